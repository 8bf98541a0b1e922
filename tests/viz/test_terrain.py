"""The mesh of the ground, against areas, depths and positions worked out by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from ground.array import Elements
from ground.surface import Plane, Slope, normal
from rollover.dynamics.result import GroundTrack
from viz.recordings.terrain import BEYOND, SOIL, corner, cut_open, frames, nice, ramp, terrain, thinned

ARRAY = Elements(length=2.0, width=1.0, centre=(0.5, -0.2), spacing=(0.1, 0.05))  # 20 x 20
TOUCHED = np.array([5 * 20 + 7, 5 * 20 + 8, 12 * 20 + 19, 0], dtype=np.int64)  # two side by side, two on the rim


def area_from_above(vertices: NDArray[np.float64], triangles: NDArray[np.int64]) -> float:
    a, b, c = (vertices[triangles[:, k], :2] for k in range(3))
    (ux, uy), (vx, vy) = (b - a).T, (c - a).T
    return float(0.5 * np.abs(ux * vy - uy * vx).sum())


@pytest.mark.parametrize("count", [20, 400])
def test_moving_and_fixed_parts_cover_the_array_once(count: int) -> None:
    # 400 x 400 is more than is drawn element by element
    array = Elements(length=2.0, width=1.0, centre=(0.5, -0.2), spacing=(2.0 / count, 1.0 / count))
    touched = np.array([3 * count + 4, 3 * count + 5, (count - 1) * count], dtype=np.int64)
    t = terrain(Plane(), array, touched)
    covered = area_from_above(t.fixed, t.fixed_triangles)
    covered += sum(area_from_above(p.base, p.triangles) for p in t.patches)
    assert covered == pytest.approx(2.0 * 1.0, rel=1e-9)
    assert len(t.fixed) < 25_000


def test_soil_beyond_the_array_fills_the_outer_rectangle() -> None:
    t = terrain(Plane(), ARRAY, TOUCHED, outer=(-2.0, 3.0, -1.0, 2.0))
    covered = area_from_above(t.fixed, t.fixed_triangles)
    covered += sum(area_from_above(p.base, p.triangles) for p in t.patches)
    assert covered == pytest.approx(5.0 * 3.0, rel=1e-9)
    beyond = t.fixed[t.fixed_colours == BEYOND]
    assert beyond[:, 0].min() == -2.0
    assert beyond[:, 1].max() == 2.0


@pytest.mark.parametrize("surface", [Plane(), Slope(angle_deg=20.0, direction_deg=90.0)])
def test_a_touched_element_lies_at_its_depth_along_the_normal(surface: Plane | Slope) -> None:
    t = terrain(surface, ARRAY, TOUCHED)
    row = np.array([0.03, 0.01, 0.02, 0.04])
    seen = set()
    for patch in t.patches:
        moved = patch.positions(row) - patch.base
        assert np.all(moved[patch.column == -1] == pytest.approx(0.0, abs=2e-7))
        for k in patch.columns.tolist():
            ix, iy = divmod(int(TOUCHED[k]), 20)
            mine = np.flatnonzero((patch.column == k) & ~patch.is_side)
            # single precision of coordinates of 1 m
            np.testing.assert_allclose(moved[mine], np.tile(-row[k] * normal(surface), (mine.size, 1)), atol=2e-7)
            if mine.size == 4:  # its own square, not only a wall beside a neighbour in the next patch
                assert patch.base[mine, 0].min() == pytest.approx(-0.5 + 0.1 * ix, abs=1e-12)
                assert patch.base[mine, 1].max() == pytest.approx(-0.7 + 0.05 * (iy + 1), abs=1e-12)
                seen.add(k)
    assert seen == {0, 1, 2, 3}


def test_a_wall_joins_neighbours_in_different_patches() -> None:
    both = np.array([11 * 20 + 3, 12 * 20 + 3], dtype=np.int64)  # patches are 12 elements wide
    t = terrain(Plane(), ARRAY, both)
    row = np.array([0.02, 0.05])
    edge = -0.5 + 0.1 * 12
    found = set()
    for patch in t.patches:
        points = patch.positions(row)[patch.triangles]
        for triangle in points[np.ptp(points[:, :, 0], axis=1) < 1e-9]:
            if abs(triangle[0, 0] - edge) < 1e-6 and np.ptp(triangle[:, 2]) > 1e-6:
                found |= {round(float(z), 6) for z in triangle[:, 2]}
    assert found == {-0.02, -0.05}


def test_colour_begins_with_that_of_the_untouched_soil() -> None:
    for patch in terrain(Plane(), ARRAY, TOUCHED).patches:
        assert set(patch.colours(np.zeros(4), 0.05)[~patch.is_side].tolist()) == {SOIL}
    shades = ramp(np.array([0.0, 0.01, 0.03, 0.05, 0.09]), 0.05)
    assert shades[0] == SOIL
    assert len(set(shades.tolist())) == 4  # what is deeper than the scale is as bright as the scale


def test_frames_keep_changes_only_and_how_the_ground_was_left() -> None:
    time = np.arange(0.0, 1.0, 0.001)
    sinkage = np.zeros((time.size, 2))
    sinkage[:, 0] = np.clip(time - 0.3, 0.0, 0.2005)  # changes from 0.3 s to 0.5005 s
    sinkage[:, 1] = np.clip(time - 0.7, 0.0, 0.1)  # another patch
    element = np.array([5 * 20 + 7, 15 * 20 + 7], dtype=np.int64)
    track = GroundTrack(time=time, element=element, sinkage=sinkage)
    early, late = (p for p in terrain(Plane(), ARRAY, element).patches if p.columns.size)
    kept = frames(track, early)
    assert np.diff(time[kept]).min() >= 0.02 - 1e-9
    assert time[kept[0]] >= 0.3
    assert time[kept[-1]] < 0.53
    assert sinkage[kept[-1], 0] == sinkage[-1, 0]
    assert time[frames(track, late)[0]] >= 0.7


def test_frames_of_a_large_picture_are_thinned_to_the_last() -> None:
    time = np.arange(0.0, 4.0, 0.02)
    track = GroundTrack(time=time, element=np.array([27]), sinkage=np.linspace(0.0, 0.1, time.size)[:, None])
    (patch,) = terrain(Plane(), ARRAY, track.element).patches
    large = replace(patch, base=np.zeros((400_000, 3)))
    (kept,) = thinned([frames(track, patch)], [large])
    assert len(kept) * 400_000 <= 8_000_000
    assert kept[-1] == time.size - 1
    empty = GroundTrack(time=np.zeros(0), element=np.zeros(0, dtype=np.int64), sinkage=np.zeros((0, 0)))
    assert frames(empty, patch).size == 0
    assert terrain(Plane(), ARRAY, empty.element).patches == ()


def test_a_section_begins_at_the_first_touched_row() -> None:
    touched = np.array([5 * 20 + 7, 6 * 20 + 12], dtype=np.int64)
    section, moved = cut_open(ARRAY, touched)
    assert section.count == (20, 13)
    assert corner(section) == pytest.approx((-0.5, -0.7 + 7 * 0.05), abs=1e-12)
    assert [divmod(int(e), 13) for e in moved] == [(5, 0), (6, 5)]
    # on the section's face the soil's edge sinks with its element; beside other soil it stays
    t = terrain(Plane(), section, moved, outer=(-1.0, 2.0, corner(section)[1], 1.0))
    assert any(np.any(p.is_side & (p.column == 0)) for p in t.patches)
    closed = terrain(Plane(), section, moved, outer=(-1.0, 2.0, -1.0, 1.0))
    assert not any(np.any(p.is_side & (p.column == 0)) for p in closed.patches)


def test_grid_lies_on_whole_multiples_above_the_surface() -> None:
    t = terrain(Slope(angle_deg=10.0, direction_deg=0.0), ARRAY, TOUCHED, grid_step=0.5)
    along_y = t.grid[np.abs(t.grid[:, 0, 0] - t.grid[:, 1, 0]) < 1e-9]
    lift = 0.004 * 0.5
    x = along_y[:, 0, 0] + lift * math.sin(math.radians(10.0))
    np.testing.assert_allclose(x, [-0.5, 0.0, 0.5, 1.0, 1.5], atol=1e-9)
    gap = along_y[:, 0] @ normal(Slope(angle_deg=10.0, direction_deg=0.0))
    np.testing.assert_allclose(gap, lift, atol=1e-12)


@pytest.mark.parametrize(("value", "expected"), [(0.3, 0.5), (0.5, 0.5), (51.0, 100.0), (1.0, 1.0), (0.0, 1.0)])
def test_nice_numbers(value: float, expected: float) -> None:
    assert nice(value) == pytest.approx(expected, rel=1e-12)
