"""Compiled: where the bodies are for the few coordinates of a vehicle at rest, and how they move with each.

The coordinates u are those of `rollover.dynamics.equilibrium`: height, roll, pitch, axle angle, slide (2), yaw;
from `PARTS` on shift (3) and tilt (3) of each part of a ROPS.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ground.compiled import compiled, leaf
from rollover.kernels.vectors import cross

ROLL, PITCH, AXLE, SLIDE, YAW, PARTS = 1, 2, 3, 4, 6, 7  # places in u; 0 is the height
WITH_CHASSIS, SWINGS = 0, -1  # of a body that is no part with places in u of its own: rigid, or the axle
SHORT = 1e-7  # sine of an angle below which a turn is none, or half a one


@leaf
def turn_by_angles(roll: float, pitch: float, yaw: float, R: Any) -> None:
    """R_WV of ISO 8855 angles (rad) into R (3, 3)."""
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    R[0, 0], R[0, 1], R[0, 2] = cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr
    R[1, 0], R[1, 1], R[1, 2] = sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr
    R[2, 0], R[2, 1], R[2, 2] = -sp, cp * sr, cp * cr


@leaf
def vector_of(R: Any, v: Any) -> None:
    """Rotation vector of R (3, 3) into v (3,), rad, no longer than pi."""
    v[0], v[1], v[2] = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    sine = 0.5 * math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    cosine = 0.5 * (R[0, 0] + R[1, 1] + R[2, 2] - 1.0)
    if sine <= SHORT and cosine < 0.0:  # half a turn about the axis of the longest column of R + 1
        k = 0
        for j in range(1, 3):
            if R[j, j] > R[k, k]:
                k = j
        length = math.sqrt(2.0 * (1.0 + R[k, k]))
        for j in range(3):
            v[j] = math.pi * (R[j, k] + (1.0 if j == k else 0.0)) / length
        return
    factor = 0.5 * math.atan2(sine, cosine) / sine if sine > SHORT else 0.5
    for j in range(3):
        v[j] *= factor


@leaf
def _product(A: Any, B: Any, C: Any) -> None:
    """A B into C, (3, 3) each."""
    for i in range(3):
        for j in range(3):
            C[i, j] = A[i, 0] * B[0, j] + A[i, 1] * B[1, j] + A[i, 2] * B[2, j]


@leaf
def _origin(u: Any, place: Any, i: int) -> float:
    """Coordinate i of the vehicle's origin."""
    return place[3, i] + u[0] * place[0, i] + u[SLIDE] * place[1, i] + u[SLIDE + 1] * place[2, i]  # type: ignore[no-any-return]


@compiled
def put(u: Any, heading: float, place: Any, pivot: Any, centre: Any, part: Any, turns: Any, q: Any) -> None:
    """Rotations `turns` (nb, 3, 3) and coordinates q (6 nb,) of all bodies.

    `place` (4, 3): the surface's normal, two directions along it, and the point the vehicle's origin slides and rises
    from. `pivot` (3,) is the axle's, about its centre of mass; `centre` (nb, 3) in vehicle axes; `part` (nb,) where in
    u a body's own coordinates begin, `WITH_CHASSIS` or `SWINGS`.
    """
    own, R = np.empty((3, 3)), turns[0]
    turn_by_angles(u[ROLL], u[PITCH], heading + u[YAW], R)
    for b in range(part.size):
        at = part[b]
        if at == SWINGS:
            turn_by_angles(u[AXLE], 0.0, 0.0, own)
            _product(R, own, turns[b])
        elif at != WITH_CHASSIS:
            turn_by_angles(u[at + 3], u[at + 4], u[at + 5], own)
            _product(R, own, turns[b])
        elif b > 0:
            turns[b] = R
        for i in range(3):
            x = _origin(u, place, i)
            for j in range(3):
                x += R[i, j] * centre[b, j]
                if at == SWINGS:
                    x += (R[i, j] - turns[b, i, j]) * pivot[j]
                elif at != WITH_CHASSIS:
                    x += R[i, j] * u[at + j]
            q[6 * b + i] = x
        vector_of(turns[b], q[6 * b + 3 : 6 * b + 6])


@leaf
def _spin(axis: Any, x: Any, turn: Any, row: Any) -> None:
    """Velocity of a body at x (3,) that spins about an axis (3,) through the origin into row (6,)."""
    row[0], row[1], row[2] = cross(axis[0], axis[1], axis[2], x[0], x[1], x[2])
    for i in range(3):
        row[3 + i] = turn[0, i] * axis[0] + turn[1, i] * axis[1] + turn[2, i] * axis[2]


@compiled
def move(u: Any, heading: float, place: Any, pivot: Any, part: Any, turns: Any, q: Any, rows: Any) -> None:
    """Velocities (size, 6 nb) of all bodies (world; angular in body axes) for a unit rate of each u.

    `turns` and `q` are those that `put` writes for u.
    """
    R, x, arm = turns[0], np.empty(3), np.empty(3)
    level, own, tilt = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    turn_by_angles(0.0, 0.0, heading + u[YAW], level)
    rows[:] = 0.0
    for b in range(part.size):
        at, first = part[b], 6 * b
        for i in range(3):
            rows[0, first + i] = place[0, i]
            rows[SLIDE, first + i], rows[SLIDE + 1, first + i] = place[1, i], place[2, i]
            x[i] = q[first + i] - _origin(u, place, i)
        _spin(R[:, 0], x, turns[b], rows[ROLL, first : first + 6])
        _spin(level[:, 1], x, turns[b], rows[PITCH, first : first + 6])
        _spin(level[:, 2], x, turns[b], rows[YAW, first : first + 6])
        if at == SWINGS:
            for i in range(3):
                arm[i] = -(turns[b, i, 0] * pivot[0] + turns[b, i, 1] * pivot[1] + turns[b, i, 2] * pivot[2])
            _spin(R[:, 0], arm, turns[b], rows[AXLE, first : first + 6])
        elif at != WITH_CHASSIS:
            arm[:] = 0.0
            turn_by_angles(0.0, 0.0, u[at + 5], own)
            _product(R, own, tilt)
            _spin(turns[b, :, 0], arm, turns[b], rows[at + 3, first : first + 6])
            _spin(tilt[:, 1], arm, turns[b], rows[at + 4, first : first + 6])
            _spin(R[:, 2], arm, turns[b], rows[at + 5, first : first + 6])
            for k in range(3):
                for i in range(3):
                    rows[at + k, first + i] = R[i, k]
