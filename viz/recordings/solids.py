"""What bodies are drawn with: solids and wires as arrays, each under an entity of its own. Nothing knows the viewer.

Parts are given in the axes of the entity they hang under; m, colours 0xRRGGBBAA.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rollover.spec.shapes import Point
from viz.content.entities import escaped

FRAME = 0xF2C81EFF  # a yielding frame, and the mass of a striker
STEEL, DARK_STEEL = 0x8E98A3FF, 0x5C6670FF
AROUND = 48  # facets of what is round


@dataclass(frozen=True, kw_only=True)
class Block:
    """A solid cuboid along the axes of its entity."""

    path: str
    centre: Point
    size: Point
    colour: int
    see_through: bool = False


@dataclass(frozen=True, kw_only=True)
class Rod:
    """A solid round bar with flat ends at `start` and `end`."""

    path: str
    start: Point
    end: Point
    radius: float
    colour: int


@dataclass(frozen=True, kw_only=True)
class Balls:
    """Solid balls."""

    path: str
    centres: NDArray[np.float64]
    radii: NDArray[np.float64]
    colour: int


@dataclass(frozen=True, kw_only=True)
class Hull:
    """A mesh: vertices (n, 3) with normals (n, 3) and colours (n,), triangles (m, 3)."""

    path: str
    vertices: NDArray[np.float64]
    normals: NDArray[np.float64]
    colours: NDArray[np.uint32]
    triangles: NDArray[np.int64]


@dataclass(frozen=True, kw_only=True)
class Wire:
    """Lines, each (k, 3)."""

    path: str
    strips: tuple[NDArray[np.float64], ...]
    colour: int
    radius: float


Part = Block | Rod | Balls | Hull | Wire


def body_path(body: str) -> str:
    """Entity of a body: carries its pose, its parts are children."""
    return f"world/{escaped(body)}"
