"""The rig as it really was: every number of a drop that is known to the generator alone, and the soil's answer to it.

The soil's curve is written from the paper (Ye 2006, eqs 3-5) and from the definitions of the effects; nothing of the
simulator is used. x, z are positive down, SI.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

CLAY_MASS = 132.0  # kg in (5): the law belongs to the face, whatever strikes it
FACE = 0.140 * 0.045  # m2
RAMP = 2e-5  # m/s over which friction changes its sign where a stage does not say which way it is

Push = Callable[[float, float, float], float]  # (t, x, v) -> N, downward
Resist = Callable[[float, float, float, float], float]  # (t, z, v, F) -> F
Curve = Callable[[float, float, float], float]  # (t, z, v) -> N
Gather = Callable[[float], tuple[float, float]]  # z -> kg of soil that was gathered on the way there, kg/m


@dataclass(frozen=True, kw_only=True)
class Bristle:
    """Friction with a state, LuGre: s' = v - stiffness |v| s/g(v), F = stiffness s + damping s' + viscous v."""

    stiffness: float  # N/m
    damping: float  # N s/m
    viscous: float  # N s/m
    level: Callable[[float], float]  # g(v), N, at |v|

    def steady(self, v: float) -> float:
        """Deflection s (m) where v (m/s) has lasted."""
        return math.copysign(self.level(abs(v)) / self.stiffness, v)

    def force(self, v: float, deflection: float) -> tuple[float, float]:
        """Friction against v (N) and the rate of the deflection (m/s)."""
        rate = v - self.stiffness * abs(v) * deflection / self.level(abs(v))
        return self.stiffness * deflection + self.damping * rate + self.viscous * v, rate


@dataclass(frozen=True, kw_only=True)
class Rig:
    """One drop; the defaults are the paper's. Where a step in depth has a `width` (m) it is a smooth one."""

    speed: float = 3.0  # m/s at the first contact
    mass: float = 132.0
    gravity: float = 9.81
    fraction: float = 0.10  # m_b1 over the mass of the whole striker
    stiffness: float = 1.0
    damping: float = 0.0  # N (s/m)^exponent
    exponent: float = 1.0
    proportion: float = 0.0  # s/m, of the force itself that each m/s adds
    per_decade: float = 0.0
    power: float = 0.0  # of v over `slow`, in place of its logarithm
    slow: float = 0.01  # m/s
    drag: float = 0.0  # N (s/m)^drag_exponent
    drag_exponent: float = 2.0
    growth: float = 0.0  # kg/m
    recovery: float = 0.02  # K_u = K'(z_max)/recovery
    unloading_ratio: float = 1.0  # damping ratio of the unloading path
    pull: float = 0.0  # N on the face
    reach: float = 0.005  # m
    layer_depth: float = math.inf
    layer_ratio: float = 1.0
    layer_width: float = 0.0
    layer_spring: float = 0.0  # N/m, what the layer adds of its own from its top on
    layer_onset: float = 0.0  # of what the layer would add at its top, how much it leaves out from there on
    crust_depth: float = 0.0
    crust_ratio: float = 1.0
    crust_width: float = 0.0
    crust_remains: float = 0.0  # of what the crust adds at its end, how much stays below
    nose_share: float = 0.1
    spring: float = 0.0  # N/m between nose and body; 0: one rigid block
    dashpot: float = 0.0
    guide: float = 0.0  # N
    guide_creep: float = 0.0  # m/s: F tanh(v/this); 0: it holds what is at rest
    air: float = 0.0  # 1/2 rho C_d A, N s2/m2
    side_load: float = 0.0  # friction of the guide over the force that accelerates the striker
    relaxing: float = 0.0  # N/m, spring of a Maxwell branch of the soil
    relaxation: float = 1.0  # s, its time
    push: Push | None = None
    resist: Resist | None = None  # on the way down
    returning: Resist | None = None  # on the way back
    breaks: tuple[float, ...] = ()  # depths at which `resist` leaps or has a kink, m
    gather: Gather | None = None  # soil that joins in place of `growth`
    unloading: Callable[[float], float] | None = None  # share of the force at a share of the way back; 1 at 1, 0 at 0
    holding: Callable[[float], float] | None = None  # share of `pull` at a gap over `reach`; none: 1 - it
    joint: Callable[[float, float], float] | None = None  # (closing m, m/s) -> N between body and nose, for `spring`
    bristle: Bristle | None = None
    background: Callable[[float], float] | None = None  # t -> what the ground's force is off by, a share of it

    @property
    def nose(self) -> float:
        """Mass that meets the ground first, kg."""
        return self.mass * self.nose_share if self.spring > 0.0 else self.mass

    @property
    def grows(self) -> bool:
        """Whether soil joins on the way down."""
        return self.growth > 0.0 or self.gather is not None

    def steps(self) -> tuple[float, ...]:
        """Depths at which the curve jumps, m."""
        found = []
        if self.layer_ratio != 1.0 and self.layer_width == 0.0:
            found.append(self.layer_depth)
        if self.crust_ratio != 1.0 and self.crust_width == 0.0 and self.crust_remains < 1.0:
            found.append(self.crust_depth)
        return (*found, *self.breaks)


def branches(touch_speed: float) -> tuple[float, float, float]:
    """K_b1 (N/m), the factor of z^0.264 in K_b2 z, and the depth (m) where both are equal."""
    first = 75_000.0 + 4.9e-6 * touch_speed**18.71  # (4)
    # (5): 1e3 * 1300 * (1e3 z)^-0.736 * 0.89^(m_s v_s/100) * z
    factor = 1.3e6 * 1e3**-0.736 * 0.89 ** (CLAY_MASS * touch_speed / 100.0)
    return first, factor, (factor / first) ** (1.0 / 0.736)


def _below(z: float, depth: float, width: float) -> float:
    """0 above a depth and 1 below it, m."""
    if width > 0.0:
        return 0.5 * (1.0 + math.tanh((z - depth) / width))
    return 1.0 if z > depth else 0.0


def loading_curve(rig: Rig, touch_speed: float) -> Curve:
    """F(t, z, v) of the ground while it is pushed deeper, after a touch with `touch_speed`; never a pull."""
    first, factor, change = branches(touch_speed)

    def curve(t: float, z: float, v: float) -> float:
        z = max(z, 0.0)
        force = rig.stiffness * (first * z if z <= change else factor * z**0.264)  # (3): F = K' z
        if rig.crust_ratio != 1.0:
            stays = rig.crust_remains * rig.crust_depth / max(z, rig.crust_depth)
            lost = (1.0 - stays) * _below(z, rig.crust_depth, rig.crust_width)
            force *= rig.crust_ratio + (1.0 - rig.crust_ratio) * lost
        if rig.layer_ratio != 1.0:
            spared = rig.layer_onset * rig.layer_depth / max(z, rig.layer_depth)
            force *= 1.0 + (rig.layer_ratio - 1.0) * (1.0 - spared) * _below(z, rig.layer_depth, rig.layer_width)
        force += rig.layer_spring * max(z - rig.layer_depth, 0.0) if rig.layer_spring != 0.0 else 0.0
        if v > 0.0:
            force *= (max(v, rig.slow) / rig.slow) ** rig.power * (1.0 + rig.proportion * v)
            if rig.per_decade != 0.0 and v > rig.slow:
                force *= 1.0 + rig.per_decade * math.log10(v / rig.slow)
            if rig.damping != 0.0:
                force += rig.damping * v**rig.exponent
            if rig.drag != 0.0:
                force += rig.drag * v**rig.drag_exponent
        if rig.resist is not None:
            force = rig.resist(t, z, v, force)
        return max(force, 0.0)

    return curve
