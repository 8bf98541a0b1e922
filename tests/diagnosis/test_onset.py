"""Drops that nobody timed: their first contact is seen, however far off their clock is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rollover.diagnosis import diagnose
from rollover.diagnosis.data.onset import clock_notes, zeros_from_contact
from rollover.diagnosis.overlay import overlays_of
from rollover.recording import Clock, Recording
from rollover.system.errors import InputError
from tests.diagnosis.drops import ACCELERATION, DEPTH, FORCE, recorded, scenario

LATE = (0.4, -0.1, 7.0)  # s


def drops(
    clock: Clock, late: tuple[float, ...] = LATE, changes: dict[str, float] | None = None
) -> list[tuple[str, Recording]]:
    made = recorded(changes or {}, 3, channels=(FORCE, DEPTH, ACCELERATION), rate=1000.0)
    return [(name, replace(r, time=r.time + by, clock=clock)) for (name, r), by in zip(made, late, strict=True)]


@pytest.mark.parametrize("clock", [Clock(zero="unknown"), Clock(within=8.0)])
@pytest.mark.parametrize("late", [LATE, (0.05, -0.05, 0.0)])
def test_an_untimed_drop_begins_at_its_contact(clock: Clock, late: tuple[float, float, float]) -> None:
    """`recorded` makes clocks late by half a millisecond itself, and the soil here is the scenario's."""
    plain = recorded({}, 3, channels=(FORCE, DEPTH, ACCELERATION), rate=1000.0)
    found, notes = zeros_from_contact(scenario(), drops(clock, late))
    for (_, one), (_, other) in zip(found, plain, strict=True):
        assert np.max(np.abs(one.time - other.time)) < 2e-3
        assert one.clock.zero == "unknown"  # what is left is fitted
    said = [float(line.split(" at ")[1].split(" s,")[0]) for line in notes]
    assert said == pytest.approx(late, abs=2e-3)
    again, silent = zeros_from_contact(scenario(), found)
    assert silent == []
    assert all(one is other for (_, one), (_, other) in zip(again, found, strict=True))


@pytest.mark.parametrize("clock", [Clock(), Clock(within=0.01)])
def test_a_known_clock_stays_while_the_scenario_lasts(clock: Clock) -> None:
    given = drops(clock, (0.38, -0.1, 0.02))
    assert zeros_from_contact(scenario(), given) == (given, [])
    beyond = drops(clock, (7.0, 100.0, 1.7e9))
    found, notes = zeros_from_contact(scenario(), beyond)
    assert all("shares no time with the scenario" in line for line in notes)
    assert max(abs(r.time[0] + 0.03) for _, r in found) < 5e-3


@pytest.mark.parametrize("late", [(0.02, -0.05, 0.1), (0.0, 0.3, 0.0), (0.0, 1e-3, -1e-3)])
def test_a_wrong_known_clock_is_reported_with_its_cure(
    late: tuple[float, float, float],
) -> None:
    given = drops(Clock(), late)
    said = list(clock_notes(scenario(), given, {}))
    far = [(name, by) for (name, _), by in zip(given, late, strict=True) if abs(by) > 0.01]
    assert len(said) == len(far)
    for line, (name, by) in zip(said, far, strict=True):
        assert line.startswith(f"{name}: its clock is off, which is not stated; the scenario's zero lies at ")
        assert float(line.split(" at ")[1].split(" s,")[0]) == pytest.approx(by, abs=2e-3)
        assert line.endswith(
            "left as it is stated to be: `clock: {zero: unknown}` in its sidecar or profile sets it there"
        )
    assert not list(clock_notes(scenario(), drops(Clock(within=0.01), late), {}))  # the fitted shift has room for it


def test_a_diagnosis_reports_a_wrong_clock_and_frees_it() -> None:
    given = drops(Clock(), (0.03, 0.03, 0.03))
    assert diagnose(scenario(), given, estimate=False).verdict == "unexplained"
    kept = diagnose(scenario(), given)
    assert (kept.verdict, {e.id for e in kept.effects}) == ("sensor", {"sensor-clock-offset"})
    assert kept.broken == ()
    assert sum("left as it is stated to be" in note for note in kept.notes) == 3
    unknown = diagnose(scenario(), [(name, replace(r, clock=Clock(zero="unknown"))) for name, r in given])
    assert unknown.verdict == "no-mismatch"
    assert not any("left as it is" in note for note in unknown.notes)


def test_what_begins_within_its_impact_is_laid_over_the_run() -> None:
    """From 20 ms after the contact on, on a clock 0.4 s late: its first sample is no contact."""
    given = [
        (name, replace(r, time=r.time[50:], channels={c: v[50:] for c, v in r.channels.items()}))
        for name, r in drops(Clock(zero="unknown"), (0.4, 0.4, 0.4))
    ]
    found, notes = zeros_from_contact(scenario(), given)
    assert all("by least-squares alignment of" in line for line in notes)
    assert [r.time[0] for _, r in found] == pytest.approx([r.time[0] - 0.4 for _, r in given], abs=2e-3)


def test_a_clock_beyond_the_scenario_is_refused_by_name() -> None:
    """Nothing but the fall, an hour after a zero: where it ends nobody knows."""
    (name, one), *_ = drops(Clock(), (3600.0, 0.0, 0.0))
    rows = one.time < 3600.0 - 2e-3
    fall = replace(one, time=one.time[rows], channels={c: v[rows] for c, v in one.channels.items()})
    with pytest.raises(InputError, match=f"^{name}: clock: its time zero cannot be determined, got stamps from 3599.9"):
        zeros_from_contact(scenario(), [(name, fall)])


def test_what_is_missing_is_named_from_drops_that_nobody_timed() -> None:
    given = drops(Clock(zero="unknown"), changes={"effects.soil-viscous-damping.damping": 180.0})
    found = diagnose(scenario(), given)
    assert [e.id for e in found.effects] == ["soil-viscous-damping"]
    assert found.effects[0].parameters["damping"].value == pytest.approx(180.0, rel=0.02)
    assert sum("its clock has no zero" in line for line in found.notes) == 3
    assert all(max(t.rms_after for t in one.tracks) < 1.2 for one in overlays_of(scenario(), given, found))


def test_a_diagnosis_says_the_same_on_any_clock() -> None:
    """From one second early to an epoch: values, ends of intervals and misfits to 1e-6 of each number."""
    damping = {"effects.soil-viscous-damping.damping": 180.0}
    first, other = [diagnose(scenario(), drops(Clock(zero="unknown"), (late,) * 3, damping)) for late in (-1.0, 1e9)]
    assert [e.id for e in first.effects] == ["soil-viscous-damping"]
    assert (other.verdict, [e.id for e in other.effects]) == (first.verdict, [e.id for e in first.effects])
    value, same = (found.effects[0].parameters["damping"] for found in (first, other))
    assert (same.value, same.low, same.high) == pytest.approx((value.value, value.low, value.high), rel=1e-6)
    assert value.low <= 180.0 <= value.high
    assert other.after["held_out"].nrmse == pytest.approx(first.after["held_out"].nrmse, rel=1e-6)
