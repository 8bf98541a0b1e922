"""Where and how fast the bodies are when a run begins, from the scenario's initiation."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ground.relief import element_plane
from ground.surface import Surface, height, is_flat
from rollover.dynamics.bodies import Body
from rollover.dynamics.equilibrium import Equilibrium, tread_point
from rollover.dynamics.posture import ROLL
from rollover.dynamics.support import closed_form
from rollover.kernels.forces import generalised_forces
from rollover.kernels.step import stand
from rollover.kernels.tables import W_RADIUS, Tables, handle
from rollover.kernels.terms import fall_back
from rollover.scenario import Scenario
from rollover.spec.frames import from_angles, from_quaternion, rotation_vector
from rollover.spec.initiation import Driving, Drop, Release, Standing, Throw, TipOver
from rollover.spec.vehicle import Striker, Vehicle, laden
from rollover.system.errors import Fault, InputError

Array = NDArray[np.float64]


REST = (
    "there is no static balance on this surface, neither on four wheels nor on two: the vehicle was let go from rest "
    "in the pose it would stand in, without initiation.excess_deg"
)


@dataclass(frozen=True, kw_only=True)
class Start:
    """Generalised coordinates and velocities, (6 nb,) each, the time at which they hold, and a note on the start."""

    q: Array
    qd: Array
    time: float
    note: str = ""  # what a reader of the run has to know of how it began


def place(scenario: Scenario, bodies: tuple[Body, ...], t: Tables) -> Start:
    """Begin the scenario. Raises ``ValueError`` where no such start exists, with the reason."""
    initiation = scenario.initiation
    if isinstance(initiation, Drop):
        return _dropped(initiation, scenario, bodies, t)
    if isinstance(initiation, Release):
        return _released(initiation, scenario, bodies, t)
    if isinstance(initiation, Throw):
        return _thrown(initiation, scenario, bodies, t)
    assert isinstance(scenario.vehicle, Vehicle)
    if isinstance(initiation, Driving):
        return _driving(initiation, scenario, bodies, t)
    if isinstance(initiation, TipOver):
        return _tipped(initiation, scenario, scenario.vehicle, bodies, t)
    assert isinstance(initiation, Standing)  # test stands put the vehicle down themselves
    return _standing(initiation, scenario, bodies, t)


def _dropped(drop: Drop, scenario: Scenario, bodies: tuple[Body, ...], t: Tables) -> Start:
    R = from_angles(math.radians(drop.roll_deg), math.radians(drop.pitch_deg), math.radians(drop.yaw_deg))
    at = np.array([*drop.position, 0.0])
    q = _rigid(bodies, at, R)
    lowest = _deepest(bodies, t, R, scenario.ground.surface, at)
    # first contact at t = 0, a hair's breadth below the surface so that it is found there
    rise, speed = _fallen(scenario, bodies, drop, lowest)
    rise -= 1e-9
    q[2::6] += rise
    kernels = handle(t)
    generalised_forces(kernels, q, np.zeros_like(q), np.zeros_like(q))
    stand(kernels)
    qd = np.zeros(6 * len(bodies))
    qd[2::6] = -speed
    return Start(q=q, qd=qd, time=-drop.lead_time)


def _released(release: Release, scenario: Scenario, bodies: tuple[Body, ...], t: Tables) -> Start:
    origin, upright = np.zeros(3), np.eye(3)
    q, qd = _rigid(bodies, origin, upright), np.zeros(6 * len(bodies))
    q[2::6] += _deepest(bodies, t, upright, scenario.ground.surface, origin) + release.height
    qd[2::6] = -release.speed
    kernels = handle(t)
    generalised_forces(kernels, q, qd, np.zeros_like(q))
    stand(kernels)
    return Start(q=q, qd=qd, time=0.0)


def _thrown(throw: Throw, scenario: Scenario, bodies: tuple[Body, ...], t: Tables) -> Start:
    if throw.quaternion is not None:
        R = from_quaternion(throw.quaternion)
    else:
        R = from_angles(math.radians(throw.roll_deg), math.radians(throw.pitch_deg), math.radians(throw.yaw_deg))
    x, y, z = throw.position
    if z <= float(height(scenario.ground.surface, np.array(x), np.array(y))):
        raise InputError(
            Fault(path="initiation.position", message=f"the centre of mass is in the ground, got z = {z:g} m; higher")
        )
    q, qd = np.zeros(6), np.zeros(6)
    q[:3], q[3:] = throw.position, rotation_vector(R)
    qd[:3], qd[3:] = throw.velocity, throw.angular_velocity
    kernels = handle(t)
    generalised_forces(kernels, q, qd, np.zeros(6))
    return Start(q=q, qd=qd, time=0.0)


def _fallen(scenario: Scenario, bodies: tuple[Body, ...], drop: Drop, lowest: float) -> tuple[float, float]:
    """How far a drop begins above its place at first contact, and its downward speed there; `lowest` is added."""
    guide, air = scenario.effects.get("guide-friction"), scenario.effects.get("air-drag")
    brake, creep = 0.0, 0.0
    if guide is not None and isinstance(scenario.vehicle, Striker):
        brake, creep = guide.force, guide.creep
    drag, critical, ratio = (air.factor, air.critical, air.crisis_ratio) if air is not None else (0.0, math.inf, 1.0)
    if brake == 0.0 and drag == 0.0:
        rise = lowest + drop.speed * drop.lead_time - 0.5 * scenario.gravity * drop.lead_time**2
        return rise, drop.speed - scenario.gravity * drop.lead_time
    mass = sum(b.inertia.mass for b in bodies)
    depth, speed = fall_back(scenario.gravity, mass, brake, creep, drag, critical, ratio, drop.speed, drop.lead_time)
    return lowest - float(depth), float(speed)


def _deepest(bodies: tuple[Body, ...], t: Tables, R: Array, surface: Surface, at: Array) -> float:
    """How far the lowest contact point or tread edge lies below the surface, along z, with the origin at z = 0."""
    depth = -math.inf
    for body in bodies:
        for _, points in body.surfaces:
            x = points.position @ R.T + at
            ground = height(surface, x[:, 0], x[:, 1]) if is_flat(surface) else _element_heights(t, x)
            depth = max(depth, float(np.max(ground - x[:, 2])))
    for w in range(len(t.wheel_i)):
        x = tread_point(t, bodies, w, R) + at
        depth = max(depth, float(height(surface, x[0], x[1]) - x[2]))
    return depth


def _element_heights(t: Tables, x: Array) -> Array:
    """Heights of the elements' planes below or above points (n, 3), (n,)."""
    found, plane = np.empty(len(x)), np.empty(4)
    spacing = t.grid_f[2:]
    for k, corner in enumerate(t.grid_f[:2] + np.floor((x[:, :2] - t.grid_f[:2]) / spacing) * spacing):
        element_plane(t.relief, t.nodes, corner[0], corner[1], spacing[0], spacing[1], plane)
        found[k] = (plane[3] - plane[:2] @ x[k, :2]) / plane[2]
    return found


def _base(
    scenario: Scenario, bodies: tuple[Body, ...], t: Tables, position: tuple[float, float], heading: float
) -> Array:
    """Where the vehicle's origin is put down, (3,); on uneven ground `t.plane` becomes that under its wheels."""
    surface, at = scenario.ground.surface, np.array(position)
    if is_flat(surface):
        return np.array([*at, float(height(surface, at[0], at[1]))])
    turn = from_angles(0.0, 0.0, heading)[:2, :2]
    hubs = np.array([bodies[int(b)].centre[:2] for b in t.wheel_i]).reshape(-1, 2) + t.wheel_f[:, :2]
    under = hubs @ turn.T + at
    z = height(surface, under[:, 0], under[:, 1])
    fit = np.linalg.lstsq(np.column_stack([under - at, np.ones(len(under))]), z, rcond=None)[0]
    n = np.array([-fit[0], -fit[1], 1.0]) / math.sqrt(1.0 + fit[0] ** 2 + fit[1] ** 2)
    base = np.array([*at, fit[2]])
    t.plane[:] = [*n, n @ base]
    return base


def _rigid(bodies: tuple[Body, ...], origin: Array, R: Array) -> Array:
    """Coordinates of all bodies moved as one: vehicle origin and R_WV."""
    return np.concatenate([np.concatenate([origin + R @ body.centre, rotation_vector(R)]) for body in bodies])


def _standing(standing: Standing, scenario: Scenario, bodies: tuple[Body, ...], t: Tables) -> Start:
    statics, u = _stood(standing, scenario, bodies, t)
    return Start(q=statics.coordinates(u), qd=statics.rates(u, standing.roll_rate), time=0.0)


def _stood(
    start: Standing | Driving, scenario: Scenario, bodies: tuple[Body, ...], t: Tables
) -> tuple[Equilibrium, Array]:
    heading = math.radians(start.heading_deg)
    base = _base(scenario, bodies, t, start.position, heading)
    statics = Equilibrium(bodies, t, heading, scenario.gravity, base)
    u = statics.solve(statics.guess()) if len(t.wheel_i) else None
    if u is None:
        why, cure = _why_not(scenario, t, heading)
        raise InputError(
            Fault(path="initiation", message=f"the vehicle does not stand on this surface, got {why}; {cure}")
        )
    return statics, statics.seated(u)


def _why_not(scenario: Scenario, t: Tables, heading: float) -> tuple[str, str]:
    """Why a vehicle does not stand, and what lets it: by the support of a rigid one on the plane under its wheels."""
    assert isinstance(scenario.vehicle, Vehicle)
    if scenario.vehicle.trailer is not None:
        return "no static equilibrium with its trailer", "a gentler ground.surface, another heading, or 'drop'"
    x, y, z = (float(c) for c in t.plane[:3])  # the normal leans downhill
    least = closed_form(scenario.vehicle, math.pi - math.atan2(y, x) + heading).rigid
    slope = math.acos(min(z, 1.0))
    if least == 0.0:
        centre = ", ".join(f"{c:.3g}" for c in laden(scenario.vehicle).centre_of_mass)
        return f"its centre of mass [{centre}] m outside the feet of its wheels", "another place of it or of a wheel"
    if least < slope:
        steep = f"ground of {math.degrees(slope):.3g} deg, which it turns over on from {math.degrees(least):.3g} deg"
        return steep, "a gentler ground.surface, another heading, or 'drop'"
    if not is_flat(scenario.ground.surface):
        return "no static equilibrium, as where a wheel stands on an edge", "another initiation.position, or 'drop'"
    return "no static equilibrium", "'drop' or 'tip-over'"


def _driving(driving: Driving, scenario: Scenario, bodies: tuple[Body, ...], t: Tables) -> Start:
    """At its static equilibrium, all of it moving forward, each wheel turning as its tread rolls."""
    statics, u = _stood(driving, scenario, bodies, t)
    turning = t.spin_i >= 0
    rates = driving.speed / t.wheel_f[turning, W_RADIUS]
    q = np.concatenate([statics.coordinates(u), np.zeros(len(rates))])
    return Start(q=q, qd=np.concatenate([statics.forward(u, driving.speed, driving.sideways), rates]), time=0.0)


def _beyond(statics: Equilibrium, balance: Array | None, sign: float, excess_deg: float) -> Array | None:
    """The pose so far beyond a balance; None without one, and where it would roll back: then it was no balance."""
    if balance is None or excess_deg == 0.0:
        return balance
    u = balance.copy()
    u[ROLL] += sign * math.radians(excess_deg)
    found = statics.solve(u, fixed=(ROLL,))
    return found if found is not None and statics.tips(found, sign) else None


def _tipped(tip: TipOver, scenario: Scenario, vehicle: Vehicle, bodies: tuple[Body, ...], t: Tables) -> Start:
    if not vehicle.wheels:
        raise InputError(
            Fault(
                path="initiation.kind", message="needs a vehicle with wheels, got 'tip-over' without; 'drop' suits it"
            )
        )
    sign = -1.0 if tip.side == "left" else 1.0  # roll > 0 lowers the right side
    base = _base(scenario, bodies, t, tip.position, math.radians(tip.heading_deg))
    statics = Equilibrium(bodies, t, math.radians(tip.heading_deg), scenario.gravity, base)
    swing = vehicle.front_axle.swing if vehicle.front_axle is not None else 0.0
    u = statics.balance(sign, swing)
    if u is None and statics.tilt(sign) > 0.0 and statics.solve(statics.guess()) is None:
        held = statics.held()  # steeper than it can stand: there is nothing to tip it over, it only has to be let go
        if held is not None:
            return Start(q=statics.coordinates(held), qd=statics.rates(held, sign * tip.roll_rate), time=0.0, note=REST)
    u = _beyond(statics, u, sign, tip.excess_deg)
    if u is None:
        u = _beyond(statics, statics.outermost(sign, swing), sign, tip.excess_deg)
    if u is None and statics.overturns:
        slope = math.degrees(math.acos(float(t.plane[2])))
        raise InputError(
            Fault(
                path="initiation",
                message=f"falls over to the {tip.side} before any balance on two wheels, got ground of "
                f"{slope:.3g} deg; a gentler ground.surface, or the other side",
            )
        )
    if u is None:
        raise InputError(
            Fault(
                path="initiation",
                message=f"no balance on two wheels was found on this surface, got side {tip.side!r}; "
                "side or heading_deg so that it falls downhill, a flatter surface, or another initiation.kind, such as "
                "driving over the edge",
            )
        )
    u = statics.seated(u, fixed=(ROLL,))
    return Start(q=statics.coordinates(u), qd=statics.rates(u, sign * tip.roll_rate), time=0.0)
