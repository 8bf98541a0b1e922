"""Compiled: one step of generalised alpha for the bodies with their joints, solved by Newton's iteration.

With the scheme of Chung and Hulbert (1993) in the form of Arnold and Bruls (2007) for joints as equations of position,

    q+ = q o (h v + h^2 ((1/2 - beta) A + beta A+)),   v+ = v + h ((1 - gamma) A + gamma A+),
    (1 - alpha_m) A+ + alpha_m A = (1 - alpha_f) a+ + alpha_f a,
    M a+ + G' l = Q(q+, v+),   g(q+) = 0,

where `o` adds positions and turns of wheels, and turns bodies by a rotation vector in their own axes. Unknown are the
increments of q+ and the joints' forces l; the rows of the forces are scaled by beta h^2, so that the matrix does not
depend on the step's length. The contact set and the soil's co-moving masses are those of the step's start.

The iteration is that of Exudyn 1.13, rule by rule: one new matrix for each step, further ones where it contracts
slowly; a start afresh where it diverges; half the step where it fails. It ends where Exudyn's ends, so that both give
the same numbers but for rounding, not only the same within the iteration's tolerance.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ground.compiled import compiled, leaf
from rollover.kernels.dense import factorise, norm, substitute
from rollover.kernels.forces import generalised_forces
from rollover.kernels.jacobian import stiffness
from rollover.kernels.joint_equations import EQUATIONS, joint_errors, joint_rows
from rollover.kernels.vectors import cross

TOLERANCE = 1e-5  # of the residual's norm, N and N m: of what it was at first, or by itself
MOST_ITERATIONS = 25
FEW_ITERATIONS = 8  # with one matrix; beyond, each iteration has its own
SLOW, APART = 0.5, 2.0  # residual over the one before: a new matrix helps; it diverges
LARGEST = 1e38  # square of a state's norm that is none any more

# places in Course.real: time of the last accepted step, length of the next one, end and length asked for, s; gravity,
# m/s2; time at which the last forces were tried
TIME, STEP, END, LONGEST, GRAVITY, TRIED, REALS = 0, 1, 2, 3, 4, 5, 6
# places in Course.whole: steps since the last one that was shortened, steps, forces, matrices
SINCE, STEPS, FORCES, MATRICES, WHOLES = 0, 1, 2, 3, 4
# places in Course.scheme
ALPHA_M, ALPHA_F, BETA, GAMMA, SCHEME = 0, 1, 2, 3, 4


class Course(NamedTuple):
    """State of the integrator; n = 6 bodies + turning wheels, nj joints."""

    q: Any  # (n,)
    qd: Any  # (n,)
    qdd: Any  # (n,)
    filtered: Any  # (n,) A of the scheme
    added: Any  # (n, n) co-moving masses and turning wheels at the step's start
    anchor: Any  # (nj, 3) places of the guides
    scheme: Any  # (SCHEME,)
    real: Any  # (REALS,)
    whole: Any  # (WHOLES,)


class Room(NamedTuple):
    """What a step works with."""

    start: Any  # (4, n) q, qd, qdd and A at its start
    way: Any  # (n,) increment of q since its start
    force: Any  # (n,) generalised forces that were found last
    joint: Any  # (5 nj,) forces of the joints
    mass: Any  # (n, n) whole mass matrix
    rows: Any  # (5 nj, n) of the joints
    residual: Any  # (n + 5 nj,)
    change: Any  # (n + 5 nj,)
    matrix: Any  # (n + 5 nj, n + 5 nj)
    stiff: Any  # (n, n)
    order: Any  # (n + 5 nj,)


@compiled
def room_for(n: int, joints: int) -> Any:
    """Room of a step."""
    c = EQUATIONS * joints
    return Room(
        np.zeros((4, n)),
        np.zeros(n),
        np.zeros(n),
        np.zeros(c),
        np.zeros((n, n)),
        np.zeros((c, n)),
        np.zeros(n + c),
        np.zeros(n + c),
        np.zeros((n + c, n + c)),
        np.zeros((n, n)),
        np.zeros(n + c, dtype=np.int64),
    )


@leaf
def turn(r: Any, x: float, y: float, z: float) -> None:
    """R(r) <- R(r) R(x, y, z) for a rotation vector r (3,), by unit quaternions."""
    c = math.sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2])
    s = 0.5 if c < 1e-9 else math.sin(0.5 * c) / c
    w0, a0, b0, c0 = math.cos(0.5 * c), s * r[0], s * r[1], s * r[2]
    c = math.sqrt(x * x + y * y + z * z)
    s = 0.5 if c < 1e-9 else math.sin(0.5 * c) / c
    w1, a1, b1, c1 = math.cos(0.5 * c), s * x, s * y, s * z
    a2, b2, c2 = cross(a0, b0, c0, a1, b1, c1)
    w = w0 * w1 - a0 * a1 - b0 * b1 - c0 * c1
    a2, b2, c2 = a2 + w0 * a1 + w1 * a0, b2 + w0 * b1 + w1 * b0, c2 + w0 * c1 + w1 * c0
    size = math.sqrt(a2 * a2 + b2 * b2 + c2 * c2)
    s = 2.0 if size < 1e-12 else 2.0 * math.atan2(size, w) / size
    r[0], r[1], r[2] = s * a2, s * b2, s * c2


@leaf
def place_bodies(s: Any, w: Any, bodies: int) -> None:
    """q = start o way."""
    for k in range(s.q.size):
        s.q[k] = w.start[0, k]
    for b in range(bodies):
        at = 6 * b
        for k in range(3):
            s.q[at + k] += w.way[at + k]
        turn(s.q[at + 3 : at + 6], w.way[at + 3], w.way[at + 4], w.way[at + 5])
    for k in range(6 * bodies, s.q.size):
        s.q[k] += w.way[k]


@leaf
def predict(s: Any, w: Any, bodies: int, h: float) -> None:
    """The step's end with a+ = 0 and no forces of the joints; A becomes that of the end as far as it is known."""
    alpha_m, alpha_f, beta, gamma = s.scheme[ALPHA_M], s.scheme[ALPHA_F], s.scheme[BETA], s.scheme[GAMMA]
    for k in range(s.q.size):
        before = s.filtered[k]
        after = (alpha_f * w.start[2, k] - alpha_m * before) / (1.0 - alpha_m)
        w.way[k] = h * w.start[1, k] + h * h * ((0.5 - beta) * before + beta * after)
        s.qd[k] = w.start[1, k] + h * ((1.0 - gamma) * before + gamma * after)
        s.qdd[k], s.filtered[k] = 0.0, after
    for k in range(w.joint.size):
        w.joint[k] = 0.0
    place_bodies(s, w, bodies)


@compiled
def residual_of(t: Any, s: Any, w: Any) -> float:
    """Residuals of the equations of motion and of the joints at the state of `s`; returns their norm."""
    n, c, bodies = s.q.size, w.joint.size, t.mass.shape[0]
    generalised_forces(t, s.q, s.qd, w.force)
    s.whole[FORCES] += 1
    joint_rows(t, w.rows)
    for i in range(n):
        # an element touches one body only: without turning wheels the mass matrix is one of blocks
        first, end = (i - i % 6, i - i % 6 + 6) if n == bodies else (0, n)
        total = -w.force[i]
        for k in range(first, end):
            total += w.mass[i, k] * s.qdd[k]
        w.residual[i] = total
    for k in range(c):
        for i in range(n):
            w.residual[i] += w.rows[k, i] * w.joint[k]
    for b in range(t.pose.shape[0]):
        at = 6 * b
        w.residual[at + 2] += s.real[GRAVITY] * t.mass[at, at]
        J, o = t.mass[at + 3 : at + 6, at + 3 : at + 6], s.qd[at + 3 : at + 6]
        x, y, z = momentum(J, o)
        x, y, z = cross(o[0], o[1], o[2], x, y, z)
        w.residual[at + 3] += x
        w.residual[at + 4] += y
        w.residual[at + 5] += z
    joint_errors(t, s.anchor, w.residual[n:])
    return norm(w.residual)


@leaf
def momentum(J: Any, o: Any) -> Any:
    """J o, three numbers."""
    return (
        J[0, 0] * o[0] + J[0, 1] * o[1] + J[0, 2] * o[2],
        J[1, 0] * o[0] + J[1, 1] * o[1] + J[1, 2] * o[2],
        J[2, 0] * o[0] + J[2, 1] * o[1] + J[2, 2] * o[2],
    )


@leaf
def add_gyroscopic(t: Any, s: Any, factor: float, A: Any) -> None:
    """A += factor d(omega x J omega)/d omega of each body."""
    for b in range(t.pose.shape[0]):
        at = 6 * b + 3
        J, o = t.mass[at : at + 3, at : at + 3], s.qd[at : at + 3]
        x, y, z = momentum(J, o)
        for k in range(3):
            u, v, r = cross(o[0], o[1], o[2], J[0, k], J[1, k], J[2, k])
            A[at, at + k] += factor * u
            A[at + 1, at + k] += factor * v
            A[at + 2, at + k] += factor * r
        A[at, at + 1] += factor * z
        A[at, at + 2] -= factor * y
        A[at + 1, at] -= factor * z
        A[at + 1, at + 2] += factor * x
        A[at + 2, at] += factor * y
        A[at + 2, at + 1] -= factor * x


@compiled
def new_matrix(t: Any, s: Any, w: Any, h: float) -> bool:
    """Factors of Newton's matrix at the state that was tried last; False where it is singular."""
    n, c = s.q.size, w.joint.size
    scale = s.scheme[BETA] * h * h
    inertia = (1.0 - s.scheme[ALPHA_M]) / (1.0 - s.scheme[ALPHA_F])  # scale beta'
    damping = s.scheme[GAMMA] * h  # scale gamma'
    stiffness(t, scale, damping, w.stiff)
    for i in range(n):
        for k in range(n):
            w.matrix[i, k] = inertia * w.mass[i, k] + w.stiff[i, k]
        for k in range(c):
            w.matrix[i, n + k] = w.matrix[n + k, i] = w.rows[k, i]
    for i in range(n, n + c):
        for k in range(n, n + c):
            w.matrix[i, k] = 0.0
    add_gyroscopic(t, s, damping, w.matrix)
    s.whole[MATRICES] += 1
    return factorise(w.matrix, w.order)


@compiled
def improve(t: Any, s: Any, w: Any, h: float) -> None:
    """Where one iteration of Newton's leads: the state of `s`."""
    n, scale = s.q.size, s.scheme[BETA] * h * h
    for k in range(n):
        w.change[k] = scale * w.residual[k]
    for k in range(n, w.change.size):
        w.change[k] = w.residual[k]
    substitute(w.matrix, w.order, w.change)
    velocity = s.scheme[GAMMA] * h / scale
    acceleration = (1.0 - s.scheme[ALPHA_M]) / (scale * (1.0 - s.scheme[ALPHA_F]))
    for k in range(n):
        w.way[k] -= w.change[k]
        s.qd[k] -= velocity * w.change[k]
        s.qdd[k] -= acceleration * w.change[k]
    for k in range(w.joint.size):
        w.joint[k] -= w.change[n + k] / scale
    place_bodies(s, w, t.pose.shape[0])


@leaf
def is_lost(s: Any, w: Any) -> bool:
    """Whether the state is not finite any more."""
    u, v, f = 0.0, 0.0, 0.0
    for k in range(s.q.size):
        u += s.q[k] * s.q[k]
        v += s.qd[k] * s.qd[k]
    for k in range(w.joint.size):
        f += w.joint[k] * w.joint[k]
    return not (u < LARGEST and v < LARGEST and f == f)


@compiled
def solve_step(t: Any, s: Any, w: Any, h: float) -> int:
    """Newton's iteration for the step of length h that begins at `w.start`; iterations, or 0 where it failed."""
    bodies = t.pose.shape[0]
    predict(s, w, bodies, h)
    first = residual_of(t, s, w)
    if first <= TOLERANCE:
        first = 2.0 * TOLERANCE  # one iteration at least
    left = last = first
    renew, full, restarted, once_more = True, False, False, False
    for count in range(1, MOST_ITERATIONS + 1):
        if renew or full:
            if not new_matrix(t, s, w, h):
                return 0
            renew = False
        improve(t, s, w, h)
        left = residual_of(t, s, w)
        if left > first and count == 1:
            first = last = left
        if left <= TOLERANCE * first or left <= TOLERANCE:
            if not once_more:
                return count
            once_more = False
            continue
        once_more = False
        lost, ratio = is_lost(s, w), left / last
        last = left
        if lost and full:
            return 0
        if not full and count > FEW_ITERATIONS:
            full = True
        elif not full and (lost or (ratio > SLOW and count > 2)):
            renew = True
            full = restarted
            if lost or ratio > APART or full:
                restarted = once_more = True
                last = first
                for k in range(s.q.size):
                    s.filtered[k] = w.start[3, k]
                predict(s, w, bodies, h)
                residual_of(t, s, w)
    return 0


@compiled
def accept(s: Any) -> None:
    """A of the end of a step that was solved."""
    factor = (1.0 - s.scheme[ALPHA_F]) / (1.0 - s.scheme[ALPHA_M])
    for k in range(s.q.size):
        s.filtered[k] += factor * s.qdd[k]


@leaf
def stand_still(s: Any, w: Any) -> None:
    """Nothing accelerates yet, and no joint is under load."""
    for k in range(s.q.size):
        s.qdd[k] = 0.0
    for k in range(w.joint.size):
        w.joint[k] = 0.0


@compiled
def first_accelerations(s: Any, w: Any) -> None:
    """Accelerations of the start by the residuals of what stands still; the joints' rows do not change.

    M a + G' l = Q, G a = 0.
    """
    n, c = s.q.size, w.joint.size
    for i in range(n + c):
        w.change[i] = -w.residual[i] if i < n else 0.0
        for k in range(n + c):
            w.matrix[i, k] = w.mass[i, k] if i < n and k < n else 0.0
    for i in range(n):
        for k in range(c):
            w.matrix[i, n + k] = w.matrix[n + k, i] = w.rows[k, i]
    factorise(w.matrix, w.order)
    substitute(w.matrix, w.order, w.change)
    for k in range(n):
        s.qdd[k] = s.filtered[k] = w.change[k]
