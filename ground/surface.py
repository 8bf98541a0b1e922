"""The undisturbed surface: height, normal and element frame. World z is up, gravity acts along -z."""

from __future__ import annotations

import functools
import math
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray

from ground import relief
from ground.kinds import ByKind
from ground.no_data import missing
from ground.quantity import Grid, Quantity, parameters

Array = NDArray[np.float64]
FACE = Quantity("deg", "inclination of the face", above=0, most=relief.STEEPEST)
Where = Annotated[tuple[float, float], Quantity("m", "world x and y")]
Turn = Quantity("deg", "about z, 0 along x, 90 along y", least=-360, most=360)


@parameters
class Plane:
    """z = 0: level ground."""

    kind: Literal["plane"] = "plane"

    @property
    def gradient(self) -> tuple[float, float]:
        """(dz/dx, dz/dy)."""
        return (0.0, 0.0)


@parameters
class Slope:
    """z = tan(angle) (x cos(d) + y sin(d)): a plane that rises towards the direction d."""

    kind: Literal["slope"] = "slope"
    angle_deg: Annotated[float, Quantity("deg", "inclination", least=-60, most=60)]
    direction_deg: Annotated[
        float, Quantity("deg", "uphill direction about z, 0 along x, 90 along y", least=-360, most=360)
    ] = 90.0

    @property
    def gradient(self) -> tuple[float, float]:
        """(dz/dx, dz/dy)."""
        rise, d = math.tan(math.radians(self.angle_deg)), math.radians(self.direction_deg)
        return (rise * math.cos(d), rise * math.sin(d))


@parameters
class Bank:
    """Level at z = 0 up to a straight edge, then falling to a level bottom at z = -height."""

    kind: Literal["bank"] = "bank"
    height: Annotated[float, Quantity("m", "of the top over the bottom", above=0)]
    angle_deg: Annotated[float, FACE]
    edge: Annotated[Where, "a point of the top edge"] = (0.0, 0.0)
    direction_deg: Annotated[float, Turn, "in which it falls, across the edge"] = 90.0


@parameters
class Ditch:
    """A trench with a level bottom at z = -depth and equal faces on both sides."""

    kind: Literal["ditch"] = "ditch"
    depth: Annotated[float, Quantity("m", above=0)]
    bottom: Annotated[float, Quantity("m", "width of the level bottom", least=0)] = 0.0
    angle_deg: Annotated[float, FACE]
    centre: Annotated[Where, "a point of the middle line"] = (0.0, 0.0)
    direction_deg: Annotated[float, Turn, "across the ditch"] = 90.0


@parameters
class Ramp:
    """A wedge that lies on the ground: rises over its length, runs level along its top, ends at a steep face."""

    kind: Literal["ramp"] = "ramp"
    length: Annotated[float, Quantity("m", "of the rise", above=0)]
    height: Annotated[float, Quantity("m", "of its top", above=0)]
    width: Annotated[float, Quantity("m", "across its top: a wheel's track, or the whole vehicle", above=0)]
    top: Annotated[float, Quantity("m", "level length behind the rise", least=0)] = 0.0
    face_deg: Annotated[float, FACE, "of the faces at its end and sides"] = relief.STEEPEST
    start: Annotated[Where, "where the middle of the rise begins"] = (0.0, 0.0)
    direction_deg: Annotated[float, Turn, "in which it rises"] = 0.0

    def validate(self) -> None:
        """Refuse a rise that is steeper than any face."""
        most = self.length * math.tan(math.radians(relief.STEEPEST))
        if self.height > most:
            raise ValueError(f"height: too steep for its length, got {self.height!r}; at most {most:.4g} m")


@parameters
class Kerb:
    """A straight step up from z = 0 to z = height, such as a wheel trips over."""

    kind: Literal["kerb"] = "kerb"
    height: Annotated[float, Quantity("m", above=0)]
    face_deg: Annotated[float, FACE] = relief.STEEPEST
    foot: Annotated[Where, "a point of the line at which it begins to rise"] = (0.0, 0.0)
    direction_deg: Annotated[float, Turn, "in which it rises, across the kerb"] = 90.0


@parameters
class Heightmap:
    """Heights at the nodes of a grid, bilinear between them; beyond its rim the ground goes on level."""

    kind: Literal["heightmap"] = "heightmap"
    heights: Annotated[
        tuple[tuple[float, ...], ...],
        Grid("m", "a row for each x, a value for each y; or the name of a .csv or .npy file that holds them"),
    ]
    spacing: Annotated[tuple[float, float], Quantity("m", "between nodes along x and y", above=0)]
    corner: Annotated[Where, "of the node with the smallest x and y"] = (0.0, 0.0)

    def validate(self) -> None:
        """Refuse what is no grid, and nodes without a height."""
        lengths = {len(row) for row in self.heights}
        if len(self.heights) < 2 or len(lengths) != 1 or min(lengths) < 2:
            raise ValueError(f"heights: not a grid, got {len(self.heights)} rows of {sorted(lengths)}; at least 2 x 2")
        found = missing(np.array(self.heights, dtype=float), self.spacing, relief.STEEPEST)
        if found is not None:
            i, j, why = found
            raise ValueError(
                f"heights.{i}.{j}: no height at row {i + 1}, column {j + 1}, got {why}: a mark for no data; "
                "fill such nodes in from those beside them, or cut the map down to where it has heights"
            )


Part = Annotated[Plane | Slope | Bank | Ditch | Ramp | Kerb | Heightmap, ByKind()]


@parameters
class Sum:
    """Several surfaces laid over each other, their heights added: a ramp on a bank on a slope."""

    kind: Literal["sum"] = "sum"
    parts: tuple[Part, ...]

    def validate(self) -> None:
        """Refuse a sum of nothing."""
        if not self.parts:
            raise ValueError("parts: got none; at least one surface is needed")


Surface = Annotated[Plane | Slope | Bank | Ditch | Ramp | Kerb | Heightmap | Sum, ByKind()]


def is_flat(surface: Surface) -> bool:
    """Whether one plane stands for all of the surface."""
    parts = surface.parts if isinstance(surface, Sum) else (surface,)
    return all(isinstance(part, (Plane, Slope)) for part in parts)


def gradient(surface: Surface) -> tuple[float, float]:
    """(dz/dx, dz/dy) of a flat surface."""
    parts = surface.parts if isinstance(surface, Sum) else (surface,)
    slopes = [part.gradient for part in parts if isinstance(part, (Plane, Slope))]
    return (sum(g[0] for g in slopes), sum(g[1] for g in slopes))


@functools.lru_cache(maxsize=8)
def tables(surface: Surface, spacing: tuple[float, float] = (0.0, 0.0)) -> tuple[Array, Array]:
    """Parts (k, PART_COLUMNS) and map nodes (n,) for the kernels of `ground.relief`; none for a flat surface.

    `spacing` (m) is that of the elements whose planes stand for the surface; 0: the surface itself is asked for.
    """
    rows: list[list[float]] = []
    nodes: list[Array] = [np.zeros(0)]
    if not is_flat(surface):
        for part in surface.parts if isinstance(surface, Sum) else (surface,):
            at = sum(map(len, nodes))
            if isinstance(part, Heightmap):
                grid = np.array(part.heights)
                rows.append(_row(relief.MAP, part.corner, 0.0, *part.spacing, *map(float, grid.shape), float(at)))
                nodes += [grid.ravel(), relief.highest_of_blocks(grid)]
            elif not isinstance(part, Plane):
                rows.append(_profile(part))
    parts, heights = np.array(rows).reshape(-1, relief.PART_COLUMNS), np.concatenate(nodes)
    parts[:, relief.OVER] = relief.overshoots(parts, heights, *spacing)
    return parts, heights


def _profile(part: Slope | Bank | Ditch | Ramp | Kerb) -> list[float]:
    def tan(degrees: float) -> float:
        return math.tan(math.radians(degrees))

    if isinstance(part, Slope):
        return _row(relief.SLOPED, (0.0, 0.0), 0.0, *part.gradient)
    if isinstance(part, Bank):
        return _row(relief.BANK, part.edge, part.direction_deg, tan(part.angle_deg), part.height)
    if isinstance(part, Ditch):
        face = tan(part.angle_deg)
        half = 0.5 * part.bottom + part.depth / face
        return _row(relief.DITCH, part.centre, part.direction_deg, face, part.depth, half)
    if isinstance(part, Kerb):
        return _row(relief.KERB, part.foot, part.direction_deg, tan(part.face_deg), part.height)
    rise, end = part.height / part.length, part.length + part.top
    return _row(
        relief.RAMP, part.start, part.direction_deg, rise, part.height, end, tan(part.face_deg), 0.5 * part.width
    )


def _row(kind: int, at: tuple[float, float], direction_deg: float, *numbers: float) -> list[float]:
    d = math.radians(direction_deg)
    row = [float(kind), *at, math.cos(d), math.sin(d), *numbers]
    return row + [0.0] * (relief.PART_COLUMNS - len(row))


def height(surface: Surface, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Height of the undisturbed surface at world x, y (m, any shape)."""
    if is_flat(surface):
        gx, gy = gradient(surface)
        return gx * np.asarray(x) + gy * np.asarray(y)
    x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
    z = np.empty(x.size)
    relief.heights(*tables(surface), np.ascontiguousarray(x).ravel(), np.ascontiguousarray(y).ravel(), z)
    return z.reshape(x.shape)


def normal(surface: Surface) -> NDArray[np.float64]:
    """Unit normal of a flat surface, up, in world axes, shape (3,)."""
    gx, gy = gradient(surface)
    n = np.array([-gx, -gy, 1.0])
    return np.asarray(n / np.linalg.norm(n))


def normals(surface: Surface, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit normals of any surface at world x, y (n,), up, in world axes, (n, 3)."""
    if is_flat(surface):
        return np.tile(normal(surface), (len(x), 1))
    n = np.empty((len(x), 3))
    relief.normals(*tables(surface), np.ascontiguousarray(x, dtype=float), np.ascontiguousarray(y, dtype=float), n)
    return n
