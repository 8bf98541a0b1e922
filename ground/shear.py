"""Compiled: shear of one element with the memory of how far it has been sheared, see `ground.friction`.

Force to be tried, memory to be committed, as in `ground.kernel`.
"""

from __future__ import annotations

import math
from typing import Any

from ground.compiled import inlined, leaf
from ground.kernel import NORMAL, SHEAR, SHEARED


@inlined
def yields_at(modulus: float, sheared: float) -> float:
    """R = K (1 - exp(-j/K)), m: how far the spring of sheared soil is strained where it yields."""
    return -modulus * math.expm1(-sheared / modulus)


@leaf
def shear_force(strength: float, modulus: float, sheared: float, shear: Any, moved: Any, n: Any) -> Any:
    """F_t = -F_max e/K with |e| <= R(j) = K (1 - exp(-j/K)); j grows by what the strain would go beyond R.

    `strength` (N) is F_max = c A + F_n tan(phi), `sheared` (m) is j, `shear` e at the last commit, world axes.
    """
    if strength <= 0.0:
        return 0.0, 0.0, 0.0
    x, y, z = shear[0] + moved[0], shear[1] + moved[1], shear[2] + moved[2]
    along = x * n[0] + y * n[1] + z * n[2]
    x, y, z = x - along * n[0], y - along * n[1], z - along * n[2]
    size = math.sqrt(x * x + y * y + z * z)
    beyond = size - yields_at(modulus, sheared)
    factor = -strength / modulus
    if beyond > 0.0:
        factor *= yields_at(modulus, sheared + beyond) / size
    return factor * x, factor * y, factor * z


@leaf
def commit_shear(modulus: float, row: Any, moved: Any) -> None:
    """Add what has moved to the strain of the soil's spring; what goes beyond R(j) shears it further."""
    shear, n = row[SHEAR : SHEAR + 3], row[NORMAL : NORMAL + 3]
    x, y, z = shear[0] + moved[0], shear[1] + moved[1], shear[2] + moved[2]
    along = x * n[0] + y * n[1] + z * n[2]
    x, y, z = x - along * n[0], y - along * n[1], z - along * n[2]
    size = math.sqrt(x * x + y * y + z * z)
    beyond, factor = size - yields_at(modulus, row[SHEARED]), 1.0
    if beyond > 0.0:
        row[SHEARED] += beyond
        factor = yields_at(modulus, row[SHEARED]) / size
    shear[0], shear[1], shear[2] = factor * x, factor * y, factor * z
