"""The vibrating-press foundation model: lumped spring, dashpots and a mass on a side branch (Ye 2006, Fig. 1b).

Source: the foundation model that Ye (2006) draws after J. P. Wolf, "Foundation Vibration Analysis Using Simple
Physical Models", Prentice Hall, 1994. The foundation node stands on a spring K and a dashpot C; beside them a mass
M1 hangs on the node by a dashpot C1 alone (Wolf's monkey tail). It has no spring, so that it adds nothing to the
static stiffness; it is dragged along at low frequency and left behind at high frequency, which is how an elastic
half-space answers. The model is linear: it springs back all the way along the same curve and leaves no rut.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ground.compiled import advance_law, begin_law, force_law
from ground.law import HIDDEN, REFERENCE_AREA, GroundLaw
from ground.quantity import Quantity, parameters

_W = HIDDEN  # hidden state: velocity of the internal mass, m/s, positive down
_K, _C, _C1, _M1 = 1, 2, 3, 4  # places of the fields in p


@parameters
class Press(GroundLaw):
    """F = K z + C v + C1 (v - w) with M1 dw/dt = C1 (v - w): a foundation that vibrates on elastic ground."""

    kind: Literal["press"] = "press"
    stiffness: Annotated[float, Quantity("N/m", "K on the reference face", above=0)]
    damping: Annotated[float, Quantity("N s/m", "C on the reference face", least=0)]
    side_damping: Annotated[float, Quantity("N s/m", "C1, from the node to the internal mass", least=0)]
    side_mass: Annotated[float, Quantity("kg", "M1, the internal mass on the reference face", above=0)]

    hidden = 1
    plastic = False

    @staticmethod
    @begin_law
    def begin(p, s):  # type: ignore[no-untyped-def]
        """Start with the internal mass at rest, like the ground."""
        s[_W] = 0.0

    @staticmethod
    @force_law
    def force(p, s, z, v):  # type: ignore[no-untyped-def]
        """K z + C v + C1 (v - w)."""
        return p[_K] * z + p[_C] * v + p[_C1] * (v - s[_W])

    @staticmethod
    @advance_law
    def advance(p, s, z, v, h):  # type: ignore[no-untyped-def]
        """w+ = v + (w - v) exp(-C1 h/M1), exact while v stands still within the step, stable for any h."""
        s[_W] = v + (s[_W] - v) * math.exp(-p[_C1] * h / p[_M1])


def dynamic_stiffness(law: Press, omega: ArrayLike) -> NDArray[np.complex128]:
    """S = K + i w C - w^2 M1/(1 + i w M1/C1), N/m, for z = Z exp(i w t); `omega` w in rad/s, any shape."""
    w = np.asarray(omega, dtype=float)
    if law.side_damping == 0.0:
        return law.stiffness + 1j * w * law.damping
    return (
        law.stiffness + 1j * w * law.damping - w**2 * law.side_mass / (1.0 + 1j * w * law.side_mass / law.side_damping)
    )


@dataclass(frozen=True, kw_only=True)
class DiskCoefficients:
    """Numbers of the vertical lumped model of a disk, each with Poisson's ratio nu: constant + slope nu^4.

    They multiply the static stiffness K: gamma0 K r/c_s is C, gamma1 K r/c_s is C1, mu1 K (r/c_s)^2 is M1 and
    mu0 K (r/c_s)^2 is soil that moves with the disk, with c_s the shear wave speed and r the radius.
    """

    gamma0: float = 0.8
    gamma1: tuple[float, float] = (0.34, -4.3)
    mu1: tuple[float, float] = (0.4, -4.0)
    mu0: float = 0.9  # times (nu - 1/3), only above nu = 1/3
    source: str = "Wolf's table for the disk on a homogeneous half-space, from memory; not compared with the print"
    confidence: str = "recalled"


@parameters
class Disk:
    """A rigid massless disk on an elastic half-space, moving vertically: where the numbers of a `Press` come from."""

    radius: Annotated[float, Quantity("m", "r", above=0)]
    shear_modulus: Annotated[float, Quantity("Pa", "G of the ground at small strain", above=0)]
    poisson: Annotated[float, Quantity("1", "nu of the ground", least=0, most=0.5)]
    density: Annotated[float, Quantity("kg/m3", "rho of the ground", above=0)]
    coefficients: DiskCoefficients = DiskCoefficients()

    @property
    def shear_speed(self) -> float:
        """c_s = sqrt(G/rho), m/s."""
        return math.sqrt(self.shear_modulus / self.density)

    @property
    def stiffness(self) -> float:
        """K = 4 G r/(1 - nu), N/m: the exact static stiffness of a rigid disk (Boussinesq)."""
        return 4.0 * self.shear_modulus * self.radius / (1.0 - self.poisson)

    @property
    def damping(self) -> float:
        """C = gamma0 K r/c_s, N s/m."""
        return self.coefficients.gamma0 * self.stiffness * self.radius / self.shear_speed

    @property
    def side_damping(self) -> float:
        """C1 = gamma1 K r/c_s, N s/m."""
        return self._of(self.coefficients.gamma1) * self.stiffness * self.radius / self.shear_speed

    @property
    def side_mass(self) -> float:
        """M1 = mu1 K (r/c_s)^2, kg."""
        return self._of(self.coefficients.mu1) * self.stiffness * (self.radius / self.shear_speed) ** 2

    @property
    def trapped_mass(self) -> float:
        """mu0 K (r/c_s)^2, kg: soil fixed to the disk. A force law cannot hold it; it belongs to the co-moving mass."""
        mu0 = self.coefficients.mu0 * max(0.0, self.poisson - 1.0 / 3.0)
        return mu0 * self.stiffness * (self.radius / self.shear_speed) ** 2

    def law(self) -> Press:
        """The law of the reference area of which elements that cover the disk add up to the disk.

        The stiffness of a disk grows with its radius, that of an array with its area; the two agree for this
        radius only.
        """
        share = REFERENCE_AREA / (math.pi * self.radius**2)
        return Press(
            stiffness=share * self.stiffness,
            damping=share * self.damping,
            side_damping=share * self.side_damping,
            side_mass=share * self.side_mass,
        )

    def _of(self, constant_slope: tuple[float, float]) -> float:
        return constant_slope[0] + constant_slope[1] * self.poisson**4
