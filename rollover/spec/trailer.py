"""What is articulated behind a vehicle: a trailer, an implement, the rear frame of a forwarder (data only)."""

from __future__ import annotations

from typing import Annotated

from ground.quantity import Quantity, parameters
from rollover.spec.inertia import MassProperties
from rollover.spec.occupant import BodyJoint
from rollover.spec.shapes import Point, Shape

FREE = BodyJoint(
    stiffness=(0.0, 0.0, 0.0),
    damping=(100.0, 100.0, 100.0),
    low_deg=(-90.0, -25.0, -75.0),
    high_deg=(90.0, 25.0, 75.0),
    stop_stiffness=1.0e5,
)


@parameters
class Hitch:
    """A stiff ball joint, by which what is behind turns against the vehicle within a range, with springs or without.

    A towing eye turns freely as far as its ring lets it; the central joint of a forwarder is held about y, and about z
    by its steering cylinders.
    """

    position: Annotated[Point, Quantity("m", "of the joint, vehicle axes")]
    stiffness: Annotated[float, Quantity("N/m", "along each axis", above=0)] = 5.0e6
    damping: Annotated[float, Quantity("N s/m", "along each axis", least=0)] = 2.0e4
    turns: Annotated[BodyJoint, "of what is behind against the vehicle: about x roll, about y pitch, about z yaw"] = (
        FREE
    )


@parameters
class Trailer:
    """A body behind the vehicle on a hitch; its wheels and loads say `carrier: trailer`. Not part of the `whole`."""

    body: Annotated[MassProperties, "of the trailer with its wheels, without what is attached to it; vehicle axes"]
    hitch: Hitch
    outline: Annotated[tuple[Shape, ...], "what of it can touch the ground"] = ()
