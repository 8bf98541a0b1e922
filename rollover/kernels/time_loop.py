"""Compiled: the loop over steps, with what is recorded of them; it comes back where only the caller can go on."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from ground.compiled import StructRefProxy, StructType, compiled, define_proxy, register, released
from rollover.kernels.dense import largest
from rollover.kernels.forces import added_mass
from rollover.kernels.generalised_alpha import (
    END,
    LONGEST,
    SINCE,
    STEP,
    STEPS,
    TIME,
    TRIED,
    accept,
    first_accelerations,
    residual_of,
    room_for,
    solve_step,
    stand_still,
)
from rollover.kernels.record import law_flags, new_events, write_row
from rollover.kernels.step import end_of_step
from rollover.kernels.tables import ACTIVE, FLAGS_NOW, OUTSIDE, SLOTS, TOUCH
from rollover.kernels.wheel_spin import throttle

# why the loop came back; several may hold
EVENT, LOST, OUT, FULL, FRAME, REST, DONE, GAVE_UP = 1, 2, 4, 8, 16, 32, 64, 128
FASTEST = 1e3  # m/s or rad/s: beyond it a state has left what can be
SHORTEST = 1e-8  # s, of a step
RECOVERY, EASY = 10, 7  # steps after which a shortened one is doubled, where the last took fewer iterations than that
REST_SPEED = 0.02  # m/s: slower than this, all bodies, for REST_TIME is rest
REST_TIME = 0.2  # s

# places in Watch.real: time between rows, time of the loop's zero, time at rest so far, end of changing inputs, s
BETWEEN, ZERO, QUIET, CHANGING, WATCHED = 0, 1, 2, 3, 4
# places in Watch.whole: rows so far, rows between two frames of the ground; whether what is at rest has touched ground,
# whether that has been said
ROWS, PER_FRAME, TOUCHED, RESTED, COUNTED = 0, 1, 2, 3, 4


class Watch(NamedTuple):
    """What is kept of a run, and what the loop needs to know."""

    rows: Any  # (rows, row_length)
    time: Any  # (rows,) of the loop, s
    seen: Any  # (EVENT_KINDS, subjects)
    uncalibrated: Any  # (nr,)
    deepest: Any  # (nr,)
    drive: Any  # (DRIVE_NUMBERS,) or (0,)
    real: Any  # (WATCHED,)
    whole: Any  # (COUNTED,)


@register
class WatchType(StructType):
    """The kernels' view of `Watch`: one pointer, for its arrays handed over one by one cost 4 us a call."""


class WatchHandle(StructRefProxy):  # type: ignore[misc]
    """What kernels take for a `Watch`; made by `watched`, shares the arrays."""


define_proxy(WatchHandle, WatchType, list(Watch._fields))


@compiled
def watched(g: Any) -> Any:
    """Bundle the arrays of a `Watch` for the kernels."""
    return WatchHandle(g.rows, g.time, g.seen, g.uncalibrated, g.deepest, g.drive, g.real, g.whole)


@compiled
def whole_mass(t: Any, s: Any, w: Any) -> None:
    """Mass matrix of the step that begins: bodies, co-moving masses, turning wheels."""
    for i in range(w.mass.shape[0]):
        for k in range(w.mass.shape[1]):
            w.mass[i, k] = s.added[i, k]
    for i in range(t.mass.shape[0]):
        for k in range(i - i % 6, i - i % 6 + 6):
            w.mass[i, k] += t.mass[i, k]


@compiled
def check(t: Any, g: Any, qd: Any, force: Any) -> int:
    """Look at a step that has ended: why the caller must see to it, or 0; events that were seen before are dropped."""
    reason = EVENT if new_events(t, g.seen) > 0 else 0
    if not largest(qd) <= FASTEST or not math.isfinite(largest(force)):
        return reason | LOST
    if t.counts[OUTSIDE] > 0:
        return reason | OUT
    return reason | FULL if t.counts[SLOTS] + t.point_a.shape[0] + 1 > t.memory.shape[0] else reason


@compiled
def keep(t: Any, g: Any, q: Any, qd: Any, qdd: Any, dt: float, now: float) -> int:
    """Record a step that has ended, where a row is due, and whether all is at rest: why the caller must go on, or 0."""
    reason, n = 0, t.mass.shape[0]
    if now >= g.whole[ROWS] * g.real[BETWEEN] - 1e-9:
        t.counts[FLAGS_NOW] |= law_flags(t, g.uncalibrated, g.deepest)
        write_row(t, q, qd, qdd, g.rows[g.whole[ROWS]])
        g.time[g.whole[ROWS]] = now
        if g.whole[ROWS] % g.whole[PER_FRAME] == 0:
            reason |= FRAME
        g.whole[ROWS] += 1
    for b in range(t.pose.shape[0]):
        if g.seen[TOUCH, b]:
            g.whole[TOUCHED] = 1
    settled = g.whole[TOUCHED] > 0 and largest(qd[:n]) < REST_SPEED
    settled = settled and g.real[ZERO] + now > g.real[CHANGING]
    g.real[QUIET] = g.real[QUIET] + dt if settled else 0.0
    if g.real[QUIET] >= REST_TIME and g.whole[RESTED] == 0:
        g.whole[RESTED] = 1
        reason |= REST
    return reason


@compiled
def look(t: Any, g: Any, q: Any, qd: Any, qdd: Any, force: Any, dt: float, now: float) -> int:
    """Both of the above; nothing is recorded of a state that is none."""
    reason = check(t, g, qd, force)
    if reason & (LOST | OUT) == 0:
        reason |= keep(t, g, q, qd, qdd, dt, now)
    return reason


@compiled
def next_mass(t: Any, s: Any) -> None:
    """Co-moving masses for the next step; like the contact set they are those of its start."""
    if t.counts[ACTIVE] > 0 or largest_of(s.added) > 0.0:
        added_mass(t, s.q, s.added)


@compiled
def largest_of(A: Any) -> float:
    """Largest |A_jk|."""
    most = 0.0
    for i in range(A.shape[0]):
        most = max(most, largest(A[i]))
    return most


@compiled
def set_clock(t: Any, now: float) -> None:
    """The scenario's time at the start, before any step, s."""
    t.clock[0], t.clock[1] = 0.0, now


def begin(t: Any, s: Any, g: Any, drive: Any, now: float) -> int:
    """Accelerations and record of the start at time `now`; why the caller must go on, or 0.

    Once for each run: these kernels one after another cost microseconds, another copy of them all a tenth of what
    compiling the loop does.
    """
    w = room_for(s.q.size, len(s.anchor))
    whole_mass(t, s, w)
    set_clock(t, now)
    stand_still(s, w)
    residual_of(t, s, w)
    first_accelerations(s, w)
    end_of_step(t, s.q, s.qd, s.qdd, 0.0, w.force, False)
    throttle(t, drive, now)
    reason = look(t, g, s.q, s.qd, s.qdd, w.force, 0.0, 0.0)
    next_mass(t, s)
    return int(reason)


@released
def advance(t: Any, s: Any, g: Any) -> int:
    """Steps until the caller must go on; returns why."""
    n = s.q.size
    w = room_for(n, t.joint_i.shape[0])
    while s.real[TIME] < s.real[END] - 1e-10:
        whole_mass(t, s, w)
        for k in range(n):
            w.start[0, k], w.start[1, k], w.start[2, k], w.start[3, k] = s.q[k], s.qd[k], s.qdd[k], s.filtered[k]
        now, count = s.real[TIME], 0
        while count == 0:
            s.real[STEP] = min(s.real[STEP], s.real[END] - s.real[TIME])
            now = s.real[TIME] + s.real[STEP]
            if now < s.real[TRIED]:
                t.clock[2] += 1.0  # once more, with half the step
            s.real[TRIED] = now
            t.clock[0], t.clock[1] = now - s.real[TIME], g.real[ZERO] + now
            count = solve_step(t, s, w, s.real[STEP])
            if count > 0:
                break
            for k in range(n):
                s.q[k], s.qd[k], s.qdd[k] = w.start[0, k], w.start[1, k], w.start[2, k]
            if s.real[STEP] <= SHORTEST:
                return GAVE_UP
            s.real[STEP] = max(0.5 * s.real[STEP], SHORTEST)
            s.whole[SINCE] = 0
        accept(s)
        s.whole[STEPS] += 1
        s.whole[SINCE] += 1
        if s.whole[SINCE] >= RECOVERY and count < EASY:
            s.real[STEP] = min(s.real[LONGEST], 2.0 * s.real[STEP])
            s.whole[SINCE] = 0
        dt = now - s.real[TIME]
        s.real[TIME] = now
        t.clock[1] = math.floor((g.real[ZERO] + now) * 1e9 + 0.5) * 1e-9  # step times are sums
        end_of_step(t, s.q, s.qd, s.qdd, dt, w.force, True)
        throttle(t, g.drive, t.clock[1])
        reason = look(t, g, s.q, s.qd, s.qdd, w.force, dt, now)
        t.clock[2] = 0.0
        next_mass(t, s)
        if reason > 0:
            return reason
    return DONE
