"""Treated ground such as a road base: the stiffness depends on the impact speed and the sinkage only.

Ye (2006) finds that on treated soil, unlike on natural clay, the striker's mass does not enter. The form is that of
eqs (4) and (5) with the speed where the momentum stood: a stiffness at the start that rises with the speed, capped
by one that falls (or rises) with the sinkage. The paper prints no coefficients for it, so there are no defaults.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

from ground.compiled import begin_law, force_law
from ground.law import BEFORE, BRANCH, HIDDEN, SPEED, GroundLaw
from ground.quantity import Quantity, parameters

_K1, _C2 = HIDDEN, HIDDEN + 1  # hidden states: K_1 and the coefficient of K_2, worked out once for each touch
_A1, _N1, _B1, _A2, _N2, _DECAY = 1, 2, 3, 4, 5, 6  # places of the fields in p


@parameters
class Treated(GroundLaw):
    """F = K'(z) z with K' = min(a v_s^n + b, c (1e3 z)^k exp(-lambda v_s)), v_s in m/s and z in m."""

    kind: Literal["treated"] = "treated"
    speed_coefficient: Annotated[float, Quantity("N/m", "a, rise of the first branch at 1 m/s", least=0)]
    speed_exponent: Annotated[float, Quantity("1", "n, of v_s in the first branch", least=0)]
    first_stiffness: Annotated[float, Quantity("N/m", "b, first branch at no speed", above=0)]
    second_stiffness: Annotated[float, Quantity("N/m", "c, second branch at 1 mm and no speed", above=0)]
    sinkage_exponent: Annotated[float, Quantity("1", "k, of the sinkage in mm; 0: constant", above=-1, most=4)]
    speed_decay: Annotated[float, Quantity("s/m", "lambda, of v_s in the second branch; 0: none", least=0)]

    hidden = 2

    @staticmethod
    @begin_law
    def begin(p, s):  # type: ignore[no-untyped-def]
        """Latch both branches and the sinkage where they cross."""
        s[_K1] = p[_A1] * s[SPEED] ** p[_N1] + p[_B1]
        s[_C2] = p[_A2] * 1e3 ** p[_N2] * math.exp(-p[_DECAY] * s[SPEED])
        if p[_N2] != 0.0:
            # this way up, a coefficient that has decayed to nothing divides nothing
            s[BRANCH] = (s[_C2] / s[_K1]) ** (-1.0 / p[_N2])

    @staticmethod
    @force_law
    def force(p, s, z, v):  # type: ignore[no-untyped-def]
        """K' z; written as z^(1+k) because z^k alone is infinite at z = 0 for a negative k."""
        if z <= 0.0:
            return 0.0
        if p[_N2] < 0.0 and z < BEFORE * s[BRANCH]:
            return s[_K1] * z
        return min(s[_K1] * z, s[_C2] * z ** (1.0 + p[_N2]))
