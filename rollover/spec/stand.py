"""Test stands (data): a static test of the ROPS, a pendulum blow, a tilt table. A scenario begins with one of them.

Points are in vehicle axes. A load of a static test follows from a code and the vehicle, or is given as a number.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

from ground.quantity import Label, Quantity, parameters
from rollover.spec.shapes import Point

From = Literal["front", "rear", "left", "right", "above"]
Code = Literal["code-4", "code-6", "code-7"]
Step = Literal["longitudinal", "crush", "side", "second-longitudinal"]
# unit vector in which a load pushes, by where it comes from; vehicle axes
DIRECTION: dict[str, Point] = {
    "front": (-1.0, 0.0, 0.0),
    "rear": (1.0, 0.0, 0.0),
    "left": (0.0, -1.0, 0.0),
    "right": (0.0, 1.0, 0.0),
    "above": (0.0, 0.0, -1.0),
}


@parameters
class StaticLoad:
    """One load of a sequence: pushed until an energy is absorbed, or up to a force that is held.

    What a code `asks` follows from the vehicle's mass, and the side and the point from its frame where they are not
    given. A number given beside it is pushed to instead; what the code asks is still what the load is held against.
    """

    name: Annotated[str, Label("of the load in results and events")]
    asks: Annotated[Step | None, "the step of the code that this load is; null: of none, by energy or force"] = None
    come_from: Annotated[From | None, "the side that the beam comes from; null: by the code"] = None
    point: Annotated[
        Point | None, Quantity("m", "middle of the beam on the ROPS, vehicle axes, before the test; null: by the code")
    ] = None
    energy: Annotated[float | None, Quantity("J", "to be absorbed; null: by the code", above=0)] = None
    force: Annotated[float | None, Quantity("N", "to be reached and held; null: by the code", above=0)] = None

    def validate(self) -> None:
        """Refuse a load with two requirements or none, and a number that nothing places."""
        if None not in (self.energy, self.force) or (self.asks is None and self.energy is self.force is None):
            raise ValueError(
                f"energy: one of energy and force is needed, got {self.energy!r} and {self.force!r}; one, or `asks` "
                "for what the code asks of the vehicle"
            )
        other = "energy" if self.asks == "crush" else "force"
        if self.asks is not None and getattr(self, other) is not None:
            raise ValueError(f"{other}: {self.asks!r} is no load of that kind, got {getattr(self, other)!r}; null")
        if self.asks is None and (self.come_from is None or self.point is None):
            missing = "come_from" if self.come_from is None else "point"
            raise ValueError(f"{missing}: not given, got a load of a number of its own; needed, or `asks`")


@parameters
class StaticTest:
    """The chassis is held; a beam on a guide pushes the ROPS load by load, each released before the next.

    The sequence of the static tests for agricultural tractors (OECD Codes 4, 6 and 7). The beam is one-sided: it
    pushes and never pulls, along its guide only, as a beam on a universal joint does.
    """

    kind: Literal["static-test"] = "static-test"
    code: Annotated[Code | None, "by whose formulae; null: the one that applies to frame, track and mass"] = None
    loads: Annotated[tuple[StaticLoad, ...] | None, "null: the sequence of the code for this vehicle"] = None
    surplus: Annotated[
        float, Quantity("1", "share by which each load goes on beyond what the code asks", least=0, most=1)
    ] = 0.0
    push_on: Annotated[
        str | None, "name of the load that goes on until the frame fails, the last one then: its margin is measured"
    ] = None
    rate: Annotated[float, Quantity("m/s", "of the beam; a standard allows 0.005", above=0, most=1)] = 0.1
    force_rate: Annotated[float, Quantity("N/s", "at which a force is put on and taken off", above=0)] = 1.0e5
    hold: Annotated[float, Quantity("s", "that a force stays on after the deflection stopped", least=0)] = 0.2
    pause: Annotated[float, Quantity("s", "between two loads", least=0)] = 0.2
    contact_stiffness: Annotated[float, Quantity("N/m", "between beam and ROPS", above=0)] = 2.0e7
    contact_damping: Annotated[float, Quantity("N s/m", "between beam and ROPS", least=0)] = 2.0e3
    most_deflection: Annotated[float, Quantity("m", "at which a load is given up", above=0)] = 0.6
    beam_length: Annotated[float, Quantity("m", "of the beam, drawn only", least=0.25, most=0.7)] = 0.5

    def validate(self) -> None:
        """Refuse an empty sequence, loads that share a name, and an unknown one to push on."""
        if self.loads is None:
            return
        names = [load.name for load in self.loads]
        if not names:
            raise ValueError("loads: none given; at least one load")
        if len(set(names)) != len(names):
            raise ValueError(f"loads: two loads share a name, got {names}; each name once")

    @property
    def heading_deg(self) -> float:
        """The vehicle stands along x."""
        return 0.0


@parameters
class Lashing:
    """A rope between the vehicle and the ground, or a strut that props it: a spring that works one way."""

    name: Annotated[str, Label("of the lashing")]
    body: Literal["chassis", "front_axle"] = "chassis"
    point: Annotated[Point, Quantity("m", "on the vehicle, vehicle axes")]
    anchor: Annotated[Point, Quantity("m", "on the ground, vehicle axes of the standing vehicle")]
    stiffness: Annotated[float, Quantity("N/m", above=0)]
    damping: Annotated[float, Quantity("N s/m", least=0)] = 0.0
    preload: Annotated[float, Quantity("N", "tension or thrust before the blow", least=0)] = 0.0
    strut: Annotated[bool, "pushes only; else it is a rope, which only pulls"] = False

    def validate(self) -> None:
        """Refuse a rope without length."""
        if math.dist(self.point, self.anchor) < 0.01:
            raise ValueError(f"anchor: less than 10 mm from the point, got {self.anchor}; another place")


@parameters
class PendulumBlow:
    """A block on chains falls against the ROPS of the standing, lashed vehicle (OECD Code 3, ISO 3463).

    Block and chains turn as one about a horizontal axis at `pivot_height`; the face is at right angles to the way
    of the block. `height` is that of the block's centre of mass at release above its place at first contact.
    """

    kind: Literal["pendulum-blow"] = "pendulum-blow"
    come_from: Annotated[Literal["front", "rear", "left", "right"], "the side that the block comes from"]
    point: Annotated[Point, Quantity("m", "on the ROPS that the middle of the face hits, vehicle axes")]
    height: Annotated[float, Quantity("m", "of fall, H", above=0, most=3)]
    chain_angle_deg: Annotated[
        float, Quantity("deg", "of the chains at first contact, before the lowest point", least=-30, most=30)
    ] = 0.0
    pivot_height: Annotated[float, Quantity("m", "of the axis above ground", least=4, most=20)] = 6.0
    mass: Annotated[float, Quantity("kg", "of the block", above=0)] = 2000.0
    face: Annotated[float, Quantity("m", "side of the square face", above=0)] = 0.68
    depth: Annotated[float, Quantity("m", "of the block", above=0)] = 0.60
    contact_stiffness: Annotated[float, Quantity("N/m3", "of face and ROPS, for each area in contact", above=0)] = 4e8
    contact_damping: Annotated[float, Quantity("s", "damping over stiffness of the contact", least=0)] = 1e-3
    lashings: tuple[Lashing, ...] = ()

    @property
    def heading_deg(self) -> float:
        """The vehicle stands along x."""
        return 0.0


@parameters
class TiltTable:
    """The table on which the vehicle stands is tilted slowly until it overturns.

    Told in the table's axes: gravity turns instead of the table. What a turning table adds, of the order of
    (rate)^2 h, is left out; at 1 deg/s it is 1e-4 of gravity. Once a wheel has lifted the table only creeps: a
    balance that is lost takes seconds to show, and the table would be degrees further by then.
    """

    kind: Literal["tilt-table"] = "tilt-table"
    heading_deg: Annotated[
        float, Quantity("deg", "of the vehicle on the table; y is downhill", least=-360, most=360)
    ] = 0.0
    from_deg: Annotated[float, Quantity("deg", "where the vehicle is put down on its wheels", least=0, most=80)] = 0.0
    to_deg: Annotated[float, Quantity("deg", "where the table stops", above=0, most=85)] = 70.0
    rate_deg: Annotated[float, Quantity("deg/s", "of the table", above=0, most=20)] = 1.0

    creep: Annotated[
        float, Quantity("1", "share of the rate at which it goes on once a wheel has lifted", above=0, most=1)
    ] = 0.05

    def validate(self) -> None:
        """Refuse a table that does not move."""
        if self.to_deg <= self.from_deg:
            raise ValueError(f"to_deg: not beyond from_deg ({self.from_deg:g}), got {self.to_deg:g}; larger")


Stand = StaticTest | PendulumBlow | TiltTable
