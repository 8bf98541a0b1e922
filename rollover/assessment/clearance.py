"""The operator's clearance zone against the structure and the ground: least distance, first intrusion, when.

The zone is a convex prism fixed to the chassis. Distances are signed: negative is depth inside. The structure may
come near it by deflecting; the ground may enter it where the structure leaves it "unprotected".
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from ground.surface import Surface, height
from rollover.dynamics.result import Motion, Run
from rollover.spec.frames import from_quaternions
from rollover.spec.rops import ClearanceZone
from rollover.spec.shapes import Shape, Tube, sample
from rollover.spec.vehicle import Vehicle

Array = NDArray[np.float64]
SPACING = 0.02  # m, of the points that stand for members
ROWS = 500  # looked at together: bounds the memory of long runs, and how far a body moves meanwhile
ROUNDING = 1e-9  # m, far above that of distances of some metres


@dataclass(frozen=True, kw_only=True)
class Approach:
    """How near something came to the zone: least signed distance (m), its time, and the time of the first intrusion.

    `history` is (n,) over the rows of the run's recording; `nearest` names what came nearest.
    """

    what: str
    least: float
    time: float
    first_intrusion: float | None
    nearest: str
    history: Array


def signed_distance(zone: ClearanceZone, points: Array) -> Array:
    """Signed distance of points (..., 3) in vehicle axes from the zone, m, negative inside.

    A prism is the product of an interval in x and a convex polygon in (y, z): outside both parts add as squares,
    inside the nearer one counts.
    """
    ring = zone.corners()[:6, 1:]
    low, high = zone.corners()[0, 0], zone.corners()[6, 0]
    along = np.maximum(low - points[..., 0], points[..., 0] - high)
    across = _polygon_distance(ring, points[..., 1:])
    outside = np.hypot(np.maximum(along, 0.0), np.maximum(across, 0.0))
    return np.asarray(np.where((along > 0.0) | (across > 0.0), outside, np.maximum(along, across)))


def _polygon_distance(ring: Array, points: Array) -> Array:
    """Signed distance from a convex polygon (k, 2), negative inside."""
    nearest = np.full(points.shape[:-1], np.inf)
    inside = np.full(points.shape[:-1], -np.inf)
    turn = np.sign(_area(ring))
    for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        edge = b - a
        length = float(np.hypot(*edge))
        e, n = edge / length, turn * np.array([edge[1], -edge[0]]) / length
        offset = points - a
        s = np.clip(offset @ e, 0.0, length)
        nearest = np.minimum(nearest, np.hypot(*np.moveaxis(offset - s[..., None] * e, -1, 0)))
        inside = np.maximum(inside, offset @ n)
    return np.where(inside > 0.0, nearest, inside)


def _area(ring: Array) -> float:
    y, z = ring.T
    return 0.5 * float(np.sum(y * np.roll(z, -1) - z * np.roll(y, -1)))


def approaches(run: Run) -> tuple[Approach, ...]:
    """How near the structure and the ground came to the zone; nothing for a vehicle without a zone."""
    vehicle = run.scenario.vehicle
    if not isinstance(vehicle, Vehicle) or vehicle.rops is None or vehicle.rops.clearance_zone is None:
        return ()
    zone, time = vehicle.rops.clearance_zone, run.recording.time
    structure = _of_structure(zone, run, vehicle)
    ground = _of_ground(zone, run.pose["chassis"], run.scenario.ground.surface)
    names, distances = list(structure), np.array(list(structure.values()))
    k = int(np.argmin(distances.min(axis=1)))
    return (
        _approach("structure", names[k], distances.min(axis=0), time),
        _approach("ground", "ground", ground, time),
    )


def _approach(what: str, nearest: str, history: Array, time: Array) -> Approach:
    k = int(np.argmin(history))
    entered = history < 0.0
    first = float(time[int(np.argmax(entered))]) if entered.any() else None
    return Approach(
        what=what, least=float(history[k]), time=float(time[k]), first_intrusion=first, nearest=nearest, history=history
    )


def _of_structure(zone: ClearanceZone, run: Run, vehicle: Vehicle) -> dict[str, Array]:
    """Signed distance of each member over time, (n,)."""
    assert vehicle.rops is not None
    chassis = run.pose["chassis"]
    found = {}
    for body, (_, members) in vehicle.rops.parts.items():
        for member in members:
            points, thickness = _stand_ins(member)
            found[member.name] = _in_chassis(points, run.pose[body], chassis, zone) - thickness
    return found


def _in_chassis(points: Array, body: Motion, chassis: Motion, zone: ClearanceZone) -> Array:
    """Least signed distance (n,) of a body's points (k, 3), which move with it, seen from the chassis."""
    R, C = from_quaternions(body.quaternion), from_quaternions(chassis.quaternion)
    turn = np.einsum("nji,njk->nik", C, R)
    shift = np.einsum("nji,nj->ni", C, body.origin - chassis.origin)
    least = np.empty(len(R))
    for start in range(0, len(R), ROWS):
        part = slice(start, start + ROWS)
        near = _near(points, turn[part], shift[part], zone)
        local = np.einsum("nij,kj->nki", turn[part], near) + shift[part, None]
        least[part] = signed_distance(zone, local).min(axis=1)
    return least


def _near(points: Array, turn: Array, shift: Array, zone: ClearanceZone) -> Array:
    """Those of a body's points (k, 3) that may come nearest to the zone in any of some rows.

    A signed distance changes by no more than a point moves, and a rigid body's points move no further than the corners
    of the box around them: who is further off at the first row than the nearest by twice that, stays behind it.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    corners = np.array(list(product(*zip(low, high, strict=True))))
    way = np.einsum("nij,kj->nki", turn - turn[0], corners) + (shift - shift[0])[:, None]
    reach = float(np.linalg.norm(way, axis=-1).max())
    at_first = signed_distance(zone, points @ turn[0].T + shift[0])
    return np.asarray(points[at_first <= at_first.min() + 2.0 * reach + ROUNDING])


def _stand_ins(member: Shape) -> tuple[Array, float]:
    """Points (k, 3) for a member and how far its surface stands off them: a tube's axis, otherwise its surface."""
    if isinstance(member, Tube):
        start, end = np.array(member.start), np.array(member.end)
        count = max(2, round(float(np.linalg.norm(end - start)) / SPACING) + 1)
        return start + np.linspace(0.0, 1.0, count)[:, None] * (end - start), 0.5 * member.diameter
    return np.concatenate([patch.position for patch in sample(member, SPACING)]), 0.0


def _of_ground(zone: ClearanceZone, chassis: Motion, surface: Surface) -> Array:
    """Least height of the zone's corners above the undisturbed surface, (n,), m."""
    R = from_quaternions(chassis.quaternion)
    corners = np.einsum("nij,kj->nki", R, zone.corners()) + chassis.origin[:, None]
    x, y, z = np.moveaxis(corners, -1, 0)
    return np.asarray((z - height(surface, x, y)).min(axis=1))


def protected_margin(vehicle: Vehicle) -> float:
    """Least distance of the zone's corners from the hull of all that is hard, m; negative: "unprotected".

    Flat ground on which the overturned vehicle could rest touches the convex hull of wheels, outline and structure;
    it stays out of the zone exactly where the zone lies inside that hull (undeflected).
    """
    if vehicle.rops is None or vehicle.rops.clearance_zone is None:
        raise ValueError("rops.clearance_zone: none given, got no zone to protect; a vehicle with one")
    from scipy.spatial import ConvexHull

    structure = [shape for _, members in vehicle.rops.parts.values() for shape in members]
    hard = [patch.position for shape in (*vehicle.outline, *structure) for patch in sample(shape, 0.05)]
    angle = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
    for wheel in vehicle.wheels:
        x, y, z = wheel.centre
        for side in (-0.5, 0.5):
            rim = [wheel.tyre.radius * np.cos(angle), np.zeros(48), wheel.tyre.radius * np.sin(angle)]
            hard.append(np.array([x, y + side * wheel.tyre.width, z]) + np.array(rim).T)
    planes = ConvexHull(np.concatenate(hard)).equations
    depth = -(vehicle.rops.clearance_zone.corners() @ planes[:, :3].T + planes[:, 3])
    return float(depth.min())
