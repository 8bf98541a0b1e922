"""Pressure and sinkage of soft ground under a plate, and how it lets go: Bekker (1956, 1969) and Wong.

    p = (k_c/b + k_phi) z^n                  loading, b the smaller side of the plate
    p = p_u - (k_0 + A_u z_u)(z_u - z)       unloading from (z_u, p_u) and loading again up to there

Plates are pressed in slowly: there is no rate in it, nor did a blow calibrate it. As a force on the reference face,
F = A_ref p; the array scales it by the covered area, and keeps the rut and the line of unloading. Where neither k_0 nor
A_u is given the array's `recovery` stands for them.
"""

from __future__ import annotations

from typing import Annotated, Literal

from ground.compiled import force_law
from ground.law import REFERENCE_AREA, GroundLaw
from ground.quantity import Quantity, parameters
from ground.reference import REFERENCE_WIDTH

_KC, _KPHI, _N, _B = 1, 2, 3, 4  # places of the fields in p


@parameters
class BekkerWong(GroundLaw):
    """p = (k_c/b + k_phi) z^n, unloading with k_0 + A_u z_u: soft ground under plates, tracks and wheels."""

    kind: Literal["bekker-wong"] = "bekker-wong"
    cohesive_modulus: Annotated[float, Quantity("N/m^(n+1)", "k_c", least=0)]
    frictional_modulus: Annotated[float, Quantity("N/m^(n+2)", "k_phi", least=0)]
    exponent: Annotated[float, Quantity("1", "n", above=0, most=4)]
    width: Annotated[float, Quantity("m", "b, smaller side of what is pressed in", above=0)] = REFERENCE_WIDTH
    unloading_stiffness: Annotated[float, Quantity("Pa/m", "k_0 of unloading", least=0)] = 0.0
    unloading_growth: Annotated[float, Quantity("Pa/m2", "A_u, growth of it with the deepest sinkage", least=0)] = 0.0

    def validate(self) -> None:
        """Refuse a soil that resists nowhere."""
        if self.cohesive_modulus + self.frictional_modulus <= 0.0:
            raise ValueError("frictional_modulus: no resistance at all, got 0 beside cohesive_modulus 0; one of both")

    @property
    def unloading_line(self) -> tuple[float, float]:
        """k_0 (N/m) and A_u (N/m2) on the reference face."""
        return REFERENCE_AREA * self.unloading_stiffness, REFERENCE_AREA * self.unloading_growth

    @staticmethod
    @force_law
    def force(p, s, z, v):  # type: ignore[no-untyped-def]
        """A_ref p."""
        if z <= 0.0:
            return 0.0
        return REFERENCE_AREA * (p[_KC] / p[_B] + p[_KPHI]) * z ** p[_N]
