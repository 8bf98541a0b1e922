"""The array of ground impact elements over a rectangle: layout now, memory and look-up with the kernel."""

from __future__ import annotations

from typing import Annotated, Literal

from ground.quantity import Quantity, parameters
from ground.ye import CO_MOVING_FRACTIONS, mass_fraction

Estimate = Literal["ye-2006", "lorenz-1934-low", "lorenz-1934-high", "kundt-1987", "kroeber-1988", "pietzsch-1991"]

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
    """Soil that moves with the striker, as a share of the effective mass at its contact.

    Given as such, by the name of an estimate in Ye 2006, Table 1, or by the loss share x of eq (10), y = x/(1 - x).
    """

    fraction: Annotated[float, Quantity("1", "m_b1/m_s, 0.10 by Kroeber 1988 and Ye 2006", least=0, most=10)] = 0.10
    estimate: Annotated[Estimate | None, "takes the fraction from Table 1 instead"] = None
    loss_share: Annotated[
        float | None,
        Quantity("1", "x, share lost to sound and vibration; takes the fraction from (10)", least=0, below=1),
    ] = None

    def validate(self) -> None:
        """Refuse two answers to one question."""
        if self.estimate is not None and self.loss_share is not None:
            raise ValueError(f"loss_share: got {self.loss_share!r} beside estimate {self.estimate!r}; one of both")

    @property
    def share(self) -> float:
        """The fraction that is meant, m_b1/m_s."""
        if self.estimate is not None:
            return CO_MOVING_FRACTIONS[self.estimate]
        return self.fraction if self.loss_share is None else mass_fraction(self.loss_share)
