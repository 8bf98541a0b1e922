"""The compiled inner loop over touched elements: force to be tried, memory to be committed.

An element that is in contact moves with the vehicle's point above it (restitution 0, no separation while it is
loaded), so its sinkage and sinkage rate are the point's and its mass goes into the vehicle's mass matrix.
`normal_force` and `friction_force` are pure; only `commit` and `commit_friction` write.

Memory of an element, one row of `memory` each; forces there are per reference area, so that a contact area
that grows or shrinks only multiplies them.
"""

from __future__ import annotations

import math
from typing import Any

from ground.compiled import call_advance, call_force, compiled
from ground.law import BRANCH, REFERENCE_AREA

# columns of memory (float)
SINKAGE = 0  # deepest point's z at the last commit, m
LINE_Z = 1  # deepest sinkage so far: where the unloading line starts, m
LINE_F = 2  # force there, N per reference area
LINE_K = 3  # K_u, N/m per reference area
LINE_C = 4  # dashpot of the unloading line, N s/m per reference area
AREA = 5  # contact area now, m2
MASS_B = 6  # co-moving mass m_b1, kg
SHEAR = 7  # 7, 8, 9: shear displacement since the last slip, world axes, m
PLACE = 10  # 10, 11, 12: that centroid at the last commit, world, m
OWNER_R = 13  # 13, 14, 15: centroid of the covered area in its body's axes about its centre of mass, m
NORMAL = 16  # 16, 17, 18: unit normal of the undisturbed surface, world, up
OFFSET = 19  # normal . (a point of the undisturbed surface), m
FORCE = 20  # normal force at the start of the step, N
FRICTION = 21  # 21, 22, 23: friction force at the start of the step, N
TOUCH_SPEED = 24  # latched normal impact speed, m/s
SPREAD = 25  # how far the mean of the covered area stands above its deepest point, m
COLUMNS = 26

# columns of state (int)
# which element, body above it, mode, domain flags, touches so far, row of its law and friction
CELL, BODY, MODE, FLAGS, HITS, ROW = 0, 1, 2, 3, 4, 5
STATE_COLUMNS = 6
IDLE, LOADING, UNLOADING = 0, 1, 2

# columns of the law's settings
PLASTIC, REST_STIFFNESS, ADDRESS_FORCE, ADDRESS_ADVANCE, ADDRESS_BEGIN = 0, 1, 2, 3, 4

SAME = 1e-10  # m: sinkages closer than this are one, so that rounding does not switch a loaded element to its line

# outcomes of a commit, as bits
BRANCHED, ARRESTED, RELEASED = 1, 2, 4


@compiled
def normal_force(law: Any, p: Any, s: Any, row: Any, z: float, v: float) -> float:
    """Spring force of one element at sinkage z and rate v, N: never a pull; memory is only read.

    z is that of the deepest point; the law is asked once, at the mean of the covered area (midpoint rule).
    Loading follows the law; below the deepest sinkage the line of stiffness K_u with its dashpot, capped by
    the loading curve at the line's start.
    """
    if z <= 0.0:
        return 0.0
    if law[PLASTIC] == 0 or z >= row[LINE_Z] - SAME:
        f = call_force(law[ADDRESS_FORCE], (p.ctypes, s.ctypes, max(z - row[SPREAD], 0.0), v))
    else:
        f = min(row[LINE_F] - row[LINE_K] * (row[LINE_Z] - z) + row[LINE_C] * v, row[LINE_F])
    return max(f, 0.0) * row[AREA] / REFERENCE_AREA  # type: ignore[no-any-return]


@compiled
def rut_depth(row: Any) -> float:
    """Sinkage below which the unloaded element gives no force: the rut that stays, m."""
    if row[LINE_K] <= 0.0:
        return 0.0
    return max(row[LINE_Z] - row[LINE_F] / row[LINE_K], 0.0)  # type: ignore[no-any-return]


@compiled
def set_line(law: Any, p: Any, s: Any, row: Any, z: float) -> None:
    """Start the unloading line at (z, F(z)) with K_u = K'(z)/recovery."""
    f = call_force(law[ADDRESS_FORCE], (p.ctypes, s.ctypes, max(z - row[SPREAD], 0.0), 0.0))
    row[LINE_Z] = z
    row[LINE_F] = f
    row[LINE_K] = f / (p[0] * z) if z > 0.0 else 0.0


@compiled
def set_rest_line(row: Any, mass: float) -> None:
    """(6) read literally, K_b3 = 9.81 m_s / z_p,max: a secant through the origin, so the force drops to the weight."""
    if row[LINE_Z] > 0.0:
        row[LINE_K] = 9.81 * mass * REFERENCE_AREA / row[AREA] / row[LINE_Z]
        row[LINE_F] = row[LINE_K] * row[LINE_Z]


@compiled
def enter_from_the_side(law: Any, p: Any, s: Any, row: Any, z: float, force: float) -> None:
    """Let a sinkage that was not swept by normal motion begin on the reloading line with `force` (N).

    A member that slides into an element pushes its soil aside: the element's work was not done, so its force
    must not be there at once. It climbs K_u to the loading curve as the member sinks further.
    """
    per_reference = force * REFERENCE_AREA / max(row[AREA], 1e-12)
    f = call_force(law[ADDRESS_FORCE], (p.ctypes, s.ctypes, max(z - row[SPREAD], 0.0), 0.0))
    if f <= per_reference or z <= 0.0:
        return
    row[LINE_K] = f / (p[0] * z)
    row[LINE_Z] = z + (f - per_reference) / row[LINE_K]
    row[LINE_F] = f
    row[LINE_C] = 0.0


@compiled
def commit(law: Any, p: Any, s: Any, row: Any, state: Any, z: float, v: float, h: float, mass: float) -> int:
    """Accept a step that ended at (z, v): move the deepest point, turn round, or let go. Returns outcome bits.

    `mass` (kg) is the share of the effective mass above the element; it only enters the literal eq (6).
    """
    outcome = 0
    before = row[SINKAGE]
    row[SINKAGE] = z
    if law[ADDRESS_ADVANCE] != 0:
        # the mean rate makes a law's own states second order in the step
        call_advance(law[ADDRESS_ADVANCE], (p.ctypes, s.ctypes, max(z - row[SPREAD], 0.0), (z - before) / h, h))
    if law[PLASTIC] == 0:
        if z <= 0.0:
            outcome |= RELEASED
        return outcome
    if z > row[LINE_Z]:
        if state[MODE] == LOADING and before < s[BRANCH] <= z:
            outcome |= BRANCHED
        state[MODE] = LOADING
        set_line(law, p, s, row, z)
    if state[MODE] == LOADING and v <= 0.0:
        state[MODE] = UNLOADING
        row[LINE_C] = 0.0  # a new line asks for its dashpot
        outcome |= ARRESTED
        if law[REST_STIFFNESS] != 0:
            set_rest_line(row, mass)
    if z <= rut_depth(row) and v <= 0.0:
        outcome |= RELEASED
    return outcome


@compiled
def friction_force(
    mu: float, stick: float, relaxation: float, force: float, shear: Any, moved: Any, v: Any, n: Any
) -> Any:
    """F_t = -mu F_n (d + tau v_t)/d_s, |F_t| <= mu F_n; d = committed shear plus what has moved since.

    Vectors are in world axes; only their parts along the surface of normal n count. Returns three components.
    """
    if mu <= 0.0 or force <= 0.0:
        return 0.0, 0.0, 0.0
    x = shear[0] + moved[0] + relaxation * v[0]
    y = shear[1] + moved[1] + relaxation * v[1]
    z = shear[2] + moved[2] + relaxation * v[2]
    along = x * n[0] + y * n[1] + z * n[2]
    x, y, z = x - along * n[0], y - along * n[1], z - along * n[2]
    factor = -mu * force / max(math.sqrt(x * x + y * y + z * z), stick)
    return factor * x, factor * y, factor * z


@compiled
def commit_friction(stick: float, shear: Any, moved: Any, n: Any) -> None:
    """Add what has moved to the shear displacement and cut it at d_s: the rest was slip."""
    x, y, z = shear[0] + moved[0], shear[1] + moved[1], shear[2] + moved[2]
    along = x * n[0] + y * n[1] + z * n[2]
    x, y, z = x - along * n[0], y - along * n[1], z - along * n[2]
    size = math.sqrt(x * x + y * y + z * z)
    factor = stick / size if size > stick else 1.0
    shear[0], shear[1], shear[2] = factor * x, factor * y, factor * z
