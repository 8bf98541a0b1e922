"""Compiled: a striker in level ground: what acts on it, where that has kinks and jumps, how a contact begins and ends.

Depth x is positive down. A rigid striker has one coordinate; one that gives way has two, nose and body.
"""

from __future__ import annotations

import math
from typing import Any

from ground.compiled import inlined, leaf
from ground.kernel import (
    ADHESION,
    AREA,
    CLINGS,
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
    MASS_B,
    MODE,
    PLASTIC,
    REBOUND_DAMPING,
    SAME,
    SINKAGE,
    SPREAD,
    TOUCH_SPEED,
    UNLOADING,
    begin,
    grown,
    lets_go,
    loading_force,
    normal_force,
    rut_depth,
)
from ground.law import BRANCH, REFERENCE_AREA
from rollover.kernels.terms import INCHING, free

# numbers of a drop: kg, kg, N/m, N s/m (no spring: rigid), -, m2, kg, N s, m/s2, m/s, s, N, N s2/m2,
# m (height of a cone whose base is the face, 0: flat), m (above the ground at t = 0 with the speed, 0: first contact)
MASS, NOSE, SPRING, DASHPOT, FRACTION, FACE, LAW_MASS, MOMENTUM_MOST, GRAVITY, SPEED, STEP, GUIDE, AIR = range(13)
# m/s (critical speed of the air, inf: none), - (its drag above over that below), m/s (the guide's creep, 0: it holds)
CONE, HEIGHT, CRISIS, THIN, CREEP, NUMBERS = 13, 14, 15, 16, 17, 18


@inlined
def cover(f: Any, row: Any, z: float) -> None:
    """Covered area of a cone at sinkage z, pi (R z/h)^2 up to its base, and the mean of it above the tip, 2/3 z."""
    if f[CONE] > 0.0:
        wet = min(max(z, 0.0), f[CONE])
        row[AREA], row[SPREAD] = f[FACE] * (wet / f[CONE]) ** 2, 2.0 / 3.0 * wet


@inlined
def swept(f: Any, z: float) -> float:
    """Volume that the nose has swept at sinkage z, m3: the integral of the covered area."""
    if f[CONE] > 0.0:
        wet = min(z, f[CONE])
        return f[FACE] * (wet**3 / (3.0 * f[CONE] ** 2) + z - wet)  # type: ignore[no-any-return]
    return f[FACE] * z  # type: ignore[no-any-return]


@inlined
def along(law: Any, p: Any, row: Any, f: Any, z: float) -> float:
    """Co-moving mass at sinkage z: what there was at the last commit and what has grown since, kg."""
    if row[GROWING] == 0.0 or z <= row[LINE_Z]:
        return row[MASS_B]  # type: ignore[no-any-return]
    more = swept(f, grown(law, p, z)) - swept(f, grown(law, p, row[LINE_Z]))
    return row[MASS_B] + p[law[EFFECTS] + GROWTH] / REFERENCE_AREA * more  # type: ignore[no-any-return]


@inlined
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


@inlined
def edges(depth: float, width: float, out: Any, count: int) -> int:
    """Where the edge of a layer begins and ends, into out from `count` on; returns how many there are then."""
    out[count] = depth - 0.5 * width
    if width <= 0.0:
        return count + 1
    out[count + 1] = depth + 0.5 * width
    return count + 2


@leaf
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


@leaf
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


@leaf
def settle_one(law: Any, p: Any, row: Any, state: Any, mass: float) -> None:
    """Give an arrested element its dashpot, 2 K_u/omega of all that stands on it (`rollover.kernels.step.settle`)."""
    if state[MODE] == UNLOADING and row[LINE_C] == 0.0 and row[LINE_K] > 0.0:
        omega = math.sqrt(row[LINE_K] * row[AREA] / REFERENCE_AREA / (mass + row[MASS_B]))
        row[LINE_C] = 2.0 * p[law[EFFECTS] + REBOUND_DAMPING] * row[LINE_K] / omega


@leaf
def steepness(law: Any, p: Any, s: Any, row: Any, state: Any) -> float:
    """Stiffness of the ground as it is met now, N/m: of the line, or the secant of the loading curve."""
    if state[MODE] == IDLE:
        return 0.0
    if state[MODE] == UNLOADING:
        return row[LINE_K] * row[AREA] / REFERENCE_AREA  # type: ignore[no-any-return]
    z = max(row[SINKAGE], 1e-6)
    return loading_force(law, p, s, z, 0.0) / z * row[AREA] / REFERENCE_AREA  # type: ignore[no-any-return]


@inlined
def held(law: Any, p: Any, s: Any, row: Any, state: Any, f: Any, y: Any, now: Any) -> float:
    """What presses the soil that moves along against the striker, N: below nothing it would have to be pulled."""
    return accelerate(law, p, s, row, state, f, y, now) + row[MASS_B] * now[0]  # type: ignore[no-any-return]


@inlined
def holds(f: Any) -> bool:
    """Whether the guide is one whose friction holds what is at rest."""
    return f[GUIDE] > 0.0 and f[CREEP] == 0.0 and f[SPRING] <= 0.0  # type: ignore[no-any-return]


@leaf
def is_stuck(law: Any, p: Any, s: Any, row: Any, state: Any, f: Any, y: Any, now: Any) -> bool:
    """Whether the guide holds what hardly moves on its line of unloading: its friction is more than what pulls."""
    if not holds(f) or state[MODE] != UNLOADING or abs(y[1]) >= INCHING:
        return False
    speed, y[1] = y[1], 0.0
    accelerate(law, p, s, row, state, f, y, now)
    y[1] = speed
    return abs(now[0]) * (f[NOSE] + row[MASS_B]) <= f[GUIDE]  # type: ignore[no-any-return]
