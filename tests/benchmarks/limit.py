"""The limit: the same vehicle on the same elements in one compiled loop, without Exudyn and without Python calls.

Chassis, front axle on its pivot and ROPS on its mounts, the very kernels of the product, the same step. What the
product adds to it is Exudyn's implicit solver, the crossings between the languages, and the recording of rows.

Velocity Verlet, second order like generalised-alpha: half a kick, a drift, forces at the predicted velocity, half
a kick, `end_of_step`. Masses are blocks of 6 (an element touches one body only), each factorised by itself; the
pivot enters through its Schur complement of 5 rows.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass
from typing import Any
from unittest import mock

import numpy as np
from numpy.typing import NDArray

from ground.compiled import compiled
from rollover.dynamics import model, simulate
from rollover.dynamics.assembly import grown
from rollover.kernels.forces import added_mass, generalised_forces
from rollover.kernels.generalised_alpha import turn
from rollover.kernels.impact import constraints
from rollover.kernels.step import end_of_step
from rollover.kernels.tables import ACTIVE, EVENTS, OMEGA, OUTSIDE, SLOTS, Tables, handle
from rollover.kernels.vectors import cross, relative_angle, to_body, to_world
from rollover.kernels.vectors import place as place_of
from rollover.scenario import Scenario

Array = NDArray[np.float64]
DRIFT_RATE = 100.0  # 1/s, Baumgarte's: errors of the pivot fade within some ten steps


@compiled
def factorise(A: Any) -> None:
    """Cholesky factor of A (n, n), in place in its lower triangle."""
    for j in range(A.shape[0]):
        for k in range(j):
            A[j, j] -= A[j, k] * A[j, k]
        A[j, j] = math.sqrt(A[j, j])
        for i in range(j + 1, A.shape[0]):
            for k in range(j):
                A[i, j] -= A[i, k] * A[j, k]
            A[i, j] /= A[j, j]


@compiled
def back(L: Any, x: Any) -> None:
    """x <- (L L')^-1 x."""
    n = L.shape[0]
    for i in range(n):
        for k in range(i):
            x[i] -= L[i, k] * x[k]
        x[i] /= L[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            x[i] -= L[k, i] * x[k]
        x[i] /= L[i, i]


@compiled
def pivot_bias(t: Any, j: int, g: Any) -> None:
    """dG/dt v of pivot j, and its errors of position with Baumgarte's square, into g (5,)."""
    pa, pb, p = t.pose[t.joint_i[j, 1]], t.pose[t.joint_i[j, 2]], t.joint_f[j]
    a, b, c = pa[OMEGA], pa[OMEGA + 1], pa[OMEGA + 2]
    u = cross(a, b, c, p[0], p[1], p[2])
    u = cross(a, b, c, u[0], u[1], u[2])
    u = to_world(pa, u[0], u[1], u[2])
    d, e, f = pb[OMEGA], pb[OMEGA + 1], pb[OMEGA + 2]
    v = cross(d, e, f, p[3], p[4], p[5])
    v = cross(d, e, f, v[0], v[1], v[2])
    v = to_world(pb, v[0], v[1], v[2])
    x, y = place_of(pa, p[0], p[1], p[2]), place_of(pb, p[3], p[4], p[5])
    square = DRIFT_RATE * DRIFT_RATE
    for k in range(3):
        g[k] = u[k] - v[k] + square * (x[k] - y[k])
    w = to_world(pb, d, e, f)
    w = to_body(pa, w[0], w[1], w[2])
    w = cross(a, b, c, w[0], w[1], w[2])
    g[3] = w[1] - square * relative_angle(pa, pb, 1)
    g[4] = w[2] - square * relative_angle(pa, pb, 2)


@compiled
def accelerations(t: Any, q: Any, v: Any, Q: Any, gravity: float, room: Any, a: Any) -> None:
    """Solve (M + P) a + G' l = Q + weight - gyroscopic terms, G a = -dG/dt v, into a; poses and Q belong to (q, v)."""
    P, L, Y, S, g = room
    nb = t.pose.shape[0]
    moving = t.counts[ACTIVE] > 0
    if moving:
        added_mass(t, q, P)
    for b in range(nb):
        at = 6 * b
        for j in range(6):
            for k in range(j + 1):
                L[b, j, k] = t.mass[at + j, at + k]
                if moving:
                    L[b, j, k] += P[at + j, at + k]
        J, w = t.mass[at + 3 : at + 6, at + 3 : at + 6], v[at + 3 : at + 6]
        s = cross(
            w[0],
            w[1],
            w[2],
            J[0, 0] * w[0] + J[0, 1] * w[1] + J[0, 2] * w[2],
            J[1, 0] * w[0] + J[1, 1] * w[1] + J[1, 2] * w[2],
            J[2, 0] * w[0] + J[2, 1] * w[1] + J[2, 2] * w[2],
        )
        for k in range(3):
            a[at + k] = Q[at + k]
            a[at + 3 + k] = Q[at + 3 + k] - s[k]
        a[at + 2] -= gravity * t.mass[at, at]
        factorise(L[b])
        back(L[b], a[at : at + 6])
    if t.joint_i.shape[0] == 0:
        return
    G = constraints(t)
    pivot_bias(t, 0, g)
    S[:] = 0.0
    for side in range(1, 3):
        at = 6 * t.joint_i[0, side]
        for r in range(5):
            y, row = Y[side - 1, r], G[r, at : at + 6]
            for k in range(6):
                y[k] = row[k]
                g[r] += row[k] * (a[at + k] + 2.0 * DRIFT_RATE * v[at + k])
            back(L[t.joint_i[0, side]], y)
            for c in range(r, 5):
                for k in range(6):
                    S[c, r] += G[c, at + k] * y[k]
    factorise(S)
    back(S, g)
    for side in range(1, 3):
        at = 6 * t.joint_i[0, side]
        for r in range(5):
            for k in range(6):
                a[at + k] -= Y[side - 1, r, k] * g[r]


@compiled
def advance(t: Any, q: Any, qd: Any, a: Any, h: float, gravity: float, first: int, last: int) -> int:
    """Steps `first` to `last`; returns the step reached: earlier where the memory must grow, -1 outside the array."""
    n, nb = q.shape[0], t.pose.shape[0]
    Q, v = np.zeros(n), np.zeros(n)
    room = np.zeros((n, n)), np.zeros((nb, 6, 6)), np.zeros((2, 5, 6)), np.zeros((5, 5)), np.zeros(5)
    generalised_forces(t, q, qd, Q)
    accelerations(t, q, qd, Q, gravity, room, a)
    for step in range(first, last):
        if t.counts[OUTSIDE] > 0:
            return -1
        if t.counts[SLOTS] + t.point_a.shape[0] + 1 > t.memory.shape[0]:
            return step
        for k in range(n):
            v[k] = qd[k] + h * a[k]
            qd[k] += 0.5 * h * a[k]
        for b in range(nb):
            at = 6 * b
            for k in range(3):
                q[at + k] += h * qd[at + k]
            turn(q[at + 3 : at + 6], h * qd[at + 3], h * qd[at + 4], h * qd[at + 5])
        generalised_forces(t, q, v, Q)
        accelerations(t, q, v, Q, gravity, room, a)
        for k in range(n):
            qd[k] += 0.5 * h * a[k]
        end_of_step(t, q, qd, a, h, Q, False)
        t.counts[EVENTS] = 0
        accelerations(t, q, qd, Q, gravity, room, a)
    return last


class CaughtError(Exception):
    """Ends a run where its solver would begin."""


def caught(scenario: Scenario) -> dict[str, Any]:
    """What `rollover.dynamics.simulate` hands to its solver: bodies, tables, start, step; nothing is done twice."""
    with mock.patch.object(model, "solve", side_effect=CaughtError) as solve, suppress(CaughtError):
        simulate.run(scenario)
    return dict(solve.call_args.kwargs)


@dataclass
class Loop:
    """A scenario at its start, ready to be advanced; `run` may be called once."""

    tables: Tables
    q: Array
    qd: Array
    step: float
    steps: int
    gravity: float

    def run(self) -> None:
        """Advance to the end. Raises ``RuntimeError`` where the vehicle leaves the array or the state is not finite."""
        t, a, done = self.tables, np.zeros_like(self.q), 0
        while done < self.steps:
            t = self.tables = grown(t)
            done = advance(handle(t), self.q, self.qd, a, self.step, self.gravity, done, self.steps)
            if done < 0 or not np.isfinite(self.q).all():
                raise RuntimeError("the compiled loop left the array or is not finite")


def loop(scenario: Scenario) -> Loop:
    """The scenario's tables and start, as `rollover.dynamics.simulate` makes them."""
    given = caught(scenario)
    return Loop(
        tables=given["live"].tables,
        q=given["start"].q.copy(),
        qd=given["start"].qd.copy(),
        step=given["step"],
        steps=given["steps"],
        gravity=given["gravity"],
    )
