"""Strong effects: what no multiple of a little of them does, where it is tried, and how it is fitted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest

from rollover.diagnosis.fit.jobs import Executor
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted
from rollover.diagnosis.fit.parameterisation import Candidate
from rollover.diagnosis.fit.step import Inquiry
from rollover.diagnosis.fit.tasks import Task
from rollover.diagnosis.selection import screening
from rollover.diagnosis.selection.forward_step import _robust_short_fits
from rollover.diagnosis.selection.screening import screen
from rollover.diagnosis.settings import SETTINGS
from rollover.effects import Search
from tests.diagnosis import test_ensemble
from tests.diagnosis.test_ensemble import STEP
from tests.diagnosis.test_scan import CHANNEL, SLOPE, TIME, N, Wave, problem_of


class Tipping(Wave):
    """A slope moves a wave of its own, until at 60 the vehicle tips, `after`; mass moves a little of what that does."""

    def predict(self, changes: Mapping[str, Any], shift: float) -> dict[str, np.ndarray]:
        self.runs += 1
        x, m = changes.get("effects.slope.angle", 0.0), changes.get("effects.mass.factor", 0.0)
        tipped = self.after * np.sin(30.0 * TIME)
        return {CHANNEL: tipped * (x > 60.0) + 0.002 * self.after * x * np.sin(200.0 * TIME) + 0.05 * m * tipped}


MASS = replace(SLOPE, id="mass", search={"factor": Search(-2.0, 2.0)})


def tipped(size: float) -> tuple[Problem, Fitted]:
    """Four recordings of a vehicle that tipped, which moves them by so many times their noise, and the base."""
    problem, base = problem_of((0.0,) * 4, (size,) * 4)
    for e in problem.dataset:
        object.__setattr__(e, "simulator", Tipping(size))
    problem.measured = [size * np.sin(30.0 * TIME) + w for w in np.random.default_rng(1).standard_normal((4, N))]
    problem.heavy_tailed = False
    blocks = [replace(b, residual=w) for b, w in zip(base.blocks, problem.measured, strict=True)]
    return problem, replace(base, blocks=tuple(blocks))


def test_an_effect_that_shows_only_when_strong_is_found() -> None:
    problem, base = tipped(20.0)
    mass, groups = MASS, [[r] for r in range(4)]
    found = screening.score_candidates(problem, base, [mass, SLOPE], groups)
    assert found.scores["mass"] > 100.0 * found.scores["slope"]
    assert found.far == {"slope": ((0.95,),)}  # a mass leaves 0.91^2 of it, more than is followed
    assert found.leading[0] == "slope"
    assert [c.key for c in found.ranked([mass, SLOPE])] == ["slope", "mass"]
    inquiry = Inquiry(
        problem=problem, candidates=(SLOPE,), groups=[], phases=[], say=lambda _: None, executor=Executor()
    )
    begun = screen(inquiry, base, [SLOPE], [0, 1], [0.0] * 4, found)[0]
    assert (0.95,) in begun.starts
    assert screen(inquiry, base, [SLOPE], [0, 1], [0.0] * 4, replace(found, far={}))[0].starts != begun.starts
    problem.heavy_tailed = True
    assert (
        screening.score_candidates(problem, base, [mass, SLOPE], groups).far == {}
    )  # of what perturbed runs so far, chance may be all


def test_where_known_runs_must_do_no_strong_effect_is_tried() -> None:
    problem, base = tipped(20.0)
    groups = [[r] for r in range(4)]
    screening.score_candidates(problem, base, [MASS, SLOPE], groups, base, [0, 1])
    known = problem.simulations
    assert screening.score_candidates(problem, base, [MASS, SLOPE], groups, base, [0, 1]).far == {}
    assert problem.simulations == known
    assert list(screening.score_candidates(problem, base, [MASS, SLOPE], groups).far) == ["slope"]
    assert problem.simulations > known


def test_a_start_worse_on_the_worst_recording_is_dropped(monkeypatch: pytest.MonkeyPatch) -> None:
    """x beyond 60 tips as was recorded, any other place moves what no recording did."""
    problem, base = tipped(20.0)
    problem.measured[2] = 1.5 * problem.measured[2]
    asked: dict[int, set[float]] = {1: set(), 2: set()}
    chi2_at = screening.chi2_at

    def counted(problem: Problem, candidates: Any, x: Any, shifts: Any, use: Any) -> float | None:
        for r in use:
            asked[r] |= {round(float(v), 9) for v in x}
        return chi2_at(problem, candidates, x, shifts, use)

    monkeypatch.setattr(screening, "chi2_at", counted)
    assert screening.strong_starts(problem, base, [SLOPE], [1, 2]) == {"slope": ((0.95,),)}
    assert asked[2] == {round(x, 9) for (x,) in SLOPE.strong()}
    assert asked[1] == {0.95}


@pytest.mark.parametrize(("full", "masked"), [(5.0, 20.0), (20.0, 5.0), (20.0, 20.0)])
def test_a_start_better_on_the_worst_recording_goes_to_all(
    full: float, masked: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    def chi2_at(problem: Problem, candidates: Any, x: Any, *_: Any) -> float:
        return 10.0 if not x else 30.0 if x != (0.95,) else masked if problem.heavy_tailed else full

    monkeypatch.setattr(screening, "chi2_at", chi2_at)
    problem, base = tipped(20.0)
    assert screening.strong_starts(problem, base, [SLOPE], [1, 2]) == ({} if full == masked else {"slope": ((0.95,),)})


def test_a_strong_effect_is_fitted_robustly_compared_in_full() -> None:
    """Before the impact x sets a wave, after it which of many courses is taken: in full the nearest dip ends a fit."""

    class Parting:
        effort = SETTINGS.forward.runs

        def predict(self, changes: Mapping[str, Any], shift: float) -> dict[str, np.ndarray]:
            x, time = changes.get("effects.slope.angle", 0.0), STEP * np.arange(test_ensemble.N) - shift
            early = x * np.sin(9.0 * time)
            return {
                c: np.where(time < test_ensemble.IMPACT, early, 4.0 * np.sin(150.0 * x + k) * np.cos(20.0 * time))
                for k, c in enumerate(test_ensemble.CHANNELS)
            }

    truth, rng, simulator = 0.7, np.random.default_rng(2), Parting()
    quiet = replace(test_ensemble.blown(), simulator=cast(Any, simulator))
    dataset = []
    for _ in range(2):
        signals = []
        for s, values in zip(
            quiet.signals, simulator.predict({"effects.slope.angle": truth}, 0.0).values(), strict=True
        ):
            there = values + 0.2 * rng.standard_normal(values.size)
            there[quiet.early[: values.size] == 0.0] *= -1.0  # it went another way, whatever x is
            signals.append(replace(s, values=there))
        dataset.append(replace(quiet, signals=tuple(signals)))
    problem = Problem(dataset)
    problem.heavy_tailed = False
    strength = replace(SLOPE, search={"angle": Search(0.0, 1.0)}, null=(0.0,))
    task = Task(candidates=(strength,), start=(0.3,), shifts=(0.0, 0.0), only=(0, 1), fixed_shifts=True)
    with Executor() as executor:
        inquiry = Inquiry(
            problem=problem, candidates=(strength,), groups=[], phases=[], say=lambda _: None, executor=executor
        )
        plain, smooth = inquiry.fits([task])[0], _robust_short_fits(inquiry, [task], (0, 1))[0]
    assert plain is not None
    assert abs(plain.x[0] - truth) > 0.1
    assert smooth.x[0] == pytest.approx(truth, abs=0.02)
    assert all(b.heavy_tail is None for b in smooth.blocks)  # it stands in full
    assert not any(b.slope.any() for b in smooth.blocks)  # with clocks where they say, as other first fits
    assert not problem.heavy_tailed


def test_an_effect_is_strong_at_each_end_of_its_range() -> None:
    assert SLOPE.strong() == [(0.58,), (0.42,), (0.5 - 0.175,), (0.5 - 0.45,), (0.5 + 0.175,), (0.5 + 0.45,)]
    assert replace(SLOPE, null=None).strong() == []
    tank = Candidate(
        id="tank-slosh", kind="physics", family="x", null=(None, None),
        search={"mass": Search(1.0, 1000.0, "log"), "length": Search(0.1, 1.0)},
    )  # fmt: skip
    places = tank.strong()
    assert set(tank.scan_points()) < set(places)
    assert {x for x, _ in set(places) - set(tank.scan_points())} == {0.9}
    assert {y for _, y in places} == {y for _, y in tank.scan_points()}


def test_a_limit_starts_where_it_is_reached_despite_its_misfit() -> None:
    """Peaks of 20 N and a limit of 17 N; fits may begin beside the scenario's own of 30 N, or where 4 or 10 N yield."""
    null, gives_way = 0.9, 0.3

    class Yielding(Wave):
        def predict(self, changes: Mapping[str, Any], shift: float) -> dict[str, np.ndarray]:
            limit = changes.get("effects.rops-plasticity.yield_force", np.inf)
            return {CHANNEL: np.clip(20.0 * np.sin(30.0 * TIME), -limit, limit)}

    limit = Candidate(
        id="rops-plasticity", kind="physics", family="x", search={"yield_force": Search(0.0, 33.0)}, null=(null,)
    )  # fmt: skip
    problem, base = problem_of((0.0,) * 4, (0.0,) * 4)
    simulator: Any = Yielding(0.0)
    for e in problem.dataset:
        object.__setattr__(e, "simulator", simulator)
    known, true = (simulator.predict(c, 0.0)[CHANNEL] for c in ({}, {"effects.rops-plasticity.yield_force": 17.0}))
    problem.measured = [true + w for w in np.random.default_rng(1).standard_normal((4, N))]
    blocks = [replace(b, residual=w - known) for b, w in zip(base.blocks, problem.measured, strict=True)]
    base = replace(base, blocks=tuple(blocks))
    inquiry = Inquiry(
        problem=problem, candidates=(limit,), groups=[], phases=[], say=lambda _: None, executor=Executor()
    )
    scored = replace(screening.score_candidates(problem, base, [limit], [[r] for r in range(4)]), far={})
    found = screen(inquiry, base, [limit], [0, 1], [0.0] * 4, scored)[0]
    nothing_yields = [x for x in limit.scan_points() if abs(x[0] - null) < 0.1]
    assert nothing_yields
    assert found.chi2 > sum(b.residual @ b.residual for b in blocks[:2])  # which is what these leave
    assert found.starts == ((null + SETTINGS.fit.parameterisation.zero_step,), (gives_way,))
