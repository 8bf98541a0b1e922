"""What falls or rolls: a vehicle with wheels, front axle and ROPS, a rigid body, or a striker on a guide (data only).

Vehicle axes (ISO 8855): x forward, y left, z up; origin on level ground below the middle of the rear axle.
Masses and inertias of a vehicle are those of the whole, as they are measured; what the axle and the ROPS weigh
is taken off to find the chassis. Attached masses (ballast, driver, implement) come on top of the whole.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, ClassVar, Literal

from ground.quantity import Label, Later, Quantity, parameters
from rollover.spec.bogie import Bogie, body_of, check_bogies
from rollover.spec.inertia import MassProperties, combined, cuboid
from rollover.spec.occupant import Occupant, check_room
from rollover.spec.provenance import Provenance
from rollover.spec.rops import Rops
from rollover.spec.shapes import Point, Shape
from rollover.spec.suspension import Suspension
from rollover.spec.trailer import Trailer


@parameters
class Tyre:
    """A crowned tread on radial and lateral springs in series, a dashpot, Coulomb friction; never pulls.

    Section R - c (2y/w)^2; stiffness 1/k = cos^2(camber)/k_z + sin^2(camber)/k_y at its lowest point. Flat on its side
    it is a ring of its shoulder's radius that yields on the rim by `lying_stiffness`; held evenly all round, pressed at
    one place by F, a rigid ring of stiffness c shifts by F/c and tilts by 2 F/(c R) there, so that k_y = c/3.
    """

    radius: Annotated[float, Quantity("m", "unloaded, in the middle of the tread", above=0)]
    width: Annotated[float, Quantity("m", "tread", above=0)]
    crown: Annotated[float, Quantity("m", "how far the shoulders lie below the middle", above=0)] = 0.03
    side_wall: Annotated[
        float, Quantity("1", "share of the radius up to which the side wall bears on the ground", above=0, most=1)
    ] = 0.7
    vertical_stiffness: Annotated[float, Quantity("N/m", "k_z", above=0)]
    vertical_damping: Annotated[float, Quantity("N s/m", least=0)] = 0.0
    lateral_stiffness: Annotated[float, Quantity("N/m", "k_y, also of the stick spring", above=0)]
    lying_stiffness: Annotated[
        float | None,
        Later(),
        Quantity("N/m", "of the tyre flat on its side, 3 k_y if held evenly; null: rigid side walls", above=0),
    ] = None
    friction: Annotated[float, Quantity("1", "mu between tyre and ground", least=0, most=2)] = 0.8
    bottoming: Annotated[
        float | None, Quantity("1", "deflection at which the rim bottoms, as a share of the radius", above=0, most=1)
    ] = None
    bottoming_stiffness: Annotated[float, Quantity("N/m", "added to k_z once the rim bottoms", least=0)] = 0.0

    def validate(self) -> None:
        """Refuse a ring that yields more as a whole than where it is pressed at one place."""
        if self.lying_stiffness is not None and self.lying_stiffness <= self.lateral_stiffness:
            raise ValueError(
                f"lying_stiffness: less than at one place of the tread, got {self.lying_stiffness:g} N/m; more than "
                f"lateral_stiffness, {self.lateral_stiffness:g} N/m"
            )


@parameters
class Wheel:
    """A tyre at its place, locked or turning freely."""

    name: Annotated[str, Label("front_left, front_right, rear_left, rear_right")]
    centre: Annotated[Point, Quantity("m", "wheel centre, vehicle axes")]
    tyre: Tyre
    carrier: Literal["chassis", "front_axle", "trailer"] = "chassis"
    suspension: Annotated[Suspension | None, Later(), "of a wheel on the chassis; null: it is fixed to its carrier"] = (
        None
    )
    bogie: Annotated[str | None, Later(), "name of the one on whose beam it stands; null: on its carrier itself"] = None
    rolls: Annotated[
        bool, "turns freely and without inertia, else it is locked; 'driving' turns every wheel by its own inertia"
    ] = False
    inertia: Annotated[
        float | None,
        Quantity(
            "kg m2",
            "of all that turns with it, about its axle; part of its carrier's; where 'driving' finds null, "
            "estimated from the tyre's size",
            above=0,
        ),
    ] = None

    @property
    def hub(self) -> str:
        """Name of the body that it stands on: its carrier, a bogie's beam, or its own where it is sprung."""
        if self.bogie is not None:
            return body_of(self.bogie)
        return self.carrier if self.suspension is None else f"hub_{self.name}"


@parameters
class FrontAxle:
    """A beam that swings about a longitudinal pivot between two stops."""

    pivot: Annotated[Point, Quantity("m", "a point of the pivot axis, vehicle axes")]
    body: MassProperties
    swing_deg: Annotated[float, Quantity("deg", "free pivot angle to either side", above=0, most=45)]
    stop_stiffness: Annotated[float, Quantity("N m/rad", above=0)]
    stop_damping: Annotated[float, Quantity("N m s/rad", least=0)] = 0.0
    stop: Annotated[
        Literal["compliant", "impact"],
        "how a stop is met: on its spring and dashpot, or by an exchange of momentum, after which they hold",
    ] = "compliant"
    stop_restitution: Annotated[float, Quantity("1", "of an impact on a stop", least=0, most=1)] = 0.0

    @property
    def swing(self) -> float:
        """Free swing to either side, rad."""
        return math.radians(self.swing_deg)


Carrier = Literal["chassis", "front_axle", "rops", "trailer"]


@parameters
class Attached:
    """What a vehicle carries: ballast, implement, driver, filled tank; fixed to the body that carries it.

    Its inertia about its centre of mass is given, or that of a solid cuboid of the given size.
    """

    name: Annotated[str, Label()]
    mass: Annotated[float, Quantity("kg", above=0)]
    centre_of_mass: Annotated[Point, Quantity("m", "vehicle axes")]
    inertia: Annotated[Point | None, Quantity("kg m2", "Ixx, Iyy, Izz about its centre of mass", above=0)] = None
    size: Annotated[
        Point | None, Quantity("m", "edges of a cuboid along x, y, z, in place of the inertia", above=0)
    ] = None
    carried_by: Carrier = "chassis"
    outline: Annotated[tuple[Shape, ...], "what of it can touch the ground"] = ()

    def validate(self) -> None:
        """Refuse an inertia given twice or not at all."""
        if (self.inertia is None) == (self.size is None):
            raise ValueError("inertia: give either inertia or size, got both or none; one of them")
        self.body  # noqa: B018  raises for an inertia that no body can have

    @property
    def body(self) -> MassProperties:
        """Its mass properties."""
        if self.size is not None:
            return cuboid(self.mass, self.centre_of_mass, self.size)
        assert self.inertia is not None
        return MassProperties(mass=self.mass, centre_of_mass=self.centre_of_mass, inertia=self.inertia)


@parameters
class Vehicle:
    """A tractor, or a rig made of some of its parts."""

    kind: Literal["vehicle"] = "vehicle"
    name: str
    whole: Annotated[MassProperties, "of the vehicle with axle and ROPS, without what is attached"]
    wheels: tuple[Wheel, ...] = ()
    front_axle: FrontAxle | None = None
    rops: Rops | None = None
    outline: Annotated[tuple[Shape, ...], "what of the chassis can touch the ground: bonnet, fenders, mass block"] = ()
    attached: Annotated[tuple[Attached, ...], "masses beyond the whole: ballast, implement, driver, tank"] = ()
    occupant: Annotated[Occupant | None, Later(), "who sits on it, as bodies of its own; null: nobody"] = None
    trailer: Annotated[Trailer | None, Later(), "what is articulated behind it; null: nothing"] = None
    bogies: Annotated[tuple[Bogie, ...], Later(), "beams that carry two wheels or more and swing"] = ()
    contact_spacing: Annotated[float, Quantity("m", "of the contact points on outlines and members", above=0)] = 0.03
    provenance: tuple[Provenance, ...] = ()

    def validate(self) -> None:
        """Refuse parts that do not fit together."""
        names = [w.name for w in self.wheels]
        if len(set(names)) != len(names):
            raise ValueError(f"wheels: two wheels share a name, got {names}; each name once")
        if self.front_axle is None and any(w.carrier == "front_axle" for w in self.wheels):
            raise ValueError(
                "wheels: a wheel is carried by 'front_axle' but there is none; give front_axle or 'chassis'"
            )
        for w in self.wheels:
            if w.carrier == "trailer" and self.trailer is None:
                raise ValueError("wheels: a wheel is carried by 'trailer' but there is none; give trailer or 'chassis'")
            if w.suspension is not None and w.carrier != "chassis":
                raise ValueError(f"wheels.{w.name}.suspension: got it on {w.carrier!r}; null, or carrier 'chassis'")
            if w.suspension is not None and w.bogie is not None:
                raise ValueError(f"wheels.{w.name}.suspension: got it on bogie {w.bogie!r}; null, or bogie null")
        named = sorted({w.bogie for w in self.wheels if w.bogie is not None})
        stands = {b: [(w.carrier, w.centre) for w in self.wheels if w.bogie == b] for b in named}
        check_bogies(self.bogies, stands)
        there = {"chassis": True, "front_axle": self.front_axle, "rops": self.rops, "trailer": self.trailer}
        for a in self.attached:
            if there[a.carried_by] is None:
                raise ValueError(f"attached.{a.name}.carried_by: there is none, got {a.carried_by!r}; 'chassis'")
        masses = [a.name for a in self.attached]
        if len(set(masses)) != len(masses):
            raise ValueError(f"attached: two masses share a name, got {masses}; each name once")
        chassis_of(self)
        if self.trailer is not None:
            carried(self, "trailer")
        if self.occupant is not None:
            check_room(self.occupant, self.outline, self.rops)

    def on_axle(self, wheel: Wheel, axle: str) -> bool:
        """Whether a wheel belongs to the "front", the "rear" or "all" of the axles."""
        if wheel.carrier == "trailer":
            return axle == "all"
        xs = [w.centre[0] for w in self.wheels if w.carrier != "trailer"]
        is_front = wheel.carrier == "front_axle" or wheel.centre[0] > 0.5 * (min(xs) + max(xs)) + 1e-9
        return axle == "all" or is_front == (axle == "front")


@parameters
class Striker:
    """The striker of the drop rig (Ye 2006, Fig. 5): a block on a vertical guide, flat face or a cone's tip down."""

    kind: Literal["striker"] = "striker"
    name: str = "striker"
    mass: Annotated[float, Quantity("kg", above=0)] = 132.0
    face_length: Annotated[float, Quantity("m", "along x", above=0)] = 0.140
    face_width: Annotated[float, Quantity("m", "along y", above=0)] = 0.045
    nose: Annotated[Literal["flat", "cone"], "a cone replaces the face: its area grows with the depth"] = "flat"
    nose_radius: Annotated[float, Quantity("m", "of the cone's base", above=0)] = 0.04375
    nose_height: Annotated[float, Quantity("m", "of the cone", above=0)] = 0.0755
    contact_spacing: Annotated[float, Quantity("m", "of the contact points on the face", above=0)] = 0.0225


@parameters
class RigidBody:
    """One free rigid body, such as a thrown block: mass properties and what of it can touch the ground."""

    kind: Literal["body"] = "body"
    name: str
    whole: MassProperties
    outline: Annotated[tuple[Shape, ...], "what can touch the ground; on hard ground the corners, as points"]
    contact_spacing: Annotated[float, Quantity("m", "of the contact points on outlines", above=0)] = 0.03
    provenance: tuple[Provenance, ...] = ()

    # a body is a chassis with nothing on it
    wheels: ClassVar[tuple[Wheel, ...]] = ()
    front_axle: ClassVar[None] = None
    trailer: ClassVar[None] = None
    bogies: ClassVar[tuple[Bogie, ...]] = ()
    occupant: ClassVar[None] = None
    rops: ClassVar[None] = None
    attached: ClassVar[tuple[Attached, ...]] = ()

    def validate(self) -> None:
        """Refuse a body that nothing could stop."""
        if not self.outline:
            raise ValueError("outline: nothing can touch the ground, got no shape; at least one")


def chassis_of(vehicle: Vehicle | RigidBody) -> MassProperties:
    """Mass properties of the chassis: the whole less its other parts, without attached masses.

    Raises ``ValueError`` if the parts weigh more than the whole or leave an inertia that no body can have.
    """
    whole = vehicle.whole
    if isinstance(vehicle, RigidBody):
        return whole
    parts = [] if vehicle.front_axle is None else [vehicle.front_axle.body]
    if vehicle.rops is not None:
        parts += [body for body, _ in vehicle.rops.parts.values()]
    parts += [*hubs(vehicle).values(), *beams(vehicle, "chassis")]
    heavy = sum(p.mass for p in parts)
    if whole.mass <= heavy:
        raise ValueError(
            f"whole.mass: front axle, ROPS, sprung wheels and bogies weigh more than the vehicle, got {whole.mass:g} "
            f"kg; greater than {heavy:g} kg is allowed"
        )
    try:
        return combined([whole], less=parts)
    except ValueError as e:
        raise ValueError(
            f"whole.inertia: leaves the chassis, without front axle, ROPS, hubs and bogies, an impossible {e}"
        ) from None


def carried(vehicle: Vehicle | RigidBody, carrier: Carrier) -> MassProperties:
    """Mass properties of a body of the vehicle with the masses that it carries."""
    if carrier == "chassis":
        own = chassis_of(vehicle)
    elif carrier == "trailer":
        assert vehicle.trailer is not None
        own = _without(vehicle.trailer.body, beams(vehicle, "trailer"))
    else:
        part = vehicle.front_axle if carrier == "front_axle" else vehicle.rops
        assert part is not None
        own = part.body
    extra = [a.body for a in vehicle.attached if a.carried_by == carrier]
    return combined([own, *extra]) if extra else own


def laden(vehicle: Vehicle | RigidBody) -> MassProperties:
    """Mass properties of the vehicle with everything that is attached to it."""
    extra = [a.body for a in vehicle.attached]
    if isinstance(vehicle, Vehicle) and vehicle.occupant is not None:
        extra += vehicle.occupant.parts.values()
    if vehicle.trailer is not None:
        extra.append(vehicle.trailer.body)
    return combined([vehicle.whole, *extra]) if extra else vehicle.whole


def hubs(vehicle: Vehicle | RigidBody) -> dict[str, MassProperties]:
    """Mass properties of what moves with each sprung wheel, by the name of its body."""
    return {
        w.hub: w.suspension.hub(w.centre, w.tyre.radius, w.tyre.width)
        for w in vehicle.wheels
        if w.suspension is not None
    }


def beams(vehicle: Vehicle | RigidBody, carrier: str) -> list[MassProperties]:
    """Mass properties of the bogies on the chassis or on the trailer."""
    return [b.body for b in vehicle.bogies if carrier_of(vehicle, b) == carrier]


def carrier_of(vehicle: Vehicle | RigidBody, bogie: Bogie) -> Carrier:
    """Name of the body that a bogie's pin is on: that which carries its wheels."""
    return next(w.carrier for w in vehicle.wheels if w.bogie == bogie.name)


def _without(whole: MassProperties, parts: list[MassProperties]) -> MassProperties:
    """A trailer less its bogies. Raises ``ValueError`` if they weigh more or leave an inertia that no body can have."""
    try:
        return combined([whole], less=parts) if parts else whole
    except ValueError as e:
        raise ValueError(f"trailer.body: less its bogies, {e}") from None


def alone(vehicle: Vehicle) -> Vehicle:
    """The same vehicle without its trailer."""
    if vehicle.trailer is None:
        return vehicle
    wheels = tuple(w for w in vehicle.wheels if w.carrier != "trailer")
    return replace(
        vehicle,
        trailer=None,
        wheels=wheels,
        bogies=tuple(b for b in vehicle.bogies if carrier_of(vehicle, b) != "trailer"),
        attached=tuple(a for a in vehicle.attached if a.carried_by != "trailer"),
    )


def seated_still(vehicle: Vehicle) -> Vehicle:
    """The same vehicle with its occupant as masses fixed to the chassis, which touch nothing."""
    if vehicle.occupant is None:
        return vehicle
    parts = tuple(
        Attached(name=f"occupant_{name}", mass=body.mass, centre_of_mass=body.centre_of_mass, inertia=body.inertia)
        for name, body in vehicle.occupant.parts.items()
    )
    return replace(vehicle, attached=(*vehicle.attached, *parts), occupant=None)


def pitch_inertia(vehicle: Vehicle) -> tuple[float, float] | None:
    """I about the rear axle = Iyy + m (a^2 + (h - r)^2) of the whole, and 0.378 M L^2, kg m2; None without axles.

    The second is where the two formulae of the pendulum test of OECD Code 3 for a rear impact agree, H = 2.165e-8 M L^2
    and H = 5.73e-2 I (mm); a tractor far from it has an unusual pitch inertia, or a wrong one.
    """
    sides = [[w for w in vehicle.wheels if w.carrier == carrier] for carrier in ("chassis", "front_axle")]
    if not all(sides):
        return None
    rear, front = sides[0][0].centre, sides[1][0].centre
    m, (x, _, z) = vehicle.whole.mass, vehicle.whole.centre_of_mass
    about = vehicle.whole.inertia[1] + m * ((x - rear[0]) ** 2 + (z - rear[2]) ** 2)
    return about, 0.378 * m * (front[0] - rear[0]) ** 2
