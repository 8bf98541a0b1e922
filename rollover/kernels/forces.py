"""Compiled: generalised forces and added mass of one state, tried without writing any memory.

Q = sum over contacts of J' F with J the Jacobian of the point; ground elements, tyres, mounts and axle stop.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ground.compiled import compiled, leaf
from ground.kernel import (
    AREA,
    BODY,
    MASS_B,
    NORMAL,
    OFFSET,
    OWNER_R,
    PLACE,
    PLOUGHED,
    ROW,
    SHEAR,
    SHEARED,
    SPREAD,
    friction_force,
    normal_force,
)
from ground.shear import shear_force
from rollover.kernels.compliant_joints import try_mounts
from rollover.kernels.inputs import read_inputs, try_inputs
from rollover.kernels.links import try_links
from rollover.kernels.stand_devices import try_devices
from rollover.kernels.tables import (
    A_C,
    A_IMPACT,
    A_K,
    A_SWING,
    ACTIVE,
    COHESION,
    FN,
    FT,
    M_ANGLE_NOW,
    M_FREE,
    M_REACH,
    M_TORQUE_NOW,
    MODULUS,
    MOVED,
    MU,
    OMEGA,
    RELAXATION,
    ROT,
    STICK,
    VEL,
    ZDOT,
    X,
    Z,
)
from rollover.kernels.terms import try_terms
from rollover.kernels.tyres import try_wheels
from rollover.kernels.vectors import (
    add_force,
    centripetal_depth,
    depth_row,
    place,
    set_rotation,
    spin,
    to_body,
    to_world,
    velocity,
)
from rollover.kernels.wheel_spin import read_spins, try_spins


@leaf
def read_poses(pose: Any, q: Any, qd: Any) -> None:
    """Positions, rotation matrices and velocities of all bodies from the generalised coordinates."""
    for b in range(pose.shape[0]):
        for k in range(3):
            pose[b, X + k] = q[6 * b + k]
            pose[b, VEL + k] = qd[6 * b + k]
            pose[b, OMEGA + k] = qd[6 * b + 3 + k]
        set_rotation(pose[b], q[6 * b + 3], q[6 * b + 4], q[6 * b + 5])


@leaf
def try_elements(t: Any, Q: Any) -> None:
    """Forces of the elements in contact, with what was found for each in `trial`."""
    for a in range(t.counts[ACTIVE]):
        i = t.active[a]
        m, trial = t.memory[i], t.trial[i]
        b = t.state[i, BODY]
        row, law = t.pose[b], t.state[i, ROW]
        mu, stick, relaxation = t.soil[law, MU], t.soil[law, STICK], t.soil[law, RELAXATION]
        r, n = m[OWNER_R : OWNER_R + 3], m[NORMAL : NORMAL + 3]
        x, y, z = place(row, r[0], r[1], r[2])
        v = velocity(row, r[0], r[1], r[2])
        depth = m[OFFSET] - (n[0] * x + n[1] * y + n[2] * z) + m[SPREAD]
        rate = -(n[0] * v[0] + n[1] * v[1] + n[2] * v[2])
        force = normal_force(t.law[law], t.p[law], t.s[i], m, depth, rate)
        trial[Z], trial[ZDOT], trial[FN] = depth, rate, force
        trial[MOVED], trial[MOVED + 1], trial[MOVED + 2] = x - m[PLACE], y - m[PLACE + 1], z - m[PLACE + 2]
        modulus = t.soil[law, MODULUS]
        if modulus > 0.0:
            strength = t.soil[law, COHESION] * m[AREA] + mu * force + m[PLOUGHED] if force > 0.0 else 0.0
            f = shear_force(strength, modulus, m[SHEARED], m[SHEAR : SHEAR + 3], trial[MOVED : MOVED + 3], n)
        else:
            most = mu * force + m[PLOUGHED] if force > 0.0 else 0.0
            f = friction_force(1.0, stick, relaxation, most, m[SHEAR : SHEAR + 3], trial[MOVED : MOVED + 3], v, n)
        trial[FT], trial[FT + 1], trial[FT + 2] = f
        if m[MASS_B] > 0.0:
            # the co-moving mass is in the mass matrix; what its centripetal acceleration takes stands here
            force += m[MASS_B] * centripetal_depth(row, r, n)
        add_force(row, b, r, force * n[0] + f[0], force * n[1] + f[1], force * n[2] + f[2], Q)


@leaf
def try_axle(t: Any, Q: Any) -> None:
    """Torque of the front axle's stops about the pivot (chassis x)."""
    if t.axle_f.size == 0:
        return
    c, b = t.axle_i[0], t.axle_i[1]
    chassis, axle = t.pose[c], t.pose[b]
    r11, r21 = 0.0, 0.0
    for m in range(3):
        r11 += chassis[ROT + 3 * m + 1] * axle[ROT + 3 * m + 1]
        r21 += chassis[ROT + 3 * m + 2] * axle[ROT + 3 * m + 1]
    angle = math.atan2(r21, r11)
    x, y, z = spin(axle)
    rate = to_body(chassis, x, y, z)[0] - chassis[OMEGA]
    torque = 0.0
    # a stop that has been struck holds from where that was; before, it is the impact that turns the axle round
    swing = max(t.axle_f[A_SWING], t.axle_memory[M_REACH])
    if t.axle_f[A_IMPACT] > 0.0 and t.axle_memory[M_FREE] > 0.0:
        swing = math.inf
    if angle > swing:
        torque = min(-t.axle_f[A_K] * (angle - swing) - t.axle_f[A_C] * rate, 0.0)
    elif angle < -swing:
        torque = max(-t.axle_f[A_K] * (angle + swing) - t.axle_f[A_C] * rate, 0.0)
    t.axle_memory[M_ANGLE_NOW], t.axle_memory[M_TORQUE_NOW] = angle, torque
    Q[6 * c + 3] -= torque
    x, y, z = to_world(chassis, torque, 0.0, 0.0)
    on_axle = to_body(axle, x, y, z)
    for k in range(3):
        Q[6 * b + 3 + k] += on_axle[k]


@compiled
def generalised_forces(t: Any, q: Any, qd: Any, Q: Any) -> None:
    """All of the above at the state (q, qd), into Q (n,); wheels do not turn where q is that of the bodies alone."""
    for k in range(Q.shape[0]):
        Q[k] = 0.0
    read_poses(t.pose, q, qd)
    read_spins(t, q, qd)
    read_inputs(t)
    try_elements(t, Q)
    try_wheels(t, Q)
    try_spins(t, Q)
    try_mounts(t, Q)
    try_axle(t, Q)
    try_devices(t, Q)
    try_terms(t, Q)
    try_links(t, Q)
    try_inputs(t, Q)


@compiled
def added_mass(t: Any, q: Any, M: Any) -> None:
    """Sum of m_b1 J J' over the elements in contact and what turning wheels add, into M (n, n)."""
    M[:, :] = t.spin_mass
    J = np.empty(6)
    for b in range(t.pose.shape[0]):
        set_rotation(t.pose[b], q[6 * b + 3], q[6 * b + 4], q[6 * b + 5])
    for a in range(t.counts[ACTIVE]):
        i = t.active[a]
        m = t.memory[i]
        if m[MASS_B] > 0.0:
            b = t.state[i, BODY]
            depth_row(t.pose[b], m[OWNER_R : OWNER_R + 3], m[NORMAL : NORMAL + 3], J)
            for j in range(6):
                for k in range(6):
                    M[6 * b + j, 6 * b + k] += m[MASS_B] * J[j] * J[k]
