"""Time stamps: a clock with a zero of its own, a span that no test lasts, samples lost from a counted clock."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from rollover.recording import Recording
from rollover.recording.checks.finding import Finding, Trace, instant

Array = NDArray[np.float64]
LONGEST = 120.0  # s: `simulation.duration` of a scenario is this at most
EVEN = 1e-6  # of a step: stamps that are counted, not read off a clock
SIDES = (6, 12, 24, 48)  # samples to either side of a gap, through which a parabola is laid
CHANCE = 1e-4  # that a clean channel shows a gap
WHOLE = 0.25  # of a step, by which a gap may miss a whole number of samples
STEADY = 0.5  # of the speed, by which it may change across a gap: else something begins or ends there
SAMPLES = 2.0  # deviations at least that one sample's way is: else whether their number is whole is not told
MOVING = ("position_x", "position_y", "position_z", "roll", "pitch", "yaw", "angle", "sinkage", "deflection")


def stamps(recording: Recording) -> Iterator[Finding]:
    """Stamps at which no scenario has anything, where their zero is said to be the scenario's; and too long a span."""
    start, end = float(recording.time[0]), float(recording.time[-1])
    step = float(np.median(np.diff(recording.time))) if recording.time.size > 1 else 0.0

    def found(sentence: str, value: float) -> Finding:
        return Finding(
            check="time-base",
            channel="time",
            start=start,
            end=end,
            value=value,
            unit="s",
            error=None,
            sentence=sentence,
        )

    if recording.clock.zero == "known" and (start > LONGEST or end < 0.0):
        what = f"begin at {start:.2e} s" if start > LONGEST else f"end at {instant(end, step)} s, before 0"
        yield found(
            f"stamps {what}, outside any scenario: a clock with a zero of its own (time-base error) unless "
            "`clock: {zero: unknown}` says so",
            start if start > LONGEST else end,
        )
    if end - start > LONGEST:
        yield found(
            f"lasts {end - start:.6g} s at {1.0 / step:.4g} Hz, a scenario {LONGEST:g} s at most: another unit of time "
            "(ms for s: a time-base error), or the test is a part of it",
            end - start,
        )


def lost(t: Trace, unit: str) -> Iterator[Finding]:
    """Places at which something that cannot jump goes on as if samples were left out, on stamps that are counted.

    Parabolas through the samples before and after differ at the place by the way of n samples, n whole, along the
    motion: a position is as continuous as the body it belongs to.
    """
    steps = np.diff(t.time)
    if not t.channel.endswith(MOVING) or t.floor.sigma == 0.0 or np.abs(steps - t.step).max() > EVEN * t.step + 1e-9:
        return
    beyond = -float(ndtri(0.5 * CHANCE / t.values.size / len(SIDES)))
    places: dict[int, tuple[float, float, float]] = {}
    fits = {side: _across(t, side) for side in SIDES if t.values.size >= 4 * side}
    for side in reversed(fits):  # the longest first, which tells best how many
        jump, way, bend, error, slope = fits[side]
        if (shorter := fits.get(side // 2)) is not None:
            # where the error hides a sample's way, a whole number of samples says nothing for a jump
            bend = bend + np.where(error * SAMPLES < np.abs(way), 0.0, _bends(jump, error, shorter[0], shorter[3]))
        number = jump / np.where(way == 0.0, np.inf, way)
        whole = np.round(number)
        relative_error = np.hypot(error, whole * slope) / np.maximum(np.abs(way), 1e-300)
        sure = np.abs(jump) > beyond * error + bend
        sure &= (
            (whole >= 1.0) & (np.abs(number - whole) < WHOLE + 3.0 * relative_error) & (np.abs(way) > beyond * slope)
        )
        for k in map(int, np.flatnonzero(sure)):
            near = np.abs(jump[max(0, k - side) : k + side + 1])
            if abs(jump[k]) >= near.max():
                places.setdefault(k, (float(whole[k]), float(abs(jump[k])) / error, float(relative_error[k])))
    kept: list[int] = []
    for k in sorted(places, key=lambda k: -places[k][1]):
        if all(abs(k - other) > SIDES[-1] for other in kept):
            kept.append(k)
    if not kept:
        return
    kept.sort()
    count = sum(places[k][0] for k in kept)
    error = math.sqrt(sum(places[k][2] ** 2 for k in kept))
    yield Finding(
        check="gap",
        channel=t.channel,
        start=float(t.time[kept[0]]),
        end=float(t.time[kept[-1] + 1]),
        value=count,
        unit="samples",
        error=error,
        sentence=f"goes on as if {count:.0f} +- {error:.1f} samples were missing in {len(kept)} "
        f"place{'s' if len(kept) > 1 else ''}, though its stamps are even ({1.0 / t.step:.6g} Hz): lost samples "
        "(dropout of the logger) under a counted clock, all later stamps are early",
    )


def _bends(jump: Array, error: float, half: Array, wide: float) -> Array:
    """Infinite where a parabola through half as many samples says another jump: a bend among them feigns it, (n - 1,).

    The difference of nested fits has the shorter's variance less the longer one's; two deviations of it are let pass:
    1 of 20 true jumps is left to another length.
    """
    return np.where(np.abs(half - jump) < 2.0 * math.sqrt(wide * wide - error * error), 0.0, np.inf)


def _across(t: Trace, side: int) -> tuple[Array, Array, Array, float, float]:
    """Jump from sample k to k + 1 (n - 1,), way of one sample, what bends may feign; errors of jump and way."""
    n = t.values.size
    s = np.arange(side) + 0.5  # in steps, from the middle between both
    V = np.vander(s, 3, increasing=True)
    W = np.linalg.pinv(V)
    windows = np.lib.stride_tricks.sliding_window_view(t.values, side)
    jump, way, bend = np.zeros(n - 1), np.zeros(n - 1), np.full(n - 1, np.inf)
    k = np.arange(side - 1, n - side)  # side samples up to k, side from k + 1 on
    before, after = windows[k - side + 1][:, ::-1] @ W.T, windows[k + 1] @ W.T
    jump[k] = after[:, 0] - before[:, 0]
    way[k] = 0.5 * (after[:, 1] - before[:, 1])
    misfit_before = np.abs(windows[k - side + 1][:, ::-1] - before @ V.T).max(axis=1)
    misfit_after = np.abs(windows[k + 1] - after @ V.T).max(axis=1)
    noise = 4.5 * t.floor.sigma  # the largest of 48 that noise leaves, 1 in 3000
    bend[k] = np.where(np.maximum(misfit_before, misfit_after) > noise, np.inf, 0.0)
    turns = np.abs(after[:, 1] + before[:, 1])  # the speed jumps as well: an impact between both
    excess = np.maximum(turns - 6.0 * t.floor.sigma * float(np.linalg.norm(W[1])), 0.0)
    bend[k] += np.where(turns > STEADY * np.abs(way[k]) + 0.5 * (turns - excess), np.inf, 0.5 * excess)
    sigma = t.floor.sigma * float(np.sqrt(t.floor.independence))
    error, slope = sigma * np.sqrt(2.0) * np.linalg.norm(W[0]), sigma * np.sqrt(0.5) * np.linalg.norm(W[1])
    return jump, way, bend, float(error), float(slope)
