"""The generator's solver: the published table, the energy ledger, and what each effect leaves in the channels."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from rollover.proof.reference_solver import CHANNELS, FREE, HELD, LOADING, Descent, descend
from rollover.proof.rig import Rig, loading_curve
from tests.ground.reference_drop import solve

FORCE, DEPTH, PLACE, SPEED, ACCELERATION = CHANNELS
# v_s: z_max mm, its time ms, peak F_s N, as the reference prints them
TABLE = {3.5: (436.4, 237, 3551), 3.0: (326.6, 205, 3552), 2.0: (163.1, 148, 3452), 1.0: (67.4, 105, 3198)}
TIMES = np.linspace(-0.05, 0.6, 1301)
BEFORE = TIMES < 0.0


def fall(**changed: Any) -> Descent:
    return descend(Rig(**changed), -0.06, 0.62)


@pytest.fixture(scope="module")
def nothing() -> dict[str, Any]:
    return fall().channels(TIMES)


@pytest.mark.parametrize("speed", TABLE)
def test_the_table_of_the_drop_test(speed: float) -> None:
    drop = fall(speed=speed)
    at, depth = drop.deepest()
    peak = drop.channels(np.array([at - 1e-9]))[FORCE][0]
    z_max, ms, newton = TABLE[speed]
    assert depth == pytest.approx(1e-3 * z_max, rel=1e-3)
    assert at == pytest.approx(1e-3 * ms, rel=3e-3)  # printed to a millisecond
    assert peak == pytest.approx(newton, rel=1e-3)
    assert drop.impulse == pytest.approx(132.0 * speed * (1.0 - 1.0 / 1.1), rel=1e-12)


@pytest.mark.parametrize("speed", TABLE)
def test_every_sample_of_an_independent_solution(speed: float) -> None:
    reference, drop = solve(speed), fall(speed=speed)
    t = np.linspace(1e-6, reference.t_max - 1e-6, 400)
    got = drop.channels(t)
    np.testing.assert_allclose(got[DEPTH], reference.z(t), rtol=0, atol=1e-7)
    np.testing.assert_allclose(got[SPEED], -reference.v(t), rtol=0, atol=1e-6)
    np.testing.assert_allclose(got[FORCE], reference.load_cell(t), rtol=0, atol=1e-2)
    np.testing.assert_allclose(got[ACCELERATION], -reference.a(t), rtol=0, atol=1e-4)


ENERGIES = {
    "nothing": {},
    "viscous": {"damping": 900.0, "exponent": 1.2},
    "drag": {"drag": 40.0},
    "growth": {"growth": 40.0},
    "rebound": {"recovery": 0.15, "unloading_ratio": 0.1},
    "adhesion": {"recovery": 0.15, "unloading_ratio": 0.1, "pull": 500.0},
    "layer": {"layer_depth": 0.1, "layer_ratio": 2.0},
    "guide": {"guide": 150.0},
    "memory": {"relaxing": 1e4, "relaxation": 0.03},
}


@pytest.mark.parametrize("name", ENERGIES)
def test_the_energy_ledger_closes(name: str) -> None:
    """What comes in is what is there, what was lost in exchanges of momentum, and what forces took.

    1/2 m v_s^2 + m g x = 1/2 (m + m_b1) v^2 + lost + int F v dt + int R v dt + int 1/2 (dm_b1/dt) v^2 dt: the soil
    that joins at rest takes half of its momentum flux times v with it. Soil that stays behind keeps its own.
    """
    drop = fall(**ENERGIES[name])
    rig, taken = drop.rig, drop.lost
    for stage in drop.stages[1:]:
        nodes, weights = np.polynomial.legendre.leggauss(200)
        t = stage.start + 0.5 * (stage.end - stage.start) * (nodes + 1.0)
        powers = []
        for at, y in zip(t, np.asarray(stage.state(t)).T, strict=True):
            v = y[1] / (rig.nose + stage.moving(y[0]))
            power = stage.ground(at, y[0], v, y[4]) * v + rig.guide * abs(v)
            powers.append(power + 0.5 * (stage.growth * v * v) * v)
        taken += 0.5 * (stage.end - stage.start) * float(weights @ np.array(powers))
        end = np.asarray(stage.state(stage.end))
        moving = stage.moving(end[0])
        v = end[1] / (rig.nose + moving)
        following = drop.stages[drop.stages.index(stage) + 1 :]
        if following and following[0].mode == FREE:
            taken += 0.5 * moving * v * v
    brought = 0.5 * rig.mass * rig.speed**2 + rig.mass * rig.gravity * end[0]
    # at the end of the record the striker rests, or moves with what is left
    last = 0.5 * (rig.nose + (moving if drop.stages[-1].mode != FREE else 0.0)) * v * v
    assert taken + last == pytest.approx(brought, rel=2e-5)


def test_damping_grows_with_speed_and_ends_with_it(nothing: dict[str, Any]) -> None:
    damped, square = loading_curve(Rig(damping=800.0), 3.0), loading_curve(Rig(drag=50.0), 3.0)
    bare = loading_curve(Rig(), 3.0)
    for v in (0.5, 1.0, 2.0):
        assert damped(0.0, 0.1, v) - bare(0.0, 0.1, v) == pytest.approx(800.0 * v)
        assert square(0.0, 0.1, v) - bare(0.0, 0.1, v) == pytest.approx(50.0 * v * v)
    assert damped(0.0, 0.1, 0.0) == bare(0.0, 0.1, 0.0)
    for changed in ({"damping": 800.0}, {"drag": 50.0}, {"per_decade": 0.1}, {"growth": 40.0}):
        got = fall(**changed).channels(TIMES)
        assert got[DEPTH].max() < 0.99 * nothing[DEPTH].max()
        assert got[FORCE][110] > 1.02 * nothing[FORCE][110]  # early
        assert got[FORCE][-1] == pytest.approx(132.0 * 9.81, rel=1e-3)  # at rest


def test_rate_hardening_scales_with_the_force() -> None:
    bare, hard = loading_curve(Rig(), 3.0), loading_curve(Rig(per_decade=0.1), 3.0)
    for z in (0.02, 0.2):
        assert hard(0.0, z, 1.0) / bare(0.0, z, 1.0) == pytest.approx(1.2)
        assert hard(0.0, z, 0.1) / bare(0.0, z, 0.1) == pytest.approx(1.1)
        assert hard(0.0, z, 0.009) == bare(0.0, z, 0.009)
        assert hard(0.0, z, 0.015) / bare(0.0, z, 0.015) == pytest.approx(1.0 + 0.1 * math.log10(1.5))


def test_growing_mass_leaves_the_first_impulse_alone() -> None:
    assert fall(growth=40.0).impulse == fall().impulse
    assert fall(fraction=0.2).impulse > 1.5 * fall().impulse


def test_rebound_shows_only_after_the_deepest_point(nothing: dict[str, Any]) -> None:
    drop = fall(recovery=0.1, unloading_ratio=0.1)
    got = drop.channels(TIMES)
    until = drop.deepest()[0]
    down = until > TIMES
    for channel in CHANNELS:
        np.testing.assert_array_equal(got[channel][down], nothing[channel][down])
    assert got[SPEED].max() > 4.0 * nothing[SPEED].max() > 0.0  # upward


def test_adhesion_needs_a_pull_out(nothing: dict[str, Any]) -> None:
    for channel, values in fall(pull=600.0).channels(TIMES).items():
        np.testing.assert_array_equal(values, nothing[channel])
    lifted = {"recovery": 0.1, "unloading_ratio": 0.1}
    held, free = fall(**lifted, pull=600.0).channels(TIMES), fall(**lifted).channels(TIMES)
    assert held[FORCE].min() < -200.0
    assert free[FORCE].min() >= 0.0


@pytest.mark.parametrize("speed", [1.5, 3.0])
def test_a_layer_is_met_at_its_depth_whatever_the_speed(speed: float) -> None:
    got = fall(speed=speed, layer_depth=0.06, layer_ratio=2.0).channels(TIMES)
    plain = fall(speed=speed).channels(TIMES)
    first = int(np.argmax(np.abs(got[FORCE] - plain[FORCE]) > 1.0))
    assert got[DEPTH][first - 1] <= 0.06 <= got[DEPTH][first]


def test_a_crust_ends_at_its_depth() -> None:
    bare, crust = loading_curve(Rig(), 3.0), loading_curve(Rig(crust_depth=0.03, crust_ratio=1.7), 3.0)
    assert crust(0.0, 0.0299, 1.0) == pytest.approx(1.7 * bare(0.0, 0.0299, 1.0))
    assert crust(0.0, 0.0301, 1.0) == bare(0.0, 0.0301, 1.0)


def test_a_striker_in_two_parts_rings_at_its_own_frequency() -> None:
    """Behind the first contact the body hangs on the spring: m' = m_n m_b/(m_n + m_b) with the soil in the nose.

    The pull holds the soil on the nose, which else leaves it in the first swing.
    """
    k = 6e7
    drop = fall(spring=k, dashpot=0.5, pull=1e9)
    t = np.linspace(1e-4, 0.05, 5000)
    a = drop.channels(t)[ACCELERATION]
    assert drop.channels(np.array([1e-10]))[ACCELERATION][0] == pytest.approx(-9.81, abs=0.01)  # the body is not hit
    nose, body = 13.2 + 13.2, 118.8
    expected = math.sqrt(k * (nose + body) / (nose * body)) / (2.0 * math.pi)
    period = round(1.0 / expected / (t[1] - t[0]))
    swing = a - np.convolve(a, np.ones(period) / period, mode="same")
    crossings = t[1:][(swing[1:] > 0) & (swing[:-1] <= 0)][2:-2]
    assert 1.0 / float(np.mean(np.diff(crossings))) == pytest.approx(expected, rel=0.05)


def test_a_stiff_striker_in_two_parts_is_one_block(nothing: dict[str, Any]) -> None:
    """With a pull that holds the soil on the nose: else the first swing leaves it behind, and its momentum with it."""
    drop = fall(spring=4e7, dashpot=2000.0, pull=1e9)
    down = drop.deepest()[0] > TIMES
    assert np.max(np.abs(drop.channels(TIMES)[PLACE] - nothing[PLACE])[down]) < 1e-3
    left = fall(spring=4e7, dashpot=2000.0).channels(TIMES)
    assert np.max(np.abs(left[PLACE] - nothing[PLACE])[down]) > 0.01
    np.testing.assert_array_equal(left[PLACE][BEFORE], nothing[PLACE][BEFORE])


def test_friction_shows_in_the_fall(nothing: dict[str, Any]) -> None:
    got = fall(guide=66.0).channels(TIMES)
    np.testing.assert_allclose(got[ACCELERATION][BEFORE], -(9.81 - 0.5), rtol=1e-12)
    np.testing.assert_allclose(nothing[ACCELERATION][BEFORE], -9.81, rtol=1e-12)
    air = fall(air=0.5 * 1.2 * 0.1).channels(TIMES)
    for channel in CHANNELS:
        assert np.max(np.abs(air[channel] - nothing[channel])) < 2e-3 * np.ptp(nothing[channel])


def test_side_load_takes_a_share_of_what_accelerates() -> None:
    """In the fall m a = m g - r m a; braked, m a = m g - F + r m |a|: sign by sign."""
    got = fall(side_load=0.1).channels(TIMES)
    np.testing.assert_allclose(got[ACCELERATION][BEFORE], -9.81 / 1.1, rtol=1e-12)
    lifted = fall(side_load=0.1, recovery=0.3, unloading_ratio=0.05)
    rising = next(s for s in lifted.stages[1:] if s.mode == FREE)
    up = lifted.channels(np.array([rising.start + 1e-6]))
    assert up[SPEED][0] > 0.1
    assert up[ACCELERATION][0] == pytest.approx(-9.81 / 0.9)


def test_soil_that_relaxes_forgets(nothing: dict[str, Any]) -> None:
    drop = fall(relaxing=1e4, relaxation=0.03)
    got = drop.channels(TIMES)
    assert abs(drop.stages[-1].state(0.6)[4]) < 1e-3
    assert got[FORCE][130] > 1.1 * nothing[FORCE][130]
    assert got[FORCE][-1] == pytest.approx(132.0 * 9.81, rel=1e-3)


NULLS: dict[str, dict[str, float]] = {
    "damping": {"damping": 0.0, "exponent": 1.3},
    "rate": {"per_decade": 0.0, "slow": 0.02},
    "drag": {"drag": 0.0, "drag_exponent": 1.9},
    "growth": {"growth": 0.0},
    "rebound": {"recovery": 0.02, "unloading_ratio": 1.0},
    "adhesion": {"pull": 0.0, "reach": 0.01},
    "layer": {"layer_depth": 0.1, "layer_ratio": 1.0},
    "crust": {"crust_depth": 0.03, "crust_ratio": 1.0},
    "compliance": {"spring": 0.0, "dashpot": 300.0, "nose_share": 0.2},
    "guide": {"guide": 0.0},
    "air": {"air": 0.0},
    "memory": {"relaxing": 0.0, "relaxation": 0.05},
    "side load": {"side_load": 0.0},
}


@pytest.mark.parametrize("name", NULLS)
def test_no_strength_is_no_effect_to_the_last_bit(name: str, nothing: dict[str, Any]) -> None:
    for channel, values in fall(**NULLS[name]).channels(TIMES).items():
        np.testing.assert_array_equal(values, nothing[channel])


def test_a_second_touch_shares_momentum_again() -> None:
    drop = fall(recovery=0.3, unloading_ratio=0.05)
    assert [s.mode for s in drop.stages].count(FREE) >= 2
    assert drop.stages[1].mode == LOADING
    assert drop.impulse > fall().impulse


def test_a_guide_holds_what_has_come_to_rest() -> None:
    """Critically damped it creeps to where weight and friction balance the soil, F_s = m g + F_c, and stays."""
    drop = descend(Rig(speed=1.5, guide=300.0), -0.06, 1.3)
    got = drop.channels(np.array([0.9, 1.2]))
    assert drop.stages[-1].way == HELD
    np.testing.assert_allclose(got[FORCE], 132.0 * 9.81 + 300.0, rtol=1e-6)
    assert got[FORCE][0] == got[FORCE][1]
    assert got[SPEED].tolist() == got[ACCELERATION].tolist() == [0.0, 0.0]


def test_what_a_guide_holds_slides_when_more_pulls() -> None:
    """Held with F_c upward against it, it slides down when a push that grows with time has reached 2 F_c."""
    growing = 1000.0  # N/s
    drop = descend(Rig(speed=1.5, guide=100.0, push=lambda t, x, v: growing * max(t - 1.0, 0.0)), -0.06, 1.5)
    held = next(s for s in drop.stages if s.way == HELD and s.end > 1.0)
    assert held.end == pytest.approx(1.2, abs=1e-5)
    speed = drop.channels(np.array([1.199, 1.21]))[SPEED]
    assert speed[0] == 0.0
    assert speed[1] < 0.0
