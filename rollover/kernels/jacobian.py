"""Compiled: what the forces' stiffness and damping do to Newton's matrix: sum of (f k + f' c) J' J.

A symmetric approximation without the terms of turning frames: it decides how fast the iteration converges, never
where to.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ground.compiled import compiled, leaf
from ground.kernel import (
    AREA,
    BODY,
    LINE_C,
    LINE_K,
    LINE_Z,
    NORMAL,
    OWNER_R,
    PLASTIC,
    PLOUGHED,
    ROW,
    SHEAR,
    SPREAD,
    loading_force,
)
from ground.law import REFERENCE_AREA
from rollover.kernels.links import stiffen_links
from rollover.kernels.posts import ROOM_COLUMNS, ROOM_ROWS, stiffen_post
from rollover.kernels.tables import (
    A_C,
    A_K,
    ACTIVE,
    COHESION,
    E_DEPTH_NOW,
    E_FORCE_NOW,
    E_NORMAL_NOW,
    E_POINT,
    FN,
    M_TORQUE_NOW,
    MEMORYLESS,
    MODULUS,
    MOVED,
    MU,
    RELAXATION,
    ROT,
    S_DELTA_NOW,
    S_SET,
    STICK,
    T_B,
    T_C,
    T_K,
    T_PLAY,
    W_BOTTOM,
    W_C,
    W_KB,
    W_KY,
    W_KZ,
    W_MU,
    ZDOT,
    X,
    Z,
)
from rollover.kernels.terms import stiffen_terms
from rollover.kernels.tyres import TYRE_RELAXATION, tyre_stiffness
from rollover.kernels.vectors import direction_row, place, to_body, velocity


@leaf
def add_block(K: Any, factor: float, a: Any, at: int, b: Any, bt: int) -> None:
    """K += factor a b' on the block at rows `at`, columns `bt`."""
    for j in range(6):
        for k in range(6):
            K[at + j, bt + k] += factor * a[j] * b[k]


@leaf
def add_point(K: Any, row: Any, b: int, r: Any, n: Any, normal: float, tangential: float, room: Any) -> None:
    """A spring `normal` along n and `tangential` across it at the point r of body b; `room` (ROOM, 6) is written."""
    J, d = room[0], room[1]
    direction_row(row, r, n[0], n[1], n[2], J)
    add_block(K, normal - tangential, J, 6 * b, J, 6 * b)
    if tangential > 0.0:
        for k in range(3):
            d[0], d[1], d[2] = 0.0, 0.0, 0.0
            d[k] = 1.0
            direction_row(row, r, d[0], d[1], d[2], J)
            for j in range(6):
                if J[j] != 0.0:  # of the first three one alone is not
                    for i in range(6):
                        K[6 * b + j, 6 * b + i] += tangential * J[j] * J[i]


@leaf
def add_tangent(
    K: Any, row: Any, b: int, m: Any, trial: Any, soil: Any, normal: float, along: float, room: Any
) -> None:
    """The whole derivative of a contact's normal force and friction, which is not symmetric where it slips.

    With x the strain of the stick spring and u = x/max(|x|, d_s): F_t = -mu F_n u, so that F_n brings -mu u dF_n, and
    u turns with dx across x only where |x| > d_s.
    """
    n, D, C, x, v = m[NORMAL : NORMAL + 3], room[0:3], room[3:6], room[6], room[7]
    v[0], v[1], v[2] = velocity(row, m[OWNER_R], m[OWNER_R + 1], m[OWNER_R + 2])
    lean = 0.0
    for k in range(3):
        x[k] = m[SHEAR + k] + trial[MOVED + k] + soil[RELAXATION] * v[k]
        lean += x[k] * n[k]
    for k in range(3):
        x[k] -= lean * n[k]
    size = math.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2])
    slips, reach = size > soil[STICK], max(size, soil[STICK])
    spring = soil[MU] * trial[FN] * along / reach
    for j in range(3):
        for k in range(3):
            C[j, k] = (normal - spring) * n[j] * n[k] - soil[MU] * normal * x[j] / reach * n[k]
            if slips:
                C[j, k] -= spring * x[j] * x[k] / (size * size)
        C[j, j] += spring
        v[0], v[1], v[2] = 0.0, 0.0, 0.0
        v[j] = 1.0
        direction_row(row, m[OWNER_R : OWNER_R + 3], v[0], v[1], v[2], D[j])
    for j in range(3):
        for k in range(3):
            add_block(K, C[j, k], D[j], 6 * b, D[k], 6 * b)


@leaf
def add_pair(K: Any, factor: float, a: Any, at: int, b: Any, bt: int) -> None:
    """A spring between two bodies: K += factor (a - b)(a - b)'."""
    add_block(K, factor, a, at, a, at)
    add_block(K, factor, b, bt, b, bt)
    add_block(K, -factor, a, at, b, bt)
    add_block(K, -factor, b, bt, a, at)


ROOM = 8  # rows of 6 numbers that a leaf works with: one that made arrays of its own would count who holds them


@leaf
def add_elements(t: Any, f: float, fd: float, K: Any, room: Any) -> None:
    """Contacts with elements of the ground."""
    for a in range(t.counts[ACTIVE]):
        i = t.active[a]
        m, trial = t.memory[i], t.trial[i]
        z, v = trial[Z], trial[ZDOT]
        if trial[FN] <= 0.0:
            continue
        area, law, p, soil = (
            m[AREA] / REFERENCE_AREA,
            t.law[t.state[i, ROW]],
            t.p[t.state[i, ROW]],
            t.soil[t.state[i, ROW]],
        )
        if law[PLASTIC] != 0 and z < m[LINE_Z]:
            normal = area * (f * m[LINE_K] + fd * m[LINE_C])
        else:
            s, z = t.s[i], max(z - m[SPREAD], 0.0)
            here = loading_force(law, p, s, z, v)
            deeper = loading_force(law, p, s, z + 1e-6, v)
            faster = loading_force(law, p, s, z, v + 1e-6)
            normal = area * (f * (deeper - here) + fd * (faster - here)) * 1e6
        b = t.state[i, BODY]
        if soil[MEMORYLESS] > 0.0:
            add_tangent(K, t.pose[b], b, m, trial, soil, normal, f + fd * soil[RELAXATION], room)
            continue
        if soil[MODULUS] > 0.0:
            stick = (soil[COHESION] * m[AREA] + soil[MU] * trial[FN] + m[PLOUGHED]) / soil[MODULUS]
        else:
            stick = (soil[MU] * trial[FN] + m[PLOUGHED]) / soil[STICK]
        add_point(
            K,
            t.pose[b],
            b,
            m[OWNER_R : OWNER_R + 3],
            m[NORMAL : NORMAL + 3],
            normal,
            stick * (f + fd * soil[RELAXATION]),
            room,
        )


@leaf
def add_wheels(t: Any, f: float, fd: float, K: Any, room: Any) -> None:
    """Tyres on the ground."""
    for w in range(t.wheel_i.size):
        g, c = t.wheel_memory[w], t.wheel_f[w]
        if g[E_FORCE_NOW] > 0.0:
            b = t.wheel_i[w]
            k, _ = tyre_stiffness(c, 0.0)
            bottom = c[W_KB] if g[E_DEPTH_NOW] > c[W_BOTTOM] else 0.0
            normal = f * (k + bottom) + fd * c[W_C] * k / c[W_KZ]
            stick = c[W_KY] * (f + fd * TYRE_RELAXATION) if c[W_MU] > 0.0 else 0.0
            n = g[E_NORMAL_NOW : E_NORMAL_NOW + 3]
            add_point(K, t.pose[b], b, g[E_POINT : E_POINT + 3], n, normal, stick, room)


@compiled
def stiffness(t: Any, f: float, fd: float, K: Any) -> None:
    """K (6 nb, 6 nb) = f (-dQ/dq) + fd (-dQ/dq') at the state that was tried last."""
    for i in range(K.shape[0]):
        for k in range(K.shape[1]):
            K[i, k] = 0.0
    room = np.empty((ROOM, 6))
    add_elements(t, f, fd, K, room)
    add_wheels(t, f, fd, K, room)
    add_mounts(t, f, fd, K, room, np.empty((ROOM_ROWS if t.post_f.shape[0] > 0 else 0, ROOM_COLUMNS)))
    stiffen_terms(t, f, fd, K)
    stiffen_links(t, f, fd, K)
    if t.axle_f.size > 0 and t.axle_memory[M_TORQUE_NOW] != 0.0:
        c, b = t.axle_i[0], t.axle_i[1]
        spin_row(t, c, c, 0, room[0])
        spin_row(t, c, b, 0, room[1])
        add_pair(K, f * t.axle_f[A_K] + fd * t.axle_f[A_C], room[0], 6 * c, room[1], 6 * b)


@leaf
def spin_row(t: Any, c: int, b: int, k: int, J: Any) -> None:
    """Row (6,) of the angular velocity of body b about axis k of body c, into J."""
    J[0], J[1], J[2] = 0.0, 0.0, 0.0
    J[3], J[4], J[5] = to_body(t.pose[b], t.pose[c, ROT + k], t.pose[c, ROT + 3 + k], t.pose[c, ROT + 6 + k])


@leaf
def add_mounts(t: Any, f: float, fd: float, K: Any, room: Any, wide: Any) -> None:
    """Springs of mounts and hinges along and about the axes of body a; none where they move in their play."""
    J, L, local = room[0], room[1], room[2]
    for i in range(t.mount_f.shape[0]):
        if t.mount_i[i, 2] >= 0:
            stiffen_post(t, i, t.mount_i[i, 2], f, fd, K, wide)
            continue
        g, m = t.mount_f[i], t.mount_memory[i]
        c, b = t.mount_i[i, 0], t.mount_i[i, 1]
        under, upper = t.pose[c], t.pose[b]
        x, y, z = place(upper, g[T_B], g[T_B + 1], g[T_B + 2])
        local[0], local[1], local[2] = to_body(under, x - under[X], y - under[X + 1], z - under[X + 2])
        for k in range(3):
            x, y, z = under[ROT + k], under[ROT + 3 + k], under[ROT + 6 + k]
            direction_row(upper, g[T_B : T_B + 3], x, y, z, J)
            direction_row(under, local, x, y, z, L)
            if not loose(g, m, k):
                add_pair(K, f * g[T_K + k] + fd * g[T_C + k], J, 6 * b, L, 6 * c)
            if not loose(g, m, 3 + k):
                factor = f * g[T_K + 3 + k] + fd * g[T_C + 3 + k]
                spin_row(t, c, b, k, J)
                spin_row(t, c, c, k, L)
                add_pair(K, factor, J, 6 * b, L, 6 * c)


@leaf
def loose(f: Any, g: Any, j: int) -> bool:
    """Whether axis j of a connector moves inside its play."""
    return f[T_PLAY + j] > 0.0 and abs(g[S_DELTA_NOW + j] - g[S_SET + j]) <= f[T_PLAY + j]  # type: ignore[no-any-return]
