"""What a run remembers: one row of raw state for each output step, turned into channels when it is over."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ground.compiled import compiled
from ground.kernel import AREA, CELL, LINE_Z, SINKAGE
from rollover import tables as c
from rollover.contact import Body
from rollover.frames import angles, matrices
from rollover.scenario import Scenario
from rollover.step import kinetic_of_soil
from rollover.tables import (
    ACTIVE,
    E_FORCE,
    E_FRICTION,
    E_NORMAL,
    E_WHERE,
    FLAGS_NOW,
    M_ANGLE,
    RESULTANT_COLUMNS,
    S_FORCE_NOW,
    WORKS,
    Handle,
    Tables,
)
from rollover.vehicle import Striker

Array = NDArray[np.float64]


@compiled
def write_row(t: Any, q: Any, qd: Any, qdd: Any, row: Any) -> None:
    """State, contact resultants, wheel and mount forces, axle angle, work, soil's kinetic energy, sinkage, flags."""
    n, nb = q.size, t.pose.shape[0]
    for j in range(n):
        row[j], row[n + j], row[2 * n + j] = q[j], qd[j], qdd[j]
    k = 3 * n
    for b in range(nb):
        for j in range(RESULTANT_COLUMNS):
            row[k] = t.resultant[b, j]
            k += 1
    for w in range(t.wheel_i.size):
        g = t.wheel_memory[w]
        row[k] = g[E_FORCE]
        for j in range(3):
            row[k + 1 + j] = g[E_FRICTION + j]
            row[k + 4 + j] = g[E_WHERE + j]
            row[k + 7 + j] = g[E_NORMAL + j]
        k += 10
    for i in range(t.mount_f.shape[0]):
        for j in range(3):
            row[k] = t.mount_memory[i, S_FORCE_NOW + j]
            k += 1
    row[k] = t.axle_memory[M_ANGLE]
    k += 1
    for j in range(WORKS):
        row[k] = t.work[j]
        k += 1
    row[k] = kinetic_of_soil(t)
    deepest, footprint = 0.0, 0.0
    for a in range(t.counts[ACTIVE]):
        deepest = max(deepest, t.memory[t.active[a], SINKAGE])
        footprint += t.memory[t.active[a], AREA]
    row[k + 1] = deepest
    row[k + 2] = t.counts[FLAGS_NOW]
    row[k + 3] = footprint


def row_length(t: Tables) -> int:
    """Columns that `write_row` fills."""
    n = len(t.spin_mass)
    return int(3 * n + len(t.pose) * RESULTANT_COLUMNS + 10 * len(t.wheel_i) + 3 * len(t.mount_f) + 1 + WORKS + 1 + 3)


@dataclass
class History:
    """Buffers of a run in progress."""

    scenario: Scenario
    bodies: tuple[Body, ...]
    time: Array
    rows: Array
    count: int = 0
    track_time: list[float] = field(default_factory=list)
    track: list[Array] = field(default_factory=list)

    def add(self, time: float, t: Handle, q: Any, qd: Any, qdd: Any) -> None:
        """Write one row."""
        self.time[self.count] = time
        write_row(t, q, qd, qdd, self.rows[self.count])
        self.count += 1

    def add_track(self, time: float, t: Tables) -> None:
        """Keep the deepest sinkage of all touched elements at this instant."""
        n = int(t.counts[c.SLOTS])
        self.track_time.append(time)
        self.track.append(np.maximum(t.memory[:n, LINE_Z], t.memory[:n, SINKAGE]))

    def sinkage(self, t: Tables) -> tuple[Array, NDArray[np.int64], Array]:
        """Times (f,), elements (k,) and their sinkage (f, k), m."""
        n = int(t.counts[c.SLOTS])
        table = np.zeros((len(self.track), n))
        for i, values in enumerate(self.track):
            table[i, : len(values)] = values
        return np.array(self.track_time), t.state[:n, CELL].copy(), table


@dataclass(frozen=True)
class States:
    """Columns of the rows by meaning; arrays are (n, ...) with one row for each output step."""

    q: Array  # (n, nb, 6)
    qd: Array
    qdd: Array
    resultant: Array  # (n, nb, RESULTANT_COLUMNS)
    spin: Array  # (n, ns) rates of turning wheels
    wheels: Array  # (n, nw, 10): normal force, friction (3), place (3), normal of the ground (3)
    mounts: Array  # (n, nt, 3)
    axle: Array  # (n,)
    work: Array  # (n, WORKS)
    soil_kinetic: Array
    sinkage: Array
    flags: NDArray[np.int64]
    footprint: Array


def states(rows: Array, t: Tables) -> States:
    """Cut the rows into what they mean."""
    n, nb, ns = len(rows), len(t.pose), len(t.spin_mass) - len(t.mass)
    at = 0

    def take(*shape: int) -> Array:
        nonlocal at
        width = int(np.prod(shape)) if shape else 1
        part = rows[:, at : at + width].reshape(n, *shape)
        at += width
        return part

    q, _, qd, spin, qdd, _ = (take(*shape) for _ in range(3) for shape in ((nb, 6), (ns,)))
    return States(
        q=q,
        qd=qd,
        qdd=qdd,
        spin=spin,
        resultant=take(nb, RESULTANT_COLUMNS),
        wheels=take(len(t.wheel_i), 10),
        mounts=take(len(t.mount_f), 3),
        axle=take(),
        work=take(WORKS),
        soil_kinetic=take(),
        sinkage=take(),
        flags=take().astype(np.int64),
        footprint=take(),
    )


def energies(s: States, t: Tables, bodies: tuple[Body, ...], gravity: float) -> dict[str, Array]:
    """The ledger over time, J, each (n,): what the bodies hold and what was taken from them; `residual` is the rest.

    All of them, kinetic and potential to drive, less their sum at the start, are -residual.
    """
    n = len(s.axle)
    flat = s.qd.reshape(n, -1)
    kinetic = 0.5 * np.einsum("ni,ij,nj->n", flat, t.mass, flat) + s.soil_kinetic
    if s.spin.shape[1]:
        # I (spin + omega . e)^2/2 of the wheels that turn; t.mass is without them
        whole = np.concatenate([flat, s.spin], axis=1)
        kinetic += 0.5 * np.einsum("ni,ij,nj->n", whole, t.spin_mass, whole)
    masses = np.array([body.inertia.mass for body in bodies])
    potential = gravity * s.q[:, :, 2] @ masses
    ledger = {
        "kinetic": kinetic,
        "potential": potential - potential[0],
        "soil": s.work[:, c.SOIL],
        "tyre": s.work[:, c.TYRE],
        "rops": s.work[:, c.ROPS],
        "friction": s.work[:, c.FRICTION_WORK],
        "collision": s.work[:, c.COLLISION],
        "axle": s.work[:, c.AXLE],
        "drive": s.work[:, c.DRIVE],
    }
    total = np.sum(list(ledger.values()), axis=0)
    ledger["residual"] = np.asarray(total[0] - total)
    return ledger


def channels(scenario: Scenario, s: States, t: Tables, bodies: tuple[Body, ...]) -> dict[str, Array]:
    """All channels of a run by their names, SI, each (n,)."""
    row = {body.name: b for b, body in enumerate(bodies)}
    n, uneven = t.plane[:3], len(t.relief) > 0
    normal = s.resultant[:, :, c.R_NORMAL : c.R_NORMAL + 3].sum(axis=1)
    tangent = s.resultant[:, :, c.R_TANGENT : c.R_TANGENT + 3].sum(axis=1)
    impulse = s.resultant[:, :, c.R_IMPULSE : c.R_IMPULSE + 3].sum(axis=1)
    found: dict[str, Array] = {
        "ground/force_normal": s.resultant[:, :, c.R_WEIGHT].sum(axis=1) if uneven else normal @ n,
        "ground/force_tangential": np.linalg.norm(tangent, axis=1),
        "ground/impulse_normal": np.linalg.norm(impulse, axis=1) if uneven else impulse @ n,
        "ground/sinkage": s.sinkage,
        "ground/contact_area": s.footprint,
    }
    if isinstance(scenario.vehicle, Striker):
        bottom = bodies[0].inertia.centre_of_mass[2]
        found["striker/position_z"] = s.q[:, 0, 2] - bottom
        found["striker/velocity_z"] = s.qd[:, 0, 2]
        found["striker/acceleration_z"] = s.qdd[:, 0, 2]
    else:
        found |= _chassis(s, row["chassis"])
    if "rops" in row:
        found |= _rops(scenario, s, bodies, row["chassis"], row["rops"])
    vehicle = scenario.vehicle
    if not isinstance(vehicle, Striker):
        for w, wheel in enumerate(vehicle.wheels):
            found[f"wheel/{wheel.name}/force_normal"] = s.wheels[:, w, 0]
            if t.spin_i[w] >= 0:
                found[f"wheel/{wheel.name}/spin"] = s.spin[:, t.spin_i[w] - len(t.mass)]
        if vehicle.front_axle is not None:
            found["axle/front/angle"] = s.axle
    for name, values in energies(s, t, bodies, scenario.gravity).items():
        found[f"energy/{name}"] = values
    return {name: np.ascontiguousarray(values) for name, values in found.items()}


def _chassis(s: States, b: int) -> dict[str, Array]:
    R = matrices(s.q[:, b, 3:])
    roll, pitch, yaw = angles(s.q[:, b, 3:])
    acceleration = np.einsum("nji,nj->ni", R, s.qdd[:, b, :3])
    found = {"chassis/roll": roll, "chassis/pitch": pitch, "chassis/yaw": yaw}
    for k, axis in enumerate("xyz"):
        found[f"chassis/position_{axis}"] = s.q[:, b, k]
        found[f"chassis/velocity_{axis}"] = s.qd[:, b, k]
        found[f"chassis/angular_velocity_{axis}"] = s.qd[:, b, 3 + k]
        found[f"chassis/acceleration_{axis}"] = acceleration[:, k]
    return found


def _rops(scenario: Scenario, s: States, bodies: tuple[Body, ...], chassis: int, b: int) -> dict[str, Array]:
    vehicle = scenario.vehicle
    assert not isinstance(vehicle, Striker)
    assert vehicle.rops is not None
    R = matrices(s.q[:, chassis, 3:])
    world = s.resultant[:, b, c.R_NORMAL : c.R_NORMAL + 3] + s.resultant[:, b, c.R_TANGENT : c.R_TANGENT + 3]
    force = np.einsum("nji,nj->ni", R, world)
    found = {"rops/force": np.linalg.norm(world, axis=1)}
    for k, axis in enumerate("xyz"):
        found[f"rops/force_{axis}"] = force[:, k]
        for m, mount in enumerate(vehicle.rops.mounts):
            found[f"rops/mount/{mount.name}/force_{axis}"] = s.mounts[:, m, k]
    found["rops/impulse"] = np.linalg.norm(s.resultant[:, b, c.R_IMPULSE : c.R_IMPULSE + 3], axis=1)
    found["rops/deflection"] = corner_deflection(vehicle.rops.corner, s, bodies, chassis, b)
    found["rops/energy"] = s.work[:, c.ROPS]
    return found


def corner_deflection(
    corner: tuple[float, float, float], s: States, bodies: tuple[Body, ...], chassis: int, b: int
) -> Array:
    """Way of the more deflected upper corner against the chassis, m, (n,)."""
    R, R_rops = matrices(s.q[:, chassis, 3:]), matrices(s.q[:, b, 3:])
    ways = []
    for sign in (1.0, -1.0):
        place = np.array([corner[0], sign * corner[1], corner[2]])
        world = s.q[:, b, :3] + R_rops @ (place - bodies[b].centre)
        local = np.einsum("nji,nj->ni", R, world - s.q[:, chassis, :3])
        ways.append(np.linalg.norm(local - (place - bodies[chassis].centre), axis=1))
    return np.asarray(np.max(ways, axis=0))
