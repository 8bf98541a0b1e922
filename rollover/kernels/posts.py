"""Compiled: posts of a frame that bend along their length, between the chassis and what their heads hold together.

A post has no mass of its own, so that equilibrium says what each section carries: with s = (N, F_h, F_b, T, M_b, M_h)
on its head, sigma = B s are the axial force, both moments and the torque over their plastic resistances. The rail that
ties its head bends as in a portal that sways, from the knee's moment to none at its middle. Each section yields by

    |sigma - g p| <= 1 + (p'/D f_y A)^(1/q),   p' along sigma - g p,

the plastic interaction as an ellipsoid, with kinematic hardening g and Cowper and Symonds' factor; p is what is plastic
of it, in work for each length. By the virtual work of s the head moves by the sum over sections, of lengths w,

    v = C s + sum w B' p,   v = (u + (d_h^2 + d_b^2)/(2 H), d_h, d_b, turn),

u along the undeformed post, the second term the shortening of its chord, so that N at a lean bends it (P-delta). For a
given v that is one equation in s, the gradient of a convex function: Newton's iteration with a search along its step.
The force-based element is that of Spacone, Ciampi and Filippou, Computers & Structures 58 (1996) 83 to 97, recalled.
"""

from __future__ import annotations

import math
from typing import Any

from ground.compiled import leaf
from rollover.kernels.contact_state import note_event
from rollover.kernels.dense import solve_in_place
from rollover.kernels.rate import overstress
from rollover.kernels.tables import (
    HINGE,
    S_DELTA_NOW,
    S_FORCE_NOW,
    T_A,
    T_B,
)
from rollover.kernels.vectors import cross, direction_row, place, to_body, to_world

# columns of post_f: rows of the post's axes, along, depth, width (9), its height H, retardation of its dashpots (6, s),
# elastic stiffness and compliance of its head (36 each)
P_AXES, P_HIGH, P_LAG, P_K, P_C, POST_COLUMNS = 0, 9, 10, 16, 52, 88
# columns of post_memory: load on the head that was found last, plastic way of the head, work that is plastic and
# largest use of any section at the start of the step; stiffness and use now, whether anything yields now, moment at
# the foot (axes of the body below)
P_LOAD, P_WAY, P_WORK, P_USE, P_TANGENT, P_USE_NOW, P_FLOWS, P_FOOT, POST_MEMORY = 0, 6, 12, 13, 14, 50, 51, 52, 55
# columns of section_f: length w, hardening g (m/J), D f_y A (J/(m s), 0: no factor of the rate), exponent q, rows of B
C_LENGTH, C_HARD, C_SPEED, C_Q, C_B, SECTION_COLUMNS = 0, 1, 2, 3, 4, 28
# columns of section_memory, each for the four: p at the start of the step, p now (J/m)
C_P, C_P_NOW, SECTION_MEMORY = 0, 4, 8
RECORDED = 3  # numbers of a post in a row: plastic way of its head, plastic work, use of its worst section
CLOSED = 1e-20  # J: r' K r of what is left of v, 1e-12 m on springs of 10 kN/m
MOST, SEARCHES = 60, 12  # iterations, and steps of a search
LEFT = 0.5  # share of the slope that may be left at a search's end
ROOM_ROWS, ROOM_COLUMNS = 22, 12


@leaf
def strained(f: Any, p: Any, s: Any, u: Any) -> float:
    """sigma - g p of a section under s, into u (4,); returns its size."""
    square = 0.0
    for i in range(4):
        total = -f[C_HARD] * p[C_P + i]
        for j in range(6):
            total += f[C_B + 6 * i + j] * s[j]
        u[i] = total
        square += total * total
    return math.sqrt(square)


@leaf
def flowed(f: Any, over: float, h: float) -> Any:
    """Plastic work of a step for each length of a section that is `over` its yield, over 1; and its slope."""
    g = f[C_HARD]
    if f[C_SPEED] > 0.0:
        x = overstress(g, 1.0, f[C_SPEED], f[C_Q], over, h)
        slope = h * f[C_SPEED] * f[C_Q] * x ** (f[C_Q] - 1.0)
        return h * f[C_SPEED] * x ** f[C_Q], slope / (1.0 + g * slope)
    return over / g, 1.0 / g


@leaf
def compliant(t: Any, i: int, s: Any, v: Any, h: float, r: Any, J: Any, u: Any) -> float:
    """What of v (6,) the load s does not explain, into r (6,), and the compliance dv/ds, into J; the greatest use.

    u (2, >= 6) is written over.
    """
    f, g, most = t.post_f[i], t.post_memory[i], 0.0
    for j in range(6):
        r[j] = v[j] - g[P_WAY + j]
        for k in range(6):
            J[j, k] = f[P_C + 6 * j + k]
            r[j] -= J[j, k] * s[k]
    for n in range(t.post_i[i, 0], t.post_i[i, 1]):
        c, p = t.section_f[n], t.section_memory[n]
        size = strained(c, p, s, u[0])
        most = max(most, size)
        work, slope = 0.0, 0.0
        if size > 1.0:
            work, slope = flowed(c, size - 1.0, h)
            for j in range(6):
                u[1, j] = 0.0
                for m in range(4):
                    u[1, j] += u[0, m] / size * c[C_B + 6 * m + j]
            turned = work / size
            for j in range(6):
                r[j] -= c[C_LENGTH] * work * u[1, j]
                for k in range(6):
                    across = 0.0
                    for m in range(4):
                        across += c[C_B + 6 * m + j] * c[C_B + 6 * m + k]
                    J[j, k] += c[C_LENGTH] * (turned * across + (slope - turned) * u[1, j] * u[1, k])
        for m in range(4):
            p[C_P_NOW + m] = p[C_P + m] + (work * u[0, m] / size if size > 1.0 else 0.0)
    return most


@leaf
def left_over(K: Any, r: Any) -> float:
    """r' K r with K (36,) row by row."""
    total = 0.0
    for j in range(6):
        for k in range(6):
            total += r[j] * K[6 * j + k] * r[k]
    return total


@leaf
def turned_over(J: Any, r: Any, B: Any) -> None:
    """B (6, 7) <- J^-1 [r, 1]; J is destroyed."""
    for j in range(6):
        B[j, 0] = r[j]
        for k in range(6):
            B[j, 1 + k] = 1.0 if j == k else 0.0
    solve_in_place(J, B)


@leaf
def go_along(t: Any, i: int, s: Any, ds: Any, v: Any, h: float, r: Any, J: Any, u: Any, trial: Any) -> float:
    """s += x ds with x = 1, or where the convex function is nearly least along ds if that is beyond; the use there."""
    first, x, low, high, use = 0.0, 1.0, 0.0, 0.0, 0.0
    for j in range(6):
        first += r[j] * ds[j]
    left, right = first, 0.0
    for _ in range(SEARCHES):
        for j in range(6):
            trial[j] = s[j] + x * ds[j]
        use = compliant(t, i, trial, v, h, r, J, u)
        slope = 0.0
        for j in range(6):
            slope += r[j] * ds[j]
        if abs(slope) <= LEFT * first or (slope > 0.0 and right == 0.0):
            break
        if slope < 0.0:
            high, right = x, slope
        else:
            low, left = x, slope
        x = low + (high - low) * min(max(left / (left - right), 0.1), 0.9)
    for j in range(6):
        s[j] = trial[j]
    return use


@leaf
def try_load(t: Any, i: int, v: Any, h: float, room: Any) -> None:
    """Load on the head of post i that goes with v (6,), with stiffness and use; `room` (ROOM_ROWS, ROOM_COLUMNS)."""
    f, g = t.post_f[i], t.post_memory[i]
    s, r, ds, u = g[P_LOAD : P_LOAD + 6], room[0, :6], room[1, :6], room[2:4]
    trial, J, B = room[4, :6], room[5:11, :6], room[11:17, :7]
    had = g[P_FLOWS] > 0.0
    for j in range(6):
        trial[j] = 0.0
        for k in range(6):
            trial[j] += f[P_K + 6 * j + k] * (v[k] - g[P_WAY + k])
    use = 0.0
    for n in range(t.post_i[i, 0], t.post_i[i, 1]):
        use = max(use, strained(t.section_f[n], t.section_memory[n], trial, u[0]))
    g[P_USE_NOW], g[P_FLOWS] = use, 0.0
    if use <= 1.0:
        for j in range(36):
            g[P_TANGENT + j] = f[P_K + j]
        for j in range(6):
            s[j] = trial[j]
        return
    g[P_FLOWS] = 1.0
    if not had:
        for j in range(6):
            s[j] = trial[j] / use
    g[P_USE_NOW] = compliant(t, i, s, v, h, r, J, u)
    for _ in range(MOST):
        if left_over(f[P_K : P_K + 36], r) <= CLOSED:
            break
        turned_over(J, r, B)
        for j in range(6):
            ds[j] = B[j, 0]
        g[P_USE_NOW] = go_along(t, i, s, ds, v, h, r, J, u, trial)
    turned_over(J, r, B)
    for j in range(6):
        for k in range(6):
            g[P_TANGENT + 6 * j + k] = B[j, 1 + k]


@leaf
def try_post(t: Any, i: int, m: int, way: Any, turn: Any, rate: Any, rates: Any, room: Any) -> None:
    """Loads of post m on its head, body b of mount i, for its way and turn (3,) and their rates, body a's axes.

    Force and moment go into the mount's memory, the moment at the foot into the post's.
    """
    f, g, q = t.post_f[m], t.post_memory[m], t.mount_memory[i]
    E, v, dv, F = f[P_AXES : P_AXES + 9], room[17], room[18], room[19]
    high = f[P_HIGH]
    for k in range(3):
        v[k], v[3 + k], dv[k], dv[3 + k] = 0.0, 0.0, 0.0, 0.0
        for j in range(3):
            v[k] += E[3 * k + j] * way[j]
            v[3 + k] += E[3 * k + j] * turn[j]
            dv[k] += E[3 * k + j] * rate[j]
            dv[3 + k] += E[3 * k + j] * rates[j]
    h, b = v[1], v[2]
    v[0] += 0.5 * (h * h + b * b) / high
    dv[0] += (h * dv[1] + b * dv[2]) / high
    try_load(t, m, v, t.clock[0], room)
    for j in range(6):
        F[j] = g[P_LOAD + j]
        for k in range(6):
            F[j] += f[P_LAG + j] * f[P_K + 6 * j + k] * dv[k]
    F[1] += F[0] * h / high
    F[2] += F[0] * b / high
    for k in range(3):
        q[S_DELTA_NOW + k], q[S_DELTA_NOW + 3 + k] = way[k], turn[k]
        q[S_FORCE_NOW + k], q[S_FORCE_NOW + 3 + k] = 0.0, 0.0
        for j in range(3):
            q[S_FORCE_NOW + k] -= E[3 * j + k] * F[j]
            q[S_FORCE_NOW + 3 + k] -= E[3 * j + k] * F[3 + j]
    x, y, z = cross(
        high * E[0] + way[0],
        high * E[1] + way[1],
        high * E[2] + way[2],
        q[S_FORCE_NOW],
        q[S_FORCE_NOW + 1],
        q[S_FORCE_NOW + 2],
    )
    g[P_FOOT], g[P_FOOT + 1], g[P_FOOT + 2] = x + q[S_FORCE_NOW + 3], y + q[S_FORCE_NOW + 4], z + q[S_FORCE_NOW + 5]


@leaf
def finish_post(t: Any, i: int, m: int) -> None:
    """What post m of mount i has yielded in the step stays; its first yielding is an event, about its main axis."""
    g = t.post_memory[m]
    g[P_USE] = g[P_USE_NOW]
    if g[P_FLOWS] == 0.0:
        return
    if g[P_WORK] == 0.0:
        axis = 0
        for k in range(1, 3):
            if abs(g[P_FOOT + k]) > abs(g[P_FOOT + axis]):
                axis = k
        note_event(t, HINGE, i, place(t.pose[t.mount_i[i, 1]], 0.0, 0.0, 0.0), float(3 + axis))
    for n in range(t.post_i[m, 0], t.post_i[m, 1]):
        f, p = t.section_f[n], t.section_memory[n]
        before, after, work = 0.0, 0.0, 0.0
        for k in range(4):
            sigma, gone = 0.0, p[C_P_NOW + k] - p[C_P + k]
            for j in range(6):
                sigma += f[C_B + 6 * k + j] * g[P_LOAD + j]
                g[P_WAY + j] += f[C_LENGTH] * f[C_B + 6 * k + j] * gone
            # dissipated at the end's yield, and what hardening holds
            work += (sigma - f[C_HARD] * p[C_P_NOW + k]) * gone
            before += p[C_P + k] * p[C_P + k]
            after += p[C_P_NOW + k] * p[C_P_NOW + k]
        g[P_WORK] += f[C_LENGTH] * (work + 0.5 * f[C_HARD] * (after - before))
        for k in range(4):
            p[C_P + k] = p[C_P_NOW + k]


@leaf
def stiffen_post(t: Any, i: int, m: int, f: float, fd: float, K: Any, room: Any) -> None:
    """K += R' D R with the rates R of the head against the foot, and the post's own tangent and dashpot D."""
    n, g, q = t.post_f[m], t.post_memory[m], t.mount_memory[i]
    R, D, G = room[0:6], room[6:12], room[12:18]
    c, b = t.mount_i[i, 0], t.mount_i[i, 1]
    under, upper, at, local = t.pose[c], t.pose[b], t.mount_f[i, T_B : T_B + 3], room[18, :3]
    high, h, w = n[P_HIGH], 0.0, 0.0
    for k in range(3):
        local[k] = t.mount_f[i, T_A + k] + q[S_DELTA_NOW + k]
        h += n[P_AXES + 3 + k] * q[S_DELTA_NOW + k]
        w += n[P_AXES + 6 + k] * q[S_DELTA_NOW + k]
    for k in range(3):
        e = n[P_AXES + 3 * k : P_AXES + 3 * k + 3]
        x, y, z = to_world(under, e[0], e[1], e[2])
        direction_row(upper, at, x, y, z, R[k, :6])
        direction_row(under, local, -x, -y, -z, R[k, 6:])
        for j in range(12):
            R[3 + k, j] = 0.0
        R[3 + k, 3], R[3 + k, 4], R[3 + k, 5] = to_body(upper, x, y, z)
        for j in range(3):
            R[3 + k, 9 + j] = -e[j]
    for j in range(12):
        R[0, j] += (h * R[1, j] + w * R[2, j]) / high
    for j in range(6):
        for k in range(6):
            D[j, k] = f * g[P_TANGENT + 6 * j + k] + fd * n[P_LAG + j] * n[P_K + 6 * j + k]
    D[1, 1] += f * g[P_LOAD] / high
    D[2, 2] += f * g[P_LOAD] / high
    for j in range(6):
        for k in range(12):
            G[j, k] = 0.0
            for a in range(6):
                G[j, k] += D[j, a] * R[a, k]
    for j in range(12):
        row = 6 * b + j if j < 6 else 6 * c + j - 6
        for k in range(12):
            column = 6 * b + k if k < 6 else 6 * c + k - 6
            total = 0.0
            for a in range(6):
                total += R[a, j] * G[a, k]
            K[row, column] += total
