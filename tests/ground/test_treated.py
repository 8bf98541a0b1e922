"""Treated ground: the written equation against the compiled one, and what must not matter to it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ground.law import BRANCH, evaluate, touched
from ground.treated import Treated

LAW = Treated(
    speed_coefficient=20e3,
    speed_exponent=2.0,
    first_stiffness=400e3,
    second_stiffness=6e6,
    sinkage_exponent=-0.5,
    speed_decay=0.1,
)


def test_both_branches_by_hand() -> None:
    # 2 m/s: a v^n + b = 480 kN/m; c exp(-0.2) = 4.912 385 MN/m; they cross at (4.912 385/0.48)^2 = 104.737 mm
    change = float(touched(LAW, speed=2.0)[BRANCH])
    assert change == pytest.approx(0.104_737, rel=1e-5)
    assert evaluate(LAW, 0.010, speed=2.0) == pytest.approx(4800.0, rel=1e-12)
    # 400 mm: 4.912 385e6/20 * 0.4
    assert evaluate(LAW, 0.400, speed=2.0) == pytest.approx(98_247.7, rel=1e-6)
    before, after = (evaluate(LAW, change * (1.0 + side), speed=2.0) for side in (-1e-9, 1e-9))
    assert before == pytest.approx(after, rel=1e-8)


@settings(max_examples=300, deadline=None)
@given(
    z=st.floats(0.0, 1.0),
    speed=st.floats(0.0, 10.0),
    exponent=st.one_of(st.just(0.0), st.floats(-0.95, -0.01), st.floats(0.01, 3.0)),
    decay=st.floats(0.0, 2.0),
    n=st.floats(0.0, 6.0),
)
def test_the_compiled_force_is_the_equation(z: float, speed: float, exponent: float, decay: float, n: float) -> None:
    law = Treated(
        speed_coefficient=20e3,
        speed_exponent=n,
        first_stiffness=400e3,
        second_stiffness=6e6,
        sinkage_exponent=exponent,
        speed_decay=decay,
    )
    expected = 0.0
    if z > 0.0:
        expected = min(20e3 * speed**n + 400e3, 6e6 * (1e3 * z) ** exponent * math.exp(-decay * speed)) * z
    assert evaluate(law, z, speed=speed) == pytest.approx(expected, rel=1e-11, abs=1e-300)
    change = float(touched(law, speed=speed)[BRANCH])
    if exponent == 0.0:
        assert change == math.inf
        return
    # both branches are one: ln(1e3 z) = (ln first - ln second)/k
    crossing = (math.log((20e3 * speed**n + 400e3) / 6e6) + decay * speed) / exponent
    if abs(crossing) < 300.0:
        assert change == pytest.approx(1e-3 * math.exp(crossing), rel=1e-9)


@given(mass=st.floats(0.01, 1e5), rate=st.floats(-5.0, 5.0))
@settings(max_examples=50, deadline=None)
def test_only_speed_and_sinkage_matter(mass: float, rate: float) -> None:
    assert evaluate(LAW, 0.2, rate, speed=3.0, mass=mass) == evaluate(LAW, 0.2, speed=3.0)
    assert evaluate(LAW, 0.2, speed=3.0) != evaluate(LAW, 0.2, speed=3.1)


@pytest.mark.parametrize("speed", [0.0, 2.0, 1e4])
def test_no_bad_number_at_the_surface_or_at_absurd_speed(speed: float) -> None:
    """At 1e4 m/s the second branch has decayed to nothing at all."""
    forces = [evaluate(LAW, z, speed=speed) for z in (-1.0, 0.0, 1e-320, 1e-12, 0.1)]
    assert np.all(np.isfinite(forces))
    assert forces[:2] == [0.0, 0.0]
    assert not math.isnan(touched(LAW, speed=speed)[BRANCH])


def test_the_coefficients_are_the_users() -> None:
    with pytest.raises(TypeError, match="missing 6 required keyword-only arguments"):
        Treated()  # type: ignore[call-arg]
