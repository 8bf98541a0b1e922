"""Prints the tables: ``pytest -m benchmark tests/benchmarks -s``. Motion is asserted, time never."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

pytest.importorskip("mujoco", reason="the benchmark group is not installed")

from tests.benchmarks import cold_start, elements, side_by_side

pytestmark = [pytest.mark.benchmark, pytest.mark.timeout(3600)]


def test_elements() -> None:
    print()
    rows, demo = elements.report()
    for row in rows:
        numbers = (row.step, row.cost, row.limit_step, row.fall.cost, row.fall.roll, row.roll, row.limit_roll)
        assert all(math.isfinite(x) for x in numbers)
        # the tractor lies on its left side, or is on its way onto its wheels upside down
        assert -math.radians(170.0) < row.roll < -math.radians(60.0)
        # Two integrators of second order, the same contacts. Each contact begins at the end of a step, where the two
        # differ by their errors so far, and then slides and tilts what follows: halving the product's own step moves
        # its end by 0.01 to 0.03 rad and as many metres. Three times that, and a wrong force would be ten times it.
        assert abs(row.roll - row.limit_roll) < 0.1
        assert row.apart < 0.1
        if row.fall.whole:
            assert abs(row.fall.roll) > math.radians(60.0)
    for spacing in (elements.COARSE, elements.FINE):
        same = [r for r in rows if r.case.way == elements.SPACINGS and r.case.spacing == spacing]
        assert {r.touched for r in same} == {same[0].touched}
        # borders of elements are the same numbers but for rounding, which no contact amplifies beyond this
        assert all(abs(r.roll - same[0].roll) < 1e-6 for r in same)
    finer = [r for r in rows if r.case.way == elements.RECTANGLES]
    assert all(a.touched < b.touched for a, b in pairwise(finer))
    for speed in demo:
        assert math.isfinite(speed.peak)
        assert speed.peak > 0.0


def test_cold_start() -> None:
    print()
    first, second = cold_start.report()
    assert first.cpu > 0.0
    assert second.cpu > 0.0


def test_every_engine_side_by_side() -> None:
    print()
    rows = {row.engine: row for row in side_by_side.report(1)}
    assert set(rows) == set(side_by_side.ENGINES)
    for row in rows.values():
        assert row.cost > 0.0
        # the chassis falls by a metre and lies: what a step leaves open is less than a tenth of that
        assert row.moved < 0.1, row
