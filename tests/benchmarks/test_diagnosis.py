"""What a diagnosis costs and says, beside PySINDy on the same residual force and a polynomial that fits anything.

    make bench, or  pytest -m benchmark tests/benchmarks/test_diagnosis.py -s

Fixed cases of the proof. Gains are ln(E_before/E_after) of the misfit over the noise in the recorded channels, each
condition left out in turn and simulated. The two others are fitted to the means of the residual force over windows of
the way down; their gain in these, for which nothing has to be simulated, stands beside it. Nothing is asserted about
time.
"""

from __future__ import annotations

import importlib
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from rollover.diagnosis import Diagnosis, diagnose
from rollover.diagnosis.data.dataset import dataset_of
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.parameterisation import Candidate
from rollover.diagnosis.fit.time_shift import estimate_time_shifts
from rollover.diagnosis.forward.averaging import simulated
from rollover.diagnosis.forward.forward_model import set_up
from rollover.diagnosis.inference.residual_law import Balance, balances
from rollover.diagnosis.io import recordings_in
from rollover.proof.generator import Order, make
from rollover.proof.handover import write_case
from rollover.scenario import load

Array = NDArray[np.float64]
CASES = (
    ("single", "soil-viscous-damping"),
    ("single", "soil-layer"),
    ("single", "sensor-gain"),
    ("outside", "outside:resonance"),
    ("null", ""),
)
POWERS = tuple((a, b) for a in range(4) for b in range(4 - a))  # of depth and speed, degree 3
ROUNDS = 4  # in which a time shift is found
pytestmark = pytest.mark.benchmark


def case(kind: str, effect: str) -> Any:
    """The first case of its kind with six drops, load cell, depth and acceleration."""
    wanted = {"ground/force_normal", "ground/sinkage", "striker/acceleration_z"}
    for index in range(200):
        made = make(Order(index=index, seed=17, kind=kind, ids=(effect,) if effect else ()))
        if len(made.recordings) == 6 and wanted <= set(made.recordings[0].channels):
            return made
    raise AssertionError(effect)


Method = Callable[[Array, Array], tuple[Array, str]]  # means of all powers (k, powers), of the force (k,) -> c, words


def powers(X: Array) -> Array:
    """All products of powers of depth and speed over their largest, (n, 2) -> (n, powers)."""
    z, v = X.T
    return np.stack([z**a * v**b for a, b in POWERS], axis=1)


def by_squares(means: Array, force: Array) -> tuple[Array, str]:
    """A dense polynomial in depth and speed."""
    return np.linalg.lstsq(means, force, rcond=1e-8)[0], "nothing: coefficients of z^a v^b"


def by_sindy(means: Array, force: Array) -> tuple[Array, str]:
    """PySINDy's sparse regression over the powers of its polynomial library."""
    import pysindy

    library = pysindy.PolynomialLibrary(degree=3).fit(np.zeros((1, 2)))
    order = [POWERS.index((int(a), int(b))) for a, b in library.powers_]
    optimiser = pysindy.STLSQ(threshold=0.05 * float(np.std(force)), normalize_columns=False, alpha=1e-3)
    optimiser.fit(means[:, order], force[:, None])
    weights = np.asarray(optimiser.coef_).ravel()
    names = [n for n, w in zip(library.get_feature_names(["z", "v"]), weights, strict=True) if w != 0.0]
    found = np.zeros(len(POWERS))
    found[order] = weights
    return found, " + ".join(names) or "nothing"


def gains(problem: Problem, every: list[Balance], method: Method) -> tuple[float, float, str]:
    """ln(E_before/E_after) in recorded channels and in means of the force, conditions left out; what the whole says."""
    scale = np.array([max(float(b.depth.max()) for b in every), max(float(b.speed.max()) for b in every)])
    means = [b.weights @ powers(np.stack([b.depth, b.speed], axis=1) / scale) for b in every]
    squares = np.zeros((2, 2))  # of channels and of the force, before and after
    for condition in dict.fromkeys(b.condition for b in every):
        kept = [k for k, b in enumerate(every) if b.condition != condition]
        c, _ = method(np.concatenate([means[k] for k in kept]), np.concatenate([every[k].force for k in kept]))
        law = Candidate(
            id="polynomial",
            kind="physics",
            family="",
            search={},
            fixed={"depth": scale[0], "speed": scale[1]} | {f"z{a}v{b}": c[k] for k, (a, b) in enumerate(POWERS)},
        )
        for k, b in enumerate(every):
            if b.condition == condition:
                squares[1] += np.sum(b.force**2), np.sum((b.force - means[k] @ c) ** 2)
        for r, e in enumerate(problem.dataset):
            if (e.condition or e.name) == condition:
                without = problem.clocked(r, (), (), problem.shifts[r], ROUNDS)
                beside = problem.clocked(r, (law,), (), problem.shifts[r], ROUNDS)
                squares[0] += without.total, np.inf if beside is None else beside.total
    found = 0.5 * np.log(squares[:, 0] / squares[:, 1])
    words = method(np.concatenate(means), np.concatenate([b.force for b in every]))[1]
    return float(found[0]), float(found[1]), words


def told(found: Diagnosis) -> tuple[float, str]:
    """Held-out gain of the explanation or of the law found by regression, and its name."""
    if found.empirical is not None:
        return found.empirical.held_out_gain, f"{found.verdict}: {found.empirical.law}"
    before, after = found.before["held_out"].nrmse, found.after["held_out"].nrmse
    names = ", ".join(e.id for e in found.effects)
    return float(np.log(before / after)), f"{found.verdict}{': ' if names else ''}{names}"


@pytest.mark.parametrize(("kind", "effect"), CASES, ids=[effect or kind for kind, effect in CASES])
def test_a_diagnosis_beside_pysindy_and_a_polynomial(kind: str, effect: str) -> None:
    pytest.importorskip("pysindy", reason="needs the benchmark group: uv sync --group benchmark")
    importlib.import_module("tests.benchmarks.polynomial")  # only here: it stays in the table of effects
    with tempfile.TemporaryDirectory() as folder:
        write_case(case(kind, effect), Path(folder, "case"))
        scenario, recordings = load(Path(folder, "case", "scenario.yaml")), recordings_in(Path(folder, "case"))
    began = time.process_time()
    found = diagnose(scenario, recordings)
    spent = time.process_time() - began
    every = [dataset_of(name, *simulated(scenario, r)) for name, r in recordings]
    kept = [e for e in every if e is not None]
    forces = balances([set_up(scenario, e.recording) for e in kept], kept)
    assert len(forces) > 2  # a way down that is too short for windows has none
    problem = Problem(kept)
    estimate_time_shifts(problem)
    gain, says = told(found)
    rows = [("diagnose", gain, np.nan, says, 1.0)]
    for name, method in (("pysindy", by_sindy), ("polynomial", by_squares)):
        began = time.process_time()
        rows.append((name, *gains(problem, forces, method), (time.process_time() - began) / spent))
    print(f"\n{effect or kind}: {found.simulations} simulations, {1e3 * spent / found.simulations:.2f} ms of CPU each")
    for name, value, force, words, share in rows:
        of_force = "" if np.isnan(force) else f"(of the force {force:+.2f})"
        print(f"  {name:10s} held-out gain {value:+6.2f} {of_force:20s} time {share:8.5f}   {words}")
    assert found.simulations > 0
    assert not any(np.isnan(value) for _, value, _, _, _ in rows)
