"""Shapes whose surface can touch the ground, and the points that stand for it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray

from ground.kinds import ByKind
from ground.quantity import Label, Quantity, parameters

Point = tuple[float, float, float]
SHAPES = 256  # kept with their points: a study runs one vehicle again and again


@parameters
class Box:
    """A block with faces along the vehicle axes."""

    kind: Literal["box"] = "box"
    name: Annotated[str, Label()]
    low: Annotated[Point, Quantity("m", "corner with the smallest x, y, z")]
    high: Annotated[Point, Quantity("m", "corner with the largest x, y, z")]

    def validate(self) -> None:
        """Refuse a box turned inside out."""
        if any(a >= b for a, b in zip(self.low, self.high, strict=True)):
            got = f"got {list(self.high)} against {list(self.low)}"
            raise ValueError(f"high: must lie beyond low on every axis, {got}; larger x, y and z than those are needed")


@parameters
class Tube:
    """A round tube between two points, closed at its ends."""

    kind: Literal["tube"] = "tube"
    name: Annotated[str, Label()]
    start: Annotated[Point, Quantity("m")]
    end: Annotated[Point, Quantity("m")]
    diameter: Annotated[float, Quantity("m", above=0)]

    def validate(self) -> None:
        """Refuse a tube without length."""
        if self.start == self.end:
            raise ValueError(f"end: same as start, got {list(self.end)}; another point")


@parameters
class Disc:
    """One side of a flat round plate, such as a tyre's side wall; the normal says which side."""

    kind: Literal["disc"] = "disc"
    name: Annotated[str, Label()]
    centre: Annotated[Point, Quantity("m")]
    normal: Annotated[Point, Quantity("1", "outward")]
    radius: Annotated[float, Quantity("m", above=0)]


@parameters
class Points:
    """Single points, such as the corners of a body on hard ground; each stands for an area whichever way it faces."""

    kind: Literal["points"] = "points"
    name: Annotated[str, Label()]
    at: Annotated[tuple[Point, ...], Quantity("m", "the points, vehicle axes")]
    area: Annotated[float, Quantity("m2", "that each point stands for", above=0)]

    def validate(self) -> None:
        """Refuse an empty list."""
        if not self.at:
            raise ValueError("at: got no point; at least one")


Shape = Annotated[Box | Tube | Disc | Points, ByKind()]


@dataclass(frozen=True, kw_only=True)
class SurfacePoints:
    """Points on a surface with outward normals and the area each stands for: (n, 3), (n, 3), (n,)."""

    position: NDArray[np.float64]
    normal: NDArray[np.float64]
    area: NDArray[np.float64]

    @cached_property
    def is_flat(self) -> bool:
        """Whether all normals are the same: the whole patch faces the ground or none of it."""
        return bool(np.all(self.normal == self.normal[0]))

    @cached_property
    def corners(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Least and largest coordinates, (3,) each."""
        return self.position.min(axis=0), self.position.max(axis=0)

    def at(self, chosen: Any) -> SurfacePoints:
        """Some of the points, by an index or a mask (n,)."""
        return SurfacePoints(position=self.position[chosen], normal=self.normal[chosen], area=self.area[chosen])

    def pieces(self, size: float) -> tuple[SurfacePoints, ...]:
        """The points by cubes of `size` (m) along the axes."""
        cube = np.floor((self.position - self.position.min(axis=0)) / size)
        _, piece = np.unique(cube, axis=0, return_inverse=True)
        return tuple(self.at(piece.ravel() == k) for k in range(piece.max() + 1))


@lru_cache(maxsize=SHAPES)
def sample(shape: Shape, spacing: float) -> tuple[SurfacePoints, ...]:
    """Patches of points no further apart than `spacing` (m) on a shape, its edges and corners among them.

    Weights are those of the trapezoidal rule, so that areas add up to the surface's; edges are drawn in by
    1e-9 of the size, so that a face as large as a ground element stays inside it.
    """
    if isinstance(shape, Box):
        return _sample_box(np.array(shape.low), np.array(shape.high), spacing)
    if isinstance(shape, Tube):
        return _sample_tube(np.array(shape.start), np.array(shape.end), 0.5 * shape.diameter, spacing)
    if isinstance(shape, Points):
        place = np.array(shape.at)
        return (SurfacePoints(position=place, normal=np.zeros_like(place), area=np.full(len(place), shape.area)),)
    return (_sample_disc(np.array(shape.centre), np.array(shape.normal, dtype=float), shape.radius, spacing),)


def cone(tip: NDArray[np.float64], radius: float, height: float, spacing: float) -> SurfacePoints:
    """Points on a cone that stands on `tip`; their areas, projected along z, add up to that of its base."""
    rings = max(2, math.ceil(math.hypot(radius, height) / spacing))
    slope = math.hypot(radius, height)
    position, normal, area = (
        [tip[None]],
        [np.array([[0.0, 0.0, -1.0]])],
        [np.array([math.pi * (0.5 * radius / rings) ** 2])],
    )
    for i in range(1, rings + 1):
        # ring i stands for the surface up to half a ring on either side; the last one only inwards
        inner, outer = (i - 0.5) * radius / rings, min(i + 0.5, rings) * radius / rings
        r = radius * i / rings
        count = max(6, math.ceil(2.0 * math.pi * r / spacing))
        angle = 2.0 * math.pi * (np.arange(count) + 0.5 * (i % 2)) / count
        around = np.stack([np.cos(angle), np.sin(angle), np.zeros(count)], axis=1)
        position.append(tip + r * around + np.array([0.0, 0.0, height * i / rings]))
        normal.append((height * around - np.array([0.0, 0.0, radius])) / slope)
        # projected along z, a ring's surface is smaller by radius/slope
        area.append(np.full(count, math.pi * (outer**2 - inner**2) / count * slope / radius))
    return SurfacePoints(position=np.concatenate(position), normal=np.concatenate(normal), area=np.concatenate(area))


def rectangle(
    centre: NDArray[np.float64], u: NDArray[np.float64], v: NDArray[np.float64], spacing: float
) -> SurfacePoints:
    """Points on the rectangle centre + a u + b v, |a|, |b| <= 1, with normal along u x v."""
    a, wa = _nodes(2.0 * float(np.linalg.norm(u)), spacing)
    b, wb = _nodes(2.0 * float(np.linalg.norm(v)), spacing)
    position = centre + a[:, None, None] * u + b[None, :, None] * v
    n = np.cross(u, v)
    area = 4.0 * float(np.linalg.norm(n)) * wa[:, None] * wb[None, :]
    count = a.size * b.size
    return SurfacePoints(
        position=position.reshape(count, 3), normal=np.tile(n / np.linalg.norm(n), (count, 1)), area=area.reshape(count)
    )


def _nodes(length: float, spacing: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    count = max(1, math.ceil(length / spacing - 1e-9))
    x = np.linspace(-1.0, 1.0, count + 1) * (1.0 - 1e-9)
    w = np.full(count + 1, 1.0 / count)
    w[[0, -1]] *= 0.5
    return x, w


def _sample_box(low: NDArray[np.float64], high: NDArray[np.float64], spacing: float) -> tuple[SurfacePoints, ...]:
    centre, half = 0.5 * (low + high), 0.5 * (high - low)
    parts = []
    for axis in range(3):
        for side in (-1.0, 1.0):
            outward = np.zeros(3)
            outward[axis] = side * half[axis]
            u, v = np.zeros(3), np.zeros(3)
            u[(axis + 1) % 3] = half[(axis + 1) % 3]
            v[(axis + 2) % 3] = side * half[(axis + 2) % 3]
            parts.append(rectangle(centre + outward, u, v, spacing))
    return tuple(parts)


def _sample_tube(
    start: NDArray[np.float64], end: NDArray[np.float64], radius: float, spacing: float
) -> tuple[SurfacePoints, ...]:
    axis = end - start
    length = float(np.linalg.norm(axis))
    e, u, v = axes_along(axis)
    x, w = _nodes(length, spacing)
    around = max(8, math.ceil(2.0 * math.pi * radius / spacing))
    angle = 2.0 * math.pi * np.arange(around) / around
    normal = np.cos(angle)[:, None] * u + np.sin(angle)[:, None] * v
    position = 0.5 * (start + end) + 0.5 * length * x[:, None, None] * e + radius * normal[None]
    area = 2.0 * math.pi * radius * length * w[:, None] * np.full(around, 1.0 / around)[None]
    wall = SurfacePoints(position=position.reshape(-1, 3), normal=np.tile(normal, (x.size, 1)), area=area.reshape(-1))
    return wall, _sample_disc(start, -e, radius, spacing), _sample_disc(end, e, radius, spacing)


def _sample_disc(
    centre: NDArray[np.float64], normal: NDArray[np.float64], radius: float, spacing: float
) -> SurfacePoints:
    e, u, v = axes_along(normal)
    rings = max(1, math.ceil(radius / spacing))
    position, area = [], []
    for i in range(rings):
        inner, outer = radius * i / rings, radius * (i + 1) / rings
        # the outermost ring of points stands on the rim, so that first touch is where it should be
        r = radius * (1.0 - 1e-9) if i == rings - 1 else 0.5 * (inner + outer)
        count = max(6, math.ceil(2.0 * math.pi * r / spacing))
        angle = 2.0 * math.pi * (np.arange(count) + 0.5 * (i % 2)) / count
        position.append(centre + r * (np.cos(angle)[:, None] * u + np.sin(angle)[:, None] * v))
        area.append(np.full(count, math.pi * (outer**2 - inner**2) / count))
    points = np.concatenate(position)
    return SurfacePoints(position=points, normal=np.tile(e, (len(points), 1)), area=np.concatenate(area))


def axes_along(direction: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Right-handed unit axes (e, u, v) with e along `direction`."""
    e = direction / np.linalg.norm(direction)
    helper = np.zeros(3)
    helper[int(np.argmin(np.abs(e)))] = 1.0
    u = np.cross(helper, e)
    u /= np.linalg.norm(u)
    return e, u, np.cross(e, u)
