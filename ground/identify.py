"""From recorded drops to the law of Ye (2006): K'(z) by eq (3), its branches, the coefficients of eqs (4) and (5).

Two steps, each with its covariance. **Branches**: force over depth of all drops at once,

    F = min(K_b1 z, F_r (z/z_r)^(1+n)),

with K_b1 and F_r of each drop, one exponent n, and what the integrated depth may be off by; forces are fitted and not
K' = F/z, whose noise has no bound at the surface. **Regression** of K_b1, ln F_r and n over the drops on

    (4) K_b1 = c v^p + k_0        (5) ln F_r = ln(1e3 k) + n ln(1e3 z_r) + ln z_r + (m v/100) ln b

which is linear but for p: p is scanned, and all 95 % intervals are those of the profile likelihood. Where drops differ
by more than their noise, the scatter between drops is estimated and widens them.

Everything is per reference area: a drop on a face A counts with F A_ref/A. m in (5) is by default the 132 kg of the
reference striker whatever fell, as the array takes it (`ground.striker_mass: reference`); with ``law_mass="effective"``
it is m_s A_ref/A. Only the latter can tell drops of different masses apart.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ground.branches import Branches, fit_branches
from ground.drops import Drop, UnusableDrop, loading, rest_stiffness, stiffness
from ground.law import REFERENCE_AREA, REFERENCE_MASS, Calibration, Interval
from ground.regression import Coefficient, Regression
from ground.rise import check_one_soil
from ground.ye import Ye2006

Array = NDArray[np.float64]
LawMass = Literal["reference", "effective"]


@dataclass(frozen=True, kw_only=True)
class Identified:
    """What a set of drops says about the law."""

    law: Ye2006
    coefficients: tuple[Coefficient, ...]
    covariance: Array  # (6, 6) of the coefficients in the order of NAMES; 0 where they are not from the data
    branches: Branches
    correlation: float  # R of ln K'
    log_scatter: float  # sd of ln K' about the law
    between_drops: float  # sd of ln K_b1 and ln F_r between drops beyond their noise
    fraction: float
    law_mass: LawMass


def identify(
    drops: Sequence[Drop],
    *,
    fraction: float = 0.1,
    law_mass: LawMass = "reference",
    keep: bool = False,
    source: str = "recorded drops",
    recordings: Sequence[str] = (),
) -> Identified:
    """Identify the law from drops; `keep` takes the paper's value for what they cannot determine.

    Raises `UnusableDrop` for a drop that is none, and ``ValueError`` for a cone: this law has a face.
    """
    for drop in drops:
        if drop.cone_height > 0.0:
            raise ValueError(f"{drop.name}: a cone, whose area grows; see ground.penetration")
    loads = [loading(drop, fraction) for drop in drops]
    for load in loads:
        check_one_soil(load)
    branches = fit_branches(loads)
    masses = np.array([_law_mass(drop, law_mass) for drop in drops])
    table = Regression(branches, masses)
    found, covariance = table.coefficients(keep)
    return _concluded(branches, table, found, covariance, fraction, law_mass, source, tuple(recordings))


def _law_mass(drop: Drop, law_mass: LawMass) -> float:
    return REFERENCE_MASS if law_mass == "reference" else drop.mass * REFERENCE_AREA / drop.area


def _concluded(
    branches: Branches,
    table: Regression,
    found: tuple[Coefficient, ...],
    covariance: Array,
    fraction: float,
    law_mass: LawMass,
    source: str,
    recordings: tuple[str, ...],
) -> Identified:
    value: dict[str, Any] = {c.name: c.value for c in found}
    ln_measured, ln_law, groups = [], [], []
    for load, mass in zip(branches.loads, table.masses, strict=True):
        z, K, sd = stiffness(load)
        use = (sd < 0.2 * K) & (K > 0.0)
        first = (
            value["speed_coefficient"] * load.drop.speed ** value["speed_exponent"] + value["first_stiffness"]
        )  # (4)
        power = value["momentum_base"] ** (mass * load.drop.speed / 100.0)
        second = 1e3 * value["second_stiffness"] * (1e3 * z) ** value["sinkage_exponent"] * power  # (5)
        ln_law.append(np.log(np.minimum(first, second))[use])
        ln_measured.append(np.log(K * REFERENCE_AREA / load.drop.area, where=use, out=np.zeros_like(K))[use])
        groups.append(load.drop)
    measured, law_ = np.concatenate(ln_measured), np.concatenate(ln_law)
    left = float(np.sum((measured - law_) ** 2))
    scatter = math.sqrt(left / max(measured.size - 6, 1))
    spread = float(np.sum((measured - measured.mean()) ** 2))
    correlation = math.sqrt(max(1.0 - left / spread, 0.0))
    calibration = Calibration(
        source=source,
        recordings=recordings,
        speed_least=float(table.speeds.min()),
        speed_most=float(table.speeds.max()),
        momentum_most=float((table.masses * table.speeds).max()),
        area=_one([drop.area for drop in groups]),
        sinkage_most=max(float(load.depth.max()) for load in branches.loads),
        log_scatter=scatter,
        multiple_correlation=correlation,
        intervals=tuple(Interval(of=c.name, low=c.low, high=c.high, origin=c.origin) for c in found),
    )
    try:
        law = Ye2006(calibration=calibration, **value)
    except ValueError as reason:
        names = ", ".join(load.drop.name for load in branches.loads)
        message = f"{names}: not of this law, {reason}; faster drops, that show both branches, or the law bearing"
        raise UnusableDrop(message) from None
    return Identified(
        law=law,
        coefficients=found,
        covariance=covariance,
        branches=branches,
        correlation=correlation,
        log_scatter=scatter,
        between_drops=table.between,
        fraction=fraction,
        law_mass=law_mass,
    )


def _one(values: Sequence[float]) -> float | None:
    return values[0] if max(values) - min(values) < 0.01 * values[0] else None


__all__ = ["Branches", "Coefficient", "Identified", "fit_branches", "identify", "rest_stiffness", "stiffness"]
