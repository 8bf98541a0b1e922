"""Compiled: what joins two bodies of a ROPS, mounts and hinges alike: along and about each axis a yielding spring.

On each of the six axes, with deflection d, permanent set p and plastic way w (the sum of |dp|),

    F = k (d - p -+ g) outside a play of +-g, 0 inside,   |F| <= F_y (1 + (w'/(D l))^(1/q)) + H w,

a dashpot beside it. Tried without writing what lasts: the step's set and plastic way stand beside those of its start
until the step is accepted. The rate factor is that of Cowper and Symonds, with w' implicit over the step.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ground.compiled import compiled, inlined, leaf
from rollover.kernels.posts import ROOM_COLUMNS, ROOM_ROWS, try_post
from rollover.kernels.rate import overstress
from rollover.kernels.tables import (
    OMEGA,
    ROT,
    S_DELTA_NOW,
    S_FLOWED,
    S_FLOWED_NOW,
    S_FORCE_NOW,
    S_SET,
    S_SET_NOW,
    T_A,
    T_B,
    T_C,
    T_FAR,
    T_HARD,
    T_K,
    T_PLAY,
    T_Q,
    T_RATE,
    T_YIELD,
    X,
)
from rollover.kernels.vectors import add_between, cross, place, relative_angle, spin, to_body, velocity


@inlined
def relative_turn(a: Any, b: Any, turn: Any) -> float:
    """Rotation vector of body b against body a in a's axes, below a half turn, into turn (3,).

    Returns beta = (1 - (t/2) cot(t/2))/t^2 of `turned`, t the angle.
    """
    sine, cosine = 0.0, -0.5
    for k in range(3):
        turn[k] = relative_angle(a, b, k)
        sine += turn[k] * turn[k]
        for m in range(3):
            cosine += 0.5 * a[ROT + 3 * m + k] * b[ROT + 3 * m + k]
    sine = math.sqrt(sine)
    angle = math.atan2(sine, cosine)
    if angle < 1e-4:
        return 1.0 / 12.0 + angle * angle / 720.0
    for k in range(3):
        turn[k] *= angle / sine
    return (1.0 - 0.5 * angle / math.tan(0.5 * angle)) / (angle * angle)


@inlined
def turned(turn: Any, beta: float, sign: float, x: Any, y: Any) -> None:
    """y = x + sign/2 turn x x + beta turn x (turn x x).

    With sign -1 the rate of the rotation vector from the relative angular velocity x; with +1, its transpose, the
    torque that does the work of the moments x on that rate.
    """
    a, b, c = cross(turn[0], turn[1], turn[2], x[0], x[1], x[2])
    d, e, f = cross(turn[0], turn[1], turn[2], a, b, c)
    y[0] = x[0] + 0.5 * sign * a + beta * d
    y[1] = x[1] + 0.5 * sign * b + beta * e
    y[2] = x[2] + 0.5 * sign * c + beta * f


@leaf
def try_axis(f: Any, g: Any, j: int, delta: float, rate: float, h: float) -> None:
    """Axis j of a connector at deflection `delta`: force on body b, with the set and plastic way it would leave."""
    k, gap, hardening = f[T_K + j], f[T_PLAY + j], f[T_HARD + j]
    strained = delta - g[S_SET + j]
    spring = k * strained
    if gap > 0.0:
        spring = math.copysign(k * max(abs(strained) - gap, 0.0), strained)
    most = f[T_YIELD + j] + hardening * g[S_FLOWED + j]
    over, flow = abs(spring) - most, 0.0
    g[S_SET_NOW + j] = g[S_SET + j]
    if over > 0.0:
        if f[T_RATE + j] > 0.0:
            x = overstress(k + hardening, f[T_YIELD + j], f[T_RATE + j], f[T_Q], over, h)
            most += f[T_YIELD + j] * x
            over -= f[T_YIELD + j] * x
        flow = over / (k + hardening)
        spring = math.copysign(most + hardening * flow, strained)
        g[S_SET_NOW + j] = delta - math.copysign(gap + abs(spring) / k, strained)
    g[S_FLOWED_NOW + j] = g[S_FLOWED + j] + flow
    force = -spring - f[T_C + j] * rate
    if gap > 0.0 and (spring == 0.0 or force * strained > 0.0):
        force = 0.0  # inside its play nothing touches, and what touches never pulls
    g[S_DELTA_NOW + j], g[S_FORCE_NOW + j] = delta, force


@compiled
def try_mounts(t: Any, Q: Any) -> None:
    """Loads through mounts and hinges: on body b, and their reaction on body a at the same point."""
    room = np.empty((5, 3))
    wide = np.empty((ROOM_ROWS if t.post_f.shape[0] > 0 else 0, ROOM_COLUMNS))
    for i in range(t.mount_f.shape[0]):
        try_mount(t, i, room, wide, Q)


@leaf
def try_mount(t: Any, i: int, room: Any, wide: Any, Q: Any) -> None:
    """Loads through one of them; `room` (5, 3) is written over, of a post `wide` too."""
    local, torque, turn, rates, moved = room[0], room[1], room[2], room[3], room[4]
    h = t.clock[0]
    f, g = t.mount_f[i], t.mount_memory[i]
    a, b = t.mount_i[i, 0], t.mount_i[i, 1]
    under, upper = t.pose[a], t.pose[b]
    x, y, z = spin(upper)
    spun = to_body(under, x, y, z)
    r = f[T_B : T_B + 3]
    x, y, z = place(upper, r[0], r[1], r[2])
    # the point of body b, in a's axes about a's centre of mass
    local[0], local[1], local[2] = to_body(under, x - under[X], y - under[X + 1], z - under[X + 2])
    v, w = velocity(upper, r[0], r[1], r[2]), velocity(under, local[0], local[1], local[2])
    rate = to_body(under, v[0] - w[0], v[1] - w[1], v[2] - w[2])
    beta = 0.0
    for k in range(3):
        turn[k], rates[k] = relative_angle(under, upper, k), spun[k] - under[OMEGA + k]
    if f[T_FAR] > 0.0:
        beta = relative_turn(under, upper, turn)
        turned(turn, beta, -1.0, rates, moved)
        for k in range(3):
            rates[k] = moved[k]
    if t.mount_i[i, 2] < 0:
        for k in range(3):
            try_axis(f, g, k, local[k] - f[T_A + k], rate[k], h)
            try_axis(f, g, 3 + k, turn[k], rates[k], h)
    else:
        for k in range(3):
            torque[k] = local[k] - f[T_A + k]
        try_post(t, i, t.mount_i[i, 2], torque, turn, rate, rates, wide)
    for k in range(3):
        torque[k] = g[S_FORCE_NOW + 3 + k]
    if f[T_FAR] > 0.0:
        turned(turn, beta, 1.0, torque, moved)
        for k in range(3):
            torque[k] = moved[k]
    add_between(under, a, local, upper, b, r, g[S_FORCE_NOW : S_FORCE_NOW + 3], torque, Q)
