"""An explanation moved to where the mean of its neighbours is met best: how far, and when that is worth a step."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rollover.diagnosis.fit import ensemble_mean
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted, ResidualBlock
from rollover.diagnosis.fit.step import Step
from rollover.diagnosis.selection.ensemble_validation import refined_under_scatter
from tests.diagnosis.test_slopes import CHANNEL, MASS, SLOPE, TIME, Scattering, dataset


def test_a_model_far_from_the_ensemble_mean_takes_more_steps() -> None:
    """y = 20 x^2 sin(30 t) measured at x = 0.6, begun at 0.2: no step is longer than 0.15 of a coordinate."""

    class Curved(Scattering):
        def predict(self, changes: Mapping[str, Any], shift: float) -> dict[str, np.ndarray]:
            x, k = float(changes.get("effects.slope.angle", 0.0)), round(changes.get("neighbour", 0))
            chance = np.random.default_rng([k, round(1e9 * x)]).standard_normal(TIME.size)
            return {CHANNEL: 20.0 * x**2 * np.sin(30.0 * (TIME - shift)) + 0.05 * chance}

    problem = Problem(
        [dataset(Curved().predict({"effects.slope.angle": 0.6}, 0.0)[CHANNEL], Curved()) for _ in range(2)]
    )
    base, far = problem.fit((), ()), problem.fit((SLOPE,), (0.2,), rounds=0)
    assert base is not None
    assert far is not None
    found = refined_under_scatter(problem, Step(base=base, fitted=far, p_value=0.0, rivals=(far,)))
    assert found.fitted.x[0] == pytest.approx(0.6, abs=0.01)
    assert found.rivals == (found.fitted,)


class Straight(Scattering):
    """y = 20 x sin(30 t); `asked` are the x of runs that are no neighbours."""

    def __init__(self) -> None:
        self.asked: set[float] = set()

    def predict(self, changes: Mapping[str, Any], shift: float) -> dict[str, np.ndarray]:
        x, k = float(changes.get("effects.slope.angle", 0.0)), round(changes.get("neighbour", 0))
        if k == 0:
            self.asked.add(round(x, 9))
        chance = np.random.default_rng([k, round(1e9 * x)]).standard_normal(TIME.size)
        return {CHANNEL: 20.0 * x * np.sin(30.0 * (TIME - shift)) + 0.05 * chance}


def begun_at(x: float, values: np.ndarray) -> tuple[Problem, Step]:
    """Two recordings, and a fit that was not made, at x."""
    problem = Problem([dataset(values, Straight()) for _ in range(2)])
    base, off = problem.fit((), ()), problem.fit((SLOPE,), (x,), rounds=0)
    assert base is not None
    assert off is not None
    return problem, Step(base=base, fitted=off, p_value=0.0, rivals=(off,))


@pytest.fixture
def steps(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Places to which it was moved."""
    made: list[Any] = []
    onward = ensemble_mean._line_search

    def counted(problem: Problem, old: Fitted, dx: np.ndarray) -> Any:
        made.append(onward(problem, old, dx))
        return made[-1]

    monkeypatch.setattr(ensemble_mean, "_line_search", counted)
    return made


@pytest.mark.parametrize(("missing", "least"), [(0.0, 2), (1.0, 1), (4.0, 0)])
def test_a_partial_model_is_not_moved_for_a_small_gain(missing: float, least: int, steps: list[Any]) -> None:
    """Begun 0.02 off: (0.4/1)^2 of what cos(400 t) beside it leaves, (0.4/4)^2 of what four times that does."""
    problem, off = begun_at(0.58, 12.0 * np.sin(30.0 * TIME) + missing * np.cos(400.0 * TIME))
    found = refined_under_scatter(problem, off).fitted.x
    assert len(steps) >= least if least else (len(steps), found) == (0, (0.58,))


@pytest.mark.parametrize(("begun", "is_beside"), [(0.58, True), (0.5, False)])
def test_slopes_are_renewed_beyond_their_difference_step(begun: float, is_beside: bool, steps: list[Any]) -> None:
    problem, off = begun_at(begun, 12.0 * np.sin(30.0 * TIME))
    found = refined_under_scatter(problem, off).fitted
    assert found.x[0] == pytest.approx(0.6, abs=2e-3)
    assert len(steps) > 1
    asked = problem.dataset[0].simulator.asked  # type: ignore[attr-defined]
    (first,), _ = steps[0]
    assert first != found.x[0]
    assert (round(first + problem.effort.fine, 9) in asked) != is_beside
    assert round(found.x[0] + problem.effort.fine, 9) in asked  # what it ends with are its own
    for block, other in zip(found.blocks, problem.again(found).blocks, strict=True):
        np.testing.assert_array_equal(block.J, other.J)


@pytest.mark.parametrize(
    ("lefts", "found"),
    [
        ((99.0,), 0.6),
        ((105.0, 98.0, 200.0), 0.6),  # within what one run and another differ by
        ((120.0, 98.0, 200.0), 0.55),
        ((120.0, 140.0, 98.0), 0.65),
        ((120.0, 110.0, 101.0), None),
    ],
)
def test_a_full_step_is_taken_unless_a_part_is_clearly_better(
    lefts: tuple[float, ...], found: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Begun where 100 are left; shares are tried only where the whole way leaves more than that."""
    asked: list[float] = []
    announced: list[float] = []

    def met(_: Any, __: Any, x: Any, shifts: Any) -> Any:
        asked.append(round(x[0], 9))
        return lefts[len(asked) - 1], [s + 1.0 for s in shifts]

    monkeypatch.setattr(ensemble_mean, "_misfit_and_shifts", met)
    problem: Any = SimpleNamespace(made_ahead=lambda points: announced.extend(round(x[0], 9) for _, _, x in points))
    block = ResidualBlock(residual=np.full(4, 5.0), J=np.zeros((4, 1)), slope=np.zeros(4), shift=0.0, prior=1.0)
    old = Fitted(candidates=(SLOPE,), x=(0.5,), blocks=(block,))
    there = ensemble_mean._line_search(problem, old, np.array([0.1]))
    assert asked == announced == [0.6, 0.55, 0.65][: len(lefts)]
    assert there == (None if found is None else ([pytest.approx(found)], [1.0]))


def test_rivals_are_not_run_again_in_the_ensemble_refit() -> None:
    problem, off = begun_at(0.58, 12.0 * np.sin(30.0 * TIME))
    rival = problem.fit((MASS,), (0.3,), rounds=0)
    assert rival is not None
    assert all(e.signals[0].weight is None for e in problem.dataset)
    found = refined_under_scatter(problem, replace(off, rivals=(off.fitted, rival)))
    assert found.fitted.x[0] == pytest.approx(0.6, abs=2e-3)
    assert found.rivals[0] is found.fitted
    assert found.rivals[1] is rival
    assert all(e.signals[0].weight is not None for e in problem.dataset)  # what it stands beside is held under that
    np.testing.assert_array_equal(found.base.blocks[0].residual, problem.again(off.base).blocks[0].residual)
