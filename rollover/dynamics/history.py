"""What a run remembers: one row of raw state for each output step, turned into channels when it is over."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ground.kernel import CELL, LINE_Z, ROW, SINKAGE
from rollover.dynamics import occupant
from rollover.dynamics.bodies import Body
from rollover.dynamics.links import link_channels
from rollover.dynamics.prescribed import ground_acceleration, quantity, steered_kinetic
from rollover.kernels import tables as c
from rollover.kernels.posts import RECORDED
from rollover.kernels.tables import OUT_COLUMNS, RESULTANT_COLUMNS, WORKS, Tables
from rollover.kernels.time_loop import ROWS, Watch
from rollover.scenario import Scenario
from rollover.spec.frames import angles, matrices, quaternions
from rollover.spec.inputs import Shake
from rollover.spec.rops import Rops
from rollover.spec.vehicle import Striker, Vehicle

Array = NDArray[np.float64]


def row_length(t: Tables) -> int:
    """Columns that `rollover.kernels.record.write_row` fills."""
    n = len(t.spin_mass)
    out = OUT_COLUMNS if len(t.device_i) else 0
    parts = len(t.pose) * RESULTANT_COLUMNS + 10 * len(t.wheel_i) + 12 * len(t.mount_f)
    return int(3 * n + parts + 2 + WORKS + 1 + 3 + len(t.input_i) + len(t.link_out) + RECORDED * len(t.post_f) + out)


@dataclass
class History:
    """Buffers of a run in progress."""

    scenario: Scenario
    bodies: tuple[Body, ...]
    watch: Watch
    start: float  # s, the scenario's time at which the solver's is zero
    track_time: list[float] = field(default_factory=list)
    track: list[Array] = field(default_factory=list)

    @property
    def rows(self) -> Array:
        """Rows so far, the first one at least."""
        return np.asarray(self.watch.rows[: max(int(self.watch.whole[ROWS]), 1)])

    @property
    def time(self) -> Array:
        """Their times, s: those of the steps are sums, 0.6 and not 0.5999999999999643."""
        count = int(self.watch.whole[ROWS])
        return np.rint((self.start + self.watch.time[:count]) * 1e9) / 1e9 if count else np.zeros(1)

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
        kept = t.soil[t.state[:n, ROW], c.MEMORYLESS] == 0.0  # the others go along with the body
        return np.array(self.track_time), t.state[:n, CELL][kept], table[:, kept]


@dataclass(frozen=True)
class States:
    """Columns of the rows by meaning; arrays are (n, ...) with one row for each output step."""

    q: Array  # (n, nb, 6)
    qd: Array
    qdd: Array
    resultant: Array  # (n, nb, RESULTANT_COLUMNS)
    spin: Array  # (n, ns) rates of turning wheels
    wheels: Array  # (n, nw, 10): normal force, friction (3), place (3), normal of the ground (3)
    mounts: Array  # (n, nt, 12): force and moment on body b, deflection and turn, all in body a's axes
    axle: Array  # (n, 2): angle, impulse of the stop
    work: Array  # (n, WORKS)
    soil_kinetic: Array
    sinkage: Array
    flags: NDArray[np.int64]
    footprint: Array
    prescribed: Array  # (n, ni) what the inputs were
    links: Array  # (n, no) of an occupant, a hitch and struts, see rollover.dynamics.links
    posts: Array  # (n, np, RECORDED) of posts that bend: plastic way of the head, plastic work, use
    device: Array  # (n, OUT_COLUMNS), or (n, 0) without a test stand


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
        mounts=take(len(t.mount_f), 12),
        axle=take(2),
        work=take(WORKS),
        soil_kinetic=take(),
        sinkage=take(),
        flags=take().astype(np.int64),
        footprint=take(),
        prescribed=take(len(t.input_i)),
        links=take(len(t.link_out)),
        posts=take(len(t.post_f), RECORDED),
        device=rows[:, at:],
    )


def energies(s: States, t: Tables, bodies: tuple[Body, ...], gravity: float) -> dict[str, Array]:
    """The ledger over time, J, each (n,): what the bodies hold and what was taken from them; `residual` is the rest.

    All of them, kinetic and potential to drive, less their sum at the start, are -residual; on a test stand also what
    its devices and lashings took, less than zero for what they put in.
    """
    n = len(s.axle)
    flat = s.qd.reshape(n, -1)
    kinetic = 0.5 * np.einsum("ni,ij,nj->n", flat, t.mass, flat) + s.soil_kinetic
    if s.spin.shape[1]:
        # I (spin + omega . e)^2/2 of the wheels that turn; t.mass is without them
        whole = np.concatenate([flat, s.spin], axis=1)
        kinetic += 0.5 * np.einsum("ni,ij,nj->n", whole, t.spin_mass, whole)
        if len(t.input_i):
            kinetic += steered_kinetic(t, s.prescribed, s.qd, s.spin)
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
        "effects": s.work[:, c.EXTRA_WORK],
        "drive": s.work[:, c.DRIVE],
    }
    if len(t.device_i):
        ledger["device"] = s.work[:, c.DEVICE]
        ledger["lashing"] = s.work[:, c.LASHING]
    for name, account in (("occupant", c.OCCUPANT), ("hitch", c.HITCH), ("suspension", c.SUSPENSION)):
        if (t.link_i[:, 4] == account).any():
            ledger[name] = s.work[:, account]
    if len(t.input_i):
        ledger["input"] = s.work[:, c.INPUT]
    total = np.sum(list(ledger.values()), axis=0)
    ledger["residual"] = np.asarray(total[0] - total)
    return ledger


def over_bodies(values: Array) -> Array:
    """Sum over the second of (n, nb, ...); the library's own costs three times as much along so short an axis."""
    total = values[:, 0].copy()
    for b in range(1, values.shape[1]):
        total += values[:, b]
    return total


def channels(scenario: Scenario, time: Array, s: States, t: Tables, bodies: tuple[Body, ...]) -> dict[str, Array]:
    """All channels of a run by their names, SI, each (n,)."""
    if any(isinstance(one, Shake) for one in scenario.inputs):
        # the run's own are against the ground
        qdd = s.qdd.copy()
        qdd[:, :, :3] += ground_acceleration(scenario.inputs, time)[:, None, :]
        s = replace(s, qdd=qdd)
    row = {body.name: b for b, body in enumerate(bodies)}
    n, uneven = t.plane[:3], len(t.relief) > 0
    normal = over_bodies(s.resultant[:, :, c.R_NORMAL : c.R_NORMAL + 3])
    tangent = over_bodies(s.resultant[:, :, c.R_TANGENT : c.R_TANGENT + 3])
    impulse = over_bodies(s.resultant[:, :, c.R_IMPULSE : c.R_IMPULSE + 3])
    found: dict[str, Array] = {
        "ground/force_normal": s.resultant[:, :, c.R_WEIGHT].sum(axis=1) if uneven else normal @ n,
        "ground/force_tangential": np.linalg.norm(tangent, axis=1),
        "ground/impulse_normal": np.linalg.norm(impulse, axis=1) if uneven else impulse @ n,
        "ground/sinkage": s.sinkage,
        "ground/contact_area": s.footprint,
    }
    if isinstance(scenario.vehicle, Striker):
        body = len(bodies) - 1  # of one in two parts, the upper carries the instruments
        found["striker/position_z"] = s.q[:, body, 2] - bodies[body].centre[2]
        found["striker/velocity_z"] = s.qd[:, body, 2]
        found["striker/acceleration_z"] = s.qdd[:, body, 2]
    else:
        found |= _chassis(s, row["chassis"])
    if "rops" in row:
        found |= _rops(scenario, s, bodies, row)
    vehicle = scenario.vehicle
    if not isinstance(vehicle, Striker):
        for w, wheel in enumerate(vehicle.wheels):
            found[f"wheel/{wheel.name}/force_normal"] = s.wheels[:, w, 0]
            if t.spin_i[w] >= 0:
                found[f"wheel/{wheel.name}/spin"] = s.spin[:, t.spin_i[w] - len(t.mass)]
        if vehicle.front_axle is not None:
            found["axle/front/angle"] = s.axle[:, 0]
            if vehicle.front_axle.stop == "impact":
                found["axle/front/impulse"] = s.axle[:, 1]
    if isinstance(vehicle, Vehicle) and vehicle.occupant is not None:
        found |= occupant.channels(vehicle.occupant, s.links, s.q, s.qdd, s.resultant, row)
    if isinstance(vehicle, Vehicle):
        found |= link_channels(vehicle, s.links, s.q, bodies, row)
    for k, one in enumerate(scenario.inputs):
        found[f"input/{one.name}/{quantity(one)}"] = s.prescribed[:, k]
    for k, name in enumerate(("force", "deflection", "energy") if s.device.size else ()):
        found[f"device/{name}"] = s.device[:, k]
    for name, values in energies(s, t, bodies, scenario.gravity).items():
        found[f"energy/{name}"] = values
    return {name: np.ascontiguousarray(values) for name, values in found.items()}


def _chassis(s: States, b: int) -> dict[str, Array]:
    R = matrices(s.q[:, b, 3:])
    roll, pitch, yaw = angles(s.q[:, b, 3:])
    acceleration = np.einsum("nji,nj->ni", R, s.qdd[:, b, :3])
    found = {"chassis/roll": roll, "chassis/pitch": pitch, "chassis/yaw": yaw}
    attitude = quaternions(s.q[:, b, 3:])
    found |= {f"chassis/quaternion_{axis}": attitude[:, k] for k, axis in enumerate("xyzw")}
    for k, axis in enumerate("xyz"):
        found[f"chassis/position_{axis}"] = s.q[:, b, k]
        found[f"chassis/velocity_{axis}"] = s.qd[:, b, k]
        found[f"chassis/angular_velocity_{axis}"] = s.qd[:, b, 3 + k]
        found[f"chassis/acceleration_{axis}"] = acceleration[:, k]
    return found


def _rops(scenario: Scenario, s: States, bodies: tuple[Body, ...], row: dict[str, int]) -> dict[str, Array]:
    vehicle = scenario.vehicle
    assert not isinstance(vehicle, Striker)
    assert vehicle.rops is not None
    parts = [row[name] for name in vehicle.rops.parts]
    R = matrices(s.q[:, row["chassis"], 3:])
    resultant = over_bodies(s.resultant[:, parts])
    world = resultant[:, c.R_NORMAL : c.R_NORMAL + 3] + resultant[:, c.R_TANGENT : c.R_TANGENT + 3]
    force = np.einsum("nji,nj->ni", R, world)
    found = {"rops/force": np.linalg.norm(world, axis=1)}
    joined = [f"mount/{m.name}" for m in vehicle.rops.standing] + [f"hinge/{m.name}" for m in vehicle.rops.hinges]
    for k, axis in enumerate("xyz"):
        found[f"rops/force_{axis}"] = force[:, k]
        for m, name in enumerate(joined):
            found[f"rops/{name}/force_{axis}"] = s.mounts[:, m, k]
            found[f"rops/{name}/moment_{axis}"] = s.mounts[:, m, 3 + k]
            if name.startswith("hinge/"):
                found[f"rops/{name}/angle_{axis}"] = s.mounts[:, m, 9 + k]
    found["rops/impulse"] = np.linalg.norm(resultant[:, c.R_IMPULSE : c.R_IMPULSE + 3], axis=1)
    found["rops/deflection"] = corner_deflection(vehicle.rops, s, bodies, row["chassis"], parts)
    found["rops/energy"] = s.work[:, c.ROPS]
    for k, foot in enumerate(vehicle.rops.feet if s.posts.shape[1] else ()):
        for j, name in enumerate(("set", "plastic_work", "use")):
            found[f"rops/post/{foot.name}/{name}"] = s.posts[:, k, j]
    return found


def corner_deflection(rops: Rops, s: States, bodies: tuple[Body, ...], chassis: int, parts: list[int]) -> Array:
    """Way of the loaded upper corner against the chassis, m, (n,).

    Loaded is the corner closest to where the ground's force acts, or last acted; before any, the more deflected one.
    """
    R, R_rops, b = matrices(s.q[:, chassis, 3:]), matrices(s.q[:, parts[-1], 3:]), parts[-1]
    places = [np.array([x, sign * y, z]) for x, y, z in (rops.corner, *rops.other_corners) for sign in (1.0, -1.0)]
    ways, apart = [], []
    resultant = over_bodies(s.resultant[:, parts])
    weight = resultant[:, c.R_WEIGHT]
    loaded = np.flatnonzero(weight > 0.0)
    for place in places:
        world = s.q[:, b, :3] + R_rops @ (place - bodies[b].centre)
        local = np.einsum("nji,nj->ni", R, world - s.q[:, chassis, :3])
        ways.append(np.linalg.norm(local - (place - bodies[chassis].centre), axis=1))
        force_at = resultant[loaded, c.R_POINT : c.R_POINT + 3] / weight[loaded, None]
        apart.append(np.linalg.norm(world[loaded] - force_at, axis=1))
    ways_ = np.array(ways)
    if not len(loaded):
        return np.asarray(ways_.max(axis=0))
    # rows between two loaded ones belong to the earlier
    since = np.searchsorted(loaded, np.arange(len(weight)), side="right") - 1
    corner = np.argmin(apart, axis=0)[np.maximum(since, 0)]
    way = ways_[corner, np.arange(len(weight))]
    return np.asarray(np.where(since < 0, ways_.max(axis=0), way))
