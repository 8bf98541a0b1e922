"""Continuous or interrupted rolling of a narrow tractor with a front-mounted ROPS: the two-dimensional calculation.

EU 1322/2014 annex IX B4 (OECD Code 6) has a program for it, whose text is not at hand. Each step here says where it
comes from: `recalled` is the program's formula from memory, every one of them derived anew from planar mechanics in the
functions below; `derived` is mechanics in the place of formulae that are not remembered. It is no type approval.

The tractor stands across a slope of 1 : 1.5 and goes over sideways: about the line from its lower rear wheel to the
pivot of the front axle, on the axle's stop about its lower tyres, until it lies on their outer sides (position 1). The
upper edges of the tyres strike: it turns about their line (2) until the ROPS strikes (3), about the line from there to
a wheel (4) until the bonnet strikes, about the line from there to the ROPS (5). It rolls on if its centre of gravity
gets over the last of these lines.

Points are (x down the slope, y forward, z off the slope), m; a section across an axis is (x, z), turning from z to x.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray

from ground.quantity import Quantity, parameters

Array = NDArray[np.float64]
Section = tuple[float, float]
Basis = Literal["recalled", "derived"]
G = 9.8  # m/s2, as the program has it
PITCH_OVER_ROLL = 3.0  # I about the transverse axis over Q, as the program has it
# m: half the width of a ROPS tube with its bracket, which decides what of it lands first where it lands level with the
# centre of gravity
NEAR = 0.05


@parameters
class NarrowTractor:
    """What the calculation asks for, by the symbols of the regulation."""

    H1: Annotated[float, Quantity("m", "height of the centre of gravity", above=0)]
    L3: Annotated[float, Quantity("m", "from the centre of gravity back to the rear axle", above=0)]
    L2: Annotated[float, Quantity("m", "from the centre of gravity forward to the front axle", above=0)]
    D3: Annotated[float, Quantity("m", "diameter of the rear tyres", above=0)]
    D2: Annotated[float, Quantity("m", "diameter of the front tyres", above=0)]
    H6: Annotated[float, Quantity("m", "height of the ROPS where it strikes", above=0)]
    L6: Annotated[float, Quantity("m", "from the centre of gravity back to that point; negative if it is in front")]
    B6: Annotated[float, Quantity("m", "width of the ROPS there", above=0)]
    H7: Annotated[float, Quantity("m", "height of the bonnet", above=0)]
    B7: Annotated[float, Quantity("m", "width of the bonnet", above=0)]
    L7: Annotated[float, Quantity("m", "from the centre of gravity forward to the bonnet's front corner", above=0)]
    H0: Annotated[float, Quantity("m", "height of the front axle's pivot", above=0)]
    S: Annotated[float, Quantity("m", "rear track", above=0)]
    B0: Annotated[float, Quantity("m", "width of the rear tyres", above=0)]
    D0: Annotated[float, Quantity("rad", "swing of the front axle to its stop", least=0, below=1.5)]
    Mc: Annotated[float, Quantity("kg", "mass", above=0)]
    Q: Annotated[float, Quantity("kg m2", "moment of inertia about the longitudinal axis", above=0)]
    A0: Annotated[float, Quantity("rad", "slope, 1 : 1.5", above=0, below=1.5)] = 0.588
    U: Annotated[float, Quantity("1", "coefficient of restitution", least=0, most=1)] = 0.2
    T: Annotated[float, Quantity("m", "how far ROPS and ground give way", least=0)] = 0.2

    def validate(self) -> None:
        """Refuse shapes that the calculation does not cover: tyres must land first, then the ROPS."""
        for name in ("B6", "B7"):
            if getattr(self, name) > self.S + self.B0:
                raise ValueError(
                    f"{name}: wider than the rear tyres, got {getattr(self, name):g} m; at most S + B0 = "
                    f"{self.S + self.B0:g} m, or what lands first is not a tyre"
                )


@dataclass(frozen=True, kw_only=True)
class Step:
    """One number on the way, and where its formula comes from."""

    symbol: str
    what: str
    value: float
    unit: str
    basis: Basis


@dataclass(frozen=True, kw_only=True)
class Rolling:
    """The verdict, in a sentence too; which of three ways it went; every number on the way; positions for a picture.

    `positions` maps a position to its points by name, (3,) each, m: G, front, rear, rops, bonnet.
    """

    verdict: Literal["continuous", "interrupted"]
    sentence: str
    version: Literal["B1", "B2", "B3"]
    steps: tuple[Step, ...]
    positions: dict[int, dict[str, Array]]

    def __getitem__(self, symbol: str) -> float:
        """Value of a step by its symbol. Raises ``KeyError``."""
        for step in self.steps:
            if step.symbol == symbol:
                return step.value
        raise KeyError(symbol)


def after_impact(inertia: float, mass: float, old: Section, new: Section, restitution: float) -> float:
    """Angular velocity after an impact over that before it, as what turned about one point begins about another.

    `old` and `new` (m) are the centre of gravity as seen from each, `inertia` (kg m2) is about it. Angular momentum
    about the new point stays; that point comes in with the turning and goes out with `restitution` of its normal speed:

        (I + m r_n^2) w' = (I + m r_n . r_o + e m d_x r_nx) w,    d = r_o - r_n
    """
    moved = old[0] - new[0]
    kept = inertia + mass * (new[0] * old[0] + new[1] * old[1]) + restitution * mass * moved * new[0]
    return kept / (inertia + mass * (new[0] ** 2 + new[1] ** 2))


@dataclass(frozen=True, kw_only=True)
class Turn:
    """Turning about an axis in the slope: rate at its end (rad/s), None where it does not get there; energies, J.

    `needed` lifts the centre of gravity to its highest on the way, `available` is what turns.
    """

    rate: float | None
    needed: float
    available: float


def turn(inertia: float, mass: float, centre: Section, slope: float, rate: float, angle: float | None = None) -> Turn:
    """Turn from `rate` (rad/s) by `angle` (rad), or to the top if there is none, from `centre` of gravity (m).

    1/2 (I + m r^2) w^2 against m g (change of height). A rate that is not positive does not get anywhere.
    """
    r = math.hypot(*centre)
    tilt = math.atan2(centre[0], centre[1]) + slope  # from upright, positive beyond
    end = max(tilt, 0.0) if angle is None else tilt + angle
    top = 0.0 if tilt < 0.0 < end else min(abs(tilt), abs(end))
    about = inertia + mass * r * r
    available = 0.5 * about * max(rate, 0.0) ** 2
    needed = max(mass * G * r * (math.cos(top) - math.cos(tilt)), 0.0)
    if rate <= 0.0 or needed > available:
        return Turn(rate=None, needed=needed, available=available)
    left = available + mass * G * r * (math.cos(tilt) - math.cos(end))
    return Turn(rate=math.sqrt(2.0 * left / about), needed=needed, available=available)


def slope_across(slope: float, angle: float) -> float:
    """Slope (rad) across an axis that lies in the slope, turned by `angle` from its level line: sin a = sin A cos f."""
    return math.asin(math.sin(slope) * math.cos(angle))


def calculate(t: NarrowTractor) -> Rolling:
    """Whether it rolls on. Raises ``ValueError`` for a shape that the calculation does not cover."""
    return _Way(t).followed()


class _Way:
    """The calculation with what it has found so far."""

    def __init__(self, t: NarrowTractor) -> None:
        self.t = t
        self.steps: list[Step] = []
        self.positions: dict[int, dict[str, Array]] = {}

    def note(self, symbol: str, what: str, value: float, unit: str, basis: Basis) -> float:
        self.steps.append(Step(symbol=symbol, what=what, value=value, unit=unit, basis=basis))
        return value

    def followed(self) -> Rolling:
        lying = self.first_velocity()
        f2, o2 = self.tyres_strike(lying)
        points = self.positions[2]
        level = float(points["rops"][1])
        version: Literal["B1", "B2", "B3"] = "B2" if abs(level) <= NEAR else "B1" if level < 0.0 else "B3"
        self.note("y6", "ROPS ahead of the centre of gravity, along the tyres' line", level, "m", "derived")
        wheel = {"B1": "front", "B2": None, "B3": "rear"}[version]
        verdict, sentence = self.rops_strikes(f2, o2, wheel)
        return Rolling(
            verdict="continuous" if verdict else "interrupted",
            sentence=sentence,
            version=version,
            steps=tuple(self.steps),
            positions=self.positions,
        )

    def first_velocity(self) -> float:
        """Angular velocity as the tyres' outer sides land, from the highest point of the centre of gravity."""
        t = self.t
        if t.H0 / (t.L2 + t.L3) >= t.H1 / t.L3:
            raise ValueError(f"H0: the pivot's line passes above the centre of gravity, got {t.H0:g} m; a lower pivot")
        r2, c1 = math.hypot(t.H1, t.L3), math.atan(t.H1 / t.L3)
        l0, s1 = t.L2 + t.L3, 0.5 * t.S
        l9 = self.note("L9", "rise of the line from rear wheel to pivot", math.atan(t.H0 / l0), "rad", "recalled")
        h9 = self.note("H9", "centre of gravity above that line, side view", r2 * math.sin(c1 - l9), "m", "recalled")
        w1, w2 = r2 * math.cos(c1 - l9), math.hypot(t.H0, l0)
        f1 = self.note("F1", "angle of the tipping line against the middle", math.atan(s1 / w2), "rad", "recalled")
        w3 = self.note("W3", "from the tipping line to below the centre", (w2 - w1) * math.sin(f1), "m", "recalled")
        w4, far = math.atan2(h9, w3), math.hypot(h9, w3)
        w5 = self.note("W5", "height once the axle is on its stop", far * math.sin(w4 + t.D0), "m", "recalled")
        w6 = self.note("W6", "way towards the tipping line", w3 - far * math.cos(w4 + t.D0), "m", "recalled")
        w7 = w1 + w6 * math.sin(f1)
        w8 = math.atan2(w5, w7)
        w9 = math.sin(w8 + l9) * math.hypot(w5, w7)
        self.note("W9", "height above the ground then", w9, "m", "recalled")
        w0 = self.note("W0", "distance from the tyres' line", math.hypot(w9, s1 - w6 * math.cos(f1)), "m", "recalled")
        half = 0.5 * (t.S + t.B0)
        g1, g2 = math.hypot(half, t.H1), math.atan(2.0 * t.H1 / (t.S + t.B0))
        g3 = self.note("G3", "fall of the centre of gravity", w0 - g1 * math.cos(t.A0 + g2), "m", "recalled")
        if g3 <= 0.0:
            raise ValueError(f"H1: does not go over by itself, got {t.H1:g} m; a higher centre of gravity")
        about = t.Q + t.Mc * (0.5 * (w0 + g1)) ** 2
        o0 = math.sqrt(2.0 * t.Mc * G * g3 / about)
        return self.note("O0", "angular velocity as the tyres' sides land", o0, "rad/s", "recalled")

    def tyres_strike(self, o0: float) -> tuple[float, float]:
        """The upper edges of the tyres strike: angle of their line F2, and angular velocity about it."""
        t = self.t
        f2 = 2.0 * math.atan((t.D3 - t.D2) / (2.0 * (t.L2 + t.L3)))
        self.note("F2", "angle of the line of the tyres' upper edges", f2, "rad", "recalled")
        side = 0.5 * (t.S + t.B0)
        at = {
            "G": (t.H1, 0.0, side),
            "front": (0.5 * t.D2 * (1.0 + math.cos(f2)), t.L2 + 0.5 * t.D2 * math.sin(f2), 0.0),
            "rear": (0.5 * t.D3 * (1.0 + math.cos(f2)), 0.5 * t.D3 * math.sin(f2) - t.L3, 0.0),
            "rops": (t.H6, -t.L6, side - 0.5 * t.B6),
            "bonnet": (t.H7, t.L7, side - 0.5 * t.B7),
        }
        first = {name: np.array(p) for name, p in at.items()}
        k1 = self.note(
            "K1", "height of that line beside G", first["front"][0] + first["front"][1] * math.tan(f2), "m", "recalled"
        )
        k4 = k1 - t.H1
        self.positions[1] = first
        o1 = o0 * after_impact(t.Q, t.Mc, (t.H1, side), (-k4, side), t.U)
        self.note("O1", "angular velocity after the tyres' upper edges strike", o1, "rad/s", "recalled")
        along = k4 * math.sin(f2)  # so that y counts from the centre of gravity
        self.positions[2] = {name: _about(p, (k1, 0.0), f2) - (0.0, along, 0.0) for name, p in first.items()}
        return f2, self.note("O2", "of it, about their line", o1 * math.cos(f2), "rad/s", "recalled")

    def rops_strikes(self, f2: float, o2: float, wheel: str | None) -> tuple[bool, str]:
        """Turn about the tyres' line until the ROPS strikes, take the blow, and what comes of it."""
        t, at = self.t, self.positions[2]
        landing = {name: math.atan2(at[name][2], at[name][0]) for name in ("rops", "bonnet")}
        if at["rops"][0] <= 0.0 or (at["bonnet"][0] > 0.0 and landing["bonnet"] < landing["rops"]):
            raise ValueError(f"H6: the ROPS does not land before the bonnet, got {t.H6:g} m; a higher ROPS")
        c2 = self.note("C2", "turn until the ROPS strikes", landing["rops"], "rad", "recalled")
        a2 = self.note("A2", "slope across the tyres' line", slope_across(t.A0, f2), "rad", "recalled")
        q3 = self.note("Q3", "inertia about that direction", self.inertia(f2), "kg m2", "recalled")
        fall = self.turn("3", q3, at["G"], a2, o2, c2)
        if fall is None:
            return False, "it comes to rest on its tyres' sides, before the ROPS strikes"
        third = self.positions[3] = {name: _turned(p, c2) for name, p in at.items()}
        o3 = self.note("O3", "angular velocity as the ROPS strikes", fall, "rad/s", "recalled")
        v0, y6 = float(third["rops"][0]), float(third["rops"][1])
        share = 1.0 if wheel is None else float(third[wheel][1]) / (float(third[wheel][1]) - y6)
        e2 = self.note("E2", "from the tyres' line to the new axis, beside G", v0 * share, "m", "recalled")
        t3 = self.note("T3", "how far it has given way there", t.T * share, "m", "recalled")
        x, z = float(third["G"][0]), float(third["G"][2])
        o4 = o3 * after_impact(q3, t.Mc, (x, z), (x - e2, z + t3), t.U)
        self.note("O4", "angular velocity after the ROPS strikes", o4, "rad/s", "recalled")
        if wheel is None:
            over = self.turn("9", q3, third["G"] - np.array([v0, y6, 0.0]), a2, o4, None)
            return self.ends(over, "the ROPS")
        return self.over_the_side(f2, o4, wheel)

    def over_the_side(self, f2: float, o4: float, wheel: str) -> tuple[bool, str]:
        """Turn about the line from a wheel to the ROPS, over it or onto the bonnet, then about that line."""
        t, third = self.t, self.positions[3]
        side = third["rops"] - third[wheel]
        f3 = math.atan(-side[0] / side[1])
        self.note("F3", f"angle of the line from {wheel} wheel to ROPS", f3, "rad", "recalled")
        fourth = {name: _about(p, third[wheel][:2], f3) for name, p in third.items()}
        self.positions[4] = fourth
        o5 = self.note("O5", "of it, about that line", o4 * math.cos(f3), "rad/s", "recalled")
        a4 = self.note("A4", "slope across that line", slope_across(t.A0, f2 + f3), "rad", "recalled")
        q5 = self.note("Q5", "inertia about that direction", self.inertia(f2 + f3), "kg m2", "recalled")
        bonnet, centre = fourth["bonnet"], fourth["G"]
        c4 = math.atan2(bonnet[2], bonnet[0])
        top = -math.atan2(centre[0], centre[2]) - a4  # turn until the centre of gravity is over the line
        if bonnet[0] <= 0.0 or bonnet[2] < 0.0 or c4 >= top:
            over = self.turn("9", q5, centre, a4, o5, None)
            return self.ends(over, f"the line from {wheel} wheel to ROPS")
        self.note("C4", "turn until the bonnet strikes", c4, "rad", "derived")
        fall = self.turn("5", q5, centre, a4, o5, c4)
        if fall is None:
            return False, f"it comes to rest on {wheel} wheel and ROPS, before the bonnet strikes"
        o6 = self.note("O6", "angular velocity as the bonnet strikes", fall, "rad/s", "derived")
        fifth = {name: _turned(p, c4) for name, p in fourth.items()}
        self.positions[5] = fifth
        return self.bonnet_strikes(f2 + f3, q5, o6)

    def bonnet_strikes(self, turned: float, q5: float, o6: float) -> tuple[bool, str]:
        """The bonnet strikes: the new line goes from there to the ROPS; over it or not."""
        t, at = self.t, self.positions[5]
        rops, bonnet, centre = at["rops"], at["bonnet"], at["G"]
        way = bonnet - rops
        f5 = self.note("F5", "angle of the line from ROPS to bonnet", math.atan(-way[0] / way[1]), "rad", "derived")
        beside = float(rops[0] + (centre[1] - rops[1]) * way[0] / way[1])
        x, z = float(centre[0]), float(centre[2])
        o7 = o6 * after_impact(q5, t.Mc, (x, z), (x - beside, z), t.U) * math.cos(f5)
        self.note("O7", "after it, about that line", o7, "rad/s", "derived")
        a5 = self.note("A5", "slope across that line", slope_across(t.A0, turned + f5), "rad", "derived")
        sixth = _about(centre, (float(rops[0]), float(rops[1])), f5)
        over = self.turn("9", self.inertia(turned + f5), sixth, a5, o7, None)
        return self.ends(over, "the line from ROPS to bonnet")

    def inertia(self, turned: float) -> float:
        """Moment of inertia about an axis in the slope, turned from the tractor's length."""
        return self.t.Q * (math.cos(turned) ** 2 + PITCH_OVER_ROLL * math.sin(turned) ** 2)

    def turn(
        self, symbol: str, inertia: float, centre: Array, slope: float, rate: float, angle: float | None
    ) -> float | None:
        """A turn with its energies noted; None if it does not get there."""
        found = turn(inertia, self.t.Mc, (float(centre[0]), float(centre[2])), slope, rate, angle)
        to = "over the line" if angle is None else f"to position {symbol}"
        self.note(f"N{symbol}", f"energy needed {to}", found.needed, "J", "recalled")
        self.note(f"E{symbol}", f"energy of the turning, {to}", found.available, "J", "recalled")
        return found.rate

    def ends(self, rate: float | None, line: str) -> tuple[bool, str]:
        """The verdict, by whether the centre of gravity gets over the last line."""
        if rate is None:
            return False, f"its centre of gravity does not get over {line}"
        self.note("O9", "angular velocity over the line", rate, "rad/s", "recalled")
        return True, f"its centre of gravity goes over {line} at {rate:.2f} rad/s"


def _about(p: Array, origin: tuple[float, float] | Array, angle: float) -> Array:
    """A point (3,) in axes of the slope through `origin` (x, y), turned by `angle` so that the line lies along y."""
    x, y, (c, s) = p[0] - origin[0], p[1] - origin[1], (math.cos(angle), math.sin(angle))
    return np.array([x * c + y * s, y * c - x * s, p[2]])


def _turned(p: Array, angle: float) -> Array:
    """A point (3,) of a tractor that has turned about y by `angle`."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([p[0] * c + p[2] * s, p[1], p[2] * c - p[0] * s])
