"""Tangential laws: Coulomb friction whose stick is a short spring, so that what should stand still does."""

from __future__ import annotations

from typing import Annotated, Literal

from ground.quantity import Quantity, parameters


@parameters
class Coulomb:
    """|F_t| <= mu F_n; below the limit F_t = -mu F_n d/d_s, d the shear displacement since the last slip.

    Not part of Ye (2006): mu = 0 is the paper's own mode. Soil on steel: 0.13-0.85 over moisture.
    """

    kind: Literal["coulomb"] = "coulomb"
    coefficient: Annotated[float, Quantity("1", "mu", least=0, most=2)] = 0.0
    stick_displacement: Annotated[float, Quantity("m", "shear displacement d_s at which it slips", above=0)] = 0.002
    stick_relaxation: Annotated[float, Quantity("s", "dashpot over spring while it sticks", least=0)] = 0.005
