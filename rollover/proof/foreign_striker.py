"""Foreign forms of what belongs to the striker: a joint that gives way, the guide, the air."""

from __future__ import annotations

import math

from rollover.proof.campaign import log_uniform
from rollover.proof.forms import Form, physics, uniform
from rollover.proof.library import Change, Random, Setting
from rollover.proof.rig import Bristle

BODY = 2400.0  # N that the joint carries in a usual drop: 120 kg at 20 m/s2
CREEP = 0.002  # m/s over which friction changes its sign


def _block(random: Random) -> tuple[float, float, float]:
    """Stiffness (N/m), dashpot (N s/m) and the share of the nose, as the own form draws them."""
    return log_uniform(random, 1e5, 3e6), log_uniform(random, 100.0, 2000.0), log_uniform(random, 0.05, 0.3)


def _duffing(random: Random, s: Setting, id: str) -> Change:
    """S = k u (1 + (u/u_0)^2) + c u'."""
    (k, c, share), bend = _block(random), uniform(random, 0.4, 1.2)
    at = bend * BODY / k

    def joint(u: float, w: float) -> float:
        return k * u * (1.0 + (u / at) ** 2) + c * w

    parameters = {"linear": k, "dashpot": c, "nose": share, "closing": at}
    return physics(id, parameters, "acceleration", spring=k, dashpot=c, nose_share=share, joint=joint)


def _softening(random: Random, s: Setting, id: str) -> Change:
    """S = k u_0 tanh(u/u_0) + c u'."""
    (k, c, share), bend = _block(random), uniform(random, 1.6, 3.0)
    at = bend * BODY / k

    def joint(u: float, w: float) -> float:
        return k * at * math.tanh(u / at) + c * w

    parameters = {"linear": k, "dashpot": c, "nose": share, "closing": at}
    return physics(id, parameters, "acceleration", spring=k, dashpot=c, nose_share=share, joint=joint)


def _square_damping(random: Random, s: Setting, id: str) -> Change:
    """S = k u + c |u'| u'."""
    k, c, share = _block(random)
    square = c / 0.1

    def joint(u: float, w: float) -> float:
        return k * u + square * abs(w) * w

    parameters = {"linear": k, "square": square, "nose": share}
    return physics(id, parameters, "acceleration", spring=k, dashpot=c, nose_share=share, joint=joint)


def _dry_joint(random: Random, s: Setting, id: str) -> Change:
    """S = k u + f tanh(u'/v_0)."""
    (k, _, share), dry = _block(random), log_uniform(random, 20.0, 300.0)

    def joint(u: float, w: float) -> float:
        return k * u + dry * math.tanh(w / 0.01)

    parameters = {"linear": k, "friction": dry, "nose": share}
    return physics(id, parameters, "acceleration", spring=k, dashpot=dry / 0.01, nose_share=share, joint=joint)


def _rubs(random: Random) -> float:
    return log_uniform(random, 8.0, 400.0)


def _one_way(random: Random, s: Setting, id: str) -> Change:
    """F on the way down, nothing on the way up."""
    force = _rubs(random)

    def push(t: float, x: float, v: float) -> float:
        return -force * math.tanh(v / CREEP) if v > 0.0 else 0.0

    return physics(id, {"force": force}, "speed", push=push)


def _stribeck_level(random: Random, force: float) -> tuple[float, float]:
    return force * uniform(random, 1.3, 2.2), uniform(random, 0.1, 0.6)


def _stribeck(random: Random, s: Setting, id: str) -> Change:
    """F_c + (F_s - F_c) exp(-(v/v_s)^2)."""
    force = _rubs(random)
    static, slow = _stribeck_level(random, force)

    def push(t: float, x: float, v: float) -> float:
        return -(force + (static - force) * math.exp(-((v / slow) ** 2))) * math.tanh(v / CREEP)

    return physics(id, {"kinetic": force, "static": static, "speed": slow}, "speed", push=push)


def _lugre(random: Random, s: Setting, id: str) -> Change:
    """Bristles that bend and slip, with Stribeck's level and a viscous part."""
    force = _rubs(random)
    static, slow = _stribeck_level(random, force)
    stiffness = force / log_uniform(random, 3e-4, 3e-3)
    damping, viscous = 0.4 * math.sqrt(stiffness * 132.0), uniform(random, 0.02, 0.15) * force

    def level(v: float) -> float:
        return force + (static - force) * math.exp(-((v / slow) ** 2))

    parameters = {"kinetic": force, "static": static, "speed": slow, "bristles": stiffness, "viscous": viscous}
    bristle = Bristle(stiffness=stiffness, damping=damping, viscous=viscous, level=level)
    return physics(id, parameters, "speed", bristle=bristle)


def _lubricated(random: Random, s: Setting, id: str) -> Change:
    """F_c + k |v|: dry and viscous friction."""
    force, at = _rubs(random), log_uniform(random, 0.6, 4.0)

    def push(t: float, x: float, v: float) -> float:
        return -force * (1.0 + abs(v) / at) * math.tanh(v / CREEP)

    return physics(id, {"kinetic": force, "speed": at}, "speed", push=push)


def _drag(power: float) -> Form:
    """-F v^power of the air, 3 to 80 N at 3 m/s: a plate or a sail on the striker."""

    def draw(random: Random, s: Setting, id: str) -> Change:
        factor = log_uniform(random, 3.0, 80.0) / math.pow(3.0, power)

        def push(t: float, x: float, v: float) -> float:
            return -factor * math.copysign(math.pow(abs(v), power), v)

        return physics(id, {"factor": factor, "power": power}, "speed", push=push)

    names = {1.0: "linear", 1.5: "power-1.5", 3.0: "cubic"}
    sources = {
        1.0: "Stokes 1851",
        1.5: "between Stokes and Newton, Allen 1900",
        3.0: "what grows beyond the square, as by Allen, Mayfield, Morrison 1957",
    }
    return Form(name=names[power], source=sources[power], draw=draw)


STRIKER: dict[str, tuple[Form, ...]] = {
    "structural-compliance": (
        Form(name="duffing", source="Duffing 1918: a bolted joint that stiffens", draw=_duffing),
        Form(name="softening", source="a joint that opens, Ibrahim, Pettit, J. Sound Vib. 279 (2005) 857",
             draw=_softening),
        Form(name="square-damping", source="damping by |w| w, Jacobsen 1930", draw=_square_damping),
        Form(name="dry-joint", source="Iwan, J. Appl. Mech. 33 (1966) 893, of one element", draw=_dry_joint),
    ),
    "guide-friction": (
        Form(name="down-only", source="a ratchet or a rope that runs out: no part on the way back", draw=_one_way),
        Form(name="stribeck", source="Stribeck 1902; Armstrong-Helouvry 1991", draw=_stribeck),
        Form(name="lugre", source="Canudas de Wit et al., IEEE Trans. Autom. Control 40 (1995) 419", draw=_lugre),
        Form(name="dry-and-viscous", source="a lubricated guide, Olsson et al., Eur. J. Control 4 (1998) 176",
             draw=_lubricated),
    ),
    "air-drag": (_drag(1.0), _drag(1.5), _drag(3.0)),
}  # fmt: skip
