"""A polynomial in depth and rate as an effect: what a plain correction of the residual force does in a simulation."""

from __future__ import annotations

from typing import Annotated, ClassVar

from ground.compiled import force_law
from ground.quantity import Quantity, parameters
from ground.settings import ForceTerm
from rollover.effects import Effect

Coefficient = Annotated[float, Quantity("N", "at the scales, on the reference face")]
NAMES = tuple(f"z{a}v{b}" for a in range(4) for b in range(4 - a))


@force_law
def of_depth(p, s, z, v):  # type: ignore[no-untyped-def]
    """N on the reference face: p0 + p1 x + p2 x^2 + p3 x^3, x = z/p4."""
    x = z / p[4]
    return p[0] + x * (p[1] + x * (p[2] + x * p[3]))


@force_law
def of_rate(p, s, z, v):  # type: ignore[no-untyped-def]
    """N on the reference face: u (p0 + p1 u + p2 u^2) + x u (p3 + p4 u) + p5 x^2 u, x = z/p6, u = v/p7."""
    x, u = z / p[6], v / p[7]
    return u * (p[0] + u * (p[1] + u * p[2]) + x * (p[3] + p[4] * u + p[5] * x))


@parameters
class Polynomial(Effect):
    """F += sum_ab c_ab (z/z_0)^a (v/v_0)^b, a + b up to 3."""

    z0v0: Coefficient = 0.0
    z0v1: Coefficient = 0.0
    z0v2: Coefficient = 0.0
    z0v3: Coefficient = 0.0
    z1v0: Coefficient = 0.0
    z1v1: Coefficient = 0.0
    z1v2: Coefficient = 0.0
    z2v0: Coefficient = 0.0
    z2v1: Coefficient = 0.0
    z3v0: Coefficient = 0.0
    depth: Annotated[float, Quantity("m", "z_0", above=0)] = 0.1
    speed: Annotated[float, Quantity("m/s", "v_0", above=0)] = 1.0

    id = "polynomial"
    competes = False
    is_smooth = True
    family = "a resistance of the ground that has no name"
    equation = "F += sum_ab c_ab (z/z_0)^a (v/v_0)^b"
    source = "a regression, beside which a diagnosis stands"
    sentence = "A polynomial."
    null: ClassVar = dict.fromkeys(NAMES, 0.0)

    def force_terms(self) -> tuple[ForceTerm, ...]:
        """What depends on the depth alone, and the rest."""
        deep = (self.z0v0, self.z1v0, self.z2v0, self.z3v0, self.depth)
        fast = (self.z0v1, self.z0v2, self.z0v3, self.z1v1, self.z1v2, self.z2v1, self.depth, self.speed)
        return ForceTerm(of_depth, deep), ForceTerm(of_rate, fast)
