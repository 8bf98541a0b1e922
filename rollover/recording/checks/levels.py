"""Levels that are known without a model: free fall before contact, and rest after it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from rollover.recording.checks.finding import SURE, Finding, Trace, plateau

LEAST = 0.001  # of g or of the weight: what is smaller lies within gravity's own spread over the earth
SAME = 0.005  # of a level: gravity differs by as much from place to place
FACTORS = {  # of free fall's reading
    -1.0: "its polarity is reversed, or it hangs at rest and reads proper acceleration (`gravity: proper`)",
    1.0 / 9.80665: "a gain or unit error, g for m/s2",
    9.80665: "a gain or unit error, m/s2 for g",
    1e-3: "a gain or unit error of 1000",
    1e3: "a gain or unit error of 1000",
    0.3048: "a gain or unit error, m/s2 for ft/s2",
    1.0 / 0.3048: "a gain or unit error, ft/s2 for m/s2",
}
_PLACES = ("striker/position_z", "striker/velocity_z")
NEAR = 0.3  # of g or of the weight: what lies further off is not free fall, or not rest


def free_fall(traces: Mapping[str, Trace], gravity: float) -> Iterator[Finding]:
    """A falling accelerometer reads -g (coordinate acceleration, z up), and a load cell nothing."""
    fall = traces.get("striker/acceleration_z")
    if fall is None:
        return
    where = plateau(fall)
    if where is None:
        return
    mean = float(fall.values[where].mean())
    if abs(mean + gravity) > NEAR * gravity:
        yield from _by_a_factor(fall, where, mean, gravity)
        return
    start, end = float(fall.time[where][0]), float(fall.time[where][-1])
    error = fall.floor.of_mean(where.stop - where.start)
    off = mean + gravity
    if abs(off) > max(SURE * error, LEAST * gravity):
        rest = _level(fall, 0.0, gravity)
        if rest is not None and abs(rest[0] - off) < max(SURE * (rest[1] + error), 0.25 * abs(off)):
            means = "the same is there at rest: a bias of the accelerometer (zero offset)"
        elif off > 0.0:
            means = "it falls more slowly than freely: friction of the guide, a gain error below 1 or a zero offset"
        else:
            means = "faster than free fall is not possible: a gain error above 1 or a zero offset of the accelerometer"
        yield Finding(
            check="free-fall",
            channel=fall.channel,
            start=start,
            end=end,
            value=off,
            unit="m/s2",
            error=error,
            sentence=f"reads {mean:.4g} m/s2 before contact instead of {-gravity:.4g}; {means}",
        )
    load = traces.get("ground/force_normal")
    if load is None:
        return
    while_falling = (load.time >= start) & (load.time <= end)
    count = int(while_falling.sum())
    if count < 10:
        return
    bias, error = float(load.values[while_falling].mean()), load.floor.of_mean(count)
    if abs(bias) > SURE * error and error > 0.0:
        yield Finding(
            check="free-fall",
            channel=load.channel,
            start=start,
            end=end,
            value=bias,
            unit="N",
            error=error,
            sentence=f"reads {bias:.4g} N in free fall, where no force acts on it: a zero offset of the load cell",
        )


def _by_a_factor(fall: Trace, where: slice, mean: float, gravity: float) -> Iterator[Finding]:
    """A level before contact that is free fall in another unit, or upside down."""
    error = fall.floor.of_mean(where.stop - where.start)
    for times, means in FACTORS.items():
        if abs(mean + times * gravity) < max(SURE * error, SAME * abs(times) * gravity) and error < 0.1 * abs(mean):
            yield Finding(
                check="polarity" if times == -1.0 else "gain",
                channel=fall.channel,
                start=float(fall.time[where][0]),
                end=float(fall.time[where][-1]),
                value=mean,
                unit="m/s2",
                error=error,
                sentence=f"reads {mean:.4g} m/s2 before contact instead of {-gravity:.4g}: {means}",
            )
            return


def rest(traces: Mapping[str, Trace], mass: float | None, gravity: float) -> Iterator[Finding]:
    """At rest the load cell carries the weight and an accelerometer reads nothing (coordinate acceleration)."""
    still, load = traces.get("striker/acceleration_z"), traces.get("ground/force_normal")
    if any(_still_moving(traces[name]) for name in _PLACES if name in traces):
        return
    a = _level(still, 0.0, gravity) if still is not None else None
    weight = mass * gravity if mass is not None else 0.0
    F = _level(load, weight, weight) if load is not None and mass is not None else None
    if a is not None and F is not None and mass is not None:
        apart, error = F[0] - mass * a[0], math.hypot(F[1], mass * a[1])
        if abs(F[0]) > SURE * F[1] and abs(a[0]) > 2.0 * a[1] and abs(apart) < 2.0 * error:
            return  # F = m (a + g): it has not come to rest
    if still is not None and a is not None and abs(a[0]) > max(SURE * a[1], LEAST * gravity):
        yield Finding(
            check="rest",
            channel=still.channel,
            start=a[2],
            end=a[3],
            value=a[0],
            unit="m/s2",
            error=a[1],
            sentence=f"reads {a[0]:.4g} m/s2 at rest instead of 0: a zero offset, or it is not upright",
        )
    if load is not None and F is not None and abs(F[0]) > max(SURE * F[1], LEAST * weight):
        if still is not None and a is None:
            return
        yield Finding(
            check="rest",
            channel=load.channel,
            start=F[2],
            end=F[3],
            value=F[0],
            unit="N",
            error=F[1],
            sentence=f"reads {weight + F[0]:.5g} N at rest instead of the weight, {weight:.5g} N: "
            f"a gain error ({1.0 + F[0] / weight:.4g}), a zero offset, or another mass",
        )


def _still_moving(t: Trace) -> bool:
    """Whether a position does not end in a level of at least `SHORTEST`."""
    return plateau(t, at_end=True) is None


def _level(t: Trace, expected: float, scale: float) -> tuple[float, float, float, float] | None:
    """Offset of the last constant stretch from what is expected, its standard error, start and end; None if far."""
    where = plateau(t, at_end=True)
    if where is None:
        return None
    off = float(t.values[where].mean()) - expected
    if abs(off) > NEAR * scale:
        return None
    return off, t.floor.of_mean(where.stop - where.start), float(t.time[where][0]), float(t.time[where][-1])
