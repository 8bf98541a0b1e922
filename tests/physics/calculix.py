"""Frames of solid elements for CalculiX: bricks on a lattice, pushed, and the force that their feet carry."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from rollover.spec.steel import Steel

CCX = shutil.which("ccx")
Box = tuple[tuple[float, float], tuple[float, float], tuple[float, float]]


def lines(*stops: tuple[float, int]) -> np.ndarray:
    """Lattice lines in mm: from 0 on, to each stop in that many cells."""
    found = [0.0]
    for stop, count in stops:
        found += list(np.linspace(found[-1], stop, count + 1)[1:])
    return np.array(found)


def bricks(
    x: np.ndarray, y: np.ndarray, z: np.ndarray, solid: Callable[[np.ndarray], np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Nodes (n, 3) and bricks (m, 8) of the lattice's cells whose middles are `solid`."""
    shape = (len(x), len(y), len(z))
    places = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1)
    middles = np.stack(np.meshgrid(*(0.5 * (a[1:] + a[:-1]) for a in (x, y, z)), indexing="ij"), axis=-1)
    i, j, k = np.nonzero(solid(middles))
    corner = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    cells = np.stack([np.ravel_multi_index((i + a, j + b, k + c), shape) for a, b, c in corner], axis=1)
    used, packed = np.unique(cells, return_inverse=True)
    return places.reshape(-1, 3)[used], packed.reshape(cells.shape)


def within(p: np.ndarray, *boxes: Box) -> np.ndarray:
    """Whether places (..., 3) lie in one of the boxes."""
    hits = [np.all([(lo < p[..., k]) & (p[..., k] < hi) for k, (lo, hi) in enumerate(box)], axis=0) for box in boxes]
    return np.any(hits, axis=0)


def curve(
    folder: Path,
    nodes: np.ndarray,
    cells: np.ndarray,
    steel: Steel,
    pushed: Sequence[int],
    axis: int,
    way: float,
    increment: float = 0.05,
) -> tuple[np.ndarray, np.ndarray]:
    """Way (m) of the mean of the `pushed` nodes along an axis and the force (N) at the feet, z = 0, at each increment.

    Equal forces act on the nodes. `way` is in mm, large displacements, isotropic hardening along the steel's line.
    """
    E, H = steel.youngs_modulus, steel.youngs_modulus * steel.tangent / (steel.youngs_modulus - steel.tangent)
    feet = np.flatnonzero(nodes[:, 2] < 1e-9) + 1
    own = len(nodes) + 1
    terms = [f"{n + 1}, {axis}, 1." for n in pushed] + [f"{own}, {axis}, {-float(len(pushed))}"]
    rows = ["*NODE, NSET=ALL", *(f"{n + 1}, {a:.9g}, {b:.9g}, {c:.9g}" for n, (a, b, c) in enumerate(nodes))]
    rows += [f"{own}, 0., 0., -100.", "*ELEMENT, TYPE=C3D8I, ELSET=BODY"]
    rows += [f"{m + 1}, " + ", ".join(str(n + 1) for n in cell) for m, cell in enumerate(cells)]
    rows += ["*NSET, NSET=FEET", *(f"{n}," for n in feet)]
    rows += ["*EQUATION", str(len(terms)), *(", ".join(terms[k : k + 4]) for k in range(0, len(terms), 4))]
    rows += ["*MATERIAL, NAME=STEEL", "*ELASTIC", f"{E / 1e6}, {steel.poisson_ratio}", "*PLASTIC"]
    rows += [f"{(steel.yield_strength + H * e) / 1e6}, {e}" for e in (0.0, 0.5)]
    rows += ["*SOLID SECTION, ELSET=BODY, MATERIAL=STEEL", "*BOUNDARY", "FEET, 1, 3"]
    rows += ["*STEP, NLGEOM, INC=500", "*STATIC", f"{increment}, 1., 1e-6, {increment}", "*BOUNDARY"]
    rows += [f"{own}, {axis}, {axis}, {way}", "*NODE PRINT, NSET=FEET, TOTALS=ONLY", "RF", "*END STEP"]
    (folder / "frame.inp").write_text("\n".join(rows) + "\n")
    assert CCX is not None
    done = subprocess.run([CCX, "frame"], cwd=folder, capture_output=True, text=True, timeout=900, check=False)
    text = (folder / "frame.dat").read_text()
    found = re.findall(r"total force.*time\s+(\S+)\s+(\S+)\s+(\S+)\s+(\S+)", text)
    if not found or abs(float(found[-1][0]) - 1.0) > 1e-6:
        raise AssertionError(f"CalculiX did not come to its end: {done.stdout[-500:]}")
    table = np.array(found, dtype=float)
    return 1e-3 * way * table[:, 0], -table[:, axis]
