"""The ground as a mesh: coarse where nothing touches it, element by element where something does. Arrays only.

Each touched element is a flat square at its own depth, joined to its neighbours by upright walls: elements are
independent of each other, and a picture that smoothed them would show ruts that the model does not have.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ground.array import Elements
from ground.surface import Surface, height, is_flat, normal, normals
from rollover.dynamics.result import GroundTrack

SOIL = 0x6B5638FF
BEYOND = 0x5B4C37FF  # undisturbed soil outside the array
SIDE = 0x3F3120FF
GRID = 0x463824FF
_MOST_VERTICES = 20_000  # of the part that never changes
_MOST_ROWS = 8_000_000  # vertices times frames of the part that does
_LEAST_INTERVAL = 0.02  # s, 50 Hz
_TILE = 12  # elements along the edge of a patch

Rectangle = tuple[float, float, float, float]  # smallest and largest x, smallest and largest y, m

# sinkage over the scale -> red, green, blue; begins with the colour of the undisturbed soil
_RAMP_AT = np.array([0.0, 0.02, 0.35, 0.7, 1.0])
_RAMP = np.array([(0x6B, 0x56, 0x38), (0x8A, 0x5A, 0x2C), (0xD9, 0x5F, 0x1E), (0xFF, 0x9A, 0x1F), (0xFF, 0xE4, 0x6B)])


@dataclass(frozen=True, kw_only=True)
class Patch:
    """A part of the mesh that sinks: vertices `base` (b, 3) and `triangles`; world axes, m.

    Each vertex sinks along `down`, (3,) or on uneven ground (b, 3), by what stands in its `column` (b,) of the track,
    -1: not at all. Where `is_side` (b,) it belongs to the side of the block of soil and keeps its colour.
    """

    name: str
    base: NDArray[np.float64]
    triangles: NDArray[np.int64]
    column: NDArray[np.int64]
    is_side: NDArray[np.bool_]
    down: NDArray[np.float64]

    @property
    def columns(self) -> NDArray[np.int64]:
        """Columns of the track on which this patch depends."""
        return np.unique(self.column[self.column >= 0])

    def sinkage(self, row: NDArray[np.float64]) -> NDArray[np.float64]:
        """Sinkage of each vertex, (b,), from one row of the track."""
        return np.asarray(np.append(row, 0.0)[self.column])

    def positions(self, row: NDArray[np.float64]) -> NDArray[np.float32]:
        """Vertices (b, 3) for one row of the track."""
        return (self.base + self.sinkage(row)[:, None] * self.down).astype(np.float32)

    def colours(self, row: NDArray[np.float64], scale: float) -> NDArray[np.uint32]:
        """Colours (b,) for one row of the track; `scale` (m) as in `ramp`."""
        return np.where(self.is_side, np.uint32(SIDE), ramp(self.sinkage(row), scale)).astype(np.uint32)


@dataclass(frozen=True, kw_only=True)
class Terrain:
    """Mesh of the ground; world axes, m.

    `fixed` (a, 3) with `fixed_triangles` and `fixed_colours` never changes; `patches` do, each at its own times.
    `grid` holds the ends of lines on the undisturbed surface, (l, 2, 3), `grid_step` m apart.
    """

    fixed: NDArray[np.float64]
    fixed_triangles: NDArray[np.int64]
    fixed_colours: NDArray[np.uint32]
    patches: tuple[Patch, ...]
    grid: NDArray[np.float64]
    grid_step: float


def nice(value: float) -> float:
    """The smallest of 1, 2, 5 times a power of ten that is no less than `value`."""
    if not value > 0.0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(value))
    return next(m * power for m in (1.0, 2.0, 5.0, 10.0) if m * power >= value * (1.0 - 1e-9))


def ramp(sinkage: NDArray[np.float64], scale: float) -> NDArray[np.uint32]:
    """Soil brown at 0, over orange to yellow at `scale` (m), as 0xRRGGBBAA."""
    share = np.clip(sinkage / scale, 0.0, 1.0)
    red, green, blue = (np.rint(np.interp(share, _RAMP_AT, _RAMP[:, k])).astype(np.uint32) for k in range(3))
    return np.asarray((red << 24) | (green << 16) | (blue << 8) | 0xFF, dtype=np.uint32)


def corner(elements: Elements) -> tuple[float, float]:
    """World x, y of the array's corner with the smallest x and y, m."""
    (nx, ny), (dx, dy), (cx, cy) = elements.count, elements.spacing, elements.centre
    return cx - 0.5 * nx * dx, cy - 0.5 * ny * dy


def frames(track: GroundTrack, patch: Patch) -> NDArray[np.int64]:
    """Rows of the track worth drawing: those where the patch changed, at most 50 a second, the last state kept."""
    if not track.time.size or not patch.columns.size:
        return np.empty(0, dtype=np.int64)
    slot = np.floor((track.time - track.time[0]) / _LEAST_INTERVAL + 1e-9)
    last_of_slot = np.flatnonzero(np.append(slot[1:] != slot[:-1], True))
    mine = track.sinkage[np.ix_(last_of_slot, patch.columns)]
    changed = np.any(np.diff(mine, axis=0, prepend=0.0) != 0.0, axis=1)
    return last_of_slot[changed]


def thinned(kept: Sequence[NDArray[np.int64]], patches: Sequence[Patch]) -> list[NDArray[np.int64]]:
    """Rows for all patches, fewer where a recording would grow beyond what a viewer holds; last states stay."""
    rows = sum(len(k) * len(p.base) for k, p in zip(kept, patches, strict=True))
    every = max(1, math.ceil(rows / _MOST_ROWS))
    return [k[::-1][::every][::-1] for k in kept]


def cut_open(elements: Elements, touched: NDArray[np.int64]) -> tuple[Elements, NDArray[np.int64]]:
    """The array without what lies before (at smaller y than) the touched elements, and their indices in it.

    A section through a drop test: the striker stays in its rut, and soil before it would hide how deep.
    """
    (_, ny), dy = elements.count, elements.spacing[1]
    if not touched.size:
        return elements, touched
    first = int((touched % ny).min())
    left = replace(
        elements, width=(ny - first) * dy, centre=(elements.centre[0], elements.centre[1] + 0.5 * first * dy)
    )
    return left, touched // ny * (ny - first) + touched % ny - first


def terrain(
    surface: Surface,
    elements: Elements,
    touched: NDArray[np.int64],
    *,
    outer: Rectangle | None = None,
    grid_step: float = 0.5,
    thickness: float = 0.1,
) -> Terrain:
    """Mesh of a block of soil `thickness` m thick, of which the elements `touched` (flat indices) will move.

    Soil is drawn as far as `outer` where the array is smaller.
    """
    nx, ny = elements.count
    x0, x1, y0, y1 = _bounds(elements)
    a, b, c, d = outer or (x0, x1, y0, y1)
    outer = (min(a, x0), max(b, x1), min(c, y0), max(d, y1))
    moving = _with_adjacent(touched, nx, ny)
    block = 1
    while (math.ceil(nx / block) + 1) * (math.ceil(ny / block) + 1) > _MOST_VERTICES:
        block += 1
    fixed, fixed_triangles, rim = _fixed(surface, elements, moving, block)
    around, outside = _around(surface, elements, outer)
    fixed_side = _sides(np.concatenate([fixed, around]), np.concatenate([rim, len(fixed) + outside]), thickness)
    base = _corners(surface, elements, moving // ny, moving % ny)
    rim = _rim_of(moving // ny, moving % ny, nx, ny)
    side = _sides(base, rim, thickness)
    column = np.repeat(_columns(touched, moving), 4)
    # of the four vertices of a side, the upper two sink with their element and the lower two do not; beside soil
    # that stays, none does
    sinks = _is_open(elements, base[rim], outer)
    upper = [np.where(sinks, column[rim[:, k]], -1) for k in (0, 1)]
    whole = Patch(
        name="",
        base=np.concatenate([base, side]),
        triangles=np.concatenate([_squares(moving.size), _walls(moving, nx, ny), len(base) + _squares(len(side) // 4)]),
        column=np.concatenate([column, np.stack([*upper, *np.full((2, len(rim)), -1)], axis=1).ravel()]),
        is_side=np.repeat([False, True], [len(base), len(side)]),
        down=_down(surface, elements, moving, len(side)),
    )
    parts = (fixed, around, fixed_side)
    return Terrain(
        fixed=np.concatenate(parts),
        fixed_triangles=np.concatenate(
            [
                fixed_triangles,
                len(fixed) + _squares(len(around) // 4),
                len(fixed) + len(around) + _squares(len(fixed_side) // 4),
            ]
        ),
        fixed_colours=np.repeat(np.array([SOIL, BEYOND, SIDE], dtype=np.uint32), [len(p) for p in parts]),
        patches=_patches(elements, whole),
        grid=_grid(surface, outer, grid_step),
        grid_step=grid_step,
    )


def _down(surface: Surface, elements: Elements, moving: NDArray[np.int64], sides: int) -> NDArray[np.float64]:
    """Where vertices sink to: one direction for a flat surface, or that of each vertex's own element."""
    if is_flat(surface):
        return -normal(surface)
    (x0, y0), (dx, dy), ny = corner(elements), elements.spacing, elements.count[1]
    x: NDArray[np.float64] = x0 + (moving // ny + 0.5) * np.float64(dx)
    y: NDArray[np.float64] = y0 + (moving % ny + 0.5) * np.float64(dy)
    n = normals(surface, x, y)
    # the sides of the block hang straight down: those few vertices sink with the world
    return -np.concatenate([np.repeat(n, 4, axis=0), np.tile([0.0, 0.0, 1.0], (sides, 1))])


def _patches(elements: Elements, whole: Patch) -> tuple[Patch, ...]:
    """Cut a mesh into tiles: at any instant few elements move, and a mesh can only be written as a whole."""
    middle = whole.base[whole.triangles].mean(axis=1)[:, :2] - corner(elements)
    tile = np.floor(middle / (_TILE * np.array(elements.spacing)) + 1e-9).astype(np.int64)
    found = []
    for i, j in np.unique(tile, axis=0).tolist():
        mine = whole.triangles[(tile == (i, j)).all(axis=1)]
        vertices, triangles = np.unique(mine, return_inverse=True)
        found.append(
            replace(
                whole,
                name=f"{i}_{j}",
                base=whole.base[vertices],
                triangles=triangles.reshape(-1, 3),
                column=whole.column[vertices],
                is_side=whole.is_side[vertices],
                down=whole.down[vertices] if whole.down.ndim > 1 else whole.down,
            )
        )
    return tuple(found)


def _bounds(elements: Elements) -> Rectangle:
    (nx, ny), (dx, dy), (x0, y0) = elements.count, elements.spacing, corner(elements)
    return x0, x0 + nx * dx, y0, y0 + ny * dy


def _around(surface: Surface, elements: Elements, outer: Rectangle) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Soil between the array and `outer`: up to four rectangles, four corners each, and their edges on the outside."""
    (x0, x1, y0, y1), (a, b, c, d) = _bounds(elements), outer
    found: list[list[tuple[float, float]]] = []
    edges: list[tuple[int, int]] = []
    # low x, high x, low y, high y; which of the edges 0-1 (low y), 1-2 (high x), 2-3 (high y), 3-0 (low x) are outside
    for lx, hx, ly, hy, outside in (
        (a, x0, c, d, (0, 2, 3)),
        (x1, b, c, d, (0, 1, 2)),
        (x0, x1, c, y0, (0,)),
        (x0, x1, y1, d, (2,)),
    ):
        if hx - lx > 1e-9 and hy - ly > 1e-9:
            edges += [(4 * len(found) + k, 4 * len(found) + (k + 1) % 4) for k in outside]
            found.append([(lx, ly), (hx, ly), (hx, hy), (lx, hy)])
    if not is_flat(surface):
        found, edges = _tiles(found, outer)
    flat = np.array(found, dtype=float).reshape(-1, 2)
    corners = np.column_stack([flat, height(surface, flat[:, 0], flat[:, 1])])
    return corners, np.array(edges, dtype=np.int64).reshape(-1, 2)


def _tiles(
    rectangles: list[list[tuple[float, float]]], outer: Rectangle
) -> tuple[list[list[tuple[float, float]]], list[tuple[int, int]]]:
    """Rectangles cut into tiles that can follow uneven ground, and which of their edges are the picture's own."""
    a, b, c, d = outer
    step = max(b - a, d - c) / 60.0
    found: list[list[tuple[float, float]]] = []
    edges: list[tuple[int, int]] = []
    for (lx, ly), _, (hx, hy), _ in rectangles:
        xs = np.linspace(lx, hx, max(2, math.ceil((hx - lx) / step) + 1)).tolist()
        ys = np.linspace(ly, hy, max(2, math.ceil((hy - ly) / step) + 1)).tolist()
        for x0, x1 in pairwise(xs):
            for y0, y1 in pairwise(ys):
                at = 4 * len(found)
                rim = ((y0 == c, 0), (x1 == b, 1), (y1 == d, 2), (x0 == a, 3))
                edges += [(at + k, at + (k + 1) % 4) for on, k in rim if on]
                found.append([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
    return found, edges


def _is_open(elements: Elements, edges: NDArray[np.float64], outer: Rectangle) -> NDArray[np.bool_]:
    """Whether edges (n, 2, 3) on the rim of the array are the outside of the picture, with no soil beyond."""
    middle = edges.mean(axis=1)
    found = np.zeros(len(edges), dtype=bool)
    for k, (here, limit) in enumerate(zip(_bounds(elements), outer, strict=True)):
        if abs(limit - here) <= 1e-9:
            found |= np.abs(middle[:, k // 2] - here) < 1e-6 * max(elements.spacing)
    return found


def _rim_of(ix: NDArray[np.int64], iy: NDArray[np.int64], nx: int, ny: int) -> NDArray[np.int64]:
    """Edges on the rim of an nx by ny array, as pairs of corners of the squares at (ix, iy), four corners each."""
    found = []
    for on_rim, edge in ((iy == 0, (0, 1)), (ix == nx - 1, (1, 2)), (iy == ny - 1, (2, 3)), (ix == 0, (3, 0))):
        at = 4 * np.flatnonzero(on_rim)
        found.append(np.stack([at + edge[0], at + edge[1]], axis=1))
    return np.concatenate(found)


def _sides(vertices: NDArray[np.float64], rim: NDArray[np.int64], thickness: float) -> NDArray[np.float64]:
    """Upright faces from edges of the rim down by `thickness`: four vertices of their own for each."""
    below = np.array([0.0, 0.0, -thickness])
    a, b = vertices[rim[:, 0]], vertices[rim[:, 1]]
    return np.stack([a, b, b + below, a + below], axis=1).reshape(-1, 3)


def _columns(touched: NDArray[np.int64], moving: NDArray[np.int64]) -> NDArray[np.int64]:
    """Column of each moving element in the track; -1 for the neighbour of a touched one that is itself untouched."""
    if not touched.size:
        return np.full(moving.size, -1)
    order = np.argsort(touched)
    at = order[np.searchsorted(touched, moving, sorter=order).clip(max=touched.size - 1)]
    return np.where(touched[at] == moving, at, -1)


def _with_adjacent(touched: NDArray[np.int64], nx: int, ny: int) -> NDArray[np.int64]:
    ix, iy = touched // ny, touched % ny
    around = [(ix + i, iy + j) for i, j in ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1))]
    x, y = (np.concatenate(parts) for parts in zip(*around, strict=True))
    inside = (x >= 0) & (x < nx) & (y >= 0) & (y < ny)
    return np.unique(x[inside] * ny + y[inside])


def _place(surface: Surface, elements: Elements, ix: NDArray[np.int64], iy: NDArray[np.int64]) -> NDArray[np.float64]:
    x0, y0 = corner(elements)
    x: NDArray[np.float64] = x0 + ix * np.float64(elements.spacing[0])
    y: NDArray[np.float64] = y0 + iy * np.float64(elements.spacing[1])
    return np.stack([x, y, height(surface, x, y)], axis=-1)


def _corners(surface: Surface, elements: Elements, ix: NDArray[np.int64], iy: NDArray[np.int64]) -> NDArray[np.float64]:
    around = [_place(surface, elements, ix + i, iy + j) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))]
    return np.stack(around, axis=1).reshape(-1, 3)


def _squares(count: int) -> NDArray[np.int64]:
    first = 4 * np.arange(count)[:, None, None]
    return np.asarray(first + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)


def _walls(moving: NDArray[np.int64], nx: int, ny: int) -> NDArray[np.int64]:
    """Upright faces between neighbours: the corners of both on their common edge."""
    parts = []
    for step, edge, other in ((ny, (1, 2), (0, 3)), (1, (3, 2), (0, 1))):
        has_next = moving // ny < nx - 1 if step == ny else moving % ny < ny - 1
        a = np.flatnonzero(has_next)
        b = np.searchsorted(moving, moving[a] + step)
        there = (b < moving.size) & (moving[b.clip(max=moving.size - 1)] == moving[a] + step)
        a, b = 4 * a[there], 4 * b[there]
        quad = np.stack([a + edge[0], a + edge[1], b + other[1], b + other[0]], axis=1)
        parts += [quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]]
    return np.concatenate(parts)


def _fixed(
    surface: Surface, elements: Elements, moving: NDArray[np.int64], block: int
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Vertices, triangles and edges on the rim of what never moves.

    Blocks of `block` x `block` elements where nothing moves, and single elements in blocks where some do.
    """
    nx, ny = elements.count
    bx, by = math.ceil(nx / block), math.ceil(ny / block)
    is_open = np.zeros((bx, by), dtype=bool)
    is_open[moving // ny // block, moving % ny // block] = True
    node_x, node_y = np.minimum(np.arange(bx + 1) * block, nx), np.minimum(np.arange(by + 1) * block, ny)
    nodes = _place(surface, elements, *np.meshgrid(node_x, node_y, indexing="ij")).reshape(-1, 3)
    i, j = np.nonzero(~is_open)
    first = i * (by + 1) + j
    quad = np.stack([first, first + by + 1, first + by + 2, first + 1], axis=1)
    rim = quad.reshape(-1)[_rim_of(i, j, bx, by)]
    coarse = np.concatenate([quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]])
    inner = np.arange(block)
    oi, oj = np.nonzero(is_open)
    x = (oi[:, None, None] * block + inner[None, :, None] + 0 * inner[None, None, :]).ravel()
    y = (oj[:, None, None] * block + inner[None, None, :] + 0 * inner[None, :, None]).ravel()
    inside = (x < nx) & (y < ny)
    still = np.setdiff1d(x[inside] * ny + y[inside], moving)
    fine = _corners(surface, elements, still // ny, still % ny)
    rim = np.concatenate([rim, len(nodes) + _rim_of(still // ny, still % ny, nx, ny)])
    return np.concatenate([nodes, fine]), np.concatenate([coarse, len(nodes) + _squares(still.size)]), rim


def _grid(surface: Surface, outer: Rectangle, step: float) -> NDArray[np.float64]:
    """Lines at whole multiples of `step`, lifted a little so that they do not flicker within the surface."""
    x0, x1, y0, y1 = outer
    lift = 0.004 * step * (normal(surface) if is_flat(surface) else np.array([0.0, 0.0, 1.0]))
    lines = []
    pieces = 1 if is_flat(surface) else 100
    for low, high, across, axis in ((x0, x1, (y0, y1), 0), (y0, y1, (x0, x1), 1)):
        for at in np.arange(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1) * step:
            along = np.linspace(*across, pieces + 1)
            way = np.array([(at, c) if axis == 0 else (c, at) for c in along])
            drawn = np.column_stack([way, height(surface, way[:, 0], way[:, 1])]) + lift
            lines += [drawn[k : k + 2] for k in range(pieces)]
    return np.array(lines).reshape(-1, 2, 3)
