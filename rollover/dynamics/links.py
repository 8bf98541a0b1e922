"""Rows of the kernels' tables for what links bodies: an occupant, hitch, bogies, struts; channels of the last three."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rollover.dynamics.bodies import Body
from rollover.dynamics.occupant import Point, Row, occupant_rows
from rollover.kernels import links as k
from rollover.kernels.tables import HITCH, SUSPENSION
from rollover.scenario import Scenario
from rollover.spec.bogie import damped
from rollover.spec.frames import angles, matrices, rotation_vector
from rollover.spec.suspension import GUIDE
from rollover.spec.vehicle import Vehicle, Wheel, carrier_of

Array = NDArray[np.float64]


def link_rows(
    scenario: Scenario, bodies: tuple[Body, ...], row: dict[str, int]
) -> tuple[NDArray[np.int64], Array, Array]:
    """Rows of `link_i` and `link_f`, and the empty `link_out`: the occupant's, then force and moment (6) of each."""
    vehicle, rows, out = scenario.vehicle, list[Row](), 0

    def about(body: str, point: Point) -> list[float]:
        return [float(c) for c in np.array(point) - bodies[row[body]].centre]

    if isinstance(vehicle, Vehicle):
        rows, out = occupant_rows(scenario, vehicle, row, about)
        if vehicle.trailer is not None:
            hitch, (a, b) = vehicle.trailer.hitch, (row["chassis"], row["trailer"])
            at = [*about("trailer", hitch.position), *about("chassis", hitch.position)]
            rows.append(([k.JOINT, b, a, out, HITCH], [*at, hitch.stiffness, hitch.damping, *hitch.turns.row]))
            out += 6
        for bogie in vehicle.bogies:
            below = carrier_of(vehicle, bogie)
            at = [*about(bogie.part, bogie.pivot), *about(below, bogie.pivot)]
            rows.append(([k.JOINT, row[bogie.part], row[below], out, SUSPENSION], [*at, *bogie.row]))
            out += 6
        for wheel in sprung(vehicle):
            at = [*about(wheel.hub, wheel.centre), *about("chassis", wheel.centre)]
            rows.append(([k.STRUT, row[wheel.hub], row["chassis"], out, SUSPENSION], [*at, *_strut(wheel)]))
            out += 6
    f = np.zeros((len(rows), k.LINK_COLUMNS))
    for i, (_, numbers) in enumerate(rows):
        f[i, : len(numbers)] = numbers
    return np.array([whole for whole, _ in rows], dtype=np.int64).reshape(-1, 5), f, np.zeros(out)


def sprung(vehicle: Vehicle) -> list[Wheel]:
    """Wheels with a suspension."""
    return [w for w in vehicle.wheels if w.suspension is not None]


def _strut(wheel: Wheel) -> list[float]:
    """Numbers of a strut after its points: held stiffly along x and y and about all axes, sprung along z."""
    s, tyre = wheel.suspension, wheel.tyre
    assert s is not None
    across = GUIDE * max(tyre.vertical_stiffness, tyre.lateral_stiffness)
    about, inertia = across * tyre.radius**2, s.hub(wheel.centre, tyre.radius, tyre.width).inertia
    dashpot, damper = damped(across, s.mass), damped(about, max(inertia))
    free = [-math.pi] * 3 + [math.pi] * 3
    along = [s.stiffness, s.damping, s.preload, -s.droop, s.bump, s.stop_stiffness]
    return [across, dashpot, *[about] * 3, *[damper] * 3, *free, 0.0, *along]


def link_channels(
    vehicle: Vehicle, links: Array, q: Array, bodies: tuple[Body, ...], row: dict[str, int]
) -> dict[str, Array]:
    """Channels of hitch, bogies and struts, SI, each (n,), from rows of `link_out` (n, no) and the bodies' places."""
    found: dict[str, Array] = {}
    wheels = sprung(vehicle)
    at = links.shape[1] - 6 * (len(wheels) + len(vehicle.bogies) + (vehicle.trailer is not None))
    R = matrices(q[:, row["chassis"], 3:])
    if vehicle.trailer is not None:
        found["hitch/force"] = np.linalg.norm(links[:, at : at + 3], axis=1)
        found["hitch/moment"] = np.linalg.norm(links[:, at + 3 : at + 6], axis=1)
        R_trailer = matrices(q[:, row["trailer"], 3:])
        turn = np.array([rotation_vector(own) for own in np.einsum("nji,njk->nik", R, R_trailer)])
        found |= {f"hitch/angle_{axis}": turn[:, j] for j, axis in enumerate("xyz")}
        found["trailer/roll"], found["trailer/pitch"], found["trailer/yaw"] = angles(q[:, row["trailer"], 3:])
        at += 6
    for bogie in vehicle.bogies:
        below, own = (matrices(q[:, row[name], 3:]) for name in (carrier_of(vehicle, bogie), bogie.part))
        turn = np.array([rotation_vector(one) for one in np.einsum("nji,njk->nik", below, own)])
        found[f"bogie/{bogie.name}/angle"] = turn[:, 1]
        found[f"bogie/{bogie.name}/force"] = np.linalg.norm(links[:, at : at + 3], axis=1)
        at += 6
    for wheel in wheels:
        b, c = row[wheel.hub], row["chassis"]
        apart = np.einsum("nji,nj->ni", R, q[:, b, :3] - q[:, c, :3])
        found[f"suspension/{wheel.name}/travel"] = apart[:, 2] - (bodies[b].centre - bodies[c].centre)[2]
        found[f"suspension/{wheel.name}/force"] = -links[:, at + 2]
        at += 6
    return found
