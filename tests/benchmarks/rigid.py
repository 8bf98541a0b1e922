"""MuJoCo's yardstick: the same tractor as a rigid set of geoms that falls on a plane, or on a field of as many cells.

Two forms of it: its own boxes and cylinders, or 200 spheres on its outline, which are quicker to find contacts of.

What is the same: masses, inertias, start pose and velocity, outline, ROPS members, tyre treads, gravity, step, the
rectangle and its number of cells, friction coefficients. What differs: the ground is rigid and flat (MuJoCo's soft
constraints instead of Ye's soil), the front axle is locked where it starts, the ROPS is welded on, tyres are rigid
cylinders up to their shoulders, and side walls are the ends of these. It measures cost, not motion.
"""

from __future__ import annotations

import math
import time as clock
from dataclasses import dataclass
from typing import Any, Literal

import mujoco
import numpy as np
from numpy.typing import NDArray

from rollover.dynamics.bodies import Body
from rollover.dynamics.placement import Start
from rollover.scenario import Scenario
from rollover.spec.frames import matrices
from rollover.spec.shapes import Box, Disc, Tube
from rollover.spec.vehicle import Striker
from tests.benchmarks.limit import caught

Array = NDArray[np.float64]
Form = Literal["shapes", "spheres"]
Ground = Literal["field", "plane"]
SPHERES, AROUND, SMALL = 200, 24, 0.03  # in all, of them around each tyre; radius, m


@dataclass(frozen=True, kw_only=True)
class Fall:
    """What MuJoCo took: CPU seconds per simulated second, how far it got (s) and if to the end; roll there (rad)."""

    cost: float
    reached: float
    whole: bool
    roll: float
    place: tuple[float, float, float]  # of the chassis' centre of mass at the end, m


def text(values: Any) -> str:
    return " ".join(f"{v:.12g}" for v in np.asarray(values, dtype=float).ravel())


def geom(shape: Box | Tube | Disc, centre: Array, friction: float) -> str:
    """A geom about a body's centre of mass."""
    if isinstance(shape, Box):
        low, high = np.array(shape.low), np.array(shape.high)
        kind = f'type="box" pos="{text(0.5 * (low + high) - centre)}" size="{text(0.5 * (high - low))}"'
    elif isinstance(shape, Tube):
        ends = np.array(shape.start) - centre, np.array(shape.end) - centre
        kind = f'type="cylinder" fromto="{text(ends)}" size="{0.5 * shape.diameter:.12g}"'
    else:
        raise TypeError("a disc of its own has no geom")
    return f'<geom {kind} friction="{friction:.6g}"/>'


def spheres(count: int, points: Array, friction: float) -> list[str]:
    """So many of the contact points of a body (n, 3), about its centre of mass, as small spheres."""
    chosen = points[np.unique(np.linspace(0, len(points) - 1, min(count, len(points))).astype(int))]
    return [f'<geom type="sphere" pos="{text(p)}" size="{SMALL}" friction="{friction:.6g}"/>' for p in chosen]


def model_text(
    scenario: Scenario, bodies: tuple[Body, ...], start: Start, form: Form = "shapes", ground: Ground = "field"
) -> str:
    """MJCF of the scenario's vehicle at its start and of its ground."""
    vehicle = scenario.vehicle
    assert not isinstance(vehicle, Striker)
    q = start.q.reshape(-1, 6)
    R = matrices(q[:, 3:])
    geoms: dict[str, list[str]] = {body.name: [] for body in bodies}
    mu = scenario.ground.friction.coefficient
    row = {body.name: b for b, body in enumerate(bodies)}
    lift = -math.inf
    if form == "spheres":
        # points of an outline are those of the product, which has some hundred times as many of them
        points = [
            np.concatenate([p.position for _, p in b.surfaces]) if b.surfaces else np.zeros((0, 3)) for b in bodies
        ]
        share = (SPHERES - AROUND * len(vehicle.wheels)) / sum(len(p) for p in points)
        for body, own in zip(bodies, points, strict=True):
            geoms[body.name] += spheres(round(share * len(own)), own - body.centre, mu)
    for shape in vehicle.outline if form == "shapes" else ():
        geoms["chassis"].append(geom(shape, bodies[0].centre, mu))
    if vehicle.rops is not None and form == "shapes":
        for shape in vehicle.rops.members:
            geoms["rops"].append(geom(shape, bodies[row["rops"]].centre, mu))
    for wheel in vehicle.wheels:
        b = row[wheel.carrier]
        x, half, radius = np.array(wheel.centre), 0.5 * wheel.tyre.width, wheel.tyre.radius - wheel.tyre.crown
        y = np.array([0.0, half, 0.0])
        tread = Tube(name=wheel.name, start=tuple(x - y), end=tuple(x + y), diameter=2.0 * radius)
        if form == "shapes":
            geoms[wheel.carrier].append(geom(tread, bodies[b].centre, wheel.tyre.friction))
        else:
            turn = np.linspace(0.0, 2.0 * math.pi, AROUND, endpoint=False)
            side = half * np.where(np.arange(AROUND) % 2, 1.0, -1.0)  # left and right shoulder in turn
            ring = np.stack([(radius - SMALL) * np.cos(turn), side, (radius - SMALL) * np.sin(turn)], axis=1)
            geoms[wheel.carrier] += spheres(AROUND, x - bodies[b].centre + ring, wheel.tyre.friction)
        centre, lean = q[b, :3] + R[b] @ (x - bodies[b].centre), abs(R[b][2, 1])
        lift = max(lift, radius * math.sqrt(1.0 - lean * lean) + half * lean - centre[2])

    def opened(b: int, body: Body, joint: str) -> str:
        p, turn = q[b, :3] + [0.0, 0.0, lift], R[b]
        if b > 0:
            p, turn = R[0].T @ (q[b, :3] - q[0, :3]), R[0].T @ R[b]
        w = rotation_wxyz(turn)
        J = body.tensor
        full = text([J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2]])
        inertial = f'<inertial pos="0 0 0" mass="{body.inertia.mass:.12g}" fullinertia="{full}"/>'
        return f'<body pos="{text(p)}" quat="{text(w)}">{joint}{inertial}{"".join(geoms[body.name])}'

    nx, ny = scenario.ground.elements.count
    elements = scenario.ground.elements
    size = text([0.5 * nx * elements.spacing[0], 0.5 * ny * elements.spacing[1], 1.0, 0.1])
    at = text([*elements.centre, 0.0])
    field = f'<geom type="hfield" hfield="ground" pos="{at}" friction="{mu:.6g}"/>'
    flat = f'<geom type="plane" size="0 0 1" friction="{mu:.6g}"/>'
    nested = "".join(opened(b, body, "") + "</body>" for b, body in enumerate(bodies) if b > 0)
    return f"""<mujoco>
  <option timestep="{scenario.simulation.step:.12g}" gravity="0 0 {-scenario.gravity:.12g}"/>
  <size memory="256M"/>
  <asset><hfield name="ground" nrow="{max(ny, 2)}" ncol="{max(nx, 2)}" size="{size}"/></asset>
  <worldbody>
    {field if ground == "field" else flat}
    {opened(0, bodies[0], "<freejoint/>")}{nested}</body>
  </worldbody>
</mujoco>"""


def rotation_wxyz(R: Array) -> Array:
    """Unit quaternion, scalar first."""
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(R).ravel())
    return quaternion


def fall(scenario: Scenario, budget: float = 20.0, form: Form = "shapes", ground: Ground = "field") -> Fall:
    """Let MuJoCo simulate the scenario's duration, or as much of it as fits the budget of CPU seconds."""
    given = caught(scenario)
    model = mujoco.MjModel.from_xml_string(model_text(scenario, given["bodies"], given["start"], form, ground))
    data = mujoco.MjData(model)
    data.qvel[:6] = given["start"].qd[:6]  # world velocity, angular velocity in body axes, as ours
    steps = round(scenario.simulation.duration / scenario.simulation.step)
    began, done = clock.process_time(), 0
    while done < steps and clock.process_time() - began < budget:
        chunk = min(20, steps - done)
        mujoco.mj_step(model, data, nstep=chunk)
        done += chunk
    taken = clock.process_time() - began
    w, x, y, z = data.qpos[3:7]
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    reached = done * scenario.simulation.step
    return Fall(cost=taken / reached, reached=reached, whole=done == steps, roll=roll, place=tuple(data.xipos[1]))
