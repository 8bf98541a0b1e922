"""A logger that averages writes +179 and -179 degrees as 0: such samples are gaps, all others keep their branch."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from rollover.recording import Recording
from rollover.recording.attitude import continuous
from rollover.recording.checks import prechecks
from rollover.spec.frames import across_wraps

Array = NDArray[np.float64]
TURN = 2.0 * math.pi
SLOW = 0.3  # rad/s: 17 degrees


def wrapped(angle: Array, lowest: float) -> Array:
    """Angles within a turn that begins at `lowest`."""
    return np.asarray((angle - lowest) % TURN + lowest)


def means(raw: Array, window: int) -> Array:
    """Means of `window` samples each, side by side."""
    return np.asarray(raw[: raw.size // window * window].reshape(-1, window).mean(axis=1))


def of(values: Array, name: str = "chassis/roll", rate: float = 50.0) -> Recording:
    return Recording(title="", time=np.arange(values.size) / rate, channels={name: values})


@pytest.mark.parametrize("window", [2, 3, 5, 8])
@pytest.mark.parametrize(("lowest", "start"), [(-math.pi, 2.997), (0.0, 6.097)])
@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("name", ["chassis/roll", "chassis/yaw", "axle/front/angle"])
def test_means_over_a_wrap_become_gaps(name: str, direction: float, lowest: float, start: float, window: int) -> None:
    t = np.arange(300 * window) / (50.0 * window)
    true = direction * (start + SLOW * t)
    recorded = means(wrapped(true, lowest), window)
    truth = means(true, window)  # closed form: a line's mean is its value in the middle
    found = continuous(of(recorded, name))
    values = found[name]
    known = np.isfinite(values)
    away = truth - values
    away -= TURN * round(float(away[0]) / TURN)  # where it begins is a matter of the range
    assert np.abs(away[known]).max() < 1e-9
    spoilt = np.abs(np.sin(0.5 * (recorded - truth))) > 1e-6  # its value is another attitude
    assert 1 <= spoilt.sum() <= 2
    assert np.array_equal(~known, spoilt)
    assert sum("over a wrap of its range" in note for note in found.notes) == 1
    assert continuous(found).notes == found.notes


def test_a_moving_mean_leaves_two_of_them() -> None:
    true = 2.997 + SLOW * np.arange(200) / 50.0
    recorded = np.convolve(wrapped(true, -math.pi), np.ones(3) / 3.0, mode="valid")
    found = continuous(of(recorded))
    known = np.isfinite(found["chassis/roll"])
    assert (~known).sum() == 2
    assert np.abs(found["chassis/roll"] - true[1:-1])[known].max() < 1e-9
    assert "2 samples are means over a wrap" in found.notes[0]


@pytest.mark.parametrize(
    "angle",
    [
        wrapped(3.0 + SLOW * np.arange(100) / 50.0, -math.pi),  # wrapped, and nothing averaged
        np.where(np.arange(100) == 50, 2.0, 0.1),  # a sample that is disturbed, at no wrap
        wrapped(2.0 * np.arange(60), -math.pi),  # 115 degrees from one sample to the next
        np.where(np.arange(60) < 30, 3.1, -3.1),  # a wrap of a body that rests
        np.array([3.1, -3.1] * 20),  # noise about the wrap
        np.array([3.1, 0.0, -2.0, 1.0]),  # its neighbours are far apart on the circle
        np.array([3.1, 0.0]),
        np.array([]),
    ],
)
def test_other_samples_are_kept(angle: Array) -> None:
    assert not across_wraps(angle).any()


def test_gaps_beside_them_are_passed_over() -> None:
    angle = wrapped(3.1 + 0.01 * np.arange(20), -math.pi)
    at = int(np.argmax(np.diff(angle) < -1.0))
    angle = np.insert(angle, at + 1, [np.nan, 0.02, np.nan])
    assert np.flatnonzero(across_wraps(angle)).tolist() == [at + 2]


def test_check_calls_them_what_they_are() -> None:
    noise = np.random.default_rng(1).normal(0.0, 1e-3, 1200)
    recorded = means(wrapped(2.5041 + SLOW * np.arange(1200) / 100.0 + noise, -math.pi), 2)
    assert across_wraps(recorded).sum() == 1
    found = prechecks(of(recorded))
    assert [f.check for f in found if f.channel == "chassis/roll"] == ["wrap-around"] * len(found)
    assert any("averaged over a wrap-around" in f.sentence for f in found)
