"""Compiled: a striker that falls on level ground, integrated by itself with the kernels of the full run.

Within a step the classical Runge-Kutta formula is used; steps end where the force has a kink or a jump, where the
motion turns, and where the contact begins or ends, so that no step lies across one of these. What comes out is a track.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ground.compiled import compiled, inlined, leaf
from ground.kernel import (
    ADHESION,
    AREA,
    CLINGS,
    COLUMNS,
    EFFECTS,
    GROWING,
    IDLE,
    LINE_C,
    LINE_F,
    LINE_K,
    LINE_Z,
    LOADING,
    MASS_B,
    MODE,
    PLASTIC,
    RELEASED,
    SAME,
    STATE_COLUMNS,
    UNLOADING,
    commit,
    line_force,
    rut_depth,
)
from ground.law import REFERENCE_AREA
from rollover.kernels.cubic import crossing
from rollover.kernels.drop_trajectory import (
    BOUND,
    ELEMENT,
    END,
    FIRST,
    FROM,
    HIT,
    HOW,
    LONG,
    PRESSED,
    RESTS,
    ROOM,
    START,
    TRACK_COLUMNS,
    is_another,
    wider,
)
from rollover.kernels.striker import (
    CREEP,
    FACE,
    GUIDE,
    HEIGHT,
    LAW_MASS,
    MASS,
    NOSE,
    SPEED,
    SPRING,
    STEP,
    accelerate,
    along,
    cover,
    held,
    hit,
    holds,
    is_stuck,
    levels,
    settle_one,
    steepness,
)
from rollover.kernels.terms import INCHING

RESOLVED = 0.25  # longest step times the frequency on the ground
FALLING = 5e-4  # s, step of a fall before the first contact
HALVINGS = 20  # of a step, to the moment at which the soil stays behind
CORRECTIONS = 4  # of a step that ends at such a place
CLOSE = 1e-7  # m: how near a step ends to a jump of the force
PAST = 2e-10  # m: how far beyond the end or the beginning of contact a step ends
SAME_SPEED = 1e-7  # m/s: how near a step begins to where friction turns into a dashpot
HALFWAY, LEAST = 0.5, 0.125  # of the time left until the motion turns, and of the longest step
FAINT, LONGEST = 0.02, 4.0  # of the speed of impact, below which a ringing admits longer steps; how many times as long
SOFTLY = 0.5  # of the time in which a guide alone would stop what slides on it
STILL = 1e-8  # m/s, and m/s2 over a millisecond: what is slower on its line of unloading stays where it is
OFF = 1e-6  # of the line's force: how near a step begins to where it is capped
NOTHING, LEVEL, TURN, BEND, CAP = 0, 1, 2, 3, 4  # what ends a step before its time


@leaf
def advance(law: Any, p: Any, s: Any, row: Any, state: Any, f: Any, y: Any, h: float, a: Any, end: Any) -> None:
    """One step of the classical Runge-Kutta formula from y to `end`; a (4, 2) holds the stages' accelerations."""
    for stage in range(4):
        if stage == 0:
            for k in range(4):
                end[k] = y[k]
        else:
            part = h if stage == 3 else 0.5 * h
            for k in range(2):
                # velocity of the stage before this one: its own start plus what it had gained
                before = 0.0 if stage == 1 else (0.5 * h) * a[stage - 2, k]
                end[2 * k] = y[2 * k] + part * (y[2 * k + 1] + before)
                end[2 * k + 1] = y[2 * k + 1] + part * a[stage - 1, k]
        accelerate(law, p, s, row, state, f, end, a[stage])
    for k in range(2):
        end[2 * k] = y[2 * k] + h * (y[2 * k + 1] + h * (a[0, k] + a[1, k] + a[2, k]) / 6.0)
        end[2 * k + 1] = y[2 * k + 1] + h * (a[0, k] + 2.0 * a[1, k] + 2.0 * a[2, k] + a[3, k]) / 6.0


@leaf
def at_rest(y: Any, a: Any) -> bool:
    """Whether nose and body have come to rest, by their speeds and by the accelerations of the last step's stages."""
    still = max(abs(y[1]), abs(y[3])) < STILL
    for stage in range(4):
        still = still and max(abs(a[stage, 0]), abs(a[stage, 1])) < 1e3 * STILL
    return still  # type: ignore[no-any-return]


@leaf
def longer(f: Any, y: Any, a: Any) -> float:
    """Times its usual step that a striker which gives way may take as its ringing dies out; 1 of a rigid one.

    What a step misses of a ringing goes by its amplitude and the fourth power of the step. `a` (4, 2) as in `advance`.
    """
    if f[SPRING] <= 0.0 or f[SPEED] <= 0.0:
        return 1.0
    omega = math.sqrt(f[SPRING] * f[MASS] / (f[NOSE] * (f[MASS] - f[NOSE])))
    ringing = math.hypot(y[1] - y[3], (a[3, 0] - a[3, 1]) / omega)
    return min(max((FAINT * f[SPEED] / max(ringing, 1e-12)) ** 0.25, 1.0), LONGEST)  # type: ignore[no-any-return]


@leaf
def longest(law: Any, p: Any, s: Any, row: Any, state: Any, f: Any, y: Any, a: Any) -> float:
    """Longest step from here, s."""
    h = f[STEP] * longer(f, y, a)
    if f[GUIDE] > 0.0:  # near rest its friction is a stiff dashpot, and before, a step must not reach through that
        h = min(h, SOFTLY * f[MASS] * max(min(abs(y[1]), abs(y[3])), f[CREEP], INCHING) / f[GUIDE])
    # what depends on the rate turns over near rest
    if f[GUIDE] > 0.0 or (state[MODE] == LOADING and y[1] > 0.0):
        h = min(h, max(HALFWAY * abs(y[1]) / max(abs(a[3, 0]), 1e-9), LEAST * f[STEP]))
    stiff = max(steepness(law, p, s, row, state), 1e-9)
    return min(h, RESOLVED * math.sqrt((f[NOSE] + row[MASS_B]) / stiff))  # type: ignore[no-any-return]


@inlined
def line_rate(row: Any, v: float, a: float) -> float:
    """How fast the force of the unloading line changes, N/s per reference area."""
    return row[LINE_K] * v + row[LINE_C] * a  # type: ignore[no-any-return]


@leaf
def passed(
    law: Any, p: Any, s: Any, row: Any, state: Any, f: Any, y: Any, h: float, a: Any, end: Any, now: Any, stops: Any
) -> Any:
    """What a step from y to `end` passes first: a level of the depth, its turn, a bend of the guide's friction, a cap.

    Returns the share of the step, which of these, how far behind it a jump of the force ends (m), where it is (m, of a
    bend m/s, of a cap N per reference area), and how near the step must end (m).
    """
    share, what, jump, goal, slack = 1.0, NOTHING, 0.0, 0.0, 0.0
    for k in range(levels(law, p, s, row, state, f, stops)):
        level = stops[k]
        way = 1.0 if end[0] > y[0] else -1.0
        # up to a jump of the force, just past where contact begins or ends, to a kink
        near = level - way * CLOSE if k > 2 else level + way * PAST if k == 0 else level
        begun = 2.0 * PAST if k == 0 else 1.5 * CLOSE  # where contact begins or ends none may be missed
        if abs(y[0] - level) > begun and (y[0] - near) * (end[0] - near) < 0.0:
            theta = crossing(near, h, y[0], y[1], end[0], end[1])
            if theta < share:
                share, what, jump, goal = theta, LEVEL, way * 2.0 * CLOSE if k > 2 else 0.0, near
                slack = 0.5 * PAST if k == 0 else 0.1 * CLOSE
    if state[MODE] == LOADING and y[1] > 0.0 and end[1] < 0.0:
        accelerate(law, p, s, row, state, f, end, now)
        theta = crossing(0.0, h, y[1], a[0, 0], end[1], now[0])
        if theta <= share:
            share, what, jump = theta, TURN, 0.0
    if state[MODE] == UNLOADING and row[LINE_C] > 0.0:
        before, after = line_force(row, y[0], y[1]), line_force(row, end[0], end[1])
        for cap in (0.0, row[LINE_F]):
            if abs(before - cap) > OFF * row[LINE_F] and (before - cap) * (after - cap) < 0.0:
                accelerate(law, p, s, row, state, f, end, now)
                begins, ends = line_rate(row, y[1], a[0, 0]), line_rate(row, end[1], now[0])
                theta = crossing(cap, h, before, begins, after, ends)
                if theta < share:
                    share, what, jump, goal = theta, CAP, 0.0, cap
    if holds(f) and (abs(y[1]) < INCHING or abs(end[1]) < INCHING):
        accelerate(law, p, s, row, state, f, end, now)
        for side in (-INCHING, INCHING):
            if abs(y[1] - side) > SAME_SPEED and (y[1] - side) * (end[1] - side) < 0.0:
                theta = crossing(side, h, y[1], a[0, 0], end[1], now[0])
                if theta < share:
                    share, what, jump, goal = theta, BEND, 0.0, side
    return share, what, jump, goal, slack


@leaf
def ended(
    law: Any, p: Any, s: Any, row: Any, state: Any, f: Any, y: Any, h: float, a: Any, end: Any, now: Any,
    what: int, jump: float, goal: float, slack: float,
) -> float:  # fmt: skip
    """A step that ends about where it passes something, ended there: what lies beyond bent the first guess.

    The rest as `passed` returns it; returns how long the step is, s.
    """
    advance(law, p, s, row, state, f, y, h, a, end)
    for _ in range(CORRECTIONS):
        if what == BEND:
            accelerate(law, p, s, row, state, f, end, now)
            h = max(h - (end[1] - goal) / now[0], 1e-9 * f[STEP]) if now[0] != 0.0 else h
        elif what == CAP:
            accelerate(law, p, s, row, state, f, end, now)
            rate = line_rate(row, end[1], now[0])
            h = max(h - (line_force(row, end[0], end[1]) - goal) / rate, 1e-9 * f[STEP]) if rate != 0.0 else h
        else:
            miss = end[0] - goal
            if jump != 0.0:  # no stage may look beyond it
                last_stage = y[0] + h * (y[1] + 0.5 * h * a[1, 0])
                miss = (max(end[0], last_stage) if end[1] > 0.0 else min(end[0], last_stage)) - goal
            if what == TURN or abs(miss) < slack or abs(miss) > 0.5 * h * abs(end[1]):
                break
            h -= miss / end[1]
        advance(law, p, s, row, state, f, y, h, a, end)
    return h


@leaf
def left_behind(
    law: Any, p: Any, s: Any, row: Any, state: Any, f: Any, y: Any, h: float, a: Any, end: Any, now: Any, pull: float
) -> float:
    """A step ended where the soil that moves along stays behind; returns how long it is, s."""
    low, high = 0.0, h
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        advance(law, p, s, row, state, f, y, middle, a, end)
        if held(law, p, s, row, state, f, end, now) < -pull:
            high = middle
        else:
            low = middle
    advance(law, p, s, row, state, f, y, high, a, end)
    return high


@leaf
def committed(
    law: Any, p: Any, s: Any, row: Any, state: Any, f: Any, y: Any, h: float, now: Any, pull: float, is_turn: bool
) -> None:
    """Commit a step in contact: the line of unloading begins, the soil stays behind, the ground is left."""
    cover(f, row, y[0])
    soil = along(law, p, row, f, y[0])
    outcome = commit(law, p, s, row, state, y[0], y[1], h, f[LAW_MASS] * f[FACE] / REFERENCE_AREA)
    row[MASS_B] = soil  # of a cone whose area grew within the step
    if is_turn:
        y[0] -= 2.0 * SAME  # the way back begins on the line, with its dashpot
    if y[0] <= 0.0:
        outcome |= RELEASED
    if row[MASS_B] > 0.0 and held(law, p, s, row, state, f, y, now) < -pull:
        row[MASS_B], row[GROWING] = 0.0, 0.0  # it would have to be pulled along: it stays in the soil
    if outcome & RELEASED:
        state[MODE] = IDLE
        row[MASS_B], row[GROWING] = 0.0, 0.0
        if law[PLASTIC] == 0:
            row[LINE_Z] = 0.0  # no rut stays


@compiled
def fall(law: Any, p: Any, memory: int, f: Any, until: float) -> Any:
    """Fall on the ground at t = 0 with SPEED, or from HEIGHT at t = 0 with it, up to a time or to rest.

    `memory` is the length of an element's memory. x, v and a are those of the body, which carries the instruments.
    Returns a track (steps, TRACK_COLUMNS), the element each time that it had changed (n, COLUMNS + memory), and whether
    the state stayed within what can be.
    """
    row, state, s = np.zeros(COLUMNS), np.zeros(STATE_COLUMNS, np.int64), np.zeros(memory)
    y, end, a, now, stops = np.zeros(4), np.zeros(4), np.zeros((4, 2)), np.zeros(2), np.zeros(12)
    track, elements, whole = np.empty((ROOM, TRACK_COLUMNS)), np.empty((ROOM // 4, COLUMNS + memory)), f
    if f[HEIGHT] > 0.0 and f[SPRING] > 0.0:
        f = f.copy()  # gravity and air pull at nose and body alike: nothing bends until something is hit
        f[SPRING], f[STEP] = 0.0, max(f[STEP], FALLING)
    row[AREA] = f[FACE]
    y[1], y[3], impulse = f[SPEED], f[SPEED], 0.0
    if f[HEIGHT] > 0.0:
        y[0], y[2], state[MODE] = -f[HEIGHT], -f[HEIGHT], IDLE
    else:
        impulse = hit(law, p, s, row, state, f, y)
    pull = p[law[EFFECTS] + ADHESION] * f[FACE] / REFERENCE_AREA
    if p[law[EFFECTS] + CLINGS] != 0.0:
        pull = math.inf
    t, steps, last = 0.0, 0, -1
    most = 10_000 + 200 * int(max(until, 0.0) / whole[STEP])
    while t < until or steps == 0:
        h = longest(law, p, s, row, state, f, y, a)
        advance(law, p, s, row, state, f, y, h, a, end)
        if steps >= most or not (abs(end[1]) < 1e4 and abs(end[3]) < 1e4):
            return track[:0].copy(), elements[:0].copy(), False
        share, what, jump, goal, slack = passed(law, p, s, row, state, f, y, h, a, end, now, stops)
        if share < 1.0:
            h = ended(
                law, p, s, row, state, f, y, max(share, 1e-9) * h, a, end, now, what, jump, goal, slack
            )  # fmt: skip
            if abs(end[0] - goal) > 0.9 * CLOSE:
                jump = 0.0  # the next step goes there
        if row[MASS_B] > 0.0 and f[SPRING] > 0.0 and held(law, p, s, row, state, f, end, now) < -pull:
            sooner = left_behind(law, p, s, row, state, f, y, h, a, end, now, pull)
            if sooner < h:
                h, what, jump = sooner, NOTHING, 0.0
        is_turn = what == TURN
        if is_turn:
            end[1] = 0.0
            if f[SPRING] <= 0.0:
                end[3] = 0.0
        if is_another(elements, last, row, s):
            last += 1
            if last >= elements.shape[0]:
                elements = wider(elements)
            for k in range(COLUMNS):
                elements[last, k] = row[k]
            for k in range(memory):
                elements[last, COLUMNS + k] = s[k]
        if steps + 1 >= track.shape[0]:  # and one at rest
            track = wider(track)
        track[steps, FROM], track[steps, LONG], track[steps, HOW], track[steps, HIT] = t, h, state[MODE], impulse
        track[steps, BOUND], track[steps, ELEMENT] = f[SPRING] < whole[SPRING], last
        for k in range(4):
            track[steps, START + k], track[steps, END + k] = y[k], end[k]
        track[steps, FIRST], track[steps, FIRST + 1] = a[0, 0], a[0, 1]
        steps += 1
        t += h
        for k in range(4):
            y[k] = end[k]
        y[0] += jump
        if f[SPRING] <= 0.0:
            y[2] = y[0]
        if state[MODE] == IDLE:
            if y[0] >= rut_depth(row) - SAME and y[1] > 0.0:
                f = whole
                impulse += hit(law, p, s, row, state, f, y)
        else:
            committed(law, p, s, row, state, f, y, h, now, pull, is_turn)
        if jump != 0.0:
            accelerate(law, p, s, row, state, f, y, a[3])  # behind the jump
        settle_one(law, p, row, state, f[MASS])
        stuck = is_stuck(law, p, s, row, state, f, y, now)
        if stuck:
            y[1], y[3] = 0.0, 0.0
        if state[MODE] == UNLOADING and (stuck or at_rest(y, a)):
            track[steps, FROM], track[steps, LONG], track[steps, HOW], track[steps, HIT] = t, math.inf, RESTS, impulse
            track[steps, PRESSED] = accelerate(law, p, s, row, state, f, y, now)
            track[steps, START], track[steps, START + 2] = y[0], y[2]
            steps += 1
            break
    return track[:steps].copy(), elements[: last + 1].copy(), True
