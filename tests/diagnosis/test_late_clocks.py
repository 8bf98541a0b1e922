"""Clocks of all recordings off by far more than they may be: a finding by name, and what it explains."""

from __future__ import annotations

from dataclasses import replace

import pytest

from rollover.diagnosis import diagnose, json_of
from rollover.diagnosis.io import diagnosed_scenario
from tests.diagnosis.drops import recorded, scenario


def test_time_shifts_that_explain_all_are_a_sensor_fault() -> None:
    late = [(name, replace(r, time=r.time + 0.019)) for name, r in recorded({}, 7, noise=0.004)]
    found = diagnose(scenario(), late, estimate=True)
    assert (found.verdict, found.answer, found.broken) == ("sensor", "whole", ())
    assert {(e.id, e.kind) for e in found.effects} == {("sensor-clock-offset", "sensor")}
    offset = found.effects[0].parameters["offset"]
    assert offset.low < 0.019 < offset.high
    assert offset.value == pytest.approx(0.019, abs=7e-4)
    assert found.after["held_out"].nrmse < 1.2 < 5.0 < found.before["held_out"].nrmse
    assert "ms late" in found.sentence
    told = json_of(found)
    assert told["invariants"]["broken"] == []
    assert {e["answer"] for e in told["effects"]} == {"whole"}
    # what is switched on comes as late as what was recorded
    assert {e.channel for e in diagnosed_scenario(scenario(), found).effects.values()} == set(late[0][1].channels)
