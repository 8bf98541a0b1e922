"""Compiled: vectors of three as plain numbers, for the kernels' inner loops; arrays would be allocated there.

`row` is a row of `Tables.pose`; vectors come and go as three numbers each.
"""

from __future__ import annotations

import math
from typing import Any

from ground.compiled import inlined, leaf
from rollover.kernels.tables import ACC, ALPHA, OMEGA, ROT, VEL, X


@leaf
def set_rotation(row: Any, a: float, b: float, c: float) -> None:
    """Write the rotation matrix of the rotation vector (a, b, c) into a pose, row by row."""
    angle = math.sqrt(a * a + b * b + c * c)
    if angle < 1e-6:
        s, k = 1.0 - angle * angle / 6.0, 0.5 - angle * angle / 24.0
    else:
        s, k = math.sin(angle) / angle, (1.0 - math.cos(angle)) / (angle * angle)
    row[ROT] = 1.0 - k * (b * b + c * c)
    row[ROT + 1] = k * a * b - s * c
    row[ROT + 2] = k * a * c + s * b
    row[ROT + 3] = k * a * b + s * c
    row[ROT + 4] = 1.0 - k * (a * a + c * c)
    row[ROT + 5] = k * b * c - s * a
    row[ROT + 6] = k * a * c - s * b
    row[ROT + 7] = k * b * c + s * a
    row[ROT + 8] = 1.0 - k * (a * a + b * b)


@inlined
def to_world(row: Any, a: float, b: float, c: float) -> Any:
    """R (a, b, c)."""
    return (
        row[ROT] * a + row[ROT + 1] * b + row[ROT + 2] * c,
        row[ROT + 3] * a + row[ROT + 4] * b + row[ROT + 5] * c,
        row[ROT + 6] * a + row[ROT + 7] * b + row[ROT + 8] * c,
    )


@inlined
def to_body(row: Any, a: float, b: float, c: float) -> Any:
    """R' (a, b, c)."""
    return (
        row[ROT] * a + row[ROT + 3] * b + row[ROT + 6] * c,
        row[ROT + 1] * a + row[ROT + 4] * b + row[ROT + 7] * c,
        row[ROT + 2] * a + row[ROT + 5] * b + row[ROT + 8] * c,
    )


@inlined
def cross(a: float, b: float, c: float, d: float, e: float, f: float) -> Any:
    """(a, b, c) x (d, e, f)."""
    return b * f - c * e, c * d - a * f, a * e - b * d


@inlined
def spin(row: Any) -> Any:
    """Angular velocity in world axes."""
    return to_world(row, row[OMEGA], row[OMEGA + 1], row[OMEGA + 2])


@inlined
def place(row: Any, a: float, b: float, c: float) -> Any:
    """World position of a point given about the centre of mass."""
    x, y, z = to_world(row, a, b, c)
    return row[X] + x, row[X + 1] + y, row[X + 2] + z


@inlined
def velocity(row: Any, a: float, b: float, c: float) -> Any:
    """World velocity of a point given about the centre of mass."""
    d, e, f = cross(row[OMEGA], row[OMEGA + 1], row[OMEGA + 2], a, b, c)
    x, y, z = to_world(row, d, e, f)
    return row[VEL] + x, row[VEL + 1] + y, row[VEL + 2] + z


@leaf
def centripetal_depth(row: Any, r: Any, n: Any) -> float:
    """-n . R (w x (w x r)): the part of a depth's acceleration that does not come from accelerations."""
    p, q, w = row[OMEGA], row[OMEGA + 1], row[OMEGA + 2]
    a, b, c = cross(p, q, w, r[0], r[1], r[2])
    a, b, c = cross(p, q, w, a, b, c)
    a, b, c = to_world(row, a, b, c)
    return -(n[0] * a + n[1] * b + n[2] * c)  # type: ignore[no-any-return]


@leaf
def depth_acceleration(row: Any, r: Any, n: Any) -> float:
    """Second derivative of the depth of the point r along -n, m/s2."""
    a, b, c = cross(row[ALPHA], row[ALPHA + 1], row[ALPHA + 2], r[0], r[1], r[2])
    a, b, c = to_world(row, a, b, c)
    linear = n[0] * (row[ACC] + a) + n[1] * (row[ACC + 1] + b) + n[2] * (row[ACC + 2] + c)
    return centripetal_depth(row, r, n) - linear  # type: ignore[no-any-return]


@leaf
def add_force(row: Any, body: int, r: Any, f: float, g: float, h: float, Q: Any) -> None:
    """Add a world force (f, g, h) at the point r of a body to the generalised forces; torques are in body axes."""
    at = 6 * body
    Q[at] += f
    Q[at + 1] += g
    Q[at + 2] += h
    f, g, h = to_body(row, f, g, h)
    f, g, h = cross(r[0], r[1], r[2], f, g, h)
    Q[at + 3] += f
    Q[at + 4] += g
    Q[at + 5] += h


@leaf
def add_between(a: Any, at: int, p: Any, b: Any, bt: int, r: Any, force: Any, torque: Any, Q: Any) -> None:
    """Add a force and a torque (3,), in a's axes, on body b at its point r, and what they press back on a at p."""
    x, y, z = to_world(a, force[0], force[1], force[2])
    add_force(b, bt, r, x, y, z, Q)
    add_force(a, at, p, -x, -y, -z, Q)
    x, y, z = to_world(a, torque[0], torque[1], torque[2])
    on_b = to_body(b, x, y, z)
    for k in range(3):
        Q[6 * bt + 3 + k] += on_b[k]
        Q[6 * at + 3 + k] -= torque[k]


@leaf
def direction_row(row: Any, r: Any, a: float, b: float, c: float, J: Any) -> None:
    """J (6,) with the speed of the point r of a body along the world direction (a, b, c) = J [v, omega]."""
    J[0], J[1], J[2] = a, b, c
    a, b, c = to_body(row, a, b, c)
    J[3], J[4], J[5] = cross(r[0], r[1], r[2], a, b, c)


@leaf
def depth_row(row: Any, r: Any, n: Any, J: Any) -> None:
    """J (6,) with dz/dt = J [v, omega], z the depth of the point r along -n."""
    direction_row(row, r, -n[0], -n[1], -n[2], J)


@leaf
def relative_angle(a: Any, b: Any, k: int) -> float:
    """Component k of the rotation of body b against body a, in a's axes; exact to second order in the angle."""
    i, j = (k + 1) % 3, (k + 2) % 3
    ji, ij = 0.0, 0.0
    for m in range(3):
        ji += a[ROT + 3 * m + j] * b[ROT + 3 * m + i]
        ij += a[ROT + 3 * m + i] * b[ROT + 3 * m + j]
    return 0.5 * (ji - ij)
