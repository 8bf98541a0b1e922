"""The roll-over protective structure: members, mounts with their load-deflection law, clearance zone (data only)."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray

from ground.quantity import Label, Quantity, parameters
from rollover.inertia import MassProperties
from rollover.provenance import Provenance
from rollover.shapes import Point, Shape


@parameters
class Mount:
    """What joins the ROPS to the chassis: per axis an elastic, perfectly plastic spring with a dashpot.

    The frame is rigid in the model: the sway of its posts is part of the mounts' compliance. Force on each axis
    (vehicle axes): clip(k (delta - delta_p -+ play), +-F_y), delta_p the permanent set; no yield force, no yielding.
    """

    name: Annotated[str, Label("in channels: rops/mount/NAME/force_x")]
    position: Annotated[Point, Quantity("m", "vehicle axes")]
    stiffness: Annotated[Point, Quantity("N/m", "along x, y, z", above=0)]
    damping: Annotated[Point, Quantity("N s/m", "along x, y, z", least=0)]
    rotational_stiffness: Annotated[Point, Quantity("N m/rad", "about x, y, z", least=0)] = (0.0, 0.0, 0.0)
    rotational_damping: Annotated[Point, Quantity("N m s/rad", "about x, y, z", least=0)] = (0.0, 0.0, 0.0)
    yield_force: Annotated[tuple[float | None, float | None, float | None], Quantity("N", "F_y", above=0)] = (
        None,
        None,
        None,
    )
    play: Annotated[Point, Quantity("m", "free way to either side along x, y, z", least=0)] = (0.0, 0.0, 0.0)


@parameters
class ClearanceZone:
    """The operator's space, after the static test of Code 4: upright planes, then leaning in towards the top."""

    seat_reference_point: Annotated[Point, Quantity("m", "vehicle axes")]
    half_width: Annotated[float, Quantity("m", "of the upright planes", above=0)] = 0.250
    shoulder_height: Annotated[float, Quantity("m", "where the planes begin to lean", above=0)] = 0.300
    height: Annotated[float, Quantity("m", "of the zone above the reference point", above=0)] = 0.900
    top_half_width: Annotated[float, Quantity("m", above=0)] = 0.150
    front_reach: Annotated[float, Quantity("m", "ahead of the reference point", above=0)] = 0.550
    rear_reach: Annotated[float, Quantity("m", "behind the reference point, to the seat back", least=0)] = 0.0

    def corners(self) -> NDArray[np.float64]:
        """Corners in vehicle axes, (12, 3): rear ring of six, then front ring of six, each bottom to top."""
        x, y, z = self.seat_reference_point
        ring = [
            (-self.half_width, 0.0),
            (-self.half_width, self.shoulder_height),
            (-self.top_half_width, self.height),
            (self.top_half_width, self.height),
            (self.half_width, self.shoulder_height),
            (self.half_width, 0.0),
        ]
        return np.array([(x + dx, y + dy, z + dz) for dx in (-self.rear_reach, self.front_reach) for dy, dz in ring])


@parameters
class Rops:
    """A frame on its mounts."""

    frame: Literal["two-post-rear", "two-post-front", "four-post", "cab"]
    body: MassProperties
    mounts: tuple[Mount, ...]
    members: Annotated[tuple[Shape, ...], "tubes and boxes that can touch the ground"]
    corner: Annotated[Point, Quantity("m", "upper corner whose deflection is reported; the left one, y > 0")]
    clearance_zone: ClearanceZone | None = None
    provenance: tuple[Provenance, ...] = ()

    def validate(self) -> None:
        """Refuse a frame that nothing holds, or mounts that share a name."""
        names = [m.name for m in self.mounts]
        if not names:
            raise ValueError("mounts: none given; at least one mount")
        if len(set(names)) != len(names):
            raise ValueError(f"mounts: two mounts share a name, got {names}; each name once")
