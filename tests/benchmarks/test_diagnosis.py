"""What a diagnosis costs and says, beside PySINDy on the same residual force and a polynomial that fits anything.

    make bench, or  pytest -m benchmark tests/benchmarks/test_diagnosis.py -s

Fixed cases of the proof. Gains are ln(E_before/E_after) with each condition left out in turn: of the diagnosis in the
recorded channels, simulated; of the two others in the means of the residual force over windows of the way down, which
is the easier question, as nothing has to be simulated from its start. Nothing is asserted about time.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from rollover.diagnosis import Diagnosis, diagnose
from rollover.diagnosis.account import recordings_in
from rollover.diagnosis.bins import simulated
from rollover.diagnosis.evidence import evidence_of
from rollover.diagnosis.simulator import set_up
from rollover.diagnosis.weak import Balance, balances
from rollover.proof.folder import write_case
from rollover.proof.generator import Order, make
from rollover.scenario import load

Array = NDArray[np.float64]
CASES = (
    ("single", "soil-viscous-damping"),
    ("single", "soil-layer"),
    ("single", "sensor-gain"),
    ("outside", "outside:resonance"),
    ("null", ""),
)
DEGREE = 3
pytestmark = pytest.mark.benchmark


def case(kind: str, effect: str) -> Any:
    """The first case of its kind with six drops, load cell, depth and acceleration."""
    wanted = {"ground/force_normal", "ground/sinkage", "striker/acceleration_z"}
    for index in range(200):
        made = make(Order(index=index, seed=17, kind=kind, ids=(effect,) if effect else ()))
        if len(made.recordings) == 6 and wanted <= set(made.recordings[0].channels):
            return made
    raise AssertionError(effect)


Terms = Callable[[Array], Array]  # of depth and speed over their largest, (n, 2) -> (n, terms)


def polynomial(X: Array) -> Array:
    """All products of powers up to `DEGREE`, (n, terms)."""
    z, v = X.T
    return np.stack([z**a * v**b for a in range(DEGREE + 1) for b in range(DEGREE + 1 - a)], axis=1)


def by_squares(X: Array, means: Callable[[Terms], Array], y: Array) -> tuple[Terms, Array, str]:
    """A dense polynomial in depth and speed."""
    return polynomial, np.linalg.lstsq(means(polynomial), y, rcond=1e-8)[0], "nothing: coefficients of z^a v^b"


def by_sindy(X: Array, means: Callable[[Terms], Array], y: Array) -> tuple[Terms, Array, str]:
    """PySINDy's sparse regression over its polynomial library."""
    import pysindy

    library = pysindy.PolynomialLibrary(degree=DEGREE)
    library.fit(X)

    def terms(other: Array) -> Array:
        return np.asarray(library.transform(other))

    optimiser = pysindy.STLSQ(threshold=0.05 * float(np.std(y)), normalize_columns=False, alpha=1e-3)
    optimiser.fit(means(terms), y[:, None])
    weights = np.asarray(optimiser.coef_).ravel()
    names = [n for n, w in zip(library.get_feature_names(["z", "v"]), weights, strict=True) if w != 0.0]
    return terms, weights, " + ".join(names) or "nothing"


def gain(every: list[Balance], method: Any) -> tuple[float, str]:
    """Mean over conditions of ln(rms without/rms with) of the residual force, and what the whole fit says."""
    scale = np.array([max(float(b.depth.max()) for b in every), max(float(b.speed.max()) for b in every)])

    def states(b: Balance) -> Array:
        return np.asarray(np.stack([b.depth, b.speed], axis=1) / scale)

    def fitted(some: list[Balance]) -> tuple[Terms, Array, str]:
        def means(terms: Terms) -> Array:
            return np.concatenate([b.weights @ terms(states(b)) for b in some])

        found: tuple[Terms, Array, str] = method(
            np.concatenate([states(b) for b in some]), means, np.concatenate([b.force for b in some])
        )
        return found

    logs = []
    for out in every:
        terms, weights, _ = fitted([b for b in every if b is not out])
        left = out.force - out.weights @ terms(states(out)) @ weights
        logs.append(0.5 * np.log(np.mean(out.force**2) / np.mean(left**2)))
    return float(np.mean(logs)), fitted(every)[2]


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
    with tempfile.TemporaryDirectory() as folder:
        write_case(case(kind, effect), Path(folder, "case"))
        scenario, recordings = load(Path(folder, "case", "scenario.yaml")), recordings_in(Path(folder, "case"))
    began = time.process_time()
    found = diagnose(scenario, recordings)
    spent = time.process_time() - began
    every = [evidence_of(name, *simulated(scenario, r)) for name, r in recordings]
    kept = [e for e in every if e is not None]
    forces = balances([set_up(scenario, e.recording) for e in kept], kept)
    assert len(forces) > 2  # a way down that is too short for windows has none
    rows: list[tuple[str, float, str, float]] = [("diagnose", *told(found), 1.0)]
    for name, method in (("pysindy", by_sindy), ("polynomial", by_squares)):
        began = time.process_time()
        rows.append((name, *gain(forces, method), (time.process_time() - began) / spent))
    print(f"\n{effect or kind}: {found.simulations} simulations, {1e3 * spent / found.simulations:.2f} ms of CPU each")
    for name, value, says, share in rows:
        print(f"  {name:10s} held-out gain {value:+6.2f}   time over diagnose {share:8.5f}   {says}")
    assert found.simulations > 0
    assert all(np.isfinite(value) for _, value, _, _ in rows)
