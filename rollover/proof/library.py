"""Effects with names, at a random strength: what each changes of the rig, the instruments or the scenario's numbers.

Strengths reach from the barely visible to the strong and are even in their logarithm. `other_forms` lets each differ
from the law that a diagnosis fits where physics leaves it open: soft edges of layers, layers that set in where others
leap, exponents that are not round, lags of second order.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rollover.proof.campaign import ACCELERATION, DEPTH, FORCE, PLACE, SPEED, log_uniform
from rollover.proof.rig import FACE

Random = np.random.Generator
ANOTHER = 0.35  # of effects in other forms, those by another law of the same name
MOST_CHANNELS = (FORCE, DEPTH, ACCELERATION, SPEED, PLACE)


@dataclass(frozen=True, kw_only=True)
class Setting:
    """What a draw may lean on: how deep each drop goes without the effect (m), the range of each channel."""

    depths: tuple[float, ...]
    spans: Mapping[str, float]
    peaks: Mapping[str, float]
    channels: tuple[str, ...]
    other_forms: bool = False


@dataclass(frozen=True, kw_only=True)
class Change:
    """An effect at a strength: `parameters` by the names of the contract."""

    id: str
    kind: str  # physics, parameter, sensor, outside
    parameters: Mapping[str, float]
    rig: Mapping[str, Any] = field(default_factory=dict)
    factors: Mapping[str, float] = field(default_factory=dict)  # numbers of the rig that are multiplied
    channel: str = ""
    fault: Mapping[str, Any] = field(default_factory=dict)
    speed_power: float = 0.0  # the ground's stiffness grows with this power of the speed (outside)
    depends_on: str = ""
    near: tuple[str, ...] = ()  # listed effects that an unlisted one resembles
    form: str = ""  # the law of the literature by which it acts, where that is not the usual one
    source: str = ""  # of that law


Draw = Callable[[Random, Setting], Change]


def _either(random: Random, low: float, high: float) -> float:
    """A factor above or below 1, by `low` to `high` of its logarithm."""
    return math.exp(log_uniform(random, low, high) * random.choice((-1.0, 1.0)))


def _physics(id: str, parameters: Mapping[str, float], depends_on: str, **rig: Any) -> Change:
    return Change(id=id, kind="physics", parameters=parameters, rig=rig, depends_on=depends_on)


def _viscous(random: Random, s: Setting) -> Change:
    if s.other_forms and random.random() < ANOTHER:
        proportion = log_uniform(random, 0.002, 0.6)
        return _physics("soil-viscous-damping", {"proportion": proportion}, "speed", proportion=proportion)
    exponent = 1.0 if random.random() < 0.6 and not s.other_forms else float(random.uniform(0.85, 1.2))
    d = log_uniform(random, 6.0, 3000.0)
    parameters = {"damping": d, "exponent": exponent}
    return _physics("soil-viscous-damping", parameters, "speed", damping=d, exponent=exponent)


def _rate(random: Random, s: Setting) -> Change:
    if s.other_forms and random.random() < ANOTHER:
        power, slow = log_uniform(random, 0.001, 0.1), log_uniform(random, 0.007, 0.2)
        return _physics("soil-rate-hardening", {"power": power}, "speed", power=power, slow=slow)
    gain = log_uniform(random, 0.002, 0.2)
    slow = log_uniform(random, 0.007, 0.014) if s.other_forms else 0.01
    return _physics("soil-rate-hardening", {"per_decade": gain}, "speed", per_decade=gain, slow=slow)


def _drag(random: Random, s: Setting) -> Change:
    c = log_uniform(random, 0.08, 40.0)
    power = float(random.uniform(1.9, 2.1)) if s.other_forms else 2.0
    parameters = {"coefficient": c}
    return _physics("soil-inertial-drag", parameters, "speed", drag=0.5 * c * 1800.0 * FACE, drag_exponent=power)


def _growth(random: Random, s: Setting) -> Change:
    rate = log_uniform(random, 0.3, 100.0)
    return _physics("soil-added-mass-growth", {"rate": rate}, "speed", growth=rate)


def _rebound(random: Random, s: Setting) -> Change:
    recovery, ratio = log_uniform(random, 0.021, 0.3), float(random.uniform(0.05, 0.9))
    parameters = {"recovery": recovery, "damping_ratio": ratio}
    return _physics("soil-elastic-rebound", parameters, "depth", recovery=recovery, unloading_ratio=ratio)


def _adhesion(random: Random, s: Setting) -> Change:
    stress, reach = log_uniform(random, 3e3, 1.2e5), log_uniform(random, 0.003, 0.015)
    return _physics("soil-adhesion", {"stress": stress, "reach": reach}, "depth", pull=stress * FACE, reach=reach)


def _layer(random: Random, s: Setting) -> Change:
    reached = sorted(s.depths)[-2]
    depth, ratio = float(random.uniform(0.15, 0.8)) * reached, _either(random, 0.006, 1.2)
    if s.other_forms and random.random() < ANOTHER:
        spring = log_uniform(random, 100.0, 4e4)
        parameters = {"depth": depth, "stiffness": spring}
        return _physics("soil-layer", parameters, "depth", layer_depth=depth, layer_spring=spring)
    width = float(random.uniform(0.001, 0.02)) if s.other_forms else 0.0
    onset = float(random.choice((0.0, 1.0))) if s.other_forms else 0.0
    parameters = {"depth": depth, "stiffness_ratio": ratio}
    own = {"layer_depth": depth, "layer_ratio": ratio, "layer_width": width if onset == 0.0 else 0.0}
    return _physics("soil-layer", parameters, "depth", layer_onset=onset, **own)


def _crust(random: Random, s: Setting) -> Change:
    depth, ratio = float(random.uniform(0.012, 0.08)), _either(random, 0.012, 1.2)
    width = float(random.uniform(0.001, 0.003)) if s.other_forms else 0.0
    remains = float(random.choice((0.0, 1.0))) if s.other_forms else 0.0
    parameters = {"thickness": depth, "stiffness_ratio": ratio}
    own = {"crust_depth": depth, "crust_ratio": ratio, "crust_width": width if remains == 0.0 else 0.0}
    return _physics("soil-crust", parameters, "depth", crust_remains=remains, **own)


def _compliance(random: Random, s: Setting) -> Change:
    k, c = log_uniform(random, 1e5, 5e6), log_uniform(random, 60.0, 2000.0)
    share = log_uniform(random, 0.05, 0.3)
    parameters = {"stiffness": k, "damping": c, "nose_share": share}
    return _physics("structural-compliance", parameters, "acceleration", spring=k, dashpot=c, nose_share=share)


def _guide(random: Random, s: Setting) -> Change:
    force = log_uniform(random, 1.0, 300.0)
    creep = log_uniform(random, 1e-3, 1e-2) if random.random() < 0.5 else 0.0
    parameters = {"force": force, **({"creep": creep} if creep else {})}
    return _physics("guide-friction", parameters, "speed", guide=force, guide_creep=creep)


def _air(random: Random, s: Setting) -> Change:
    area = log_uniform(random, 0.01, 0.12)
    return _physics("air-drag", {"area": area}, "speed", air=0.5 * 1.204 * area)


def _mass(random: Random, s: Setting) -> Change:
    added = log_uniform(random, 0.1, 20.0) * float(random.choice((-1.0, 1.0)))
    return Change(id="mass", kind="parameter", parameters={"added": added}, rig={"mass": 132.0 + added})


def _speed(random: Random, s: Setting) -> Change:
    scale = _either(random, 0.0008, 0.08)
    return Change(id="impact-speed", kind="parameter", parameters={"scale": scale}, factors={"speed": scale})


def _stiffness(random: Random, s: Setting) -> Change:
    scale = _either(random, 0.001, 0.35)
    return Change(id="soil-stiffness", kind="parameter", parameters={"scale": scale}, factors={"stiffness": scale})


def _soil_mass(random: Random, s: Setting) -> Change:
    fraction = 0.10 * _either(random, 0.012, 1.2)
    return Change(id="co-moving-mass", kind="parameter", parameters={"fraction": fraction}, rig={"fraction": fraction})


def _sensor(id: str, channels: tuple[str, ...], draw: Callable[[Random, Setting, str], tuple[Any, ...]]) -> Draw:
    def made(random: Random, s: Setting) -> Change:
        channel = str(random.choice([c for c in s.channels if c in channels]))
        parameters, fault = draw(random, s, channel)
        return Change(id=id, kind="sensor", parameters=parameters, channel=channel, fault=fault)

    return made


def _signed(random: Random, low: float, high: float) -> float:
    return log_uniform(random, low, high) * float(random.choice((-1.0, 1.0)))


def _pair(name: str, field_name: str, value: float) -> tuple[dict[str, float], dict[str, float]]:
    return {name: value}, {field_name: value}


def _lag(random: Random, s: Setting, channel: str) -> tuple[dict[str, float], dict[str, float]]:
    """Of first order; where it may differ, half of them of second, as by Butterworth."""
    parameters, fault = _pair("time", "lag", log_uniform(random, 3e-4, 1.2e-2))
    return parameters, {**fault, "second_order": 0.5} if s.other_forms and random.random() < 0.5 else fault


# gains act on amplifiers, scales on lengths: the same law, another instrument
EFFECTS: dict[str, Draw] = {
    "soil-viscous-damping": _viscous,
    "soil-rate-hardening": _rate,
    "soil-inertial-drag": _drag,
    "soil-added-mass-growth": _growth,
    "soil-elastic-rebound": _rebound,
    "soil-adhesion": _adhesion,
    "soil-layer": _layer,
    "soil-crust": _crust,
    "structural-compliance": _compliance,
    "guide-friction": _guide,
    "air-drag": _air,
    "mass": _mass,
    "impact-speed": _speed,
    "soil-stiffness": _stiffness,
    "co-moving-mass": _soil_mass,
    "sensor-scale": _sensor(
        "sensor-scale", (DEPTH, PLACE), lambda r, s, c: _pair("scale", "gain", _either(r, 0.0015, 0.1))
    ),
    "sensor-gain": _sensor(
        "sensor-gain", (FORCE, ACCELERATION, SPEED), lambda r, s, c: _pair("gain", "gain", _either(r, 0.0015, 0.1))
    ),
    "sensor-bias": _sensor(
        "sensor-bias", MOST_CHANNELS, lambda r, s, c: _pair("bias", "bias", s.spans[c] * _signed(r, 0.0003, 0.06))
    ),
    "sensor-clipping": _sensor(
        "sensor-clipping",
        (FORCE, ACCELERATION, DEPTH),
        lambda r, s, c: _pair("limit", "limit", s.peaks[c] * float(r.uniform(0.5, 0.97))),
    ),
    "sensor-lag": _sensor("sensor-lag", MOST_CHANNELS, _lag),
    "sensor-clock-offset": _sensor(
        "sensor-clock-offset", MOST_CHANNELS, lambda r, s, c: _pair("offset", "offset", _signed(r, 1e-4, 1.2e-2))
    ),
    "sensor-clock-drift": _sensor(
        "sensor-clock-drift", MOST_CHANNELS, lambda r, s, c: _pair("drift", "drift", _signed(r, 2e-3, 5e-2))
    ),
}
NEGLIGIBLE = ("air-drag",)
NEEDS: dict[str, tuple[str, ...]] = {"sensor-scale": (DEPTH,)}
# the other one hides it, or says the same of the same channel
NEVER_TOGETHER = (
    frozenset({"sensor-scale", "sensor-gain"}),
    frozenset({"sensor-lag", "sensor-clock-offset"}),
    frozenset({"sensor-clock-offset", "sensor-clock-drift"}),
    frozenset({"sensor-lag", "sensor-clock-drift"}),
    frozenset({"soil-viscous-damping", "soil-inertial-drag"}),
)
