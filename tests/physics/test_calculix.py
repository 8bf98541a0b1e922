"""Frames of beams against the same frames of solid elements in CalculiX: force and deflection within 5 %.

What a beam does not know is in the solids: knees of finite size, walls that flatten, shear. Knees are modelled as stubs
that do not yield, as long as the solid knee is wide; the solids yield there too, which is part of the difference.
"""

from __future__ import annotations

import numpy as np
import pytest

from rollover.spec.sections import Section
from rollover.spec.steel import Steel
from tests.physics import calculix
from tests.physics.calculix import bricks, lines, within
from tests.physics.frames import MILD, bar, pushed

NEEDS = pytest.mark.skipif(calculix.CCX is None, reason="CalculiX is not installed: ccx is not on the path")
STRONG = Steel(name="strong", yield_strength=2.35e9, tensile_strength=2.35e9, uniform_strain=0.2)


def compared(folder, solid, axis, way, section, half, high, wide, off, direction) -> None:
    """Force at equal deflection, and deflection at equal energy, of beams (m) and of solids (mm) `solid`."""
    nodes, cells, at = solid
    x, force = calculix.curve(folder, nodes, cells, MILD, at, axis, way, increment=0.1)
    y = 0.5 * wide
    blk = Section(solid=(2e3 * half, 2e3 * half))
    beams = (
        bar("left", (0.0, y, 0.0), (0.0, y, high - half), section, MILD),
        bar("right", (0.0, -y, 0.0), (0.0, -y, high - half), section, MILD),
        bar("across", (0.0, y - half, high), (0.0, half - y, high), section, MILD),
        bar("a", (0.0, y, high - half), (0.0, y, high), blk, STRONG),
        bar("b", (0.0, -y, high - half), (0.0, -y, high), blk, STRONG),
        bar("c", (0.0, y, high), (0.0, y - half, high), blk, STRONG),
        bar("d", (0.0, -y, high), (0.0, half - y, high), blk, STRONG),
    )
    feet = [(0.0, y, 0.0), (0.0, -y, 0.0)]
    _, _, curve = pushed(
        beams, {(0.0, y - off, high): direction}, feet=feet, most=2e-3 * way * 0.5, step=0.002, segments=12
    )
    own_x, own = np.array([(p.deflection, p.force) for p in curve]).T
    assert np.interp(x, own_x, own) == pytest.approx(force, rel=0.05)
    work = np.concatenate(
        [[0.0], np.cumsum(np.diff(x, prepend=0.0) * 0.5 * (force + np.concatenate([[0.0], force[:-1]])))]
    )
    # the solids' coarser increments cut the corner of their curve: the same rule on the same places for both
    same = np.interp(np.concatenate([[0.0], x]), own_x, own)
    energy = np.concatenate([[0.0], np.cumsum(np.diff(np.concatenate([[0.0], x])) * 0.5 * (same[1:] + same[:-1]))])
    # deflection at which either has taken up an energy; at the last, the beams' may lie beyond the curve
    taken = work[2:-1]
    places = np.concatenate([[0.0], x])
    assert np.interp(taken, energy, places) == pytest.approx(np.interp(taken, work, places), rel=0.05)


@NEEDS
def test_a_portal_of_bars_pushed_sideways(tmp_path) -> None:
    a, high, wide = 30.0, 900.0, 800.0
    h = 0.5 * a
    y, x = lines((a, 4), (wide, 28), (wide + a, 4)) - h, lines((a, 1)) - h
    z = lines((60.0, 6), (high - h - 60.0, 26), (high - h, 6), (high + h, 4))
    posts = ((-h, h), (-h, h), (0.0, high)), ((-h, h), (wide - h, wide + h), (0.0, high))
    nodes, cells = bricks(x, y, z, lambda p: within(p, *posts, ((-h, h), (-h, wide + h), (high - h, high + h))))
    at = np.flatnonzero((abs(nodes[:, 1] + h) < 1e-6) & (abs(nodes[:, 2] - high) < 1e-6))
    bars = Section(solid=(a, a))
    compared(tmp_path, (nodes, cells, at), 2, 100.0, bars, 0.015, 0.9, 0.8, 0.0, (0.0, -1.0, 0.0))


@NEEDS
def test_a_portal_of_bars_pushed_lengthways(tmp_path) -> None:
    """Bending of the posts, bending and torsion of the beam between them."""
    a, high, wide = 30.0, 900.0, 800.0
    h = 0.5 * a
    y, x = lines((a, 3), (wide, 20), (wide + a, 3)) - h, lines((a, 4)) - h
    z = lines((60.0, 4), (high - h, 20), (high + h, 3))
    posts = ((-h, h), (-h, h), (0.0, high)), ((-h, h), (wide - h, wide + h), (0.0, high))
    nodes, cells = bricks(x, y, z, lambda p: within(p, *posts, ((-h, h), (-h, wide + h), (high - h, high + h))))
    place = float(y[np.argmin(abs(y - 0.2 * wide))])
    at = np.flatnonzero((abs(nodes[:, 1] - place) < 1e-6) & (nodes[:, 2] > high - h - 1e-6))
    bars = Section(solid=(a, a))
    compared(tmp_path, (nodes, cells, at), 1, 120.0, bars, 0.015, 0.9, 0.8, 1e-3 * place, (1.0, 0.0, 0.0))


@NEEDS
def test_a_portal_of_square_tubes_pushed_sideways(tmp_path) -> None:
    a, t, high, wide = 60.0, 4.0, 1000.0, 800.0
    h, inner = 0.5 * a, 0.5 * a - t
    wall = lines((t, 1), (a - t, 4), (a, 1))
    x = wall - h
    y = np.concatenate([wall, np.linspace(a, wide, 21)[1:], wide + wall[1:]]) - h
    z = np.concatenate([lines((100.0, 7), (high - h - 100.0, 16), (high - h, 7)), high - h + wall[1:]])
    mid = float(z[np.argmin(abs(z - high))])

    def solid(p: np.ndarray) -> np.ndarray:
        posts = [
            within(p, ((-h, h), (c - h, c + h), (0.0, high - h)))
            & ~within(p, ((-inner, inner), (c - inner, c + inner), (0.0, high - h)))
            for c in (0.0, wide)
        ]
        across = within(p, ((-h, h), (h, wide - h), (high - h, high + h)))
        across &= ~within(p, ((-inner, inner), (h, wide - h), (high - inner, high + inner)))
        knees = [within(p, ((-h, h), (c - h, c + h), (high - h, high + h))) for c in (0.0, wide)]
        return np.any([*posts, across, *knees], axis=0)

    nodes, cells = bricks(x, y, z, solid)
    at = np.flatnonzero((abs(nodes[:, 1] + h) < 1e-6) & (abs(nodes[:, 2] - mid) < 1e-6))
    assert mid == high
    tube = Section(tube=(a, a, t), corners="sharp")
    compared(tmp_path, (nodes, cells, at), 2, 60.0, tube, 0.03, 1.0, 0.8, 0.0, (0.0, -1.0, 0.0))
