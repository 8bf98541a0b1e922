"""How far fitted values leave a curve open, against the closed form of a straight line."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from rollover.calibration.calibrate import Calibration
from rollover.calibration.prediction import prediction_error
from rollover.system.numbers import Z95

T = np.linspace(0.0, 2.0, 21)
VALUES, SIGMA = {"a": 3.0, "b": -1.0}, {"a": 0.2, "b": 0.5}
WIDE = (-100.0, 100.0)


class Line:
    """A scenario whose curve is a t + b."""

    def __init__(self, values: dict[str, float]) -> None:
        self.values = values

    def replaced(self, changes: dict[str, float]) -> Line:
        return Line({**self.values, **changes})

    def curves(self) -> dict[str, Any]:
        return {"line": self.values["a"] * T + self.values["b"]}


def calibration(rho: float, bounds: dict[str, tuple[float, float]]) -> Calibration:
    estimates = [
        SimpleNamespace(
            path=name,
            value=value,
            low=value - Z95 * SIGMA[name],
            high=value + Z95 * SIGMA[name],
            bounds=bounds.get(name, WIDE),
        )
        for name, value in VALUES.items()
    ]
    correlation = np.array([[1.0, rho], [rho, 1.0]])
    return cast(
        Calibration, SimpleNamespace(calibrated=Line(VALUES), estimates=tuple(estimates), correlation=correlation)
    )


@pytest.mark.parametrize("rho", [-0.9, 0.0, 0.6])
@pytest.mark.parametrize("bounds", [{}, {"a": (2.95, 3.02), "b": (-1.0, 4.0)}, {"b": (-4.0, -1.0)}])
def test_it_is_that_of_a_line(rho: float, bounds: dict[str, tuple[float, float]]) -> None:
    """Var(a t + b) = t^2 s_a^2 + 2 rho t s_a s_b + s_b^2, also by steps that a range cuts short or turns round."""
    found = prediction_error(calibration(rho, bounds), lambda s: cast(Any, s).curves())
    a, b = SIGMA["a"], SIGMA["b"]
    assert found["line"] ** 2 == pytest.approx(T**2 * a**2 + 2.0 * rho * T * a * b + b**2)


def test_a_value_that_has_no_room_moves_nothing() -> None:
    found = prediction_error(calibration(0.3, {"a": (3.0, 3.0)}), lambda s: cast(Any, s).curves())
    assert found["line"] == pytest.approx(SIGMA["b"])


def test_a_curve_that_a_run_does_not_have_is_left_out() -> None:
    def curves(s: Any) -> dict[str, Any]:
        made = s.curves()
        return {**made, "rare": T} if s.values == VALUES else {**made, "other": T}

    assert set(prediction_error(calibration(0.0, {}), curves)) == {"line"}
    assert prediction_error(calibration(0.0, {}), lambda s: {"line": T if s.values == VALUES else T[:5]}) == {}
