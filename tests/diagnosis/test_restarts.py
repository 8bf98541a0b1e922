"""Fits begun otherwise, where a first look promised more than its usual shape gave."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from rollover.diagnosis.data.dataset import dataset_of
from rollover.diagnosis.fit.jobs import Executor, work
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted, ResidualBlock
from rollover.diagnosis.fit.parameterisation import Candidate
from rollover.diagnosis.fit.step import Inquiry
from rollover.diagnosis.fit.tasks import Task
from rollover.diagnosis.fit.time_shift import estimate_time_shifts
from rollover.diagnosis.forward.averaging import simulated
from rollover.diagnosis.selection.candidates import candidates_of
from rollover.diagnosis.selection.forward_step import _restarted_from_base
from rollover.diagnosis.selection.restarts import from_other_starts, with_common_time_shifts, with_known_minima
from rollover.diagnosis.selection.score_test import ScoreTest
from rollover.diagnosis.selection.screening import is_far, screen
from rollover.diagnosis.settings import SETTINGS
from rollover.effects import Search
from tests.diagnosis.drops import linear_blocks, recorded, scenario

PLAIN = Candidate(id="mass", kind="parameter", family="", search={"added": Search(-1, 1)})
SHAPED = replace(PLAIN, id="soil-adhesion", search={"stress": Search(1, 2)}, secondary={"reach": Search(1, 2)})


def begun(promised: float, gained: float) -> list[str]:
    """What is scanned where the shaped effect's slopes promised so much, of which its fit gained so much."""
    blocks = tuple(linear_blocks(np.random.default_rng(4), 2, 40, np.zeros(1)))
    base = Fitted(candidates=(), x=(), blocks=blocks)
    left = base.chi2

    def fitted(c: Candidate, gain: float) -> Fitted:
        short = tuple(replace(b, residual=b.residual * np.sqrt(max(1.0 - gain / left, 0.0))) for b in blocks)
        return Fitted(candidates=(c,), x=(0.5,), blocks=short)

    asked: list[str] = []

    def parallel_map(scan: Any, things: list[Any]) -> list[Any]:
        """Least is left at the last of the places."""
        assert sum(len(places) for _, places in things) == (40 if things else 0)
        return [(1.0 if x[1] > 0.98 else 2.0, x) for _, (*_, x) in things]

    def fits(tasks: list[Any]) -> list[None]:
        asked.extend(f"{j.how} {j.candidates[-1].id} {sorted(j.candidates[-1].search)} {j.start}" for j in tasks)
        return [None] * len(tasks)

    inquiry = SimpleNamespace(free=lambda _: [PLAIN, SHAPED], fits=fits, parallel_map=parallel_map)
    scored = ScoreTest(
        score=40.0, scores={"mass": 40.0, "soil-adhesion": promised}, null=np.zeros(9), detectable={},
        starts={"soil-adhesion": ((0.7,),)},
    )  # fmt: skip
    met = sorted([fitted(PLAIN, 10.0), fitted(SHAPED, gained)], key=lambda f: f.chi2)
    assert from_other_starts(cast(Inquiry, inquiry), base, met, scored, (0.0, 0.0)) == met
    return asked


@pytest.mark.parametrize(("promised", "gained", "scanned"), [(35.0, 5.0, 1), (35.0, 30.0, 0), (15.0, 0.0, 0)])
def test_a_disappointing_candidate_is_fitted_with_its_shape(promised: float, gained: float, scanned: int) -> None:
    assert begun(promised, gained) == ["fit soil-adhesion ['reach', 'stress'] (0.7, 0.9875)"] * scanned


def test_a_discontinuous_effect_is_scanned_not_linearised() -> None:
    """The least of adhesion does something already: what moves along stays on the face."""
    known = {"effects.soil-elastic-rebound.recovery": 0.1, "effects.soil-elastic-rebound.damping_ratio": 0.1}
    made = recorded({**known, "effects.soil-adhesion.stress": 4.6e4}, speeds=(1.5, 2.5), rate=1000.0, noise=0.1)
    found = [dataset_of(name, *simulated(scenario().replaced(known), r)) for name, r in made]
    problem = Problem([e for e in found if e is not None])
    estimate_time_shifts(problem)
    base = problem.fit((), ())
    assert base is not None
    assert not is_far(problem, base)  # from there all places are looked at
    c = next(c for c in candidates_of(problem.dataset, (), "drop") if c.id == "soil-adhesion")
    led = replace(c, id="soil-crust")  # any that is not
    assert (c.is_discontinuous, led.is_discontinuous) == (True, False)
    scored = ScoreTest(score=9.0, scores={c.key: 9.0}, null=np.zeros(9), detectable={}, starts={c.key: ((0.01,),)})
    inquiry = Inquiry(
        problem=problem, candidates=(c,), groups=[[0], [1]], phases=[], say=lambda _: None, executor=Executor()
    )
    (seen,) = screen(inquiry, base, [c], [0, 1], [b.shift for b in base.blocks], scored)
    nearest = min(c.starts(), key=lambda x: abs(np.log(c.values(x)["stress"] / 4.6e4)))
    assert seen.starts[0] == nearest
    assert c.values(nearest)["stress"] == pytest.approx(8.14e4, rel=1e-3)  # of five over four decades


@pytest.mark.parametrize(("score", "combed"), [(50.0, True), (30.0, False)])
def test_the_best_oscillatory_effect_is_scanned_in_frequency(score: float, combed: bool) -> None:
    oscillatory = replace(
        PLAIN, id="structural-compliance", search={"stiffness": Search(1e4, 1e7, "log"), "damping": Search(1.0, 1e4)}
    )
    blocks = tuple(
        replace(b, residual=9.0 * b.residual) for b in linear_blocks(np.random.default_rng(4), 2, 40, np.zeros(1))
    )
    best = Fitted(candidates=(PLAIN,), x=(0.5,), blocks=blocks)
    astray = Fitted(
        candidates=(oscillatory,), x=(0.5, 0.5), blocks=tuple(replace(b, residual=2.0 * b.residual) for b in blocks)
    )
    asked: list[str] = []

    def fits(tasks: list[Any]) -> list[None]:
        asked.extend(f"{j.how} {j.candidates[-1].id}" for j in tasks)
        return [None] * len(tasks)

    inquiry = SimpleNamespace(
        free=lambda _: [PLAIN, oscillatory], fits=fits, parallel_map=lambda scan, things: [None] * len(things)
    )
    scored = ScoreTest(score=50.0, scores={"mass": 40.0, oscillatory.key: score}, null=np.zeros(9), detectable={})
    assert from_other_starts(cast(Inquiry, inquiry), best, [best, astray], scored, (0.0, 0.0)) == [best, astray]
    assert asked == ["polish structural-compliance", "time structural-compliance"] * combed


def test_a_time_shift_is_that_of_the_lowest_minimum() -> None:
    made = recorded({}, speeds=(1.5, 2.5), rate=1000.0, noise=0.01)
    found = [dataset_of(name, *simulated(scenario(), r)) for name, r in made]
    problem = Problem([e for e in found if e is not None])
    estimate_time_shifts(problem)

    def clocked(c: Candidate, *late: float) -> Fitted:
        blocks = [problem.block(r, (c,), (0.5,), problem.shifts[r] + s, 0.0) for r, s in enumerate(late)]
        return Fitted(candidates=(c,), x=(0.5,), blocks=tuple(b for b in blocks if b is not None))

    lead, late = clocked(PLAIN, 0.0, 0.0), clocked(replace(PLAIN, own={"added": 0.0}), 0.0, 2e-3)
    alike = clocked(PLAIN, 1e-5, 0.0)
    asked: list[Task] = []

    def fits(tasks: list[Task]) -> list[Fitted | None]:
        asked.extend(tasks)
        return [work(problem, task) for task in tasks]

    inquiry = cast(Inquiry, SimpleNamespace(problem=problem, fits=fits))
    assert with_common_time_shifts(inquiry, []) == []  # nothing is near where each leaves more than the base
    kept, moved, same = with_common_time_shifts(inquiry, [lead, late, alike])
    assert kept is lead
    assert same is alike
    assert [(task.how, task.shifts) for task in asked] == [("time", tuple(problem.shifts))]
    assert abs(moved.blocks[1].shift - problem.shifts[1]) < 1e-4
    assert moved.chi2 < late.chi2


def test_a_misled_fit_restarts_and_goes_on_if_it_gains() -> None:
    """The base leaves 400 and the best 200: one comes to 290 in a few rounds and to 250 in the end, one to 310."""
    asked: list[Task] = []

    def fitted(id: str, left: float, x: tuple[float, ...]) -> Fitted:
        c = replace(PLAIN, id=id)
        block = ResidualBlock(
            residual=np.full(4, np.sqrt(left / 4.0)), J=np.zeros((4, len(x))), slope=np.zeros(4), shift=0.0, prior=1.0
        )
        return Fitted(candidates=(PLAIN, c)[-len(x) :], x=x, blocks=(block,))

    def fits(tasks: list[Task]) -> list[Fitted]:
        asked.extend(tasks)
        ends = {
            ("inertia", SETTINGS.selection.forward_step.short_rounds): 290.0,
            ("inertia", None): 250.0,
            ("air-drag", SETTINGS.selection.forward_step.short_rounds): 310.0,
        }
        return [fitted(j.candidates[-1].id, ends[j.candidates[-1].id, j.rounds], j.start) for j in tasks]

    base = fitted("mass", 400.0, (0.5,))
    astray = [fitted("inertia", 900.0, (0.4, 0.9)), fitted("air-drag", 700.0, (0.4, 0.8))]
    problem = SimpleNamespace(again=lambda f: f)
    inquiry = cast(Inquiry, SimpleNamespace(fits=fits, problem=problem))
    scored = ScoreTest(score=1.0, scores={}, null=np.zeros(1), detectable={}, starts={"inertia": ((0.7,),)})
    found = _restarted_from_base(inquiry, base, [fitted("slope", 200.0, (0.5, 0.2)), *astray], scored)
    assert [(f.candidates[-1].id, f.chi2) for f in found] == [("inertia", 250.0), ("air-drag", 310.0)]
    assert [j.start for j in asked] == [(0.5, 0.7), (0.5, 0.8), (0.5, 0.7)]


def test_a_minimum_that_another_noise_led_to_is_kept() -> None:
    """Of 900 that the base leaves: crust 700 here and 90 from the other place, layer 400 here and no less from there.

    What was not fitted here is fitted if it leaves less than 1.5 times the best.
    """
    left = {"soil-crust": 90.0, "soil-layer": 500.0, "guide-friction": 120.0, "impact-speed": 650.0, "mass": 10.0}

    def fitted(id: str, chi2: float, x: float, *beside: Candidate) -> Fitted:
        w = np.full(400, np.sqrt(chi2 / 400.0))
        block = ResidualBlock(residual=w, J=np.zeros((400, 1)), slope=np.zeros(400), shift=0.0, prior=1.0)
        return Fitted(candidates=(*beside, replace(PLAIN, id=id)), x=(x,), blocks=(block,))

    asked: list[Task] = []

    def fits(tasks: list[Task]) -> list[Fitted]:
        asked.extend(tasks)
        return [fitted(j.candidates[-1].id, left[j.candidates[-1].id], j.start[-1]) for j in tasks]

    base = replace(fitted("mass", 900.0, 0.5), candidates=(), x=())
    here = [fitted("soil-layer", 400.0, 0.2), fitted("soil-crust", 700.0, 0.2)]
    known = [fitted(id, 1.0, 0.7) for id in ("soil-crust", "soil-layer", "guide-friction", "impact-speed")]
    known += [fitted("mass", 1.0, 0.7, PLAIN), fitted("soil-stiffness", 1.0, 0.7)]  # beside another, and not looked for
    free = [replace(PLAIN, id=id) for id in left]
    inquiry = cast(Inquiry, SimpleNamespace(known=known, fits=fits, free=lambda _: free))
    found = with_known_minima(inquiry, base, here)
    assert [(f.candidates[-1].id, round(f.chi2, 6), f.x) for f in found] == [
        ("soil-crust", 90.0, (0.7,)),
        ("guide-friction", 120.0, (0.7,)),
        ("soil-layer", 400.0, (0.2,)),
    ]
    assert [(j.candidates[-1].id, j.start) for j in asked] == [(f.candidates[-1].id, (0.7,)) for f in known[:4]]
