"""Compiled: what a test stand does to the bodies: beam, given force, rope, block face, a tilted table's gravity.

One row of `device_i` and `device_f` for each. Their generalised forces are kept apart from all others, so that the
ledger can book the work that they do: mean force over the step times the way.
"""

from __future__ import annotations

import math
from typing import Any

from ground.compiled import leaf
from rollover.kernels.tables import OMEGA, X
from rollover.kernels.vectors import add_force, place, to_body, to_world, velocity

# columns of device_i: kind, body, the body that carries a face, first and end of the contact points that it can meet;
# 1 + the row of the input that gives a table's angle, or 0
D_KIND, D_BODY, D_CARRIER, D_FIRST, D_END, D_INPUT, DEVICE_INTEGERS = 0, 1, 2, 3, 4, 5, 6
OFF, BEAM, FORCE, ROPE, FACE, TILT = 0, 1, 2, 3, 4, 5

# columns of device_f: point about the body's centre of mass; direction or anchor (world), or normal of a face (axes of
# its carrier); then by kind, at time T0: START + RATE (t - T0) + SWING sin(TURN (t - T0)), never beyond MOST
D_POINT, D_WAY, D_T0, D_START, D_RATE, D_SWING, D_TURN, D_MOST, D_K, D_C, D_SIZE, D_SENSE = (
    0,
    3,
    6,
    7,
    8,
    9,
    10,
    11,
    12,
    13,
    14,
    15,
)
DEVICE_COLUMNS = 16
# columns of device_memory: force, place of the point along the way, work done on it; force and place as tried last
K_FORCE, K_ALONG, K_WORK, K_FORCE_NOW, K_ALONG_NOW, DEVICE_MEMORY = 0, 1, 2, 3, 4, 5

# rows of device_q: by where their work is booked, as tried last and at the start of the step
BY_DEVICE, BY_LASHING, ACCOUNTS = 0, 1, 2


@leaf
def level(f: Any, clock: float) -> float:
    """What a row prescribes at an instant: place of a beam (m), force (N) or angle of a table (rad)."""
    t = clock - f[D_T0]
    return min(f[D_START] + f[D_RATE] * t, f[D_MOST]) + f[D_SWING] * math.sin(f[D_TURN] * t)  # type: ignore[no-any-return]


@leaf
def try_devices(t: Any, Q: Any) -> None:
    """Forces of all devices at the state in `pose` and the instant in `clock`, added to Q (6 nb,)."""
    if t.device_i.shape[0] == 0:
        return
    for a in range(ACCOUNTS):
        for k in range(Q.size):
            t.device_q[a, k] = 0.0
    for i in range(t.device_i.shape[0]):
        kind = t.device_i[i, D_KIND]
        account = BY_LASHING if kind == ROPE else BY_DEVICE
        if kind == TILT:
            try_tilt(t, i, t.device_q[account])
        elif kind == FACE:
            try_face(t, i, t.device_q[account])
        elif kind != OFF:
            try_point(t, i, kind, t.device_q[account])
    for a in range(ACCOUNTS):
        for k in range(Q.size):
            Q[k] += t.device_q[a, k]


@leaf
def try_point(t: Any, i: int, kind: int, Q: Any) -> None:
    """A beam on its guide, a given force, or a rope, on one point of a body."""
    f, m, b = t.device_f[i], t.device_memory[i], t.device_i[i, D_BODY]
    row, r = t.pose[b], f[D_POINT : D_POINT + 3]
    x, y, z = place(row, r[0], r[1], r[2])
    u, v, w = velocity(row, r[0], r[1], r[2])
    ex, ey, ez = f[D_WAY], f[D_WAY + 1], f[D_WAY + 2]
    if kind == ROPE:
        ex, ey, ez = x - ex, y - ey, z - ez
        length = math.sqrt(ex * ex + ey * ey + ez * ez)
        ex, ey, ez = ex / length, ey / length, ez / length
        # a rope pulls once it is longer than at rest, a strut pushes once it is shorter; neither does the other
        rate = f[D_SENSE] * (ex * u + ey * v + ez * w)
        more = f[D_SENSE] * (length - f[D_START])
        force = -f[D_SENSE] * max(f[D_K] * more + f[D_C] * rate, 0.0) if more > 0.0 else 0.0
        m[K_ALONG_NOW] = length
    else:
        along = ex * x + ey * y + ez * z
        m[K_ALONG_NOW] = along
        force = level(f, t.clock[1])
        if kind == BEAM:
            depth = force - along
            rate = f[D_RATE] - (ex * u + ey * v + ez * w)
            force = max(f[D_K] * depth + f[D_C] * rate, 0.0) if depth > 0.0 else 0.0
    m[K_FORCE_NOW] = force
    add_force(row, b, r, force * ex, force * ey, force * ez, Q)


@leaf
def try_face(t: Any, i: int, Q: Any) -> None:
    """A square face on one body presses on the contact points of another that have passed it: k a (depth + c rate)."""
    f, b, o = t.device_f[i], t.device_i[i, D_BODY], t.device_i[i, D_CARRIER]
    row, other = t.pose[b], t.pose[o]
    cx, cy, cz = f[D_POINT], f[D_POINT + 1], f[D_POINT + 2]
    nx, ny, nz = f[D_WAY], f[D_WAY + 1], f[D_WAY + 2]
    wx, wy, wz = to_world(other, nx, ny, nz)
    half, total = 0.5 * f[D_SIZE], 0.0
    for p in range(t.device_i[i, D_FIRST], t.device_i[i, D_END]):
        r = t.point_r[p]
        x, y, z = place(row, r[0], r[1], r[2])
        x, y, z = to_body(other, x - other[X], y - other[X + 1], z - other[X + 2])
        depth = -(nx * (x - cx) + ny * (y - cy) + nz * (z - cz))
        if depth <= 0.0 or depth > half:
            continue
        # within the square: what is left of the way from its middle, along each axis of the carrier
        sx, sy, sz = x - cx + depth * nx, y - cy + depth * ny, z - cz + depth * nz
        if abs(sx) > half or abs(sy) > half or abs(sz) > half:
            continue
        u, v, w = velocity(row, r[0], r[1], r[2])
        ou, ov, ow = velocity(other, x, y, z)
        rate = -(wx * (u - ou) + wy * (v - ov) + wz * (w - ow))
        force = max(f[D_K] * t.point_a[p] * (depth + f[D_C] * rate), 0.0)
        total += force
        add_force(row, b, r, force * wx, force * wy, force * wz, Q)
        fx, fy, fz = -force * nx, -force * ny, -force * nz
        at = 6 * o
        Q[at] -= force * wx
        Q[at + 1] -= force * wy
        Q[at + 2] -= force * wz
        Q[at + 3] += y * fz - z * fy
        Q[at + 4] += z * fx - x * fz
        Q[at + 5] += x * fy - y * fx
    t.device_memory[i, K_FORCE_NOW] = total


@leaf
def try_tilt(t: Any, i: int, Q: Any) -> None:
    """Gravity of a table that is tilted by an angle a: m g (sin a downhill + (1 - cos a) up) besides the weight."""
    f = t.device_f[i]
    angle = level(f, t.clock[1])
    if t.device_i[i, D_INPUT] > 0:
        angle = t.input_memory[t.device_i[i, D_INPUT] - 1, 0]
    along, up = f[D_K] * math.sin(angle), f[D_K] * (1.0 - math.cos(angle))
    t.device_memory[i, K_ALONG_NOW] = angle
    for b in range(t.pose.shape[0]):
        mass = t.mass[6 * b, 6 * b]
        for k in range(3):
            Q[6 * b + k] += mass * along * f[D_WAY + k]
        Q[6 * b + 2] += mass * up


@leaf
def book_work(t: Any, now: Any, before: Any, h: float, account: int) -> None:
    """Work of generalised forces (6 nb,) on the bodies over a step, into a place of `work`; `before` becomes `now`."""
    for b in range(t.pose.shape[0]):
        for k in range(3):
            j = 6 * b + k
            t.work[account] -= 0.5 * (now[j] + before[j]) * (t.pose[b, X + k] - t.device_x[b, k])
            turned = 0.5 * h * (t.pose[b, OMEGA + k] + t.device_x[b, 3 + k])
            t.work[account] -= 0.5 * (now[j + 3] + before[j + 3]) * turned
    for k in range(now.shape[0]):
        before[k] = now[k]


@leaf
def finish_devices(t: Any, h: float, first: int) -> None:
    """Work of the devices on the bodies over a step; `first` is the place of their accounts in `work`."""
    if t.device_i.shape[0] == 0:
        return
    for a in range(ACCOUNTS):
        book_work(t, t.device_q[a], t.device_q[ACCOUNTS + a], h, first + a)
    for i in range(t.device_i.shape[0]):
        m = t.device_memory[i]
        m[K_WORK] += 0.5 * (m[K_FORCE] + m[K_FORCE_NOW]) * (m[K_ALONG_NOW] - m[K_ALONG])
        m[K_FORCE], m[K_ALONG] = m[K_FORCE_NOW], m[K_ALONG_NOW]


@leaf
def keep_poses(t: Any) -> None:
    """Remember where the next step starts, after all that changes velocities."""
    if t.device_i.shape[0] == 0 and t.input_i.shape[0] == 0:
        return
    for b in range(t.pose.shape[0]):
        for k in range(3):
            t.device_x[b, k], t.device_x[b, 3 + k] = t.pose[b, X + k], t.pose[b, OMEGA + k]
