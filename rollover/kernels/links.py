"""Compiled: links: ball joints with stops, straps that pull only, spheres against boxes and tubes, struts of wheels.

A row of `link_i` says kind, body b, body a, the first place in `link_out` and the account; the same row of `link_f` its
numbers, points about the centres of mass of b and a. All springs are functions of the bodies' relative pose alone, so
that what they hold is an energy; what their dashpots and friction take is the power that the ledger adds to it.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ground.compiled import compiled, leaf
from rollover.kernels.compliant_joints import relative_turn, turned
from rollover.kernels.tables import OMEGA, ROT, X
from rollover.kernels.terms import add_both
from rollover.kernels.vectors import add_between, direction_row, place, spin, to_body, to_world, velocity

JOINT, STRAP, BLOCK, BAR, STRUT = 0, 1, 2, 3, 4  # kinds
# columns of link_f: point on b, point on a (of a block its lower, of a bar its first corner), stiffness and dashpot
L_B, L_A, L_K, L_C = 0, 3, 6, 7
L_TURN, L_DAMP, L_LOW, L_HIGH, L_STOP = 8, 11, 14, 17, 20  # of a joint: N m/rad, N m s/rad, angles, N m/rad
L_LENGTH = 8  # of a strap, unstrained
L_END, L_RADIUS, L_MU = 8, 11, 12  # of a block or bar: its other corner or end, reach of the sphere, friction
# of a strut, besides a joint's: along z spring, dashpot, force in the design position, travel down and up, stop
L_SPRING, L_DASHPOT, L_PRELOAD, L_DROOP, L_BUMP, L_TRAVEL_STOP, LINK_COLUMNS = 21, 22, 23, 24, 25, 26, 27
# columns of link_memory: energy and power at the step's start and now; force on b (3; of a
# touch in world axes, of a joint in those of a), moment on b (3)
HELD, POWER, HELD_NOW, POWER_NOW, L_FORCE, L_MOMENT, LINK_MEMORY = 0, 1, 2, 3, 4, 7, 10
CREEP = 0.02  # m/s: below it friction of a part is a dashpot: it slips 20 mm in a second at most where it should hold
STOP_DAMPING = 0.2  # s/rad of a joint's stop, M = k d (1 + 0.2 dd/dt): nothing at 0, half as much again at 2.5 rad/s


@compiled
def try_links(t: Any, Q: Any) -> None:
    """Forces of all links at the poses that were read last."""
    if t.link_i.shape[0] == 0:
        return
    room = np.empty((5, 3))
    for i in range(t.link_i.shape[0]):
        kind = t.link_i[i, 0]
        if kind in (JOINT, STRUT):
            try_joint(t, i, room, Q)
        elif kind == STRAP:
            try_strap(t, i, room, Q)
        else:
            try_touch(t, i, room, Q)


@leaf
def seen_from(under: Any, upper: Any, r: Any, found: Any) -> None:
    """A point r about b, in the axes of a and about its centre, into `found` (3,)."""
    x, y, z = place(upper, r[0], r[1], r[2])
    found[0], found[1], found[2] = to_body(under, x - under[X], y - under[X + 1], z - under[X + 2])


@leaf
def try_joint(t: Any, i: int, room: Any, Q: Any) -> None:
    """Springs along and about a's axes; stops beyond the range of each angle of the rotation vector.

    Of a strut that along z has a preload, a dashpot and stops of its own: N = P + k d + k_s (d beyond the travel).
    """
    turn, rates, moved, force, local = room[0], room[1], room[2], room[3], room[4]
    f, g, b, a = t.link_f[i], t.link_memory[i], t.link_i[i, 1], t.link_i[i, 2]
    under, upper, r = t.pose[a], t.pose[b], f[L_B : L_B + 3]
    seen_from(under, upper, r, local)
    v, w = velocity(upper, r[0], r[1], r[2]), velocity(under, local[0], local[1], local[2])
    rate = to_body(under, v[0] - w[0], v[1] - w[1], v[2] - w[2])
    x, y, z = spin(upper)
    spun = to_body(under, x, y, z)
    beta = relative_turn(under, upper, turn)
    for k in range(3):
        rates[k] = spun[k] - under[OMEGA + k]
    turned(turn, beta, -1.0, rates, moved)
    held, power = 0.0, 0.0
    for k in range(3):
        d = local[k] - f[L_A + k]
        if k == 2 and t.link_i[i, 0] == STRUT:
            over = d - min(max(d, f[L_DROOP]), f[L_BUMP])
            force[2] = -f[L_PRELOAD] - f[L_SPRING] * d - f[L_TRAVEL_STOP] * over - f[L_DASHPOT] * rate[2]
            held += f[L_PRELOAD] * d + 0.5 * (f[L_SPRING] * d * d + f[L_TRAVEL_STOP] * over * over)
            power += f[L_DASHPOT] * rate[2] * rate[2]
        else:
            force[k] = -f[L_K] * d - f[L_C] * rate[k]
            held += 0.5 * f[L_K] * d * d
            power += f[L_C] * rate[k] * rate[k]
        beyond = turn[k] - min(max(turn[k], f[L_LOW + k]), f[L_HIGH + k])
        stop = f[L_STOP] * beyond
        damped = stop * max(1.0 + STOP_DAMPING * math.copysign(moved[k], beyond * moved[k]), 0.0)
        rates[k] = -f[L_TURN + k] * turn[k] - f[L_DAMP + k] * moved[k] - damped
        held += 0.5 * (f[L_TURN + k] * turn[k] * turn[k] + stop * beyond)
        power += f[L_DAMP + k] * moved[k] * moved[k] + (damped - stop) * moved[k]
    turned(turn, beta, 1.0, rates, moved)
    for k in range(3):
        g[L_FORCE + k], g[L_MOMENT + k] = force[k], moved[k]
    add_between(under, a, local, upper, b, r, force, moved, Q)
    g[HELD_NOW], g[POWER_NOW] = held, power


@leaf
def try_strap(t: Any, i: int, room: Any, Q: Any) -> None:
    """T = k e (1 + chi de/dt) where it is strained, never below zero."""
    force, torque, way = room[0], room[1], room[2]
    f, g, b, a = t.link_f[i], t.link_memory[i], t.link_i[i, 1], t.link_i[i, 2]
    under, upper, r, p = t.pose[a], t.pose[b], f[L_B : L_B + 3], f[L_A : L_A + 3]
    x, y, z = place(upper, r[0], r[1], r[2])
    u, v, w = place(under, p[0], p[1], p[2])
    way[0], way[1], way[2] = x - u, y - v, z - w
    length = math.sqrt(way[0] * way[0] + way[1] * way[1] + way[2] * way[2])
    e = length - f[L_LENGTH]
    g[HELD_NOW], g[POWER_NOW], g[L_FORCE] = 0.0, 0.0, 0.0
    if e <= 0.0:
        return
    v3, w3 = velocity(upper, r[0], r[1], r[2]), velocity(under, p[0], p[1], p[2])
    rate = ((v3[0] - w3[0]) * way[0] + (v3[1] - w3[1]) * way[1] + (v3[2] - w3[2]) * way[2]) / length
    tension = f[L_K] * e * max(1.0 + f[L_C] * rate, 0.0)
    x, y, z = to_body(under, way[0], way[1], way[2])
    force[0], force[1], force[2] = -tension * x / length, -tension * y / length, -tension * z / length
    torque[0], torque[1], torque[2] = 0.0, 0.0, 0.0
    # the pull acts along the line between both ends: as good at one as at the other
    seen_from(under, upper, r, way)
    add_between(under, a, way, upper, b, r, force, torque, Q)
    g[HELD_NOW], g[POWER_NOW], g[L_FORCE] = 0.5 * f[L_K] * e * e, (tension - f[L_K] * e) * rate, tension


@leaf
def nearest(kind: int, f: Any, c: Any, p: Any, n: Any) -> float:
    """Point p of a block or bar nearest to the sphere's middle c, normal n towards it; depth, all in a's axes, m."""
    inside = kind == BLOCK
    if kind == BLOCK:
        for k in range(3):
            p[k] = min(max(c[k], f[L_A + k]), f[L_END + k])
            inside = inside and p[k] == c[k]
    else:
        dot, square = 0.0, 0.0
        for k in range(3):
            axis = f[L_END + k] - f[L_A + k]
            dot += axis * (c[k] - f[L_A + k])
            square += axis * axis
        along = min(max(dot / square, 0.0), 1.0)
        for k in range(3):
            p[k] = f[L_A + k] + along * (f[L_END + k] - f[L_A + k])
    if inside:  # its middle is in the block: out by the nearest face
        best, face, sign = math.inf, 0, 1.0
        for k in range(3):
            for s, d in ((-1.0, c[k] - f[L_A + k]), (1.0, f[L_END + k] - c[k])):
                if d < best:
                    best, face, sign = d, k, s
        for k in range(3):
            n[k] = 0.0
        n[face] = sign
        return f[L_RADIUS] + best  # type: ignore[no-any-return]
    x, y, z = c[0] - p[0], c[1] - p[1], c[2] - p[2]
    size = math.sqrt(x * x + y * y + z * z)
    if size < 1e-12:  # on a bar's axis: no way out is nearer than another
        n[0], n[1], n[2] = 0.0, 0.0, 1.0
        return f[L_RADIUS]  # type: ignore[no-any-return]
    n[0], n[1], n[2] = x / size, y / size, z / size
    return f[L_RADIUS] - size  # type: ignore[no-any-return]


@leaf
def try_touch(t: Any, i: int, room: Any, Q: Any) -> None:
    """N = k d (1 + chi dd/dt) of a sphere in a block or bar, never below zero, and friction mu N v/max(|v|, v_c)."""
    c, p, n, force, on_b = room[0], room[1], room[2], room[3], room[4]
    f, g, b, a = t.link_f[i], t.link_memory[i], t.link_i[i, 1], t.link_i[i, 2]
    under, upper, r = t.pose[a], t.pose[b], f[L_B : L_B + 3]
    seen_from(under, upper, r, c)
    depth = nearest(t.link_i[i, 0], f, c, p, n)
    g[HELD_NOW], g[POWER_NOW] = 0.0, 0.0
    g[L_FORCE], g[L_FORCE + 1], g[L_FORCE + 2] = 0.0, 0.0, 0.0
    if depth <= 0.0:
        return
    rate, slide = touch_rates(under, upper, p, n, on_b)
    normal = f[L_K] * depth * max(1.0 + f[L_C] * rate, 0.0)
    speed = math.sqrt(slide[0] * slide[0] + slide[1] * slide[1] + slide[2] * slide[2])
    rub = f[L_MU] * normal / max(speed, CREEP)
    for k in range(3):
        force[k] = normal * n[k] - rub * slide[k]
        c[k] = 0.0
    g[L_FORCE], g[L_FORCE + 1], g[L_FORCE + 2] = to_world(under, force[0], force[1], force[2])
    add_between(under, a, p, upper, b, on_b, force, c, Q)
    g[HELD_NOW] = 0.5 * f[L_K] * depth * depth
    g[POWER_NOW] = (normal - f[L_K] * depth) * rate + rub * speed * speed


@leaf
def touch_rates(under: Any, upper: Any, p: Any, n: Any, on_b: Any) -> Any:
    """Rate of the depth and sliding velocity (a's axes) where b touches a at p; that place about b into `on_b`."""
    seen_from(upper, under, p, on_b)
    v, w = velocity(upper, on_b[0], on_b[1], on_b[2]), velocity(under, p[0], p[1], p[2])
    u = to_body(under, v[0] - w[0], v[1] - w[1], v[2] - w[2])
    out = u[0] * n[0] + u[1] * n[1] + u[2] * n[2]
    return -out, (u[0] - out * n[0], u[1] - out * n[1], u[2] - out * n[2])


@leaf
def finish_links(t: Any, h: float) -> None:
    """Book what the links took in a step, keep what is recorded of them, and start the next one."""
    for k in range(t.link_out.size):
        t.link_out[k] = 0.0
    for i in range(t.link_i.shape[0]):
        g, at = t.link_memory[i], t.link_i[i, 3]
        t.work[t.link_i[i, 4]] += g[HELD_NOW] - g[HELD] + 0.5 * h * (g[POWER] + g[POWER_NOW])
        keep_link(t, i, at)


@leaf
def keep_link(t: Any, i: int, at: int) -> None:
    """What a link holds and takes now is what the next step starts from; its forces into `link_out`."""
    g, kind = t.link_memory[i], t.link_i[i, 0]
    g[HELD], g[POWER] = g[HELD_NOW], g[POWER_NOW]
    if kind == STRAP:
        t.link_out[at] += g[L_FORCE]
        return
    for k in range(6 if kind in (JOINT, STRUT) else 3):
        t.link_out[at + k] += g[L_FORCE + k]


@compiled
def stiffen_links(t: Any, f: float, fd: float, K: Any) -> None:
    """What they add to Newton's matrix, symmetric and without the terms of turning frames."""
    if t.link_i.shape[0] == 0:
        return
    J, room = np.zeros((2, 6)), np.empty((5, 3))
    for i in range(t.link_i.shape[0]):
        kind = t.link_i[i, 0]
        if kind in (JOINT, STRUT):
            stiffen_joint(t, i, f, fd, J, room, K)
        elif kind == STRAP:
            stiffen_strap(t, i, f, fd, J, room, K)
        elif t.link_memory[i, HELD_NOW] > 0.0:
            stiffen_touch(t, i, f, fd, J, room, K)


@leaf
def stiffen_joint(t: Any, i: int, f: float, fd: float, J: Any, room: Any, K: Any) -> None:
    """Springs along and about a's axes, a stop where it is met."""
    n, b, a, turn, local = t.link_f[i], t.link_i[i, 1], t.link_i[i, 2], room[0], room[1]
    under, upper, r = t.pose[a], t.pose[b], n[L_B : L_B + 3]
    seen_from(under, upper, r, local)
    relative_turn(under, upper, turn)
    for k in range(3):
        x, y, z = under[ROT + k], under[ROT + 3 + k], under[ROT + 6 + k]
        direction_row(upper, r, x, y, z, J[0])
        direction_row(under, local, x, y, z, J[1])
        along = f * n[L_K] + fd * n[L_C]
        if k == 2 and t.link_i[i, 0] == STRUT:
            d = local[2] - n[L_A + 2]
            along = f * n[L_SPRING] + fd * n[L_DASHPOT]
            if d < n[L_DROOP] or d > n[L_BUMP]:
                along += f * n[L_TRAVEL_STOP]
        add_both(K, along, J, 6 * b, 6 * a)
        beyond = abs(turn[k] - min(max(turn[k], n[L_LOW + k]), n[L_HIGH + k]))
        about = f * n[L_TURN + k] + fd * n[L_DAMP + k]
        if beyond > 0.0:
            about += n[L_STOP] * (f + fd * STOP_DAMPING * beyond)
        J[:, :] = 0.0
        J[0, 3], J[0, 4], J[0, 5] = to_body(upper, x, y, z)
        J[1, 3 + k] = 1.0
        add_both(K, about, J, 6 * b, 6 * a)


@leaf
def stiffen_strap(t: Any, i: int, f: float, fd: float, J: Any, room: Any, K: Any) -> None:
    """A spring along a strap that pulls."""
    n, b, a = t.link_f[i], t.link_i[i, 1], t.link_i[i, 2]
    held = t.link_memory[i, HELD_NOW]
    if held <= 0.0:
        return
    under, upper, r, p = t.pose[a], t.pose[b], n[L_B : L_B + 3], n[L_A : L_A + 3]
    x, y, z = place(upper, r[0], r[1], r[2])
    u, v, w = place(under, p[0], p[1], p[2])
    x, y, z = x - u, y - v, z - w
    size = math.sqrt(x * x + y * y + z * z)
    direction_row(upper, r, x / size, y / size, z / size, J[0])
    direction_row(under, p, x / size, y / size, z / size, J[1])
    strain = math.sqrt(2.0 * held / n[L_K])
    factor = t.link_memory[i, L_FORCE] / strain  # k (1 + chi de/dt)
    add_both(K, f * factor + fd * n[L_K] * strain * n[L_C], J, 6 * b, 6 * a)


@leaf
def stiffen_touch(t: Any, i: int, f: float, fd: float, J: Any, room: Any, K: Any) -> None:
    """A spring along the normal, and friction as a dashpot across it."""
    c, p, m, on_b = room[0], room[1], room[2], room[4]
    n, b, a = t.link_f[i], t.link_i[i, 1], t.link_i[i, 2]
    under, upper, r = t.pose[a], t.pose[b], n[L_B : L_B + 3]
    seen_from(under, upper, r, c)
    depth = nearest(t.link_i[i, 0], n, c, p, m)
    rate, slide = touch_rates(under, upper, p, m, on_b)
    speed = math.sqrt(slide[0] * slide[0] + slide[1] * slide[1] + slide[2] * slide[2])
    factor = max(1.0 + n[L_C] * rate, 0.0)
    along = n[L_K] * (f * factor + fd * depth * n[L_C])
    across = fd * n[L_MU] * n[L_K] * depth * factor / max(speed, CREEP)
    for k in range(3):
        x, y, z = under[ROT + k], under[ROT + 3 + k], under[ROT + 6 + k]
        direction_row(upper, on_b, x, y, z, J[0])
        direction_row(under, p, x, y, z, J[1])
        add_both(K, across, J, 6 * b, 6 * a)
    x, y, z = m[0], m[1], m[2]
    u, v, w = to_world(under, x, y, z)
    direction_row(upper, on_b, u, v, w, J[0])
    direction_row(under, p, u, v, w, J[1])
    add_both(K, along - across, J, 6 * b, 6 * a)
