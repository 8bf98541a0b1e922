"""The array of ground impact elements over a rectangle: layout now, memory and look-up with the kernel."""

from __future__ import annotations

from typing import Annotated

from ground.quantity import Quantity, parameters

MOST_ELEMENTS = 4_000_000


@parameters
class Elements:
    """A rectangle of elements, each `spacing` large (measured in the horizontal plane)."""

    length: Annotated[float, Quantity("m", "along x", above=0)]
    width: Annotated[float, Quantity("m", "along y", above=0)]
    centre: Annotated[tuple[float, float], Quantity("m", "of the rectangle, world x and y")] = (0.0, 0.0)
    spacing: Annotated[tuple[float, float], Quantity("m", "of an element along x and y", above=0)] = (0.05, 0.05)

    def validate(self) -> None:
        """Refuse an array that is larger than any machine is meant to hold."""
        if self.count[0] * self.count[1] > MOST_ELEMENTS:
            nx, ny = self.count
            raise ValueError(f"spacing: gives {nx} x {ny} elements; at most {MOST_ELEMENTS} in all")

    @property
    def count(self) -> tuple[int, int]:
        """Elements along x and y."""
        return (
            max(1, round(self.length / self.spacing[0])),
            max(1, round(self.width / self.spacing[1])),
        )


@parameters
class CoMovingMass:
    """Soil that moves with the striker, as a share of the effective mass at its contact; Ye 2006, eq (10)."""

    fraction: Annotated[float, Quantity("1", "m_b1/m_s, 0.10 by Kroeber 1988 and Ye 2006", least=0, most=10)] = 0.10
