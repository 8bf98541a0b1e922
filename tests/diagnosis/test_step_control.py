"""Slopes of drops: over a step, or over a narrower one where that tells far too much."""

from __future__ import annotations

import numpy as np
import pytest

from rollover.diagnosis.fit.finite_differences import step_reduced


def test_a_steep_parameter_has_a_smaller_difference_step() -> None:
    """y(h) = 200 tanh(h/1e-3) moves it by 200 times its noise over 5e-3, and by 40 of a slope of 200,000.

    At a misfit of 100 times the noise that is what is asked for, and over 1e-5 it is the slope itself.
    """
    asked: list[float] = []

    def moved(step: float) -> np.ndarray:
        asked.append(step)
        return np.array([200.0 * np.tanh(step / 1e-3)])

    close, wide, narrow = (
        step_reduced(moved, 5e-3, 1.0),
        step_reduced(moved, 5e-3, 100.0),
        step_reduced(moved, -1e-5, 1.0),
    )
    assert close is not None
    assert wide is not None
    assert narrow is not None
    assert close[0] == pytest.approx(2e5, rel=1e-3)
    assert wide[0] == pytest.approx(4e4, rel=1e-3)
    assert narrow[0] == pytest.approx(2e5, rel=1e-3)
    there = pytest.approx(5e-3 / 200.0, rel=1e-3)
    assert asked == [5e-3, there, pytest.approx(-5e-3 / 200.0, rel=1e-3), 5e-3, -1e-5]
    assert step_reduced(lambda _: None, 5e-3, 1.0) is None


@pytest.mark.parametrize(("edge", "steps"), [(-1e-5, 3), (-1e-3, 2), (1e-5, 2)])
def test_an_edge_that_just_lies_there_is_no_slope(edge: float, steps: int) -> None:
    """y(h) = 20,000 h, and 20 more beyond an edge: over -5e-3 it moves by 100 to 120, over 1/100 of that by 1 or 21."""
    asked: list[float] = []

    def moved(step: float) -> np.ndarray:
        asked.append(step)
        return np.array([2e4 * step + 20.0 * np.sign(edge) * (abs(step) > abs(edge) and step * edge > 0.0)])

    found = step_reduced(moved, -5e-3, 1.0)
    assert found is not None
    assert found[0] == pytest.approx(2e4, rel=1e-9)
    assert len(asked) == steps
