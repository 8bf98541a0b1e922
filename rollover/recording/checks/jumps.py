"""Jumps that a channel's filter class lets no signal make: they come behind it, of an open contact or of lost samples.

A sample is held against the cubic through three neighbours on either side: about a jump two of them lie off theirs, one
to either side, by nearly half of it. Behind the filter even an impact of no duration stays smooth; what two of it lie
off is a known part of its height, whatever the motion. Clips, gaps, spikes and digits have reasons of their own.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from rollover.recording.checks.finding import Finding, Trace
from rollover.recording.checks.neighbours import off_a_cubic
from rollover.recording.filters import filtered, least_rate

Array = NDArray[np.float64]
REACH = 3  # samples to either side
ONE = np.eye(1, 4 * REACH + 1, 2 * REACH)[0]  # a sample among those that it touches
PHASES = 8  # at which an impact may fall between two samples
MARGIN = 1.5  # times what an impact of no duration leaves
TELLING = 0.3  # of a jump: not told where impacts lie nearly as far off
NOISY = 4.0  # standard deviations of the noise of such a difference
BACK = 0.5  # of a jump, that comes back at the next sample: a spike
DIGITS = 1.5  # steps of a digitised channel
DECAY = 2.0  # periods of the filter's -3 dB frequency within which it is done with an impact
AGAIN = 2  # jumps, at least: one alone is a disturbance


def jumping(t: Trace, cfc: int | None) -> NDArray[np.int64]:
    """Samples before which a channel jumps as its filter class `cfc` lets none; none where that cannot be told."""
    rate = 1.0 / t.step
    if cfc is None or not t.regular or t.values.size < 8 * REACH or rate < least_rate(cfc):
        return np.zeros(0, dtype=np.int64)
    most = MARGIN * of_an_impact(round(rate, 3), cfc)
    if most > TELLING:
        return np.zeros(0, dtype=np.int64)
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    width = 2 * max(REACH, round(DECAY * 0.6 / cfc / t.step)) + 1
    about = maximum_filter1d(t.values, width) - minimum_filter1d(t.values, width)
    steps = np.abs(np.diff(t.values))
    digit = float(np.min(steps[steps > 0.0], initial=np.inf))
    noise = t.floor.sigma * float(np.linalg.norm(off_a_cubic(ONE, REACH)))
    off = across(t.values)
    even = np.concatenate([np.abs(np.diff(t.time) - t.step) < 0.5 * t.step, np.ones(1, dtype=bool)])
    same = np.concatenate([[False], steps == 0.0, [False]])
    ends = np.isin(t.values, [t.values.max(), t.values.min()]) & (same[1:] | same[:-1])  # a clip has corners
    sound = minimum_filter1d((even & ~ends).astype(np.int8), 2 * REACH + 1) > 0
    least = most * about + NOISY * noise + (DIGITS * digit if digit < np.inf else 0.0)
    beyond = np.flatnonzero((off > least) & sound)
    together = np.split(beyond, np.flatnonzero(np.diff(beyond) > REACH) + 1)
    most_off = np.array([k[np.argmax(off[k])] for k in together if k.size], dtype=np.int64)
    again = np.maximum(off[most_off - 1], off[most_off + 1])
    return most_off[again < BACK * off[most_off]]


def jumps(t: Trace, unit: str, cfc: int | None) -> Iterator[Finding]:
    """Jumps that the filter class of a channel lets no signal make, if there are several."""
    found = jumping(t, cfc)
    if found.size < AGAIN:
        return
    off = across(t.values)[found]
    yield Finding(
        check="jump",
        channel=t.channel,
        start=float(t.time[found[0]]),
        end=float(t.time[found[-1]]),
        value=float(found.size),
        unit="",
        error=None,
        sentence=f"{found.size} jumps of up to {2.0 * float(off.max()):.4g} {unit} from one sample to the next, which "
        f"CFC {cfc} lets no signal make: an intermittent contact after the filter, or lost samples",
    )


def across(values: Array) -> Array:
    """How far each sample (n,) and the one before it lie off such cubics to either side, the less of both; else 0."""
    off = off_a_cubic(values, REACH)
    before = np.concatenate([[0.0], off[:-1]])
    return np.where(off * before < 0.0, np.minimum(np.abs(off), np.abs(before)), 0.0)


@functools.lru_cache(maxsize=64)
def of_an_impact(rate: float, cfc: int) -> float:
    """How far an impact of no duration behind a filter class lies off cubics, over its height, at a rate (Hz)."""
    fine = 1.0 / (PHASES * rate)
    impact = np.zeros(2 * PHASES * max(200, round(4.0 * rate * 0.6 / cfc)))
    impact[impact.size // 2] = 1.0
    behind = filtered(impact, fine, cfc)
    return max(float(across(behind[k::PHASES]).max()) for k in range(PHASES)) / float(np.ptp(behind))
