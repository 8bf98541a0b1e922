"""Compiled: wheels that turn by themselves: driven, braked or free, with the moments that they leave on their carrier.

A turning wheel has one coordinate, its angle against the carrier. With e the axle in the carrier's axes, I its inertia
about it and the carrier's inertia without that, the kinetic energy is I (spin + omega . e)^2/2 on top of the bodies'.
What the axle passes on is then no force of its own: the torque of the drive stands on the wheel's coordinate, and the
carrier feels it through the tread's friction, whose moment the wheel does not take.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ground.compiled import compiled, leaf
from rollover.kernels.tables import (
    D_DAMPING,
    D_RATE,
    D_STIFFNESS,
    D_TORQUE,
    DRIVE,
    E_FORCE,
    OMEGA,
    P_ABSOLUTE,
    P_ABSOLUTE_NOW,
    P_ANGLE,
    P_ANGLE_NOW,
    P_BRAKE,
    P_DRIVEN,
    P_HELD,
    P_HOLD,
    P_HOLD_NOW,
    P_INERTIA,
    P_RATE_NOW,
    P_STRAIN,
    P_TORQUE,
    P_TORQUE_NOW,
    W_AXIS,
    W_CENTRE,
)
from rollover.kernels.vectors import cross, to_body

BRAKE_STIFFNESS = 2e6  # N m/rad: a brake holds like a spring until its limit
BRAKE_RELAXATION = 0.002  # s, dashpot over that spring
# places in what an engine is told: torque, time over which it rises, time at which it ends
FULL_TORQUE, RISE, UNTIL, DRIVE_NUMBERS = 0, 1, 2, 3
DROOP = 0.1  # share of the rate limit over which a governor takes the torque back


@compiled
def throttle(t: Any, drive: Any, now: float) -> None:
    """What the engine may give in the next step; `drive` (DRIVE_NUMBERS,), or empty without an engine."""
    if drive.size == 0:
        return
    if now >= drive[UNTIL]:
        t.drive[D_TORQUE] = 0.0
        return
    rising = now / drive[RISE] if drive[RISE] > 0.0 else 1.0
    t.drive[D_TORQUE] = drive[FULL_TORQUE] * min(max(rising, 0.0), 1.0)


@leaf
def read_spins(t: Any, q: Any, qd: Any) -> None:
    """Angles and rates of turning wheels from the generalised coordinates, where there are any."""
    for w in range(t.spin_i.size):
        at = t.spin_i[w]
        if 0 <= at < q.shape[0]:
            t.spin_memory[w, P_ANGLE_NOW], t.spin_memory[w, P_RATE_NOW] = q[at], qd[at]


@leaf
def try_spins(t: Any, Q: Any) -> None:
    """Torques of drive, locked axle and brakes on the wheels; the wheels' gyroscopic moments on their carriers."""
    driven, angle, rate = 0, 0.0, 0.0
    for w in range(t.spin_i.size):
        if t.spin_i[w] >= 0 and t.spin_f[w, P_DRIVEN] > 0.0:
            driven += 1
            angle += t.spin_memory[w, P_ANGLE_NOW]
            rate += t.spin_memory[w, P_RATE_NOW]
    share = 0.0
    if driven > 0:
        angle, rate = angle / driven, rate / driven
        forward = -rate if t.drive[D_TORQUE] < 0.0 else rate  # along the torque
        governor = min(max((t.drive[D_RATE] - forward) / (DROOP * t.drive[D_RATE]), 0.0), 1.0)
        share = t.drive[D_TORQUE] * governor / driven
    for w in range(t.spin_i.size):
        at = t.spin_i[w]
        if at < 0 or at >= Q.shape[0]:
            continue
        s, f = t.spin_memory[w], t.spin_f[w]
        torque, held = 0.0, 0.0
        if f[P_DRIVEN] > 0.0:
            torque = share - t.drive[D_STIFFNESS] * (s[P_ANGLE_NOW] - angle)
            torque -= t.drive[D_DAMPING] * (s[P_RATE_NOW] - rate)
        b = t.wheel_i[w]
        e, omega = t.wheel_f[w, W_AXIS : W_AXIS + 3], t.pose[b, OMEGA : OMEGA + 3]
        absolute = s[P_RATE_NOW] + e[0] * omega[0] + e[1] * omega[1] + e[2] * omega[2]
        if f[P_HELD] > 0.0 and t.wheel_memory[w, E_FORCE] > 0.0:
            # the ground holds the wheel, whatever its carrier does: a torque on spin + omega . e
            held = -BRAKE_STIFFNESS * (s[P_STRAIN] + BRAKE_RELAXATION * absolute)
            held = min(max(held, -f[P_BRAKE]), f[P_BRAKE])
            for k in range(3):
                Q[6 * b + 3 + k] += held * e[k]
        elif f[P_BRAKE] > 0.0 and f[P_HELD] == 0.0:
            strain = s[P_STRAIN] + s[P_ANGLE_NOW] - s[P_ANGLE] + BRAKE_RELAXATION * s[P_RATE_NOW]
            torque -= min(max(BRAKE_STIFFNESS * strain, -f[P_BRAKE]), f[P_BRAKE])
        s[P_TORQUE_NOW], s[P_HOLD_NOW], s[P_ABSOLUTE_NOW] = torque, held, absolute
        Q[at] += torque + held
        momentum = f[P_INERTIA] * absolute
        x, y, z = cross(omega[0], omega[1], omega[2], momentum * e[0], momentum * e[1], momentum * e[2])
        Q[6 * b + 3] -= x
        Q[6 * b + 4] -= y
        Q[6 * b + 5] -= z


@leaf
def finish_spins(t: Any, h: float) -> None:
    """Work of drive and brakes; the brakes' slip."""
    for w in range(t.spin_i.size):
        if t.spin_i[w] < 0:
            continue
        s, most = t.spin_memory[w], t.spin_f[w, P_BRAKE] / BRAKE_STIFFNESS
        turned = s[P_ANGLE_NOW] - s[P_ANGLE]
        t.work[DRIVE] -= 0.5 * (s[P_TORQUE] + s[P_TORQUE_NOW]) * turned
        if t.spin_f[w, P_HELD] > 0.0:
            turned = 0.5 * h * (s[P_ABSOLUTE] + s[P_ABSOLUTE_NOW])
            t.work[DRIVE] -= 0.5 * (s[P_HOLD] + s[P_HOLD_NOW]) * turned
        s[P_STRAIN] = min(max(s[P_STRAIN] + turned, -most), most)
        s[P_HOLD], s[P_ABSOLUTE] = s[P_HOLD_NOW], s[P_ABSOLUTE_NOW]
        s[P_ANGLE], s[P_TORQUE] = s[P_ANGLE_NOW], s[P_TORQUE_NOW]


@leaf
def keep_spins(t: Any, before: Any, qd: Any) -> None:
    """An impact on a carrier does not turn its wheels: spin + omega . e stays."""
    for w in range(t.spin_i.size):
        at = t.spin_i[w]
        if at < 0:
            continue
        for k in range(3):
            j = 6 * t.wheel_i[w] + 3 + k
            qd[at] -= t.wheel_f[w, W_AXIS + k] * (qd[j] - before[j])


@leaf
def tread_motion(t: Any, w: int, a: Any, x: Any) -> Any:
    """Way and speed, in the carrier's axes, of the tread's point at `a` (3,) through turning since the step began.

    `x` (3,) becomes where that point stands now; returns its speed against the carrier, three numbers.
    """
    f, s = t.wheel_f[w], t.spin_memory[w]
    turned = s[P_ANGLE_NOW] - s[P_ANGLE]
    e0, e1, e2 = f[W_AXIS], f[W_AXIS + 1], f[W_AXIS + 2]
    u, v, z = cross(e0, e1, e2, a[0] - f[0], a[1] - f[1], a[2] - f[2])
    x[0], x[1], x[2] = a[0] + turned * u, a[1] + turned * v, a[2] + turned * z
    rate = s[P_RATE_NOW]
    u, v, z = cross(e0, e1, e2, x[0] - f[0], x[1] - f[1], x[2] - f[2])
    return rate * u, rate * v, rate * z


@leaf
def turn_by_friction(t: Any, w: int, hold: Any, f: Any, Q: Any) -> None:
    """Moment of the tread's friction about a turning wheel's own axle."""
    row, c = t.pose[t.wheel_i[w]], t.wheel_f[w]
    x, y, z = to_body(row, f[0], f[1], f[2])
    x, y, z = cross(hold[0] - c[W_CENTRE], hold[1] - c[W_CENTRE + 1], hold[2] - c[W_CENTRE + 2], x, y, z)
    Q[t.spin_i[w]] += c[W_AXIS] * x + c[W_AXIS + 1] * y + c[W_AXIS + 2] * z


def spin_mass(n: int, spin_i: Any, spin_f: Any, wheel_f: Any, wheel_i: Any) -> Any:
    """What turning wheels add to the mass matrix, (n, n): I g g' with g the row of spin + omega . e."""
    M = np.zeros((n, n))
    for w in range(len(spin_i)):
        if spin_i[w] >= 0:
            g = np.zeros(n)
            g[spin_i[w]] = 1.0
            g[6 * wheel_i[w] + 3 : 6 * wheel_i[w] + 6] = wheel_f[w, W_AXIS : W_AXIS + 3]
            M += spin_f[w, P_INERTIA] * np.outer(g, g)
    return M
