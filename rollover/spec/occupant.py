"""A rider or driver as a chain of three rigid bodies on a seat, with a lap belt or without (data only).

Pelvis with the legs, torso with the arms, head with the neck; joints with passive stiffness and stops; spheres that
press on seat, frame and vehicle. It moves and loads as a body of such masses does. It is no dummy and no measure of
injury: no criterion is worked out from it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

from ground.quantity import Quantity, parameters
from rollover.spec.inertia import MassProperties, cuboid
from rollover.spec.rops import Rops
from rollover.spec.shapes import Box, Point, Shape, Tube

PARTS = ("pelvis", "torso", "head")
# share of the mass: with the legs, with the arms, with the neck (recalled, Winter 1990 after Dempster 1955: pelvis
# 0.142, legs 2 x 0.161, thorax and abdomen 0.355, arms 2 x 0.050, head and neck 0.081)
SHARES = (0.464, 0.455, 0.081)
# heights over the sitting height: joints, and middles and sizes of the parts; estimates
LUMBAR, NECK, MIDDLES = 0.20, 0.70, (0.10, 0.45, 0.86)
THIGH = 0.15  # m, the middle of pelvis and legs lies ahead of the hips
SIZES = ((0.60, 0.36, 0.18), (0.24, 0.44, 0.45), (0.19, 0.16, 0.25))  # m, of the cuboids that give inertia and outline
HIP = 0.09  # m, radius of the spheres that sit
FEET = 0.14, 0.11  # m, of these from their middle along x and y
CUSHION = 0.25, 0.24, 0.10  # m, half length, half width, depth
ROUNDING = 1e-6  # m, what touches is clear
BACKREST = -0.165, 0.08, 0.60  # m, its face behind the seat, its depth; height over the sitting height


@parameters
class BodyJoint:
    """A ball joint between two parts: springs about x, y, z of the lower part, and stops where its range ends."""

    stiffness: Annotated[Point, Quantity("N m/rad", "passive, about x, y, z", least=0)]
    damping: Annotated[Point, Quantity("N m s/rad", "about x, y, z", least=0)]
    low_deg: Annotated[Point, Quantity("deg", "least angles about x, y, z", least=-120, most=0)]
    high_deg: Annotated[Point, Quantity("deg", "largest angles; about y is a bow", least=0, most=120)]
    stop_stiffness: Annotated[float, Quantity("N m/rad", "added beyond the range", least=0)] = 2000.0

    @property
    def row(self) -> tuple[float, ...]:
        """Stiffness (3), damping (3), least (3) and largest angles (3, rad), stop: as the kernels take them."""
        angles = [math.radians(angle) for angle in (*self.low_deg, *self.high_deg)]
        return (*self.stiffness, *self.damping, *angles, self.stop_stiffness)


@parameters
class LapBelt:
    """Two straps between the seat and the hips that pull only, T = k e (1 + chi de/dt)."""

    anchor: Annotated[Point, Quantity("m", "of the left strap, from `seat`; the right one mirrors it")] = (
        -0.10,
        0.24,
        -0.05,
    )
    stiffness: Annotated[float, Quantity("N/m", "k, of each strap", above=0)] = 1.0e5
    damping: Annotated[float, Quantity("s/m", "chi", least=0)] = 0.5
    slack: Annotated[float, Quantity("m", "of each strap", least=0, most=0.5)] = 0.01


@parameters
class Occupant:
    """Who sits on the vehicle; on top of its `whole`, as what is attached is."""

    mass: Annotated[float, Quantity("kg", above=0, most=250)] = 75.0
    sitting_height: Annotated[float, Quantity("m", "from the cushion to the top of the head", least=0.5, most=1.2)] = (
        0.90
    )
    seat: Annotated[Point, Quantity("m", "middle of the cushion's upper face under the hips, vehicle axes")]
    belt: Annotated[LapBelt | None, "null: none"] = None
    cushion_stiffness: Annotated[float, Quantity("N/m", "of the seat under the hips", above=0)] = 4.0e4
    contact_stiffness: Annotated[float, Quantity("N/m", "of a part against backrest, frame and vehicle", above=0)] = (
        5.0e4
    )
    contact_damping: Annotated[float, Quantity("s/m", "chi, N = k d (1 + chi dd/dt)", least=0)] = 1.0
    friction: Annotated[float, Quantity("1", "on seat, frame and vehicle", least=0, most=2)] = 0.4
    joint_stiffness: Annotated[float, Quantity("N/m", "what holds two parts together, along each axis", above=0)] = (
        2.0e5
    )
    joint_damping: Annotated[float, Quantity("N s/m", least=0)] = 400.0
    lumbar: Annotated[BodyJoint, "between pelvis and torso"] = BodyJoint(
        stiffness=(500.0, 500.0, 300.0),
        damping=(30.0, 30.0, 20.0),
        low_deg=(-30.0, -25.0, -35.0),
        high_deg=(30.0, 60.0, 35.0),
    )
    neck: Annotated[BodyJoint, "between torso and head"] = BodyJoint(
        stiffness=(40.0, 40.0, 20.0),
        damping=(2.0, 2.0, 1.0),
        low_deg=(-45.0, -60.0, -70.0),
        high_deg=(45.0, 60.0, 70.0),
        stop_stiffness=500.0,
    )

    @property
    def parts(self) -> dict[str, MassProperties]:
        """Mass properties of the three parts in the posture that it sits in, by name."""
        return {
            name: cuboid(share * self.mass, self._at(THIGH if name == "pelvis" else 0.0, middle), size)
            for name, share, middle, size in zip(PARTS, SHARES, MIDDLES, SIZES, strict=True)
        }

    @property
    def outlines(self) -> dict[str, Shape]:
        """What of each part can touch the ground: its cuboid."""
        found: dict[str, Shape] = {}
        for (name, body), size in zip(self.parts.items(), SIZES, strict=True):
            low, high = (
                tuple(c + sign * 0.5 * s for c, s in zip(body.centre_of_mass, size, strict=True)) for sign in (-1, 1)
            )
            found[name] = Box(name=f"occupant_{name}", low=low, high=high)  # type: ignore[arg-type]
        return found

    @property
    def spheres(self) -> tuple[tuple[str, Point, float], ...]:
        """Part, middle in vehicle axes and radius of what presses on seat, frame and vehicle; the hips come first.

        Four hips about the whole body's centre of mass carry a quarter of its weight each.
        """
        x, (dx, dy) = SHARES[0] * THIGH, FEET
        h = self.sitting_height
        hips = [("pelvis", (x + a * dx, b * dy, HIP), HIP) for a in (1.0, -1.0) for b in (1.0, -1.0)]
        torso = [("torso", (0.0, side * 0.16, 0.62 * h), 0.08) for side in (1.0, -1.0)]
        torso += [("torso", (-0.06, 0.0, 0.30 * h), 0.10), ("torso", (-0.04, 0.0, 0.50 * h), 0.12)]
        every = [*hips, *torso, ("head", (0.0, 0.0, 0.86 * h), 0.10)]
        sx, sy, sz = self.seat
        return tuple((part, (sx + x, sy + y, sz + z), radius) for part, (x, y, z), radius in every)

    @property
    def seat_boxes(self) -> tuple[Box, Box]:
        """Cushion and backrest, as they stand unloaded on the chassis."""
        x, y, z = self.seat
        (length, width, depth), (face, thick, height) = CUSHION, BACKREST
        cushion = Box(name="cushion", low=(x - length, y - width, z - depth), high=(x + length, y + width, z))
        behind = x + face
        return cushion, Box(
            name="backrest",
            low=(behind - thick, y - width, z),
            high=(behind, y + width, z + height * self.sitting_height),
        )

    @property
    def joints(self) -> tuple[tuple[str, str, str, Point, BodyJoint], ...]:
        """Name, lower and upper part, place in vehicle axes, and what it holds with."""
        return (
            ("lumbar", "pelvis", "torso", self._at(0.0, LUMBAR), self.lumbar),
            ("neck", "torso", "head", self._at(0.0, NECK), self.neck),
        )

    @property
    def straps(self) -> tuple[tuple[str, Point, Point], ...]:
        """Name, anchor on the chassis and place on the pelvis of each strap, vehicle axes; none without a belt."""
        if self.belt is None:
            return ()
        (x, y, z), (ax, ay, az) = self.seat, self.belt.anchor
        return tuple(
            (name, (x + ax, y + side * ay, z + az), (x + 0.06, y + side * 0.16, z + 0.16))
            for name, side in (("left", 1.0), ("right", -1.0))
        )

    def _at(self, ahead: float, share: float) -> Point:
        x, y, z = self.seat
        return x + ahead, y, z + share * self.sitting_height


@dataclass(frozen=True, kw_only=True)
class Pair:
    """A sphere of a part and what it may press on: a shape of a body of the vehicle."""

    part: str
    middle: Point
    radius: float
    carrier: str
    shape: Box | Tube
    sits: bool  # a hip on the cushion


def pairs(occupant: Occupant, outline: tuple[Shape, ...], rops: Rops | None) -> tuple[Pair, ...]:
    """Every sphere of the occupant with the seat, the boxes of the outline, boxes and tubes of the ROPS."""
    cushion, backrest = occupant.seat_boxes
    shapes: list[tuple[str, Shape]] = [("chassis", s) for s in (cushion, backrest, *outline)]
    if rops is not None:
        shapes += [(body, s) for body, (_, members) in rops.parts.items() for s in members]
    return tuple(
        Pair(
            part=part,
            middle=middle,
            radius=radius,
            carrier=carrier,
            shape=shape,
            sits=part == "pelvis" and shape is cushion,
        )
        for part, middle, radius in occupant.spheres
        for carrier, shape in shapes
        if isinstance(shape, (Box, Tube))
    )


def overlap(pair: Pair) -> float:
    """How deep a sphere stands in its shape in the design position, m; below zero where it is clear of it."""
    p, shape = pair.middle, pair.shape
    if isinstance(shape, Box):
        near = [min(max(c, low), high) for c, low, high in zip(p, shape.low, shape.high, strict=True)]
        inside = [max(low - c, c - high) for c, low, high in zip(p, shape.low, shape.high, strict=True)]
        return pair.radius - (math.dist(p, near) if near != list(p) else max(inside))
    axis = [b - a for a, b in zip(shape.start, shape.end, strict=True)]
    along = sum((c - a) * e for c, a, e in zip(p, shape.start, axis, strict=True)) / sum(e * e for e in axis)
    along = min(max(along, 0.0), 1.0)
    near = [a + along * e for a, e in zip(shape.start, axis, strict=True)]
    return pair.radius + 0.5 * shape.diameter - math.dist(p, near)


def check_room(occupant: Occupant, outline: tuple[Shape, ...], rops: Rops | None) -> None:
    """Refuse a seat on which the occupant stands in the vehicle. Raises ``ValueError``."""
    for pair in pairs(occupant, outline, rops):
        if not pair.sits and (deep := overlap(pair)) > ROUNDING:
            raise ValueError(
                f"occupant.seat: the {pair.part} stands {1e3 * deep:.3g} mm in {pair.shape.name}, got "
                f"{list(occupant.seat)} m; a seat that is clear of it"
            )
