"""The law of Ye (2006) at values worked by hand; equation numbers are the paper's."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ground.law import BRANCH, HIDDEN, REFERENCE_AREA, evaluate, touched
from ground.ye import (
    CO_MOVING_FRACTIONS,
    MULTIPLE_CORRELATION,
    Ye2006,
    collision_loss,
    first_branch,
    loss_share,
    mass_fraction,
    real_loss,
    rest_stiffness,
    second_branch,
)

LAW = Ye2006()
BRANCH_SINKAGES = ((1.0, 39.13), (2.0, 31.75), (3.0, 23.95), (3.5, 9.12))  # m/s, mm


def test_eq_4_first_branch() -> None:
    # 1^18.71 = 1
    assert first_branch(LAW, 1.0) == pytest.approx(75_000.0000049, abs=1e-9)
    # 2^18 = 262 144, 2^0.71 = 1.635 804, product 428 816; times 4.9e-6 is 2.101 20
    assert first_branch(LAW, 2.0) == pytest.approx(75_002.1012, abs=1e-4)
    # 18.71 ln 3 = 20.555 036, exp 8.4516e8; times 4.9e-6 is 4141
    assert first_branch(LAW, 3.0) == pytest.approx(79_141.0, abs=1.0)
    # 18.71 ln 3.5 = 23.439 195, exp 1.511 86e10; times 4.9e-6 is 74 081
    assert first_branch(LAW, 3.5) == pytest.approx(149_081.0, abs=1.0)
    assert first_branch(Ye2006(stiffness_scale=1.2), 3.5) == pytest.approx(1.2 * 149_081.0, abs=1.2)


@pytest.mark.parametrize(("speed", "meganewton"), [(4.0, 0.976), (5.0, 58.7), (6.0, 1776.0)])
def test_eq_4_explodes_above_its_range(speed: float, meganewton: float) -> None:
    assert first_branch(LAW, speed) == pytest.approx(meganewton * 1e6, rel=1e-3)


def test_eq_5_second_branch() -> None:
    # 1 mm and no speed: 1e3 * 1300
    assert second_branch(LAW, 1e-3, 0.0) == pytest.approx(1.3e6, rel=1e-12)
    # 10 mm: 10^-0.736 = 0.183 654; 132 kg * 2 m/s / 100 = 2.64, 0.89^2.64 = exp(-2.64 * 0.116 534) = 0.735 172
    assert second_branch(LAW, 0.010, 2.0) == pytest.approx(1.3e6 * 0.183_654 * 0.735_172, rel=1e-5)
    # the mass stands in the exponent: 66 kg at 2 m/s is 132 kg at 1 m/s
    assert second_branch(LAW, 0.010, 2.0, mass=66.0) == pytest.approx(second_branch(LAW, 0.010, 1.0), rel=1e-12)


def test_eq_6_rest_stiffness() -> None:
    # 9.81 * 132 = 1294.92 N
    for sinkage, stiffness in ((0.4364, 2967.0), (0.3266, 3965.0), (0.1631, 7941.0), (0.067435, 19_203.0)):
        assert rest_stiffness(132.0, sinkage) == pytest.approx(stiffness, rel=3e-4)


def test_eqs_7_to_10_energies_and_the_co_moving_mass() -> None:
    # (7) 66 * 12.25 = 808.5; a quarter of the energy comes back at restitution 0.5
    assert real_loss(132.0, 3.5) == pytest.approx(808.5, rel=1e-12)
    assert real_loss(132.0, 3.5, restitution=0.5) == pytest.approx(606.375, rel=1e-12)
    # (8) 132 * 13.2/145.2 = 12; 6.125 * 12 = 73.5
    for speed, loss in ((3.5, 73.5), (3.0, 54.0), (2.0, 24.0), (1.0, 6.0)):
        assert collision_loss(132.0, 13.2, speed) == pytest.approx(loss, rel=1e-12)
    assert collision_loss(132.0, 13.2, 3.5, restitution=0.5) == pytest.approx(55.125, rel=1e-12)
    # (9) 73.5/808.5 = 1/11
    assert loss_share(0.1) == pytest.approx(1.0 / 11.0, rel=1e-12)
    # (10) 0.09/0.91
    assert 100.0 * mass_fraction(0.09) == pytest.approx(9.89, abs=0.005)


@given(share=st.floats(0.0, 0.99))
def test_eq_10_undoes_eq_9(share: float) -> None:
    assert loss_share(mass_fraction(share)) == pytest.approx(share, abs=1e-12)


@pytest.mark.parametrize("share", [-0.01, 1.0, math.nan])
def test_eq_10_refuses_a_share_that_is_none(share: float) -> None:
    with pytest.raises(ValueError, match="at least 0 and less than 1"):
        mass_fraction(share)


@pytest.mark.parametrize(("speed", "millimetres"), BRANCH_SINKAGES)
def test_the_branches_cross_and_the_force_is_continuous(speed: float, millimetres: float) -> None:
    change = float(touched(LAW, speed=speed)[BRANCH])
    assert 1e3 * change == pytest.approx(millimetres, abs=0.005)
    assert first_branch(LAW, speed) == pytest.approx(second_branch(LAW, change, speed), rel=1e-12)
    before, after = (evaluate(LAW, change * (1.0 + side), speed=speed) for side in (-1e-9, 1e-9))
    assert before == pytest.approx(after, rel=1e-8)
    # K' is the smaller one: the first branch above, the second below
    assert evaluate(LAW, 0.5 * change, speed=speed) == pytest.approx(first_branch(LAW, speed) * 0.5 * change)
    deep = 2.0 * change
    assert evaluate(LAW, deep, speed=speed) == pytest.approx(second_branch(LAW, deep, speed) * deep)


@pytest.mark.parametrize("speed", [0.0, 1.0, 3.5, 6.0, 20.0])
def test_the_force_comes_up_from_nothing_without_a_bad_number(speed: float) -> None:
    """K_b2 is infinite at z = 0 but the force is not; above the calibrated speeds K_b1 is very stiff."""
    depths = [0.0, -1e-3, *np.logspace(-320, -1, 640)]
    forces = np.array([evaluate(LAW, float(z), speed=speed) for z in depths])
    assert np.all(np.isfinite(forces))
    assert list(forces[:2]) == [0.0, 0.0]
    assert np.all(np.diff(forces[2:]) >= 0.0)
    assert forces[2] < 1e-60


# an error inside compiled code is only printed: make it heard
@pytest.mark.filterwarnings("error::pytest.PytestUnraisableExceptionWarning")
def test_a_constant_second_branch_has_no_change_of_branch() -> None:
    law = Ye2006(sinkage_exponent=0.0)
    assert touched(law, speed=2.0)[BRANCH] == math.inf
    assert evaluate(law, 0.1, speed=2.0) == pytest.approx(7500.21, abs=0.01)


@settings(max_examples=300, deadline=None)
@given(
    z=st.floats(0.0, 1.0),
    speed=st.floats(0.0, 8.0),
    mass=st.floats(1.0, 5000.0),
    scale=st.floats(0.1, 10.0),
)
def test_the_compiled_force_is_the_equations(z: float, speed: float, mass: float, scale: float) -> None:
    law = Ye2006(stiffness_scale=scale)
    expected = 0.0
    if z > 0.0:
        expected = min(first_branch(law, speed), second_branch(law, z, speed, mass)) * z  # (3)
    assert evaluate(law, z, speed=speed, mass=mass) == pytest.approx(expected, rel=1e-11, abs=1e-300)


@settings(max_examples=50, deadline=None)
@given(rate=st.floats(-10.0, 10.0))
def test_the_damping_is_folded_into_the_stiffness(rate: float) -> None:
    """Eq (3): the sinkage rate itself does not enter."""
    assert evaluate(LAW, 0.05, rate, speed=3.0) == evaluate(LAW, 0.05, speed=3.0)


def test_where_the_numbers_come_from() -> None:
    domain = LAW.domain
    assert (domain.speed_least, domain.speed_most, domain.momentum_most) == (1.0, 3.5, 462.0)
    assert domain.area == REFERENCE_AREA == pytest.approx(0.0063)
    assert domain.virgin_only
    assert MULTIPLE_CORRELATION == 0.923
    # Table 1
    assert CO_MOVING_FRACTIONS == {
        "ye-2006": 0.1,
        "lorenz-1934-low": 4.0,
        "lorenz-1934-high": 10.0,
        "kundt-1987": 0.33,
        "kroeber-1988": 0.1,
        "pietzsch-1991": 0.107,
    }


def test_the_literal_eq_6_is_a_mode_of_its_own() -> None:
    assert not LAW.unloads_at_rest_stiffness
    assert Ye2006(unloading="rest-stiffness").unloads_at_rest_stiffness


@settings(max_examples=200, deadline=None)
@given(
    share=st.floats(1e-3, 1.2),
    speed=st.floats(0.1, 3.5),
    exponent=st.floats(-0.99, -1e-3),
)
def test_what_spares_the_power_changes_no_bit(share: float, speed: float, exponent: float) -> None:
    law = Ye2006(sinkage_exponent=exponent)
    s = touched(law, speed=speed)
    first, second = float(s[HIDDEN]), float(s[HIDDEN + 1])
    z = share * float(s[BRANCH])
    if not 1e-12 < z < 1e6:
        return  # where the powers leave what numbers hold
    force = evaluate(law, z, speed=speed)
    if share < 1.0 - 1e-9 / abs(exponent):
        assert force == first * z
    elif share > 1.0 + 1e-9 / abs(exponent):
        assert force == pytest.approx(second * z ** (1.0 + exponent), rel=1e-13)
        assert force < first * z
