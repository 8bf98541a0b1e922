"""Lines on the ground: its grid, and the foot and edge of kerbs, banks, ditches and ramps, which light alone hides."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ground.surface import Bank, Ditch, Kerb, Part, Ramp, Sum, Surface, height, is_flat, normal

GRID = 0x463824FF
EDGE = 0xB39A6CFF
Rectangle = tuple[float, float, float, float]  # smallest and largest x, smallest and largest y, m
_PIECES = 60  # of an edge
_MOST_PIECES = 100  # of a line of the grid
_UNSEEN = 0.005  # m that a square may miss the surface by
_STRAIGHT = 1e-6  # m, second difference of heights below which a line has no corner


def edges(surface: Surface, outer: Rectangle, spacing: tuple[float, float] = (0.0, 0.0)) -> list[NDArray[np.float64]]:
    """Lines (k, 3) along each break of the surface within a rectangle, over a mesh of `spacing` (m); world, m."""
    lift = 0.002 * math.sqrt(math.hypot(outer[1] - outer[0], outer[3] - outer[2]))
    found = []
    for part in surface.parts if isinstance(surface, Sum) else (surface,):
        for ends in _breaks(part, outer):
            inside = _within(ends, outer)
            if inside is None:
                continue
            way = np.linspace(inside[0], inside[1], _PIECES + 1)
            along = (inside[1] - inside[0]) / np.linalg.norm(inside[1] - inside[0])
            across = np.array([-along[1], along[0]])
            # a square of the mesh spans a hollow from side to side, and would hide a line at its bottom
            half = 0.5 * float(np.abs(across) @ spacing) * across
            beside = [height(surface, *(way + side * half).T) for side in (-1.0, 1.0)]
            z = np.maximum(height(surface, *way.T), 0.5 * (beside[0] + beside[1]))
            found.append(np.column_stack([way, z + lift]))
    return found


def _breaks(part: Part, outer: Rectangle) -> Iterator[NDArray[np.float64]]:
    """Both ends (2, 2) of each line along which a part of the surface breaks; beyond the rectangle if it has no end."""
    if isinstance(part, Kerb):
        places, point = [0.0, part.height / math.tan(math.radians(part.face_deg))], part.foot
    elif isinstance(part, Bank):
        places, point = [0.0, part.height / math.tan(math.radians(part.angle_deg))], part.edge
    elif isinstance(part, Ditch):
        inner = 0.5 * part.bottom
        wide = inner + part.depth / math.tan(math.radians(part.angle_deg))
        places, point = sorted({-wide, -inner, inner, wide}), part.centre
    elif isinstance(part, Ramp):
        yield from (_turned(np.array(ends), part.start, part.direction_deg) for ends in _of_ramp(part))
        return
    else:
        return
    x, y = (max(abs(side - p) for side in outer[k : k + 2]) for k, p in ((0, point[0]), (2, point[1])))
    far = math.hypot(x, y) + max(map(abs, places))
    for u in places:
        yield _turned(np.array([(u, -far), (u, far)]), point, part.direction_deg)


def _of_ramp(ramp: Ramp) -> Iterator[tuple[tuple[float, float], tuple[float, float]]]:
    """Its outline on the ground, that of its top, and what joins their corners; along it and across, m."""
    face, half = ramp.height / math.tan(math.radians(ramp.face_deg)), 0.5 * ramp.width
    end = ramp.length + ramp.top
    low, high = (0.0, end + face, half + face), (ramp.length, end, half)
    for u0, u1, v in (low, high):
        corners = [(u0, -v), (u1, -v), (u1, v), (u0, v)]
        yield from ((a, b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True) if a != b)
    for k in (0, 1):
        for side in (-1.0, 1.0):
            yield (low[k], side * low[2]), (high[k], side * high[2])


def _turned(along: NDArray[np.float64], origin: tuple[float, float], direction_deg: float) -> NDArray[np.float64]:
    c, s = math.cos(math.radians(direction_deg)), math.sin(math.radians(direction_deg))
    return np.asarray(np.array(origin) + along @ np.array([[c, s], [-s, c]]))


def _within(ends: NDArray[np.float64], outer: Rectangle) -> NDArray[np.float64] | None:
    """What of a line (2, 2) lies in the rectangle; None if nothing."""
    first, last = 0.0, 1.0
    way = ends[1] - ends[0]
    for k in (0, 1):
        low, high = outer[2 * k : 2 * k + 2]
        if abs(way[k]) < 1e-12:
            if not low <= ends[0, k] <= high:
                return None
            continue
        a, b = sorted(((low - ends[0, k]) / way[k], (high - ends[0, k]) / way[k]))
        first, last = max(first, a), min(last, b)
    return ends[0] + np.array([[first], [last]]) * way if last - first > 1e-9 else None


def grid(
    surface: Surface, outer: Rectangle, step: float, nodes: tuple[NDArray[np.float64], NDArray[np.float64]]
) -> NDArray[np.float64]:
    """Ends (l, 2, 3) of lines at whole multiples of `step`, with a corner at each of `nodes` where the surface breaks.

    Lifted a little, so that they do not flicker within the surface.
    """
    x0, x1, y0, y1 = outer
    lift = 0.004 * step * (normal(surface) if is_flat(surface) else np.array([0.0, 0.0, 1.0]))
    lines = []
    for low, high, across, axis in ((x0, x1, (y0, y1), 0), (y0, y1, (x0, x1), 1)):
        between = nodes[1 - axis]
        places = np.unique([*across, *between[(between > across[0]) & (between < across[1])]])
        for at in np.arange(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1) * step:
            c = np.array(across) if is_flat(surface) else _corners(surface, at, places, axis)
            way = np.column_stack([np.full(c.size, at), c][:: 1 - 2 * axis])
            drawn = np.column_stack([way, height(surface, way[:, 0], way[:, 1])]) + lift
            lines += [drawn[k : k + 2] for k in range(c.size - 1)]
    return np.array(lines).reshape(-1, 2, 3)


def _corners(surface: Surface, at: float, places: NDArray[np.float64], axis: int) -> NDArray[np.float64]:
    """Those of the places along a line at which its height has a corner; evenly spaced ones if there are too many."""
    x, y = (np.full(places.size, at), places)[:: 1 - 2 * axis]
    z, run = height(surface, x, y), np.diff(places)
    rise = np.diff(z) / run
    kept = np.concatenate([[True], np.abs(np.diff(rise)) * np.minimum(run[1:], run[:-1]) > _STRAIGHT, [True]])
    few = int(kept.sum()) <= _MOST_PIECES + 1
    return places[kept] if few else np.linspace(places[0], places[-1], _MOST_PIECES + 1)


def broken(
    surface: Surface,
    nodes: tuple[NDArray[np.float64], NDArray[np.float64]],
    corners: tuple[NDArray[np.int64], NDArray[np.int64]],
    most: int,
) -> NDArray[np.bool_]:
    """Which blocks of elements one square each would draw wrong, (bx, by); the `most` worst ones.

    `nodes` are x (nx + 1,) and y (ny + 1,) of the elements, m; `corners` the indices in them of the blocks' corners.
    """
    z = height(surface, nodes[0][:, None], nodes[1][None, :])
    square = z[np.ix_(*corners)]
    for node, corner in zip(nodes, corners, strict=True):
        # linear between the corners along x, then along y
        at = np.arange(node.size)
        k = np.clip(np.searchsorted(corner, at, side="right") - 1, 0, corner.size - 2)
        share = ((at - corner[k]) / (corner[k + 1] - corner[k]))[:, None]
        square = ((1.0 - share) * square[k] + share * square[k + 1]).T
    off = np.abs(z - square)
    worst = np.maximum.reduceat(np.maximum.reduceat(off, corners[0][:-1], axis=0), corners[1][:-1], axis=1)
    least = np.sort(worst, axis=None)[-most] if 0 < most < worst.size else 0.0
    return np.asarray((worst > _UNSEEN) & (worst >= least))
