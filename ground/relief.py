"""Compiled: heights of an uneven surface, as a sum of parts in one table; the tangent plane of an element."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ground.compiled import compiled

# columns of a part: kind, a point, the unit vector across its edge (towards which u grows; v stands to its left),
# and numbers of its own as named in `profile`
KIND, PX, PY, DX, DY, A, B, C, D, E, PART_COLUMNS = 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10
# A, B: gradient | tan of the face, height | tan, depth, half width at the top | tan of the rise, height, length
# with the top, tan of the faces, half width | tan, height | grid's steps along x and y, nodes along x and y, first node
SLOPED, BANK, DITCH, RAMP, KERB, MAP = 0, 1, 2, 3, 4, 5

STEEPEST = 75.0  # deg: beyond it an element of a grid in the horizontal plane stands for nothing one could press on
_STEEPEST_TAN = math.tan(math.radians(STEEPEST))


@compiled
def node(part: Any, nodes: Any, ix: int, iy: int) -> float:
    """Height at a node of a map; beyond its rim that of the rim."""
    nx, ny = int(part[C]), int(part[D])
    ix, iy = min(max(ix, 0), nx - 1), min(max(iy, 0), ny - 1)
    return nodes[int(part[E]) + ix * ny + iy]  # type: ignore[no-any-return]


@compiled
def on_map(part: Any, nodes: Any, x: float, y: float) -> Any:
    """Height and gradient of a map, bilinear between its nodes, level beyond its rim."""
    u, v = (x - part[PX]) / part[A], (y - part[PY]) / part[B]
    ix, iy = math.floor(u), math.floor(v)
    a, b = u - ix, v - iy
    z00, z10 = node(part, nodes, ix, iy), node(part, nodes, ix + 1, iy)
    z01, z11 = node(part, nodes, ix, iy + 1), node(part, nodes, ix + 1, iy + 1)
    low, high = z00 + a * (z10 - z00), z01 + a * (z11 - z01)
    gx = ((z10 - z00) * (1.0 - b) + (z11 - z01) * b) / part[A]
    return low + b * (high - low), gx, (high - low) / part[B]


@compiled
def profile(part: Any, u: float, v: float) -> Any:
    """Height of a part over u and v, and its derivatives along both."""
    kind = int(part[KIND])
    if kind == BANK:
        if u <= 0.0:
            return 0.0, 0.0, 0.0
        return (-u * part[A], -part[A], 0.0) if u * part[A] < part[B] else (-part[B], 0.0, 0.0)
    if kind == KERB:
        if u <= 0.0:
            return 0.0, 0.0, 0.0
        return (u * part[A], part[A], 0.0) if u * part[A] < part[B] else (part[B], 0.0, 0.0)
    if kind == DITCH:
        inside = (part[C] - abs(u)) * part[A]
        if inside <= 0.0:
            return 0.0, 0.0, 0.0
        return (-inside, math.copysign(part[A], u), 0.0) if inside < part[B] else (-part[B], 0.0, 0.0)
    rise, end = u * part[A], (part[C] - u) * part[D] + part[B]
    side = (part[E] - abs(v)) * part[D] + part[B]
    z = min(min(rise, end), min(side, part[B]))
    if z <= 0.0:
        return 0.0, 0.0, 0.0
    if z == part[B]:
        return z, 0.0, 0.0
    if z == rise:
        return z, part[A], 0.0
    return (z, -part[D], 0.0) if z == end else (z, 0.0, -math.copysign(part[D], v))


@compiled
def height_and_gradient(parts: Any, nodes: Any, x: float, y: float) -> Any:
    """z(x, y), dz/dx and dz/dy of all parts together."""
    z, gx, gy = 0.0, 0.0, 0.0
    for k in range(parts.shape[0]):
        part = parts[k]
        if part[KIND] == SLOPED:
            z += part[A] * x + part[B] * y
            gx += part[A]
            gy += part[B]
        elif part[KIND] == MAP:
            h, a, b = on_map(part, nodes, x, y)
            z += h
            gx += a
            gy += b
        else:
            dx, dy = x - part[PX], y - part[PY]
            h, a, b = profile(part, dx * part[DX] + dy * part[DY], dy * part[DX] - dx * part[DY])
            z += h
            gx += a * part[DX] - b * part[DY]
            gy += a * part[DY] + b * part[DX]
    return z, gx, gy


@compiled
def highest(parts: Any, nodes: Any, x: float, y: float, reach: float) -> float:
    """No point of the surface within `reach` of (x, y) is higher than this, m."""
    z = 0.0
    for k in range(parts.shape[0]):
        part = parts[k]
        kind = int(part[KIND])
        if kind == SLOPED:
            z += part[A] * x + part[B] * y + math.hypot(part[A], part[B]) * reach
        elif kind == MAP:
            z += highest_node(part, nodes, x, y, reach)
        else:
            dx, dy = x - part[PX], y - part[PY]
            u, v = dx * part[DX] + dy * part[DY], dy * part[DX] - dx * part[DY]
            if kind == BANK:
                h, _, _ = profile(part, u - reach, v)
            elif kind == KERB:
                h, _, _ = profile(part, u + reach, v)
            elif kind == DITCH:
                h, _, _ = profile(part, abs(u) + reach, v)
            else:
                rise, end = (u + reach) * part[A], (part[C] - u + reach) * part[D] + part[B]
                side = (part[E] - abs(v) + reach) * part[D] + part[B]
                h = max(min(min(rise, end), min(side, part[B])), 0.0)
            z += h
    return z


BLOCK = 16  # nodes along the edge of a block whose highest node is kept


@compiled
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


@compiled
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


@compiled
def heights(parts: Any, nodes: Any, x: Any, y: Any, z: Any) -> None:
    """Heights at many places (n,), into z (n,)."""
    for k in range(x.shape[0]):
        z[k], _, _ = height_and_gradient(parts, nodes, x[k], y[k])


@compiled
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
