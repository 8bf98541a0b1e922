"""The rigid bodies of a scenario: their mass, and the points with which they touch the ground."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ground.array import Elements
from rollover.spec.inertia import MassProperties
from rollover.spec.shapes import Disc, Shape, SurfacePoints, cone, rectangle, sample
from rollover.spec.vehicle import RigidBody, Striker, Vehicle, Wheel, carried, hubs

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Body:
    """A rigid body in the design position; `surfaces` are its named patches in vehicle axes."""

    name: str
    inertia: MassProperties
    surfaces: tuple[tuple[str, SurfacePoints], ...]

    @property
    def centre(self) -> Array:
        """Centre of mass in vehicle axes, (3,)."""
        return np.array(self.inertia.centre_of_mass)

    @property
    def tensor(self) -> Array:
        """Inertia tensor about the centre of mass, (3, 3)."""
        xx, yy, zz = self.inertia.inertia
        xy, xz, yz = self.inertia.products
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


POINTS_IN_ELEMENT = 0.8  # contact points are never further apart than this share of an element


def bodies_of(
    vehicle: Vehicle | RigidBody | Striker, elements: Elements, effects: Mapping[str, Any] | None = None
) -> tuple[Body, ...]:
    """Bodies with their contact points: striker, perhaps in two; or chassis and the vehicle's other parts.

    Points stand for areas, elements keep the ruts: an element without a point would be a gap under the body.
    """
    spacing = min(vehicle.contact_spacing, POINTS_IN_ELEMENT * min(elements.spacing))
    if isinstance(vehicle, Striker):
        height = 0.5 * (vehicle.face_length + vehicle.face_width)
        half = np.array([0.5 * vehicle.face_length, 0, 0]), np.array([0, 0.5 * vehicle.face_width, 0])
        if vehicle.nose == "cone":
            face = cone(np.zeros(3), vehicle.nose_radius, vehicle.nose_height, spacing)
        else:
            face = rectangle(np.zeros(3), half[0], -half[1], spacing)
        m, a, b = vehicle.mass, vehicle.face_length, vehicle.face_width
        block = (m * (b * b + height**2) / 12, m * (a * a + height**2) / 12, m * (a * a + b * b) / 12)

        def part(name: str, share: float, surfaces: tuple[tuple[str, SurfacePoints], ...]) -> Body:
            j = (share * block[0], share * block[1], share * block[2])
            inertia = MassProperties(mass=share * m, centre_of_mass=(0.0, 0.0, 0.5 * height), inertia=j)
            return Body(name=name, inertia=inertia, surfaces=surfaces)

        nose = nose_share(vehicle, effects)
        whole = part("striker", nose, (("face", face),))
        return (whole,) if nose == 1.0 else (whole, part("striker_body", 1.0 - nose, ()))

    def sampled(shapes: tuple[Shape, ...]) -> list[tuple[str, SurfacePoints]]:
        return [(shape.name, patch) for shape in shapes for patch in sample(shape, spacing)]

    def loads(carrier: str) -> list[tuple[str, SurfacePoints]]:
        return [patch for a in vehicle.attached if a.carried_by == carrier for patch in sampled(a.outline)]

    def walls(carrier: str) -> list[tuple[str, SurfacePoints]]:
        return [
            (disc.name, patch)
            for wheel in vehicle.wheels
            if wheel.hub == carrier and wheel.tyre.lying_stiffness is None  # else it bears on its own springs
            for disc in side_walls(wheel)
            for patch in sample(disc, spacing)
        ]

    found = [
        Body(
            name="chassis",
            inertia=carried(vehicle, "chassis"),
            surfaces=tuple(sampled(vehicle.outline) + loads("chassis") + walls("chassis")),
        )
    ]
    if vehicle.front_axle is not None:
        inertia = carried(vehicle, "front_axle")
        surfaces = tuple(walls("front_axle") + loads("front_axle"))
        found.append(Body(name="front_axle", inertia=inertia, surfaces=surfaces))
    if vehicle.rops is not None:
        for name, (inertia, members) in vehicle.rops.parts.items():
            if name == "rops":
                inertia = carried(vehicle, "rops")
            extra = loads("rops") if name == "rops" else []
            found.append(Body(name=name, inertia=inertia, surfaces=tuple(sampled(members) + extra)))
    if vehicle.trailer is not None:
        surfaces = tuple(sampled(vehicle.trailer.outline) + loads("trailer") + walls("trailer"))
        found.append(Body(name="trailer", inertia=carried(vehicle, "trailer"), surfaces=surfaces))
    found += [Body(name=b.part, inertia=b.body, surfaces=tuple(walls(b.part))) for b in vehicle.bogies]
    found += [Body(name=n, inertia=i, surfaces=tuple(walls(n))) for n, i in hubs(vehicle).items()]
    if vehicle.occupant is not None:
        outlines = vehicle.occupant.outlines
        for name, inertia in vehicle.occupant.parts.items():
            surfaces = tuple(sampled((outlines[name],)))
            found.append(Body(name=f"occupant_{name}", inertia=inertia, surfaces=surfaces))
    for name in loose(effects):
        load = loose_body(effects, name, found[0].inertia)
        rest = without(found[0].inertia, load)
        found[0] = Body(name="chassis", inertia=rest, surfaces=found[0].surfaces)
        found.append(Body(name=name, inertia=load, surfaces=()))
    return tuple(found)


def loose(effects: Mapping[str, Any] | None) -> tuple[str, ...]:
    """Effects whose mass moves in the vehicle."""
    return tuple(n for n in ("tank-slosh", "payload-shift") if effects and n in effects and effects[n].mass > 0.0)


def loose_body(effects: Mapping[str, Any] | None, name: str, chassis: MassProperties) -> MassProperties:
    """A mass that moves in the vehicle: a cube of water's density, at its place or the chassis' centre of mass."""
    assert effects is not None
    mass, place = effects[name].mass, effects[name].position
    j = mass * (mass / 1000.0) ** (2.0 / 3.0) / 6.0
    return MassProperties(mass=mass, centre_of_mass=place or chassis.centre_of_mass, inertia=(j, j, j))


def without(whole: MassProperties, part: MassProperties) -> MassProperties:
    """Mass properties of the rest. Raises ``ValueError`` if there is none that a body can have."""
    if part.mass >= whole.mass:
        raise ValueError(f"mass: more than the chassis has, got {part.mass:g} kg; less than {whole.mass:g} kg")
    mass = whole.mass - part.mass
    centre, taken = np.array(whole.centre_of_mass), np.array(part.centre_of_mass)
    middle = (whole.mass * centre - part.mass * taken) / mass

    def tensor(p: MassProperties) -> Array:
        (xx, yy, zz), (xy, xz, yz) = p.inertia, p.products
        r = np.array(p.centre_of_mass) - middle
        J = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        return np.asarray(J + p.mass * (r @ r * np.eye(3) - np.outer(r, r)))

    J = tensor(whole) - tensor(part)
    return MassProperties(
        mass=mass,
        centre_of_mass=(float(middle[0]), float(middle[1]), float(middle[2])),
        inertia=(float(J[0, 0]), float(J[1, 1]), float(J[2, 2])),
        products=(float(J[0, 1]), float(J[0, 2]), float(J[1, 2])),
    )


def nose_share(vehicle: Vehicle | RigidBody | Striker, effects: Mapping[str, Any] | None) -> float:
    """Share of a striker's mass in its nose: all of it, unless it gives way. Nothing else has a nose."""
    gives = (effects or {}).get("structural-compliance")
    if gives is None or gives.stiffness is None or not isinstance(vehicle, Striker):
        return 1.0
    return float(gives.nose_share)


def side_walls(wheel: Wheel) -> tuple[Disc, Disc]:
    """Both side walls of a tyre, within the radius that does not bend away; the tread's edges are the tyre's own."""
    x, y, z = wheel.centre
    half, radius = 0.5 * wheel.tyre.width, wheel.tyre.side_wall * wheel.tyre.radius

    def side(word: str, sign: float) -> Disc:
        name = f"{wheel.name}_{word}_wall"
        return Disc(name=name, centre=(x, y + sign * half, z), normal=(0.0, sign, 0.0), radius=radius)

    return side("left", 1.0), side("right", -1.0)
