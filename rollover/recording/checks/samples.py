"""Single samples and runs of them: flat tops, stuck and missing samples, spikes."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri, pdtrc

from rollover.recording.checks.finding import Finding, Trace
from rollover.recording.checks.neighbours import beside, off_a_cubic

CHANCE = 0.001  # that a clean channel shows a stuck run
SPIKE = 1e-4  # that it shows a spike: 1 in 1000 recordings of ten channels
FEWEST = 120  # samples, to know what is usual
FLAT = 3  # samples exactly alike at the very top: what a peak that is measured does not do
TURNS = 6  # times as long as beside it, that a digitised signal stays where it turns: 2/(sqrt 2 - 1), and some
APART = 60  # samples within which a disturbance stands alone
AROUND = 6  # samples on either side that say what a sample should be
ALONE = 0.5  # of what a spike is off both sides, at least, that it is off each
MOST = 0.05  # of the samples, that lie far off what their neighbours say
LARGER = 2.0  # times the largest quick event among contacts: these scatter by as much from one to the next
CROWDED = 0.05  # chance below which spikes that lie together are something quick
ROUNDING = 1e-9  # of a noise, that is arithmetic's
OFFSETS = beside(AROUND)
SPREAD = np.eye(2 * AROUND) - np.vander(OFFSETS / AROUND, 4) @ np.linalg.pinv(np.vander(OFFSETS / AROUND, 4))
BEFORE, AFTER = (np.linalg.pinv(np.vander(side, 3))[-1] for side in (OFFSETS[:AROUND], OFFSETS[AROUND:]))


def clipping(t: Trace, unit: str) -> Iterator[Finding]:
    """Runs of exactly equal samples at the largest or smallest value, entered and left in a step."""
    for extreme, side in ((float(t.values.max()), "top"), (float(t.values.min()), "bottom")):
        if extreme == 0.0:
            continue  # forces and sinkage have a natural floor
        starts, lengths = _runs(t.values, np.abs(t.values - extreme) <= 1e-9 * abs(extreme))
        inside = (starts > 0) & (starts + lengths < t.values.size)
        flat = inside & (lengths >= max(FLAT, _usual_run(t.values, extreme)))
        flat &= ~_creeping(t.values, starts, lengths) | (lengths > TURNS * _beside(t.values, starts))
        if not flat.any():
            continue
        first, last = int(starts[flat][0]), int((starts + lengths)[flat][-1]) - 1
        jump = np.abs(t.values[starts[flat] - 1] - extreme).max()
        if jump <= 1e-6 * abs(extreme) or not _piled_up(t.values, extreme):
            continue
        yield Finding(
            check="clipping",
            channel=t.channel,
            start=float(t.time[first]),
            end=float(t.time[last]),
            value=extreme,
            unit=unit,
            error=None,
            sentence=f"flat {side} at {extreme:.5g} {unit} over {int(lengths[flat].sum())} samples: "
            "clipping at full scale (amplifier saturation), what lies beyond is lost",
        )


def _usual_run(values: NDArray[np.float64], extreme: float) -> int:
    """What a digitised signal makes alike by itself: three times the longest run at any other level, plus one."""
    same = np.diff(values) == 0.0
    other = same & (np.abs(values[1:] - extreme) > 1e-9 * abs(extreme)) & (values[1:] != 0.0)
    if not other.any():
        return 0
    starts, lengths = _runs(values[1:], other)
    inner = lengths[(starts > 0) & (starts + lengths < other.size)]
    # a few long runs are stuck stretches, many short ones the digitising
    return 3 * (int(np.quantile(inner, 0.9)) + 1) + 1 if inner.size > 3 else FLAT + 1


def _piled_up(values: NDArray[np.float64], extreme: float) -> bool:
    """Whether more samples stand at an end than at the next two levels: digits of noise grow fewer towards it."""
    levels, counts = np.unique(values, return_counts=True)
    counts = counts if extreme == levels[-1] else counts[::-1]
    return bool(counts[-1] > counts[-3:-1].sum())


def _creeping(values: NDArray[np.float64], starts: NDArray[np.int64], lengths: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether runs of one value are entered and left by a digit at most, as those of a slow digitised signal are."""
    steps = np.abs(np.diff(values))
    digit = np.min(steps[steps > 0.0], initial=np.inf)
    into, out = steps[np.maximum(starts - 1, 0)], steps[np.minimum(starts + lengths, steps.size) - 1]
    return np.asarray(np.maximum(into, out) < 1.5 * digit)


def _beside(values: NDArray[np.float64], starts: NDArray[np.int64]) -> NDArray[np.int64]:
    """Samples of the longer one of the runs before and after the runs of one value that begin at `starts`."""
    begun = np.flatnonzero(np.diff(values, prepend=np.nan) != 0.0)
    sizes = np.concatenate([[0], np.diff(begun, append=values.size), [0]])
    at = np.searchsorted(begun, starts)
    return np.asarray(np.maximum(sizes[at], sizes[at + 2]))


def stuck(t: Trace, unit: str) -> Iterator[Finding]:
    """Interior runs of one repeated value, away from the extremes, longer than the digitising explains."""
    if t.floor.sigma == 0.0:
        return
    same = np.diff(t.values) == 0.0
    starts, lengths = _runs(t.values[1:], same)
    if not starts.size:
        return
    level = t.values[starts]
    away = (level != t.values.max()) & (level != t.values.min())
    away &= (starts > 0) & (starts + lengths < same.size)
    usual = (same.sum() - lengths.max()) / max(1, same.size - lengths.max())  # chance that a sample repeats
    away &= ~_creeping(t.values, starts, lengths + 1)
    most = 2.0 if usual <= 0.0 else max(2.0, math.log(t.values.size / CHANCE) / -math.log(min(0.99, usual)))
    for start, length in zip(starts[away & (lengths > most)], lengths[away & (lengths > most)], strict=True):
        yield Finding(
            check="stuck",
            channel=t.channel,
            start=float(t.time[start]),
            end=float(t.time[start + length]),
            value=float(t.values[start]),
            unit=unit,
            error=None,
            sentence=f"{int(length) + 1} samples in a row read exactly {t.values[start]:.6g} {unit}: "
            "a dropout, in which the logger repeated a sample",
        )


def gaps(t: Trace) -> Iterator[Finding]:
    """Samples missing from an otherwise even clock."""
    if not t.regular:
        return
    steps = np.diff(t.time)
    wide = np.flatnonzero(steps > 1.5 * t.step)
    if wide.size:
        lost = int(np.sum(np.round(steps[wide] / t.step) - 1))
        yield Finding(
            check="gap",
            channel=t.channel,
            start=float(t.time[wide[0]]),
            end=float(t.time[wide[-1] + 1]),
            value=float(lost),
            unit="samples",
            error=None,
            sentence=f"{lost} samples missing in {wide.size} places at {1.0 / t.step:.6g} Hz: "
            "lost samples (dropout of the logger)",
        )


def spikes(t: Trace, unit: str, *, among_contacts: bool = False) -> Iterator[Finding]:
    """Single samples far from what a cubic through their neighbours says, where these agree.

    And from what those before and those after say, each by themselves: at a corner or a jump one side is right. The
    largest first, each put where its neighbours say before the next is looked for, as it spoils what is said of these.
    `among_contacts`: of a force or acceleration of a vehicle, which touches again and again for no more than a sample.
    A spike is larger there than such contacts, those that hide in noise and, once it touches, all that are seen.
    """
    if not t.regular or t.floor.sigma == 0.0 or t.values.size < FEWEST:
        return
    values = t.values.copy()
    error = off_a_cubic(values, AROUND)
    inner = np.abs(error[AROUND:-AROUND])
    scale = float(np.median(inner[inner <= np.median(inner) * 6.0])) / 0.6745
    if scale < ROUNDING * t.floor.sigma:
        # most samples read exactly what their neighbours say: digits, one of which is no disturbance
        apart = np.diff(np.unique(values))
        scale = float(np.min(apart[apart > ROUNDING * t.floor.sigma]))
    beyond = -float(ndtri(0.5 * SPIKE / values.size)) * scale
    left, found = np.ones(values.size, dtype=bool), dict[int, float]()
    while abs(error[i := int(np.argmax(np.abs(error) * left))]) > beyond and left[i]:
        left[i] = False
        if np.mean(left) < 1.0 - MOST:
            return  # sampled too slowly for what happens: a neighbour says little
        if _stands_alone(values, i, error, t.floor.sigma):
            found[i] = float(error[i])
            values[i] -= error[i]
            error = off_a_cubic(values, AROUND)
    if np.mean(np.abs(error) > 3.0 * scale) > MOST:
        return  # so here
    quick = np.flatnonzero(np.abs(error) > beyond)
    contacts = np.abs(error[quick]).max(initial=0.0) if among_contacts else 0.0
    begun = quick[0] - APART if among_contacts and quick.size else values.size
    events = np.array([*found, *quick[np.diff(quick, prepend=-AROUND - 1) > AROUND]], dtype=np.int64)
    for i in sorted(found):
        if _crowded(events, i, values.size):
            continue  # something quick happens
        if among_contacts and abs(found[i]) <= LARGER * max(beyond, contacts if i > begun else 0.0):
            continue  # a contact as any other
        yield Finding(
            check="spike",
            channel=t.channel,
            start=float(t.time[i]),
            end=float(t.time[i]),
            value=found[i],
            unit=unit,
            error=scale,
            sentence=f"one sample lies {found[i]:.4g} {unit} off its neighbours, {abs(found[i]) / scale:.1f} sigma: "
            "an electromagnetic spike, or a contact no longer than one sample",
        )


def _stands_alone(values: NDArray[np.float64], i: int, error: NDArray[np.float64], sigma: float) -> bool:
    """Whether the samples around i agree, with one another and from either side of it, that it is off."""
    if np.linalg.norm(SPREAD @ values[i + OFFSETS]) > 1.6 * sigma * math.sqrt(2 * AROUND - 4):
        return False  # something quick happens here
    sides = values[i] - np.array([BEFORE @ values[i - AROUND : i], AFTER @ values[i + 1 : i + AROUND + 1]])
    # else the motion's own, on the way up or down from here
    return bool(np.min(sides * np.sign(error[i])) >= ALONE * abs(error[i]))


def _crowded(at: NDArray[np.int64], i: int, n: int) -> bool:
    """Whether so many of the spikes `at` among n samples lie near i as chance would hardly put there: Poisson."""
    near = int(np.sum(np.abs(at - i) <= APART)) - 1
    return near > 0 and float(pdtrc(near - 1, (at.size - 1) * (2 * APART + 1) / n)) < CROWDED


def _runs(values: NDArray[np.float64], where: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Starts and lengths of the runs where `where` holds and the value stays the same."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], where, [False]]).astype(np.int8)))
    return edges[::2], edges[1::2] - edges[::2]
