"""Set-up of a run: bodies, tables, start; and what a test stand adds: devices, a held chassis, a block on chains."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rollover.dynamics.assembly import tables_of
from rollover.dynamics.bodies import Body, bodies_of
from rollover.dynamics.equilibrium import Equilibrium
from rollover.dynamics.placement import Start, place
from rollover.dynamics.prescribed import first_angle, with_inputs
from rollover.kernels import stand_devices as d
from rollover.kernels.tables import E_FORCE_NOW, Tables
from rollover.scenario import Scenario
from rollover.spec.frames import matrices
from rollover.spec.inertia import MassProperties
from rollover.spec.initiation import Standing
from rollover.spec.inputs import TableAngle
from rollover.spec.stand import DIRECTION, Lashing, PendulumBlow, StaticTest, TiltTable
from rollover.spec.vehicle import Vehicle
from rollover.system.errors import Fault, InputError

Array = NDArray[np.float64]
TILT_STEP = math.radians(4.0)  # of the table, from one standing equilibrium to the next
CLEAR = 0.02  # m between the ground and a vehicle without wheels that is held


@dataclass(frozen=True, kw_only=True)
class Hinge:
    """A body turns about a world axis, 0 x or 1 y, through a point given about its centre of mass, body axes."""

    body: int
    point: tuple[float, float, float]
    axis: int


@dataclass(frozen=True, kw_only=True)
class Rig:
    """All that a run begins with."""

    bodies: tuple[Body, ...]
    tables: Tables
    start: Start
    held: tuple[int, ...] = ()  # bodies that cannot move
    hinges: tuple[Hinge, ...] = ()


def set_up(scenario: Scenario) -> Rig:
    """Bodies, tables and start of a run. Raises ``ValueError`` for a start that does not exist."""
    rig = _put_down(scenario)
    return replace(rig, tables=with_inputs(scenario, rig.bodies, rig.tables))


def _put_down(scenario: Scenario) -> Rig:
    bodies = bodies_of(scenario.vehicle, scenario.ground.elements, scenario.effects)
    t = tables_of(scenario, bodies)
    begin = scenario.initiation
    if isinstance(begin, StaticTest):
        t = with_devices(t, 1)
        held = tuple(b for b, body in enumerate(bodies) if body.name == "chassis")
        return Rig(bodies=bodies, tables=t, start=_held(scenario, bodies, t), held=held)
    if isinstance(begin, PendulumBlow):
        return _pendulum(scenario, begin, bodies)
    if isinstance(begin, TiltTable):
        t = with_devices(t, 1)
        f = t.device_f[0]
        t.device_i[0, d.D_KIND] = d.TILT
        f[d.D_WAY : d.D_WAY + 3] = 0.0, 1.0, 0.0
        f[d.D_START], f[d.D_RATE] = math.radians(begin.from_deg), math.radians(begin.rate_deg)
        f[d.D_MOST], f[d.D_K] = math.radians(begin.to_deg), scenario.gravity
        if (given := first_angle(scenario.inputs, TableAngle)) is not None:
            f[d.D_START], f[d.D_RATE], f[d.D_MOST] = given, 0.0, math.inf
        return Rig(bodies=bodies, tables=t, start=_on_table(scenario, begin, bodies, t))
    if scenario.excitation is not None:
        t = with_devices(t, 1)
        t.device_f[0, d.D_WAY : d.D_WAY + 3] = 0.0, 0.0, -1.0
    return Rig(bodies=bodies, tables=t, start=place(scenario, bodies, t))


def with_devices(t: Tables, count: int) -> Tables:
    """The same tables with room for some devices, all of them off."""
    f = np.zeros((count, d.DEVICE_COLUMNS))
    f[:, d.D_MOST] = math.inf
    return t._replace(
        device_i=np.zeros((count, d.DEVICE_INTEGERS), dtype=np.int64),
        device_f=f,
        device_memory=np.zeros((count, d.DEVICE_MEMORY)),
        device_q=np.zeros((2 * d.ACCOUNTS, len(t.mass))),
    )


def _stood(scenario: Scenario, bodies: tuple[Body, ...], t: Tables, heading_deg: float = 0.0) -> Start:
    return place(replace(scenario, initiation=Standing(heading_deg=heading_deg)), bodies, t)


def _held(scenario: Scenario, bodies: tuple[Body, ...], t: Tables) -> Start:
    """On its wheels if it has them on both sides, else just above the ground."""
    assert isinstance(scenario.vehicle, Vehicle)
    sides = [w.centre[1] for w in scenario.vehicle.wheels]
    if len(sides) > 2 and min(sides) < 0.0 < max(sides):
        return _stood(scenario, bodies, t)
    lowest = min(float(p.position[:, 2].min()) for body in bodies for _, p in body.surfaces)
    q = np.concatenate([[*body.centre[:2], body.centre[2] - lowest + CLEAR, 0.0, 0.0, 0.0] for body in bodies])
    return Start(q=q, qd=np.zeros_like(q), time=0.0)


def _on_table(scenario: Scenario, tilt: TiltTable, bodies: tuple[Body, ...], t: Tables) -> Start:
    """Standing on the table at its first angle; tilted bit by bit, for beyond it stands a balance on two wheels."""
    first, f = t.device_f[0, d.D_START], t.device_f[0]
    f[d.D_START] = 0.0
    statics = Equilibrium(bodies, t, math.radians(tilt.heading_deg), scenario.gravity, np.zeros(3))
    u = statics.solve(statics.guess())
    for angle in np.linspace(0.0, first, 1 + math.ceil(first / TILT_STEP))[1:]:
        f[d.D_START] = angle
        u = statics.solve(u) if u is not None else None
    f[d.D_START] = first
    if u is None or not np.all(t.wheel_memory[:, E_FORCE_NOW] > 0.0):
        turned = [i for i in scenario.inputs if isinstance(i, TableAngle)]
        raise InputError(
            Fault(
                path=next((f"inputs.{i.name}.angle_deg" for i in turned), "initiation.from_deg"),
                message=f"not on all its wheels on a table so steep, got {math.degrees(first):g} deg; less",
            )
        )
    return Start(q=statics.coordinates(u), qd=np.zeros(6 * len(bodies)), time=0.0)


def world_point(start: Start, bodies: tuple[Body, ...], b: int, point: tuple[float, float, float]) -> Array:
    """World place of a point of body b that is given in vehicle axes, at the start."""
    R = matrices(start.q[None, 6 * b + 3 : 6 * b + 6])[0]
    return np.asarray(start.q[6 * b : 6 * b + 3] + R @ (np.array(point) - bodies[b].centre))


def _pendulum(scenario: Scenario, blow: PendulumBlow, bodies: tuple[Body, ...]) -> Rig:
    row = {body.name: b for b, body in enumerate(bodies)}
    alone = with_devices(tables_of(scenario, bodies), len(blow.lashings))
    start = _stood(scenario, bodies, alone)
    _lash(blow.lashings, row, bodies, start, alone, 0)
    if any(lashing.preload > 0.0 for lashing in blow.lashings):
        start = _stood(scenario, bodies, alone)
    hit = world_point(start, bodies, row["rops"], blow.point)
    way, up = np.array(DIRECTION[blow.come_from]), np.array([0.0, 0.0, 1.0])
    angle = math.radians(blow.chain_angle_deg)
    centre = hit - 0.5 * blow.depth * (math.cos(angle) * way - math.sin(angle) * up)
    length = (blow.pivot_height - centre[2]) / math.cos(angle)
    lifted = math.cos(angle) - blow.height / length
    if length < blow.face or lifted < 0.0:
        raise InputError(
            Fault(
                path="initiation.height",
                message=f"more than the chains allow, got {blow.height:g} m on {length:.2f} m of chain; "
                "less, or a higher pivot_height",
            )
        )
    release = math.acos(lifted)
    pivot = centre + length * (math.sin(angle) * way + math.cos(angle) * up)
    block = Body(name="pendulum", inertia=_cuboid(blow, way), surfaces=())
    together = (*bodies, block)
    t = with_devices(tables_of(scenario, together), 1 + len(blow.lashings))
    t.wheel_memory[:], t.mount_memory[:] = alone.wheel_memory, alone.mount_memory
    _lash(blow.lashings, row, bodies, start, t, 1)
    points = np.flatnonzero(t.point_body == row["rops"])
    t.device_i[0, : d.D_END + 1] = d.FACE, row["rops"], len(bodies), points[0], points[-1] + 1
    f = t.device_f[0]
    f[d.D_POINT : d.D_POINT + 3], f[d.D_WAY : d.D_WAY + 3] = 0.5 * blow.depth * way, way
    f[d.D_K], f[d.D_C], f[d.D_SIZE] = blow.contact_stiffness, blow.contact_damping, blow.face
    turn = release * np.cross(up, way)
    at = pivot - length * (math.sin(release) * way + math.cos(release) * up)
    hinge = Hinge(body=len(bodies), point=(0.0, 0.0, length), axis=1 if way[0] else 0)
    return Rig(
        bodies=together,
        tables=t,
        start=Start(q=np.concatenate([start.q, at, turn]), qd=np.concatenate([start.qd, np.zeros(6)]), time=start.time),
        hinges=(hinge,),
    )


def _cuboid(blow: PendulumBlow, way: Array) -> MassProperties:
    squares = np.where(way != 0.0, blow.depth**2, blow.face**2)
    i = blow.mass / 12.0 * (squares.sum() - squares)
    return MassProperties(
        mass=blow.mass, centre_of_mass=(0.0, 0.0, 0.0), inertia=(float(i[0]), float(i[1]), float(i[2]))
    )


def _lash(
    lashings: tuple[Lashing, ...], row: dict[str, int], bodies: tuple[Body, ...], start: Start, t: Tables, first: int
) -> None:
    for i, lashing in enumerate(lashings, first):
        if lashing.body not in row:
            message = f"no such body, got {lashing.body!r}, which the vehicle lacks; {' or '.join(row)}"
            raise InputError(Fault(path=f"initiation.lashings.{lashing.name}.body", message=message))
        b = row[lashing.body]
        anchor = world_point(start, bodies, row["chassis"], lashing.anchor)
        length = float(np.linalg.norm(world_point(start, bodies, b, lashing.point) - anchor))
        sense = -1.0 if lashing.strut else 1.0
        t.device_i[i, d.D_KIND], t.device_i[i, d.D_BODY] = d.ROPE, b
        f = t.device_f[i]
        f[d.D_POINT : d.D_POINT + 3] = np.array(lashing.point) - bodies[b].centre
        f[d.D_WAY : d.D_WAY + 3], f[d.D_SENSE] = anchor, sense
        f[d.D_START] = length - sense * lashing.preload / lashing.stiffness
        f[d.D_K], f[d.D_C] = lashing.stiffness, lashing.damping
        t.device_memory[i, d.K_ALONG] = length
