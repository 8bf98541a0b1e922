"""Compiled: the front wheels as they are steered: between two steps their axles turn, and the work of that is booked.

With e the axle in its carrier's axes, I the wheel's inertia about it and s its own rate, the wheel's share of the
kinetic energy is I s^2/2 + I s omega . e; the rest of it is the carrier's, whose inertia does not change. Turning e by
de keeps the momentum I (s + omega . e) about the axle: s falls by omega . de. What that leaves on the carrier is a
moment, see `rollover.kernels.inputs`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ground.compiled import compiled
from rollover.kernels.inputs import I_KIND, STEERING, V_NOW, V_TURNED
from rollover.kernels.tables import E_ENERGY, E_ENERGY_NOW, INPUT, OMEGA, P_INERTIA, P_RATE_NOW, P_STEERED, TYRE, W_AXIS
from rollover.kernels.tyres import keep_tyres, try_wheels


@compiled
def steer(t: Any, qd: Any) -> None:
    """Turn the steered wheels to where the signal is; writes their rates into `qd` (n,)."""
    for i in range(t.input_i.shape[0]):
        m = t.input_memory[i]
        if t.input_i[i, I_KIND] != STEERING or m[V_NOW] == m[V_TURNED]:
            continue
        m[V_TURNED] = m[V_NOW]
        for w in range(t.spin_i.size):
            if t.spin_f[w, P_STEERED] > 0.0:
                turn_axle(t, w, m[V_NOW], qd)
        # how deep and how upright a tyre stands has changed with its axle
        try_wheels(t, np.zeros(qd.shape[0]))
        for w in range(t.wheel_i.size):
            stored = t.wheel_memory[w, E_ENERGY_NOW] - t.wheel_memory[w, E_ENERGY]
            t.work[TYRE] += stored
            t.work[INPUT] -= stored
        keep_tyres(t)


@compiled
def turn_axle(t: Any, w: int, angle: float, qd: Any) -> None:
    """Turn one axle to an angle about its carrier's z, with its momentum kept and its energy booked."""
    at, e, inertia = t.spin_i[w], t.wheel_f[w, W_AXIS : W_AXIS + 3], t.spin_f[w, P_INERTIA]
    first, before, after = 6 * t.wheel_i[w] + 3, 0.0, 0.0
    for k in range(3):
        before += t.pose[t.wheel_i[w], OMEGA + k] * e[k]
    e[0], e[1], e[2] = -math.sin(angle), math.cos(angle), 0.0
    for k in range(3):
        after += t.pose[t.wheel_i[w], OMEGA + k] * e[k]
        t.spin_mass[at, first + k] = t.spin_mass[first + k, at] = inertia * e[k]
    old, new = qd[at], qd[at] - (after - before)
    t.work[INPUT] -= inertia * (new * (0.5 * new + after) - old * (0.5 * old + before))
    qd[at] = t.velocity[at] = t.spin_memory[w, P_RATE_NOW] = new
