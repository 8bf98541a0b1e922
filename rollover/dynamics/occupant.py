"""An occupant's rows in the kernels' tables, and its channels."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from rollover.kernels import links as k
from rollover.kernels.tables import OCCUPANT, R_NORMAL, R_TANGENT
from rollover.scenario import Scenario
from rollover.spec.frames import matrices
from rollover.spec.occupant import PARTS, Occupant, pairs
from rollover.spec.shapes import Box
from rollover.spec.vehicle import Vehicle

Array = NDArray[np.float64]
Row = tuple[list[int], list[float]]
Point = tuple[float, float, float]
About = Callable[[str, Point], list[float]]


def occupant_rows(scenario: Scenario, vehicle: Vehicle, row: dict[str, int], about: About) -> tuple[list[Row], int]:
    """Rows of `link_i` and `link_f`, and the length of `link_out`: contact force (3) of each part, straps, joints (6).

    `about` gives a point in vehicle axes about a body's centre of mass.
    """
    if vehicle.occupant is None:
        return [], 0
    occupant, out = vehicle.occupant, 3 * len(PARTS)
    rows: list[Row] = []

    if (belt := occupant.belt) is not None:
        for _, anchor, hip in occupant.straps:
            length = math.dist(anchor, hip) + belt.slack
            ends = [*about("occupant_pelvis", hip), *about("chassis", anchor)]
            numbers = [*ends, belt.stiffness, belt.damping, length]
            rows.append(([k.STRAP, row["occupant_pelvis"], row["chassis"], out, OCCUPANT], numbers))
            out += 1
    for _, lower, upper, at, joint in occupant.joints:
        under, above = f"occupant_{lower}", f"occupant_{upper}"
        held = [occupant.joint_stiffness, occupant.joint_damping, *joint.row]
        rows.append(([k.JOINT, row[above], row[under], out, OCCUPANT], [*about(above, at), *about(under, at), *held]))
        out += 6
    return rows + _touching(scenario, vehicle, occupant, row, about), out


def _touching(
    scenario: Scenario,
    vehicle: Vehicle,
    occupant: Occupant,
    row: dict[str, int],
    about: About,
) -> list[Row]:
    """Spheres against boxes and tubes; the hips stand in the cushion by their weight over its stiffness."""
    sag = occupant.mass * scenario.gravity / occupant.cushion_stiffness
    found: list[Row] = []
    for pair in pairs(occupant, vehicle.outline, vehicle.rops):
        part, stiffness = f"occupant_{pair.part}", occupant.contact_stiffness
        if isinstance(pair.shape, Box):
            kind, first, last, radius = k.BLOCK, pair.shape.low, pair.shape.high, pair.radius
        else:
            kind, first, last, radius = k.BAR, pair.shape.start, pair.shape.end, pair.radius + 0.5 * pair.shape.diameter
        if pair.sits:
            stiffness, last = 0.25 * occupant.cushion_stiffness, (*last[:2], last[2] + sag)
        numbers = [*about(part, pair.middle), *about(pair.carrier, first), stiffness, occupant.contact_damping]
        numbers += [*about(pair.carrier, last), radius, occupant.friction]
        found.append(([kind, row[part], row[pair.carrier], 3 * PARTS.index(pair.part), OCCUPANT], numbers))
    return found


def channels(
    occupant: Occupant, links: Array, q: Array, qdd: Array, resultant: Array, row: dict[str, int]
) -> dict[str, Array]:
    """Its channels, SI, each (n,), from the rows of `link_out` (n, no) and the bodies' states (n, nb, ...)."""
    found: dict[str, Array] = {}
    for i, part in enumerate(PARTS):
        b = row[f"occupant_{part}"]
        own = np.einsum("nji,nj->ni", matrices(q[:, b, 3:]), qdd[:, b, :3])
        found |= {f"occupant/{part}/acceleration_{axis}": own[:, j] for j, axis in enumerate("xyz")}
        found[f"occupant/{part}/contact_force"] = np.linalg.norm(links[:, 3 * i : 3 * i + 3], axis=1)
        ground = resultant[:, b, R_NORMAL : R_NORMAL + 3] + resultant[:, b, R_TANGENT : R_TANGENT + 3]
        found[f"occupant/{part}/ground_force"] = np.linalg.norm(ground, axis=1)
    at = 3 * len(PARTS)
    for name, _, _ in occupant.straps:
        found[f"occupant/belt/{name}/force"] = links[:, at]
        at += 1
    for name, *_ in occupant.joints:
        found[f"occupant/{name}/force"] = np.linalg.norm(links[:, at : at + 3], axis=1)
        found[f"occupant/{name}/moment"] = np.linalg.norm(links[:, at + 3 : at + 6], axis=1)
        at += 6
    return found
