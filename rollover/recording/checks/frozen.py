"""A channel that reads one value to the end, or for a good part of it: a cable, a converter or a logger that stopped.

Noise of sigma lets two samples share a digit d with the chance d/(2 sigma sqrt(pi)) at most: n independent ones do so
with its power of n. What has come to rest may be quieter than what moves: the chance is that of a third of the noise.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from rollover.recording.checks.finding import Finding, Trace, digit_of
from rollover.recording.noise_floor import LENGTH, noise_floor

CHANCE = 1e-4  # that a clean channel is called frozen
QUIETER = 3.0  # times less noise at rest than before
LONG = 10  # samples at least: less is a dropout, or chance
FAR = 10.0  # noises, by which what breaks off leaps to 0
FLOOR = ("N", "m")  # units of what may end at 0 by what it is: a force, a depth, a deflection


def frozen(t: Trace, unit: str) -> Iterator[Finding]:
    """The longest run of one value, where it lasts to the end or makes the channel look free of noise."""
    start, stop = _longest(t.values)
    to_the_end = stop == t.values.size
    if stop - start < LONG or start == 0 or not (to_the_end or t.floor.sigma == 0.0):
        return
    others = t.values[:start] if to_the_end or start >= t.values.size - stop else t.values[stop:]
    if others.size < 2 * LENGTH:
        return
    floor = noise_floor(others)
    level = float(t.values[start])
    jump = abs(float(t.values[start - 1]) - level)
    if level == 0.0 and (unit in FLOOR or jump < FAR * floor.sigma):
        return
    if floor.sigma == 0.0:
        return
    alike = digit_of(others) * QUIETER / (2.0 * floor.sigma * math.sqrt(math.pi))
    count = (stop - start) / floor.independence
    if alike >= 1.0 or count * -math.log(alike) < math.log(t.values.size / CHANCE):
        return
    until = "to the end" if to_the_end else f"over {stop - start} samples"
    yield Finding(
        check="stuck",
        channel=t.channel,
        start=float(t.time[start]),
        end=float(t.time[stop - 1]),
        value=level,
        unit=unit,
        error=None,
        sentence=f"reads exactly {level:.6g} {unit} {until}, {stop - start} samples, after noise of "
        f"{floor.sigma:.3g} {unit}: a frozen channel, of a broken cable, a converter or a logger that stopped",
    )


def _longest(values: NDArray[np.float64]) -> tuple[int, int]:
    """First sample of the longest run of one value, and the one behind its last."""
    begun = np.flatnonzero(np.diff(values, prepend=np.nan) != 0.0)
    ends = np.append(begun[1:], values.size)
    k = int(np.argmax(ends - begun))
    return int(begun[k]), int(ends[k])
