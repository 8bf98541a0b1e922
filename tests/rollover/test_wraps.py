"""A logger that averages writes +179 and -179 degrees as 0: such samples are gaps, all others keep their branch."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from rollover.recording import Recording
from rollover.recording.attitude import ANGLES, continuous, means_over_wraps
from rollover.recording.checks import prechecks
from rollover.spec.frames import across_wraps, other_branch

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


def turning(which: int, at: tuple[float, float, float], rows: slice) -> Recording:
    """Roll, pitch, yaw of which one turns slowly over +180 degrees, some rows given by the other branch."""
    rpy = np.tile(np.array(at), (400, 1))
    rpy[:, which] = math.pi - 0.4 + 0.002 * np.arange(400)
    rpy += np.random.default_rng(2).normal(0.0, 1e-4, rpy.shape)
    rpy[rows] = other_branch(rpy[rows])
    channels = {name: wrapped(rpy[:, k], -math.pi) for k, name in enumerate(ANGLES)}
    return Recording(title="", time=np.arange(400) / 50.0, channels=channels)


@pytest.mark.parametrize(("which", "at"), [(0, (0.0, 1.3, 0.2)), (2, (-0.4, 1.2, 0.0))])
def test_a_sample_on_the_other_branch_is_a_mean_in_no_command(which: int, at: tuple[float, float, float]) -> None:
    recorded = turning(which, at, slice(200, 201))
    name = ANGLES[which]
    assert across_wraps(recorded[name])[200]  # by this angle alone it would be one
    assert not means_over_wraps(recorded)[name].any()
    assert np.isfinite(continuous(recorded)[name]).all()
    assert not any("averaged" in f.sentence for f in prechecks(recorded))


@pytest.mark.parametrize("which", [0, 2])
def test_only_whole_turns_are_told_as_wraps(which: int) -> None:
    """Every other of the first 150 rows by the other branch, half a turn away; one wrap, later."""
    recorded = turning(which, (0.1, 1.3, 0.2), slice(0, 150, 2))
    steps = np.abs(np.diff(recorded[ANGLES[which]]))
    assert (steps > math.pi).sum() > 20
    told = {f.channel: f.value for f in prechecks(recorded) if f.check == "wrap-around"}
    assert told == {ANGLES[which]: 1.0}


def test_an_angle_within_one_turn_has_no_means_over_wraps() -> None:
    """A prescribed steering angle is read as it is: nothing of it becomes a gap, and none is told."""
    noise = np.random.default_rng(1).normal(0.0, 1e-3, 1200)
    values = means(wrapped(2.5041 + SLOW * np.arange(1200) / 100.0 + noise, -math.pi), 2)
    recorded = of(values, "input/steering/angle")
    assert across_wraps(values).sum() == 1
    assert not any("averaged" in f.sentence for f in prechecks(recorded))
    assert np.array_equal(continuous(recorded)["input/steering/angle"], values)
