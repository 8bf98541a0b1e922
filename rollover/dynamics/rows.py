"""Rows of the kernels' tables for what acts on the bodies beside the ground: terms, wheels, mounts, joints."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.dynamics.bodies import Body, loose
from rollover.dynamics.post_rows import heads
from rollover.dynamics.prescribed import first_angle
from rollover.effects.vehicle import TankSlosh
from rollover.kernels import tables as c
from rollover.kernels import terms
from rollover.scenario import Scenario
from rollover.spec.estimates import turning_inertia
from rollover.spec.initiation import Driving
from rollover.spec.inputs import Steering
from rollover.spec.vehicle import RigidBody, Striker, Vehicle, Wheel

Array = NDArray[np.float64]
Index = NDArray[np.int64]


def wheel_rows(wheels: tuple[Wheel, ...], bodies: tuple[Body, ...], row: dict[str, int]) -> Array:
    """A row for each wheel: where it stands on its carrier, its tyre."""
    wheel_f = np.zeros((len(wheels), c.WHEEL_COLUMNS))
    for w, wheel in enumerate(wheels):
        tyre = wheel.tyre
        centre = np.array(wheel.centre) - bodies[row[wheel.hub]].centre
        wheel_f[w] = [
            *centre,
            *(0.0, 1.0, 0.0),
            tyre.radius,
            0.5 * tyre.width,
            tyre.crown,
            tyre.vertical_stiffness,
            tyre.lateral_stiffness,
            tyre.vertical_damping,
            tyre.friction,
            float(wheel.rolls),
            math.inf if tyre.bottoming is None else tyre.bottoming * tyre.radius,
            tyre.bottoming_stiffness,
            0.0 if tyre.lying_stiffness is None else tyre.lying_stiffness / tyre.lateral_stiffness,
        ]
    return wheel_f


def term_rows(scenario: Scenario, bodies: tuple[Body, ...]) -> tuple[Index, Array]:
    """Rows for `rollover.kernels.terms`; forces on a striker in two parts go by their masses: it falls as one."""
    effects = scenario.effects
    rows: list[tuple[tuple[int, int, int], list[float]]] = []
    falling = range(len(bodies)) if isinstance(scenario.vehicle, Striker) else range(1)
    mass = sum(bodies[b].inertia.mass for b in falling)
    for b in falling:
        share = bodies[b].inertia.mass / mass
        if "guide-friction" in effects and isinstance(scenario.vehicle, Striker):
            guide = effects["guide-friction"]
            rows.append(((terms.GUIDE_BRAKE, b, b), [share * guide.force, guide.creep]))
        if "air-drag" in effects:
            air = effects["air-drag"]
            rows.append(((terms.AIR_DRAG, b, b), [share * air.factor, air.critical, air.crisis_ratio]))
    if "gyroscopic-rotor" in effects and not isinstance(scenario.vehicle, Striker):
        rows.append(((terms.ROTOR, 0, 0), list(effects["gyroscopic-rotor"].vector)))
    if "drive-torque" in effects and not isinstance(scenario.vehicle, Striker):
        rows.append(((terms.REACTION, 0, 0), [effects["drive-torque"].torque]))
    if not isinstance(scenario.vehicle, Striker):
        for b, body in enumerate(bodies):
            if body.name in loose(effects):
                rows.append(((terms.BED, 0, b), _bed(effects[body.name], body, bodies[0], scenario.gravity)))
    if isinstance(scenario.vehicle, Striker) and len(bodies) > 1:
        gives = effects["structural-compliance"]
        rows.append(((terms.BETWEEN, 0, 1), [gives.stiffness, gives.damping, 0.0]))
    f = np.zeros((len(rows), terms.TERM_NUMBERS))
    for i, (_, numbers) in enumerate(rows):
        f[i, : len(numbers)] = numbers
    return np.array([row for row, _ in rows], dtype=np.int64).reshape(-1, 3), f


BED_FREQUENCY = 200.0  # rad/s, of a load on its bed: it sags by a quarter of a millimetre


def _bed(effect: Any, body: Body, chassis: Body, gravity: float) -> list[float]:
    """Numbers of `terms.BED` for a mass that moves across the chassis."""
    m, j, w = body.inertia.mass, body.inertia.inertia[0], BED_FREQUENCY
    held = [*(body.centre - chassis.centre), m * w * w, 1.4 * m * w, j * w * w, 1.4 * j * w]
    if isinstance(effect, TankSlosh):
        slow = math.sqrt(gravity / effect.length)
        return [*held, m * slow * slow, 2.0 * effect.damping * m * slow, 0.0, math.inf]
    return [*held, 0.0, 0.0, effect.friction, effect.travel]


LOCK_STIFFNESS, LOCK_DAMPING = 1e5, 200.0  # N m/rad and N m s/rad of the shafts between the wheels of a locked axle


def turning_rows(scenario: Scenario, wheel_f: Array, first: int) -> tuple[Index, Array, Array]:
    """Coordinates and numbers of wheels that turn, and of their drive; steers the front wheels. None unless driving."""
    start, vehicle = scenario.initiation, scenario.vehicle
    spin_i, spin_f = np.full(len(wheel_f), -1, dtype=np.int64), np.zeros((len(wheel_f), c.SPIN_COLUMNS))
    drive = np.array([0.0, 1e9, 0.0, 0.0])
    if not isinstance(start, Driving) or not isinstance(vehicle, Vehicle):
        return spin_i, spin_f, drive
    steered = first_angle(scenario.inputs, Steering)
    steer = math.radians(start.steer_deg) if steered is None else steered
    for w, wheel in enumerate(vehicle.wheels):
        spin_i[w] = first + w
        spin_f[w] = [
            turning_inertia(vehicle, wheel),
            (start.brake.torque or 0.0) if start.brake and vehicle.on_axle(wheel, start.brake.axle) else 0.0,
            float(start.drive is not None and vehicle.on_axle(wheel, start.drive.axle)),
            float(start.brake is not None and start.brake.against == "ground"),
            float(start.brake is not None and vehicle.on_axle(wheel, start.brake.axle)),
            float(steered is not None and vehicle.on_axle(wheel, "front")),
        ]
        wheel_f[w, c.W_ROLLS] = 0.0
        if vehicle.on_axle(wheel, "front"):
            wheel_f[w, c.W_AXIS : c.W_AXIS + 3] = [-math.sin(steer), math.cos(steer), 0.0]
    if start.drive is not None:
        drive[c.D_RATE] = start.drive.limit_rate or 1e9
        if start.drive.differential == "locked":
            drive[c.D_STIFFNESS], drive[c.D_DAMPING] = LOCK_STIFFNESS, LOCK_DAMPING
    return spin_i, spin_f, drive


def mount_rows(
    vehicle: Vehicle | RigidBody | Striker, bodies: tuple[Body, ...], row: dict[str, int]
) -> tuple[Array, Index]:
    """Numbers and bodies of the mounts and hinges of a ROPS."""
    if isinstance(vehicle, Striker) or vehicle.rops is None:
        return np.zeros((0, c.MOUNT_COLUMNS)), np.zeros((0, 3), dtype=np.int64)
    rows, pairs = list[list[float]](), list[list[int]]()
    bends = heads(vehicle.rops)
    for joint in vehicle.rops.joints:
        a, b, k = row[joint.below], row[joint.above], len(rows) - len(vehicle.rops.mounts)
        is_post = 0 <= k < len(bends)
        place = np.array(bends[k] if is_post else joint.connector.position)
        far = float(is_post or joint.connector.turns_far)
        rows.append([*(place - bodies[b].centre), *(place - bodies[a].centre), *joint.connector.row, far])
        pairs.append([a, b, k if is_post else -1])
    return np.array(rows), np.array(pairs, dtype=np.int64)


def joint_rows(
    vehicle: Vehicle | RigidBody | Striker, bodies: tuple[Body, ...], row: dict[str, int]
) -> tuple[Index, Array, Array, Index]:
    """Bodies and points of guides and of the front axle's pivot; the axle's stops and bodies."""
    axle_f, axle_i = np.zeros(0), np.zeros(2, dtype=np.int64)
    if isinstance(vehicle, Striker):
        guides = [[c.GUIDE, b, -1] for b in range(len(bodies))]
        return np.array(guides, dtype=np.int64), np.zeros((len(bodies), 6)), axle_f, axle_i
    if vehicle.front_axle is None:
        return np.zeros((0, 3), dtype=np.int64), np.zeros((0, 6)), axle_f, axle_i
    a, b = row["chassis"], row["front_axle"]
    axle, pivot = vehicle.front_axle, np.array(vehicle.front_axle.pivot)
    points = np.array([[*(pivot - bodies[a].centre), *(pivot - bodies[b].centre)]])
    impact = float(axle.stop == "impact")
    axle_f = np.array([axle.swing, axle.stop_stiffness, axle.stop_damping, impact, axle.stop_restitution])
    return np.array([[c.PIVOT, a, b]], dtype=np.int64), points, axle_f, np.array([a, b], dtype=np.int64)


def upright(wheels: int) -> Array:
    """Empty memory of tyres over level ground."""
    memory = np.zeros((wheels, c.EDGE_COLUMNS))
    memory[:, c.E_NORMAL + 2] = memory[:, c.E_NORMAL_NOW + 2] = 1.0
    return memory
