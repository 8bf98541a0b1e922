"""A recording laid over a simulation by least squares of all channels that both have: where its zero is.

The simulation stays before and after as it begins and ends, so that every sample that was recorded counts wherever it
is laid.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from ground.drops import correlated
from rollover.comparison import alignment
from rollover.comparison.misfit import estimated_noise, sigma_of
from rollover.recording import Recording
from rollover.recording.filters import least_rate
from rollover.spec.channels import describe

Array = NDArray[np.float64]
SHAPE = 0.05  # of a channel's range: what a scenario may miss where all channels are laid over it
MOST, SAMPLES = 0.5, 2000  # of the variance that may stay when laid over one another; samples of a channel there
APART = 0.1  # of the time that is compared: 3 sigma of a zero beyond tell nothing
PLACES, LONGEST = 601, 20_000  # zeros that are tried over twice a run, and at most


@dataclass(frozen=True, kw_only=True)
class Part:
    """A channel beside its simulation: samples (n,), rows of the run (m,), and 1 sigma of what they may differ by."""

    channel: str
    time: Array
    values: Array
    run_time: Array
    run: Array
    scale: float

    def off(self, zero: float) -> Array:
        """What is between them over the scale, (n,); angles whichever way round."""
        away = self.values - np.interp(self.time - zero, self.run_time, self.run)
        if describe(self.channel).unit == "rad":
            away = np.remainder(away + np.pi, 2.0 * np.pi) - np.pi
        return np.asarray(away / self.scale)

    def unlike(self, zero: float | None) -> float:
        """Sum of squares that the simulation leaves at any gain and level; of the values alone for None."""
        y = (self.values - self.values.mean()) / self.scale
        if zero is None:
            return float(y @ y)
        x = np.interp(self.time - zero, self.run_time, self.run)
        x, power = x - x.mean(), float(np.sum((x - x.mean()) ** 2))
        gain = max(float(x @ y) / power, 0.0) if power > 0.0 else 0.0
        return float(np.sum((y - gain * x) ** 2))


def parts(recording: Recording, run: Recording) -> Iterator[Part]:
    """The channels that a recording and a run have in common and that move."""
    for channel in recording.channels:
        time, values = recording.samples(channel)
        if channel not in run.channels or time.size < 2:
            continue
        every = -(-time.size // SAMPLES)
        made = behind(run, channel, recording.cfc.get(channel))
        span = max(float(np.ptp(values)), float(np.ptp(made)))
        if span <= 0.0:
            continue
        scale = float(np.hypot(sigma_of(recording, channel, estimated_noise) or 0.0, SHAPE * span))
        yield Part(
            channel=channel, time=time[::every], values=values[::every], run_time=run.time, run=made, scale=scale
        )


def laid_over(recording: Recording, run: Recording) -> tuple[float, float, tuple[str, ...]] | None:
    """Where a run's zero is on a recording's stamps, s, 1 sigma, and the channels; None if they are alike nowhere."""
    common = list(parts(recording, run))
    if not common:
        return None
    start, end = float(run.time[0]), float(run.time[-1])
    low, high = float(recording.time[0]) - end, float(recording.time[-1]) - start

    def left(zero: float) -> float:
        return sum(float(np.sum(p.off(zero) ** 2)) for p in common)

    step = max(min(high - low, 2.0 * (end - start)) / PLACES, (high - low) / LONGEST)
    places = np.arange(low, high + step, step)
    for _ in range(3):
        costs = np.array([left(float(z)) for z in places])
        best = float(places[int(np.argmin(costs))])
        step = float(places[1] - places[0])
        places = np.linspace(best - 2.0 * step, best + 2.0 * step, 81)
    best = float(minimize_scalar(left, bounds=(best - step, best + step), method="bounded", options={"xatol": 1e-9}).x)
    least = left(best)
    alike = sum(p.unlike(best) for p in common), sum(p.unlike(None) for p in common)
    overlap = min(float(recording.time[-1]) - best, end) - max(float(recording.time[0]) - best, start)
    if alike[0] > MOST * alike[1] or overlap <= 0.0:
        return None
    h = max(0.25 * step, 1e-6)
    bend = (left(best + h) - 2.0 * least + left(best - h)) / h**2
    count = sum(p.values.size for p in common)
    worth = max(correlated(p.off(best)) for p in common)
    if bend <= 0.0:
        return None
    sigma = float(np.sqrt(2.0 / bend * least / count * worth))
    # what is left bends the minimum as well: no better than the step of the simulation's rows
    sigma = float(np.hypot(sigma, np.median(np.diff(run.time)) / np.sqrt(12.0)))
    if 3.0 * sigma > APART * overlap:
        return None
    return best, sigma, tuple(p.channel for p in common)


def behind(run: Recording, channel: str, cfc: int | None) -> Array:
    """A channel of a run through the class that the recording went through."""
    values, step = run[channel], float(np.median(np.diff(run.time)))
    if cfc is None or 1.0 / step < least_rate(cfc):
        return values
    return alignment.through(run.time, values, step, cfc)
