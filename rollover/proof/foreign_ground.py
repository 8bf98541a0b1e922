"""Foreign forms of what resists by speed: damping, strength by the rate, drag, soil that joins on the way down."""

from __future__ import annotations

import math

from rollover.proof.campaign import log_uniform
from rollover.proof.forms import Form, physics, resisting, strength, uniform
from rollover.proof.library import Change, Random, Setting
from rollover.proof.rig import FACE

USUAL = 2.0  # m/s at which strengths are drawn
DEEP = 0.2  # m, as well
WIDTH = 0.045  # m, the lesser side of the face


def _hunt_crossley(random: Random, s: Setting, id: str) -> Change:
    """F + chi z^1.5 v, down and up; a surface does not pull."""
    chi = strength(random) / (math.pow(0.1, 1.5) * USUAL)

    def law(t: float, z: float, v: float, force: float) -> float:
        return max(force + chi * math.pow(max(z, 0.0), 1.5) * v, min(force, 0.0))

    return resisting(id, {"chi": chi}, "speed", law, returning=law)


def _saturating_dashpot(random: Random, s: Setting, id: str) -> Change:
    """F + c v up to a speed, from there on what it has reached; a surface does not pull."""
    most, at = strength(random), uniform(random, 0.25, 0.8)

    def law(t: float, z: float, v: float, force: float) -> float:
        return max(force + most * min(max(v / at, -1.0), 1.0), min(force, 0.0))

    return resisting(id, {"most": most, "speed": at}, "speed", law, returning=law)


def _eyring(random: Random, s: Setting, id: str) -> Change:
    """F + a arsinh(v/v_0), v > 0."""
    slow = log_uniform(random, 0.1, 0.6)
    a = strength(random) / math.asinh(USUAL / slow)

    def law(t: float, z: float, v: float, force: float) -> float:
        return force + a * math.asinh(max(v, 0.0) / slow)

    return resisting(id, {"scale": a, "speed": slow}, "speed", law)


def _embedded(random: Random, s: Setting, id: str) -> Change:
    """F + c v (1 + z/h), v > 0: the sides radiate too."""
    h = log_uniform(random, 0.02, 0.1)
    c = strength(random) / (USUAL * (1.0 + 0.1 / h))

    def law(t: float, z: float, v: float, force: float) -> float:
        return force + c * max(v, 0.0) * (1.0 + z / h)

    return resisting(id, {"dashpot": c, "height": h}, "speed", law)


def _arsinh_rate(random: Random, s: Setting, id: str) -> Change:
    """F (1 + mu arsinh(v/v_0)/ln 10), v > 0."""
    mu, slow = log_uniform(random, 0.02, 0.3), log_uniform(random, 0.05, 0.5)

    def law(t: float, z: float, v: float, force: float) -> float:
        return force * (1.0 + mu * math.asinh(max(v, 0.0) / slow) / math.log(10.0))

    return resisting(id, {"gain": mu, "speed": slow}, "speed", law)


def _herschel_bulkley(random: Random, s: Setting, id: str) -> Change:
    """F (1 + eta v^n), v > 0 in m/s."""
    eta, n = log_uniform(random, 0.02, 0.4), uniform(random, 0.25, 0.5)

    def law(t: float, z: float, v: float, force: float) -> float:
        return force * (1.0 + eta * math.pow(max(v, 0.0), n))

    return resisting(id, {"viscosity": eta, "index": n}, "speed", law)


def _strain_rate(random: Random, s: Setting, id: str) -> Change:
    """F (1 + lambda log10(v/(B + z)/rate_0)): what shears is the deeper, the slower."""
    gain, least = log_uniform(random, 0.02, 0.25), log_uniform(random, 0.3, 3.0)

    def law(t: float, z: float, v: float, force: float) -> float:
        rate = max(v, 0.0) / (WIDTH + z)
        return force * (1.0 + gain * math.log10(rate / least)) if rate > least else force

    return resisting(id, {"gain": gain, "rate": least}, "speed", law)


def _two_regimes(random: Random, s: Setting, id: str) -> Change:
    """F (1 + lambda log10(v/v_0)), from v_1 on three to six times as much for each decade."""
    gain, times, second = log_uniform(random, 0.01, 0.1), uniform(random, 3.0, 6.0), uniform(random, 0.4, 1.2)

    def law(t: float, z: float, v: float, force: float) -> float:
        if v <= 0.01:
            return force
        more = (times - 1.0) * math.log10(v / second) if v > second else 0.0
        return force * (1.0 + gain * (math.log10(v / 0.01) + more))

    return resisting(id, {"gain": gain, "times": times, "speed": second}, "speed", law)


def _cubic(random: Random, s: Setting, id: str) -> Change:
    """F + k v^3, v > 0."""
    k = strength(random) / USUAL**3

    def law(t: float, z: float, v: float, force: float) -> float:
        return force + k * max(v, 0.0) ** 3

    return resisting(id, {"factor": k}, "speed", law)


def _developing(random: Random, s: Setting, id: str) -> Change:
    """F + 1/2 C rho A v^2 (1 - exp(-z/l)), v > 0: the flow takes some depth to develop."""
    c, length = strength(random) / (0.5 * 1800.0 * FACE * USUAL**2), uniform(random, 0.5, 2.5) * WIDTH

    def law(t: float, z: float, v: float, force: float) -> float:
        return force + 0.5 * c * 1800.0 * FACE * max(v, 0.0) ** 2 * (1.0 - math.exp(-z / length))

    return resisting(id, {"factor": c, "length": length}, "speed", law)


def _linear_and_square(random: Random, s: Setting, id: str) -> Change:
    """F + b v + c v^2, v > 0, the linear part a fifth to two fifths of it at 2 m/s."""
    whole, share = strength(random), uniform(random, 0.2, 0.4)
    b, c = share * whole / USUAL, (1.0 - share) * whole / USUAL**2

    def law(t: float, z: float, v: float, force: float) -> float:
        v = max(v, 0.0)
        return force + b * v + c * v * v

    return resisting(id, {"linear": b, "square": c}, "speed", law)


def _levelling(random: Random, s: Setting, id: str) -> Change:
    """F + c v^2/(1 + v/v_1), v > 0: square at first, linear when fast."""
    at = uniform(random, 0.6, 2.0)
    c = strength(random) * (1.0 + USUAL / at) / USUAL**2

    def law(t: float, z: float, v: float, force: float) -> float:
        v = max(v, 0.0)
        return force + c * v * v / (1.0 + v / at)

    return resisting(id, {"factor": c, "speed": at}, "speed", law)


def _gathered_saturating(random: Random, s: Setting, id: str) -> Change:
    """m_b1 + M (1 - exp(-z/l))."""
    m, length = log_uniform(random, 0.5, 15.0), log_uniform(random, 0.03, 0.1)

    def gather(z: float) -> tuple[float, float]:
        fades = math.exp(-max(z, 0.0) / length)
        return m * (1.0 - fades), m / length * fades

    return physics(id, {"mass": m, "length": length}, "speed", gather=gather)


def _gathered_root(random: Random, s: Setting, id: str) -> Change:
    """m_b1 + M (sqrt(1 + z/l) - 1)/(sqrt(1 + 0.2/l) - 1)."""
    m, length = log_uniform(random, 0.5, 15.0), log_uniform(random, 0.005, 0.03)
    norm = m / (math.sqrt(1.0 + DEEP / length) - 1.0)

    def gather(z: float) -> tuple[float, float]:
        root = math.sqrt(1.0 + max(z, 0.0) / length)
        return norm * (root - 1.0), norm / (2.0 * length * root)

    return physics(id, {"mass": m, "length": length}, "speed", gather=gather)


def _gathered_square(random: Random, s: Setting, id: str) -> Change:
    """m_b1 + M (z/0.2 m)^2."""
    m = log_uniform(random, 0.5, 15.0)

    def gather(z: float) -> tuple[float, float]:
        share = max(z, 0.0) / DEEP
        return m * share * share, 2.0 * m * share / DEEP

    return physics(id, {"mass": m}, "speed", gather=gather)


GROUND: dict[str, tuple[Form, ...]] = {
    "soil-viscous-damping": (
        Form(name="hunt-crossley", source="Hunt, Crossley, J. Appl. Mech. 42 (1975) 440", draw=_hunt_crossley),
        Form(
            name="kelvin-voigt-with-cut-off",
            source="a dashpot that yields, Bingham; no pull at a surface, e.g. Goyal, Pinson, Sinden, Eng. Comput. 10 "
            "(1994) 162",
            draw=_saturating_dashpot,
        ),
        Form(name="eyring", source="Eyring, J. Chem. Phys. 4 (1936) 283", draw=_eyring),
        Form(
            name="embedded-dashpot",
            source="radiation from the sides of an embedded footing, Gazetas, J. Geotech. Eng. 117 (1991) 1363",
            draw=_embedded,
        ),
    ),
    "soil-rate-hardening": (
        Form(
            name="arsinh-rate",
            source="Einav, Randolph, Int. J. Numer. Methods Eng. 63 (2005) 1991; arsinh as in Eyring 1936",
            draw=_arsinh_rate,
        ),
        Form(
            name="herschel-bulkley",
            source="Boukpeti et al., Geotechnique 62 (2012) 137; with another index Cowper, Symonds 1957",
            draw=_herschel_bulkley,
        ),
        Form(
            name="strain-rate-falling-with-depth",
            source="rate of strain as speed over the size of what shears, Biscontin, Pestana, Can. Geotech. J. 38 "
            "(2001) 1264",
            draw=_strain_rate,
        ),
        Form(name="two-regimes", source="CEB Bulletin 187 (1988): two slopes over the logarithm", draw=_two_regimes),
    ),
    "soil-inertial-drag": (
        Form(name="cubic", source="a power series in v, Allen, Mayfield, Morrison, J. Appl. Phys. 28 (1957) 370",
             draw=_cubic),
        Form(name="developing-with-depth", source="drag before the cavity is formed, after Tsimring, Volfson 2005",
             draw=_developing),
        Form(name="linear-and-square", source="Forrestal, Luk, Int. J. Impact Eng. 12 (1992) 427",
             draw=_linear_and_square),
        Form(name="levelling-off", source="square at first, linear when fast, as Allen et al. 1957 have two regimes",
             draw=_levelling),
    ),
    "soil-added-mass-growth": (
        Form(name="saturating", source="the bulb under a footing is complete after its width, Lysmer, Richart 1966",
             draw=_gathered_saturating),
        Form(name="root-of-depth", source="a bulb that grows with the contact, Wagner, ZAMM 12 (1932) 193",
             draw=_gathered_root),
        Form(name="square-of-depth", source="wedge, von Karman, NACA TN 321 (1929)", draw=_gathered_square),
    ),
}  # fmt: skip
