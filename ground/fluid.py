"""Entry into a fluid at rest: drag and hydrostatic pressure on the wetted area; what a nose meets on water.

Pressure on the covered area at its mean depth z and sinkage rate v,

    q = 1/2 C_d rho v |v| + rho g z

The array scales it by the covered area, which for a cone grows: A(z) 1/2 C_d rho v^2 of drag, and A z of a cone is the
volume below the surface, so that rho g A z is its buoyancy. Once the nose is in, the displaced volume is that of the
body, or of the open cavity, behind it. C_d of a cone that runs in a cavity: 0.5 to 0.8 for half angles of 45 to 90 deg,
0.8 for a disc (recalled, medium confidence); it is a number to be fitted.

What the law leaves out is the fluid that moves along. It is the effect `soil-added-mass-growth`: on a cone
m_a = k rho r(z)^3, r the wetted radius, with the force d(m_a v)/dt (von Karman, NACA TN 321, 1929; Wagner, ZAMM 12(4),
1932; k = 4/3 for the one side of a disc by Lamb, and more for the fluid that piles up; recalled, high confidence).
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

from ground.compiled import force_law
from ground.law import REFERENCE_AREA, GroundLaw
from ground.quantity import Quantity, parameters

_RHO, _C, _G = 1, 2, 3  # places of the fields in p


@parameters
class FluidEntry(GroundLaw):
    """F = A (1/2 C_d rho v |v| + rho g z): drag and buoyancy of a nose that enters a fluid, without added mass."""

    kind: Literal["fluid-entry"] = "fluid-entry"
    density: Annotated[float, Quantity("kg/m3", "rho of the fluid", above=0)] = 1000.0
    drag_coefficient: Annotated[float, Quantity("1", "C_d of the wetted nose", least=0, most=5)] = 0.7
    gravity: Annotated[float, Quantity("m/s2", "g of the hydrostatic pressure", least=0, most=30)] = 9.81

    plastic = False
    fluid = True

    @staticmethod
    @force_law
    def force(p, s, z, v):  # type: ignore[no-untyped-def]
        """A_ref q; the array keeps a way out from pulling."""
        if z <= 0.0:
            return 0.0
        return REFERENCE_AREA * p[_RHO] * (0.5 * p[_C] * v * abs(v) + p[_G] * z)


def cone_rate(half_angle: float, *, density: float = 1000.0, coefficient: float = 4.0 / 3.0) -> float:
    """Rate of `soil-added-mass-growth` (kg/m) that gives a cone m_a = k rho r^3; `half_angle` in rad.

    The effect's mass is rate/A_ref times the displaced volume, which is pi/3 r^3/tan(half_angle).
    """
    return 3.0 * coefficient * density * math.tan(half_angle) / math.pi * REFERENCE_AREA
