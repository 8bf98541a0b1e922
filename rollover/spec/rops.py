"""The roll-over protective structure: members, mounts and hinges, clearance zone (data only)."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray

from ground.kinds import ByKind
from ground.quantity import Later, Quantity, parameters
from rollover.spec.beam import Beam
from rollover.spec.connections import Connection, check_connections
from rollover.spec.connector import Connector
from rollover.spec.feet import Foot, side_stiffnesses, springs
from rollover.spec.inertia import MassProperties
from rollover.spec.mechanism import Joint, free_motions, sentence
from rollover.spec.provenance import Provenance
from rollover.spec.shapes import Box, Disc, Point, Points, Shape, Tube

Member = Annotated[Box | Tube | Disc | Points | Beam, ByKind(usual="beam")]


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
class Upper:
    """The upper part of a frame in two parts: a body of its own on hinges.

    A fold, a plastic hinge at a post's foot, a weld at mid-height: what the hinges' axes let through.
    """

    body: MassProperties
    hinges: Annotated[tuple[Connector, ...], "between the lower and the upper part"]
    members: Annotated[tuple[Member, ...], "tubes, beams and boxes of the upper part that can touch the ground"]


@parameters
class Rops:
    """A frame on its mounts, in one part or two; it is rigid, the sway of its posts is in mounts, hinges and feet.

    With `segments` its posts bend along their length instead, and half of what ties their heads with each.
    """

    frame: Literal["two-post-rear", "two-post-front", "four-post", "cab"]
    body: Annotated[MassProperties, "of the frame; without its upper part if there is one"]
    mounts: Annotated[tuple[Connector, ...], "between the chassis and the frame, as stiff and strong as said here"] = ()
    feet: Annotated[
        tuple[Foot, ...], "where beams stand on the chassis: as stiff and strong as their sections and steel", Later()
    ] = ()
    members: Annotated[tuple[Member, ...], "tubes, beams with a section and boxes that can touch the ground"]
    connections: Annotated[
        tuple[Connection, ...], "welds, bolts and cast pieces at ends of members, which `rollover rops` holds", Later()
    ] = ()
    segments: Annotated[
        int | None,
        Quantity("1", "of each post, which then bends in a run; null: a spring at each foot", least=2, most=100),
        Later(),
    ] = None
    upper: Upper | None = None
    corner: Annotated[Point, Quantity("m", "upper corner whose deflection is reported; the left one, y > 0")]
    other_corners: Annotated[
        tuple[Point, ...], "further upper corners, left ones, m; of all, the loaded one is reported"
    ] = ()
    clearance_zone: ClearanceZone | None = None
    provenance: tuple[Provenance, ...] = ()

    def validate(self) -> None:
        """Refuse a frame that nothing holds or that its joints leave a motion, and joints that share a name."""
        for what, joints in (("mounts", self.standing), ("upper.hinges", self.hinges)):
            names = [m.name for m in joints]
            if not names and (what == "mounts" or self.upper is not None):
                feet = ", or feet of members with a section" if what == "mounts" else ""
                raise ValueError(f"{what}: none given; at least one{feet}")
            if len(set(names)) != len(names):
                raise ValueError(f"{what}: two share a name, got {names}; each name once")
        check_connections(self.connections, self.beams)
        if self.segments is not None:
            self._posts_bend()
        if free := free_motions({name: body for name, (body, _) in self.parts.items()}, self.joints):
            raise ValueError(sentence(free))

    def _posts_bend(self) -> None:
        """Refuse segments where there are no posts to bend, and what a post that bends does not have."""
        if not self.feet:
            raise ValueError(f"segments: no feet, got {self.segments}; feet of members with a section, or null")
        if self.upper is not None:
            raise ValueError(f"segments: a frame in two parts has none, got {self.segments}; null, or no upper part")
        if loose := [f for f in self.feet if f.play > 0.0]:
            what = f"feet.{loose[0].name}.play"
            raise ValueError(f"{what}: a post that bends has no play, got {loose[0].play:g} m; 0, or segments: null")

    @property
    def hinges(self) -> tuple[Connector, ...]:
        """Between the lower and the upper part, none if the frame is in one part."""
        return self.upper.hinges if self.upper is not None else ()

    @property
    def joints(self) -> tuple[Joint, ...]:
        """Mounts, then hinges, with the parts that they join."""
        sides = (
            ("mounts", "chassis", "rops", self.mounts),
            ("feet", "chassis", "rops", self.standing[len(self.mounts) :]),
            ("upper.hinges", "rops", "rops_upper", self.hinges),
        )
        return tuple(
            Joint(path=f"{path}.{c.name}", below=below, above=above, connector=c)
            for path, below, above, connectors in sides
            for c in connectors
        )

    @property
    def connectors(self) -> tuple[Connector, ...]:
        """Mounts and feet, then hinges."""
        return self.standing + self.hinges

    @property
    def standing(self) -> tuple[Connector, ...]:
        """Mounts, then feet as the springs that stand for their posts."""
        return self.mounts + (springs(self.feet, self.beams, self.body) if self.feet else ())

    @property
    def side_stiffness(self) -> dict[str, float]:
        """What each mount and foot puts against a load along y, by its path (`mounts.left`, `feet.left`), N/m."""
        feet = side_stiffnesses(self.feet, self.beams, self.body)
        return {f"mounts.{m.name}": m.stiffness[1] for m in self.mounts} | {f"feet.{n}": k for n, k in feet.items()}

    @property
    def parts(self) -> dict[str, tuple[MassProperties, tuple[Shape, ...]]]:
        """Bodies of the frame by name, from below: mass properties and members."""
        found = {"rops": (self.body, shapes(self.members))}
        if self.upper is not None:
            found["rops_upper"] = (self.upper.body, shapes(self.upper.members))
        return found

    @property
    def beams(self) -> tuple[Beam, ...]:
        """Members that have a section, of both parts."""
        upper = () if self.upper is None else self.upper.members
        return tuple(m for m in (*self.members, *upper) if isinstance(m, Beam))


def shapes(members: tuple[Member, ...]) -> tuple[Shape, ...]:
    """What of members can touch the ground."""
    return tuple(m.tube if isinstance(m, Beam) else m for m in members)
