"""Mass, centre of mass and inertia of a body."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from ground.quantity import Quantity, parameters
from rollover.spec.shapes import Point


@parameters
class MassProperties:
    """Mass, centre of mass and inertia tensor about it, in vehicle axes."""

    mass: Annotated[float, Quantity("kg", above=0)]
    centre_of_mass: Annotated[Point, Quantity("m")]
    inertia: Annotated[Point, Quantity("kg m2", "Ixx, Iyy, Izz about the centre of mass", above=0)]
    products: Annotated[Point, Quantity("kg m2", "Ixy, Ixz, Iyz, as elements of the tensor")] = (0.0, 0.0, 0.0)

    def validate(self) -> None:
        """Refuse what no body can have: an inertia beyond the triangle inequality, or not positive definite."""
        a, b, c = sorted(self.inertia)
        if c > a + b:
            raise ValueError(
                f"inertia: violates the triangle inequality, got {list(self.inertia)}; "
                f"the largest ({c:g}) may be at most the sum of the others ({a + b:g} kg m2)"
            )
        ixx, iyy, izz = self.inertia
        ixy, ixz, iyz = self.products
        minor = ixx * iyy - ixy * ixy
        determinant = izz * minor - ixx * iyz * iyz - iyy * ixz * ixz + 2.0 * ixy * ixz * iyz
        if minor <= 0.0 or determinant <= 0.0:
            raise ValueError(f"products: inertia is not positive definite, got {list(self.products)}; smaller products")


def combined(parts: Sequence[MassProperties], less: Sequence[MassProperties] = ()) -> MassProperties:
    """Mass properties of parts taken together, without those of `less`; by the parallel axis theorem.

    Raises ``ValueError`` if what is left weighs nothing or has an inertia that no body can have.
    """
    signed = [(1.0, p) for p in parts] + [(-1.0, p) for p in less]
    mass = sum(p.mass for p in parts) - sum(p.mass for p in less)
    if mass <= 0.0:
        raise ValueError(f"mass: nothing is left, got {mass:g} kg; greater than 0 kg is allowed")
    first = [
        sum(p.mass * p.centre_of_mass[i] for p in parts) - sum(p.mass * p.centre_of_mass[i] for p in less)
        for i in range(3)
    ]
    centre = (first[0] / mass, first[1] / mass, first[2] / mass)

    def about_centre(p: MassProperties, sign: float) -> list[float]:
        x, y, z = (c - w for c, w in zip(p.centre_of_mass, centre, strict=True))
        m = p.mass
        diagonal = [m * (y * y + z * z), m * (x * x + z * z), m * (x * x + y * y)]
        off = [-m * x * y, -m * x * z, -m * y * z]
        return [sign * (i + s) for i, s in zip((*p.inertia, *p.products), diagonal + off, strict=True)]

    total = [sum(terms) for terms in zip(*(about_centre(p, sign) for sign, p in signed), strict=True)]
    return MassProperties(
        mass=mass,
        centre_of_mass=centre,
        inertia=(total[0], total[1], total[2]),
        products=(total[3], total[4], total[5]),
    )


def cuboid(mass: float, centre: Point, size: Point) -> MassProperties:
    """Mass properties of a solid cuboid with edges `size` along the vehicle axes."""
    a, b, c = (edge * edge for edge in size)
    inertia = (mass * (b + c) / 12.0, mass * (a + c) / 12.0, mass * (a + b) / 12.0)
    return MassProperties(mass=mass, centre_of_mass=centre, inertia=inertia)
