"""What lies on uneven ground in the picture: the mesh at its breaks, the lines over it; against the surface itself."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from ground.array import Elements
from ground.surface import Bank, Ditch, Kerb, Ramp, Slope, Sum, Surface, height
from viz.recordings.edges import edges
from viz.recordings.terrain import Terrain, terrain

ARRAY = Elements(length=26.0, width=22.0, centre=(5.0, 6.0), spacing=(0.05, 0.05))  # drawn in blocks of 4 by 4
WHOLE = (-8.0, 18.0, -5.0, 17.0)
OUTER = (-6.0, 14.0, -3.0, 14.0)  # what the vehicle reaches
TOUCHED = np.array([440 * 100 + 150, 440 * 300 + 260], dtype=np.int64)
RAMP = Ramp(length=2.4, height=1.0, width=4.0, top=0.5, start=(5.0, 6.0), direction_deg=-60.0)
BANK = Bank(height=2.0, angle_deg=50.0, edge=(0.0, 0.03), direction_deg=90.0)
UNEVEN = [
    BANK,
    Ditch(depth=1.1, bottom=0.5, angle_deg=50.0, centre=(0.0, 3.0), direction_deg=75.0),
    Kerb(height=0.152, face_deg=60.0, foot=(0.0, 2.0), direction_deg=90.0),
    Sum(parts=(Slope(angle_deg=15.0, direction_deg=30.0), RAMP)),
]


def drawn(t: Terrain, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Highest triangle of the mesh over each place, m; the upright ones cover nothing."""
    z = np.full(x.size, -np.inf)
    for vertices, triangles in [(t.fixed, t.fixed_triangles), *((p.base, p.triangles) for p in t.patches)]:
        a = vertices[triangles[:, 0]]
        b, c = vertices[triangles[:, 1]] - a, vertices[triangles[:, 2]] - a
        det = b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0]
        a, b, c, det = (values[np.abs(det) > 1e-12] for values in (a, b, c, det))
        for k in range(x.size):
            dx, dy = x[k] - a[:, 0], y[k] - a[:, 1]
            u, v = (dx * c[:, 1] - dy * c[:, 0]) / det, (b[:, 0] * dy - b[:, 1] * dx) / det
            on = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1.0 + 1e-9)
            z[k] = max(z[k], float((a[:, 2] + u * b[:, 2] + v * c[:, 2])[on].max(initial=-np.inf)))
    return z


@pytest.mark.parametrize("surface", UNEVEN, ids=lambda s: s.kind)
def test_no_line_along_a_break_is_hidden_by_the_mesh(surface: Surface) -> None:
    # a square of s = 5 cm over a hollow whose slope changes by b stands b s/4 above its bottom at most
    t = terrain(surface, ARRAY, TOUCHED, outer=OUTER)
    for line in edges(surface, t.outer, ARRAY.spacing):
        x, y, z = line[3:-3:9].T
        assert np.all(z > drawn(t, x, y))
        # the steepest face, 75 degrees, and a line that runs askew over squares: 2 tan 75 s/4 and the lift of 1.2 cm
        assert np.all(z < height(surface, x, y) + 0.012 + 2.0 * math.tan(math.radians(75.0)) * 0.05 / 4.0)


@pytest.mark.parametrize("surface", UNEVEN, ids=lambda s: s.kind)
def test_grid_and_mesh_follow_the_breaks(surface: Surface) -> None:
    t = terrain(surface, ARRAY, TOUCHED, outer=OUTER, grid_step=1.0)
    rng = np.random.default_rng(0)
    share = rng.uniform(0.02, 0.98, (80, 1))
    ends = t.grid[rng.choice(len(t.grid), 80)]
    x, y, z = (share * ends[:, 0] + (1.0 - share) * ends[:, 1]).T
    # lifted by 4 mm; in a hollow the line has its corners where squares of 5 cm have theirs
    assert np.quantile(z - drawn(t, x, y), 0.05) > 0.003
    places = rng.uniform([WHOLE[0], WHOLE[2]], [WHOLE[1], WHOLE[3]], (150, 2)).T
    off = np.abs(drawn(t, *places) - height(surface, *places))
    # a slope that changes by b in a square of s = 5 cm: b s/4, b = tan 50 here; askew over two squares
    assert off.max() < 2.0 * math.tan(math.radians(50.0)) * 0.05 / 4.0
    assert len(t.fixed) < 25_000 + 2 * 20_000


def test_a_line_of_the_grid_bends_where_the_ground_does() -> None:
    grid = terrain(BANK, ARRAY, TOUCHED, grid_step=1.0).grid
    mine = grid[np.all(np.abs(grid[:, :, 0] - 3.0) < 1e-9, axis=1)]
    y = np.linspace(-5.0, 17.0, 4001)
    z = np.interp(y, [-5.0, *mine[:, 1, 1]], [grid[:, 0, 2].max(), *mine[:, 1, 2]])
    # 4 mm above; between nodes 5 cm apart a corner of tan 50 is cut by tan 50 s/4
    assert np.abs(z - 0.004 - height(BANK, np.full(y.size, 3.0), y)).max() < math.tan(math.radians(50.0)) * 0.05 / 4.0
    assert len(mine) < 10, "and nowhere else"


def test_lines_reach_the_rim_of_the_ground_that_is_drawn() -> None:
    t = terrain(BANK, ARRAY, TOUCHED, outer=OUTER)
    assert t.outer == WHOLE
    for line in edges(BANK, t.outer, ARRAY.spacing):
        assert sorted(line[[0, -1], 0]) == pytest.approx([-8.0, 18.0])


def test_a_ramp_is_outlined_on_the_ground_and_on_top() -> None:
    lines = edges(RAMP, WHOLE)
    face, half, end = 1.0 / math.tan(math.radians(75.0)), 2.0, 2.9
    assert len(lines) == 12, "two rectangles and what joins their corners"
    c, s = math.cos(math.radians(-60.0)), math.sin(math.radians(-60.0))
    found = {tuple(np.round([c * x + s * y, c * y - s * x], 6)) for x, y in _ends(lines) - np.array([5.0, 6.0])}
    low = {(u, v) for u in (0.0, end + face) for v in (-half - face, half + face)}
    high = {(u, v) for u in (2.4, end) for v in (-half, half)}
    assert found == {tuple(np.round(p, 6) + 0.0) for p in low | high}
    for line in lines:
        x, y, z = line.T
        assert np.all(np.abs(z - height(RAMP, x, y)) < 0.02), "its lines lie on it"
        middle, along = line[30, :2], line[-1, :2] - line[0, :2]
        across = 1e-3 * np.array([-along[1], along[0]]) / np.linalg.norm(along)
        beside = [float(height(RAMP, *(middle + side * across)[:, None])[0]) for side in (-1.0, 0.0, 1.0)]
        assert abs(beside[0] - 2.0 * beside[1] + beside[2]) > 1e-4, "there the slope differs on both sides"


def _ends(lines: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    return np.concatenate([line[[0, -1], :2] for line in lines])
