"""What a diagnosis is shown with: recordings beside the scenario as it is, and with what was found."""

from __future__ import annotations

from dataclasses import replace

import pytest

from rollover.diagnosis.overlay import overlays_of
from tests.diagnosis.drops import recorded, scenario
from tests.rollover.diagnosed import sensor_at_fault

DAMPING = "effects.soil-viscous-damping.damping"


@pytest.mark.parametrize("stated", [{}, {DAMPING: 0.0}])
def test_what_was_found_is_shown_whatever_is_stated(stated: dict[str, float]) -> None:
    """An importer may state that a recording has none of it: what was found takes its place."""
    given = [(n, replace(r, conditions={**r.conditions, **stated})) for n, r in recorded({DAMPING: 180.0}, 3)]
    damping = replace(
        sensor_at_fault().effects[0],
        id="soil-viscous-damping",
        kind="physics",
        settings={"damping": 180.0},
        channel=None,
    )
    shown = overlays_of(scenario(), given, replace(sensor_at_fault(), effects=(damping,)))
    assert len(shown) == len(given)
    for track in (t for one in shown for t in one.tracks):
        assert track.rms_after is not None
        assert track.rms_after < 1.3
    assert max(t.rms_before for one in shown for t in one.tracks) > 3.0
