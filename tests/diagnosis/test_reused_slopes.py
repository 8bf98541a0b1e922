"""Slopes that need no runs of their own: lent by a fit of fewer effects, kept where they predicted well."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rollover.diagnosis.fit.jobs import Executor
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted
from rollover.diagnosis.fit.local_search import without_effect
from rollover.diagnosis.fit.tasks import Task
from rollover.diagnosis.selection.forward_step import reusable_slopes
from rollover.diagnosis.selection.screening import score_candidates
from rollover.diagnosis.settings import SETTINGS
from tests.diagnosis.test_scan import problem_of as looks_of
from tests.diagnosis.test_slopes import CHANNEL, MASS, SIGMA, SLOPE, TIME, Late, dataset

Place = tuple[float, float]
WAVES = np.sin(30.0 * TIME), np.cos(70.0 * TIME)


class Curved(Late):
    """y = 40 (x + bend x^2) sin(30 t) + 40 o cos(70 t); `asked` are the (x, o) of its runs, in their order."""

    def __init__(self, bend: float) -> None:
        self.bend, self.asked = bend, dict[Place, None]()

    def predict(self, changes: Mapping[str, Any], shift: float) -> dict[str, np.ndarray]:
        x, o = (float(changes.get(f"effects.{name}", 0.0)) for name in ("slope.angle", "mass.added"))
        self.asked[round(x, 9), round(o, 9)] = None
        return {CHANNEL: 40.0 * (x + self.bend * x**2) * WAVES[0] + 40.0 * o * WAVES[1]}


def problem_of(x: float, o: float, bend: float = 0.0, effort: Any = SETTINGS.forward.runs) -> tuple[Problem, Curved]:
    runs = Curved(bend)
    values = runs.predict({"effects.slope.angle": x, "effects.mass.added": o}, 0.0)[CHANNEL]
    runs.asked.clear()
    return Problem([dataset(values, runs, effort)]), runs


def beside(runs: Curved, at: Place) -> set[Place]:
    """Runs to either side of a place, of those that a slope asks for where a fit ends."""
    x, o = at
    sides = {
        (x - SETTINGS.forward.runs.fine, o),
        (x + SETTINGS.forward.runs.fine, o),
        (x, o - SETTINGS.forward.runs.fine),
        (x, o + SETTINGS.forward.runs.fine),
    }
    return {(round(a, 9), round(b, 9)) for a, b in sides} & set(runs.asked)


def base_at(problem: Problem, x: float) -> Fitted:
    found = problem.fit((SLOPE,), (x,), rounds=0, width=1)
    assert found is not None
    return found


def fitted(problem: Problem, start: Place, base: Fitted | None) -> Fitted:
    reused = None if base is None else reusable_slopes(problem, base)
    found = problem.fit((SLOPE, MASS), start, width=1, reused=reused)
    assert found is not None
    return found


@pytest.mark.parametrize("is_reused", [True, False])
def test_a_fit_starts_with_reused_columns_and_ends_with_own(is_reused: bool) -> None:
    problem, runs = problem_of(0.5, 0.6, bend=0.5)
    base = base_at(problem, 0.45)
    runs.asked.clear()
    found = fitted(problem, (0.45, 0.2), base if is_reused else None)
    first = [at for at in runs.asked if at[1] == 0.2]
    assert set(first) == {(0.45, 0.2), *(() if is_reused else ((0.42, 0.2), (0.48, 0.2)))}
    assert found.x == pytest.approx((0.5, 0.6), abs=1e-4)  # 3e-5 leaves the gain of 4 at which a search ends
    other = problem.again(found)
    for block, own in zip(found.blocks, other.blocks, strict=True):
        np.testing.assert_allclose(block.J, own.J, rtol=0.05, atol=1e-6 * float(np.abs(own.J).max()))


def test_slopes_of_another_place_are_no_reason_to_end() -> None:
    """Those lent have the wrong sign: every way that they point leaves more, and a fit's own lead on."""
    problem, _ = problem_of(0.5, 0.6)
    base = base_at(problem, 0.3)
    turned = replace(base, blocks=tuple(replace(b, J=-b.J) for b in base.blocks))
    assert fitted(problem, (0.3, 0.6), turned).x == pytest.approx((0.5, 0.6), abs=1e-4)


@pytest.mark.parametrize(("bend", "no_jacobian", "told"), [(0.0, True, 1), (4.0, True, 2), (0.0, False, 2)])
def test_a_short_fit_keeps_slopes_that_predicted_well(bend: float, no_jacobian: bool, told: int) -> None:
    """Of what is straight the first step leaves next to nothing; bent, it goes half as far again as it should."""
    problem, runs = problem_of(0.5, 0.6, bend)
    found = problem.fit((MASS, SLOPE), (0.2, 0.2), width=1, rounds=2, no_jacobian=no_jacobian)
    assert found is not None
    places = [at for at in runs.asked if len({x for x, o in beside(runs, at) if o == at[1]}) == 2]
    assert places[0] == (0.2, 0.2)
    assert len(places) >= told if not no_jacobian else len(places) == told


@pytest.mark.parametrize("is_beside", [True, False])
def test_a_fit_ends_with_the_slopes_of_a_point_beside_it(is_beside: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Slopes lent are twice too steep: half the way gains three quarters of 4.7, less than goes on, so all are told.

    The step that these lead to ends 2e-5 further on.
    """
    problem, runs = problem_of(0.5, 0.6)
    at = 0.5 - float(np.sqrt(4.7)) / float(np.linalg.norm(40.0 * WAVES[0] / SIGMA))
    base = base_at(problem, at)
    steep = replace(base, blocks=tuple(replace(b, J=2.0 * b.J) for b in base.blocks))
    if not is_beside:
        monkeypatch.setattr(Problem, "is_beside", lambda *_: False)
    found = fitted(problem, (at, 0.6), steep)
    assert found.x == pytest.approx((0.5, 0.6), abs=1e-6)  # a tenth of the last step
    told = [place for place in runs.asked if len(beside(runs, place)) == 4]
    assert len(told) == (1 if is_beside else 2)
    assert all(b.J.any(axis=0).all() for b in found.blocks)


def test_a_fit_cut_short_ends_with_its_own_jacobian() -> None:
    problem, runs = problem_of(0.5, 0.6)
    reused = reusable_slopes(problem, base_at(problem, 0.2))
    found = problem.fit((SLOPE, MASS), (0.2, 0.2), width=1, rounds=1, reused=reused)
    assert found is not None
    x, o = found.x
    assert len(beside(runs, (round(x, 9), round(o, 9)))) == 4


@pytest.mark.parametrize(("effort", "is_reused"), [(SETTINGS.forward.runs, True), (SETTINGS.forward.drops, False)])
def test_a_reduced_fit_starts_with_the_others_columns(effort: Any, is_reused: bool) -> None:
    problem, runs = problem_of(0.5, 0.6, effort=effort)
    whole = problem.fit((SLOPE, MASS), (0.5, 0.6))
    assert whole is not None
    runs.asked.clear()
    rest = without_effect(problem, whole, 1, no_jacobian=True)
    assert rest is not None
    assert rest.candidates == (SLOPE,)
    assert all(o == 0.0 for _, o in runs.asked)
    steps = [effort.fd_steps[0], effort.fd_steps[0] + SETTINGS.forward.runs.fd_steps[0]]
    assert any((round(0.5 - step, 9), 0.0) in runs.asked for step in steps) != is_reused
    assert not any(b.J.any() for b in rest.blocks)


def test_slopes_are_reused_where_they_cost_runs_alone() -> None:
    problem, _ = problem_of(0.5, 0.6)
    base = base_at(problem, 0.45)
    reused = reusable_slopes(problem, base, [0])
    assert reused is not None
    np.testing.assert_array_equal(reused[0], base.blocks[0].J)
    nothing = problem.fit((), ())
    assert nothing is not None
    assert reusable_slopes(problem, nothing) is None
    cheap, _ = problem_of(0.5, 0.6, effort=SETTINGS.forward.drops)
    assert reusable_slopes(cheap, base_at(cheap, 0.45)) is None


def test_a_task_with_other_slopes_is_another_task() -> None:
    task = Task(candidates=(SLOPE, MASS), start=(0.45, 0.2), shifts=(0.0,), width=1)
    reused = [replace(task, reused=(np.full((3, 1), slope),)) for slope in (1.0, 1.0, 2.0)]
    keys = [one.key("") for one in (task, *reused)]
    assert keys[1] == keys[2]
    assert len(set(keys)) == 3


def test_a_task_asks_for_no_runs_beside_reused_columns(monkeypatch: pytest.MonkeyPatch) -> None:
    problem, _ = problem_of(0.5, 0.6)
    base = base_at(problem, 0.45)
    wanted: list[tuple[float, ...]] = []
    monkeypatch.setattr(Problem, "made_ahead", lambda _, points: wanted.extend(tuple(x) for _, _, x in points))
    monkeypatch.setattr(Problem, "fit", lambda *_, **told: wanted.append(told["reused"][0].shape))
    with Executor() as executor:
        task = Task(
            candidates=(SLOPE, MASS), start=(0.45, 0.2), shifts=(0.0,), width=1, reused=reusable_slopes(problem, base)
        )
        executor.fits(problem, [task])
    assert wanted[-1] == (TIME.size, 1)
    assert [tuple(round(v, 9) for v in x) for x in wanted[:-1]] == [(0.45, 0.2), (0.45, 0.17), (0.45, 0.23)]


def test_a_short_fit_that_is_taken_up_again_has_no_slopes_either(tmp_path: Path) -> None:
    task = Task(candidates=(SLOPE, MASS), start=(0.45, 0.2), shifts=(0.0,), rounds=2)
    found = []
    for _ in range(2):
        problem, runs = problem_of(0.5, 0.6, bend=0.5)
        with Executor(notebook=tmp_path / "fits") as executor:
            (fit,) = executor.fits(problem, [task])
        assert fit is not None
        found.append((fit.x, fit.total, fit.blocks[0].J.any()))
        asked = len(runs.asked)
    assert found[0] == found[1]
    assert not found[0][2]
    assert asked == 1


def test_what_counts_otherwise_has_the_slopes_that_it_had() -> None:
    problem, _ = problem_of(0.5, 0.6, bend=0.5)
    base = base_at(problem, 0.45)
    steep = replace(base, blocks=tuple(replace(b, J=2.0 * b.J) for b in base.blocks))
    problem.heavy_tailed = False
    found = problem.recounted(steep)
    assert not found.blocks[0].masked
    np.testing.assert_array_equal(found.blocks[0].J, steep.blocks[0].J)
    np.testing.assert_array_equal(found.blocks[0].residual, base.blocks[0].residual)


def test_no_run_is_announced_beside_reused_columns(monkeypatch: pytest.MonkeyPatch) -> None:
    problem, _ = problem_of(0.5, 0.6)
    reused, wanted = reusable_slopes(problem, base_at(problem, 0.45)), list[Place]()
    monkeypatch.setattr(
        Problem, "made_ahead", lambda _, points: wanted.extend((round(x[0], 9), round(x[1], 9)) for _, _, x in points)
    )
    problem.fit((SLOPE, MASS), (0.45, 0.2), width=1, rounds=1, no_jacobian=True, reused=reused)
    assert wanted[:3] == [(0.45, 0.2), (0.45, 0.17), (0.45, 0.23)]
    assert not {(0.42, 0.2), (0.48, 0.2)} & set(wanted)


def test_a_robust_screening_shares_the_jacobian_of_a_plain(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    problem, base = looks_of((0.0,) * 4, (0.0,) * 4)
    problem.heavy_tailed = False
    recounted, asked = Problem.recounted, list[bool]()
    monkeypatch.setattr(Problem, "again", lambda *_: pytest.fail("slopes cost runs"))
    monkeypatch.setattr(Problem, "recounted", lambda own, f: (asked.append(own.heavy_tailed), recounted(own, f))[1])
    score_candidates(problem, base, [SLOPE], [[r] for r in range(4)])
    assert asked == [True]
