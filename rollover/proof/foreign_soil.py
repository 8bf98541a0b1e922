"""Foreign forms of what goes by depth: layers, crusts, stiffness, the way back, a pull at lift-off, soil at once."""

from __future__ import annotations

import math

from rollover.proof.campaign import log_uniform
from rollover.proof.forms import Form, physics, ratio, resisting, uniform
from rollover.proof.library import Change, Random, Setting
from rollover.proof.rig import FACE, Rig, loading_curve


def _top(random: Random, s: Setting) -> float:
    """Depth of a layer that the second deepest drop reaches, m."""
    return uniform(random, 0.15, 0.7) * sorted(s.depths)[-2]


def _ramp(random: Random, s: Setting, id: str) -> Change:
    """K' grows from 1 to the ratio over a length below the top."""
    top, r, length = _top(random, s), ratio(random), uniform(random, 0.03, 0.12)

    def law(t: float, z: float, v: float, force: float) -> float:
        return force * (1.0 + (r - 1.0) * min(max((z - top) / length, 0.0), 1.0))

    return resisting(id, {"top": top, "ratio": r, "length": length}, "depth", law, breaks=(top, top + length))


def _two_step(random: Random, s: Setting, id: str) -> Change:
    """Half of it at the top, the other half 20 to 60 mm deeper."""
    top, r, apart = _top(random, s), ratio(random), uniform(random, 0.02, 0.06)

    def law(t: float, z: float, v: float, force: float) -> float:
        return force * (1.0 + 0.5 * (r - 1.0) * (float(z > top) + float(z > top + apart)))

    return resisting(id, {"top": top, "ratio": r, "apart": apart}, "depth", law, breaks=(top, top + apart))


def _gibson(random: Random, s: Setting, id: str) -> Change:
    """K' grows with the depth below the top, without an end."""
    top, r = _top(random, s), math.exp(log_uniform(random, 0.05, 1.2))
    slope = (r - 1.0) / 0.1

    def law(t: float, z: float, v: float, force: float) -> float:
        return force * (1.0 + slope * max(z - top, 0.0))

    return resisting(id, {"top": top, "per_metre": slope}, "depth", law, breaks=(top,))


def _pan(random: Random, s: Setting, id: str) -> Change:
    """A thin hard pan over softer soil: what it adds dies out below its top."""
    top, r, length = _top(random, s), ratio(random, 0.1, 1.3), uniform(random, 0.06, 0.2)

    def law(t: float, z: float, v: float, force: float) -> float:
        return force * (1.0 + (r - 1.0) * math.exp(-(z - top) / length)) if z > top else force

    return resisting(id, {"top": top, "ratio": r, "length": length}, "depth", law, breaks=(top,))


def _plate(random: Random) -> tuple[float, float]:
    """Thickness of a crust (m) and what it adds where it breaks (N); it grows with the depth until then."""
    thickness = uniform(random, 0.012, 0.08)
    below = loading_curve(Rig(), 2.0)(0.0, thickness, 0.0)
    return thickness, (ratio(random) - 1.0) * below


def _stays(random: Random, s: Setting, id: str) -> Change:
    """The force that the crust has reached stays."""
    thickness, most = _plate(random)

    def law(t: float, z: float, v: float, force: float) -> float:
        return force + most * min(z / thickness, 1.0)

    return resisting(id, {"thickness": thickness, "force": most}, "depth", law, breaks=(thickness,))


def _exponential(random: Random, s: Setting, id: str) -> Change:
    """It softens exponentially behind its peak."""
    thickness, most = _plate(random)
    length = uniform(random, 0.4, 1.5) * thickness

    def law(t: float, z: float, v: float, force: float) -> float:
        return force + most * (z / thickness if z < thickness else math.exp(-(z - thickness) / length))

    parameters = {"thickness": thickness, "force": most, "length": length}
    return resisting(id, parameters, "depth", law, breaks=(thickness,))


def _linear(random: Random, s: Setting, id: str) -> Change:
    """It softens along a line behind its peak."""
    thickness, most = _plate(random)
    length = uniform(random, 0.5, 2.0) * thickness

    def law(t: float, z: float, v: float, force: float) -> float:
        return force + most * (z / thickness if z < thickness else max(1.0 - (z - thickness) / length, 0.0))

    parameters = {"thickness": thickness, "force": most, "length": length}
    return resisting(id, parameters, "depth", law, breaks=(thickness, thickness + length))


def _profile(random: Random, s: Setting, id: str) -> Change:
    """K' falls off exponentially from the surface."""
    length, r = uniform(random, 0.012, 0.06), ratio(random, 0.1, 1.3)

    def law(t: float, z: float, v: float, force: float) -> float:
        return force * (1.0 + (r - 1.0) * math.exp(-z / length))

    return resisting(id, {"length": length, "ratio": r}, "depth", law)


def _more(random: Random) -> float:
    """Share by which the ground is stiffer or softer."""
    return log_uniform(random, 0.02, 0.35) * float(random.choice((-1.0, 1.0)))


def _power(random: Random, s: Setting, id: str) -> Change:
    """F (z/2 mm)^p: the paper's power of the depth is another."""
    p = _more(random) / math.log(50.0)  # at 0.1 m by the share that was drawn

    def law(t: float, z: float, v: float, force: float) -> float:
        return force * math.pow(max(z, 1e-6) / 0.002, p)

    return resisting(id, {"power": p}, "depth", law, "parameter")


def _hyperbolic(random: Random, s: Setting, id: str) -> Change:
    """F (1 + a z/(z + h))."""
    a, h = _more(random), log_uniform(random, 0.005, 0.03)

    def law(t: float, z: float, v: float, force: float) -> float:
        return force * (1.0 + a * z / (z + h))

    return resisting(id, {"share": a, "half_depth": h}, "depth", law, "parameter")


def _logarithmic(random: Random, s: Setting, id: str) -> Change:
    """F (1 + a ln(1 + z/h)/ln(1 + 0.1 m/h)): compacted by its own weight."""
    a, h = _more(random), log_uniform(random, 0.001, 0.01)

    def law(t: float, z: float, v: float, force: float) -> float:
        return force * (1.0 + a * math.log1p(z / h) / math.log1p(0.1 / h))

    return resisting(id, {"share": a, "depth_scale": h}, "depth", law, "parameter")


def _recovery(random: Random) -> tuple[float, float]:
    return log_uniform(random, 0.021, 0.3), uniform(random, 0.05, 0.9)


def _oliver_pharr(random: Random, s: Setting, id: str) -> Change:
    """F = F_max x^m on the way back, x from 1 at the deepest point to 0 in the rut."""
    (recovery, damped), m = _recovery(random), uniform(random, 1.3, 2.2)
    parameters = {"recovery": recovery, "damping_ratio": damped, "power": m}
    return physics(id, parameters, "depth", recovery=recovery, unloading_ratio=damped, unloading=lambda x: x**m)


def _bent(random: Random, s: Setting, id: str) -> Change:
    """Two straight lines: stiff at first, softer from a share of the force on."""
    (recovery, damped), force, way = _recovery(random), uniform(random, 0.25, 0.5), uniform(random, 0.6, 0.85)

    def unloading(x: float) -> float:
        return force / way * x if x < way else force + (1.0 - force) * (x - way) / (1.0 - way)

    parameters = {"recovery": recovery, "damping_ratio": damped, "force_share": force, "way_share": way}
    return physics(id, parameters, "depth", recovery=recovery, unloading_ratio=damped, unloading=unloading)


def _exponential_return(random: Random, s: Setting, id: str) -> Change:
    """F = F_max (exp(b x) - 1)/(exp(b) - 1)."""
    (recovery, damped), b = _recovery(random), uniform(random, 1.5, 4.0)
    parameters = {"recovery": recovery, "damping_ratio": damped, "curvature": b}

    def unloading(x: float) -> float:
        return math.expm1(b * min(x, 2.0)) / math.expm1(b)

    return physics(id, parameters, "depth", recovery=recovery, unloading_ratio=damped, unloading=unloading)


def _pull(random: Random) -> tuple[float, float]:
    return log_uniform(random, 3e3, 1.2e5), log_uniform(random, 0.003, 0.015)


def _dugdale(random: Random, s: Setting, id: str) -> Change:
    """The full stress up to a gap, then nothing."""
    stress, reach = _pull(random)
    parameters = {"stress": stress, "gap": reach}
    return physics(id, parameters, "depth", pull=stress * FACE, reach=reach, holding=lambda gap: 1.0)


def _decaying(random: Random, s: Setting, id: str) -> Change:
    """Exponentially less with the gap; at six lengths it ends."""
    stress, length = _pull(random)
    parameters = {"stress": stress, "length": length}
    return physics(
        id, parameters, "depth", pull=stress * FACE, reach=6.0 * length, holding=lambda gap: math.exp(-6.0 * gap)
    )


def _cohesive(random: Random, s: Setting, id: str) -> Change:
    """It opens along a line to the full stress, and closes along another to nothing."""
    (stress, reach), peak = _pull(random), uniform(random, 0.15, 0.4)

    def holding(gap: float) -> float:
        return gap / peak if gap < peak else (1.0 - gap) / (1.0 - peak)

    parameters = {"stress": stress, "gap": reach, "peak": peak}
    return physics(id, parameters, "depth", pull=stress * FACE, reach=reach, holding=holding)


def _joining(random: Random) -> tuple[float, float]:
    """Soil that joins (kg) over a length (m) instead of at once."""
    return 13.2 * log_uniform(random, 0.05, 1.0), log_uniform(random, 0.003, 0.02)


def _joins_fading(random: Random, s: Setting, id: str) -> Change:
    m, length = _joining(random)

    def gather(z: float) -> tuple[float, float]:
        fades = math.exp(-max(z, 0.0) / length)
        return m * (1.0 - fades), m / length * fades

    return physics(id, {"mass": m, "length": length}, "speed", "parameter", gather=gather)


def _joins_evenly(random: Random, s: Setting, id: str) -> Change:
    m, length = _joining(random)

    def gather(z: float) -> tuple[float, float]:
        return (m * max(z, 0.0) / length, m / length) if z < length else (m, 0.0)

    return physics(id, {"mass": m, "length": length}, "speed", "parameter", gather=gather, breaks=(length,))


def _joins_smoothly(random: Random, s: Setting, id: str) -> Change:
    m, length = _joining(random)

    def gather(z: float) -> tuple[float, float]:
        x = min(max(z, 0.0) / length, 1.0)
        return m * x * x * (3.0 - 2.0 * x), 6.0 * m / length * x * (1.0 - x)

    return physics(id, {"mass": m, "length": length}, "speed", "parameter", gather=gather, breaks=(length,))


CONE = "cone index over depth"
SOIL: dict[str, tuple[Form, ...]] = {
    "soil-layer": (
        Form(name="ramp", source=f"{CONE}, straight between two values, ASAE EP542", draw=_ramp),
        Form(name="two-step", source=f"{CONE}, a transition horizon over a hardpan, ASAE EP542", draw=_two_step),
        Form(name="gibson", source="Gibson, Geotechnique 17 (1967) 58: modulus that grows with depth", draw=_gibson),
        Form(name="thin-pan", source="punch-through of a hard layer, Meyerhof, Can. Geotech. J. 11 (1974) 223",
             draw=_pan),
    ),
    "soil-crust": (
        Form(name="force-stays", source="a plate of ideally plastic soil, Meyerhof, Hanna 1978", draw=_stays),
        Form(name="exponential-softening", source="softening behind a peak, Bazant, Planas 1998", draw=_exponential),
        Form(name="linear-softening", source="Hillerborg, Modeer, Petersson, Cem. Concr. Res. 6 (1976) 773",
             draw=_linear),
        Form(name="exponential-profile", source="strength that falls off from a dry surface, Bekker 1969",
             draw=_profile),
    ),
    "soil-stiffness": (
        Form(name="power-of-depth", source="p = k z^n with another n, Bekker 1969", draw=_power),
        Form(name="hyperbolic", source="Kondner, J. Soil Mech. Found. Div. 89 (1963) 115", draw=_hyperbolic),
        Form(name="logarithmic", source="a stiffness by the logarithm of the depth, an engineering guess",
             draw=_logarithmic),
    ),
    "soil-elastic-rebound": (
        Form(name="power-unloading", source="Oliver, Pharr, J. Mater. Res. 7 (1992) 1564", draw=_oliver_pharr),
        Form(name="two-slopes", source="unloading in two branches, after Walton, Braun, J. Rheol. 30 (1986) 949",
             draw=_bent),
        Form(name="exponential-unloading", source="confined swelling by the logarithm of the stress, Terzaghi 1943",
             draw=_exponential_return),
    ),
    "soil-adhesion": (
        Form(name="constant-to-a-gap", source="Dugdale, J. Mech. Phys. Solids 8 (1960) 100", draw=_dugdale),
        Form(name="exponential", source="Xu, Needleman, Model. Simul. Mater. Sci. Eng. 1 (1993) 111", draw=_decaying),
        Form(name="triangular", source="bilinear cohesive zone, Geubelle, Baylor, Compos. B 29 (1998) 589",
             draw=_cohesive),
    ),
    "co-moving-mass": (
        Form(name="joins-exponentially", source="the bulb forms over the first millimetres, Lysmer, Richart 1966",
             draw=_joins_fading),
        Form(name="joins-evenly", source="as before, at a constant rate", draw=_joins_evenly),
        Form(name="joins-smoothly", source="as before, with a smooth beginning and end", draw=_joins_smoothly),
    ),
}  # fmt: skip
