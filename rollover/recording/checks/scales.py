"""Units of a drop's channels by what a drop can do: its speed at contact, its momentum, its weight.

A striker of mass m that lands at u moves on at u at most, so that half its depth z_max takes it the time

    t_half >= 0.5 z_max/u                                                                           (S1)

(a constant deceleration to rest: 0.59 z_max/u), seldom ten times that. Up to its greatest depth it has lost all its
speed, of a pulse of length T whatever follows it has turned it round at most:

    int a dt = u,    int F dt = m u + m g T    to the greatest depth                                (S2)
    int a dt <= 2 u,    int F dt <= 2 m u + m g T    of a pulse                                     (S3)

What lies beyond by more than any of this leaves open, and by about a thousand or by g, is a unit that was misread.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from rollover.recording.checks.finding import Finding, Trace, plateau

FORCE, DEPTH, ACCELERATION = "ground/force_normal", "ground/sinkage", "striker/acceleration_z"
PULSE = 0.2  # of the peak, within which a pulse is looked at: it holds 80 % of a half sine's momentum and more
TOO_LITTLE, TOO_MUCH = 0.03, 30.0  # of (S1) to (S3): half-way, in powers of ten, between what is right and a thousand
G_LOW, G_HIGH = 0.04, 0.2  # of the speed: in g 1/9.81 of it, of which a tenth of the depth may have taken a half
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
    depth, load, read = (traces.get(name) for name in (DEPTH, FORCE, ACCELERATION))
    if load is not None and mass is not None and (found := _of_weight(load, mass * gravity)):
        yield found
        return
    speed = conditions.get("initiation.speed")
    if not isinstance(speed, (int, float)) or isinstance(speed, bool) or not speed > 0.0:
        return
    stop = None if depth is None else _stop(depth)
    if depth is not None and stop is not None and (found := _of_depth(depth, stop, float(speed))):
        yield found
        return  # the time itself may be what is wrong
    if load is not None and mass is not None and (found := _of_force(load, stop, float(speed), mass, gravity)):
        yield found
    if read is not None and ACCELERATION not in proper and (found := _of_acceleration(read, stop, float(speed))):
        yield found


def _stop(depth: Trace) -> tuple[float, float, float] | None:
    """When a tenth and when half of the greatest depth is reached, and when that itself; None if it is not reached."""
    top = int(np.argmax(depth.values))
    most = float(depth.values[top])
    if most < CLEAR * depth.floor.sigma or top >= depth.values.size - FEWEST:
        return None
    under = [np.flatnonzero(depth.values[: top + 1] < share * most) for share in SHARES]
    if not all(rows.size for rows in under) or under[1][-1] - under[0][-1] < FEWEST:
        return None
    low, high = (float(depth.time[rows[-1]]) for rows in under)
    return low, high, float(depth.time[top])


def _of_depth(t: Trace, stop: tuple[float, float, float], speed: float) -> Finding | None:
    ratio = (SHARES[1] - SHARES[0]) * float(t.values.max()) / (stop[1] - stop[0]) / speed
    if TOO_LITTLE < ratio < TOO_MUCH:
        return None
    means = "stamps in ms taken for s, or m for mm" if ratio < 1.0 else "stamps in s taken for ms, or mm for m"
    return _finding(t, stop[:2], ratio, f"goes down at {ratio * speed:.3g} m/s where it lands at {speed:.3g}: {means}")


def _of_weight(t: Trace, weight: float) -> Finding | None:
    where = plateau(t, at_end=True)
    if where is None:
        return None
    level, error = float(t.values[where].mean()), t.floor.of_mean(where.stop - where.start)
    for times, means in ((1e-3, "kN taken for N"), (1e3, "N taken for kN")):
        if abs(level - times * weight) < SAME * times * weight and error < SAME * times * weight:
            what = f"reads {level:.4g} N at rest, where it carries {weight:.4g} N"
            return _finding(t, (t.time[where][0], t.time[where][-1]), level / weight, f"{what}: {means}")
    return None


def _of_force(
    t: Trace, stop: tuple[float, float, float] | None, speed: float, mass: float, gravity: float
) -> Finding | None:
    least = mass * speed
    if stop is not None and (between := _integral(t, stop[0], stop[2])) is not None:
        ratio = between / least
        if ratio < TOO_LITTLE:
            what = f"holds {between:.3g} N s up to the greatest depth, where {mass:.4g} kg at {speed:.3g} m/s have"
            return _finding(t, (stop[0], stop[2]), ratio, f"{what} {least:.3g}: kN taken for N")
    if (pulse := _pulse(t)) is None:
        return None
    impulse, span = pulse
    most = 2.0 * least + mass * gravity * (span[1] - span[0])
    if impulse < TOO_MUCH * most:
        return None
    what = f"its pulse holds {impulse:.3g} N s, where {most:.3g} are possible"
    return _finding(t, span, impulse / most, f"{what}: N taken for kN")


def _of_acceleration(t: Trace, stop: tuple[float, float, float] | None, speed: float) -> Finding | None:
    if stop is not None and (between := _integral(t, stop[0], stop[2])) is not None:
        ratio = between / speed
        if G_LOW < ratio < G_HIGH:
            what = f"changes the speed by {between:.3g} m/s up to the greatest depth, where {speed:.3g} is lost"
            return _finding(t, (stop[0], stop[2]), ratio, f"{what}: g taken for m/s2")
    if (pulse := _pulse(t)) is None:
        return None
    change, span = pulse
    ratio = change / (2.0 * speed)
    if not ratio > IMPOSSIBLE:
        return None
    means = "m/s2 taken for g" if ratio < TOO_MUCH else "stamps in ms taken for s, or another unit"
    what = f"its pulse changes the speed by {change:.3g} m/s, where {2.0 * speed:.3g} are possible"
    return _finding(t, span, ratio, f"{what}: {means}")


def _integral(t: Trace, start: float, end: float) -> float | None:
    """Integral of a channel between two instants; None where it has too few samples there, or nothing but noise."""
    inside = (t.time >= start) & (t.time <= end)
    if int(inside.sum()) < FEWEST or float(np.abs(t.values[inside]).max()) < CLEAR * t.floor.sigma:
        return None
    return float(np.trapezoid(t.values[inside], t.time[inside]))


def _pulse(t: Trace) -> tuple[float, tuple[float, float]] | None:
    """Integral over the stretch about the largest value that stays above a part of it and ends inside the record, and
    when that begins and ends; None if there is none.
    """
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
    where = slice(int(before[-1]), end)
    span = float(t.time[where][0]), float(t.time[where][-1])
    return float(np.trapezoid(t.values[where], t.time[where])), span


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
        yield _finding(
            t, (t.time[where][0], t.time[where][-1]), size, f"{said}, where it should read 0: {means}", unit="m/s2"
        )


def _finding(t: Trace, span: tuple[float, float], value: float, sentence: str, *, unit: str = "1") -> Finding:
    return Finding(
        check="gain",
        channel=t.channel,
        start=float(span[0]),
        end=float(span[1]),
        value=value,
        unit=unit,
        error=None,
        sentence=sentence,
    )
