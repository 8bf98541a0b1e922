"""Compiled: what is prescribed over time: forces on bodies, motion of the ground, engine and brakes.

A row of `input_i` says kind, body and which pieces of `pieces` are its signal; the same row of `input_f` its numbers.
A piece is a cubic from an instant on, so that straight lines and splines are read alike.

A shaken ground and a turning table are told in their own axes: what they add are forces -m a on the bodies, and the
contacts, whose speeds are against the ground as it moves, stay what they are. How the wheels are steered stands in
`rollover.kernels.steering`.
"""

from __future__ import annotations

from typing import Any

from ground.compiled import leaf
from rollover.kernels.stand_devices import book_work
from rollover.kernels.tables import (
    D_TORQUE,
    INPUT,
    OMEGA,
    P_BRAKE,
    P_BRAKED,
    P_INERTIA,
    P_RATE_NOW,
    P_STEERED,
    VEL,
    W_AXIS,
    X,
)
from rollover.kernels.vectors import add_force, cross, to_body, to_world

# columns of input_i: kind, body (-1: none, or all), first and end of its pieces
I_KIND, I_BODY, I_FIRST, I_END, INPUT_INTEGERS = 0, 1, 2, 3, 4
FORCE_WORLD, FORCE_BODY, SHAKEN_BY_PLACE, SHAKEN_BY_ACCELERATION, TABLE, STEERING, DRIVE_TORQUE, BRAKE_TORQUE = range(8)
# columns of input_f: point about the body's centre of mass, or on the table's axis; direction, of length 1
F_POINT, F_WAY, INPUT_COLUMNS = 0, 3, 6
# columns of input_memory: value, rate and acceleration now; angle to which the wheels are turned
V_NOW, V_RATE, V_ACCELERATION, V_TURNED, INPUT_MEMORY = 0, 1, 2, 3, 4
# columns of pieces: instant from which a cubic holds, its coefficients from the constant on
PIECE_COLUMNS = 5


@leaf
def read_inputs(t: Any) -> None:
    """Value, rate and acceleration of every signal at the instant in `clock`; what engine and brakes may give."""
    now = t.clock[1]
    for i in range(t.input_i.shape[0]):
        low, high = t.input_i[i, I_FIRST], t.input_i[i, I_END]
        m = t.input_memory[i]
        if now < t.pieces[low, 0]:
            m[V_NOW], m[V_RATE], m[V_ACCELERATION] = t.pieces[low, 1], 0.0, 0.0
        else:
            while high - low > 1:
                middle = (low + high) // 2
                if t.pieces[middle, 0] <= now:
                    low = middle
                else:
                    high = middle
            p = t.pieces[low]
            x = now - p[0]
            m[V_NOW] = p[1] + x * (p[2] + x * (p[3] + x * p[4]))
            m[V_RATE] = p[2] + x * (2.0 * p[3] + x * 3.0 * p[4])
            m[V_ACCELERATION] = 2.0 * p[3] + x * 6.0 * p[4]
        if t.input_i[i, I_KIND] == DRIVE_TORQUE:
            t.drive[D_TORQUE] = m[V_NOW]
        elif t.input_i[i, I_KIND] == BRAKE_TORQUE:
            for w in range(t.spin_i.size):
                t.spin_f[w, P_BRAKE] = m[V_NOW] * t.spin_f[w, P_BRAKED]


@leaf
def try_inputs(t: Any, Q: Any) -> None:
    """Forces of all inputs at the state in `pose`, added to Q (n,); `read_inputs` has read the signals."""
    if t.input_i.shape[0] == 0:
        return
    found = t.input_q[0]
    for k in range(found.shape[0]):
        found[k] = 0.0
    for i in range(t.input_i.shape[0]):
        kind, b, f, m = t.input_i[i, I_KIND], t.input_i[i, I_BODY], t.input_f[i], t.input_memory[i]
        if kind in (FORCE_WORLD, FORCE_BODY):
            x, y, z = f[F_WAY], f[F_WAY + 1], f[F_WAY + 2]
            if kind == FORCE_BODY:
                x, y, z = to_world(t.pose[b], x, y, z)
            add_force(t.pose[b], b, f[F_POINT : F_POINT + 3], m[V_NOW] * x, m[V_NOW] * y, m[V_NOW] * z, found)
        elif kind in (SHAKEN_BY_PLACE, SHAKEN_BY_ACCELERATION):
            a = m[V_NOW] if kind == SHAKEN_BY_ACCELERATION else m[V_ACCELERATION]
            for j in range(t.pose.shape[0]):
                for k in range(3):
                    found[6 * j + k] -= t.mass[6 * j, 6 * j] * a * f[F_WAY + k]
        elif kind == TABLE:
            try_turning(t, f, -m[V_RATE], -m[V_ACCELERATION], found)
        elif kind == STEERING:
            try_steered(t, m[V_RATE], found)
    for k in range(found.shape[0]):
        Q[k] += found[k]


@leaf
def try_turning(t: Any, f: Any, rate: float, acceleration: float, Q: Any) -> None:
    """What axes add that turn about their x through the point (y, z) of `f`: forces, and moments of the inertia.

    F = -m (alpha x r + w x (w x r) + 2 w x v). With w and alpha in body axes and o the body's own angular velocity,
    J (o' + alpha - o x w) + (o + w) x J (o + w) is the moment: all but J o' + o x J o stands here.
    """
    for b in range(t.pose.shape[0]):
        row, mass = t.pose[b], t.mass[6 * b, 6 * b]
        y, z = row[X + 1] - f[F_POINT + 1], row[X + 2] - f[F_POINT + 2]
        Q[6 * b + 1] += mass * (acceleration * z + rate * rate * y + 2.0 * rate * row[VEL + 2])
        Q[6 * b + 2] -= mass * (acceleration * y - rate * rate * z + 2.0 * rate * row[VEL + 1])
        wx, wy, wz = to_body(row, rate, 0.0, 0.0)
        ax, ay, az = to_body(row, acceleration, 0.0, 0.0)
        ox, oy, oz = row[OMEGA], row[OMEGA + 1], row[OMEGA + 2]
        cx, cy, cz = cross(ox, oy, oz, wx, wy, wz)
        ax, ay, az = ax - cx, ay - cy, az - cz
        J = t.mass[6 * b + 3 : 6 * b + 6, 6 * b + 3 : 6 * b + 6]
        gx = J[0, 0] * wx + J[0, 1] * wy + J[0, 2] * wz
        gy = J[1, 0] * wx + J[1, 1] * wy + J[1, 2] * wz
        gz = J[2, 0] * wx + J[2, 1] * wy + J[2, 2] * wz
        hx = J[0, 0] * ox + J[0, 1] * oy + J[0, 2] * oz
        hy = J[1, 0] * ox + J[1, 1] * oy + J[1, 2] * oz
        hz = J[2, 0] * ox + J[2, 1] * oy + J[2, 2] * oz
        ux, uy, uz = cross(ox + wx, oy + wy, oz + wz, gx, gy, gz)
        vx, vy, vz = cross(wx, wy, wz, hx, hy, hz)
        Q[6 * b + 3] -= J[0, 0] * ax + J[0, 1] * ay + J[0, 2] * az + ux + vx
        Q[6 * b + 4] -= J[1, 0] * ax + J[1, 1] * ay + J[1, 2] * az + uy + vy
        Q[6 * b + 5] -= J[2, 0] * ax + J[2, 1] * ay + J[2, 2] * az + uz + vz


@leaf
def try_steered(t: Any, rate: float, Q: Any) -> None:
    """Moment of turning wheels that are steered on their carrier: -I spin de/dt, with de/dt = rate z x e."""
    for w in range(t.spin_i.size):
        if t.spin_f[w, P_STEERED] > 0.0:
            at, turned = 6 * t.wheel_i[w] + 3, rate * t.spin_f[w, P_INERTIA] * t.spin_memory[w, P_RATE_NOW]
            Q[at] += turned * t.wheel_f[w, W_AXIS + 1]
            Q[at + 1] -= turned * t.wheel_f[w, W_AXIS]


@leaf
def finish_inputs(t: Any, h: float) -> None:
    """Work of the inputs' forces on the bodies over a step."""
    if t.input_i.shape[0] > 0:
        book_work(t, t.input_q[0], t.input_q[1], h, INPUT)
