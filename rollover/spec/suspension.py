"""A wheel on a spring and a damper of its own, and what moves with it (data only)."""

from __future__ import annotations

from typing import Annotated

from ground.quantity import Quantity, parameters
from rollover.spec.inertia import MassProperties, cuboid
from rollover.spec.shapes import Point

GUIDE = 4.0  # of the tyre's larger stiffness: what holds the wheel in its guide moves it by a quarter of the tyre's way


@parameters
class Suspension:
    """The wheel moves along the vehicle's z against its carrier, N = P + k d + c dd/dt, between two stops.

    d is upwards from the design position. A real link turns the wheel a little as well; here it does not.
    """

    mass: Annotated[
        float, Quantity("kg", "of wheel, hub and what of the links goes with it; part of the whole", above=0)
    ]
    stiffness: Annotated[float, Quantity("N/m", "k, of spring and link at the wheel", above=0)]
    damping: Annotated[float, Quantity("N s/m", "c, at the wheel", least=0)] = 0.0
    preload: Annotated[float, Quantity("N", "P, in the design position", least=0)] = 0.0
    bump: Annotated[float, Quantity("m", "travel up to the stop", above=0)] = 0.1
    droop: Annotated[float, Quantity("m", "travel down to the stop", above=0)] = 0.1
    stop_stiffness: Annotated[float, Quantity("N/m", "added beyond the travel", least=0)] = 2.0e5

    def hub(self, centre: Point, radius: float, width: float) -> MassProperties:
        """What moves with the wheel: a cuboid about its centre, turning about the axle with a disc's m r^2/2."""
        edge = 3.0**0.5 * radius
        return cuboid(self.mass, centre, (edge, width, edge))
