"""What a drop shows at the stamps of a recording, all channels at once, is what each of them is by itself."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from rollover import scenario
from rollover.diagnosis.forward.filtering import filtered_like, rows_of
from rollover.diagnosis.forward.instruments import Instruments
from rollover.dynamics.drop_test import COLUMNS, DropModel, channels_of
from rollover.recording import Recording
from rollover.recording.filters import filtered, low_pass
from rollover.recording.record import with_channels

EVEN = np.arange(-200, 1500) * 2e-4
STAMPS = {"even": EVEN, "too slow for the filter": EVEN[::5], "a gap": EVEN[(EVEN < 0.01) | (EVEN > 0.03)]}


@pytest.mark.parametrize("stamps", STAMPS.values(), ids=STAMPS.keys())
def test_all_channels_at_once_are_each_by_itself(stamps: NDArray[np.float64]) -> None:
    names = (*COLUMNS, "chassis/position_z")  # which a drop has none of
    cfc = {"ground/force_normal": 180, "striker/acceleration_z": 60}
    recording = Recording(title="r", time=stamps, channels=dict.fromkeys(names, stamps), cfc=cfc)
    rows = rows_of(recording)
    drop = DropModel(scenario=scenario.load("drop_test")).rows(rows.times)
    found, each = Instruments(recording, rows).shown(drop), filtered_like(channels_of(drop, names), recording, rows)
    assert found.keys() == each.keys() == set(COLUMNS)
    for name in COLUMNS:
        assert np.array_equal(found[name], each[name]), name
    assert np.ptp(found["ground/force_normal"]) > 0.0


def test_rows_too_slow_for_a_class_are_refused() -> None:
    with pytest.raises(ValueError, match="sampled too slowly for CFC 180"):
        low_pass(180, 1e-3)
    with pytest.raises(ValueError, match="no such filter class"):
        filtered(np.zeros(1), 1e-4, 61)


def test_a_recording_that_shows_other_channels_keeps_its_stamps() -> None:
    before = Recording(title="r", time=EVEN, channels={"ground/sinkage": EVEN}, conditions={"gravity": 9.8})
    found = with_channels(before, {"ground/force_normal": 2.0 * EVEN})
    assert found.time is before.time
    assert found.conditions == before.conditions
    assert list(found.channels) == ["ground/force_normal"]
    assert list(before.channels) == ["ground/sinkage"]
