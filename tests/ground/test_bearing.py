"""Bearing pressure: static value at rest, a share for each decade of rate, a face and a cone."""

from __future__ import annotations

import math

import pytest

from ground.bearing import Bearing
from ground.law import REFERENCE_AREA, evaluate

SOIL = Bearing(surface_pressure=2e3, depth_pressure=1e4, depth_exponent=0.5, rate_per_decade=0.2)


def test_at_rest_it_is_the_static_pressure() -> None:
    assert evaluate(SOIL, 0.4, 0.0, speed=1.0) == pytest.approx(REFERENCE_AREA * (2e3 + 1e4 * 2.0), rel=1e-12)


def test_ten_times_the_rate_adds_a_fifth_of_static_pressure() -> None:
    static = evaluate(SOIL, 0.1, 0.0, speed=1.0)
    # asinh(x/2) = ln x + 1/x^2 + ... for x = v/v_0 of 50 and 500
    step = evaluate(SOIL, 0.1, 10.0, speed=1.0) - evaluate(SOIL, 0.1, 1.0, speed=1.0)
    assert step == pytest.approx(0.2 * static, rel=1e-3)
    assert evaluate(SOIL, 0.1, 1.0, speed=1.0) == pytest.approx(static * (1.0 + 0.2 * math.log10(50.0)), rel=1e-3)


def test_a_soil_without_resistance_is_refused() -> None:
    with pytest.raises(ValueError, match=r"^depth_pressure: no resistance"):
        Bearing(surface_pressure=0.0, depth_pressure=0.0)
