"""What explains the way down alone, as a beginning where much is missing on the way back."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from rollover.diagnosis.data.phases import drop_phases
from rollover.diagnosis.fit.jobs import Executor
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted
from rollover.diagnosis.fit.parameterisation import Candidate
from rollover.diagnosis.fit.step import Inquiry, Step
from rollover.diagnosis.inference.lack_of_fit import Mismatch
from rollover.diagnosis.pipeline import diagnose
from rollover.diagnosis.prepared import prepared
from rollover.diagnosis.selection import stepwise
from rollover.diagnosis.selection.stepwise import Taken
from rollover.diagnosis.settings import SETTINGS
from rollover.effects import Search
from rollover.proof.reference_solver import descend
from rollover.proof.rig import Rig
from rollover.recording import Recording
from rollover.scenario import load
from tests.diagnosis.drops import linear_blocks

SPEEDS = (1.3, 2.0, 3.0)
NOISE = {"ground/force_normal": 40.0, "ground/sinkage": 2e-3, "striker/acceleration_z": 0.4}
LAYER = Candidate(id="soil-layer", kind="physics", family="", search={"depth": Search(0, 1)})
MASS = Candidate(id="mass", kind="parameter", family="", search={"added": Search(0, 1)})
REBOUND = Candidate(id="soil-elastic-rebound", kind="physics", family="", search={"recovery": Search(0, 1)})


def recordings(rig: dict[str, float]) -> list[tuple[str, Recording]]:
    rng, times = np.random.default_rng(9), np.arange(-0.05, 0.4, 1e-3)
    found = []
    for k, speed in enumerate(SPEEDS):
        made = descend(Rig(speed=speed, **rig), -0.1, 0.5).channels(times)
        channels = {c: made[c] + size * rng.standard_normal(times.size) for c, size in NOISE.items()}
        name = f"r{k + 1}"
        found.append(
            (name, Recording(title=name, time=times, channels=channels, conditions={"initiation.speed": speed}))
        )
    return found


def test_a_layer_under_ground_that_springs_back() -> None:
    """Neither meets a bouncing striker by itself; a mass that moves along, as heavy as may be, led, and nothing did."""
    true = {"depth": 0.0646, "stiffness_ratio": 2.72, "recovery": 0.105, "damping_ratio": 0.06}
    rig = {"layer_depth": 0.0646, "layer_ratio": 2.72, "recovery": 0.105, "unloading_ratio": 0.06}
    found = diagnose(load("drop_test"), recordings(rig))
    assert {e.id for e in found.effects} == {"soil-layer", "soil-elastic-rebound"}
    told = {p: v.value for e in found.effects for p, v in e.parameters.items()}
    assert told == pytest.approx(true, rel=0.02)


def fit(candidates: tuple[Candidate, ...], left: float) -> Fitted:
    block = linear_blocks(np.random.default_rng(4), 1, 40, np.zeros(1))[0]
    residual = np.full(block.residual.size, np.sqrt(left / block.residual.size))
    return Fitted(candidates=candidates, x=(0.5,) * len(candidates), blocks=(replace(block, residual=residual),))


def taken(base: Fitted, found: Fitted) -> Taken:
    step = Step(base=base, fitted=found, p_value=0.0, rivals=(found,))
    left = Mismatch(p_value=0.0, cells=(), adjusted=())
    return Taken(
        base=base, steps=(step,) if found.candidates else (), fitted=found, before=left, after=left, first=step,
        at_first=cast(Any, None), scored=cast(Any, None),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("above", "over_all", "better"),
    [
        (40.0, 90.0, True),  # the layer explains the way down, and with the rebound all of it
        (80.0, 90.0, False),  # it does not explain the way down
        (40.0, 9_900.0, False),  # it explains the way down, and hardly less is left over all
    ],
)
def test_a_truncated_fit_is_a_start_if_it_gains_much(
    above: float, over_all: float, better: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    base, asked = fit((), 40_000.0), []
    before, there = taken(base, fit((MASS,), 10_000.0)), taken(base, fit((LAYER, REBOUND), over_all))

    def selected(asking: Inquiry, no_jacobian: Fitted, begun: Any = (), *, pairs: bool = True) -> Taken:
        asked.append([s.fitted.candidates[-1].id for s in begun])
        whole = asking.problem.dataset == ["whole"]
        assert pairs == whole, "all pairs over all that was recorded alone"
        return there if whole else taken(no_jacobian, fit((LAYER, REBOUND) if begun else (LAYER,), above))

    reweighted: list[Any] = []
    problem = SimpleNamespace(
        dataset=["whole"], effort=SETTINGS.forward.drops, simulations=3, with_noise_model=reweighted.append
    )
    early = SimpleNamespace(dataset=["cut"], fit=lambda *_: fit((), 900.0), simulations=4)
    monkeypatch.setattr(stepwise, "_cut", lambda *_: "cut")
    monkeypatch.setattr(stepwise, "Problem", lambda _: early)
    monkeypatch.setattr(stepwise, "estimate_time_shifts", lambda _: None)
    monkeypatch.setattr(stepwise, "forward_selection", selected)
    back = {"moves": np.inf}
    monkeypatch.setattr(stepwise, "rebound_residual", lambda *_: back["moves"])
    whole = Inquiry(
        problem=cast(Any, problem), candidates=(), groups=[], phases=[()], say=lambda _: None,
        executor=cast(Any, SimpleNamespace(fits=lambda _, tasks, __: [fit(j.candidates, 5_000.0) for j in tasks])),
    )  # fmt: skip
    found = stepwise.loading_first(whole, before)
    assert found is (there if better else before)
    ways = [[], ["soil-layer"], ["soil-elastic-rebound"], ["soil-elastic-rebound"]]
    assert asked == ways[: 4 if above < 60.0 else 1], "the way down, as it springs back, the first rise, the whole"
    assert problem.simulations == (15 if above < 60.0 else 7)
    assert reweighted == ([["whole"]] if over_all > 900.0 else []), "as it was before a way that led nowhere"
    little = taken(base, fit((MASS,), 60.0))
    assert stepwise.loading_first(whole, little) is little
    back["moves"] = 50.0
    assert stepwise.loading_first(whole, before) is before, "what rests as simulated is no reason for ten thousand"


def test_the_loading_ends_before_the_deepest_point() -> None:
    dataset, _ = prepared(load("drop_test"), recordings({}), Executor())
    phases = drop_phases(dataset[0])
    cut = stepwise._cut(dataset[0], phases, 0.9)
    assert cut is not None
    deepest = descend(Rig(speed=SPEEDS[0]), -0.1, 0.8).deepest()[0]
    for before, after in zip(dataset[0].signals, cut.signals, strict=True):
        last = dataset[0].recording.time[after.rows[-1]]
        assert 0.8 * deepest < last < deepest
        np.testing.assert_array_equal(before.values[: after.rows.size], after.values)
    assert stepwise._cut(dataset[0], ((-0.05, "approach"),), 0.9) is None
    assert stepwise._cut(dataset[0], ((-0.05, "free-fall"), (-0.045, "peak")), 0.9) is None, "five samples"


@pytest.mark.parametrize(
    ("rig", "is_back"),
    [
        ({"layer_depth": 0.05, "layer_ratio": 3.0}, False),  # far from the simulation, and as still as that
        ({"layer_depth": 0.05, "layer_ratio": 3.0, "recovery": 0.05, "unloading_ratio": 0.06}, True),
        ({"recovery": 0.05, "unloading_ratio": 0.06}, True),
    ],
)
def test_holding_ground_moves_nothing_during_unloading(rig: dict[str, float], is_back: bool) -> None:
    dataset, _ = prepared(load("drop_test"), recordings(rig), Executor())
    problem = Problem(dataset)
    base = problem.fit((), ())
    assert base is not None
    phases = [drop_phases(e) for e in dataset]
    asking = Inquiry(problem=problem, candidates=(), groups=[], phases=phases, say=lambda _: None, executor=Executor())
    beyond = base.chi2 - sum(b.residual.size for b in base.blocks)
    moved = stepwise.rebound_residual(asking, base)
    assert (
        moved > 0.1 * beyond if is_back else abs(moved) < 0.1 * SETTINGS.selection.truncated_start.least_share * beyond
    )
    early = [stepwise._cut(e, p, stepwise.TRUNCATIONS[0]) for e, p in zip(dataset, phases, strict=True)]
    cut = Problem([e for e in early if e is not None])
    above = cut.fit((), ())
    assert above is not None
    assert stepwise.rebound_residual(replace(asking, problem=cut), above) == np.inf, "nothing tells of it"
