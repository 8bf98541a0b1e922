"""Tangential laws: Coulomb friction on a short stick spring, and soil that shears with the memory of how far it has.

Janosi and Hanamoto (1961), after the peakless curves of loose sand, wet clay and disturbed soil:

    tau = (c + sigma tan phi)(1 - exp(-j/K))

with the shear displacement j since the member came over the element. Where the motion turns round the soil springs back
by the slope that the curve has at its start, (c + sigma tan phi)/K, and yields again where it left the curve. As a
spring of strain e, |e| <= R(j) = K (1 - exp(-j/K)), and what goes beyond R is what j grows by; on the way out this is
the curve itself. On landing anew j begins from zero: the same displacement is needed again, as in repeated shear tests
(recalled after Wong, Theory of Ground Vehicles, medium confidence).
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

from ground.kinds import ByKind
from ground.quantity import Later, Quantity, parameters


@parameters
class Bulldozing:
    """Passive earth pressure on what ploughs sideways, F = b (1/2 gamma z^2 K_p + q z K_p + 2 c z sqrt(K_p)).

    Rankine (1857) with the cohesion term of Bell (1915): a smooth upright wall of width b in level soil to the depth z,
    K_p = tan^2(45 deg + phi/2). Recalled; the formulae stand in every textbook of soil mechanics.
    """

    unit_weight: Annotated[float, Quantity("N/m3", "gamma, of the soil", above=0)]
    friction_angle_deg: Annotated[float, Quantity("deg", "phi, angle of internal friction", least=0, below=60)]
    cohesion: Annotated[float, Quantity("Pa", "c", least=0)] = 0.0
    surcharge: Annotated[float, Quantity("Pa", "q, of what lies on the soil ahead: a bow wave", least=0)] = 0.0

    @property
    def passive(self) -> float:
        """K_p."""
        return math.tan(math.radians(45.0 + 0.5 * self.friction_angle_deg)) ** 2

    @property
    def coefficients(self) -> tuple[float, float]:
        """A (N/m3) and B (N/m2) of F/b = A z^2 + B z."""
        k = self.passive
        return 0.5 * self.unit_weight * k, self.surcharge * k + 2.0 * self.cohesion * math.sqrt(k)


Ploughs = Annotated[Bulldozing | None, Later(), "what ploughs meets the soil ahead of it; null: it does not"]


@parameters
class Coulomb:
    """|F_t| <= mu F_n; below the limit F_t = -mu F_n d/d_s, d the shear displacement since the last slip.

    Not part of Ye (2006): mu = 0 is the paper's own mode. Soil on steel: 0.13-0.85 over moisture.
    """

    kind: Literal["coulomb"] = "coulomb"
    coefficient: Annotated[float, Quantity("1", "mu", least=0, most=2)] = 0.0
    stick_displacement: Annotated[float, Quantity("m", "shear displacement d_s at which it slips", above=0)] = 0.002
    stick_relaxation: Annotated[float, Quantity("s", "dashpot over spring while it sticks", least=0)] = 0.005
    bulldozing: Ploughs = None


@parameters
class JanosiHanamoto:
    """Shear stress (c + sigma tan phi)(1 - exp(-j/K)): soil that has to be sheared before it resists in full."""

    kind: Literal["janosi-hanamoto"] = "janosi-hanamoto"
    cohesion: Annotated[float, Quantity("Pa", "c", least=0)]
    friction_angle_deg: Annotated[float, Quantity("deg", "phi, angle of internal friction", least=0, below=60)]
    shear_modulus: Annotated[float, Quantity("m", "K, shear displacement at 63 % of the strength", above=0)]
    bulldozing: Ploughs = None

    @property
    def coefficient(self) -> float:
        """Its tan(phi)."""
        return math.tan(math.radians(self.friction_angle_deg))


Friction = Annotated[Coulomb | JanosiHanamoto, ByKind(usual="coulomb")]
