"""The table of named soils."""

from __future__ import annotations

import math

import pytest

from ground.law import evaluate
from ground.soils import log_scatter, soils
from ground.ye import Ye2006


def test_every_soil_says_where_it_comes_from() -> None:
    for name, soil in soils().items():
        assert soil.name == name
        assert soil.title
        assert len(soil.source) > 20
        assert soil.confidence in ("printed", "derived", "recalled")
        assert evaluate(soil.law, 0.05, 1.0, speed=2.0) > 0.0


def test_natural_clay_is_the_printed_law() -> None:
    clay = soils()["natural-clay"]
    assert clay.law == Ye2006()
    assert clay.confidence == "printed"


def test_soft_and_stiff_clay_stand_one_deviation_either_side() -> None:
    table = soils()
    forces = [evaluate(table[f"natural-clay{end}"].law, 0.1, speed=2.0) for end in ("-soft", "", "-stiff")]
    low, high = math.log(forces[1] / forces[0]), math.log(forces[2] / forces[1])
    assert low == pytest.approx(high, rel=1e-12)
    assert low == pytest.approx(log_scatter(), rel=1e-12)


def test_the_scatter_follows_from_the_multiple_correlation() -> None:
    """sd of the residual over sd of what is explained is sqrt(1 - 0.923^2)/0.923 = 0.416 90; sd(ln K_b2) 0.650."""
    assert log_scatter() == pytest.approx(0.4169 * 0.650, rel=2e-3)
    # the mean of the spread is settled, not an effect of how finely the curves are sampled
    assert log_scatter(2000) == pytest.approx(log_scatter(), rel=0.01)
