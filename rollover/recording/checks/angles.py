"""Angles that turn over from +180 to -180 degrees: said as information; all else is asked of them unwrapped."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rollover.recording.checks.finding import Finding, Trace
from rollover.recording.noise_floor import noise_floor
from rollover.spec.channels import describe

Mask = NDArray[np.bool_]

CLOSE = 8.0  # noise levels, by which a step may miss a whole turn
TURN = 2.0 * math.pi
QUICK = 0.5  # rad a sample: a step that misses a turn by more is no wrap


def wraps(t: Trace, means: Mask, turned: Mask) -> Iterator[Finding]:
    """Whole turns in a trace as it was read, not unwrapped, and means over them.

    `means` and `turned` (n,): which samples are means over a wrap, and on the other branch of roll, pitch, yaw.
    """
    if describe(t.channel).unit != "rad" or float(np.ptp(t.values)) > TURN * 1.001:
        return
    if means.any():
        yield _averaged(t, means)
        t, turned = replace(t, time=t.time[~means], values=t.values[~means]), turned[~means]
    steps = np.diff(t.values)
    # to the other branch roll and yaw step by half a turn, give or take what they moved meanwhile
    over = np.flatnonzero((np.abs(steps) > 0.5 * TURN) & (turned[1:] == turned[:-1]))
    if not over.size:
        return
    whole = np.unwrap(t.values)
    floor = noise_floor(whole)
    usual = float(np.quantile(np.abs(np.diff(whole)), 0.99))
    missed = np.abs(np.abs(steps[over]) - TURN)
    lone = np.isin(over + 1, over) & (np.sign(steps[over]) * np.sign(steps[np.minimum(over + 1, steps.size - 1)]) < 0.0)
    if np.any(missed > min(QUICK, CLOSE * floor.sigma + 3.0 * usual + 1e-6)) and lone.any():
        return  # a sample that is off by half a turn and comes back
    end = math.degrees(float(np.abs(t.values).max()))
    span = "0 and 360" if float(t.values.min()) > -0.1 and end > 270.0 else "+-180"
    yield Finding(
        check="wrap-around",
        channel=t.channel,
        start=float(t.time[over[0]]),
        end=float(t.time[over[-1] + 1]),
        value=float(over.size),
        unit="",
        error=None,
        sentence=f"wrapped at {span} degrees in {over.size} place{'s' if over.size > 1 else ''}: "
        "a wrap-around of the angle's range, information and no fault",
    )


def is_of_means(gap: Finding, t: Trace, means: Mask) -> bool:
    """Whether a gap is one that means over a wrap, of a trace as it was read, have become."""
    at = t.time[means]
    return bool(np.any((gap.start <= at) & (at <= gap.end)))


def _averaged(t: Trace, means: Mask) -> Finding:
    count, at = int(means.sum()), np.flatnonzero(means)
    return Finding(
        check="wrap-around",
        channel=t.channel,
        start=float(t.time[at[0]]),
        end=float(t.time[at[-1]]),
        value=float(count),
        unit="",
        error=None,
        sentence=f"{count} sample{'s' if count > 1 else ''} averaged over a wrap-around, as by a logger that takes "
        "means: taken as gaps, information and no fault",
    )
