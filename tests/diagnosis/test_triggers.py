"""Drops that nobody timed: their first contact is seen, however far off their clock is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rollover.diagnosis import diagnose
from rollover.diagnosis.series import series
from rollover.diagnosis.triggers import REACH, from_first_contact
from rollover.recording import Clock, Recording
from tests.diagnosis.drops import ACCELERATION, DEPTH, FORCE, recorded, scenario

LATE = (0.4, -0.1, 7.0)  # s


def drops(
    clock: Clock, late: tuple[float, ...] = LATE, changes: dict[str, float] | None = None
) -> list[tuple[str, Recording]]:
    made = recorded(changes or {}, 3, channels=(FORCE, DEPTH, ACCELERATION), rate=1000.0)
    return [(name, replace(r, time=r.time + by, clock=clock)) for (name, r), by in zip(made, late, strict=True)]


@pytest.mark.parametrize("clock", [Clock(zero="unknown"), Clock(within=8.0)])
def test_a_drop_that_nobody_timed_begins_where_it_shows_something(clock: Clock) -> None:
    """A channel shows a contact a few samples after it: what is left is within reach of a time shift."""
    plain = recorded({}, 3, channels=(FORCE, DEPTH, ACCELERATION), rate=1000.0)
    found, notes = from_first_contact(scenario(), drops(clock))
    for (_, one), (_, other) in zip(found, plain, strict=True):
        assert np.max(np.abs(one.time - other.time)) < 8e-3
    said = [float(line.split(" at ")[1].split(" s,")[0]) for line in notes]
    assert said == pytest.approx(LATE, abs=8e-3)
    assert from_first_contact(scenario(), found) == (found, [])


@pytest.mark.parametrize(
    ("clock", "late"), [(Clock(), LATE), (Clock(within=0.01), LATE), (Clock(zero="unknown"), (0.05, -0.05, 0.0))]
)
def test_a_clock_that_is_known_or_within_reach_is_left_as_it_is(clock: Clock, late: tuple[float, ...]) -> None:
    given = drops(clock, late)
    assert max(map(abs, late)) < REACH or clock.zero == "known"
    assert from_first_contact(scenario(), given) == (given, [])


def test_what_begins_within_its_blow_shows_no_contact() -> None:
    """From 20 ms after the contact on, on a clock 0.4 s late: its first sample is no contact."""
    given = [
        (name, replace(r, time=r.time[50:], channels={c: v[50:] for c, v in r.channels.items()}))
        for name, r in drops(Clock(zero="unknown"), (0.4, 0.4, 0.4))
    ]
    found, notes = from_first_contact(scenario(), given)
    assert [r.time[0] for _, r in found] == [r.time[0] for _, r in given]
    assert notes == []


def test_what_is_missing_is_named_from_drops_that_nobody_timed() -> None:
    given = drops(Clock(zero="unknown"), changes={"effects.soil-viscous-damping.damping": 180.0})
    found = diagnose(scenario(), given)
    assert [e.id for e in found.effects] == ["soil-viscous-damping"]
    assert found.effects[0].parameters["damping"].value == pytest.approx(180.0, rel=0.02)
    assert sum("its clock has no zero" in line for line in found.notes) == 3
    assert all(max(t.rms_after for t in one.tracks) < 1.2 for one in series(scenario(), given, found))
