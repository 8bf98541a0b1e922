"""Static equilibrium of a vehicle on its tyres: standing, or balanced on two wheels."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from rollover.contact import Body
from rollover.forces import generalised_forces, tyre_point
from rollover.frames import from_angles, rotation_vector
from rollover.jacobian import stiffness
from rollover.tables import E_DEPTH_NOW, E_FORCE_NOW, POSE_COLUMNS, ROT, W_KZ, W_MU, Tables, handle

Array = NDArray[np.float64]
ROLL, PITCH, AXLE, SHIFT, TILT = 1, 2, 3, 4, 7  # places in u; 0 is the height
TOLERANCE = 1e-7  # of forces and moments over the weight


def tread_point(t: Tables, bodies: tuple[Body, ...], w: int, R: Array) -> Array:
    """Lowest point of a tyre, about the vehicle's origin, world axes, all bodies turned by R, (3,)."""
    row, e, x = np.zeros(POSE_COLUMNS), np.zeros(3), np.zeros(3)
    row[ROT : ROT + 9] = R.ravel()
    tyre_point(row, t.wheel_f[w], t.plane[:3], e, x)
    return x + R @ bodies[int(t.wheel_i[w])].centre


def _cross(a: Array, b: Array) -> Array:
    """A x b; numpy's own takes twenty times as long for two vectors."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


class Equilibrium:
    """Few coordinates u: height, roll, pitch, axle angle, shift (3) and tilt (3) of the ROPS on its mounts.

    Roll and pitch turn about the vehicle's origin, after the heading; the residuals are the virtual work of all
    forces for each coordinate, over the weight. The tyres' stick springs are unstrained.
    """

    def __init__(self, bodies: tuple[Body, ...], t: Tables, heading: float, gravity: float) -> None:
        self.bodies, self.t, self.heading = bodies, t, heading
        self.handle = handle(t)
        self.weight = np.zeros(6 * len(bodies))
        self.weight[2::6] = [-gravity * b.inertia.mass for b in bodies]
        self.size = 10 if bodies[-1].name == "rops" else 4
        self.scale = max(-float(self.weight.sum()), 1.0)

    def guess(self, roll: float = 0.0, axle: float = 0.0) -> Array:
        """Start of a search: turned by `roll`, pitched so that front and rear tyres touch, pressed in by the weight."""
        u = np.zeros(self.size)
        u[ROLL], u[AXLE] = roll, axle
        centres = [self.bodies[int(b)].centre[0] for b in self.t.wheel_i] + self.t.wheel_f[:, 0]
        front = centres > 0.5 * (centres.min() + centres.max())

        def depths(pitch: float) -> Array:
            u[PITCH] = pitch
            self.residual(u)
            return self.t.wheel_memory[:, E_DEPTH_NOW].copy()

        def uneven(pitch: float) -> float:
            d = depths(pitch)
            return float(d[front].max() - d[~front].max())

        if front.any() and not front.all() and uneven(-0.4) * uneven(0.4) < 0.0:
            u[PITCH] = brentq(uneven, -0.4, 0.4, xtol=1e-4)
        deepest = float(depths(float(u[PITCH])).max())
        u[0] += deepest / self.t.plane[2] - self.scale / float(self.t.wheel_f[:, W_KZ].sum())
        return u

    def _rotations(self, u: Array) -> list[Array]:
        R = from_angles(u[ROLL], u[PITCH], self.heading)
        found = []
        for body in self.bodies:
            if body.name == "front_axle":
                found.append(R @ from_angles(u[AXLE], 0.0, 0.0))
            elif body.name == "rops":
                found.append(R @ from_angles(*u[TILT : TILT + 3]))
            else:
                found.append(R)
        return found

    def coordinates(self, u: Array) -> Array:
        """Generalised coordinates (6 nb,) of all bodies."""
        turns = self._rotations(u)
        R, origin = turns[0], np.array([0.0, 0.0, u[0]])
        parts = []
        for body, turn in zip(self.bodies, turns, strict=True):
            x = origin + R @ body.centre
            if body.name == "front_axle":
                pivot = self.t.joint_f[0, 3:6]  # about the axle's centre of mass
                x = x + R @ pivot - turn @ pivot
            elif body.name == "rops":
                x = x + R @ u[SHIFT : SHIFT + 3]
            parts += [x, rotation_vector(turn)]
        return np.concatenate(parts)

    def tangents(self, u: Array) -> Array:
        """Velocities (size, 6 nb) of all bodies (world; angular in body axes) for a unit rate of each coordinate."""
        turns, q = self._rotations(u), self.coordinates(u)
        R, origin = turns[0], np.array([0.0, 0.0, u[0]])
        spins = {ROLL: R[:, 0], PITCH: from_angles(0.0, 0.0, self.heading)[:, 1]}
        rows = np.zeros((self.size, q.size))
        rows[0, 2::6] = 1.0
        for b, (body, turn) in enumerate(zip(self.bodies, turns, strict=True)):
            x, at = q[6 * b : 6 * b + 3], 6 * b
            for k, spin in spins.items():
                rows[k, at : at + 3] = _cross(spin, x - origin)
                rows[k, at + 3 : at + 6] = turn.T @ spin
            if body.name == "front_axle":
                rows[AXLE, at : at + 3] = _cross(R[:, 0], -turn @ self.t.joint_f[0, 3:6])
                rows[AXLE, at + 3 : at + 6] = turn.T @ R[:, 0]
            elif body.name == "rops":
                tilt = [turn[:, 0], R @ from_angles(0.0, 0.0, u[TILT + 2])[:, 1], R[:, 2]]
                for k in range(3):
                    rows[SHIFT + k, at : at + 3] = R[:, k]
                    rows[TILT + k, at + 3 : at + 6] = turn.T @ tilt[k]
        return rows

    def residual(self, u: Array) -> Array:
        """Virtual work for each coordinate over the weight, (size,)."""
        return self._work(u)[0]

    @contextmanager
    def _without_friction(self) -> Iterator[None]:
        """No stick: the tyres may move sideways as the vehicle settles."""
        friction = self.t.wheel_f[:, W_MU].copy()
        self.t.wheel_f[:, W_MU] = 0.0
        try:
            yield
        finally:
            self.t.wheel_f[:, W_MU] = friction

    def _work(self, u: Array) -> tuple[Array, Array]:
        """Residual at u and the tangents that it was found with."""
        q = self.coordinates(u)
        Q = np.zeros_like(q)
        with self._without_friction():
            generalised_forces(self.handle, q, np.zeros_like(q), Q)
        T = self.tangents(u)
        return np.asarray(T @ (Q + self.weight) / self.scale), T

    def solve(self, guess: Array, fixed: tuple[int, ...] = ()) -> Array | None:
        """Equilibrium near a guess by a damped Newton iteration, some coordinates held, or None."""
        free = [k for k in range(self.size) if k not in fixed]
        if len(self.bodies) == 1 or self.bodies[1].name != "front_axle":
            free = [k for k in free if k != AXLE]
        u, K = guess.copy(), np.zeros((self.weight.size, self.weight.size))
        r, T = self._work(u)
        for _ in range(80):
            size = float(np.max(np.abs(r[free])))
            if size < TOLERANCE:
                return u
            with self._without_friction():
                stiffness(self.handle, 1.0, 0.0, K)
            A = (T @ K @ T.T / self.scale)[np.ix_(free, free)]
            step = np.linalg.solve(A + 1e-3 * np.eye(len(free)), r[free])
            step *= min(1.0, 0.1 / max(float(np.max(np.abs(step))), 1e-12))
            for _ in range(8):
                trial = u.copy()
                trial[free] += step
                r, T = self._work(trial)
                if float(np.max(np.abs(r[free]))) < size:
                    break
                step *= 0.5
            u = trial
        return None

    def balance(self, sign: float, swing: float) -> Array | None:
        """Unstable equilibrium on the wheels of one side: sign 1 tips to the right, -1 to the left; or None.

        For each roll angle the other coordinates settle; the balance is where the roll moment changes its sign.
        """
        last: tuple[float, float] | None = None
        settled = self.guess()

        def moment(roll: float) -> float:
            nonlocal settled
            start = settled.copy()
            start[ROLL] = sign * roll
            found = self.solve(start, fixed=(ROLL,))
            if found is None:
                found = self.solve(self.guess(sign * roll, -sign * min(roll, 1.01 * swing)), fixed=(ROLL,))
            if found is None or abs(found[PITCH]) > 0.5:
                return math.nan
            settled = found
            return sign * float(self.residual(found)[ROLL])

        for roll in np.radians(np.arange(20.0, 80.0, 6.0)):
            value = moment(float(roll))
            if math.isnan(value):
                continue
            if last is not None and last[1] < 0.0 <= value:
                at = float(brentq(moment, last[0], float(roll), xtol=1e-8))
                moment(at)
                return settled
            last = (float(roll), value)
        return None

    def rates(self, u: Array, rate: float) -> Array:
        """Velocities (6 nb,) while the vehicle rolls at `rate` about its most loaded tyre's contact."""
        if rate == 0.0:
            return np.zeros(6 * len(self.bodies))
        v = self.tangents(u)[ROLL] * rate
        self.residual(u)
        R = from_angles(u[ROLL], u[PITCH], self.heading)
        w = int(np.argmax(self.t.wheel_memory[:, E_FORCE_NOW]))
        shift = _cross(R @ np.array([rate, 0.0, 0.0]), tread_point(self.t, self.bodies, w, R))
        for b in range(len(self.bodies)):
            v[6 * b : 6 * b + 3] -= shift
        return np.asarray(v)
