"""A bogie: wheels one behind the other on a beam that swings about a pin across the vehicle (data only)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Annotated

from ground.quantity import Label, Quantity, parameters
from rollover.spec.inertia import MassProperties
from rollover.spec.shapes import Point


@parameters
class Bogie:
    """A beam on one side, which the wheels that name it stand on; its pin is on the body that carries these wheels.

    On a pin without friction the moments of the wheels about it are in balance: two of them at a and b from the pin
    carry N_1 a = N_2 b, whatever the ground's height under each. Stops end its swing.
    """

    name: Annotated[str, Label("left, right")]
    pivot: Annotated[Point, Quantity("m", "of the pin, which lies along y, vehicle axes")]
    body: Annotated[MassProperties, "of the beam with its wheels; part of what carries it, vehicle axes"]
    swing_deg: Annotated[float, Quantity("deg", "free, up and down", above=0, most=60)] = 15.0
    stop_stiffness: Annotated[float, Quantity("N m/rad", "added beyond the swing", least=0)] = 1.0e6
    damping: Annotated[float, Quantity("N m s/rad", "of the pin, about y", least=0)] = 0.0
    stiffness: Annotated[float, Quantity("N/m", "of the pin in its bearing, along each axis", above=0)] = 2.0e7
    bending: Annotated[float, Quantity("N m/rad", "of the pin and the beam, about x and z", above=0)] = 5.0e6

    @property
    def part(self) -> str:
        """Name of its body."""
        return body_of(self.name)

    @property
    def row(self) -> tuple[float, ...]:
        """Numbers of its joint after the two points, as the kernels take them; a tenth of critical across the swing."""
        swing, free = math.radians(self.swing_deg), math.pi
        along, about = damped(self.stiffness, self.body.mass), damped(self.bending, max(self.body.inertia))
        turns = (self.bending, 0.0, self.bending, about, self.damping, about)
        return (self.stiffness, along, *turns, -free, -swing, -free, free, swing, free, self.stop_stiffness)


def body_of(bogie: str) -> str:
    """Name of the body of a bogie's beam."""
    return f"bogie_{bogie}"


def damped(stiffness: float, inertia: float, share: float = 0.1) -> float:
    """Dashpot 2 share sqrt(k m) beside a spring, a share of critical."""
    return 2.0 * share * math.sqrt(stiffness * inertia)


def check_bogies(bogies: Sequence[Bogie], stands: Mapping[str, Sequence[tuple[str, Point]]]) -> None:
    """Raise ``ValueError`` for bogies that cannot swing between their wheels; `stands`: carrier and place by bogie."""
    names = [b.name for b in bogies]
    if len(set(names)) != len(names):
        raise ValueError(f"bogies: two bogies share a name, got {names}; each name once")
    for name in stands:
        if name not in names:
            raise ValueError(f"wheels: a wheel stands on bogie {name!r}, got {names or 'no bogies'}; one of these")
    for bogie in bogies:
        on = stands.get(bogie.name, [])
        if len({carrier for carrier, _ in on}) > 1:
            carriers = sorted({carrier for carrier, _ in on})
            raise ValueError(f"bogies.{bogie.name}: its wheels have several carriers, got {carriers}; the same")
        if any(carrier == "front_axle" for carrier, _ in on):
            raise ValueError(f"bogies.{bogie.name}: got wheels on the front axle; carrier 'chassis' or 'trailer'")
        ways = [place[0] - bogie.pivot[0] for _, place in on]
        if not ways or not min(ways) < 0.0 < max(ways):
            where = ", ".join(f"{way:g} m" for way in ways) or "no wheel"
            raise ValueError(
                f"bogies.{bogie.name}.pivot: its beam falls over, got wheels at {where} ahead of the pin; "
                f"one ahead of it and one behind"
            )
