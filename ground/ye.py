"""The ground impact element of Ye (2006): one secant spring and a co-moving mass, identified from drop tests.

Source: Ye Min-zhen, "Ground modeling in machinery-ground interaction system and parameter determination",
Engineering Mechanics 23(10), 2006, 107-110; equation numbers are the paper's. Natural clay under a striker of
132 kg with a face of 140 mm x 45 mm, 1.0 to 3.5 m/s. The regression behind (4) and (5) has a multiple
correlation of 0.923: the scatter is a real uncertainty on every load.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

from ground.compiled import begin_law, force_law
from ground.law import BEFORE, BRANCH, HIDDEN, MASS, REFERENCE_AREA, REFERENCE_MASS, SPEED, Domain, GroundLaw
from ground.quantity import Quantity, parameters

MULTIPLE_CORRELATION = 0.923
_K1, _C2 = HIDDEN, HIDDEN + 1  # hidden states: K_b1 and the coefficient of K_b2, worked out once for each touch
_SCALE, _A1, _N1, _B1, _A2, _N2, _Q2 = 1, 2, 3, 4, 5, 6, 7  # places of the fields in p


@parameters
class Ye2006(GroundLaw):
    """F = K'(z) z with K' = min(K_b1, K_b2), eqs (3)-(5); clay that does not rebound."""

    kind: Literal["ye-2006"] = "ye-2006"
    stiffness_scale: Annotated[float, Quantity("1", "factor on K'", above=0)] = 1.0
    speed_coefficient: Annotated[float, Quantity("N/m", "of v_s^n in K_b1, eq (4)", least=0)] = 4.9e-6
    speed_exponent: Annotated[float, Quantity("1", "n in K_b1, eq (4)", least=0)] = 18.71
    first_stiffness: Annotated[float, Quantity("N/m", "constant term of K_b1, eq (4)", above=0)] = 75_000.0
    second_stiffness: Annotated[float, Quantity("N/mm", "K_b2 at 1 mm and no momentum, eq (5)", above=0)] = 1300.0
    sinkage_exponent: Annotated[float, Quantity("1", "of the sinkage in mm in K_b2, eq (5)", above=-1, most=0)] = -0.736
    momentum_base: Annotated[float, Quantity("1", "of (m_s v_s / 100 N s) in K_b2, eq (5)", above=0, most=2)] = 0.89
    unloading: Literal["plastic", "rest-stiffness"] = "plastic"

    hidden = 2

    @staticmethod
    @begin_law
    def begin(p, s):  # type: ignore[no-untyped-def]
        """Latch K_b1, the coefficient of K_b2 and the sinkage where the branches cross."""
        s[_K1] = p[_SCALE] * (p[_A1] * s[SPEED] ** p[_N1] + p[_B1])  # (4)
        # (5), K_b2 = 1e3 * 1300 * (1e3 z)^-0.736 * 0.89^(m_s v_s / 100), without z^-0.736
        s[_C2] = p[_SCALE] * 1e3 * p[_A2] * 1e3 ** p[_N2] * p[_Q2] ** (s[MASS] * s[SPEED] / 100.0)
        if p[_N2] < 0.0:
            s[BRANCH] = (s[_C2] / s[_K1]) ** (-1.0 / p[_N2])

    @staticmethod
    @force_law
    def force(p, s, z, v):  # type: ignore[no-untyped-def]
        """K' z, eq (3), with K' = min(K_b1, K_b2); z K_b2 is finite at z -> 0 though K_b2 is not."""
        if z <= 0.0:
            return 0.0
        if p[_N2] < 0.0 and z < BEFORE * s[BRANCH]:
            return s[_K1] * z
        return min(s[_K1] * z, s[_C2] * z ** (1.0 + p[_N2]))

    @property
    def unloads_at_rest_stiffness(self) -> bool:
        """The paper's literal third branch, eq (6): gives a third to two thirds of the energy back if lifted."""
        return self.unloading == "rest-stiffness"

    @property
    def domain(self) -> Domain:
        """The drop tests behind the regression: speeds, momentum, face, virgin soil, normal impact."""
        if self.calibration is not None:
            return self.calibration.domain
        return Domain(
            speed_least=1.0,
            speed_most=3.5,
            momentum_most=REFERENCE_MASS * 3.5,
            area=REFERENCE_AREA,
            virgin_only=True,
            obliquity_most=math.radians(10.0),
        )


def first_branch(law: Ye2006, speed: float) -> float:
    """K_b1 = 4.9e-6 v_s^18.71 + 75000 N/m, eq (4)."""
    return float(law.stiffness_scale * (law.speed_coefficient * speed**law.speed_exponent + law.first_stiffness))


def second_branch(law: Ye2006, z: float, speed: float, mass: float = REFERENCE_MASS) -> float:
    """K_b2 = 1e3 * 1300 * (1e3 z)^-0.736 * 0.89^(m_s v_s/100) N/m, eq (5); z in m."""
    momentum_factor = law.momentum_base ** (mass * speed / 100.0)
    return float(law.stiffness_scale * 1e3 * law.second_stiffness * (1e3 * z) ** law.sinkage_exponent * momentum_factor)


def rest_stiffness(mass: float, z_max: float, gravity: float = 9.81) -> float:
    """K_b3 = 9.81 m_s / z_p,max, eq (6), N/m."""
    return gravity * mass / z_max


def real_loss(mass: float, speed: float, restitution: float = 0.0) -> float:
    """dE_r = 1/2 m_s v_s^2 (1 - k_r^2), eq (7), J. It leaves out m g z_max, as the paper does."""
    return 0.5 * mass * speed**2 * (1.0 - restitution**2)


def collision_loss(mass: float, co_moving_mass: float, speed: float, restitution: float = 0.0) -> float:
    """dE_s = 1/2 v_s^2 m_s m_b1/(m_s + m_b1) (1 - k_s^2), eq (8), J."""
    reduced = mass * co_moving_mass / (mass + co_moving_mass)
    return 0.5 * speed**2 * reduced * (1.0 - restitution**2)


def loss_share(fraction: float) -> float:
    """x = dE_s/dE_r = y/(1 + y) for restitution 0, eqs (7)-(9): share that goes into sound and vibration."""
    return fraction / (1.0 + fraction)


def mass_fraction(share: float) -> float:
    """y = x/(1 - x), eq (10): co-moving mass over striker mass from the share x lost in the collision."""
    if not 0.0 <= share < 1.0:
        raise ValueError(f"share: out of bounds, got {share!r}; at least 0 and less than 1 is allowed")
    return share / (1.0 - share)


# Table 1: co-moving mass as a share of the striker's mass (Lorenz gives a range; both ends stand here)
CO_MOVING_FRACTIONS: dict[str, float] = {
    "ye-2006": 0.10,
    "lorenz-1934-low": 4.0,
    "lorenz-1934-high": 10.0,
    "kundt-1987": 0.33,
    "kroeber-1988": 0.10,
    "pietzsch-1991": 0.107,
}
