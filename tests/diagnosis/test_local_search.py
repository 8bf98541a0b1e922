"""Fits that are followed where slopes mislead: behind a cliff, and beside a kink."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from rollover.comparison.synthesis import synthetic
from rollover.diagnosis import diagnose
from rollover.diagnosis.data.dataset import dataset_of
from rollover.diagnosis.data.phases import phases_of
from rollover.diagnosis.fit import levenberg_marquardt, local_search, threshold_scan
from rollover.diagnosis.fit.jobs import Executor
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted
from rollover.diagnosis.fit.local_search import ended, with_time_shift_search
from rollover.diagnosis.fit.model_variants import with_fitted_secondary
from rollover.diagnosis.fit.parameterisation import coordinate, coordinates
from rollover.diagnosis.fit.step import Inquiry, Screened, Step
from rollover.diagnosis.fit.threshold_scan import threshold_ranges, with_threshold_traced
from rollover.diagnosis.fit.time_shift import estimate_time_shifts
from rollover.diagnosis.forward.averaging import simulated
from rollover.diagnosis.inference.intervals import intervals
from rollover.diagnosis.selection import restarts
from rollover.diagnosis.selection.candidates import candidates_of
from rollover.diagnosis.selection.pairs import best_subsets
from rollover.diagnosis.selection.restarts import _damping_frequency_scan
from rollover.diagnosis.selection.score_test import ScoreTest
from rollover.diagnosis.settings import SETTINGS
from rollover.dynamics.simulate import run
from rollover.effects import EFFECTS
from rollover.proof.generator import Case, make, plan
from rollover.scenario import load
from tests.diagnosis.drops import ACCELERATION, DEPTH, FORCE, recorded, scenario
from tests.diagnosis.test_fits import candidate, problem_of
from tests.physics.scenes import shipped

CHANNELS = (FORCE, DEPTH, ACCELERATION)


def problem_of_case(case: Case, folder: Path) -> Problem:
    path = folder / "scenario.yaml"
    path.write_text(case.scenario, encoding="utf-8")
    return Problem([dataset_of(str(k), *simulated(load(path), r)) for k, r in enumerate(case.recordings)])


def test_a_damping_behind_a_cliff_is_found() -> None:
    """A hopping striker: what its body does after each landing hangs on the one before."""
    true = {"stiffness": 1.888e6, "damping": 1372.0}
    hidden = {f"effects.structural-compliance.{name}": value for name, value in true.items()}
    speeds = (1.13, 2.4, 2.8, 1.98, 1.6, 3.1)
    problem = problem_of(recorded(hidden, 1, speeds=speeds, channels=CHANNELS, rate=1500.0, noise=0.005))
    c = candidate(problem, "structural-compliance")
    count = sum(e.count for e in problem.dataset)
    led_astray = problem.fit((c,), (0.5625, 0.2), shifts=[0.0] * len(speeds))
    assert led_astray is not None
    assert led_astray.chi2 > 4.0 * count
    inquiry = Inquiry(
        problem=problem,
        candidates=[c],
        groups=[[0], [1, 2, 3, 4, 5]],
        phases=[],
        say=lambda _: None,
        executor=Executor(),
    )
    scored = ScoreTest(score=9.0, scores={c.key: 9.0}, null=np.zeros(9), detectable={})
    (found,) = _damping_frequency_scan(inquiry, [led_astray], scored, [b.shift for b in led_astray.blocks])
    assert found.chi2 < 1.2 * count
    assert c.values(found.x)["stiffness"] == pytest.approx(true["stiffness"], rel=0.02)
    assert c.values(found.x)["damping"] == pytest.approx(true["damping"], rel=0.1)


def test_a_misfitted_nose_is_found_by_its_oscillation(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Damped until it hardly rings, as a share of the mass that it has not: nothing leads from there to what it is."""
    true = {"stiffness": 3.619e6, "damping": 385.3, "nose_share": 0.2545}
    hidden = {f"effects.structural-compliance.{name}": value for name, value in true.items()}
    speeds = (1.13, 1.6, 2.4)
    problem = problem_of(recorded(hidden, 1, speeds=speeds, channels=CHANNELS, rate=1500.0, noise=0.005))
    c = candidate(problem, "structural-compliance")
    astray = problem.fit(
        (c,), coordinates({"stiffness": 6.4e6, "damping": 8000.0}, c.search), shifts=[0.0] * len(speeds)
    )
    assert astray is not None
    assert astray.chi2 > 10.0 * sum(e.count for e in problem.dataset)
    inquiry = Inquiry(
        problem=problem, candidates=[c], groups=[[0], [1, 2]], phases=[], say=lambda _: None, executor=Executor()
    )
    scored = ScoreTest(score=9.0, scores={c.key: 9.0}, null=np.zeros(9), detectable={})
    (found,) = _damping_frequency_scan(inquiry, [astray], scored, [b.shift for b in astray.blocks])
    assert found.chi2 < 1.2 * sum(e.count for e in problem.dataset)
    assert found.candidates[-1].values(found.x) == pytest.approx(true, rel=0.01)
    monkeypatch.setattr(restarts, "_by_frequency", lambda *_: [])
    (near,) = _damping_frequency_scan(inquiry, [astray], scored, [b.shift for b in astray.blocks])
    assert near.chi2 > 10.0 * found.chi2


def test_the_clock_of_a_channel_is_followed_against_all_others(tmp_path: Path) -> None:
    """Its edges hold the sum of its offset and the time shifts; what else there is moves as little as noise allows."""
    case = make(next(order for order in plan(63, 20262911, ["single"]) if order.index == 45))
    (truth,) = case.truth["effects"]
    assert (truth["id"], truth["channel"]) == ("sensor-clock-offset", FORCE)
    problem = problem_of_case(case, tmp_path)
    c = candidate(problem, f"sensor-clock-offset:{FORCE}")
    begun = (coordinate(0.006138, c.search["offset"]),)
    stopped = problem.fit((c,), begun, shifts=[1.43e-4] * len(case.recordings), width=2)
    assert stopped is not None
    found = with_time_shift_search(problem, stopped)
    right = problem.fit((c,), (coordinate(truth["parameters"]["offset"], c.search["offset"]),), width=2)
    assert right is not None
    assert found.chi2 < right.chi2 + 5.0 < stopped.chi2 - 40.0
    assert c.values(found.x)["offset"] == pytest.approx(truth["parameters"]["offset"], abs=3e-5)


def test_a_fit_whose_rounds_were_too_few_is_gone_on_with() -> None:
    problem = problem_of(recorded({"effects.soil-layer.stiffness_ratio": 1.3, "effects.soil-layer.depth": 0.12}, 6))
    c = candidate(problem, "soil-layer")
    short = problem.fit((c,), (0.62, 0.4), rounds=2)
    whole = problem.fit((c,), (0.62, 0.4), width=1)
    assert short is not None
    assert whole is not None
    assert short.chi2 > whole.chi2 + 20.0
    assert ended(problem, short).chi2 < whole.chi2 + 2.0
    assert ended(problem, whole).chi2 <= whole.chi2


def test_a_nose_is_found_along_the_ridge_of_its_frequency(tmp_path: Path) -> None:
    """Little damping: hundreds of radians of ringing know k/(s (1 - s)) long before they know either."""
    case = make(next(order for order in plan(63, 20262913, ["single"]) if order.index == 7))
    true = case.truth["effects"][0]["parameters"]
    problem = problem_of_case(case, tmp_path)
    c = candidate(problem, "structural-compliance")
    share = EFFECTS[c.id].reshaped(true, "nose_share", 0.1)
    plain = problem.fit((c,), [coordinate(share[name], s) for name, s in c.search.items()])
    assert plain is not None
    assert plain.chi2 > 4.0 * sum(e.count for e in problem.dataset)
    found = with_fitted_secondary(problem, plain, [b.total for b in plain.blocks])
    assert found is not None
    assert found.chi2 < 1.1 * sum(e.count for e in problem.dataset)
    assert found.candidates[-1].along == ()
    for name, told in intervals(problem, found)[0].items():
        assert told.low <= true[name] <= told.high
        assert told.high - told.low < 0.05 * true[name]


def test_a_noses_share_moves_at_constant_frequency_and_damping() -> None:
    """w^2 = k/(M s (1 - s)), 2 zeta w = c/(M s (1 - s)): what rings freely moves the reduced mass."""
    effect = EFFECTS["structural-compliance"]
    before = {"stiffness": 2e6, "damping": 300.0, "nose_share": 0.1}
    after = effect.reshaped(before, "nose_share", 0.3)
    for name in ("stiffness", "damping"):
        w = [n[name] / (n["nose_share"] * (1.0 - n["nose_share"])) for n in (before, after)]
        assert w[1] == pytest.approx(w[0], rel=1e-12)
    problem = problem_of(recorded({}, speeds=(2.0,)))
    whole = replace(candidate(problem, "structural-compliance").whole(), along=("nose_share",))
    x = (0.4, 0.5, 0.6)
    plain, there = whole.plain(x)
    assert plain.changes(there) == pytest.approx(whole.changes(x), rel=1e-12)
    other = whole.changes((0.4, 0.5, 0.3))
    k, s = "effects.structural-compliance.stiffness", "effects.structural-compliance.nose_share"
    w = [n[k] / (n[s] * (1.0 - n[s])) for n in (whole.changes(x), other)]
    assert w[1] == pytest.approx(w[0], rel=1e-12)


def test_the_share_of_an_unweighed_nose_is_found() -> None:
    true = {"stiffness": 1e6, "damping": 500.0, "nose_share": 0.2}
    hidden = {f"effects.structural-compliance.{name}": value for name, value in true.items()}
    problem = problem_of(recorded(hidden, 3, speeds=(1.2, 2.0, 2.8), channels=CHANNELS, rate=1500.0, noise=0.005))
    c = candidate(problem, "structural-compliance")
    count = sum(e.count for e in problem.dataset)
    begun = [coordinate(true[name], s) for name, s in c.search.items()]
    plain = problem.fit((c,), begun, shifts=[0.0] * 3)
    assert plain is not None
    assert plain.chi2 > 2.0 * count
    found = with_fitted_secondary(problem, plain, [b.total for b in plain.blocks])
    assert found is not None
    assert found.chi2 < 1.1 * count
    told = found.candidates[-1].values(found.x)
    assert told == {name: pytest.approx(value, rel=0.05) for name, value in true.items()}
    reweighted = scenario().replaced({"effects.structural-compliance": {"nose_share": 0.2, "stiffness": None}})
    by_key = {c.key: c for c in candidates_of(problem.dataset, (), "drop", reweighted)}
    assert by_key["structural-compliance"].secondary == {}


def test_a_threshold_is_found_though_a_fit_ended_at_another() -> None:
    """A crust that is hardly stiffer: ends elsewhere are nearly as good, and no slope leads from one to the other."""
    true = {"thickness": 0.065, "stiffness_ratio": 1.02}
    hidden = {f"effects.soil-crust.{name}": value for name, value in true.items()}
    problem = problem_of(recorded(hidden, 2, speeds=(1.2, 1.8, 2.4, 3.0), channels=CHANNELS, rate=1500.0, noise=0.004))
    c = candidate(problem, "soil-crust")
    begun = [coordinate(v, s) for v, s in zip((0.092, 1.01), c.search.values(), strict=True)]
    ended = problem.fit((c,), begun, width=1)
    assert ended is not None
    assert abs(c.values(ended.x)["thickness"] - true["thickness"]) > 0.004
    found = min((with_threshold_traced(problem, ended, s) for s in threshold_ranges(ended)), key=lambda f: f.chi2)
    assert found.chi2 < ended.chi2 - 100.0
    assert c.values(found.x)["thickness"] == pytest.approx(true["thickness"], rel=0.01)
    assert c.values(found.x)["stiffness_ratio"] == pytest.approx(true["stiffness_ratio"], abs=0.001)
    assert all(with_threshold_traced(problem, found, s).chi2 <= found.chi2 for s in threshold_ranges(found))


def test_a_clock_is_tried_all_along_its_range(tmp_path: Path) -> None:
    """Each edge that a drift moves past a sample leaves a valley of its own; fits had ended in the sixth part of it."""
    case = make(next(order for order in plan(63, 20263014, ["single"]) if order.index == 1))
    (truth,) = case.truth["effects"]
    assert (truth["id"], truth["channel"]) == ("sensor-clock-drift", FORCE)
    problem = problem_of_case(case, tmp_path)
    c = candidate(problem, f"sensor-clock-drift:{FORCE}")
    stopped = problem.fit((c,), (coordinate(truth["parameters"]["drift"] / 6.0, c.search["drift"]),), rounds=0)
    assert stopped is not None
    found = min((with_threshold_traced(problem, stopped, s) for s in threshold_ranges(stopped)), key=lambda f: f.chi2)
    assert found.chi2 < 0.9 * stopped.chi2
    assert c.values(found.x)["drift"] == pytest.approx(truth["parameters"]["drift"], rel=0.02)


def test_an_oscillatory_effect_is_traced_along_its_ridge(tmp_path: Path) -> None:
    case = make(next(order for order in plan(63, 20263016, ["single"]) if order.index == 25))
    problem = problem_of_case(case, tmp_path)
    c = candidate(problem, "structural-compliance").whole()
    ended = {"stiffness": 3.68794e6, "damping": 75.98, "nose_share": 0.184108}
    x = [coordinate(ended[name], s) for name, s in c.search.items()]
    stopped = problem.fit((c,), x, rounds=0, shifts=[0.0] * len(case.recordings))
    assert stopped is not None
    curved, own = c.reshaped(x)
    assert curved.plain(own)[1] == pytest.approx(x)
    assert [k for k, _, _ in threshold_ranges(stopped)] == [2, 2]
    found = min((with_threshold_traced(problem, stopped, s) for s in threshold_ranges(stopped)), key=lambda f: f.chi2)
    assert found.chi2 < stopped.chi2 - 20.0
    share = case.truth["effects"][0]["parameters"]["nose_share"]
    assert c.values(found.x)["nose_share"] == pytest.approx(share, rel=0.006)


def test_a_pair_that_leaves_nothing_is_named_by_both() -> None:
    """A crust and guide friction, recorded from full runs: these meet the crust's end a step late."""
    hidden = {"effects.soil-crust.thickness": 0.03, "effects.guide-friction.force": 40.0}
    made = []
    for seed, speed in enumerate((1.2, 1.5, 2.0, 2.5, 3.0, 3.4), start=1):
        conditions = {"initiation.speed": speed}
        full = run(shipped("drop_test").replaced({**conditions, **hidden})).recording
        made.append((f"v{speed}", synthetic(full, channels=CHANNELS, rate=1000.0, seed=seed, conditions=conditions)))
    found = diagnose(shipped("drop_test"), made)
    assert {e.id for e in found.effects} == {"soil-crust", "guide-friction"}
    assert not found.remaining_significant
    by = {e.id: e.parameters for e in found.effects}
    assert by["soil-crust"]["thickness"].value == pytest.approx(0.03, rel=0.01)
    assert by["guide-friction"]["force"].value == pytest.approx(40.0, rel=0.05)
    assert found.after["held_out"].nrmse == pytest.approx(1.0, abs=0.03)


def test_a_shape_that_one_recording_alone_hangs_on_is_found() -> None:
    """A face that springs back and is held: one drop of six lets go, within 5 % of the reach."""
    sprung = {"effects.soil-elastic-rebound.recovery": 0.1, "effects.soil-elastic-rebound.damping_ratio": 0.1}
    true = {"stress": 7508.0, "reach": 0.00396}
    hidden = {f"effects.soil-adhesion.{name}": value for name, value in true.items()}
    speeds = (1.621, 2.624, 1.395, 1.852, 2.123, 2.439)
    made = recorded({**sprung, **hidden}, 1, speeds=speeds, rate=1500.0, until=0.6, noise=0.003)
    base = scenario().replaced({**sprung, "simulation.duration": 0.8})
    found = diagnose(base, made)
    assert [e.id for e in found.effects] == ["soil-adhesion"]
    by = found.effects[0].parameters
    for name, value in true.items():
        assert by[name].value == pytest.approx(value, rel=0.05), name
    assert found.after["held_out"].nrmse == pytest.approx(1.0, abs=0.03)


def test_an_abrupt_effect_is_led_by_its_smooth_shape(tmp_path: Path) -> None:
    """A crust whose end leaps past samples: a fit that is stuck far from the truth comes there, another stays."""
    case = make(plan(63, 20263301, ("single",))[43])
    [true] = [e["parameters"] for e in case.truth["effects"]]
    problem = problem_of_case(case, tmp_path)
    estimate_time_shifts(problem)
    c = candidate(problem, "soil-crust")
    gains = []
    for begun in ((0.8125, 0.875), (0.0625, 0.125)):
        stuck = problem.fit((c,), begun)
        assert stuck is not None
        found = with_fitted_secondary(problem, stuck, [b.total for b in stuck.blocks])
        assert found is not None
        assert found.candidates == (c,), "its usual shape"
        gains.append(stuck.chi2 - found.chi2)
        for name, value in c.values(found.x).items():
            assert value == pytest.approx(true[name], rel=2e-3), name
    assert min(gains) >= 0.0
    assert max(gains) > 4000.0


def test_two_effects_without_a_first_are_tried_together() -> None:
    """A heavier striker with guide friction: a stiffness and the mass led, and friction beside the first."""
    hidden = {"effects.mass.added": 2.3, "effects.guide-friction.force": 31.0}
    problem = problem_of(recorded(hidden, 1, speeds=(1.4, 2.0, 2.6, 3.2), rate=1000.0, noise=0.003, channels=CHANNELS))
    c = {name: candidate(problem, name) for name in ("mass", "soil-stiffness", "guide-friction")}
    base = problem.fit((), ())
    stiffer, heavier = (problem.fit((c[name],), c[name].starts()[0]) for name in ("soil-stiffness", "mass"))
    assert base is not None
    assert stiffer is not None
    assert heavier is not None
    beside = problem.fit((*stiffer.candidates, c["guide-friction"]), (*stiffer.x, *c["guide-friction"].starts()[0]))
    assert beside is not None
    count = sum(e.count for e in problem.dataset)
    assert min(stiffer.chi2, heavier.chi2, beside.chi2) > 1.5 * count
    first = Step(base=base, fitted=stiffer, p_value=0.0, rivals=(stiffer, heavier))
    then = Step(base=stiffer, fitted=beside, p_value=0.0, rivals=(beside,))
    scored = ScoreTest(score=9.0, scores={"guide-friction": 9.0}, null=np.zeros(9), detectable={})
    guide = Screened(candidate=c["guide-friction"], starts=tuple(c["guide-friction"].starts()), chi2=9.0, potential=0.0)
    phases = [phases_of(e) for e in problem.dataset]
    inquiry = Inquiry(
        problem=problem, candidates=[*c.values()], groups=[], phases=phases, say=lambda _: None, executor=Executor()
    )
    alone = best_subsets(inquiry, [replace(first, screened=(guide,))], scored, stiffer)
    assert alone is not None  # what scored most need not have led anything
    assert alone[0][-1].fitted.label == "mass + guide-friction"
    found = best_subsets(inquiry, [first, then], scored, beside)
    assert found is not None
    (one, both), left = found
    assert one.fitted.label == "mass"
    assert both.base is one.fitted
    assert both.fitted.label == "mass + guide-friction"
    assert both.fitted.chi2 < 1.1 * count
    assert left.p_value > 0.01
    assert c["mass"].values(both.fitted.x[:1])["added"] == pytest.approx(2.3, rel=0.05)
    assert c["guide-friction"].values(both.fitted.x[1:])["force"] == pytest.approx(31.0, rel=0.05)


def test_a_fit_is_ended_finely_whatever_others_may_leave(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rounds that gain less than tells two fits apart are saved, until a fit is the last one."""
    hidden = {"effects.soil-viscous-damping.damping": 900.0}
    problem = problem_of(recorded(hidden, 2, speeds=(1.6, 2.6), channels=CHANNELS, rate=1500.0, noise=0.005))
    c, begun = candidate(problem, "soil-viscous-damping"), (0.05,)
    usual = problem.fit((c,), begun)
    monkeypatch.setattr(levenberg_marquardt, "TUNING", replace(levenberg_marquardt.TUNING, converged_gain=1e5))
    coarse, fine = problem.fit((c,), begun), problem.fit((c,), begun, finely=True)
    assert usual is not None
    assert coarse is not None
    assert fine is not None
    assert fine.chi2 - 1e-6 < usual.chi2 < fine.chi2 + 1.0
    assert coarse.chi2 > fine.chi2 + 1.0
    assert ended(problem, coarse).chi2 < fine.chi2 + 0.05


def test_a_start_that_beats_the_fit_in_few_rounds_goes_on() -> None:
    """Short fits to few recordings, one from the fit itself: what it gains on these alone others must gain too."""
    block = SimpleNamespace(shift=0.0)
    fitted = cast(Fitted, SimpleNamespace(candidates=(), x=(0.5,), blocks=(block, block, block)))
    leaves = {0.5: 90.0, 0.1: 95.0, 0.2: 80.0, 0.3: None, 0.4: 89.0}
    asked = []

    def short(_: Any, x: tuple[float, ...], **how: Any) -> Any:
        asked.append(how["only"])
        left = leaves[x[0]]
        return None if left is None else SimpleNamespace(x=(x[0] + 0.01,), total=left)

    problem = cast(Problem, SimpleNamespace(fit=short))
    found = threshold_scan._best_start(problem, fitted, [(0.1,), (0.2,), (0.3,), (0.4,)], (0, 2))
    assert [round(x, 9) for (x,) in found] == [0.21, 0.41]
    assert asked == 5 * [(0, 2)]


@pytest.mark.parametrize(
    ("dips", "began", "met"),
    [
        ((0.0, 9e-4), 7e-4, 0.0),  # where its clock is as stated
        ((4e-4, 9e-4), 4.1e-4, 4e-4),  # where the scenario as it is was met best
        ((5e-4, 9e-4), 1.2e-3, 9e-4),  # nowhere near a better one: where it was
    ],
)
def test_a_time_shift_in_another_minimum_restarts(dips: tuple[float, float], began: float, met: float) -> None:
    """Edges leave it in the second of two dips, 0.1 ms to either side, that leaves 11 where the first leaves 10."""

    def block(_r: int, _c: Any, _x: Any, shift: float, _step: float, *, clock: bool) -> Any:
        left = min(k + min(abs(shift - dip) / 1e-4, 1.0) for k, dip in enumerate(dips)) + 10.0
        return SimpleNamespace(total=left, shift=shift, prior=1e-3)

    problem = cast(Problem, SimpleNamespace(block=block, shifts=[began]))
    found = local_search._tried(problem, 0, (), (), block(0, (), (), 9e-4, 0.0, clock=False))
    assert found.shift == pytest.approx(met, abs=SETTINGS.fit.local_search.shift_step_least)
