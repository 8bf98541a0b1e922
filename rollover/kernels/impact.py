"""Compiled: which elements are touched, and the momentum that they take at restitution 0.

A new element's mass is at rest; all that are hit within a step are hit at once. With P the co-moving masses
already moving along and N the new ones, both as sums of m_b1 J J', the plastic impact is

    (M + P + N) v+ + G' l = (M + P) v-,   G v+ = G v-,

G the joints: momentum is exact, joints and far bodies take their part, and what is lost is booked.
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
    OWNER_R,
    TOUCH_SPEED,
)
from rollover.kernels.dense import add_outer, dot, solve_in_place, times
from rollover.kernels.tables import A_RESTITUTION, ACTIVE, FRACTION, GUIDE, R_IMPULSE, ROT
from rollover.kernels.vectors import depth_row, direction_row, to_body, to_world


@compiled
def constraints(t: Any) -> Any:
    """G (5 nj, 6 nb) with G v = 0 for the joints: front axle pivot and the rig's guide."""
    nj, nb = t.joint_i.shape[0], t.pose.shape[0]
    G = np.zeros((5 * nj, 6 * nb))
    e = np.zeros(3)
    for j in range(nj):
        a, b = t.joint_i[j, 1], t.joint_i[j, 2]
        if t.joint_i[j, 0] == GUIDE:
            for k in range(2):
                G[5 * j + k, 6 * a + k] = 1.0
            for k in range(3):
                G[5 * j + 2 + k, 6 * a + 3 + k] = 1.0
            continue
        p = t.joint_f[j]
        for k in range(3):
            e[0], e[1], e[2] = 0.0, 0.0, 0.0
            e[k] = 1.0
            direction_row(t.pose[a], p[:3], e[0], e[1], e[2], G[5 * j + k, 6 * a : 6 * a + 6])
            direction_row(t.pose[b], p[3:], -e[0], -e[1], -e[2], G[5 * j + k, 6 * b : 6 * b + 6])
        for k in range(1, 3):
            e[0], e[1], e[2] = 0.0, 0.0, 0.0
            e[k] = 1.0  # the pivot turns about x of body a: not about its y and z
            x, y, z = to_world(t.pose[a], e[0], e[1], e[2])
            local = to_body(t.pose[b], x, y, z)
            for m in range(3):
                G[5 * j + 2 + k, 6 * a + 3 + m] = e[m]
                G[5 * j + 2 + k, 6 * b + 3 + m] = -local[m]
    return G


@compiled
def joined(M: Any, G: Any, columns: int) -> Any:
    """The matrix [[M, G'], [G, 0]] and room for right-hand sides."""
    n, c = M.shape[0], G.shape[0]
    K = np.zeros((n + c, n + c))
    for i in range(n):
        for k in range(n):
            K[i, k] = M[i, k]
        for k in range(c):
            K[i, n + k] = G[k, i]
            K[n + k, i] = G[k, i]
    return K, np.zeros((n + c, columns))


@compiled
def mobility(t: Any) -> Any:
    """A (6 nb, 6 nb), the velocities that unit impulses give: M^-1 - M^-1 G' (G M^-1 G')^-1 G M^-1."""
    G = constraints(t)
    n, c = t.mass.shape[0], G.shape[0]
    A = t.inverse.copy()
    if c == 0:
        return A
    X, S, L = np.zeros((c, n)), np.zeros((c, c)), np.zeros((c, n))
    for r in range(c):
        for k in range(n):
            if G[r, k] != 0.0:
                at = 6 * (k // 6)
                for j in range(at, at + 6):
                    X[r, j] += G[r, k] * t.inverse[k, j]
    for r in range(c):
        for k in range(n):
            L[r, k] = X[r, k]
        for q in range(c):
            for k in range(n):
                S[r, q] += X[r, k] * G[q, k]
    solve_in_place(S, L)
    for r in range(c):
        for j in range(n):
            if X[r, j] != 0.0:
                for k in range(n):
                    A[j, k] -= X[r, j] * L[r, k]
    return A


@compiled
def largest_eigenvalue(A: Any, P: Any) -> float:
    """Largest eigenvalue of A P (both positive semidefinite) by power iteration."""
    x = np.ones(A.shape[0])
    for k in range(x.shape[0]):
        x[k] += 0.01 * k  # no symmetry of the vehicle may hide the direction
    value, last, n = 0.0, 0.0, x.shape[0]
    y = np.zeros(n)
    for _ in range(60):
        for i in range(n):
            at = 6 * (i // 6)
            total = 0.0
            for k in range(at, at + 6):
                total += P[i, k] * x[k]
            y[i] = total
        value = 0.0
        for i in range(n):
            total = 0.0
            for k in range(n):
                total += A[i, k] * y[k]
            x[i] = total
            value += total * total
        value = math.sqrt(value)
        if value == 0.0:
            return 0.0
        for k in range(n):
            x[k] /= value
        if abs(value - last) <= 1e-9 * value:
            break
        last = value
    return value


@compiled
def share_mass(t: Any, new: Any, total: int, share: Any) -> None:
    """Co-moving masses and shares of the effective mass for the new contacts; writes MASS_B and `share`.

    Contact i has effective mass 1/W_ii, W = J A J'. Its share is a_i / sum_j a_j |c_ij|, with the areas a and the
    correlations c_ij = W_ij / sqrt(W_ii W_jj) of all contacts: like contacts divide the mass by area, unrelated ones
    do not. By Gershgorin's theorem (scaled by a) the masses of one set never exceed the fraction of M in any
    direction; a set of its own is scaled so that it reaches that fraction, one that joins masses which move along
    already gets what they leave.
    """
    n = t.mass.shape[0]
    A = mobility(t)
    everyone = t.counts[ACTIVE]
    J, AJ, W = np.zeros((everyone, 6)), np.zeros((everyone, n)), np.zeros(everyone)
    P, N = np.zeros((n, n)), np.zeros((n, n))
    for a in range(everyone):
        i = t.active[a]
        at = 6 * t.state[i, BODY]
        contact_row(t, i, J[a])
        for m in range(n):
            for k in range(6):
                AJ[a, m] += A[m, at + k] * J[a, k]
        W[a] = max(dot(J[a], AJ[a, at : at + 6]), 1e-30)
        add_outer(P, t.memory[i, MASS_B], J[a], at)
    fraction = t.soil[0, FRACTION]
    for k in range(total):
        a = new[k]
        i = t.active[a]
        crowd = 0.0
        for other in range(everyone):
            at = 6 * t.state[t.active[other], BODY]
            w = dot(J[other], AJ[a, at : at + 6])
            crowd += t.memory[t.active[other], AREA] * abs(w) / math.sqrt(W[a] * W[other])
        part = t.memory[i, AREA] / max(crowd, 1e-30)
        taken = dot(AJ[a], times(P, AJ[a])) / W[a]
        share[k] = part / W[a]
        if t.memory[i, TOUCH_SPEED] > 0.0:
            t.memory[i, MASS_B] = max(min(fraction * part, fraction - taken), 0.0) / W[a]
        add_outer(N, t.memory[i, MASS_B], J[a], 6 * t.state[i, BODY])
    if fraction > 0.0:
        alone = True  # nothing moves along yet
        for i in range(n):
            for m in range(n):
                alone = alone and P[i, m] == 0.0
                N[i, m] += P[i, m]
        after = largest_eigenvalue(A, N)
        factor = 1.0
        if alone and after > 0.0:
            factor = fraction / after  # a set of its own takes its whole fraction in the direction that feels it most
        elif after > fraction * (1.0 + 1e-9):
            before = largest_eigenvalue(A, P)
            if after > before:
                # the largest eigenvalue is convex in the factor: the chord never overshoots
                factor = max(min((fraction - before) / (after - before), 1.0), 0.0)
        for k in range(total):
            t.memory[t.active[new[k]], MASS_B] *= factor


@leaf
def contact_row(t: Any, slot: int, J: Any) -> None:
    """Row of an element's contact: dz/dt = J [v, omega] of its body."""
    m = t.memory[slot]
    depth_row(t.pose[t.state[slot, BODY]], m[OWNER_R : OWNER_R + 3], m[NORMAL : NORMAL + 3], J)


@compiled
def exchange(t: Any, new: Any, total: int, qd: Any) -> float:
    """Plastic impact of the new elements' masses; writes the velocities, returns the kinetic energy lost, J."""
    n = t.mass.shape[0]
    P, full, after, J = t.mass.copy(), t.mass.copy(), qd.copy(), np.zeros(6)
    for a in range(t.counts[ACTIVE]):
        i = t.active[a]
        fresh = False
        for k in range(total):
            fresh = fresh or new[k] == a
        if t.memory[i, MASS_B] > 0.0 and not fresh:
            contact_row(t, i, J)
            add_outer(P, t.memory[i, MASS_B], J, 6 * t.state[i, BODY])
    G = constraints(t)
    before, kept = times(P, qd), times(G, qd)
    pulled = True
    while pulled:
        for j in range(n):
            for k in range(n):
                full[j, k] = P[j, k]
        for k in range(total):
            i = t.active[new[k]]
            contact_row(t, i, J)
            add_outer(full, t.memory[i, MASS_B], J, 6 * t.state[i, BODY])
        K, B = joined(full, G, 1)
        for k in range(n):
            B[k, 0] = before[k]
        for k in range(G.shape[0]):
            B[n + k, 0] = kept[k]  # what the solver left of the joints' drift is not ours to change
        solve_in_place(K, B)
        for k in range(n):
            after[k] = B[k, 0]
        pulled = False
        for k in range(total):
            i = t.active[new[k]]
            at = 6 * t.state[i, BODY]
            contact_row(t, i, J)
            # a point that the others turn upwards does not take its element along
            if t.memory[i, MASS_B] > 0.0 and dot(J, after[at : at + 6]) < 0.0:
                t.memory[i, MASS_B] = 0.0
                pulled = True
    for k in range(total):
        i = t.active[new[k]]
        b = t.state[i, BODY]
        contact_row(t, i, J)
        impulse = t.memory[i, MASS_B] * dot(J, after[6 * b : 6 * b + 6])
        for m in range(3):
            t.resultant[b, R_IMPULSE + m] += impulse * t.memory[i, NORMAL + m]
    lost = 0.5 * dot(qd, before) - 0.5 * dot(after, times(full, after))
    for k in range(n):
        qd[k] = after[k]
    return lost


SLOW_STOP = 0.05  # rad/s: an axle that meets its stop more slowly stays there; below this a bounce lasts a few steps


@compiled
def strike_stop(t: Any, side: float, qd: Any) -> Any:
    """Impact of the front axle on a stop: writes the velocities, returns the kinetic energy lost, J, and the impulse.

    With s v the rate of the axle against the chassis about the pivot, towards the stop, and e the restitution,

        (M + P) (v+ - v-) + G' l + s' p = 0,   G v+ = G v-,   s v+ = -e s v-:

    angular momentum about the pivot is exchanged, the joint gives what it must, soil that moves along takes part.
    """
    n = t.mass.shape[0]
    c, b = t.axle_i[0], t.axle_i[1]
    P, J = t.mass.copy(), np.zeros(6)
    for a in range(t.counts[ACTIVE]):
        i = t.active[a]
        if t.memory[i, MASS_B] > 0.0:
            contact_row(t, i, J)
            add_outer(P, t.memory[i, MASS_B], J, 6 * t.state[i, BODY])
    joints = constraints(t)
    last = joints.shape[0]
    G = np.zeros((last + 1, n))
    G[:last] = joints
    x, y, z = to_body(t.pose[b], t.pose[c, ROT], t.pose[c, ROT + 3], t.pose[c, ROT + 6])
    G[last, 6 * c + 3] = -side
    G[last, 6 * b + 3], G[last, 6 * b + 4], G[last, 6 * b + 5] = side * x, side * y, side * z
    kept = times(G, qd)
    approach = kept[last]
    if approach <= 0.0:
        return 0.0, 0.0
    kept[last] = -t.axle_f[A_RESTITUTION] * approach if approach > SLOW_STOP else 0.0
    before = times(P, qd)
    K, B = joined(P, G, 1)
    for k in range(n):
        B[k, 0] = before[k]
    for k in range(last + 1):
        B[n + k, 0] = kept[k]
    solve_in_place(K, B)
    after = B[:n, 0].copy()
    lost = 0.5 * dot(qd, before) - 0.5 * dot(after, times(P, after))
    for k in range(n):
        qd[k] = after[k]
    return lost, B[n + last, 0]
