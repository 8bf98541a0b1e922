"""Compiled: heights of an uneven surface, as a sum of parts in one table; the tangent plane of an element."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ground.compiled import leaf

# columns of a part: kind, a point, the unit vector across its edge (towards which u grows; v stands to its left),
# and numbers of its own as named in `profile`
KIND, PX, PY, DX, DY, A, B, C, D, E, OVER, PART_COLUMNS = 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11
# A, B: gradient | tan of the face, height | tan, depth, half width at the top | tan of the rise, height, length
# with the top, tan of the faces, half width | tan, height | grid's steps along x and y, nodes along x and y, first node
SLOPED, BANK, DITCH, RAMP, KERB, MAP = 0, 1, 2, 3, 4, 5

STEEPEST = 75.0  # deg: beyond it an element of a grid in the horizontal plane stands for nothing one could press on
_STEEPEST_TAN = math.tan(math.radians(STEEPEST))


@leaf
def node(parts: Any, nodes: Any, k: int, ix: int, iy: int) -> float:
    """Height at a node of a map; beyond its rim that of the rim."""
    nx, ny = int(parts[k, C]), int(parts[k, D])
    ix, iy = min(max(ix, 0), nx - 1), min(max(iy, 0), ny - 1)
    return nodes[int(parts[k, E]) + ix * ny + iy]  # type: ignore[no-any-return]


@leaf
def on_map(parts: Any, nodes: Any, k: int, x: float, y: float) -> Any:
    """Height and gradient of a map, bilinear between its nodes, level beyond its rim."""
    u, v = (x - parts[k, PX]) / parts[k, A], (y - parts[k, PY]) / parts[k, B]
    ix, iy = math.floor(u), math.floor(v)
    a, b = u - ix, v - iy
    z00, z10 = node(parts, nodes, k, ix, iy), node(parts, nodes, k, ix + 1, iy)
    z01, z11 = node(parts, nodes, k, ix, iy + 1), node(parts, nodes, k, ix + 1, iy + 1)
    low, high = z00 + a * (z10 - z00), z01 + a * (z11 - z01)
    gx = ((z10 - z00) * (1.0 - b) + (z11 - z01) * b) / parts[k, A]
    return low + b * (high - low), gx, (high - low) / parts[k, B]


@leaf
def profile(parts: Any, k: int, u: float, v: float) -> Any:
    """Height of part k over u and v, and its derivatives along both."""
    kind, a, b = int(parts[k, KIND]), parts[k, A], parts[k, B]
    if kind == BANK:
        if u <= 0.0:
            return 0.0, 0.0, 0.0
        return (-u * a, -a, 0.0) if u * a < b else (-b, 0.0, 0.0)
    if kind == KERB:
        if u <= 0.0:
            return 0.0, 0.0, 0.0
        return (u * a, a, 0.0) if u * a < b else (b, 0.0, 0.0)
    if kind == DITCH:
        inside = (parts[k, C] - abs(u)) * a
        if inside <= 0.0:
            return 0.0, 0.0, 0.0
        return (-inside, math.copysign(a, u), 0.0) if inside < b else (-b, 0.0, 0.0)
    d = parts[k, D]
    rise, end = u * a, (parts[k, C] - u) * d + b
    side = (parts[k, E] - abs(v)) * d + b
    z = min(min(rise, end), min(side, b))
    if z <= 0.0:
        return 0.0, 0.0, 0.0
    if z == b:
        return z, 0.0, 0.0
    if z == rise:
        return z, a, 0.0
    return (z, -d, 0.0) if z == end else (z, 0.0, -math.copysign(d, v))


@leaf
def height_and_gradient(parts: Any, nodes: Any, x: float, y: float) -> Any:
    """z(x, y), dz/dx and dz/dy of all parts together."""
    z, gx, gy = 0.0, 0.0, 0.0
    for k in range(parts.shape[0]):
        if parts[k, KIND] == SLOPED:
            z += parts[k, A] * x + parts[k, B] * y
            gx += parts[k, A]
            gy += parts[k, B]
        elif parts[k, KIND] == MAP:
            h, a, b = on_map(parts, nodes, k, x, y)
            z += h
            gx += a
            gy += b
        else:
            dx, dy, along, across = x - parts[k, PX], y - parts[k, PY], parts[k, DX], parts[k, DY]
            h, a, b = profile(parts, k, dx * along + dy * across, dy * along - dx * across)
            z += h
            gx += a * along - b * across
            gy += a * across + b * along
    return z, gx, gy


@leaf
def highest(parts: Any, nodes: Any, x: float, y: float, reach: float) -> float:
    """No point of the surface within `reach` of (x, y) is higher than this, m; nor of planes, see `overshoots`."""
    z = 0.0
    for k in range(parts.shape[0]):
        a, b = parts[k, A], parts[k, B]
        kind = int(parts[k, KIND])
        if kind == SLOPED:
            z += a * x + b * y + math.hypot(a, b) * reach
        elif kind == MAP:
            z += highest_node(parts[k], nodes, x, y, reach) + parts[k, OVER]
        else:
            dx, dy, along, across = x - parts[k, PX], y - parts[k, PY], parts[k, DX], parts[k, DY]
            u, v, level = dx * along + dy * across, dy * along - dx * across, 0.0
            if kind == BANK:
                h, _, _ = profile(parts, k, u - reach, v)
                level = -b
            elif kind == KERB:
                h, _, _ = profile(parts, k, u + reach, v)
            elif kind == DITCH:
                h, _, _ = profile(parts, k, abs(u) + reach, v)
                level = -b
            else:
                rise, end = (u + reach) * a, (parts[k, C] - u + reach) * parts[k, D] + b
                side = (parts[k, E] - abs(v) + reach) * parts[k, D] + b
                h = max(min(min(rise, end), min(side, b)), 0.0)
            z += h
            if h != level:  # as low as it gets: nothing bends within reach
                z += parts[k, OVER]
    return z


BLOCK = 16  # nodes along the edge of a block whose highest node is kept


@leaf
def highest_node(part: Any, nodes: Any, x: float, y: float, reach: float) -> float:
    """Highest node of the blocks that lie within `reach`; they stand behind the map's own nodes."""
    nx, ny = int(part[C]), int(part[D])
    bx, by = (nx + BLOCK - 1) // BLOCK, (ny + BLOCK - 1) // BLOCK
    first = int(part[E]) + nx * ny
    i0, i1 = math.floor((x - reach - part[PX]) / part[A]), math.floor((x + reach - part[PX]) / part[A]) + 1
    j0, j1 = math.floor((y - reach - part[PY]) / part[B]), math.floor((y + reach - part[PY]) / part[B]) + 1
    i0, i1 = min(max(i0, 0), nx - 1) // BLOCK, min(max(i1, 0), nx - 1) // BLOCK
    j0, j1 = min(max(j0, 0), ny - 1) // BLOCK, min(max(j1, 0), ny - 1) // BLOCK
    z = -math.inf
    for i in range(i0, i1 + 1):
        for j in range(j0, j1 + 1):
            if i < bx and j < by:
                z = max(z, nodes[first + i * by + j])
    return z


@leaf
def element_plane(parts: Any, nodes: Any, x0: float, y0: float, dx: float, dy: float, plane: Any) -> None:
    """Plane of the element with its lowest corner at (x0, y0): unit normal and offset into `plane` (4,).

    The plane nearest to the surface's heights at the four corners. It is the tangent plane wherever the surface does
    not bend within the element, and never steeper than what the element spans; `STEEPEST` at most.
    """
    a, _, _ = height_and_gradient(parts, nodes, x0, y0)
    b, _, _ = height_and_gradient(parts, nodes, x0 + dx, y0)
    c, _, _ = height_and_gradient(parts, nodes, x0 + dx, y0 + dy)
    d, _, _ = height_and_gradient(parts, nodes, x0, y0 + dy)
    gx, gy = 0.5 * (b + c - a - d) / dx, 0.5 * (c + d - a - b) / dy
    steep = math.hypot(gx, gy)
    if steep > _STEEPEST_TAN:
        gx, gy = gx * _STEEPEST_TAN / steep, gy * _STEEPEST_TAN / steep
    size = math.sqrt(1.0 + gx * gx + gy * gy)
    plane[0], plane[1], plane[2] = -gx / size, -gy / size, 1.0 / size
    plane[3] = plane[0] * (x0 + 0.5 * dx) + plane[1] * (y0 + 0.5 * dy) + plane[2] * 0.25 * (a + b + c + d)


@leaf
def heights(parts: Any, nodes: Any, x: Any, y: Any, z: Any) -> None:
    """Heights at many places (n,), into z (n,)."""
    for k in range(x.shape[0]):
        z[k], _, _ = height_and_gradient(parts, nodes, x[k], y[k])


@leaf
def normals(parts: Any, nodes: Any, x: Any, y: Any, n: Any) -> None:
    """Unit normals at many places (k,), into n (k, 3)."""
    for k in range(x.shape[0]):
        _, gx, gy = height_and_gradient(parts, nodes, x[k], y[k])
        size = math.sqrt(1.0 + gx * gx + gy * gy)
        n[k, 0], n[k, 1], n[k, 2] = -gx / size, -gy / size, 1.0 / size


def highest_of_blocks(grid: Any) -> Any:
    """Highest node of each block of a map (nx, ny), its upper neighbours included: (blocks,)."""
    nx, ny = grid.shape
    return np.array(
        [grid[i : i + BLOCK + 1, j : j + BLOCK + 1].max() for i in range(0, nx, BLOCK) for j in range(0, ny, BLOCK)]
    )


def overshoots(parts: Any, nodes: Any, dx: float, dy: float) -> Any:
    """How much higher than its highest corner the plane of an element of dx by dy may stand within it, m, (parts,).

    The plane misses each of the corners' heights a, b, c, d by |a - b + c - d|/4, of which each part adds its own:
    at most half of what it rises along an edge. `STEEPEST` only lays a plane flatter.
    """
    found = np.zeros(len(parts))
    for k, part in enumerate(parts):
        if part[KIND] == MAP:
            nx, ny, first = (int(v) for v in part[[C, D, E]])
            grid = nodes[first : first + nx * ny].reshape(nx, ny)
            rises = (np.abs(np.diff(grid, axis=i)).max(initial=0.0) / part[A + i] * (dx, dy)[i] for i in (0, 1))
            found[k] = 0.5 * min(rises)
        elif part[KIND] != SLOPED:
            steepest = max(part[A], part[D]) if part[KIND] == RAMP else part[A]
            found[k] = 0.5 * min(steepest * min(dx, dy), part[B])
    return found
