"""A yield in forms that are not the product's own, |F| <= F_y, written down as numbers of the mounts.

What else acts in overturns has no other form that can be written as numbers of a scenario.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rollover.proof.campaign import log_uniform
from rollover.proof.overturns.library import MOUNTS, YIELD_X, Change, Draw, Random

STIFF = 0.05  # m, gauge length over which a mount is strained


def _yields(
    forces: Mapping[str, float], parameters: Mapping[str, float], form: str, source: str, **more: Any
) -> Change:
    values: dict[str, Any] = {}
    for mount, force in forces.items():
        values[f"vehicle.rops.mounts.{mount}.yield_force"] = [YIELD_X, force, None]
        values |= {f"vehicle.rops.mounts.{mount}.{name}": value for name, value in more.items()}
    return Change(id="rops-plasticity", kind="physics", parameters=parameters, values=values, form=form, source=source)


def _whole(random: Random) -> float:
    """Yield force of both mounts together, N."""
    return log_uniform(random, 3000.0, 10_000.0)


def _hardening(random: Random) -> Change:
    """Behind the yield a tangent of 3 to 25 % of the elastic stiffness."""
    whole, share = _whole(random), log_uniform(random, 0.03, 0.25)
    parameters = {"yield_force": whole, "tangent": share}
    source = "bilinear hardening, Chen, Han, Plasticity for Structural Engineers 1988"
    return _yields(dict.fromkeys(MOUNTS, 0.5 * whole), parameters, "hardening", source, hardening=[0.0, share, 0.0])


def _by_rate(random: Random) -> Change:
    """F_y (1 + (rate/D)^(1/q)) of mild steel, D = 40.4 1/s, q = 5, over some gauge length."""
    whole, gauge = _whole(random), log_uniform(random, 0.5 * STIFF, 4.0 * STIFF)
    parameters = {"static_force": whole, "gauge_length": gauge}
    rate = {"rate": 40.4, "exponent": 5.0, "gauge_length": gauge}
    return _yields(dict.fromkeys(MOUNTS, 0.5 * whole), parameters, "by-rate", "Cowper, Symonds 1957", rate_factor=rate)


def _mounts_in_turn(random: Random) -> Change:
    """One mount yields early, the other late: both together have a knee of two bends."""
    whole, apart = _whole(random), float(random.uniform(0.2, 0.5))
    first, second = random.permutation(MOUNTS).tolist()
    forces = {str(first): 0.5 * whole * (1.0 - apart), str(second): 0.5 * whole * (1.0 + apart)}
    source = "two elements in parallel, Iwan, J. Appl. Mech. 33 (1966) 893"
    return _yields(forces, {"yield_force": whole, "apart": apart}, "one-by-one", source)


FORMS = {"rops-plasticity": (_hardening, _by_rate, _mounts_in_turn)}


def _drawn(id: str) -> Draw:
    def draw(random: Random, _: Mapping[str, float]) -> Change:
        return FORMS[id][int(random.integers(len(FORMS[id])))](random)

    return draw


EFFECTS: dict[str, Draw] = {id: _drawn(id) for id in FORMS}
