"""Points that stand for surfaces: areas add up, corners are among them, normals look out."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rollover.spec.shapes import Box, Disc, Points, Tube, cone, sample


@pytest.mark.parametrize("spacing", [0.5, 0.07, 0.02])
def test_box(spacing: float) -> None:
    box = Box(name="b", low=(-0.3, 0.1, 0.0), high=(0.5, 0.4, 1.2))
    patches = sample(box, spacing)
    assert sum(p.area.sum() for p in patches) == pytest.approx(2 * (0.8 * 0.3 + 0.3 * 1.2 + 0.8 * 1.2), rel=1e-12)
    points = np.concatenate([p.position for p in patches])
    assert points.max(axis=0) == pytest.approx(box.high, abs=1e-8)
    assert points.min(axis=0) == pytest.approx(box.low, abs=1e-8)
    middle = 0.5 * (np.array(box.low) + np.array(box.high))
    for patch in patches:
        assert patch.is_flat
        assert np.all(np.einsum("ij,ij->i", patch.position - middle, patch.normal) > 0)


def test_tube_projects_to_its_width() -> None:
    """Half of the wall faces down; its projection is length times diameter."""
    tube = Tube(name="t", start=(0, 0, 0), end=(0, 2.0, 0), diameter=0.08)
    wall, *ends = sample(tube, 0.01)
    assert wall.area.sum() == pytest.approx(math.pi * 0.08 * 2.0, rel=1e-12)
    assert (wall.area * np.maximum(-wall.normal[:, 2], 0)).sum() == pytest.approx(2.0 * 0.08, rel=5e-3)
    assert [round(float(e.normal[0, 1])) for e in ends] == [-1, 1]
    assert sum(e.area.sum() for e in ends) == pytest.approx(2 * math.pi * 0.04**2, rel=1e-12)


def test_disc_reaches_its_rim() -> None:
    disc = Disc(name="d", centre=(1, 2, 3), normal=(0, 1, 0), radius=0.5)
    (patch,) = sample(disc, 0.05)
    assert patch.area.sum() == pytest.approx(math.pi * 0.25, rel=1e-12)
    assert np.linalg.norm(patch.position - [1, 2, 3], axis=1).max() == pytest.approx(0.5, abs=1e-8)
    assert patch.position[:, 1] == pytest.approx(2.0)


def test_impossible_shapes_are_refused() -> None:
    with pytest.raises(ValueError, match="beyond low"):
        Box(name="b", low=(0, 0, 0), high=(1, 0, 1))
    with pytest.raises(ValueError, match="same as start"):
        Tube(name="t", start=(1, 1, 1), end=(1, 1, 1), diameter=0.1)


def test_points_are_themselves_and_face_every_way() -> None:
    (patch,) = sample(Points(name="corners", at=((0.1, 0.2, 0.3), (0.0, 0.0, 1.0)), area=0.02), 0.01)
    assert patch.position.tolist() == [[0.1, 0.2, 0.3], [0.0, 0.0, 1.0]]
    assert not patch.normal.any()
    assert patch.area.tolist() == [0.02, 0.02]


def test_a_cone_has_its_area_and_faces_outward() -> None:
    r, h = 0.3, 0.4
    patch = cone(np.array([1.0, 2.0, 3.0]), r, h, 0.01)
    # seen along the axis: its base
    assert float(-patch.normal[:, 2] @ patch.area) == pytest.approx(math.pi * r**2, rel=1e-9)
    # mantle pi r sqrt(r^2 + h^2), the point at the tip stands flat
    assert float(patch.area.sum()) == pytest.approx(math.pi * r * 0.5, rel=1e-3)
    above = patch.position - [1.0, 2.0, 3.0]
    assert np.hypot(above[:, 0], above[:, 1]) == pytest.approx(above[:, 2] * r / h, abs=1e-12)
    assert np.linalg.norm(patch.normal, axis=1) == pytest.approx(1.0)
    assert np.all(np.sum(patch.normal[1:] * above[1:], axis=1) == pytest.approx(0.0, abs=1e-12))


def test_pieces_are_all_of_a_patch() -> None:
    whole = sample(Box(name="b", low=(-0.3, 0.1, 0.0), high=(0.5, 0.4, 1.2)), 0.05)[0]
    pieces = whole.pieces(0.25)
    assert len(pieces) > 4
    for piece in pieces:
        assert np.all(np.ptp(piece.position, axis=0) <= 0.25)
    rows = [np.column_stack([p.position, p.normal, p.area]) for p in (whole, *pieces)]
    assert np.array_equal(np.unique(rows[0], axis=0), np.unique(np.concatenate(rows[1:]), axis=0))
    assert sum(len(p.area) for p in pieces) == len(whole.area)


def test_a_shape_that_is_met_again_keeps_its_points() -> None:
    one, again, finer = (sample(Box(name="b", low=(0, 0, 0), high=(1, 1, 1)), h) for h in (0.1, 0.1, 0.05))
    assert again is one
    assert len(finer[0].area) > len(one[0].area)
    low, high = one[0].corners
    np.testing.assert_array_equal(low, one[0].position.min(axis=0))
    np.testing.assert_array_equal(high, one[0].position.max(axis=0))
