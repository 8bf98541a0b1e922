"""What no table of effects holds: twelve and more kinds of physics and faults that must end as `unexplained`.

Each says its channel, what it depends on, and the listed effects that it resembles (`near`).
"""

from __future__ import annotations

import math
from typing import Any

from rollover.proof.campaign import ACCELERATION, DEPTH, FORCE, SPEED, log_uniform
from rollover.proof.library import Change, Draw, Random, Setting

# over a short range a bend is a gain and an offset
BENT = ("sensor-gain", "sensor-scale", "sensor-bias", "sensor-clipping")


def _law(id: str, depends_on: str, parameters: dict[str, float], near: tuple[str, ...] = (), **rig: Any) -> Change:
    return Change(id=id, kind="outside", parameters=parameters, rig=rig, depends_on=depends_on, near=near)


def _on(random: Random, s: Setting, *channels: str) -> str:
    return str(random.choice([c for c in s.channels if c in channels] or [FORCE]))


def _fault(id: str, depends_on: str, channel: str, near: tuple[str, ...] = (), **fault: float) -> Change:
    return Change(
        id=id, kind="outside", parameters=fault, channel=channel, fault=fault, depends_on=depends_on, near=near
    )


def _ringing(random: Random, s: Setting) -> Change:
    """Something loose on the striker rings after the impact: F = A sin(2 pi f t) exp(-t/tau)."""
    a, f, tau = log_uniform(random, 60.0, 900.0), random.uniform(20.0, 60.0), random.uniform(0.05, 0.25)

    def push(t: float, x: float, v: float) -> float:
        return a * math.sin(2.0 * math.pi * f * t) * math.exp(-t / tau) if t > 0.0 else 0.0

    parameters = {"amplitude": a, "frequency": float(f), "decay": float(tau)}
    return _law("outside:ringing", "time", parameters, ("structural-compliance",), push=push)


def _brake(random: Random, s: Setting) -> Change:
    """A brake on the guide closes a fixed time after the impact."""
    a, at = log_uniform(random, 60.0, 900.0), random.uniform(0.02, 0.09)

    def push(t: float, x: float, v: float) -> float:
        return -a * min(max(v / 0.02, -1.0), 1.0) * min(max((t - at) / 0.002, 0.0), 1.0)

    return _law("outside:brake", "time", {"force": a, "time": float(at)}, ("guide-friction",), push=push)


def _memory(random: Random, s: Setting) -> Change:
    """Soil that relaxes: a Maxwell branch beside the spring."""
    k, tau = log_uniform(random, 1e3, 3e4), random.uniform(0.02, 0.08)
    parameters = {"stiffness": k, "time": float(tau)}
    near = ("soil-viscous-damping", "soil-rate-hardening")
    return _law("outside:memory", "time", parameters, near, relaxing=k, relaxation=float(tau))


def _bands(random: Random, s: Setting) -> Change:
    """Ground laid in bands: F (1 + A sin(2 pi z/length))."""
    a, length = log_uniform(random, 0.04, 0.5), random.uniform(0.015, 0.035)

    def resist(t: float, z: float, v: float, force: float) -> float:
        return force * (1.0 + a * math.sin(2.0 * math.pi * z / length))

    parameters = {"amplitude": a, "length": float(length)}
    return _law("outside:bands", "depth", parameters, ("soil-layer", "soil-crust"), resist=resist)


def _stone(random: Random, s: Setting) -> Change:
    """A stone that is pushed aside: a bump of force at one depth."""
    a, at = log_uniform(random, 150.0, 3000.0), random.uniform(0.3, 0.85) * sorted(s.depths)[-2]
    width = random.uniform(0.004, 0.012)

    def resist(t: float, z: float, v: float, force: float) -> float:
        return force + a * math.exp(-(((z - at) / width) ** 2))

    parameters = {"force": a, "depth": float(at), "width": float(width)}
    return _law("outside:stone", "depth", parameters, ("soil-layer",), resist=resist)


def _cubic(random: Random, s: Setting) -> Change:
    """Ground that stiffens with the cube of the depth, up to a limit."""
    a, at = log_uniform(random, 150.0, 3000.0), random.uniform(0.3, 0.8) * sorted(s.depths)[-2]

    def resist(t: float, z: float, v: float, force: float) -> float:
        ratio = (z / at) ** 3
        return force + a * ratio / (1.0 + ratio)

    return _law("outside:cubic", "depth", {"force": a, "depth": float(at)}, ("soil-layer",), resist=resist)


def _edge(random: Random, s: Setting) -> Change:
    """The face lands on its edge: the area of contact grows over the first millimetres."""
    full = random.uniform(0.02, 0.04)

    def resist(t: float, z: float, v: float, force: float) -> float:
        return force * min(z / full, 1.0)

    return _law("outside:edge", "depth", {"depth": float(full)}, ("soil-crust",), resist=resist)


def _resonance(random: Random, s: Setting) -> Change:
    """A resistance that peaks at one speed."""
    a, at, width = log_uniform(random, 150.0, 1500.0), random.uniform(0.5, 1.2), random.uniform(0.1, 0.3)

    def resist(t: float, z: float, v: float, force: float) -> float:
        return force + a * math.exp(-(((v - at) / width) ** 2))

    parameters = {"force": a, "speed": float(at), "width": float(width)}
    near = ("soil-viscous-damping", "soil-rate-hardening", "soil-inertial-drag")
    return _law("outside:resonance", "speed", parameters, near, resist=resist)


def _side_load(random: Random, s: Setting) -> Change:
    """A centre of mass beside the guide: friction that grows with the acceleration."""
    ratio = log_uniform(random, 0.01, 0.15)
    near = ("guide-friction", "mass", "soil-stiffness")
    return _law("outside:side-load", "acceleration", {"ratio": ratio}, near, side_load=ratio)


def _by_speed(random: Random, s: Setting) -> Change:
    """Ground that is stiffer the faster it was hit, all the way down."""
    power = log_uniform(random, 0.03, 0.4) * float(random.choice((-1.0, 1.0)))
    return Change(
        id="outside:stiffness-by-impact-speed",
        kind="outside",
        parameters={"power": power},
        speed_power=power,
        depends_on="impact-speed",
        near=("soil-rate-hardening", "soil-stiffness", "soil-viscous-damping"),
    )


def _warming(random: Random, s: Setting) -> Change:
    channel = _on(random, s, FORCE, ACCELERATION, DEPTH)
    gain = log_uniform(random, 0.02, 0.3) * float(random.choice((-1.0, 1.0)))
    middle, width = float(random.uniform(0.05, 0.15)), float(random.uniform(0.01, 0.03))
    return _fault(
        "outside:warming", "time", channel, ("sensor-gain", "sensor-scale"), warming=gain, middle=middle, width=width
    )


def _quantised(random: Random, s: Setting) -> Change:
    channel = _on(random, s, FORCE, ACCELERATION, DEPTH, SPEED)
    return _fault("outside:coarse", "value", channel, quantum=s.spans[channel] * float(random.uniform(0.08, 0.2)))


def _hum(random: Random, s: Setting) -> Change:
    channel = _on(random, s, FORCE, ACCELERATION, DEPTH, SPEED)
    amplitude, phase = s.spans[channel] * log_uniform(random, 0.01, 0.15), float(random.uniform(0.0, 6.283))
    return _fault("outside:hum", "time", channel, hum=amplitude, frequency=50.0, phase=phase)


def _loose(random: Random, s: Setting) -> Change:
    channel = _on(random, s, FORCE, ACCELERATION)
    return _fault(
        "outside:loose-contact", "time", channel, dropouts=float(random.uniform(8.0, 30.0)),
        lasting=float(random.uniform(0.002, 0.006)),
    )  # fmt: skip


def _curved(random: Random, s: Setting) -> Change:
    channel = _on(random, s, FORCE, DEPTH)
    bend = log_uniform(random, 0.02, 0.25) * float(random.choice((-1.0, 1.0))) / s.peaks[channel]
    return _fault("outside:curved", "value", channel, BENT, curved=bend)


OUTSIDE: dict[str, Draw] = {
    "outside:ringing": _ringing,
    "outside:brake": _brake,
    "outside:memory": _memory,
    "outside:bands": _bands,
    "outside:stone": _stone,
    "outside:cubic": _cubic,
    "outside:edge": _edge,
    "outside:resonance": _resonance,
    "outside:side-load": _side_load,
    "outside:stiffness-by-impact-speed": _by_speed,
    "outside:warming": _warming,
    "outside:coarse": _quantised,
    "outside:hum": _hum,
    "outside:loose-contact": _loose,
    "outside:curved": _curved,
}
