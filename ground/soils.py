"""Named soils: a law with its numbers, where they come from, and how far to trust them.

Only soils whose numbers have a source stand here. The range that a soil was tested in is `Soil.law.domain`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ground.bekker import BekkerWong
from ground.friction import JanosiHanamoto
from ground.law import GroundLaw
from ground.ye import MULTIPLE_CORRELATION, Ye2006, first_branch, second_branch

# printed: a published table or equation; derived: worked out from printed numbers under stated assumptions;
# recalled: from memory, never compared with the print
Confidence = Literal["printed", "derived", "recalled"]

PLATE_WIDTH = 0.1  # m: b of a member of a frame with its soil, or of a narrow tyre on its shoulder; a choice

# m at each drop speed (m/s), the deepest sinkage of 132 kg under Ye2006 itself, to the millimetre
_DEEPEST = {1.0: 0.067, 2.0: 0.163, 3.0: 0.327, 3.5: 0.436}


@dataclass(frozen=True, kw_only=True)
class Soil:
    """One named soil: its law, a title for people, and the standing of its numbers; how it shears, where known."""

    name: str
    law: GroundLaw
    friction: JanosiHanamoto | None = None
    title: str
    source: str
    confidence: Confidence


def log_scatter(points: int = 200) -> float:
    """sigma = sd(ln K_b2) sqrt(1 - R^2)/R: one standard deviation of ln K' about the regression of eqs (4), (5).

    R fixes the residual only against the spread that the regression explains. That spread is taken from the curves
    themselves: the four drop speeds, `points` sinkages evenly spaced from the change of branch to the deepest. That
    ln K' was regressed, and that the records were spread evenly, are assumptions; the paper says neither.
    """
    law = Ye2006()
    explained = []
    for speed, deepest in _DEEPEST.items():
        # K_b2(z) = K_b1 solved for z
        change = (second_branch(law, 1e-3, speed) / first_branch(law, speed)) ** (-1.0 / law.sinkage_exponent) * 1e-3
        explained += [math.log(second_branch(law, z, speed)) for z in np.linspace(change, deepest, points)]
    return float(np.std(explained)) * math.sqrt(1.0 - MULTIPLE_CORRELATION**2) / MULTIPLE_CORRELATION


def soils() -> dict[str, Soil]:
    """Every named soil by its name."""
    sigma = log_scatter()
    derived = (
        f"the printed law with its stiffness times exp({{sign}}{sigma:.2f}): one standard deviation of ln K' "
        f"estimated from the multiple correlation of {MULTIPLE_CORRELATION}, see ground.soils.log_scatter"
    )
    listed = (
        Soil(
            name="natural-clay",
            law=Ye2006(),
            title="natural clay that does not rebound",
            source="Ye 2006, Engineering Mechanics 23(10), 107-110, eqs (4) and (5), after drop tests of "
            "Schwanghart, TU München, 1979",
            confidence="printed",
        ),
        Soil(
            name="natural-clay-soft",
            law=Ye2006(stiffness_scale=math.exp(-sigma)),
            title="natural clay, one standard deviation softer",
            source=derived.format(sign="-"),
            confidence="derived",
        ),
        Soil(
            name="natural-clay-stiff",
            law=Ye2006(stiffness_scale=math.exp(sigma)),
            title="natural clay, one standard deviation stiffer",
            source=derived.format(sign="+"),
            confidence="derived",
        ),
    )
    return {soil.name: soil for soil in (*listed, *_of_plates())}


# moisture, %: n, k_c (kN/m^(n+1)), k_phi (kN/m^(n+2)), c (kPa), phi (deg), K (m)
_PLATES = {
    "dry-sand": ("dry sand", 0, 1.1, 0.99, 1528.43, 1.04, 28.0, 0.025),
    "sandy-loam": ("sandy loam of 15 % moisture", 15, 0.7, 5.27, 1515.04, 1.72, 29.0, 0.015),
    "wet-clay": ("clayey soil of 38 % moisture", 38, 0.5, 13.19, 692.15, 4.14, 13.0, 0.006),
}
_PLATE_SOURCE = (
    "Wong, Theory of Ground Vehicles, table of terrain values (Land Locomotion Laboratory; clayey soil from Thailand): "
    "recalled with high confidence, those of dry sand also seen as another program cites them; K recalled as typical "
    "(firm sand 0.01, loose sand 0.025, compressed clay 0.006 m) with medium confidence"
)


def _of_plates() -> tuple[Soil, ...]:
    """Soils of plate and shear tests."""
    return tuple(
        Soil(
            name=name,
            law=BekkerWong(cohesive_modulus=1e3 * kc, frictional_modulus=1e3 * kphi, exponent=n, width=PLATE_WIDTH),
            friction=JanosiHanamoto(cohesion=1e3 * c, friction_angle_deg=phi, shear_modulus=K),
            title=title,
            source=_PLATE_SOURCE,
            confidence="recalled",
        )
        for name, (title, _, n, kc, kphi, c, phi, K) in _PLATES.items()
    )
