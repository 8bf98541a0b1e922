"""Frames of a few members, pushed: what tests of a frame share."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rollover.dynamics.frame.equilibrium import Frame, Support
from rollover.dynamics.frame.mesh import mesh
from rollover.dynamics.frame.push import Point, at_rest, push
from rollover.spec.beam import Beam
from rollover.spec.connector import Connector
from rollover.spec.sections import Section
from rollover.spec.steel import Steel

TUBE = Section(tube=(60.0, 60.0, 4.0))
# ten times as stiff as steel: a mechanism is there before the frame has moved far enough for its lean to count
STIFF = Steel(name="stiff", yield_strength=355e6, tensile_strength=355e6, uniform_strain=0.2, youngs_modulus=2.1e12)
MILD = Steel(name="mild", yield_strength=235e6, tensile_strength=360e6, uniform_strain=0.2)
Place = tuple[float, float, float]


@dataclass(frozen=True)
class Way:
    """A goal that is never met: the curve goes on to its end."""

    size: float = 1.0

    def missing(self, _: Point) -> float:
        return math.inf

    def reached(self, _: list[Point]) -> bool:
        return False


def bar(name: str, start: Place, end: Place, section: Section = TUBE, steel: Steel = STIFF) -> Beam:
    return Beam(name=name, start=start, end=end, section=section, material=steel)


def portal(high: float, wide: float, section: Section = TUBE, steel: Steel = STIFF) -> tuple[Beam, ...]:
    """Two posts on the ground, y = +-wide/2, and the beam across them."""
    y = 0.5 * wide
    return (
        bar("left", (0.0, y, 0.0), (0.0, y, high), section, steel),
        bar("right", (0.0, -y, 0.0), (0.0, -y, high), section, steel),
        bar("across", (0.0, y, high), (0.0, -y, high), section, steel),
    )


def pushed(
    beams: Sequence[Beam],
    loads: Mapping[Place, tuple[float, float, float]],
    *,
    feet: Sequence[Place],
    most: float,
    step: float = 0.002,
    segments: int = 24,
    mount: Connector | None = None,
    speed: float = 0.0,
) -> tuple[Frame, np.ndarray, list[Point]]:
    """A frame pushed at places by forces in one proportion; its load is the factor on them, its way their work's."""
    points = {f"load{k}": p for k, p in enumerate(loads)} | {f"foot{k}": p for k, p in enumerate(feet)}
    meshed = mesh(beams, points, segments)
    frame = Frame(
        meshed, [Support(name=f"foot{k}", node=meshed.at[f"foot{k}"], connector=mount) for k in range(len(feet))]
    )
    c = sum(frame.pattern({meshed.at[f"load{k}"]: 1.0}, way) for k, way in enumerate(loads.values()))
    curve, _ = push(frame, at_rest(frame), c, step=step, most=most, goal=Way(), speed=speed)
    return frame, np.asarray(c), curve
