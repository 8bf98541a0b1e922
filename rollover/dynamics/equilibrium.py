"""Static equilibrium of a vehicle on its tyres: standing, or balanced on two wheels."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from rollover.dynamics.bodies import Body
from rollover.dynamics.posture import AXLE, PARTS, PITCH, ROLL, SLIDE, SWINGS, WITH_CHASSIS, YAW, move, put
from rollover.kernels.forces import generalised_forces
from rollover.kernels.jacobian import stiffness
from rollover.kernels.links import JOINT, L_B, L_HIGH, L_LOW
from rollover.kernels.step import stand
from rollover.kernels.tables import (
    E_DEPTH_NOW,
    E_FORCE_NOW,
    POSE_COLUMNS,
    ROT,
    S_DELTA_NOW,
    S_FORCE_NOW,
    S_SET,
    T_K,
    T_PLAY,
    W_CENTRE,
    W_HALF,
    W_KZ,
    Tables,
    handle,
)
from rollover.kernels.tyres import tyre_point
from rollover.spec.frames import from_angles

Array = NDArray[np.float64]
OWN = ("rops", "trailer", "bogie_", "hub_")
TOLERANCE = 1e-7  # of forces and moments over the weight
FREE = 1.0  # m or rad: a play that no part of a ROPS leaves
BEYOND, STEP = math.radians(15.0), math.radians(1.0)  # of the inward search: from past the stiff balance, in degrees


def tread_point(t: Tables, bodies: tuple[Body, ...], w: int, R: Array) -> Array:
    """Lowest point of a tyre, about the vehicle's origin, world axes, all bodies turned by R, (3,)."""
    row, e, x = np.zeros(POSE_COLUMNS), np.zeros(3), np.zeros(3)
    row[ROT : ROT + 9] = R.ravel()
    tyre_point(row, t.wheel_f[w], t.plane[:3], e, x)
    return np.asarray(x + R @ bodies[int(t.wheel_i[w])].centre)


def _cross(a: Array, b: Array) -> Array:
    """A x b; numpy's own takes twenty times as long for two vectors."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def _root(f: Callable[[float], float], low: float, high: float) -> float:
    """Where f changes its sign, to 1e-4.

    brentq's own wrapper refers to itself: what it is handed, here with a run's tables, would stay until garbage is
    collected.
    """
    held = [f]
    try:
        return float(brentq(lambda x: held[0](x), low, high, xtol=1e-4))
    finally:
        held.clear()


class Equilibrium:
    """Few coordinates u: height, roll, pitch, axle angle, slide (2), yaw; shift (3) and tilt (3) of bodies on springs.

    Height is along the surface's normal, slide along it; roll, pitch and yaw turn about the vehicle's origin. The
    residuals are the virtual work of all forces for each coordinate, over the weight. The tyres' stick springs hold
    the vehicle where the search began, so that on a slope it leans on them. They begin at `base`, a point of the
    plane `t.plane`, which for an uneven surface is that of the ground under the wheels.
    """

    def __init__(self, bodies: tuple[Body, ...], t: Tables, heading: float, gravity: float, base: Array) -> None:
        self.bodies, self.t, self.heading = bodies, t, heading
        self.handle = handle(t)
        self.weight = np.zeros(6 * len(bodies))
        self.weight[2::6] = [-gravity * b.inertia.mass for b in bodies]
        n = from_angles(0.0, 0.0, heading).T @ t.plane[:3]
        self.level = -math.asin(n[1]), math.atan2(n[0], n[2])  # roll and pitch of a vehicle flat on the surface
        n = t.plane[:3]
        x = np.array([n[2], 0.0, -n[0]]) / math.hypot(n[0], n[2])
        self.place = np.array([n, x, _cross(n, x), base])
        frames = [b.name for b in bodies if b.name.startswith(OWN)]  # bodies that springs hold
        self.size = PARTS + 6 * len(frames)
        begins = {name: PARTS + 6 * i for i, name in enumerate(frames)} | {"front_axle": SWINGS}
        self.part = np.array([begins.get(b.name, WITH_CHASSIS) for b in bodies], dtype=np.int64)
        self.centre = np.array([b.centre for b in bodies])
        # of the axle, about its own centre of mass
        self.pivot = t.joint_f[0, 3:6].copy() if "front_axle" in [b.name for b in bodies] else np.zeros(3)
        # in its play a part has no place of its own: it is found without, then put where it bears
        self.play = t.mount_f[:, T_PLAY : T_PLAY + 6].copy()
        t.mount_f[:, T_PLAY : T_PLAY + 6] = 0.0
        self.scale = max(-float(self.weight.sum()), 1.0)
        self.overturns = False  # whether `balance` found it to fall over at every roll that it tried

    def guess(self, roll: float = 0.0, axle: float = 0.0) -> Array:
        """Start of a search: rolled against the surface, pitched so that both axles touch, pressed in by the weight."""
        u = np.zeros(self.size)
        u[ROLL], u[AXLE] = self.level[0] + roll, axle
        self._upright(u, roll)
        centres = [self.bodies[int(b)].centre[0] for b in self.t.wheel_i] + self.t.wheel_f[:, 0]
        front = centres > 0.5 * (centres.min() + centres.max())

        def depths(pitch: float) -> Array:
            u[PITCH] = self.level[1] + pitch
            self.residual(u)
            return np.array(self.t.wheel_memory[:, E_DEPTH_NOW])

        def uneven(pitch: float) -> float:
            d = depths(pitch)
            return float(d[front].max() - d[~front].max())

        reaches = front.any() and not front.all() and uneven(-0.4) * uneven(0.4) < 0.0
        deepest = float(depths(_root(uneven, -0.4, 0.4) if reaches else 0.0).max())
        if roll == 0.0 and self._lay(u):
            self.residual(u)
            deepest = float(self.t.wheel_memory[:, E_DEPTH_NOW].max())
        u[0] += deepest - self.scale / float(self.t.wheel_f[:, W_KZ].sum())
        return u

    def _upright(self, u: Array, roll: float) -> None:
        """Turn a trailer with its bogies back on its hitch by as much as the vehicle is rolled, as far as it turns."""
        for (kind, b, a, *_), f in zip(self.t.link_i, self.t.link_f, strict=True):
            if kind != JOINT:
                continue
            at, under = int(self.part[b]), int(self.part[a])
            if self.bodies[b].name == "trailer":
                tilt = min(max(-roll, f[L_LOW]), f[L_HIGH])
                hitch = f[L_B : L_B + 3]
                u[at : at + 3], u[at + 3] = hitch - from_angles(tilt, 0.0, 0.0) @ hitch, tilt
            elif self.bodies[a].name == "trailer":
                tilt, apart = u[under + 3], self.centre[b] - self.centre[a]
                u[at : at + 3] = u[under : under + 3] + from_angles(tilt, 0.0, 0.0) @ apart - apart
                u[at + 3] = tilt

    def _lay(self, u: Array) -> bool:
        """Swing each bogie within its stops until wheels ahead of its pin are as deep as those behind; if any was."""
        pins = [
            (int(b), f)
            for (kind, b, *_), f in zip(self.t.link_i, self.t.link_f, strict=True)
            if kind == JOINT and self.bodies[b].name.startswith("bogie_")
        ]
        return sum(self._lie(u, b, f) for b, f in pins) > 0  # each of them

    def _lie(self, u: Array, b: int, f: Array) -> bool:
        """Swing one bogie, body b on the pin f, so; whether it reaches."""
        at, pin, on = int(self.part[b]), f[L_B : L_B + 3].copy(), self.t.wheel_i == b
        base, ahead = u[at : at + 3].copy(), self.t.wheel_f[:, 0] > pin[0]

        def uneven(angle: float) -> float:
            swung = from_angles(u[at + 3], angle, 0.0) - from_angles(u[at + 3], 0.0, 0.0)
            u[at : at + 3], u[at + 4] = base - swung @ pin, angle
            self.residual(u)
            d = self.t.wheel_memory[:, E_DEPTH_NOW]
            return float(d[on & ahead].max() - d[on & ~ahead].max())

        low, high = float(f[L_LOW + 1]), float(f[L_HIGH + 1])
        reaches = uneven(low) * uneven(high) < 0.0
        uneven(_root(uneven, low, high) if reaches else 0.0)
        return reaches

    def placed(self, u: Array) -> tuple[Array, Array]:
        """Generalised coordinates (6 nb,) of all bodies, and their velocities (size, 6 nb) for a unit rate of each u.

        Velocities are in world axes, angular ones in body axes.
        """
        turns, q = np.empty((len(self.bodies), 3, 3)), np.empty(self.weight.size)
        put(u, self.heading, self.place, self.pivot, self.centre, self.part, turns, q)
        rows = np.empty((self.size, q.size))
        move(u, self.heading, self.place, self.pivot, self.part, turns, q, rows)
        return q, rows

    def coordinates(self, u: Array) -> Array:
        """Generalised coordinates (6 nb,) of all bodies."""
        return self.placed(u)[0]

    def tangents(self, u: Array) -> Array:
        """Their velocities (size, 6 nb) for a unit rate of each u, as in `placed`."""
        return self.placed(u)[1]

    def residual(self, u: Array) -> Array:
        """Virtual work for each coordinate over the weight, (size,)."""
        q, rows = self.placed(u)
        Q = np.zeros_like(q)
        generalised_forces(self.handle, q, np.zeros_like(q), Q)
        return np.asarray(rows @ (Q + self.weight) / self.scale)

    def solve(self, guess: Array, fixed: tuple[int, ...] = ()) -> Array | None:
        """Equilibrium near a guess by a damped Newton iteration, some coordinates held, or None."""
        free = [k for k in range(self.size) if k not in fixed]
        if len(self.bodies) == 1 or self.bodies[1].name != "front_axle":
            free = [k for k in free if k != AXLE]
        u = guess.copy()
        self.residual(u)
        stand(self.handle)
        r = self.residual(u)[free]
        for _ in range(100):
            size = float(np.max(np.abs(r)))
            if size < TOLERANCE:
                return u
            # differences see all of the geometry, near the end; kinks on the way lead them astray, springs are patient
            far = (self._by_springs, self._by_differences)
            for direction in far if size > 0.02 else far[::-1]:
                better, u_next, r_next = self._descend(u, r, direction(u, r, free), free)
                if better:
                    break
            u, r = u_next, r_next
        return None

    def seated(self, u: Array, fixed: tuple[int, ...] = ()) -> Array:
        """The equilibrium u with the parts of the ROPS where they bear at the ends of their play, which is given back.

        Each axis with play is taken to bear at one end of it, there as a spring that stands off by the play, or to be
        free; what would pull is set free, what goes beyond its play bears, until nothing changes. Where that does not
        end, parts begin to move when the run does.
        """
        if not self.play.any():
            return u
        memory, gap = self.t.mount_memory, self.t.mount_f[:, T_PLAY : T_PLAY + 6]
        sets = memory[:, S_SET : S_SET + 6]
        self.residual(u)
        force = memory[:, S_FORCE_NOW : S_FORCE_NOW + 6]
        sides = -np.sign(np.where(np.abs(force) > 1e-4 * self.scale, force, 0.0)) * (self.play > 0.0)
        for _ in range(20):
            gap[:] = np.where((sides == 0.0) & (self.play > 0.0), FREE, 0.0)
            sets[:] = sides * self.play
            found = self.solve(u, fixed)
            if found is None:
                break
            u = found
            way, after = memory[:, S_DELTA_NOW : S_DELTA_NOW + 6], sides.copy()
            beyond = (sides == 0.0) & (self.play > 0.0) & (np.abs(way) > self.play)
            after[beyond] = np.sign(way[beyond])
            pull = np.where(sides == 0.0, 0.0, (self.play - way * sides) * self.t.mount_f[:, T_K : T_K + 6])
            if not beyond.any() and pull.max() > 0.0:
                after[np.unravel_index(int(np.argmax(pull)), pull.shape)] = 0.0  # one at a time: the others may bear
            if np.array_equal(after, sides):
                break
            sides = after
        sets[:], gap[:] = 0.0, self.play
        return u

    def _descend(self, u: Array, r: Array, step: Array, free: list[int]) -> tuple[bool, Array, Array]:
        """Go along a step, at most 0.1 in any coordinate, halved until the residual falls; whether it did."""
        step = step * min(1.0, 0.1 / max(float(np.max(np.abs(step))), 1e-12))
        size = float(np.max(np.abs(r)))
        for _ in range(8):
            trial = u.copy()
            trial[free] += step
            found = self.residual(trial)[free]
            if float(np.max(np.abs(found))) < size:
                return True, trial, found
            step = 0.5 * step
        return False, trial, found

    def _by_differences(self, u: Array, r: Array, free: list[int]) -> Array:
        eps = 1e-7
        slopes = np.empty((len(free), len(free)))
        for column, k in enumerate(free):
            stepped = u.copy()
            stepped[k] += eps
            slopes[:, column] = (self.residual(stepped)[free] - r) / eps
        return -np.asarray(np.linalg.lstsq(slopes, r, rcond=1e-10)[0])

    def _by_springs(self, u: Array, r: Array, free: list[int]) -> Array:
        K = np.zeros((self.weight.size, self.weight.size))
        self.residual(u)
        stiffness(self.handle, 1.0, 0.0, K)
        T = self.tangents(u)
        A = (T @ K @ T.T / self.scale)[np.ix_(free, free)]
        return np.asarray(np.linalg.solve(A + 1e-3 * np.eye(len(free)), r))

    def tilt(self, sign: float) -> float:
        """How far the surface falls towards a side (1 right, -1 left), rad."""
        return -sign * math.asin(float(from_angles(0.0, 0.0, self.heading)[:, 1] @ self.t.plane[:3]))

    def held(self) -> Array | None:
        """Flat on the surface on all wheels, kept from rolling, slipping and turning, the rest in equilibrium; or None.

        The pose in which a vehicle stands that is let go where it cannot stand.
        """
        u = self.solve(self.guess(), fixed=(ROLL, SLIDE, SLIDE + 1, YAW))
        return None if u is None else self.seated(u, fixed=(ROLL, SLIDE, SLIDE + 1, YAW))

    def balance(self, sign: float, swing: float) -> Array | None:
        """Unstable equilibrium on the wheels of one side: sign 1 tips to the right, -1 to the left; or None.

        For each roll angle against the surface the other coordinates settle; at the balance the moment changes sign.
        """
        settled: Array | None = None

        def moment(roll: float) -> float:
            nonlocal settled
            found = None
            if settled is not None:
                start = settled.copy()
                start[ROLL] = self.level[0] + sign * roll
                found = self.solve(start, fixed=(ROLL,))
            if found is None:
                found = self.solve(self.guess(sign * roll, -sign * min(roll, 1.01 * swing)), fixed=(ROLL,))
            if found is None or abs(found[PITCH] - self.level[1]) > 0.5:
                return math.nan
            settled = found
            return sign * float(self.residual(found)[ROLL])

        roll = self._rigid() - self.tilt(sign)  # a little less than where it balances
        value, step = moment(roll), math.radians(3.0)
        tried = [value] if roll >= 0.0 and not math.isnan(value) else []
        for _ in range(15):
            below = value < 0.0 or math.isnan(value)
            before, roll = (roll, value), roll + (step if below else -step)
            value = moment(roll)
            tried += [value] if roll >= 0.0 and not math.isnan(value) else []
            if before[1] * value <= 0.0:  # a nan never is
                return settled if self._between(moment, before, (roll, value)) else None
        self.overturns = min(tried, default=-1.0) > 0.0
        return None

    def outermost(self, sign: float, swing: float) -> Array | None:
        """The balance with the axle on its stop, sought from beyond it inwards; or None.

        Just below the static limit poses that follow from each other jump between the free axle and its stop, and the
        last balance merges with the end of the stop: where every pose overturns, the one that does least is given.
        """
        settled: Array | None = None

        def moment(roll: float) -> float:
            nonlocal settled
            start = self.guess(sign * roll, -sign * min(roll, 1.01 * swing)) if settled is None else settled.copy()
            start[ROLL] = self.level[0] + sign * roll
            found = self.solve(start, fixed=(ROLL,))
            if found is None or abs(found[PITCH] - self.level[1]) > 0.5:
                return math.nan
            settled = found
            return sign * float(self.residual(found)[ROLL])

        roll = max(self._rigid() - self.tilt(sign), swing) + BEYOND
        outer, least, pose = (math.nan, math.nan), math.inf, None
        while roll > swing:
            inner = (roll, moment(roll))
            if inner[1] < 0.0 < outer[1]:
                return settled if self._between(moment, inner, outer) else None
            if 0.0 < inner[1] < least:
                least, pose = inner[1], settled
            outer, roll = inner, roll - STEP
        return pose

    def tips(self, u: Array, sign: float) -> bool:
        """Whether a pose goes on rolling to the side that it leans to, rather than back."""
        return sign * float(self.residual(u)[ROLL]) > 0.0

    def _rigid(self) -> float:
        """Angle (rad) at which a rigid vehicle balances on its outer edges; tyres and axle move it by some degrees."""
        height = sum(b.inertia.mass * b.centre[2] for b in self.bodies) / sum(b.inertia.mass for b in self.bodies)
        edge = max(
            abs(self.bodies[int(b)].centre[1] + f[W_CENTRE + 1]) + f[W_HALF]
            for b, f in zip(self.t.wheel_i, self.t.wheel_f, strict=True)
        )
        return math.atan2(edge, height)

    def _between(self, moment: Callable[[float], float], a: tuple[float, float], b: tuple[float, float]) -> bool:
        """Close in on the zero between two points by the Illinois variant of false position."""
        for _ in range(40):
            x = b[0] - b[1] * (b[0] - a[0]) / (b[1] - a[1]) if a[1] != b[1] else 0.5 * (a[0] + b[0])
            y = moment(x)
            if math.isnan(y):
                return False
            if abs(y) < 10.0 * TOLERANCE or abs(b[0] - a[0]) < 1e-9:
                return True
            a = b if y * b[1] < 0.0 else (a[0], 0.5 * a[1])
            b = (x, y)
        return True

    def forward(self, u: Array, speed: float, sideways: float) -> Array:
        """Velocities (6 nb,) of a vehicle that moves along the ground, along its heading and to its left (m/s)."""
        n, ahead = self.t.plane[:3], from_angles(0.0, 0.0, self.heading + u[YAW])[:, 0]
        ahead = ahead - (ahead @ n) * n
        ahead /= np.linalg.norm(ahead)
        return np.tile([*(speed * ahead + sideways * _cross(n, ahead)), 0.0, 0.0, 0.0], len(self.bodies))

    def rates(self, u: Array, rate: float) -> Array:
        """Velocities (6 nb,) while the vehicle rolls at `rate` about its most loaded tyre's contact."""
        if rate == 0.0:
            return np.zeros(6 * len(self.bodies))
        v = self.tangents(u)[ROLL] * rate
        self.residual(u)
        R = from_angles(u[ROLL], u[PITCH], self.heading + u[YAW])
        w = int(np.argmax(self.t.wheel_memory[:, E_FORCE_NOW]))
        shift = _cross(R @ np.array([rate, 0.0, 0.0]), tread_point(self.t, self.bodies, w, R))
        for b in range(len(self.bodies)):
            v[6 * b : 6 * b + 3] -= shift
        return np.asarray(v)
