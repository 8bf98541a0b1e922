"""The drop solved on its own: momenta instead of velocities, an eighth-order integrator between events.

State: x and P of the nose with the soil that moves along, x and v of the body, the force of a Maxwell branch.

    dP/dt = sum of forces on nose and soil,   v = P/(m + m_b1(x)),   F_s = F + d(m_b1 v)/dt        (1) without impulse

A stage ends at an event (the deepest point, a change of branch, a step in depth, lift-off, a new touch) and the next
starts there, so that no step lies across a kink. Whether soil stays behind is asked within the steps too: a nose that
rings pulls at it for less than a step. A guide that does not creep rubs one way throughout a stage, or holds.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rollover.proof.line import Line, line_back, met_again
from rollover.proof.rig import RAMP, Curve, Rig, branches, loading_curve

Array = NDArray[np.float64]
CHANNELS = (
    "ground/force_normal",
    "ground/sinkage",
    "striker/position_z",
    "striker/velocity_z",
    "striker/acceleration_z",
)
FREE, LOADING, LINE = "free", "loading", "line"
HELD = 0.0  # the way of a guide (1: the striker slides down on it) that lets nothing slide
RTOL, ATOL = 1e-9, 1e-11
MOST_STAGES = 4000
WITHIN = 12  # places of a step at which it is asked whether the soil would have to be pulled
PAST_EVENT = 1e-11  # m: past an event, so that it does not answer again
BREAKS = 1.0 + 1e-6  # times its friction a guide holds what has come to rest; by as much more it lets go


class DescentError(RuntimeError):
    """The drop came to no end."""


@dataclass(frozen=True, kw_only=True)
class Stage:
    """From `start` to `end` (s) under one set of equations; `soil` is m_b1 at `origin`, kg, and grows by `growth`.

    Where it `gathers` it grows as the rig's own law says. `way` is that of the guide's friction, None where it goes by
    the speed.
    """

    rig: Rig
    mode: str
    start: float
    end: float
    soil: float
    growth: float
    origin: float
    curve: Curve | None
    line: Line | None
    way: float | None = None
    gathers: bool = False
    state: Callable[[ArrayLike], Array]

    def moving(self, x: float) -> float:
        """m_b1 at depth x, kg."""
        if self.gathers and self.rig.gather is not None:
            return self.soil + max(self.rig.gather(x)[0] - self.rig.gather(self.origin)[0], 0.0)
        return self.soil + self.growth * max(x - self.origin, 0.0)

    def grows(self, x: float) -> float:
        """dm_b1/dx at depth x, kg/m."""
        return self.rig.gather(x)[1] if self.gathers and self.rig.gather is not None else self.growth

    def ground(self, t: float, x: float, v: float, memory: float) -> float:
        """What the soil's spring presses with, N."""
        rig = self.rig
        if self.mode == FREE:
            return 0.0
        if self.mode == LOADING:
            assert self.curve is not None
            force = self.curve(t, x, v)
        else:
            assert self.line is not None
            force = self.line.presses(rig, x, v)
        if rig.background is not None and force > 0.0:
            force *= 1.0 + rig.background(t)
        return max(force + memory, 0.0) if memory else force

    def rates(self, t: float, y: Array) -> list[float]:
        """Derivative of the state."""
        return self.motion(t, *y.tolist())[0]

    def pulled(self, t: float, x: float, memory: float) -> float:
        """What pulls a rigid striker downward that its guide holds at x, N."""
        pushed = self.rig.push(t, x, 0.0) if self.rig.push is not None else 0.0
        return self.rig.nose * self.rig.gravity + pushed - self.ground(t, x, 0.0, memory)

    def motion(self, t: float, x: float, p: float, xb: float, vb: float, memory: float) -> tuple[list[float], Any]:
        """Derivative of the state, and what instruments see: v, a of nose and body, N on the soil without impulse."""
        rig = self.rig
        total = rig.nose + self.moving(x)
        v = p / total
        bristle = rig.bristle
        force = self.ground(t, x, v, memory if bristle is None else 0.0)
        share = rig.nose / rig.mass
        outer = rig.nose * rig.gravity - share * _resistance(rig, v, self.way)
        if rig.push is not None:
            outer += rig.push(t, x, v)
        ab = fading = 0.0
        if bristle is not None:
            rubs, fading = bristle.force(v, memory)
            outer -= rubs
        if self.way == HELD:
            return [0.0, 0.0, 0.0, 0.0, -memory / rig.relaxation], (0.0, 0.0, x, 0.0, 0.0, force)
        if rig.spring > 0.0:
            between = rig.spring * (xb - x) + rig.dashpot * (vb - v)
            if rig.joint is not None:
                between = rig.joint(xb - x, vb - v)
            outer += between
            ab = rig.gravity - _resistance(rig, vb, None) / rig.mass - between / (rig.mass - rig.nose)
        thrown = self.grows(x) * v * v if self.mode == LOADING and v > 0.0 else 0.0
        a = (outer - force - thrown) / total
        if rig.side_load:
            # friction side_load m |a| against the motion, solved for a
            turned = rig.side_load * rig.nose * _sign(v) * math.copysign(1.0, a)
            a *= total / (total + turned)
        if rig.spring <= 0.0:
            ab, vb = a, v
        if rig.relaxing:
            fading = rig.relaxing * v - memory / rig.relaxation if self.mode != FREE else -memory / rig.relaxation
        seen = (v, a, xb if rig.spring > 0.0 else x, vb, ab, force + thrown + self.moving(x) * a)
        return [v, total * a + thrown, vb, ab, fading], seen


@dataclass(frozen=True, kw_only=True)
class Descent:
    """A drop from `start` to `end` (s), first contact at 0."""

    rig: Rig
    stages: tuple[Stage, ...]
    impulse: float  # N s, of all exchanges of momentum with the soil
    lost: float  # J, in them

    def channels(self, times: ArrayLike) -> dict[str, Array]:
        """Values of `CHANNELS` at times (n,), s, in any order, (n,) each; z up for the striker. No impulse in them."""
        t = np.asarray(times, dtype=np.float64)
        out = np.empty((len(CHANNELS), t.size))
        which = np.searchsorted([s.end for s in self.stages[:-1]], t, side="right")
        for k, stage in enumerate(self.stages):
            here = np.flatnonzero(which == k)
            if here.size == 0:
                continue
            states = np.reshape(stage.state(t[here]), (5, here.size)).T.tolist()
            rows = [(y[0], *stage.motion(at, *y)[1]) for at, y in zip(t[here].tolist(), states, strict=True)]
            x, _, _, xb, vb, ab, cell = np.array(rows).T
            touching = stage.mode != FREE
            out[0, here] = cell if touching else 0.0
            out[1, here] = x if touching else 0.0
            out[2, here], out[3, here], out[4, here] = -xb, -vb, -ab
        return dict(zip(CHANNELS, out, strict=True))

    def deepest(self) -> tuple[float, float]:
        """Time (s) and depth (m) of the deepest point of the nose."""
        ends = [(float(s.state(s.end)[0]), s.end) for s in self.stages if s.mode == LOADING]
        depth, at = max(ends)
        return at, depth

    def phases(self) -> list[tuple[float, str]]:
        """Start (s) and name of each phase: free-fall, loading, unloading, rest."""
        at = self.deepest()[0]
        return [(self.stages[0].start, "free-fall"), (0.0, "loading"), (at, "unloading")]


def _sign(v: float) -> float:
    return min(max(v / RAMP, -1.0), 1.0)


def _resistance(rig: Rig, v: float, way: float | None) -> float:
    if way is None:
        way = math.tanh(v / rig.guide_creep) if rig.guide_creep > 0.0 else _sign(v)
    return rig.guide * way + rig.air * v * abs(v)


def descend(rig: Rig, start: float, end: float) -> Descent:
    """Solve one drop from `start` (s, not after first contact) to `end`. Raises `DescentError`."""
    start = min(start, -1e-6)
    stages = [_approach(rig, start)]
    t, x, v = 0.0, 0.0, rig.speed
    xb, vb, memory = 0.0, rig.speed, 0.0 if rig.bristle is None else rig.bristle.steady(rig.speed)
    line: Line | None = None
    growing = rig.grows
    impulse = lost = 0.0
    mode, soil, origin = FREE, 0.0, 0.0
    curve: Curve | None = None
    touching = True
    while t < end:
        if len(stages) > MOST_STAGES:
            raise DescentError(f"no end after {MOST_STAGES} stages, at {t:.6g} s")
        if touching:  # restitution 0: nose and soil go on together
            curve, soil, growing = loading_curve(rig, v), rig.fraction * rig.mass, rig.grows
            shared = v * rig.nose / (rig.nose + soil)
            impulse += rig.nose * (v - shared)
            lost += 0.5 * v * shared * soil  # (8) with k_s = 0
            v, touching = shared, False
            vb = v if rig.spring <= 0.0 else vb
            origin, mode = x, LOADING
            if line is not None:
                line = met_again(line, curve, t)
                mode, x = LINE, max(x, line.rut)
        growth = rig.growth if growing and mode == LOADING else 0.0
        gathers = growing and mode == LOADING and rig.gather is not None
        at = (x, v, xb, vb, memory)
        stage, happened = _stage(rig, mode, t, end, at, soil, growth, origin, curve, line, gathers)
        stages.append(stage)
        y = stage.state(stage.end).tolist()
        t, x, xb, vb, memory = stage.end, y[0], y[2], y[3], y[4]
        v = y[1] / (rig.nose + stage.moving(x))
        soil, origin = stage.moving(x), max(x, origin)
        if happened == "deepest":
            assert curve is not None
            line = line_back(rig, curve, t, x, 0.0)
            critical = 2.0 * math.sqrt(line.stiffness * (rig.mass + soil))
            line = line_back(rig, curve, t, x, rig.unloading_ratio * critical)
            mode, x, v = LINE, x - PAST_EVENT, 0.0
        elif happened == "deeper":
            mode, x, origin = LOADING, x + PAST_EVENT, x
        elif happened == "step":
            x += PAST_EVENT
        elif happened == "turned":
            v = 0.0
        elif happened == "lift-off":
            mode, soil, growing = FREE, 0.0, False
            x -= PAST_EVENT
        elif happened == "soil stays":
            soil, growing = 0.0, False
        elif happened == "touch":
            touching = True
        if rig.spring <= 0.0:
            xb, vb = x, v
    return Descent(rig=rig, stages=tuple(stages), impulse=impulse, lost=lost)


def _approach(rig: Rig, start: float) -> Stage:
    """Free fall, solved backwards from the first contact, as one block: a dashpot run backwards explodes."""
    from scipy.integrate import solve_ivp

    rig = replace(rig, spring=0.0)
    if (bristle := rig.bristle) is not None:  # a state run backwards explodes as well: it has settled there
        rig = replace(rig, bristle=None, push=lambda t, x, v: -bristle.force(v, bristle.steady(v))[0])
    common: dict[str, Any] = {
        "rig": rig, "mode": FREE, "start": start, "end": 0.0, "soil": 0.0, "growth": 0.0, "origin": 0.0,
        "curve": None, "line": None,
    }  # fmt: skip
    bare = Stage(**common, state=lambda t: np.zeros(5))
    first = [0.0, rig.nose * rig.speed, 0.0, rig.speed, 0.0]
    solved = solve_ivp(bare.rates, (0.0, start), first, method="DOP853", rtol=RTOL, atol=ATOL, dense_output=True)
    return Stage(**common, state=solved.sol)


def _stage(
    rig: Rig,
    mode: str,
    t: float,
    end: float,
    at: tuple[float, float, float, float, float],
    soil: float,
    growth: float,
    origin: float,
    curve: Curve | None,
    line: Line | None,
    gathers: bool,
) -> tuple[Stage, str]:
    """Integrate to the next event and say which it was."""
    from scipy.integrate import solve_ivp

    common: dict[str, Any] = {
        "rig": rig, "mode": mode, "start": t, "soil": soil, "growth": growth, "origin": origin, "curve": curve,
        "line": line, "gathers": gathers,
    }  # fmt: skip
    bare = Stage(**common, end=end, state=lambda t: np.zeros(5))
    x, v, xb, vb, memory = at
    if rig.guide > 0.0 and rig.guide_creep == 0.0 and rig.spring <= 0.0:
        common["way"] = _way(bare, t, x, v, memory)
        bare = replace(bare, way=common["way"])
    state = [x, v * (rig.nose + bare.moving(x)), xb, vb, memory]
    names: list[str] = []
    events: list[Any] = []

    def watch(name: str, value: Callable[[float, Array], float], direction: float) -> None:
        value.terminal, value.direction = True, direction  # type: ignore[attr-defined]
        names.append(name)
        events.append(value)

    if mode == LOADING:
        watch("deepest", lambda t, y: y[1], -1.0)
        for depth in (branches(rig.speed)[2], *rig.steps()):
            if depth > x:
                watch("step", lambda t, y, depth=depth: y[0] - depth, 1.0)  # type: ignore[misc]
    elif mode == LINE:
        assert line is not None
        leaves = max(line.rut - (rig.reach if rig.pull > 0.0 else 0.0), 0.0)
        watch("deeper", lambda t, y: y[0] - line.depth, 1.0)
        watch("lift-off", lambda t, y: y[0] - leaves, -1.0)
    else:
        depth = line.rut if line is not None else 0.0
        watch("touch", lambda t, y: y[0] - depth, 1.0)
    if bare.way == HELD:
        watch("turned", lambda t, y: abs(bare.pulled(t, y[0], y[4])) - BREAKS**2 * rig.guide, 1.0)
    elif bare.way is not None and mode != LOADING:  # at the deepest point it turns by itself
        watch("turned", lambda t, y: y[1], -bare.way)
    clinging: Callable[[float, Array], float] | None = None
    if mode != FREE and soil > 0.0 and rig.spring > 0.0:

        def held(t: float, y: Array) -> float:
            return float(bare.motion(t, *np.asarray(y).tolist())[1][5]) + rig.pull

        if held(t, np.array(state)) < 0.0:  # the soil cannot be pulled along: it stays
            common["soil"], common["growth"], common["gathers"] = 0.0, 0.0, False
            bare = Stage(**common, end=end, state=bare.state)
            state[1] = v * rig.nose
        else:
            clinging = held
            watch("soil stays", held, -1.0)
    solved = solve_ivp(
        bare.rates, (t, end), state, method="DOP853", rtol=RTOL, atol=ATOL, dense_output=True, events=events,
        max_step=0.02,
    )  # fmt: skip
    if solved.status < 0:
        raise DescentError(f"at {t:.6g} s: {solved.message}")
    if clinging is not None and (let_go := _dips(clinging, solved)) is not None:
        return Stage(**common, end=let_go, state=solved.sol), "soil stays"
    stage = Stage(**common, end=float(solved.t[-1]), state=solved.sol)
    happened = next((n for n, found in zip(names, solved.t_events, strict=True) if found.size), "end")
    return stage, happened


def _way(bare: Stage, t: float, x: float, v: float, memory: float) -> float:
    """Which way what moves with v on its guide slides from now on; from rest it goes where more pulls than holds."""
    if v != 0.0:
        return math.copysign(1.0, v)
    pulled = bare.pulled(t, x, memory)
    return math.copysign(1.0, pulled) if abs(pulled) > BREAKS * bare.rig.guide else HELD


def _dips(value: Callable[[float, Array], float], solved: Any) -> float | None:
    """When a value first falls below zero within a step, s: it may have risen again before the step was over."""
    from scipy.optimize import brentq

    def at(t: float) -> float:
        return value(t, solved.sol(t))

    for a, b in itertools.pairwise(solved.t.tolist()):
        fine = np.linspace(a, b, WITHIN)
        below = np.flatnonzero([at(t) < 0.0 for t in fine[:-1]])
        if below.size and below[0] > 0:
            return float(brentq(at, fine[below[0] - 1], fine[below[0]], xtol=1e-12))
    return None
