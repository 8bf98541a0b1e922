"""What stands in the picture besides the ground: bodies, wheels, the clearance zone, the drop rig. Arrays only.

Parts are given in the axes of the entity they hang under: a body's parts in vehicle axes, drawn with that
body's pose; parts of the world in world axes. Nothing here knows the viewer.
"""

from __future__ import annotations

import dataclasses
import math
from collections import Counter

import numpy as np
from numpy.typing import NDArray

from rollover.dynamics.result import Run
from rollover.spec.bogie import Bogie
from rollover.spec.inertia import MassProperties
from rollover.spec.rops import ClearanceZone, Rops
from rollover.spec.shapes import Box, Disc, Point, Points, Shape, Tube, axes_along
from rollover.spec.stand import PendulumBlow, StaticTest
from rollover.spec.trailer import Trailer
from rollover.spec.vehicle import RigidBody, Striker, Vehicle, Wheel, laden
from viz.content.entities import escaped
from viz.recordings.rig import rig
from viz.recordings.solids import AROUND, DARK_STEEL, FRAME, STEEL, Balls, Block, Hull, Part, Rod, Wire, body_path

PAINT = (0x4C8C46FF, 0x417C3DFF, 0x569A4EFF, 0x386E36FF)  # the chassis, part by part
UPPER = 0xF29A2EFF
LOAD = 0x3F6FB5FF  # what is attached
TREAD, LUG, SIDE_WALL = 0x2B2E33FF, 0x3B3F46FF, 0x34383EFF
RIM, RIM_MARK = 0xD8D8D0FF, 0x6F7378FF
ZONE = 0x5FD3F5FF
_MEMBER = 0.04  # m from the loaded point, on a member's axis, to the beam's front


def parts(run: Run) -> tuple[Part, ...]:
    """Everything that is drawn besides ground, forces and events."""
    vehicle = run.scenario.vehicle
    if isinstance(vehicle, Striker):
        return rig(run, vehicle)
    return _vehicle(vehicle) + _stand(run)


def _vehicle(vehicle: Vehicle | RigidBody) -> tuple[Part, ...]:
    chassis, axle = body_path("chassis"), body_path("front_axle")
    found: list[Part] = []
    for i, shape in enumerate(vehicle.outline):
        found.append(_solid(shape, f"{chassis}/{escaped(shape.name)}", PAINT[i % len(PAINT)]))
    if not vehicle.outline:
        # nothing was said of its shape: the cuboid with the same mass, centre and moments of inertia
        found.append(_equivalent(vehicle.whole, f"{chassis}/equivalent_cuboid"))
    for wheel in vehicle.wheels:
        found += _wheel(wheel, f"{body_path(wheel.hub)}/{escaped(wheel.name)}")
    rear = [w for w in vehicle.wheels if w.carrier == "chassis" and w.bogie is None]
    for i, (a, b) in enumerate(_opposite(rear)):
        # not part of the model: without it the wheels would hang in the air
        found.append(_beam(a.centre, b.centre, f"{chassis}/axle_{i}"))
    if vehicle.front_axle is not None:
        for wheel in (w for w in vehicle.wheels if w.carrier == "front_axle"):
            found.append(_beam(vehicle.front_axle.pivot, wheel.centre, f"{axle}/beam_{escaped(wheel.name)}"))
        x, y, z = vehicle.front_axle.pivot
        found.append(Rod(path=f"{axle}/pivot", start=(x - 0.15, y, z), end=(x + 0.15, y, z), radius=0.05, colour=STEEL))
    if vehicle.trailer is not None:
        found += _trailer(vehicle.trailer, [w for w in vehicle.wheels if w.carrier == "trailer" and w.bogie is None])
    for bogie in vehicle.bogies:
        found += _bogie(bogie, [w for w in vehicle.wheels if w.bogie == bogie.name])
    if vehicle.rops is not None:
        found += _rops(vehicle.rops)
    for mass in vehicle.attached:
        root = f"{body_path(mass.carried_by)}/{escaped(mass.name)}"
        found += [_solid(shape, f"{root}/{escaped(shape.name)}", LOAD) for shape in mass.outline]
        if not mass.outline:
            # it cannot touch anything: seen through, in the size that its inertia gives it
            found.append(dataclasses.replace(_equivalent(mass.body, f"{root}/mass"), colour=LOAD, see_through=True))
    if isinstance(vehicle, Vehicle) and (occupant := vehicle.occupant) is not None:
        found += [_solid(s, f"{chassis}/seat_{s.name}", DARK_STEEL) for s in occupant.seat_boxes]
        for part, shape in occupant.outlines.items():
            found.append(_solid(shape, f"{body_path(f'occupant_{part}')}/{part}", LOAD))
    return tuple(found)


def _trailer(trailer: Trailer, wheels: list[Wheel]) -> list[Part]:
    """Its outline, its axles, and a ball where it hangs on the vehicle."""
    root = body_path("trailer")
    found = [_solid(s, f"{root}/{escaped(s.name)}", PAINT[i % len(PAINT)]) for i, s in enumerate(trailer.outline)]
    if not trailer.outline:
        found.append(_equivalent(trailer.body, f"{root}/equivalent_cuboid"))
    found += [_beam(a.centre, b.centre, f"{root}/axle_{i}") for i, (a, b) in enumerate(_opposite(wheels))]
    hitch = np.array([trailer.hitch.position])
    return [*found, Balls(path=f"{root}/hitch", centres=hitch, radii=np.array([0.08]), colour=DARK_STEEL)]


def _bogie(bogie: Bogie, wheels: list[Wheel]) -> list[Part]:
    """A beam along its wheels, and its pin."""
    root, (x, y, z) = body_path(bogie.part), bogie.pivot
    on = (x, wheels[0].centre[1], z)
    found: list[Part] = [_beam(on, w.centre, f"{root}/beam_{escaped(w.name)}") for w in wheels]
    out = math.copysign(0.15, wheels[0].centre[1])
    return [*found, Rod(path=f"{root}/pin", start=(x, y - out, z), end=on, radius=0.09, colour=STEEL)]


def _stand(run: Run) -> tuple[Part, ...]:
    """The test stand: a beam and the rod that pushes it, or a block on the lower part of its chains, and lashings."""
    begin = run.scenario.initiation
    if isinstance(begin, StaticTest):
        # its x is the way that it pushes, its front stands at the loaded point; 150 mm high as the standards have it
        path = body_path("beam")
        size = (0.10, begin.beam_length, 0.15)
        return (
            Block(path=f"{path}/beam", centre=(-0.05 - _MEMBER, 0.0, 0.0), size=size, colour=STEEL),
            Rod(path=f"{path}/rod", start=(-0.1, 0.0, 0.0), end=(-0.7, 0.0, 0.0), radius=0.04, colour=DARK_STEEL),
        )
    if not isinstance(begin, PendulumBlow):
        return ()
    path, along = body_path("pendulum"), begin.come_from in ("front", "rear")
    half, top = 0.5 * begin.face, 0.5 * begin.face + 1.2
    size = (begin.depth, begin.face, begin.face) if along else (begin.face, begin.depth, begin.face)
    found: list[Part] = [Block(path=f"{path}/block", centre=(0.0, 0.0, 0.0), size=size, colour=STEEL)]
    for name, side in (("one", 0.8 * half), ("other", -0.8 * half)):
        x, y = (0.0, side) if along else (side, 0.0)
        chain = Rod(path=f"{path}/chain_{name}", start=(x, y, half), end=(x, y, top), radius=0.015, colour=DARK_STEEL)
        found.append(chain)
    if begin.lashings and "chassis" in run.motion:
        pose = run.motion["chassis"]
        R, origin = rotation(pose.quaternion[0]), pose.origin[0]
        strips = tuple(origin + np.array([x.point, x.anchor]) @ R.T for x in begin.lashings)
        found.append(Wire(path="world/lashings", strips=strips, colour=DARK_STEEL, radius=0.012))
    return tuple(found)


def _rops(rops: Rops) -> list[Part]:
    found: list[Part] = []
    for (body, (_, members)), colour in zip(rops.parts.items(), (FRAME, UPPER), strict=False):
        found += _frame(members, body_path(body), colour)
    for below, joints, name in (("chassis", rops.standing, "rops_mounts"), ("rops", rops.hinges, "hinges")):
        if joints:
            places = np.array([m.position for m in joints])
            radii = np.full(len(places), 0.06)
            found.append(Balls(path=f"{body_path(below)}/{name}", centres=places, radii=radii, colour=DARK_STEEL))
    if rops.clearance_zone is not None:
        found.append(_zone(rops.clearance_zone, f"{body_path('chassis')}/clearance_zone"))
    return found


def _frame(members: tuple[Shape, ...], root: str, colour: int) -> list[Part]:
    found: list[Part] = [_solid(shape, f"{root}/{escaped(shape.name)}", colour) for shape in members]
    tubes = [s for s in members if isinstance(s, Tube)]
    ends = Counter(end for tube in tubes for end in (tube.start, tube.end))
    joints = [end for end, count in ends.items() if count > 1]
    if joints:
        # flat ends leave a notch where two tubes meet
        radii = [max(0.5 * t.diameter for t in tubes if end in (t.start, t.end)) for end in joints]
        found.append(Balls(path=f"{root}/joints", centres=np.array(joints), radii=np.array(radii), colour=colour))
    return found


def _zone(zone: ClearanceZone, path: str) -> Wire:
    corners = zone.corners()
    rings = [corners[[*range(k, k + 6), k]] for k in (0, 6)]
    edges = [corners[[k, k + 6]] for k in range(6)]
    return Wire(path=path, strips=(*rings, *edges), colour=ZONE, radius=0.008)


def _solid(shape: Shape, path: str, colour: int) -> Part:
    if isinstance(shape, Box):
        low, high = np.array(shape.low), np.array(shape.high)
        return Block(path=path, centre=_point(0.5 * (low + high)), size=_point(high - low), colour=colour)
    if isinstance(shape, Tube):
        return Rod(path=path, start=shape.start, end=shape.end, radius=0.5 * shape.diameter, colour=colour)
    if isinstance(shape, Points):
        return _around(np.array(shape.at), path)
    assert isinstance(shape, Disc)
    # a side of a plate has no thickness; 5 mm inwards are enough to be seen
    outward = axes_along(np.array(shape.normal, dtype=float))[0]
    back = _point(np.array(shape.centre) - 0.005 * outward)
    return Rod(path=path, start=back, end=shape.centre, radius=shape.radius, colour=SIDE_WALL)


def _around(points: NDArray[np.float64], path: str) -> Hull | Balls:
    """The convex body with these corners, each flat side in a shade of its own; fewer or flat ones as balls."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):
        size = 0.02 * float(np.ptp(points, axis=0).max() or 1.0)
        return Balls(path=path, centres=points, radii=np.full(len(points), size), colour=PAINT[0])
    sides: dict[tuple[float, ...], int] = {}
    vertices, normals, colours = [], [], []
    for corners, plane in zip(hull.simplices, hull.equations, strict=True):
        shade = PAINT[sides.setdefault(tuple((np.round(plane, 6) + 0.0).tolist()), len(sides)) % len(PAINT)]
        a, b, c = points[corners]
        order = (a, b, c) if np.cross(b - a, c - a) @ plane[:3] > 0.0 else (a, c, b)
        for corner in order:
            vertices.append(corner)
            normals.append(plane[:3])
            colours.append(shade)
    return Hull(
        path=path,
        vertices=np.array(vertices),
        normals=np.array(normals),
        colours=np.array(colours, dtype=np.uint32),
        triangles=np.arange(len(vertices)).reshape(-1, 3),
    )


def _equivalent(body: MassProperties, path: str) -> Block:
    total = 0.5 * sum(body.inertia)
    squares = [12.0 / body.mass * max(total - i, 0.0) for i in body.inertia]
    size = (math.sqrt(squares[0]), math.sqrt(squares[1]), math.sqrt(squares[2]))
    return Block(path=path, centre=body.centre_of_mass, size=size, colour=PAINT[0])


def _opposite(wheels: list[Wheel]) -> list[tuple[Wheel, Wheel]]:
    """Pairs of wheels at the same place along x and z."""
    return [
        (a, b)
        for i, a in enumerate(wheels)
        for b in wheels[:i]
        if math.hypot(a.centre[0] - b.centre[0], a.centre[2] - b.centre[2]) < 0.02
    ]


def _beam(start: Point, end: Point, path: str) -> Rod:
    return Rod(path=path, start=start, end=end, radius=0.06, colour=DARK_STEEL)


def _wheel(wheel: Wheel, path: str) -> list[Part]:
    x, y, z = wheel.centre
    radius, half = wheel.tyre.radius, 0.5 * wheel.tyre.width
    rim, out = 0.5 * radius, math.copysign(1.0, y)
    hub = Rod(
        path=f"{path}/hub",
        start=(x, y, z),
        end=(x, y + out * 0.95 * half, z),
        radius=0.16 * radius,
        colour=STEEL,
    )
    return [_tyre(np.array(wheel.centre), radius, half, rim, path), hub]


def _tyre(centre: NDArray[np.float64], radius: float, half: float, rim: float, path: str) -> Hull:
    """A body of revolution about y: tread to the full radius at full width but for a small shoulder, dished rim."""
    # (y, r, colour of even facets, colour of odd facets) along the section; each stretch keeps its own vertices,
    # so that edges stay sharp and the rim can carry marks by which the attitude is seen
    dish = 0.45 * half
    section = [(-dish, 0.0), (-dish, rim), (-half, 1.1 * rim), (-half, 0.93 * radius), (-0.92 * half, radius)]
    section += [(-y, r) for y, r in reversed(section)]
    paint = [(RIM, RIM), (RIM, RIM), (SIDE_WALL, SIDE_WALL), (LUG, TREAD)]
    paint += [(LUG, TREAD), *reversed(paint)]
    angle = 2.0 * math.pi * np.arange(AROUND + 1) / AROUND
    vertices, normals, colours = [], [], []
    for (y0, r0), (y1, r1), shades in zip(section[:-1], section[1:], paint, strict=True):
        along = np.array([y1 - y0, r1 - r0])
        ny, nr = np.array([-along[1], along[0]]) / np.linalg.norm(along)
        for k in range(AROUND):
            even, odd = shades
            shade = even if k % 2 == 0 else odd
            if r0 == 0.0 or r1 == 0.0:
                shade = RIM_MARK if k // (AROUND // 8) % 2 else RIM
            for r, y, a in ((r0, y0, angle[k]), (r1, y1, angle[k]), (r1, y1, angle[k + 1]), (r0, y0, angle[k + 1])):
                vertices.append((r * math.cos(a), y, r * math.sin(a)))
                normals.append((nr * math.cos(a), ny, nr * math.sin(a)))
                colours.append(shade)
    first = 4 * np.arange(len(vertices) // 4)[:, None, None]
    return Hull(
        path=path,
        vertices=centre + np.array(vertices),
        normals=np.array(normals),
        colours=np.array(colours, dtype=np.uint32),
        triangles=(first + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3),
    )


def _point(values: NDArray[np.float64]) -> Point:
    x, y, z = values.tolist()
    return (x, y, z)


def extent(run: Run, *, at: int | None = None) -> tuple[NDArray[np.float64], float]:
    """Centre and radius of a ball around all that moves, over the whole run or in one frame; world, m."""
    found = [np.zeros((0, 3))]
    for part in parts(run):
        motion = next((m for body, m in run.motion.items() if part.path.startswith(body_path(body) + "/")), None)
        points = _reach(part)
        if motion is None:
            found.append(points)
            continue
        count = len(motion.origin)
        some = (
            np.linspace(0, count - 1, 12).round().astype(int) if at is None and count else range(count)[at or 0 :][:1]
        )
        found += [motion.origin[i] + points @ rotation(motion.quaternion[i]).T for i in some]
    points = np.concatenate(found)
    if not len(points):
        return np.zeros(3), 1.0
    low, high = points.min(axis=0), points.max(axis=0)
    return 0.5 * (low + high), float(0.5 * np.linalg.norm(high - low))


def path_of_centre(run: Run) -> NDArray[np.float64]:
    """Where the vehicle's centre of mass was at the frame times, as if it were rigid, (n, 3); world, m.

    That of a striker's face if it is let go high up; of one in a guide nothing, for it stays in the picture.
    """
    vehicle = run.scenario.vehicle
    if isinstance(vehicle, Striker) and run.scenario.initiation.kind == "release" and "striker" in run.motion:
        return run.motion["striker"].origin
    if isinstance(vehicle, Striker) or "chassis" not in run.motion:
        return np.zeros((0, 3))
    motion, centre = run.motion["chassis"], np.array(laden(vehicle).centre_of_mass)
    turned = [rotation(q) @ centre for q in motion.quaternion]
    return np.asarray(motion.origin + np.array(turned).reshape(-1, 3))


def _reach(part: Part) -> NDArray[np.float64]:
    if isinstance(part, Block):
        corners = np.array(np.meshgrid(*[(-0.5, 0.5)] * 3)).reshape(3, -1).T
        return np.asarray(np.array(part.centre) + corners * np.array(part.size))
    if isinstance(part, Rod):
        return np.array([part.start, part.end])
    if isinstance(part, Hull):
        return part.vertices[::7]
    return np.concatenate(part.strips) if isinstance(part, Wire) else part.centres


def rotation(quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation matrix of a unit quaternion x, y, z, w."""
    x, y, z, w = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
