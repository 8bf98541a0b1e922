"""The drop rig in the picture: the striker with its mass, and the guide that it falls in. Arrays only."""

from __future__ import annotations

import math

import numpy as np

from rollover.dynamics.result import Run
from rollover.spec.shapes import Point
from rollover.spec.vehicle import Striker
from viz.recordings.solids import AROUND, DARK_STEEL, FRAME, STEEL, Block, Hull, Part, Rod, body_path

STEEL_DENSITY = 7850.0  # kg/m3, for the size of a block of which only the mass is known


def rig(run: Run, striker: Striker) -> tuple[Part, ...]:
    """The striker and its guide; the striker's origin lies in the middle of its face.

    Above the face a nose long enough to be seen from the deepest rut, above it a steel cube with the mass, beside
    it two upright bars from the ground to above the cube's highest place, and a crossbar.
    """
    a, b = striker.face_length, striker.face_width
    side = (striker.mass / STEEL_DENSITY) ** (1.0 / 3.0)
    path = body_path("striker")
    origin = run.motion["striker"].origin if "striker" in run.motion else np.zeros((0, 3))
    x, y, _ = origin[0] if len(origin) else np.zeros(3)
    highest, lowest = float(origin[:, 2].max(initial=0.0)), float(origin[:, 2].min(initial=0.0))
    nose = 0.8 * side - lowest
    top = highest + nose + 1.15 * side
    apart = 0.5 * side + 0.025

    def bar(name: str, start: Point, end: Point) -> Rod:
        return Rod(path=f"world/guide/{name}", start=start, end=end, radius=0.01, colour=DARK_STEEL)

    point: Part = Block(
        # the ground's force acts inside its outline
        path=f"{path}/nose",
        centre=(0.0, 0.0, 0.5 * nose),
        size=(a, b, nose),
        colour=STEEL,
        see_through=True,
    )
    shaft: tuple[Part, ...] = ()
    if striker.nose == "cone":
        point = _cone(striker.nose_radius, striker.nose_height, f"{path}/nose")
        start, end = (0.0, 0.0, striker.nose_height), (0.0, 0.0, nose)
        shaft = (Rod(path=f"{path}/shaft", start=start, end=end, radius=striker.nose_radius, colour=STEEL),)
    mass = Block(path=f"{path}/mass", centre=(0.0, 0.0, nose + 0.5 * side), size=(side, side, side), colour=FRAME)
    if run.scenario.initiation.kind == "release":  # what is let go falls freely
        return (point, *shaft, mass)
    return (
        point,
        *shaft,
        mass,
        bar("front", (x + apart, y, 0.0), (x + apart, y, top)),
        bar("rear", (x - apart, y, 0.0), (x - apart, y, top)),
        bar("cross", (x + apart, y, top), (x - apart, y, top)),
    )


def _cone(radius: float, height: float, path: str) -> Hull:
    """A cone that stands on its tip at the origin."""
    angle = 2.0 * math.pi * np.arange(AROUND + 1) / AROUND
    rim = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(angle.size, height)], axis=1)
    outward = np.stack([height * np.cos(angle), height * np.sin(angle), np.full(angle.size, -radius)], axis=1)
    outward /= math.hypot(radius, height)
    vertices = np.stack([np.zeros_like(rim[1:]), rim[1:], rim[:-1]], axis=1).reshape(-1, 3)
    return Hull(
        path=path,
        vertices=vertices,
        normals=np.repeat(outward[1:], 3, axis=0),
        colours=np.full(len(vertices), STEEL, dtype=np.uint32),
        triangles=np.arange(len(vertices)).reshape(-1, 3),
    )
