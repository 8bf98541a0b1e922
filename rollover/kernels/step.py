"""Compiled: the end of an accepted step. What the step did is booked and committed, then contacts are renewed.

Work is the mean of the forces at both ends of the step, as the solver saw them, times the way between them.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ground.compiled import compiled, inlined, leaf
from ground.kernel import (
    commit_friction,
)
from rollover.kernels.applied_forces import A_TANGENT, NOW, finish_applied
from rollover.kernels.contact_state import note_event, touch
from rollover.kernels.elements import finish_elements, settle
from rollover.kernels.forces import generalised_forces, read_poses
from rollover.kernels.impact import strike_stop
from rollover.kernels.inputs import finish_inputs
from rollover.kernels.links import finish_links
from rollover.kernels.ploughing import plough
from rollover.kernels.posts import finish_post
from rollover.kernels.stand_devices import finish_devices, keep_poses
from rollover.kernels.steering import steer
from rollover.kernels.tables import (
    A_IMPACT,
    A_SWING,
    ACC,
    ALPHA,
    AXLE,
    AXLE_BLOW,
    AXLE_STOP,
    COLLISION,
    DEVICE,
    E_ANCHOR,
    E_COSINE,
    E_COSINE_NOW,
    E_DAMPING,
    E_DAMPING_NOW,
    E_DEPTH,
    E_DEPTH_NOW,
    E_ENERGY,
    E_ENERGY_NOW,
    E_FORCE,
    E_FORCE_NOW,
    E_FRICTION_NOW,
    E_INWARD,
    E_INWARD_NOW,
    E_NORMAL_NOW,
    E_PLACE,
    E_POINT,
    E_SHEAR,
    E_SLIP,
    E_WHERE,
    HINGE,
    M_ANGLE,
    M_ANGLE_NOW,
    M_FREE,
    M_IMPULSE,
    M_REACH,
    M_TORQUE,
    M_TORQUE_NOW,
    R_NORMAL,
    R_WEIGHT,
    ROPS,
    S_DELTA,
    S_DELTA_NOW,
    S_FLOWED,
    S_FLOWED_NOW,
    S_FORCE,
    S_FORCE_NOW,
    S_SET,
    S_SET_NOW,
    TYRE,
    W_AXIS,
    W_KY,
    W_MU,
    WHEEL_OFF,
    WHEEL_ON,
)
from rollover.kernels.terms import finish_terms
from rollover.kernels.tyres import along_axle, keep_tyres
from rollover.kernels.vectors import add_force, place, to_world
from rollover.kernels.wheel_spin import finish_spins, keep_spins, tread_motion, turn_by_friction


@compiled
def end_of_step(t: Any, q: Any, qd: Any, qdd: Any, h: float, Q: Any, is_tried: bool) -> None:
    """Book, commit, renew the contacts, exchange momentum with what was newly hit (writes qd).

    `is_tried` says that the forces of (q, qd) are those that were tried last.
    """
    if not is_tried:
        t.clock[0] = h
        generalised_forces(t, q, qd, Q)
    for b in range(t.pose.shape[0]):
        for k in range(3):
            t.pose[b, ACC + k] = qdd[6 * b + k]
            t.pose[b, ALPHA + k] = qdd[6 * b + 3 + k]
        for k in range(R_NORMAL, R_WEIGHT + 1):
            t.resultant[b, k] = 0.0
    finish_elements(t, h)
    account_friction(t)
    finish_applied(t, h, qd)
    finish_wheels(t)
    finish_mounts(t)
    finish_axle(t)
    finish_devices(t, h, DEVICE)
    finish_inputs(t, h)
    finish_terms(t, h)
    finish_links(t, h)
    finish_spins(t, h)
    start_step(t)
    before = qd.copy()
    bodies = qd[: t.mass.shape[0]]
    if strike(t, bodies):
        read_poses(t.pose, q, qd)
    t.work[COLLISION] += touch(t, bodies, h)
    keep_spins(t, before, qd)
    t.velocity[:] = qd
    settle(t)
    read_poses(t.pose, q, qd)  # the impact changed the velocities
    plough(t)
    steer(t, qd)
    keep_poses(t)


@leaf
def finish_wheels(t: Any) -> None:
    """Work and commit of the tyres; lift-off and touch-down as events."""
    for w in range(t.wheel_i.size):
        g = t.wheel_memory[w]
        t.work[TYRE] += g[E_ENERGY_NOW] - g[E_ENERGY]
        # way of the pressure's centre, which of a tyre that lies flat is not the lowest point
        inside = 0.5 * (g[E_INWARD] + g[E_INWARD_NOW]) * (g[E_COSINE_NOW] - g[E_COSINE])
        way = g[E_DEPTH_NOW] - g[E_DEPTH] - inside
        t.work[TYRE] += 0.5 * (g[E_DAMPING] + g[E_DAMPING_NOW]) * way
        grip(t, w)
        hold(g)  # the tread's lowest point moves over the crown: friction takes hold of the new one
        if (g[E_FORCE] > 0.0) != (g[E_FORCE_NOW] > 0.0):
            kind = WHEEL_ON if g[E_FORCE_NOW] > 0.0 else WHEEL_OFF
            note_event(t, kind, w, (g[E_WHERE], g[E_WHERE + 1], g[E_WHERE + 2]), g[E_FORCE_NOW])


@compiled
def account_friction(t: Any) -> None:
    """Enter the tyres' friction where it acted: on the point of the tread that it took hold of at the step's start."""
    hold, Q = np.empty(3), t.applied[A_TANGENT, NOW]
    for w in range(t.wheel_i.size):
        g, b = t.wheel_memory[w], t.wheel_i[w]
        f = g[E_FRICTION_NOW], g[E_FRICTION_NOW + 1], g[E_FRICTION_NOW + 2]
        hold[:] = g[E_ANCHOR : E_ANCHOR + 3]
        if t.spin_i[w] >= 0 and t.spin_i[w] < Q.size:
            tread_motion(t, w, g[E_ANCHOR : E_ANCHOR + 3], hold)
            turn_by_friction(t, w, hold, f, Q)
        add_force(t.pose[b], b, hold, f[0], f[1], f[2], Q)


@leaf
def finish_mounts(t: Any) -> None:
    """Work and permanent set of mounts and hinges; the first yielding of each axis as an event."""
    for i in range(t.mount_f.shape[0]):
        g = t.mount_memory[i]
        for axis in range(3):
            for k in (axis, 3 + axis):
                t.work[ROPS] -= 0.5 * (g[S_FORCE + k] + g[S_FORCE_NOW + k]) * (g[S_DELTA_NOW + k] - g[S_DELTA + k])
                if g[S_FLOWED_NOW + k] > 0.0 and g[S_FLOWED + k] == 0.0:
                    note_event(t, HINGE, i, place(t.pose[t.mount_i[i, 1]], 0.0, 0.0, 0.0), float(k))
                g[S_SET + k], g[S_FLOWED + k] = g[S_SET_NOW + k], g[S_FLOWED_NOW + k]
        if t.mount_i[i, 2] >= 0:
            finish_post(t, i, t.mount_i[i, 2])


@leaf
def finish_axle(t: Any) -> None:
    """Work of the axle stops; reaching one is an event."""
    if t.axle_f.size == 0:
        return
    g, swing = t.axle_memory, t.axle_f[A_SWING]
    t.work[AXLE] -= 0.5 * (g[M_TORQUE] + g[M_TORQUE_NOW]) * (g[M_ANGLE_NOW] - g[M_ANGLE])
    if abs(g[M_ANGLE]) <= swing < abs(g[M_ANGLE_NOW]):
        note_event(t, AXLE_STOP, 0, place(t.pose[t.axle_i[1]], 0.0, 0.0, 0.0), g[M_ANGLE_NOW])
    if abs(g[M_ANGLE_NOW]) < swing:
        g[M_FREE], g[M_REACH] = 1.0, swing


@compiled
def strike(t: Any, qd: Any) -> bool:
    """Let an axle that has swung freely into its stop strike it: momentum, energy, event; whether it did."""
    if t.axle_f.size == 0 or t.axle_f[A_IMPACT] == 0.0:
        return False
    g = t.axle_memory
    if g[M_FREE] == 0.0 or abs(g[M_ANGLE_NOW]) < t.axle_f[A_SWING]:
        return False
    g[M_FREE], g[M_REACH] = 0.0, abs(g[M_ANGLE_NOW])
    lost, impulse = strike_stop(t, math.copysign(1.0, g[M_ANGLE_NOW]), qd)
    if impulse == 0.0:
        return False
    t.work[AXLE] += lost
    g[M_IMPULSE] += impulse
    note_event(t, AXLE_BLOW, 0, place(t.pose[t.axle_i[1]], 0.0, 0.0, 0.0), impulse)
    return True


@compiled
def stand(t: Any) -> None:
    """Let the tyres' stick springs begin where the tyres stand now, unstrained."""
    for w in range(t.wheel_i.size):
        g = t.wheel_memory[w]
        for k in range(3):
            g[E_SHEAR + k] = 0.0
        hold(g)


@compiled
def keep_strain(t: Any) -> None:
    """Take what the stick springs have been strained by since `stand` as their strain at the start of a run."""
    e = np.empty(3)
    for w in range(t.wheel_i.size):
        g, c = t.wheel_memory[w], t.wheel_f[w]
        grip(t, w)
        hold(g)
        if t.spin_i[w] >= 0:
            # nothing has turned the wheel yet: it holds along its axle only
            n, shear = g[E_NORMAL_NOW : E_NORMAL_NOW + 3], g[E_SHEAR : E_SHEAR + 3]
            e[0], e[1], e[2] = to_world(t.pose[t.wheel_i[w]], c[W_AXIS], c[W_AXIS + 1], c[W_AXIS + 2])
            lean = n[0] * e[0] + n[1] * e[1] + n[2] * e[2]
            shear[0], shear[1], shear[2] = along_axle(e, n, lean, shear)


@leaf
def grip(t: Any, w: int) -> None:
    """Add what a tyre's anchor has moved to its stick spring, as far as friction holds; off the ground it is free."""
    g = t.wheel_memory[w]
    if g[E_FORCE_NOW] > 0.0:
        stick = max(t.wheel_f[w, W_MU] * g[E_FORCE_NOW] / t.wheel_f[w, W_KY], 1e-9)
        commit_friction(stick, g[E_SHEAR : E_SHEAR + 3], g[E_SLIP : E_SLIP + 3], g[E_NORMAL_NOW : E_NORMAL_NOW + 3])
    else:
        for k in range(3):
            g[E_SHEAR + k] = 0.0


@inlined
def hold(g: Any) -> None:
    """Let the stick spring take hold of the tread's lowest point as it stands now."""
    for k in range(3):
        g[E_ANCHOR + k], g[E_PLACE + k] = g[E_POINT + k], g[E_WHERE + k]


@compiled
def start_step(t: Any) -> None:
    """What was found at the end of a step is what the next one starts from.

    The elements' part is in `finish_elements`: a contact that changes after the step enters the solver, and so the
    ledger, with the force that it has at the end of its first step.
    """
    keep_tyres(t)
    for i in range(t.mount_f.shape[0]):
        g = t.mount_memory[i]
        for k in range(6):
            g[S_DELTA + k], g[S_FORCE + k] = g[S_DELTA_NOW + k], g[S_FORCE_NOW + k]
    if t.axle_f.size > 0:
        t.axle_memory[M_ANGLE], t.axle_memory[M_TORQUE] = t.axle_memory[M_ANGLE_NOW], t.axle_memory[M_TORQUE_NOW]
