"""Mass, centre of mass and inertia of a body."""

from __future__ import annotations

from typing import Annotated

from ground.quantity import Quantity, parameters
from rollover.shapes import Point


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
