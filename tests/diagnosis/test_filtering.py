"""Filters of a test see the even rows that a rig sampled, whatever a recording keeps of them."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from rollover import scenario
from rollover.diagnosis.forward.averaging import block_averaged, simulated
from rollover.diagnosis.forward.discontinuities import DISCONTINUITY_IN
from rollover.diagnosis.forward.filtering import rows_of
from rollover.diagnosis.forward.forward_model import DropSimulator
from rollover.diagnosis.settings import SETTINGS
from rollover.recording import Recording

FAST = np.arange(-1000, 4001) * 1e-4  # 10 kHz
CHANNELS = ("ground/force_normal", "striker/acceleration_z", "ground/sinkage")


def recorded(stamps: NDArray[np.float64]) -> Recording:
    """A recording of three channels of which two went through a filter; what is in them is no matter here."""
    channels = {name: np.zeros(stamps.size) for name in CHANNELS}
    return Recording(time=stamps, channels=channels, title="r", cfc=dict.fromkeys(CHANNELS[:2], 180))


def predicted(stamps: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    found = DropSimulator(scenario.load("drop_test"), recorded(stamps)).predict({"effects.mass.added": 3.0}, 2e-4)
    assert found is not None
    return found


@pytest.fixture(scope="module")
def whole() -> dict[str, NDArray[np.float64]]:
    return predicted(FAST)


KEPT = {
    "slow for the class": np.arange(FAST.size) % 10 == 0,
    "a gap at the contact": (np.arange(FAST.size) < 900) | (np.arange(FAST.size) > 1250),
    "uneven": np.random.default_rng(3).random(FAST.size) < 0.7,
}


@pytest.mark.parametrize("kept", KEPT.values(), ids=KEPT.keys())
def test_what_is_kept_of_fast_rows_reads_as_these_do(
    kept: NDArray[np.bool_], whole: dict[str, NDArray[np.float64]]
) -> None:
    """1 kHz asks for ten times the rows, of which CFC 180 needs two: its filter's own error is that of its rate."""
    found = predicted(FAST[kept])
    for name, values in ((c, v) for c, v in whole.items() if not c.startswith(DISCONTINUITY_IN)):
        off = np.abs(found[name] - values[kept]) / np.ptp(values)
        if name == "ground/sinkage":
            assert np.max(off) == 0.0, "no filter, no other rows"
        else:
            assert np.quantile(off, 0.98) < 2e-3
            assert np.max(off) < 0.03, "beside the leap at the contact"


def test_even_rows_that_are_fast_enough_are_as_they_are() -> None:
    rows = rows_of(recorded(FAST))
    assert rows.times is FAST
    assert np.array_equal(rows.even, np.arange(FAST.size))
    unfiltered = replace(recorded(FAST[KEPT["uneven"]]), cfc={})
    assert rows_of(unfiltered).times.size == unfiltered.time.size


def test_means_of_rows_behind_a_filter_are_those_of_all_rows(whole: dict[str, NDArray[np.float64]]) -> None:
    """The filter sees every row that the rig sampled; what is compared is as few as without one."""
    recording = recorded(FAST)
    thin, simulator, many = simulated(scenario.load("drop_test"), recording)
    assert many == FAST.size // SETTINGS.forward.averaging.most_rows
    assert thin.cfc == recording.cfc
    found = simulator.predict({"effects.mass.added": 3.0}, 2e-4)
    assert found is not None
    rows = FAST.size // many * many
    for name in CHANNELS:
        means = whole[name][:rows].reshape(-1, many).mean(axis=1)
        off = np.abs(found[name] - means) / np.ptp(means)
        assert np.max(off[:-20]) < 1e-9, "but where the last rows, which fill no mean, bend the end of the filter"


def test_a_full_run_keeps_the_rate_of_its_filters() -> None:
    recording = recorded(FAST)
    thin, inside = block_averaged(recording, 1800.0)
    assert inside is not None
    assert inside.shape[1] == 5
    assert 1.0 / float(np.median(np.diff(thin.time))) > 1800.0
    assert block_averaged(recording, 6000.0) == (recording, None)


def test_a_simulator_in_another_process_is_what_it_was_here() -> None:
    """Workers get it pickled: every attribute arrives, and it predicts the same."""
    here = DropSimulator(scenario.load("drop_test"), recorded(np.arange(0.0, 0.3, 1e-3)), discontinuities=True)
    there = pickle.loads(pickle.dumps(here))
    assert vars(there).keys() == vars(here).keys()
    assert there.discontinuities is True
    mine, theirs = (one.predict({"effects.mass.added": 3.0}, 2e-4) for one in (here, there))
    assert mine is not None
    assert theirs is not None
    assert mine.keys() == theirs.keys()
    assert all(np.array_equal(mine[c], theirs[c]) for c in mine)
