"""What a force that was left out does to the channels of a drop, while the ground is pushed deeper.

Beside a simulated way down z_0(t) a force f(t) moves the striker by

    (m + m_b1) dz'' = -k(t) dz - f,   dF_s = -m dz''                    (the ground resists more)
    (m + m_b1) dz'' = -k(t) dz + f,   dF_s = f - m dz''                 (something beside the ground pushes)    (D6)

with the secant stiffness k = (F(z_0 + dz) - F(z_0))/dz of the way that was measured: linear in f, exact on that way.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ground.law import REFERENCE_AREA, along
from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.fit.linearisation import ResidualBlock
from rollover.diagnosis.forward.filtering import filtered_like, rows_of
from rollover.diagnosis.inference.bases import linear_b_splines
from rollover.diagnosis.inference.newmark import newmark_response
from rollover.diagnosis.settings import SETTINGS
from rollover.dynamics.drop_test import DropModel
from rollover.scenario import Scenario
from rollover.spec.initiation import Drop
from rollover.spec.vehicle import Striker

Array = NDArray[np.float64]
Moves = tuple[Array, Array, Array, Array]  # changes of depth, speed, acceleration, load cell, (n, k) each
Where = Literal["ground", "push"]
WHERES: tuple[Where, ...] = ("ground", "push")
TUNING = SETTINGS.inference.residual_force


@dataclass(frozen=True, kw_only=True)
class Way:
    """One recording's way down: t (n,) s from the contact, its depth, speed and acceleration, the ground's force.

    `stiffness` is k of (D6), `mass` m and `whole` m + m_b1, kg; `touch` the speed at the contact.
    """

    time: Array
    depth: Array
    speed: Array
    acceleration: Array
    force: Array
    stiffness: Array
    mass: float
    whole: float
    touch: float
    gravity: float

    def until(self, n: int) -> Way:
        """The first n steps of it."""
        fields = ("time", "depth", "speed", "acceleration", "force", "stiffness")
        return replace(self, **{name: getattr(self, name)[:n] for name in fields})

    def moved(self, f: Array, where: Where, faster: float = 0.0) -> Moves:
        """(D6) for forces f (n, k): changes of depth, speed, acceleration and load cell, (n, k) each.

        `faster` is a change of speed (m/s) just after the impact. Newmark's rule of constant mean acceleration.
        """
        sign = -1.0 if where == "ground" else 1.0
        z, v, a = (np.zeros(f.shape) for _ in range(3))
        v[0] = faster
        newmark_response(np.ascontiguousarray(sign * f / self.whole), self.stiffness / self.whole, TUNING.step, z, v, a)
        felt = -self.mass * a if where == "ground" else f - self.mass * a
        return z, v, a, felt


def channels_of(way: Way, moves: Moves, e: Dataset, shift: float) -> Array:
    """Those changes as the recording would show them: stacked, whitened, (n, k); what is later stays as it ends."""
    z, v, a, felt = moves
    measured = {
        "ground/sinkage": z,
        "striker/position_z": -z,
        "striker/velocity_z": -v,
        "striker/acceleration_z": -a,
        "ground/force_normal": felt,
    }
    rows = rows_of(e.recording)
    stamps = rows.times - shift
    at = np.clip(np.searchsorted(way.time, stamps) - 1, 0, way.time.size - 2)
    ahead = np.clip((stamps - way.time[at]) / TUNING.step, 0.0, 1.0)[:, None]
    begun = (stamps >= 0.0)[:, None]
    zero_force = np.zeros((stamps.size, z.shape[1]))

    def read(y: Array) -> Array:
        return np.asarray(begun * ((1.0 - ahead) * y.take(at, axis=0) + ahead * y.take(at + 1, axis=0)))

    found = {c: read(measured[c]) if c in measured else zero_force for c in e.recording.channels}
    return np.asarray(e.marginalised(e.whitened(e.raw(filtered_like(found, e.recording, rows)))))


@dataclass(frozen=True, kw_only=True)
class Descent:
    """A recording with its way down, the rows of its stack until the way ends, and what any force at all leaves there.

    `residual` (n,) and `slope` (n,) are those of its block; `left` is the sum of squares that is left by the ground's
    force and by a push, each free in time, and `free` how many numbers that took.
    """

    dataset: Dataset
    way: Way
    shift: float
    rows: NDArray[np.bool_]
    residual: Array
    slope: Array
    prior: float
    left: Mapping[str, float]
    free: float
    better: float

    @property
    def score(self) -> float:
        """What a force leaves at this time shift."""
        return min(self.excess(where) for where in WHERES) + (self.shift / self.prior) ** 2

    def excess(self, where: Where) -> float:
        """What the best force leaves over the noise."""
        return self.left[where] - (float(self.rows.sum()) - self.free)


def descent(scenario: Scenario, e: Dataset, block: ResidualBlock) -> Descent | None:
    """The way down of a recording under its `scenario`, beside the base's `block`; None if it has none."""
    striker, start = scenario.vehicle, scenario.initiation
    if not isinstance(striker, Striker) or not isinstance(start, Drop) or striker.nose == "cone":
        return None
    time = np.arange(0.0, TUNING.duration, TUNING.step)
    run = DropModel(scenario=scenario).run(time)
    z, v = run.channels["ground/sinkage"], -run.channels["striker/velocity_z"]
    v[0] = v[1]
    going = v > TUNING.stopped_speed * v[1]
    n = int(np.argmin(going)) if not going.all() else time.size
    if n < 12:
        return None
    time, z, v = time[:n], z[:n], v[:n]
    share = scenario.ground.co_moving_mass.share
    mass, area = striker.mass, striker.face_length * striker.face_width / REFERENCE_AREA
    touch = float(start.speed)

    def spring(depth: Array, speed: Array) -> Array:
        return area * along(scenario.ground.law, np.maximum(depth, 0.0), speed, speed=touch)

    force = spring(z, v)
    tangent = (spring(z + TUNING.tangent_step, v) - force) / TUNING.tangent_step
    way = Way(
        time=time, depth=z, speed=v, acceleration=np.gradient(v, time), force=force, stiffness=tangent, mass=mass,
        whole=(1.0 + share) * mass, touch=touch, gravity=scenario.gravity,
    )  # fmt: skip
    stamps = np.concatenate([e.recording.time[s.rows] for s in e.signals]) - block.shift
    rows = stamps <= time[-1]
    knots = time[-1] * np.linspace(0.0, 1.0, TUNING.free_knots) ** TUNING.knot_power
    f = linear_b_splines(time, knots) * TUNING.force_prior * float(force.max())
    measured = way
    for _ in range(TUNING.stiffness_rounds):
        moves = _all_moves(measured, f, "ground")
        x, _, _ = _free(measured, moves, e, block, rows)
        dz, dv, da = (m @ x[:-1] for m in moves[:3])
        depth = np.maximum(z + dz, 0.0)
        there = spring(depth, v)
        adaptive_difference = np.where(
            np.abs(dz) > TUNING.tangent_step,
            (there - force) / np.where(np.abs(dz) > TUNING.tangent_step, dz, 1.0),
            tangent,
        )
        measured = replace(
            way, depth=depth, speed=v + dv, acceleration=way.acceleration + da, force=there,
            stiffness=np.clip(adaptive_difference, 0.0, None),
        )  # fmt: skip
    on = measured.speed > TUNING.stopped_speed * v[1]
    n = int(np.argmin(on)) if not on.all() else n
    if n < 12:
        return None
    measured = measured.until(n)
    f, rows = f[:n], stamps <= time[n - 1]
    left: dict[str, float] = {}
    free, later = 0.0, {}
    for where in WHERES:
        x, left[where], free = _free(measured, _all_moves(measured, f, where), e, block, rows)
        later[where] = float(x[-1]) * block.prior
    return Descent(
        dataset=e, way=measured, shift=block.shift, rows=rows, residual=block.residual, slope=block.slope,
        prior=block.prior, left=left, free=free,
        better=block.shift + later[min(WHERES, key=lambda where: left[where])],
    )  # fmt: skip


def _all_moves(way: Way, f: Array, where: Where) -> Moves:
    """Changes by each force, and by a speed that is `speed_prior`, (n, k + 1) each."""
    forced = way.moved(f, where)
    faster = way.moved(np.zeros((f.shape[0], 1)), where, TUNING.speed_prior * way.touch)
    z, v, a, felt = (np.hstack([one, other]) for one, other in zip(forced, faster, strict=True))
    return z, v, a, felt


def _free(
    way: Way, moves: Moves, e: Dataset, block: ResidualBlock, rows: NDArray[np.bool_]
) -> tuple[Array, float, float]:
    """Strengths of `_all_moves` that leave least of a recording, what that is, and how many count."""
    J = channels_of(way, moves, e, block.shift)[rows]
    A = np.column_stack([J, block.slope[rows] * block.prior])
    w = block.residual[rows]
    N = A.T @ A
    inverse = np.linalg.inv(N + np.eye(N.shape[0]))
    x = inverse @ (A.T @ w)
    miss = w - A @ x
    return x, float(miss @ miss), float(np.trace(inverse @ N))
