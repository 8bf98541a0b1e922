"""Hard ground that a body bounces off: a linear spring whose damping grows with the penetration.

Source of the form: Hunt and Crossley, "Coefficient of restitution interpreted as damping in vibroimpact", Journal of
Applied Mechanics 42(2), 1975, 440-445; here with a spring exponent of 1 and the restitution solved exactly:

    F = k z (1 + d v),   v = dz/dt, positive downward

From the surface at v_s back to the surface at -e v_s the motion m v dv/dz = -k z (1 + d v) gives, whatever m and k,

    integral from -e v_s to v_s of v/(1 + d v) dv = 0   =>   (1 + e) D = ln((1 + D)/(1 - e D)),   D = d v_s

so that the restitution e fixes d by the latched impact speed alone: it is the same for a corner and for a whole face,
which a dashpot of fixed strength would not give. 1 + d v >= 1 - e D > 0: never a pull.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, Literal

from ground.compiled import begin_law, force_law
from ground.law import HIDDEN, SPEED, Domain, GroundLaw
from ground.quantity import Quantity, parameters
from ground.reference import REFERENCE_WIDTH

# m: by convention a footing has failed where it settled by a tenth of its width; ground that gives way further under
# the reference face is not hard, and would neither spring back nor follow a straight line
NO_LONGER_HARD = 0.1 * REFERENCE_WIDTH

_D = HIDDEN  # hidden state: d in s/m, worked out once for each touch
_K, _E, _SLOW = 1, 2, 3  # places of the fields in p


@parameters
class Hard(GroundLaw):
    """F = k z (1 + d v): rebounds with a coefficient of restitution and keeps no rut."""

    kind: Literal["hard"] = "hard"
    stiffness: Annotated[float, Quantity("N/m", "k on the reference face", above=0)] = 5.0e4
    restitution: Annotated[float, Quantity("1", "e, speed after over speed before", above=0, most=1)] = 0.5
    slow_speed: Annotated[
        float, Quantity("m/s", "impacts below it are damped as if they had it, so that a body comes to rest", above=0)
    ] = 0.02

    hidden = 1
    plastic = False
    memoryless = True

    @property
    def domain(self) -> Domain:
        """That of its calibration if it has one; in either case no deeper than hard ground gives way."""
        known = super().domain
        return replace(known, sinkage_most=min(known.sinkage_most, NO_LONGER_HARD))

    @staticmethod
    @begin_law
    def begin(p, s):  # type: ignore[no-untyped-def]
        """Solve (1 + e) D = ln((1 + D)/(1 - e D)) by bisection: the left side is larger up to the root only."""
        e = p[_E]
        low, high = 0.0, 1.0 / e
        for _ in range(60):
            D = 0.5 * (low + high)
            if math.log1p(D) - math.log(max(1.0 - e * D, 1e-300)) < (1.0 + e) * D:
                low = D
            else:
                high = D
        s[_D] = 0.5 * (low + high) / max(s[SPEED], p[_SLOW])

    @staticmethod
    @force_law
    def force(p, s, z, v):  # type: ignore[no-untyped-def]
        """k z (1 + d v); what leaves faster than it should is no longer held, but not pulled either."""
        return p[_K] * z * max(1.0 + s[_D] * v, 0.0)
