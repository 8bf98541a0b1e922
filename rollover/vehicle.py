"""What falls or rolls: a vehicle with wheels, front axle and ROPS, or the striker of the drop rig (data only).

Vehicle axes (ISO 8855): x forward, y left, z up; origin on level ground below the middle of the rear axle.
Masses and inertias of a vehicle are those of the whole, as they are measured; what the axle and the ROPS carry
is taken off to find the chassis.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

from ground.quantity import Label, Quantity, parameters
from rollover.inertia import MassProperties
from rollover.provenance import Provenance
from rollover.rops import Rops
from rollover.shapes import Point, Shape


@parameters
class Tyre:
    """A crowned tread on radial and lateral springs in series, a dashpot, Coulomb friction; never pulls.

    Section R - c (2y/w)^2; stiffness 1/k = cos^2(camber)/k_z + sin^2(camber)/k_y at its lowest point.
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
    friction: Annotated[float, Quantity("1", "mu between tyre and ground", least=0, most=2)] = 0.8


@parameters
class Wheel:
    """A tyre at its place, locked or turning freely."""

    name: Annotated[str, Label("front_left, front_right, rear_left, rear_right")]
    centre: Annotated[Point, Quantity("m", "wheel centre, vehicle axes")]
    tyre: Tyre
    carrier: Literal["chassis", "front_axle"] = "chassis"
    rolls: Annotated[
        bool, "turns freely and without inertia, else it is locked; 'driving' turns every wheel by its own inertia"
    ] = False
    inertia: Annotated[
        float | None, Quantity("kg m2", "of all that turns with it, about its axle; part of its carrier's", above=0)
    ] = None


@parameters
class FrontAxle:
    """A beam that swings about a longitudinal pivot between two stops."""

    pivot: Annotated[Point, Quantity("m", "a point of the pivot axis, vehicle axes")]
    body: MassProperties
    swing_deg: Annotated[float, Quantity("deg", "free swing to either side", above=0, most=45)]
    stop_stiffness: Annotated[float, Quantity("N m/rad", above=0)]
    stop_damping: Annotated[float, Quantity("N m s/rad", least=0)] = 0.0

    @property
    def swing(self) -> float:
        """Free swing to either side, rad."""
        return math.radians(self.swing_deg)


@parameters
class Vehicle:
    """A tractor, or a rig made of some of its parts."""

    kind: Literal["vehicle"] = "vehicle"
    name: str
    whole: MassProperties
    wheels: tuple[Wheel, ...] = ()
    front_axle: FrontAxle | None = None
    rops: Rops | None = None
    outline: Annotated[tuple[Shape, ...], "what of the chassis can touch the ground: bonnet, fenders, mass block"] = ()
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
        chassis_of(self)

    def on_axle(self, wheel: Wheel, axle: str) -> bool:
        """Whether a wheel belongs to the "front", the "rear" or "all" of the axles."""
        xs = [w.centre[0] for w in self.wheels]
        is_front = wheel.carrier == "front_axle" or wheel.centre[0] > 0.5 * (min(xs) + max(xs)) + 1e-9
        return axle == "all" or is_front == (axle == "front")


@parameters
class Striker:
    """The striker of the drop rig (Ye 2006, Fig. 5): a block on a vertical guide, flat face down."""

    kind: Literal["striker"] = "striker"
    name: str = "striker"
    mass: Annotated[float, Quantity("kg", above=0)] = 132.0
    face_length: Annotated[float, Quantity("m", "along x", above=0)] = 0.140
    face_width: Annotated[float, Quantity("m", "along y", above=0)] = 0.045
    contact_spacing: Annotated[float, Quantity("m", "of the contact points on the face", above=0)] = 0.0225


def chassis_of(vehicle: Vehicle) -> MassProperties:
    """Mass properties of the chassis: the whole less front axle and ROPS.

    Raises ``ValueError`` if the parts weigh more than the whole or leave an inertia that no body can have.
    """
    whole = vehicle.whole
    parts = [p for p in (vehicle.front_axle and vehicle.front_axle.body, vehicle.rops and vehicle.rops.body) if p]
    mass = whole.mass - sum(p.mass for p in parts)
    if mass <= 0.0:
        raise ValueError(
            f"whole.mass: front axle and ROPS weigh more than the vehicle, got {whole.mass:g} kg; "
            f"greater than {whole.mass - mass:g} kg is allowed"
        )
    first = [
        whole.mass * c - sum(p.mass * p.centre_of_mass[i] for p in parts) for i, c in enumerate(whole.centre_of_mass)
    ]
    centre = (first[0] / mass, first[1] / mass, first[2] / mass)

    def about_origin(p: MassProperties, sign: float) -> list[float]:
        x, y, z = (c - w for c, w in zip(p.centre_of_mass, centre, strict=True))
        m = p.mass
        diagonal = [m * (y * y + z * z), m * (x * x + z * z), m * (x * x + y * y)]
        off = [-m * x * y, -m * x * z, -m * y * z]
        return [sign * (i + s) for i, s in zip((*p.inertia, *p.products), diagonal + off, strict=True)]

    total = [
        sum(terms) for terms in zip(about_origin(whole, 1.0), *(about_origin(p, -1.0) for p in parts), strict=True)
    ]
    try:
        return MassProperties(
            mass=mass,
            centre_of_mass=centre,
            inertia=(total[0], total[1], total[2]),
            products=(total[3], total[4], total[5]),
        )
    except ValueError as e:
        raise ValueError(f"whole.inertia: leaves the chassis, without front axle and ROPS, an impossible {e}") from None
