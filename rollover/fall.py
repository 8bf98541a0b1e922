"""Compiled: a striker that falls on level ground, integrated by itself with the kernels of the full run.

Depth x is positive down. A rigid striker has one coordinate; one that gives way has two, nose and body. Within a step
the classical Runge-Kutta formula is used; steps end where the force has a kink or a jump, where the motion turns, and
where the contact begins or ends, so that no step lies across one of these.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ground.compiled import compiled
from ground.kernel import (
    ADHESION,
    AREA,
    CLINGS,
    COLUMNS,
    CRUST_DEPTH,
    CRUST_RATIO,
    CRUST_WIDTH,
    EFFECTS,
    GROWING,
    GROWTH,
    GROWTH_END,
    IDLE,
    LAYER_DEPTH,
    LAYER_RATIO,
    LAYER_SPRING,
    LAYER_WIDTH,
    LINE_C,
    LINE_K,
    LINE_Z,
    LOADING,
    MASS_B,
    MODE,
    PLASTIC,
    REBOUND_DAMPING,
    RELEASED,
    SAME,
    SINKAGE,
    SPREAD,
    STATE_COLUMNS,
    TOUCH_SPEED,
    UNLOADING,
    begin,
    commit,
    grown,
    lets_go,
    loading_force,
    normal_force,
    rut_depth,
)
from ground.law import BRANCH, REFERENCE_AREA
from rollover.cubic import between_ends, crossing
from rollover.terms import INCHING, fall_back, free

# numbers of a drop: kg, kg, N/m, N s/m (no spring: rigid), -, m2, kg, N s, m/s2, m/s, s, N, N s2/m2,
# m (height of a cone whose base is the face, 0: flat), m (above the ground at t = 0 with the speed, 0: first contact)
MASS, NOSE, SPRING, DASHPOT, FRACTION, FACE, LAW_MASS, MOMENTUM_MOST, GRAVITY, SPEED, STEP, GUIDE, AIR = range(13)
# m/s (critical speed of the air, inf: none), - (its drag above over that below), m/s (the guide's creep, 0: it holds)
CONE, HEIGHT, CRISIS, THIN, CREEP, NUMBERS = 13, 14, 15, 16, 17, 18
# columns of what comes out
OUT_FORCE, OUT_SINKAGE, OUT_X, OUT_V, OUT_A, OUT_IMPULSE, OUT_COLUMNS = 0, 1, 2, 3, 4, 5, 6

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
AT_REST = 1e-8  # m/s, and m/s2 over a millisecond: what is slower on its line of unloading stays where it is


@compiled
def cover(f: Any, row: Any, z: float) -> None:
    """Covered area of a cone at sinkage z, pi (R z/h)^2 up to its base, and the mean of it above the tip, 2/3 z."""
    if f[CONE] > 0.0:
        wet = min(max(z, 0.0), f[CONE])
        row[AREA], row[SPREAD] = f[FACE] * (wet / f[CONE]) ** 2, 2.0 / 3.0 * wet


@compiled
def swept(f: Any, z: float) -> float:
    """Volume that the nose has swept at sinkage z, m3: the integral of the covered area."""
    if f[CONE] > 0.0:
        wet = min(z, f[CONE])
        return f[FACE] * (wet**3 / (3.0 * f[CONE] ** 2) + z - wet)  # type: ignore[no-any-return]
    return f[FACE] * z  # type: ignore[no-any-return]


@compiled
def along(law: Any, p: Any, row: Any, f: Any, z: float) -> float:
    """Co-moving mass at sinkage z: what there was at the last commit and what has grown since, kg."""
    if row[GROWING] == 0.0 or z <= row[LINE_Z]:
        return row[MASS_B]  # type: ignore[no-any-return]
    more = swept(f, grown(law, p, z)) - swept(f, grown(law, p, row[LINE_Z]))
    return row[MASS_B] + p[law[EFFECTS] + GROWTH] / REFERENCE_AREA * more  # type: ignore[no-any-return]


@compiled
def accelerate(law: Any, p: Any, s: Any, row: Any, state: Any, f: Any, y: Any, a: Any) -> float:
    """Accelerations of nose and body into a (2,); returns the ground's spring force, N. y: x, v of both."""
    force, soil = 0.0, row[MASS_B]
    if state[MODE] != IDLE:
        cover(f, row, y[0])
        force, soil = normal_force(law, p, s, row, y[0], y[1]), along(law, p, row, f, y[0])
    nose = f[NOSE] * free(f[GRAVITY], f[MASS], f[GUIDE], f[CREEP], f[AIR], f[CRISIS], f[THIN], y[1]) - force
    if f[SPRING] > 0.0:
        between = f[SPRING] * (y[2] - y[0]) + f[DASHPOT] * (y[3] - y[1])
        nose += between
        a[1] = free(f[GRAVITY], f[MASS], f[GUIDE], f[CREEP], f[AIR], f[CRISIS], f[THIN], y[3])
        a[1] -= between / (f[MASS] - f[NOSE])
    a[0] = nose / (f[NOSE] + soil)
    if f[SPRING] <= 0.0:
        a[1] = a[0]
    return force


@compiled
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


@compiled
def edges(depth: float, width: float, out: Any, count: int) -> int:
    """Where the edge of a layer begins and ends, into out from `count` on; returns how many there are then."""
    out[count] = depth - 0.5 * width
    if width <= 0.0:
        return count + 1
    out[count + 1] = depth + 0.5 * width
    return count + 2


@compiled
def levels(law: Any, p: Any, s: Any, row: Any, state: Any, f: Any, out: Any) -> int:
    """Depths at which the force may have a kink or a jump, or the contact begin or end, into out (12,)."""
    if state[MODE] == IDLE:
        out[0] = rut_depth(row)
        return 1
    e = law[EFFECTS]
    out[0] = lets_go(law, p, row) if law[PLASTIC] != 0 else 0.0
    out[1] = row[LINE_Z]
    out[2] = s[BRANCH]
    count = 3
    if p[e + LAYER_RATIO] != 1.0 or p[e + LAYER_SPRING] != 0.0:
        count = edges(p[e + LAYER_DEPTH], p[e + LAYER_WIDTH], out, count)
    if p[e + CRUST_RATIO] != 1.0:
        count = edges(p[e + CRUST_DEPTH], p[e + CRUST_WIDTH], out, count)
    if row[GROWING] != 0.0 and p[e + GROWTH_END] < math.inf:
        out[count] = p[e + GROWTH_END]
        count += 1
    if f[CONE] > 0.0:
        out[count] = f[CONE]
        count += 1
    if state[MODE] == UNLOADING and (p[e + ADHESION] > 0.0 or p[e + CLINGS] != 0.0):
        out[count] = rut_depth(row)  # what clings to the striker is pressed again, by the line's dashpot at once
        count += 1
    return count


@compiled
def hit(law: Any, p: Any, s: Any, row: Any, state: Any, f: Any, y: Any) -> float:
    """Begin a contact: latch the speed, share momentum with the co-moving mass; returns the impulse, N s."""
    row[TOUCH_SPEED], row[SINKAGE] = y[1], y[0]
    row[MASS_B] = f[FRACTION] * f[NOSE] if y[1] > 0.0 else 0.0
    mass = min(f[LAW_MASS], f[MOMENTUM_MOST] / max(y[1], 1e-12))
    begin(law, p, s, row, state, mass, y[0])
    y[0] = max(y[0], SAME)  # in the ground: what depends on the rate alone acts at once
    y[1] *= f[NOSE] / (f[NOSE] + row[MASS_B])
    if f[SPRING] <= 0.0:
        y[3] = y[1]
    return row[MASS_B] * y[1]  # type: ignore[no-any-return]


@compiled
def settle_one(law: Any, p: Any, row: Any, state: Any, mass: float) -> None:
    """Give an arrested element its dashpot, 2 K_u/omega of all that stands on it (see `rollover.step.settle`)."""
    if state[MODE] == UNLOADING and row[LINE_C] == 0.0 and row[LINE_K] > 0.0:
        omega = math.sqrt(row[LINE_K] * row[AREA] / REFERENCE_AREA / (mass + row[MASS_B]))
        row[LINE_C] = 2.0 * p[law[EFFECTS] + REBOUND_DAMPING] * row[LINE_K] / omega


@compiled
def steepness(law: Any, p: Any, s: Any, row: Any, state: Any) -> float:
    """Stiffness of the ground as it is met now, N/m: of the line, or the secant of the loading curve."""
    if state[MODE] == IDLE:
        return 0.0
    if state[MODE] == UNLOADING:
        return row[LINE_K] * row[AREA] / REFERENCE_AREA  # type: ignore[no-any-return]
    z = max(row[SINKAGE], 1e-6)
    return loading_force(law, p, s, z, 0.0) / z * row[AREA] / REFERENCE_AREA  # type: ignore[no-any-return]


@compiled
def held(law: Any, p: Any, s: Any, row: Any, state: Any, f: Any, y: Any, now: Any) -> float:
    """What presses the soil that moves along against the striker, N: below nothing it would have to be pulled."""
    return accelerate(law, p, s, row, state, f, y, now) + row[MASS_B] * now[0]  # type: ignore[no-any-return]


@compiled
def at_rest(y: Any, a: Any) -> bool:
    """Whether nose and body have come to rest, by their speeds and by the accelerations of the last step's stages."""
    still = max(abs(y[1]), abs(y[3])) < AT_REST
    for stage in range(4):
        still = still and max(abs(a[stage, 0]), abs(a[stage, 1])) < 1e3 * AT_REST
    return still  # type: ignore[no-any-return]


@compiled
def holds(f: Any) -> bool:
    """Whether the guide is one whose friction holds what is at rest."""
    return f[GUIDE] > 0.0 and f[CREEP] == 0.0 and f[SPRING] <= 0.0  # type: ignore[no-any-return]


@compiled
def is_stuck(law: Any, p: Any, s: Any, row: Any, state: Any, f: Any, y: Any, now: Any) -> bool:
    """Whether the guide holds what hardly moves on its line of unloading: its friction is more than what pulls."""
    if not holds(f) or state[MODE] != UNLOADING or abs(y[1]) >= INCHING:
        return False
    speed, y[1] = y[1], 0.0
    accelerate(law, p, s, row, state, f, y, now)
    y[1] = speed
    return abs(now[0]) * (f[NOSE] + row[MASS_B]) <= f[GUIDE]  # type: ignore[no-any-return]


@compiled
def longer(f: Any, y: Any, a: Any) -> float:
    """Times its usual step that a striker which gives way may take as its ringing dies out; 1 of a rigid one.

    What a step misses of a ringing goes by its amplitude and the fourth power of the step. `a` (4, 2) as in `advance`.
    """
    if f[SPRING] <= 0.0 or f[SPEED] <= 0.0:
        return 1.0
    omega = math.sqrt(f[SPRING] * f[MASS] / (f[NOSE] * (f[MASS] - f[NOSE])))
    ringing = math.hypot(y[1] - y[3], (a[3, 0] - a[3, 1]) / omega)
    return min(max((FAINT * f[SPEED] / max(ringing, 1e-12)) ** 0.25, 1.0), LONGEST)  # type: ignore[no-any-return]


@compiled
def drop(law: Any, p: Any, memory: int, f: Any, times: Any, out: Any) -> int:
    """Fall on the ground at t = 0 with SPEED, or from HEIGHT at t = 0 with it.

    Rows (OUT_COLUMNS) at `times` (s, rising) go into `out`.
    `memory` is the length of an element's memory. x, v and a are those of the body, which carries the instruments.
    Returns the number of steps, or -1 if the state left what can be.
    """
    row, state, s = np.zeros(COLUMNS), np.zeros(STATE_COLUMNS, np.int64), np.zeros(memory)
    y, end, a, now, stops = np.zeros(4), np.zeros(4), np.zeros((4, 2)), np.zeros(2), np.zeros(12)
    at, whole = np.zeros(4), f
    if f[HEIGHT] > 0.0 and f[SPRING] > 0.0:
        f = f.copy()  # gravity and air pull at nose and body alike: nothing bends until something is hit
        f[SPRING], f[STEP] = 0.0, max(f[STEP], FALLING)
    i, n = 0, times.size
    g, m, guide, creep, air, crisis, thin = f[GRAVITY], f[MASS], f[GUIDE], f[CREEP], f[AIR], f[CRISIS], f[THIN]
    while i < n and times[i] < 0.0:
        x, v = fall_back(g, m, guide, creep, air, crisis, thin, f[SPEED], -times[i])
        out[i, OUT_FORCE], out[i, OUT_SINKAGE], out[i, OUT_IMPULSE] = 0.0, 0.0, 0.0
        out[i, OUT_X], out[i, OUT_V], out[i, OUT_A] = x - f[HEIGHT], v, free(g, m, guide, creep, air, crisis, thin, v)
        i += 1
    row[AREA] = f[FACE]
    y[1], y[3], impulse = f[SPEED], f[SPEED], 0.0
    if f[HEIGHT] > 0.0:
        y[0], y[2], state[MODE] = -f[HEIGHT], -f[HEIGHT], IDLE
    else:
        impulse = hit(law, p, s, row, state, f, y)
    pull = p[law[EFFECTS] + ADHESION] * f[FACE] / REFERENCE_AREA
    if p[law[EFFECTS] + CLINGS] != 0.0:
        pull = math.inf
    t, steps = 0.0, 0
    most = 10_000 + 200 * int(max(times[n - 1], 0.0) / whole[STEP]) if n > 0 else 0
    while i < n:
        steps += 1
        h = f[STEP] * longer(f, y, a)
        if guide > 0.0:  # near rest its friction is a stiff dashpot, and before, a step must not reach through that
            h = min(h, SOFTLY * m * max(min(abs(y[1]), abs(y[3])), creep, INCHING) / guide)
        if guide > 0.0 or (state[MODE] == LOADING and y[1] > 0.0):  # what depends on the rate turns over near rest
            h = min(h, max(HALFWAY * abs(y[1]) / max(abs(a[3, 0]), 1e-9), LEAST * f[STEP]))
        h = min(h, RESOLVED * math.sqrt((f[NOSE] + row[MASS_B]) / max(steepness(law, p, s, row, state), 1e-9)))
        advance(law, p, s, row, state, f, y, h, a, end)
        if steps > most or not (abs(end[1]) < 1e4 and abs(end[3]) < 1e4):
            return -1
        share, jump, goal, slack = 1.0, 0.0, 0.0, 0.0
        for k in range(levels(law, p, s, row, state, f, stops)):
            level = stops[k]
            way = 1.0 if end[0] > y[0] else -1.0
            # up to a jump of the force, just past where contact begins or ends, to a kink
            near = level - way * CLOSE if k > 2 else level + way * PAST if k == 0 else level
            if abs(y[0] - level) > 1.5 * CLOSE and (y[0] - near) * (end[0] - near) < 0.0:
                theta = crossing(near, h, y[0], y[1], end[0], end[1])
                if theta < share:
                    share, jump, goal = theta, way * 2.0 * CLOSE if k > 2 else 0.0, near
                    slack = 0.5 * PAST if k == 0 else 0.1 * CLOSE
        turning = state[MODE] == LOADING and y[1] > 0.0 and end[1] < 0.0
        if turning:
            accelerate(law, p, s, row, state, f, end, now)
            theta = crossing(0.0, h, y[1], a[0, 0], end[1], now[0])
            turning = theta <= share
            if turning:
                share, jump = theta, 0.0
        creeping, bend = False, 0.0  # the friction of the guide begins or ceases to be a dashpot
        if holds(f) and (abs(y[1]) < INCHING or abs(end[1]) < INCHING):
            accelerate(law, p, s, row, state, f, end, now)
            for side in (-INCHING, INCHING):
                if abs(y[1] - side) > SAME_SPEED and (y[1] - side) * (end[1] - side) < 0.0:
                    theta = crossing(side, h, y[1], a[0, 0], end[1], now[0])
                    if theta < share:
                        share, jump, turning, creeping, bend = theta, 0.0, False, True, side
        if share < 1.0:
            h = max(share, 1e-9) * h
            advance(law, p, s, row, state, f, y, h, a, end)
            for _ in range(CORRECTIONS):  # what lies beyond bent the first guess
                miss = end[0] - goal
                if jump != 0.0:  # no stage may look beyond it
                    last_stage = y[0] + h * (y[1] + 0.5 * h * a[1, 0])
                    miss = (max(end[0], last_stage) if end[1] > 0.0 else min(end[0], last_stage)) - goal
                if creeping:
                    accelerate(law, p, s, row, state, f, end, now)
                    h = max(h - (end[1] - bend) / now[0], 1e-9 * f[STEP]) if now[0] != 0.0 else h
                    advance(law, p, s, row, state, f, y, h, a, end)
                    continue
                if turning or abs(miss) < slack or abs(miss) > 0.5 * h * abs(end[1]):
                    break
                h -= miss / end[1]
                advance(law, p, s, row, state, f, y, h, a, end)
            if abs(end[0] - goal) > 0.9 * CLOSE:
                jump = 0.0  # the next step goes there
        if row[MASS_B] > 0.0 and f[SPRING] > 0.0 and held(law, p, s, row, state, f, end, now) < -pull:
            low, high = 0.0, h  # the step ends where the soil stays behind
            for _ in range(HALVINGS):
                middle = 0.5 * (low + high)
                advance(law, p, s, row, state, f, y, middle, a, end)
                if held(law, p, s, row, state, f, end, now) < -pull:
                    high = middle
                else:
                    low = middle
            if high < h:
                turning, jump = False, 0.0
            h = high
            advance(law, p, s, row, state, f, y, h, a, end)
        if turning:
            end[1] = 0.0
            if f[SPRING] <= 0.0:
                end[3] = 0.0
        if times[i] <= t + h:
            accelerate(law, p, s, row, state, f, end, now)
            first0, first1, last0, last1 = a[0, 0], a[0, 1], now[0], now[1]
            while i < n and times[i] <= t + h:
                theta = max((times[i] - t) / h, 0.0)
                at[0] = between_ends(theta, h, y[0], y[1], end[0], end[1])
                at[1] = between_ends(theta, h, y[1], first0, end[1], last0)
                at[2] = between_ends(theta, h, y[2], y[3], end[2], end[3])
                at[3] = between_ends(theta, h, y[3], first1, end[3], last1)
                force = accelerate(law, p, s, row, state, f, at, now)
                touching = state[MODE] != IDLE
                # (1) without the collision: F_s = F + m_b1 a
                out[i, OUT_FORCE] = force + along(law, p, row, f, at[0]) * now[0] if touching else 0.0
                out[i, OUT_SINKAGE] = at[0] if touching else 0.0
                out[i, OUT_X], out[i, OUT_V], out[i, OUT_A] = at[2], at[3], now[1]
                out[i, OUT_IMPULSE] = impulse
                i += 1
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
            cover(f, row, y[0])
            soil = along(law, p, row, f, y[0])
            outcome = commit(law, p, s, row, state, y[0], y[1], h, f[LAW_MASS] * f[FACE] / REFERENCE_AREA)
            row[MASS_B] = soil  # of a cone whose area grew within the step
            if turning:
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
        if jump != 0.0:
            accelerate(law, p, s, row, state, f, y, a[3])  # behind the jump
        settle_one(law, p, row, state, f[MASS])
        stuck = is_stuck(law, p, s, row, state, f, y, now)
        if stuck:
            y[1], y[3] = 0.0, 0.0
        if state[MODE] == UNLOADING and i < n and (stuck or at_rest(y, a)):
            force = accelerate(law, p, s, row, state, f, y, now)
            for k in range(i, n):
                out[k, OUT_FORCE], out[k, OUT_SINKAGE], out[k, OUT_IMPULSE] = force, y[0], impulse
                out[k, OUT_X], out[k, OUT_V], out[k, OUT_A] = y[2], 0.0, 0.0
            i = n
    return steps
