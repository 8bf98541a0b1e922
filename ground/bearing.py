"""Bearing pressure that grows with depth and with the rate: soft sediment under a penetrometer or a slow foot.

Pressure on the face at depth z and penetration rate v,

    q = (q_0 + q_1 (z/z_1)^n) (1 + beta asinh(v/(2 v_0))/ln 10)

For v well above v_0 the rate term is 1 + beta log10(v/v_0): the strain-rate correction by a share of the static
resistance for each decade that is used with free-fall penetrometers (Dayal and Allen, Canadian Geotechnical Journal
12(3), 1975, 336-346), with v_0 = 0.02 m/s, the rate of the standard cone test; asinh makes it go to the static value at
rest. As a force on the reference face, F = A_ref q; the array scales it by the covered area, which for a cone grows.
The user, or `rollover identify`, brings the numbers.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

from ground.compiled import force_law
from ground.law import REFERENCE_AREA, GroundLaw
from ground.quantity import Quantity, parameters

REFERENCE_DEPTH = 0.1  # m, z_1
_Q0, _Q1, _N, _BETA, _V0 = 1, 2, 3, 4, 5  # places of the fields in p


@parameters
class Bearing(GroundLaw):
    """F = A (q_0 + q_1 (z/0.1 m)^n)(1 + beta asinh(v/(2 v_0))/ln 10): soft sediment, on a face or a cone."""

    kind: Literal["bearing"] = "bearing"
    surface_pressure: Annotated[float, Quantity("Pa", "q_0", least=0)]
    depth_pressure: Annotated[float, Quantity("Pa", "q_1, at 0.1 m", least=0)]
    depth_exponent: Annotated[float, Quantity("1", "n", above=0, most=4)] = 1.0
    rate_per_decade: Annotated[float, Quantity("1", "beta, rise for each decade of rate", least=0, most=3)] = 0.0
    rate_reference: Annotated[float, Quantity("m/s", "v_0", above=0)] = 0.02

    def validate(self) -> None:
        """Refuse a soil that resists nowhere."""
        if self.surface_pressure + self.depth_pressure <= 0.0:
            raise ValueError("depth_pressure: no resistance at all, got 0 Pa beside surface_pressure 0 Pa; one of both")

    @staticmethod
    @force_law
    def force(p, s, z, v):  # type: ignore[no-untyped-def]
        """A_ref q; q_0 is mobilised over the first 0.1 mm, so that nothing jumps at the touch."""
        if z <= 0.0:
            return 0.0
        static = p[_Q0] * (1.0 - math.exp(-z / 1e-4)) + p[_Q1] * (z / REFERENCE_DEPTH) ** p[_N]
        return REFERENCE_AREA * static * (1.0 + p[_BETA] * math.asinh(max(v, 0.0) / (2.0 * p[_V0])) / math.log(10.0))
