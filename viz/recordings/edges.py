"""Where the ground breaks: lines along the foot and the edge of kerbs, banks and ditches, which light alone hides."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ground.surface import Bank, Ditch, Kerb, Sum, Surface, height

EDGE = 0xB39A6CFF
Rectangle = tuple[float, float, float, float]  # smallest and largest x, smallest and largest y, m
_PIECES = 60


def edges(surface: Surface, outer: Rectangle) -> list[NDArray[np.float64]]:
    """Lines (k, 3) along each break of the surface within a rectangle; world, m."""
    x0, x1, y0, y1 = outer
    reach, middle = math.hypot(x1 - x0, y1 - y0), np.array([0.5 * (x0 + x1), 0.5 * (y0 + y1)])
    found = []
    for part in surface.parts if isinstance(surface, Sum) else (surface,):
        for point, direction_deg, u in _breaks(part):
            d = math.radians(direction_deg)
            across, along = np.array([math.cos(d), math.sin(d)]), np.array([-math.sin(d), math.cos(d)])
            start = np.array(point) + u * across
            start = start + (middle - start) @ along * along  # the place of the line that is nearest to the middle
            way = start + np.linspace(-0.5 * reach, 0.5 * reach, _PIECES + 1)[:, None] * along
            way = way[(way[:, 0] >= x0) & (way[:, 0] <= x1) & (way[:, 1] >= y0) & (way[:, 1] <= y1)]
            if len(way) > 1:
                lifted = height(surface, way[:, 0], way[:, 1]) + 0.002 * math.sqrt(reach)
                found.append(np.column_stack([way, lifted]))
    return found


def _breaks(part: Any) -> Iterator[tuple[tuple[float, float], float, float]]:
    """A point, the direction across, deg, and how far across the line lies, m, for each break of a part."""
    if isinstance(part, Kerb):
        places, point = [0.0, part.height / math.tan(math.radians(part.face_deg))], part.foot
    elif isinstance(part, Bank):
        places, point = [0.0, part.height / math.tan(math.radians(part.angle_deg))], part.edge
    elif isinstance(part, Ditch):
        inner = 0.5 * part.bottom
        outer = inner + part.depth / math.tan(math.radians(part.angle_deg))
        places, point = sorted({-outer, -inner, inner, outer}), part.centre
    else:
        return
    for u in places:
        yield point, part.direction_deg, u
