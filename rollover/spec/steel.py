"""Steels of members: elastic, yield, hardening up to the tensile strength, rate of strain (data only)."""

from __future__ import annotations

from typing import Annotated

from ground.quantity import Label, Quantity, parameters
from rollover.spec.provenance import Provenance


@parameters
class CowperSymonds:
    """At a strain rate e the steel yields at f_y (1 + (e/D)^(1/q))."""

    rate: Annotated[float, Quantity("1/s", "D", above=0)]
    exponent: Annotated[float, Quantity("1", "q", least=1, most=20)]


@parameters
class Steel:
    """A steel: elastic up to its yield strength, then a straight line up to its tensile strength, kinematic hardening.

    Strengths are those of the tension test, force over first section. f_y is the least that a grade promises; what is
    delivered has more, up to a fifth: a certificate's own number is better.
    """

    name: Annotated[str, Label("of the grade, as results tell it")]
    yield_strength: Annotated[float, Quantity("Pa", "f_y", above=0, most=3e9)]
    tensile_strength: Annotated[float, Quantity("Pa", "f_u", above=0, most=3e9)]
    uniform_strain: Annotated[float, Quantity("1", "strain at f_u, before the neck", above=0, most=0.5)]
    youngs_modulus: Annotated[float, Quantity("Pa", "E", above=0)] = 210e9
    poisson_ratio: Annotated[float, Quantity("1", "nu", least=0, below=0.5)] = 0.3
    density: Annotated[float, Quantity("kg/m3", above=0)] = 7850.0
    rate_factor: Annotated[CowperSymonds | None, "null: the yield does not depend on the rate"] = None
    provenance: tuple[Provenance, ...] = ()

    def validate(self) -> None:
        """Refuse a steel that softens, and one whose tensile strength is reached before it yields."""
        if self.tensile_strength < self.yield_strength:
            raise ValueError(
                f"yield_strength: above the tensile strength ({self.tensile_strength:g} Pa), got "
                f"{self.yield_strength:g}; at most that, or another tensile_strength beside it"
            )
        if self.uniform_strain <= self.tensile_strength / self.youngs_modulus:
            raise ValueError(
                f"uniform_strain: reached before the steel yields, got {self.uniform_strain:g}; above f_u/E = "
                f"{self.tensile_strength / self.youngs_modulus:.3g}"
            )

    @property
    def shear_modulus(self) -> float:
        """G = E/(2 (1 + nu)), Pa."""
        return 0.5 * self.youngs_modulus / (1.0 + self.poisson_ratio)

    @property
    def tangent(self) -> float:
        """Slope of the straight line after yield, (f_u - f_y)/(strain at f_u - f_y/E), Pa."""
        rise = self.tensile_strength - self.yield_strength
        return rise / (self.uniform_strain - self.yield_strength / self.youngs_modulus)
