"""Uneven surfaces: heights by hand, gradients that are those of the heights, planes of elements, bounds for culling."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ground import relief
from ground.surface import (
    Bank,
    Ditch,
    Heightmap,
    Kerb,
    Plane,
    Ramp,
    Slope,
    Sum,
    Surface,
    height,
    is_flat,
    normals,
    tables,
)

MAP = Heightmap(
    heights=tuple(tuple(math.sin(0.3 * i) + 0.1 * j for j in range(40)) for i in range(25)),
    spacing=(0.2, 0.1),
    corner=(-2.0, -1.5),
)
UNEVEN: list[Surface] = [
    Bank(height=2.0, angle_deg=45.0, edge=(1.0, 0.5), direction_deg=30.0),
    Ditch(depth=0.5, bottom=0.4, angle_deg=50.0, direction_deg=20.0),
    Ramp(length=1.5, height=0.457, width=0.6, top=1.0, start=(-1.0, 0.0), direction_deg=12.0),
    Kerb(height=0.15, foot=(0.0, 0.3)),
    MAP,
    Sum(parts=(Slope(angle_deg=10.0), Bank(height=1.0, angle_deg=30.0), Ramp(length=1.0, height=0.3, width=1.0))),
]


def at(surface: Surface, x: float, y: float) -> float:
    return float(height(surface, np.array([x]), np.array([y]))[0])


def test_heights_by_hand() -> None:
    bank = Bank(height=2.0, angle_deg=45.0, edge=(0.0, 1.0))
    assert [at(bank, 5.0, y) for y in (0.0, 1.0, 2.5, 3.0, 9.0)] == pytest.approx([0.0, 0.0, -1.5, -2.0, -2.0])
    ditch = Ditch(depth=0.5, bottom=1.0, angle_deg=45.0)
    assert [at(ditch, 0.0, y) for y in (-2.0, -0.75, 0.0, 0.5, 0.9)] == pytest.approx([0.0, -0.25, -0.5, -0.5, -0.1])
    ramp = Ramp(length=2.0, height=0.5, width=1.0, top=1.0, face_deg=45.0)
    assert [at(ramp, x, 0.0) for x in (-1.0, 1.0, 2.5, 3.2, 4.0)] == pytest.approx([0.0, 0.25, 0.5, 0.3, 0.0])
    assert [at(ramp, 2.5, y) for y in (0.49, -0.7, 1.1)] == pytest.approx([0.5, 0.3, 0.0])
    kerb = Kerb(height=0.2, face_deg=45.0, direction_deg=0.0, foot=(1.0, 0.0))
    assert [at(kerb, x, 7.0) for x in (0.9, 1.1, 3.0)] == pytest.approx([0.0, 0.1, 0.2])


def test_heights_of_a_sum_are_added() -> None:
    parts = UNEVEN[-1].parts  # type: ignore[union-attr]
    x, y = np.random.default_rng(1).uniform(-3, 3, (2, 50))
    np.testing.assert_allclose(height(UNEVEN[-1], x, y), sum(height(part, x, y) for part in parts), atol=1e-12)


def test_a_sum_of_planes_is_a_plane() -> None:
    both = Sum(parts=(Slope(angle_deg=10.0, direction_deg=0.0), Plane()))
    assert is_flat(both)
    assert len(tables(both)[0]) == 0
    assert at(both, 2.0, 1.0) == pytest.approx(2.0 * math.tan(math.radians(10.0)))


@pytest.mark.parametrize("surface", UNEVEN, ids=lambda s: s.kind)
def test_gradients_are_those_of_the_heights(surface: Surface) -> None:
    """Central differences, away from bends (where the one-sided differences disagree)."""
    x, y = np.random.default_rng(2).uniform(-3, 3, (2, 400))
    eps, n = 1e-6, normals(surface, x, y)
    for k, (dx, dy) in enumerate(((eps, 0.0), (0.0, eps))):
        up, here, down = (height(surface, x + s * dx, y + s * dy) for s in (1.0, 0.0, -1.0))
        smooth = np.abs(up - 2 * here + down) < 1e-10
        assert smooth.mean() > 0.9
        np.testing.assert_allclose((-n[:, k] / n[:, 2])[smooth], ((up - down) / (2 * eps))[smooth], atol=1e-6)


@pytest.mark.parametrize("surface", UNEVEN, ids=lambda s: s.kind)
def test_nothing_within_reach_is_higher_than_said(surface: Surface) -> None:
    rng = np.random.default_rng(3)
    for _ in range(50):
        x, y, reach = rng.uniform(-3, 3), rng.uniform(-3, 3), rng.uniform(0.0, 1.5)
        a, r = rng.uniform(0, 2 * math.pi, 200), reach * np.sqrt(rng.uniform(0, 1, 200))
        most = relief.highest(*tables(surface), x, y, reach)
        assert height(surface, x + r * np.cos(a), y + r * np.sin(a)).max() <= most + 1e-9


def test_the_plane_of_an_element() -> None:
    """Tangent where the ground does not bend; across a step no steeper than the step over the element, or 75 deg."""
    plane = np.empty(4)
    bank = tables(Bank(height=5.0, angle_deg=40.0, direction_deg=0.0))
    relief.element_plane(*bank, 1.0, 2.0, 0.05, 0.04, plane)
    a = math.radians(40.0)
    np.testing.assert_allclose(plane, [math.sin(a), 0.0, math.cos(a), 0.0], atol=1e-12)
    kerb = tables(Kerb(height=0.1, face_deg=75.0, direction_deg=0.0, foot=(1.01, 0.0)))
    relief.element_plane(*kerb, 1.0, 2.0, 0.2, 0.2, plane)
    assert -plane[0] / plane[2] == pytest.approx(0.1 / 0.2)
    cliff = Heightmap(heights=((0.0, 0.0), (9.0, 9.0)), spacing=(0.1, 1.0))
    relief.element_plane(*tables(cliff), 0.0, 0.0, 0.1, 0.1, plane)
    assert math.degrees(math.acos(plane[2])) == pytest.approx(75.0)


def test_no_plane_of_an_element_stands_higher_than_said() -> None:
    """Planes at the corners of elements large and small; some stand higher than the ground anywhere near."""
    rng, plane, over = np.random.default_rng(4), np.empty(4), []
    turned = Kerb(height=0.15, face_deg=70.0, direction_deg=40.0)
    for surface in (*UNEVEN, turned):
        for _ in range(400):
            (x, y), (dx, dy) = rng.uniform(-3, 3, 2), rng.uniform(0.02, 0.6, 2)
            ground = relief.highest(*tables(surface), x + 0.5 * dx, y + 0.5 * dy, math.hypot(dx, dy))
            parts, nodes = tables(surface, (dx, dy))
            # half the diagonal is no tolerance: from its centre it reaches the element's corners and nothing beyond
            most = relief.highest(parts, nodes, x + 0.5 * dx, y + 0.5 * dy, 0.5 * math.hypot(dx, dy))
            relief.element_plane(parts, nodes, x, y, dx, dy, plane)
            cx, cy = np.array([x, x + dx, x + dx, x]), np.array([y, y, y + dy, y + dy])
            high = float(((plane[3] - plane[0] * cx - plane[1] * cy) / plane[2]).max())
            assert high <= most + 1e-9, (surface.kind, x, y, dx, dy)
            over.append(high - ground)
    assert max(over) > 0.01


def test_what_is_no_surface_is_refused() -> None:
    with pytest.raises(ValueError, match="not a grid"):
        Heightmap(heights=((0.0, 1.0), (0.0,)), spacing=(1.0, 1.0))
    with pytest.raises(ValueError, match="at least one"):
        Sum(parts=())
    with pytest.raises(ValueError, match="too steep"):
        Ramp(length=0.1, height=1.0, width=1.0)
