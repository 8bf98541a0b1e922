"""The mesh of the ground, against areas, depths and positions worked out by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from ground.array import Elements
from ground.surface import Plane, Slope, normal
from rollover.run import GroundTrack
from viz.terrain import BEYOND, SOIL, corner, cut_open, frames, nice, ramp, terrain

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
    covered = area_from_above(t.fixed, t.fixed_triangles) + area_from_above(t.base, t.triangles)
    assert covered == pytest.approx(2.0 * 1.0, rel=1e-9)
    assert len(t.fixed) < 25_000


def test_soil_beyond_the_array_fills_the_outer_rectangle() -> None:
    t = terrain(Plane(), ARRAY, TOUCHED, outer=(-2.0, 3.0, -1.0, 2.0))
    covered = area_from_above(t.fixed, t.fixed_triangles) + area_from_above(t.base, t.triangles)
    assert covered == pytest.approx(5.0 * 3.0, rel=1e-9)
    beyond = t.fixed[t.fixed_colours == BEYOND]
    assert beyond[:, 0].min() == -2.0
    assert beyond[:, 1].max() == 2.0


@pytest.mark.parametrize("surface", [Plane(), Slope(angle_deg=20.0, direction_deg=90.0)])
def test_a_touched_element_lies_at_its_depth_along_the_normal(surface: Plane | Slope) -> None:
    t = terrain(surface, ARRAY, TOUCHED)
    row = np.array([0.03, 0.01, 0.02, 0.04])
    moved = t.positions(row) - t.base
    for k, element in enumerate(TOUCHED.tolist()):
        ix, iy = divmod(element, 20)
        x, y = -0.5 + 0.1 * ix, -0.7 + 0.05 * iy
        mine = np.flatnonzero((t.column == k) & ~t.is_side)
        assert mine.size == 4
        assert t.base[mine, 0].min() == pytest.approx(x, abs=1e-12)
        assert t.base[mine, 1].max() == pytest.approx(y + 0.05, abs=1e-12)
        # single precision of coordinates of 1 m
        np.testing.assert_allclose(moved[mine], np.tile(-row[k] * normal(surface), (4, 1)), atol=2e-7)
    assert np.all(moved[(t.column == -1)] == pytest.approx(0.0, abs=2e-7))


def test_colour_begins_with_that_of_the_untouched_soil() -> None:
    t = terrain(Plane(), ARRAY, TOUCHED)
    assert set(t.colours(np.zeros(4), 0.05)[~t.is_side].tolist()) == {SOIL}
    shades = ramp(np.array([0.0, 0.01, 0.03, 0.05, 0.09]), 0.05)
    assert shades[0] == SOIL
    assert len(set(shades.tolist())) == 4  # what is deeper than the scale is as bright as the scale


def test_frames_keep_changes_only_and_how_the_ground_was_left() -> None:
    time = np.arange(0.0, 1.0, 0.001)
    sinkage = np.zeros((time.size, 2))
    sinkage[:, 0] = np.clip(time - 0.3, 0.0, 0.2005)  # changes from 0.3 s to 0.5005 s
    kept = frames(GroundTrack(time=time, element=np.array([3, 4]), sinkage=sinkage), 8)
    assert np.diff(time[kept]).min() >= 0.02 - 1e-9
    assert time[kept[0]] >= 0.3
    assert time[kept[-1]] < 0.53
    np.testing.assert_array_equal(sinkage[kept[-1]], sinkage[-1])


def test_frames_of_a_large_array_are_thinned_but_the_last_stays() -> None:
    time = np.arange(0.0, 4.0, 0.02)
    sinkage = np.linspace(0.0, 0.1, time.size)[:, None]
    track = GroundTrack(time=time, element=np.array([3]), sinkage=sinkage)
    kept = frames(track, 400_000)
    assert len(kept) * 400_000 <= 8_000_000
    assert kept[-1] == time.size - 1
    empty = GroundTrack(time=np.zeros(0), element=np.zeros(0, dtype=np.int64), sinkage=np.zeros((0, 0)))
    assert frames(empty, 0).size == 0


def test_section_begins_at_the_first_touched_row_and_keeps_places() -> None:
    touched = np.array([5 * 20 + 7, 6 * 20 + 12], dtype=np.int64)
    section, moved = cut_open(ARRAY, touched)
    assert section.count == (20, 13)
    assert corner(section) == pytest.approx((-0.5, -0.7 + 7 * 0.05), abs=1e-12)
    assert [divmod(int(e), 13) for e in moved] == [(5, 0), (6, 5)]
    # on the section's face the soil's edge sinks with its element; beside other soil it stays
    t = terrain(Plane(), section, moved, outer=(-1.0, 2.0, corner(section)[1], 1.0))
    assert np.any(t.is_side & (t.column == 0))
    closed = terrain(Plane(), section, moved, outer=(-1.0, 2.0, -1.0, 1.0))
    assert not np.any(closed.is_side & (closed.column == 0))


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
