"""Peaks that are cut off at one value by no more than a sample each: the rail of an amplifier or converter.

Values of a channel lie on digits d apart (of the converter, of the file, at least of floating point). If the K values
below the largest lie over a span S, about K d/S of them share a digit by chance; that the largest value comes m times
has the chance of m - 1 or more where so many are expected (Poisson).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import pdtrc

from rollover.recording.checks.finding import EXACT, Finding, Trace, digit_of
from rollover.spec.channels import UNITS, describe

Array = NDArray[np.float64]
CHANCE = 1e-4  # that a clean end of a channel is called a rail: 1 in 500 recordings of ten channels
BELOW = 20  # values below the largest, that say how dense they lie there
SMOOTH = 5.0  # times as often as values at large, that the two samples about a parabola's top share a digit
BOUNDED = ("chassis/quaternion", "ground/contact_area")  # end at one value by what they are
ANGLES = "rad"  # turn over at 180 degrees


def rails(t: Trace, unit: str, stated: set[float]) -> Iterator[Finding]:
    """Ends of a channel that several peaks reach to the last digit, or one that is a full scale's round number.

    `stated` are ends that have been found flat already.
    """
    if t.floor.sigma == 0.0 or t.channel.startswith(BOUNDED):
        return
    for sign in (1.0, -1.0):
        x = sign * t.values
        extreme = float(x.max())
        if extreme <= 0.0 or any(abs(sign * extreme - value) <= EXACT * abs(value) for value in stated):
            continue
        digit = digit_of(x)
        at = _peaks_at(x, extreme, digit)
        if not at.size:
            continue
        expected = _expected(x, extreme, digit)
        count = at.size if _holds(x, extreme) else int(np.sum(np.abs(x - extreme) <= EXACT * extreme))
        expected *= SMOOTH if count > at.size else 1.0
        by_chance = float(pdtrc(count - 2, expected)) if count > 1 else 1.0
        value = sign * extreme
        if by_chance < CHANCE:
            peaks = f"{at.size} separate peaks end" if at.size > 1 else f"its peak ends, in {count} samples,"
            what = f"{peaks} at exactly {value:.6g} {unit}"
        elif unit != ANGLES and (full := _full_scale(extreme, digit, unit)) and _stands_over(x, extreme):
            what = f"its peak reads exactly {'-' if sign < 0.0 else ''}{full}, a full scale's round number"
        else:
            continue
        yield Finding(
            check="clipping",
            channel=t.channel,
            start=float(t.time[at[0]]),
            end=float(t.time[at[-1]]),
            value=value,
            unit=unit,
            error=None,
            sentence=f"{what}: clipping at full scale (amplifier saturation), what lies beyond is lost",
        )


def shared(traces: Mapping[str, Mapping[str, Trace]]) -> Iterator[tuple[str, Finding]]:
    """(recording, finding) where a channel's peak is the same to the last digit in several recordings.

    `traces` by recording and channel. A recording that is there twice has all its samples alike, and says nothing.
    """
    channels = dict.fromkeys(c for of in traces.values() for c in of)
    for channel in channels:
        if channel.startswith(BOUNDED) or describe(channel).unit == ANGLES:
            continue
        there = {name: of[channel] for name, of in traces.items() if channel in of}
        for sign in (1.0, -1.0):
            yield from _shared(channel, sign, {name: t for name, t in there.items() if t.floor.sigma > 0.0})


def _shared(channel: str, sign: float, there: Mapping[str, Trace]) -> Iterator[tuple[str, Finding]]:
    tops = {name: float((sign * t.values).max()) for name, t in there.items()}
    groups: dict[str, list[str]] = {}
    for name, top in tops.items():
        if top > 0.0:
            groups.setdefault(f"{top:.10g}", []).append(name)
    for names in groups.values():
        top = tops[names[0]]
        different = _different([there[name] for name in names])
        highest = top >= (1.0 - EXACT) * max(tops.values())
        if not highest:
            continue
        expected = max(_expected(x, top, digit_of(x)) for x in (sign * t.values for t in different))
        # the first says where, each other one has to meet it with one of its own highest values
        if float(expected ** (len(different) - 1)) >= CHANCE:
            continue
        unit = describe(channel).unit
        for name in names:
            t = there[name]
            at = np.flatnonzero(np.abs(sign * t.values - top) <= EXACT * top)
            yield (
                name,
                Finding(
                    check="clipping",
                    channel=channel,
                    start=float(t.time[at[0]]),
                    end=float(t.time[at[-1]]),
                    value=sign * top,
                    unit=unit,
                    error=None,
                    sentence=f"its peak ends at exactly {sign * top:.6g} {unit} in {len(names)} recordings: "
                    "clipping at full scale (amplifier saturation), what lies beyond is lost",
                ),
            )


def _different(traces: Sequence[Trace]) -> list[Trace]:
    """Traces of which no two are one recording twice."""
    found: list[Trace] = []
    for t in traces:
        n = [min(t.values.size, o.values.size) for o in found]
        if not any(np.mean(t.values[:k] == o.values[:k]) > 0.5 for k, o in zip(n, found, strict=True)):
            found.append(t)
    return found


def _peaks_at(x: Array, extreme: float, digit: float) -> NDArray[np.int64]:
    """First samples of the runs at the extreme that begin and end inside, with a step larger than a digit."""
    there = np.abs(x - extreme) <= EXACT * extreme
    edges = np.flatnonzero(np.diff(np.concatenate([[False], there, [False]]).astype(np.int8)))
    starts, ends = edges[::2], edges[1::2]
    inside = (starts > 0) & (ends < x.size)
    starts, ends = starts[inside], ends[inside]
    least = 1.5 * digit
    steep = (extreme - x[starts - 1] > least) & (extreme - x[ends] > least)
    return np.asarray(starts[steep])


def _holds(x: Array, extreme: float) -> bool:
    """Whether a channel repeats samples elsewhere, as one does that is read more often than it is measured."""
    same = np.diff(x) == 0.0
    return bool(np.any(same & (x[1:] != 0.0) & (np.abs(x[1:] - extreme) > EXACT * extreme)))


def _expected(x: Array, extreme: float, digit: float) -> float:
    """How many values share the digit of the largest by chance."""
    below = np.sort(x[extreme - x > EXACT * extreme])[-BELOW:]
    if below.size < BELOW:
        return math.inf
    return BELOW * digit / float(extreme - below[0])


def _stands_over(x: Array, extreme: float) -> bool:
    """Whether the largest value belongs to a pulse: far beyond the middle half of all."""
    low, high = np.quantile(x, [0.25, 0.75])
    return bool(extreme - high > 5.0 * max(float(high - low), 1e-12 * extreme))


def _full_scale(extreme: float, digit: float, unit: str) -> str:
    """The extreme in the unit in which it is exactly one digit and noughts, or two; nothing if that may be chance.

    There are 9 such numbers in a decade with one digit, 90 with two: a value known to `digit` is one of these in some
    of the units with the chance of their number over ln 10, times digit over value.
    """
    known = UNITS.get(unit, {})
    scales = {round(math.log(f) if f > 0.0 else 0.0, 9): (name, f) for name, f in reversed(known.items())}
    close = max(digit / extreme, EXACT)
    for digits in (1, 2):
        for name, f in scales.values():
            value = extreme / f
            rounded = float(f"{value:.{digits - 1}e}")
            if abs(value - rounded) > EXACT * value:
                continue
            if len(scales) * 9 * 10 ** (digits - 1) / math.log(10.0) * close < CHANCE:
                return f"{rounded:.6g} {name}"
    return ""
