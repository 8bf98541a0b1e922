"""What a pre-check found, and the statistics that all of them share."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rollover.recording import Recording
from rollover.recording.noise_floor import LENGTH, NoiseFloor, noise_floor

Array = NDArray[np.float64]

SURE = 4.0  # standard errors: 1 in 16,000 by chance; with a noise level 15 % too small 1 in 1500, of ten questions


EXACT = 1e-9  # of a value: what is exactly alike, or exactly round, after its unit was changed
PARTS = 12  # of the smallest distance: a hundred values over a thousand digits leave one of 12 in 1 of 1e20 cases
WHOLE = 0.01  # of a digit, that a multiple may miss: 2 % of values on no digits, a hundred do so never
SHORTEST = 0.05  # s of a level that is one


@dataclass(frozen=True, kw_only=True)
class Finding:
    """Something wrong with a channel that needs no model to be seen.

    `check` free-fall | rest | zero-offset | polarity | gain | double-integral | clipping | stuck | gap | clock-drift |
    lag | spike | jump | time-base | wrap-around (which is no fault) | stated-noise;
    `start`, `end` s; `value` in `unit`, `error` its standard error where it has one; `sentence` says what it means.
    """

    check: str
    channel: str
    start: float
    end: float
    value: float
    unit: str
    error: float | None
    sentence: str


def instant(time: float, step: float) -> str:
    """A time stamp to a tenth of the step between two: 0.0123 rather than 1.71455e+09 or -0."""
    places = min(9, max(0, math.ceil(-math.log10(step)) + 1)) if 0.0 < step < 10.0 else 0
    text = f"{time:z.{places}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def when(start: float, end: float, step: float) -> str:
    """The span of a finding in words: `at 0.7 s`, or `0.1 to 0.25 s`."""
    first, last = instant(start, step), instant(end, step)
    return f"at {first} s" if first == last else f"{first} to {last} s"


@dataclass(frozen=True, kw_only=True)
class Trace:
    """One channel's samples with its noise floor; `regular` where they are evenly spaced."""

    channel: str
    time: Array
    values: Array
    step: float
    regular: bool
    floor: NoiseFloor


def trace(recording: Recording, channel: str) -> Trace | None:
    """A channel without its gaps; None where it is too short to say anything about."""
    time, values = recording.samples(channel)
    if time.size < 2 * LENGTH:
        return None
    steps = np.diff(time)
    step = float(np.median(steps))
    regular = float(np.mean(np.abs(steps - step) < 0.05 * step)) > 0.9
    return Trace(channel=channel, time=time, values=values, step=step, regular=regular, floor=noise_floor(values))


def digit_of(values: Array) -> float:
    """Step of the digits that the values (n,) of a channel lie on, at least `EXACT` of the largest.

    That is the smallest distance of two of them, or a part of it of which all others are multiples.
    """
    levels = np.unique(values)
    least = EXACT * float(np.abs(levels).max())
    apart = np.diff(levels)
    apart = apart[apart > least]
    if not apart.size:
        return least
    for parts in range(1, PARTS + 1):
        step = float(apart.min()) / parts
        if step > least:
            multiples = (levels - levels[0]) / step
            if float(np.abs(multiples - np.round(multiples)).max()) < WHOLE:
                return step
    return least


def plateau(t: Trace, *, at_end: bool = False) -> slice | None:
    """The longest constant stretch from the start (or back from the end): blocks whose means agree within noise."""
    if t.floor.sigma == 0.0:
        return _constant(t.values, at_end)
    block = max(10, int(4.0 * t.floor.independence))
    count = t.values.size // block
    if count < 3:
        return None
    x = t.values[::-1] if at_end else t.values
    means = x[: count * block].reshape(count, block).mean(axis=1)
    error = t.floor.of_mean(block)
    n, mean = 2, float(means[:2].mean())
    if abs(means[1] - means[0]) > 5.0 * error * np.sqrt(2.0):
        return None
    while n < count and abs(means[n] - mean) < 5.0 * error * np.sqrt(1.0 + 1.0 / n):
        mean += (float(means[n]) - mean) / (n + 1)
        n += 1
    length = (n - 1 if n < count else n) * block  # the last block may hold the beginning of what follows
    while length >= 3 * block and _moves(t, x[:length]):
        length //= 2  # towards the end of the record, where it is calmest
    if length < max(3 * block, round(SHORTEST / t.step)):
        return None
    return slice(t.values.size - length, t.values.size) if at_end else slice(0, length)


def _moves(t: Trace, x: Array) -> bool:
    """Whether a stretch has a slope or a bend beyond its noise."""
    s, x = np.linspace(-1.0, 1.0, x.size), x - x.mean()
    error = t.floor.of_mean(x.size)
    slope, bend = float(np.mean(x * s)) * np.sqrt(3.0), float(np.mean(x * (3.0 * s * s - 1.0))) * np.sqrt(5.0) / 2.0
    return bool(max(abs(slope), abs(bend)) > 3.0 * error)


def _constant(values: Array, at_end: bool) -> slice | None:
    x = values[::-1] if at_end else values
    other = np.flatnonzero(np.abs(x - x[0]) > 1e-9 * max(1.0, abs(float(x[0]))))
    length = int(other[0]) if other.size else x.size
    if length < 10:
        return None
    return slice(values.size - length, values.size) if at_end else slice(0, length)
