"""Soil that shears and yields under pressure: closed forms of plate tests, energy, reversal, Coulomb as the limit."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ground.bekker import BekkerWong
from ground.friction import Coulomb, JanosiHanamoto
from ground.hard import Hard
from ground.kernel import AREA, COLUMNS, LOADING, MODE, NORMAL, SHEAR, SHEARED, STATE_COLUMNS, commit, normal_force
from ground.law import REFERENCE_AREA, evaluate, touched
from ground.settings import settings as kernel_settings
from ground.shear import commit_shear, shear_force
from ground.surface import Slope
from rollover.assessment.ledger import closure
from rollover.dynamics.simulate import run
from rollover.scenario import Scenario, load
from rollover.spec.document import content_hash
from rollover.spec.initiation import Drop
from rollover.system.errors import InputError
from tests.physics.scenes import block

SAND = JanosiHanamoto(cohesion=1040.0, friction_angle_deg=28.0, shear_modulus=0.025)
PLATE = BekkerWong(cohesive_modulus=990.0, frictional_modulus=1528430.0, exponent=1.1, width=0.1)
ANGLE = 20.0


class Sheared:
    """One element under a plate that is moved by hand along x and y."""

    def __init__(self, strength: float, modulus: float) -> None:
        self.row = np.zeros(COLUMNS)
        self.row[NORMAL : NORMAL + 3] = 0.0, 0.0, 1.0
        self.strength, self.modulus = strength, modulus

    def move(self, dx: float, dy: float = 0.0) -> np.ndarray:
        moved, row = np.array([dx, dy, 0.1]), self.row  # what is along the normal does not count
        n, shear = row[NORMAL : NORMAL + 3], row[SHEAR : SHEAR + 3]
        tried = shear_force(self.strength, self.modulus, row[SHEARED], shear, moved, n)
        commit_shear(self.modulus, row, moved)
        still = shear_force(self.strength, self.modulus, row[SHEARED], shear, np.zeros(3), n)
        assert np.allclose(tried, still, rtol=1e-9, atol=1e-9)  # what was tried is what stands
        return np.array(tried)


@pytest.mark.parametrize("step", [1e-4, 7e-3])
def test_a_plate_pulled_one_way_follows_the_curve(step: float) -> None:
    """tau = tau_max (1 - exp(-j/K)) whatever the steps; its work up to j is tau_max (j - K (1 - exp(-j/K)))."""
    K, most = 0.02, 900.0
    plate, work = Sheared(most, K), 0.0
    places = np.arange(step, 0.14, step)
    before = 0.0
    for j in places:
        force = -plate.move(step)[0]
        assert force == pytest.approx(most * (1.0 - math.exp(-j / K)), rel=1e-9)
        work += 0.5 * (before + force) * step
        before = force
    j = float(places[-1])
    assert plate.row[SHEARED] == pytest.approx(j, rel=1e-9)
    # the trapezoid leaves h^2/12 tau_max/K of the whole
    assert work == pytest.approx(most * (j + K * math.expm1(-j / K)), abs=step**2 / 12.0 * most / K * 1.1)


def test_shear_reverses_by_its_first_slope_and_resumes_the_curve() -> None:
    K, most = 0.02, 1000.0
    plate = Sheared(most, K)
    top = -plate.move(0.01)[0]
    assert -plate.move(-0.002)[0] == pytest.approx(top - most * 0.002 / K, rel=1e-9)
    assert plate.row[SHEARED] == pytest.approx(0.01, rel=1e-12)  # springing back shears nothing
    assert -plate.move(0.002)[0] == pytest.approx(top, rel=1e-9)
    assert -plate.move(0.005)[0] == pytest.approx(most * (1.0 - math.exp(-0.015 / K)), rel=1e-9)
    # the other way it yields at the same stress, and shears on from there
    there = K * (1.0 - math.exp(-0.015 / K))
    assert plate.move(-2.0 * there)[0] == pytest.approx(most * there / K, rel=1e-9)
    assert plate.row[SHEARED] == pytest.approx(0.015, rel=1e-9)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.tuples(st.floats(-0.05, 0.05), st.floats(-0.05, 0.05)), min_size=1, max_size=6))
def test_a_closed_way_never_gives_energy(moves: list[tuple[float, float]]) -> None:
    """Work over any way in the plane is at least the energy in the spring, F_max e^2/(2 K), so never negative."""
    K, most, pieces = 0.02, 800.0, 50
    plate, work, before = Sheared(most, K), 0.0, np.zeros(2)
    for dx, dy in moves:
        for _ in range(pieces):
            way = np.array([dx, dy]) / pieces
            force = plate.move(*way)[:2]
            work -= float(0.5 * (before + force) @ way)
            before = force
            assert np.linalg.norm(force) <= most * (1.0 + 1e-12)
    stored = 0.5 * most / K * float(np.sum(plate.row[SHEAR : SHEAR + 3] ** 2))
    # each piece's trapezoid is off by no more than the slope times the square of the way
    slack = most / K * sum(dx * dx + dy * dy for dx, dy in moves) / pieces
    assert work >= stored - slack


def test_strength_grows_with_load_and_area() -> None:
    """A block sliding down a slope is braked by c A + m g cos(a) tan(phi): after long shear, as a point mass."""
    a, mass, area = math.radians(ANGLE), 500.0, 0.6
    soil = JanosiHanamoto(cohesion=600.0, friction_angle_deg=8.0, shear_modulus=0.001)
    scenario = block(
        Drop(speed=0.02, roll_deg=ANGLE), mass=mass, surface=Slope(angle_deg=ANGLE, direction_deg=90.0), law=Hard()
    )
    done = run(
        replace(
            scenario,
            ground=replace(
                scenario.ground, friction=soil, co_moving_mass=replace(scenario.ground.co_moving_mass, fraction=0.0)
            ),
        )
    )
    assert done.status == "done", done.sentence
    time, v = done.recording.time, done.recording["chassis/velocity_y"] / math.cos(a)
    late = time > 0.5
    gain = -float(np.polyfit(time[late], v[late], 1)[0])
    expected = 9.81 * math.sin(a) - (600.0 * area / mass + 9.81 * math.cos(a) * math.tan(math.radians(8.0)))
    assert gain == pytest.approx(expected, rel=0.05)
    assert closure(done).largest < 0.005


def sliding(friction: Coulomb | JanosiHanamoto, speed: float = 0.05) -> Scenario:
    scenario = block(Drop(speed=speed, roll_deg=ANGLE), surface=Slope(angle_deg=ANGLE, direction_deg=90.0))
    return replace(scenario, ground=replace(scenario.ground, friction=friction))


def test_a_short_modulus_is_coulomb_friction() -> None:
    mu = 0.2
    coulomb = run(sliding(Coulomb(coefficient=mu, stick_displacement=1e-4, stick_relaxation=0.0)))
    phi = math.degrees(math.atan(mu))
    sheared = run(sliding(JanosiHanamoto(cohesion=0.0, friction_angle_deg=phi, shear_modulus=1e-4)))
    way = [
        float(r.recording["chassis/position_y"][-1] - r.recording["chassis/position_y"][0]) for r in (coulomb, sheared)
    ]
    assert way[1] == pytest.approx(way[0], rel=5e-3)
    assert sheared.ledger["friction"] == pytest.approx(coulomb.ledger["friction"], rel=5e-3)
    assert closure(sheared).largest < 0.005


def test_soil_has_to_be_sheared_before_it_holds() -> None:
    """Strength beyond the slope's pull: it gives way by at least j with tan(a) = tan(phi)(1 - exp(-j/K)).

    At most by what a load gives that comes at once: pull j = strength (j - K (1 - exp(-j/K))).
    """
    K, phi = 0.02, 40.0
    done = run(sliding(JanosiHanamoto(cohesion=0.0, friction_angle_deg=phi, shear_modulus=K)))
    y, z = (done.recording[f"chassis/position_{axis}"] for axis in "yz")
    way = (y[0] - y) * math.cos(math.radians(ANGLE)) + (z[0] - z) * math.sin(math.radians(ANGLE))
    ratio = math.tan(math.radians(ANGLE)) / math.tan(math.radians(phi))
    static = -K * math.log(1.0 - ratio)
    low, high = static, 1.0
    for _ in range(80):
        j = 0.5 * (low + high)
        low, high = (j, high) if ratio * j > j + K * math.expm1(-j / K) else (low, j)
    late = way[len(way) // 2 :]
    assert static < late.mean() < low
    # nothing damps its spring: it swings, and never further than where it turned round
    assert late.max() < 1.02 * low
    assert closure(done).largest < 0.005


# ---------------------------------------------------------------- pressure and sinkage


def test_a_plate_pressed_in_follows_bekker() -> None:
    for z in (0.01, 0.05, 0.2):
        pressure = (990.0 / 0.1 + 1528430.0) * z**1.1
        assert evaluate(PLATE, z, 0.0, speed=0.1) == pytest.approx(REFERENCE_AREA * pressure, rel=1e-12)
    with pytest.raises(ValueError, match=r"^frictional_modulus: no resistance at all"):
        BekkerWong(cohesive_modulus=0.0, frictional_modulus=0.0, exponent=1.0)


class Pressed:
    """One element under a plate that is pressed in and lifted by hand, slowly."""

    def __init__(self, law: BekkerWong) -> None:
        self.row, self.state = np.zeros(COLUMNS), np.zeros(STATE_COLUMNS, dtype=np.int64)
        self.row[AREA], self.state[MODE] = REFERENCE_AREA, LOADING
        self.law, self.p, self.s = *kernel_settings(law), touched(law, speed=0.1)

    def to(self, z: float, v: float) -> float:
        force = float(normal_force(self.law, self.p, self.s, self.row, z, 0.0))
        commit(self.law, self.p, self.s, self.row, self.state, z, v, 1.0, 132.0)
        return force / REFERENCE_AREA


def test_it_unloads_and_reloads_by_the_slope_of_wong() -> None:
    """p = p_u - (k_0 + A_u z_u)(z_u - z), by another slope from deeper; the rut stays."""
    k0, grows = 2e6, 5.03e8
    law = replace(PLATE, unloading_stiffness=k0, unloading_growth=grows)
    plate = Pressed(law)
    for deep in (0.02, 0.06):
        top = plate.to(deep, 1e-6)
        assert top == pytest.approx((990.0 / 0.1 + 1528430.0) * deep**1.1, rel=1e-9)
        slope = k0 + grows * deep
        half = deep - 0.5 * top / slope
        assert plate.to(half, -1e-6) == pytest.approx(0.5 * top, rel=1e-9)
        assert plate.to(deep - 1.01 * top / slope, -1e-6) == 0.0
        assert plate.to(half, 1e-6) == pytest.approx(0.5 * top, rel=1e-9)
        assert plate.to(deep - 1e-9, 1e-6) == pytest.approx(top, rel=1e-5)


def test_without_an_unloading_slope_it_is_the_recovery() -> None:
    plate, deep = Pressed(replace(PLATE, recovery=0.1)), 0.05
    top = plate.to(deep, 1e-6)
    assert plate.to(0.95 * deep, -1e-6) == pytest.approx(0.5 * top, rel=1e-9)


def test_a_line_flatter_than_the_secant_springs_back_in_full() -> None:
    plate, deep = Pressed(replace(PLATE, unloading_stiffness=1.0)), 0.05
    top = plate.to(deep, 1e-6)
    assert plate.to(0.5 * deep, -1e-6) == pytest.approx(0.5 * top, rel=1e-9)


def test_a_block_on_bekker_soil_sinks_as_its_weight_says() -> None:
    """Let go at the surface: m g z = A (k_c/b + k_phi) z^(n+1)/(n+1) at its deepest, without co-moving mass."""
    mass, area = 500.0, 0.6
    scenario = block(Drop(speed=1e-3), mass=mass, law=PLATE, fraction=0.0, step=2e-4, duration=0.5)
    done = run(scenario)
    z = (mass * 9.81 * 2.1 / (area * (990.0 / 0.1 + 1528430.0))) ** (1.0 / 1.1)
    assert float(done.recording["ground/sinkage"].max()) == pytest.approx(z, rel=0.01)
    assert closure(done).largest < 0.005


# ---------------------------------------------------------------- in files


def test_friction_without_a_kind_is_coulomb_and_its_hash_stays() -> None:
    scenario = load("side_overturn")
    assert scenario.ground.friction == Coulomb(coefficient=0.5)
    said = scenario.replaced({"ground.friction": {"kind": "coulomb", "coefficient": 0.5}})
    assert content_hash(said) == content_hash(scenario)
    sand = {"kind": "janosi-hanamoto", "cohesion": 1040.0, "friction_angle_deg": 28.0, "shear_modulus": 0.025}
    changed = scenario.replaced({"ground.friction": sand})
    assert changed.ground.friction == SAND
    assert changed.replaced({"ground.friction.shear_modulus": 0.01}).ground.friction == replace(
        SAND, shear_modulus=0.01
    )


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (
            {"kind": "janosi"},
            "ground.friction.kind: unknown kind, got text 'janosi'; allowed: coulomb, janosi-hanamoto",
        ),
        (
            {"coefficient": -0.5},
            "ground.friction.coefficient: out of bounds, got -0.5; a number at least 0 and at most 2",
        ),
        ({"cohesion": 5.0}, "ground.friction.cohesion: unknown key, got 'cohesion'; allowed: kind, coefficient"),
        (
            {"kind": "janosi-hanamoto", "cohesion": 1.0, "friction_angle_deg": 70.0, "shear_modulus": 0.01},
            "ground.friction.friction_angle_deg: out of bounds, got 70.0; a number at least 0 and less than 60 deg",
        ),
        ({"kind": "janosi-hanamoto", "cohesion": 1.0}, "ground.friction.friction_angle_deg: missing; a number"),
    ],
)
def test_wrong_friction_is_told_for_the_kind_that_was_meant(value: dict[str, object], said: str) -> None:
    with pytest.raises(InputError) as refused:
        load("side_overturn").replaced({"ground.friction": value})
    assert said in str(refused.value)


def test_the_effect_of_friction_takes_the_place_of_shear() -> None:
    sheared = sliding(SAND).replaced({"effects.ground-friction.coefficient": 0.3})
    assert sheared.applied().ground.friction == Coulomb(coefficient=0.3)
    assert sliding(SAND).replaced({"effects.ground-friction.coefficient": None}).applied().ground.friction == SAND


# ---------------------------------------------------------------- soil trip


def tripped(changes: dict[str, object]) -> tuple[float, float]:
    """Largest lean (deg) of the shipped load on its way, and the ledger's largest residual."""
    done = run(load("soil_trip").replaced(changes))
    assert done.status == "done", done.sentence
    return float(np.degrees(np.abs(done.recording["chassis/roll"])).max()), closure(done).largest


def test_a_tall_load_trips_where_soil_holds_more_than_s_over_h() -> None:
    """s/h = 0.5: 0.83 of the weight turns it over, 0.36 lets it slide to rest; so does a speed below that by energy."""
    s, h, inertia = 0.4, 0.8, 160.0 / 600.0
    r2 = s * s + h * h
    least = math.sqrt(2.0 * 9.81 * (inertia + r2) * (math.sqrt(r2) - h)) / h
    over, ledger = tripped({})
    assert over > 80.0
    assert ledger < 0.005
    weak, ledger = tripped({"ground.friction.cohesion": 0.0, "ground.friction.friction_angle_deg": 20.0})
    assert weak < 5.0
    assert ledger < 0.005
    slow, _ = tripped({"initiation.velocity": [0.0, 0.9 * least, 0.0]})
    assert slow < 45.0
