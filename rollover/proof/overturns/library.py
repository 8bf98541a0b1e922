"""Effects that act in overturns, at a random strength, as values of the scenario or as faults of an instrument."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rollover.proof.campaign import log_uniform
from rollover.proof.instruments import Fault

Random = np.random.Generator

# what the utility tractor and its ground are without any effect
MASS, CENTRE, INERTIA = 3000.0, (0.90, 0.0, 0.82), (1300.0, 3000.0, 3300.0)
FRICTION, SWING, TYRE_DAMPING = 0.5, 12.0, 3000.0
TYRES = ("front_left", "front_right", "rear_left", "rear_right")
LATERAL = {"front_left": 110e3, "front_right": 110e3, "rear_left": 175e3, "rear_right": 175e3}
MOUNTS = ("left", "right")
YIELD_X = 15_000.0
SCALED = ("chassis/roll",)  # the same law on a place or an attitude is a scale in the table of effects


@dataclass(frozen=True, kw_only=True)
class Change:
    """An effect at a strength: `parameters` by the names of the contract, `values` those of the scenario.

    `tilt` (rad) is added to the inclination of every test's ground, its roll rate is `pushed` times what is written
    down; `channel` is the one that `fault` spoils; `depends_on` and `near` are for what no table of effects holds.
    """

    id: str
    kind: str  # physics, parameter, sensor, outside
    parameters: Mapping[str, float]
    values: Mapping[str, Any] = field(default_factory=dict)
    tilt: float = 0.0
    pushed: float = 1.0
    channel: str = ""
    fault: Fault = field(default_factory=Fault)
    depends_on: str = ""
    near: tuple[str, ...] = ()
    form: str = ""
    source: str = ""

    @property
    def moves(self) -> bool:
        """Whether the motion is another."""
        return bool(self.values) or self.tilt != 0.0 or self.pushed != 1.0


Draw = Callable[[Random, Mapping[str, float]], Change]


def _either(random: Random, low: float, high: float) -> float:
    """A number of either sign, its size from `low` to `high`."""
    return log_uniform(random, low, high) * float(random.choice((-1.0, 1.0)))


def _friction(random: Random, _: Mapping[str, float]) -> Change:
    mu = FRICTION * math.exp(_either(random, 0.15, 0.9))
    return Change(
        id="ground-friction", kind="physics", parameters={"coefficient": mu}, values={"ground.friction.coefficient": mu}
    )


def _plasticity(random: Random, _: Mapping[str, float]) -> Change:
    whole = log_uniform(random, 3000.0, 11_000.0)
    values = {f"vehicle.rops.mounts.{m}.yield_force": [YIELD_X, 0.5 * whole, None] for m in MOUNTS}
    return Change(id="rops-plasticity", kind="physics", parameters={"yield_force": whole}, values=values)


def _tyre_damping(random: Random, _: Mapping[str, float]) -> Change:
    c = TYRE_DAMPING * math.exp(_either(random, 0.5, 2.0))
    values = {f"vehicle.wheels.{w}.tyre.vertical_damping": c for w in TYRES}
    return Change(id="tyre-damping", kind="physics", parameters={"damping": c}, values=values)


def _axle_stop(random: Random, _: Mapping[str, float]) -> Change:
    swing = SWING + _either(random, 0.4, 5.0)
    return Change(
        id="axle-stop",
        kind="physics",
        parameters={"angle": math.radians(swing)},
        values={"vehicle.front_axle.swing_deg": swing},
    )


def _slosh(random: Random, _: Mapping[str, float]) -> Change:
    parameters = {"mass": log_uniform(random, 60.0, 400.0), "length": log_uniform(random, 0.15, 0.6)}
    return Change(
        id="tank-slosh",
        kind="physics",
        parameters=parameters,
        values=_term("tank-slosh", {**parameters, "damping": 0.02}),
    )


def _payload(random: Random, _: Mapping[str, float]) -> Change:
    parameters = {"mass": log_uniform(random, 60.0, 400.0), "travel": log_uniform(random, 0.06, 0.3)}
    friction = float(random.uniform(0.2, 0.5))
    return Change(
        id="payload-shift",
        kind="physics",
        parameters=parameters,
        values=_term("payload-shift", {**parameters, "friction": friction}),
    )


def _layer(random: Random, _: Mapping[str, float]) -> Change:
    parameters = {"depth": log_uniform(random, 0.006, 0.02), "stiffness_ratio": log_uniform(random, 1.5, 5.0)}
    return Change(id="soil-layer", kind="physics", parameters=parameters, values=_term("soil-layer", parameters))


def _air(_: Random, __: Mapping[str, float]) -> Change:
    return Change(id="air-drag", kind="physics", parameters={"area": 2.0}, values=_term("air-drag", {"area": 2.0}))


def _term(id: str, parameters: Mapping[str, float]) -> dict[str, Any]:
    return {f"effects.{id}.{name}": value for name, value in parameters.items()}


def _centre(random: Random, _: Mapping[str, float]) -> Change:
    x, y, z = CENTRE
    up, left = _either(random, 0.005, 0.06), _either(random, 0.002, 0.03)
    return Change(
        id="centre-of-mass",
        kind="parameter",
        parameters={"height": up, "lateral": left},
        values={"vehicle.whole.centre_of_mass": [x, y + left, z + up]},
    )


def _inertia(random: Random, _: Mapping[str, float]) -> Change:
    scale = math.exp(_either(random, 0.03, 0.3))
    values = {"vehicle.whole.inertia": [scale * v for v in INERTIA]}
    return Change(id="inertia", kind="parameter", parameters={"scale": scale}, values=values)


def _tilted(random: Random, _: Mapping[str, float]) -> Change:
    angle = _either(random, 0.005, 0.05)
    return Change(id="slope", kind="parameter", parameters={"angle": angle}, tilt=angle)


def _sensor(id: str, fault: Callable[[Random, float], tuple[dict[str, float], Fault]]) -> Draw:
    def draw(random: Random, spans: Mapping[str, float]) -> Change:
        channel = str(random.choice(sorted(spans)))
        parameters, wrong = fault(random, spans[channel])
        name = id
        if id == "sensor-gain" and channel in SCALED:
            name, parameters = "sensor-scale", {"scale": parameters["gain"]}
        return Change(id=name, kind="sensor", parameters=parameters, channel=channel, fault=wrong)

    return draw


def _gain(random: Random, _: float) -> tuple[dict[str, float], Fault]:
    gain = math.exp(_either(random, 0.02, 0.2))
    return {"gain": gain}, Fault(gain=gain)


def _bias(random: Random, span: float) -> tuple[dict[str, float], Fault]:
    bias = _either(random, 0.005, 0.1) * span
    return {"bias": bias}, Fault(bias=bias)


def _offset(random: Random, _: float) -> tuple[dict[str, float], Fault]:
    late = _either(random, 0.003, 0.03)
    return {"offset": late}, Fault(offset=late)


EFFECTS: dict[str, Draw] = {
    "ground-friction": _friction,
    "rops-plasticity": _plasticity,
    "tyre-damping": _tyre_damping,
    "axle-stop": _axle_stop,
    "tank-slosh": _slosh,
    "payload-shift": _payload,
    "soil-layer": _layer,
    "centre-of-mass": _centre,
    "inertia": _inertia,
    "slope": _tilted,
    "sensor-gain": _sensor("sensor-gain", _gain),
    "sensor-bias": _sensor("sensor-bias", _bias),
    "sensor-clock-offset": _sensor("sensor-clock-offset", _offset),
}
NEGLIGIBLE: dict[str, Draw] = {"air-drag": _air}
