"""Conditions are no surer than the digits in which they are written."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from rollover.diagnosis import diagnose
from rollover.diagnosis.data.condition_uncertainty import decimals, with_rounding_uncertainty
from rollover.recording import Recording
from tests.diagnosis.drops import ACCELERATION, DEPTH, FORCE, recorded, scenario

SPEED, MASS = "initiation.speed", "vehicle.mass"


def stated(**conditions: object) -> Recording:
    time = np.arange(3.0)
    return Recording(title="stated", time=time, channels={FORCE: 0.0 * time}, conditions=conditions)


@pytest.mark.parametrize(("value", "many"), [(1.25, 2), (130.0, 0), (0.5, 1), (-2.125, 3), (1e-7, 15), (2e16, 0)])
def test_digits_behind_the_point_are_those_that_are_written(value: float, many: int) -> None:
    assert decimals(value) == many


def test_what_is_rounded_is_known_to_half_its_last_digit_evenly() -> None:
    """A value that lies evenly within 10^-d has the variance 10^-2d/12."""
    first, second = stated(**{SPEED: 1.9, "initiation.lead_time": 0.02}), stated(**{SPEED: 2.19, MASS: 132.0})
    found, said = with_rounding_uncertainty([("a", first), ("b", second)])
    assert [r.uncertainty for _, r in found] == [
        {SPEED: pytest.approx(0.01 / math.sqrt(12.0))},
        {SPEED: pytest.approx(0.01 / math.sqrt(12.0)), MASS: pytest.approx(1.0 / math.sqrt(12.0))},
    ]
    assert [line.partition(" ")[0] for line in said] == [SPEED, MASS]
    assert with_rounding_uncertainty(found) == (found, [])  # it is said now


@pytest.mark.parametrize("speeds", [(1.5, 3.0), (2.0 / 3.0,), (1.234, 2.5), (0.0,)])
def test_what_may_be_nominal_or_is_given_in_full_has_no_rounding(speeds: tuple[float, ...]) -> None:
    """1.5 is so to 2 %, 1.234 to 0.02 %."""
    given = [(str(v), stated(**{SPEED: v})) for v in speeds]
    assert with_rounding_uncertainty(given) == (given, [])


def test_rounded_speeds_are_no_mismatch() -> None:
    """Errors of up to 0.6 % at a noise of 0.3 % that no one effect makes, though several would do for some."""
    true = (0.7246, 1.2954, 2.1046, 2.8954)
    made = recorded({}, 3, speeds=true, channels=(FORCE, DEPTH, ACCELERATION), noise=0.003)
    rounded = [(n, replace(r, conditions={SPEED: round(v, 2)})) for (n, r), v in zip(made, true, strict=True)]
    found = diagnose(scenario(), rounded)
    assert found.verdict == "no-mismatch"
    assert any("rounded" in note for note in found.notes)
    exact = diagnose(scenario(), made)
    assert exact.verdict == "no-mismatch"
    assert not any("rounded" in note for note in exact.notes)
