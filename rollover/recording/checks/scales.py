"""Units of a drop's channels by what a drop can do: its speed at contact, its momentum, its weight.

A striker of mass m that lands at u moves on at u at most, so that half its depth z_max takes it the time

    t_half >= 0.5 z_max/u                                                                           (S1)

(a constant deceleration to rest: 0.59 z_max/u), seldom ten times that. The ground takes its momentum at least, at most
twice that and the weight over the pulse's length T:

    m u <= int F dt <= 2 m u + m g T,    u <= int a dt over the same pulse <= 2 u                   (S2)

What lies beyond by far more than any of this leaves open, and by about a thousand or by g, is a unit that was misread.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from rollover.recording.checks.finding import Finding, Trace, plateau

FORCE, DEPTH, ACCELERATION = "ground/force_normal", "ground/sinkage", "striker/acceleration_z"
PULSE = 0.2  # of the peak, within which a pulse is looked at: it holds 80 % of a half sine's momentum and more
TOO_LITTLE, TOO_MUCH = 0.03, 30.0  # of (S1), (S2): half-way, in powers of ten, between what is right and a thousand
G_LOW, G_HIGH = 0.05, 0.25  # of the speed: an impulse in g is 1/9.81 of it, 0.8 to 2 times
SHARES = (0.1, 0.5)  # of the depth, between which its speed is taken
IMPOSSIBLE = 3.0  # times the change of speed of a perfect rebound: m/s2 read as g are 4.9 times that, and more
OVER = 0.7  # of the peak, below which a record that ends has the larger part of the pulse behind it
CLEAR = 20.0  # noises, over which a pulse stands
FEWEST = 4  # samples of it
SAME = 0.03  # of g: its spread over the earth, and a gain of 2 %
AXES = ("x", "y", "z")


def scales(
    traces: Mapping[str, Trace], conditions: Mapping[str, Any], mass: float | None, gravity: float, proper: set[str]
) -> Iterator[Finding]:
    """Units of force, depth and acceleration in a drop at a stated speed, and gravity that an accelerometer includes.

    `proper` are accelerometers that are said to include it.
    """
    yield from _gravity_included(traces, gravity, proper)
    speed = conditions.get("initiation.speed")
    if not isinstance(speed, (int, float)) or not speed > 0.0 or isinstance(speed, bool):
        return
    depth, load, read = (traces.get(name) for name in (DEPTH, FORCE, ACCELERATION))
    if depth is not None and (found := _of_depth(depth, float(speed))):
        yield found
        return  # the time itself may be what is wrong
    if load is not None and mass is not None and (found := _of_force(load, float(speed), mass, gravity)):
        yield found
    if read is not None and ACCELERATION not in proper and (found := _of_acceleration(read, float(speed), gravity)):
        yield found


def _of_depth(t: Trace, speed: float) -> Finding | None:
    top = int(np.argmax(t.values))
    most = float(t.values[top])
    before = t.values[: top + 1]
    if most < CLEAR * t.floor.sigma or top < FEWEST:
        return None
    under = [np.flatnonzero(before < share * most) for share in SHARES]
    low, high = (int(rows[-1]) if rows.size else 0 for rows in under)
    if high - low < FEWEST:
        return None
    ratio = (SHARES[1] - SHARES[0]) * most / float(t.time[high] - t.time[low]) / speed
    if TOO_LITTLE < ratio < TOO_MUCH:
        return None
    means = "stamps in ms taken for s, or m for mm" if ratio < 1.0 else "stamps in s taken for ms, or mm for m"
    return _finding(t, low, high, ratio, f"goes down at {ratio * speed:.3g} m/s where it lands at {speed:.3g}: {means}")


def _of_force(t: Trace, speed: float, mass: float, gravity: float) -> Finding | None:
    where = _pulse(t)
    if where is None:
        return None
    length = float(t.time[where.stop - 1] - t.time[where.start])
    impulse = float(np.trapezoid(t.values[where], t.time[where]))
    least, most = mass * speed, 2.0 * mass * speed + mass * gravity * length
    ratio = impulse / (least if impulse < least else most)
    if TOO_LITTLE < ratio < TOO_MUCH:
        return None
    means = (
        "kN taken for N, or stamps in s taken for ms" if ratio < 1.0 else "N taken for kN, or stamps in ms taken for s"
    )
    what = f"its pulse holds {impulse:.3g} N s where {mass:.4g} kg at {speed:.3g} m/s have {least:.3g}"
    return _finding(t, where.start, where.stop - 1, ratio, f"{what}: {means}")


def _of_acceleration(t: Trace, speed: float, gravity: float) -> Finding | None:
    where = _pulse(t)
    if where is None:
        return None
    change = float(np.trapezoid(t.values[where], t.time[where]))
    ratio = change / speed if change < speed else change / (2.0 * speed)
    if G_LOW < ratio < G_HIGH:
        means = "g taken for m/s2"
    elif ratio < TOO_LITTLE:
        means = "stamps in s taken for ms, or another unit"
    elif ratio > TOO_MUCH:
        means = "stamps in ms taken for s, or another unit"
    elif ratio > IMPOSSIBLE:
        means = "m/s2 taken for g"
    else:
        return None
    what = f"its pulse changes the speed by {change:.3g} m/s where {speed:.3g} to {2.0 * speed:.3g} are possible"
    return _finding(t, where.start, where.stop - 1, ratio, f"{what}: {means}")


def _pulse(t: Trace) -> slice | None:
    """The stretch about the largest value that stays above a part of it, both ends inside the record; None if none."""
    top = int(np.argmax(t.values))
    peak = float(t.values[top])
    if peak < CLEAR * t.floor.sigma:
        return None
    below = np.flatnonzero(t.values < PULSE * peak)
    before, after = below[below < top], below[below > top]
    end = int(after[0]) + 1 if after.size else t.values.size  # a weight that rests is part of it
    is_over = after.size > 0 or float(t.values[-FEWEST:].max()) < OVER * peak
    if not before.size or not is_over or end - before[-1] - 2 < FEWEST:
        return None
    return slice(int(before[-1]), end)


def _gravity_included(traces: Mapping[str, Trace], gravity: float, proper: set[str]) -> Iterator[Finding]:
    """Accelerometers that read g where a body has come to rest: what holds it up, not how its speed changes."""
    for body in ("striker", "chassis"):
        axes = [t for axis in AXES if (t := traces.get(f"{body}/acceleration_{axis}")) and t.channel not in proper]
        ends = [(t, where) for t in axes if (where := plateau(t, at_end=True)) is not None]
        if not ends or len(ends) < len(axes):
            continue
        levels = [float(t.values[where].mean()) for t, where in ends]
        size = float(np.linalg.norm(levels))
        error = float(np.linalg.norm([t.floor.of_mean(where.stop - where.start) for t, where in ends]))
        if abs(size - gravity) > SAME * gravity or error > SAME * gravity:
            continue
        t, where = ends[int(np.argmax(np.abs(levels)))]
        said = f"reads {levels[int(np.argmax(np.abs(levels)))]:.4g} m/s2 at rest"
        said += f", {size:.4g} with the other axes" if len(ends) > 1 else ""
        means = "gravity is included, proper acceleration (`gravity: proper` of its sensor)"
        yield _finding(t, where.start, where.stop - 1, size, f"{said}, where it should read 0: {means}", unit="m/s2")


def _finding(t: Trace, first: int, last: int, value: float, sentence: str, *, unit: str = "1") -> Finding:
    return Finding(
        check="gain",
        channel=t.channel,
        start=float(t.time[first]),
        end=float(t.time[last]),
        value=value,
        unit=unit,
        error=None,
        sentence=sentence,
    )
