"""Compiled: the end of a step of the ground's elements: contact forces, commit, dashpots; their soil's energy."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ground.compiled import compiled, leaf
from ground.kernel import (
    ADHESION,
    AREA,
    ARRESTED,
    BODY,
    BRANCHED,
    CLINGS,
    EFFECTS,
    FLAGS,
    FORCE,
    FRICTION,
    IDLE,
    LINE_C,
    LINE_K,
    MASS_B,
    MET,
    MODE,
    NORMAL,
    OWNER_R,
    PLACE,
    REBOUND_DAMPING,
    RELEASED,
    ROW,
    SHEAR,
    UNLOADING,
    commit,
    commit_friction,
)
from ground.law import REFERENCE_AREA
from ground.shear import commit_shear
from rollover.kernels.applied_forces import A_NORMAL, A_TANGENT, NOW
from rollover.kernels.contact_state import drop_mass, meet, note_event
from rollover.kernels.dense import dot, times
from rollover.kernels.impact import mobility
from rollover.kernels.tables import (
    ACTIVE,
    BRANCH_CHANGE,
    FLAGS_NOW,
    FN,
    FT,
    MODULUS,
    MOVED,
    OUT_OF_AREA,
    R_NORMAL,
    R_POINT,
    R_TANGENT,
    R_WEIGHT,
    SOIL,
    STICK,
    TURN,
    ZDOT,
    Z,
)
from rollover.kernels.terms import BETWEEN
from rollover.kernels.vectors import add_force, depth_acceleration, depth_row, place, velocity


@leaf
def finish_elements(t: Any, h: float) -> None:
    """Work, contact forces and commit of the elements in contact."""
    flags, footprint, row = 0, 0.0, 0
    for a in range(t.counts[ACTIVE]):
        i = t.active[a]
        m, state, trial = t.memory[i], t.state[i], t.trial[i]
        b, row = state[BODY], state[ROW]
        f, r, n = trial[FN], m[OWNER_R : OWNER_R + 3], m[NORMAL : NORMAL + 3]
        add_force(t.pose[b], b, r, f * n[0], f * n[1], f * n[2], t.applied[A_NORMAL, NOW])
        add_force(t.pose[b], b, r, trial[FT], trial[FT + 1], trial[FT + 2], t.applied[A_TANGENT, NOW])
        # what the ground and the vehicle exert on each other: (1) without the collision, F_s = F + m_b1 a
        contact = trial[FN]
        if m[MASS_B] > 0.0:
            contact += m[MASS_B] * depth_acceleration(t.pose[b], m[OWNER_R : OWNER_R + 3], m[NORMAL : NORMAL + 3])
            e = t.law[row, EFFECTS]
            if t.p[row, e + CLINGS] == 0.0 and contact < -t.p[row, e + ADHESION] * m[AREA] / REFERENCE_AREA:
                # the mass would have to be pulled along: it leaves, and stays in the soil
                drop_mass(t, i)
                contact = trial[FN]
        x = place(t.pose[b], m[OWNER_R], m[OWNER_R + 1], m[OWNER_R + 2])
        result = t.resultant[b]
        for k in range(3):
            result[R_NORMAL + k] += contact * m[NORMAL + k]
            result[R_TANGENT + k] += trial[FT + k]
            result[R_POINT + k] += contact * x[k]
        result[R_WEIGHT] += contact
        if trial[FN] > 0.0:
            flags |= state[FLAGS]
            footprint += m[AREA]
        m[FORCE] = trial[FN]
        for k in range(3):
            m[FRICTION + k] = trial[FT + k]
        along = m[MASS_B]
        outcome = commit(
            t.law[row], t.p[row], t.s[i], m, state, trial[Z], trial[ZDOT], h, t.s[i, 1] * m[AREA] / REFERENCE_AREA
        )
        # half of the work that sets more soil moving is that soil's kinetic energy
        t.work[SOIL] -= 0.5 * (m[MASS_B] - along) * trial[ZDOT] * trial[ZDOT]
        if t.soil[row, MODULUS] > 0.0:
            if trial[FN] > 0.0:  # what slides above a rut shears nothing
                commit_shear(t.soil[row, MODULUS], m, trial[MOVED : MOVED + 3])
        else:
            commit_friction(t.soil[row, STICK], m[SHEAR : SHEAR + 3], trial[MOVED : MOVED + 3], m[NORMAL : NORMAL + 3])
        for k in range(3):
            m[PLACE + k] += trial[MOVED + k]
        if outcome & MET:
            meet(t, i)
        if outcome & BRANCHED:
            note_event(t, BRANCH_CHANGE, b, x, trial[Z])
        if outcome & ARRESTED:
            note_event(t, TURN, b, x, trial[Z])
        if outcome & RELEASED:
            state[MODE] = IDLE
    if footprint > 0.0 and abs(footprint - t.domain[row, 3]) > 0.01 * t.domain[row, 3]:
        flags |= OUT_OF_AREA
    t.counts[FLAGS_NOW] = flags


@compiled
def settle(t: Any) -> None:
    """Give newly arrested elements the dashpot that settles what stands on them critically.

    c = 2 K_u / omega with omega^2 the Rayleigh quotient of the unloading stiffnesses of all elements under the
    body against mass and co-moving masses, for the motion that a push through them gives; for one element this
    is c = 2 sqrt(K_u (m_s + m_b1)). What stands on a nose that gives way moves along with it here.
    """
    nb6 = t.mass.shape[0]
    for body in range(t.pose.shape[0]):
        wanted = False
        for a in range(t.counts[ACTIVE]):
            i = t.active[a]
            if t.state[i, BODY] == body and t.state[i, MODE] == UNLOADING and t.memory[i, LINE_C] == 0.0:
                wanted = True
        if not wanted:
            continue
        J = np.zeros(6)
        g = np.zeros(nb6)
        for a in range(t.counts[ACTIVE]):
            i = t.active[a]
            if t.state[i, BODY] == body:
                m = t.memory[i]
                depth_row(t.pose[body], m[OWNER_R : OWNER_R + 3], m[NORMAL : NORMAL + 3], J)
                for k in range(6):
                    g[6 * body + k] += m[LINE_K] * m[AREA] / REFERENCE_AREA * J[k]
        motion = times(mobility(t), g)
        for i in range(t.term_i.shape[0]):
            kind, nose, behind = t.term_i[i]
            if kind == BETWEEN and nose == body:
                motion[6 * behind : 6 * behind + 6] = motion[6 * body : 6 * body + 6]
        inertia, stiffness = dot(motion, times(t.mass, motion)), 0.0
        for a in range(t.counts[ACTIVE]):
            i = t.active[a]
            if t.state[i, BODY] == body:
                m = t.memory[i]
                depth_row(t.pose[body], m[OWNER_R : OWNER_R + 3], m[NORMAL : NORMAL + 3], J)
                w = 0.0
                for k in range(6):
                    w += J[k] * motion[6 * body + k]
                stiffness += m[LINE_K] * m[AREA] / REFERENCE_AREA * w * w
                inertia += m[MASS_B] * w * w
        if stiffness <= 0.0:
            continue
        omega = math.sqrt(stiffness / inertia)
        for a in range(t.counts[ACTIVE]):
            i = t.active[a]
            if t.state[i, BODY] == body and t.state[i, MODE] == UNLOADING and t.memory[i, LINE_C] == 0.0:
                row = t.state[i, ROW]
                ratio = t.p[row, t.law[row, EFFECTS] + REBOUND_DAMPING]
                t.memory[i, LINE_C] = 2.0 * ratio * t.memory[i, LINE_K] / omega


@leaf
def kinetic_of_soil(t: Any) -> float:
    """Kinetic energy of the co-moving masses, J."""
    total = 0.0
    for a in range(t.counts[ACTIVE]):
        m = t.memory[t.active[a]]
        if m[MASS_B] > 0.0:
            v = velocity(t.pose[t.state[t.active[a], BODY]], m[OWNER_R], m[OWNER_R + 1], m[OWNER_R + 2])
            speed = m[NORMAL] * v[0] + m[NORMAL + 1] * v[1] + m[NORMAL + 2] * v[2]
            total += 0.5 * m[MASS_B] * speed * speed
    return total
