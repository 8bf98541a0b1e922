"""Calibration: twins with known truth, intervals with known size, and what recordings cannot say."""

from __future__ import annotations

import math
import tracemalloc

import numpy as np
import pytest

from rollover.calibration.calibrate import Calibration, calibrate
from rollover.calibration.identifiability import determine
from rollover.calibration.objective import Objective, Parameter, case, correlation_time, parameter
from rollover.recording import Recording
from rollover.scenario import Scenario
from rollover.system.errors import InputError
from rollover.system.numbers import Z95
from tests.rollover.twin import drop, recorded, scene

STIFFNESS, MASS = "ground.law.stiffness_scale=0.3:3", "vehicle.mass=90:200"
RECOVERY = "ground.law.recovery=0.02:0.5"
FORCE = "ground/force_normal"


def stated(recording: Recording, channel: str) -> None:
    """All noise is stated in the recordings here."""


def fitted(
    recordings: dict[str, Recording], *fits: str, held_out: dict[str, Recording] | None = None, starts: int = 0
) -> Calibration:
    base = scene()
    parameters = [parameter(base, text) for text in fits]
    return calibrate(base, recordings, parameters, held_out=held_out, noise=stated, simulate=drop, starts=starts)


def test_stated_intervals_have_their_coverage() -> None:
    """8 random truths of 3 parameters, 2 drops each, clocks off by 0.3 ms: 95 % of 24 intervals.

    Errors over their stated sigma are to be standard normal: their squares sum to chi-squared with 24 degrees of
    freedom, whose 0.1 and 99.9 % points are 8.1 and 51.2. Fewer than 20 hits happen once in 100 if all is right.
    """
    hits, squares, count = 0, 0.0, 0
    for seed in range(8):
        rng = np.random.default_rng(seed)
        truth = {
            "ground.law.stiffness_scale": math.exp(rng.uniform(-0.5, 0.5)),
            "vehicle.mass": rng.uniform(110.0, 160.0),
            "ground.law.recovery": rng.uniform(0.1, 0.25),
        }
        world = scene(truth)
        drops = {
            f"at {v}": recorded(world, {"initiation.speed": v}, rng, every=8, late=rng.normal(scale=3e-4))
            for v in (1.5, 3.0)
        }
        found = fitted(drops, STIFFNESS, MASS, RECOVERY, starts=3)
        for e in found.estimates:
            hits += e.low <= truth[e.path] <= e.high
            sigma = math.log(e.high / e.low) / (2.0 * Z95)
            squares += (math.log(e.value / truth[e.path]) / sigma) ** 2
            count += 1
            assert e.determined, (seed, e)
    assert count == 24
    assert hits >= 20
    assert 8.1 < squares < 51.2


def test_recovery_is_undetermined_without_unloading() -> None:
    rng = np.random.default_rng(5)
    made = {"short": recorded(scene(), {"initiation.speed": 3.0}, rng, until=0.12)}
    found = fitted(made, STIFFNESS, RECOVERY)
    stiffness, recovery = found.estimates
    assert stiffness.determined
    assert not recovery.determined
    assert recovery.open_low
    assert recovery.open_high
    assert "not depend on it" in recovery.why
    assert any("ground.law.recovery alone is not observable" in w for w in found.warnings)


def test_recovery_is_determined_if_the_recording_goes_on() -> None:
    rng = np.random.default_rng(5)
    found = fitted({"whole": recorded(scene(), {"initiation.speed": 3.0}, rng)}, STIFFNESS, RECOVERY)
    assert all(e.determined for e in found.estimates)
    assert found.combinations == ()
    assert found.estimates[1].low < 0.1 < found.estimates[1].high


def test_mass_and_stiffness_are_one_number_to_an_accelerometer() -> None:
    """(1 + y) z'' = g - F(z)/m with F proportional to the scale: only scale/m is seen, at any speed."""
    rng = np.random.default_rng(6)
    made = recorded(scene(), {"initiation.speed": 3.0}, rng, channels=("striker/acceleration_z",))
    found = fitted({"a": made}, "ground.law.stiffness_scale=0.5:2", MASS)
    for e in found.estimates:
        assert not e.determined
        assert "together" in e.why
    assert len(found.combinations) == 1
    words = found.combinations[0]
    assert "ground.law.stiffness_scale by +1 %" in words
    assert float(words.rpartition("by ")[2].removesuffix(" %")) == pytest.approx(1.0, abs=0.02)
    assert found.condition > 100.0


def test_a_load_cell_tells_mass_and_stiffness_apart() -> None:
    rng = np.random.default_rng(6)
    made = recorded(scene(), {"initiation.speed": 3.0}, rng, channels=("striker/acceleration_z", FORCE))
    found = fitted({"a": made}, "ground.law.stiffness_scale=0.5:2", MASS)
    assert all(e.determined for e in found.estimates)
    assert found.condition < 100.0


def line(scenario: Scenario) -> Recording:
    """F = m + 1000 v t for linear algebra: the estimates of m and v are those of a straight line."""
    t = np.linspace(0.0, 1.0, 101)
    force = scenario.vehicle.mass + 1000.0 * scenario.initiation.speed * t
    return Recording(title="line", time=t, channels={FORCE: force})


def _of(simulate: object, values: np.ndarray, sigma: float, *parameters: Parameter) -> Objective:
    assert callable(simulate)
    base = scene()
    time = simulate(base).time
    made = Recording(title="made", time=time, channels={FORCE: values}, noise={FORCE: sigma})
    one = case(base, made, simulate, name="made", noise=stated)
    return Objective(cases=(one,), parameters=parameters, simulate=simulate, clock_sigma=0.0)


def test_intervals_of_a_straight_line_are_the_textbook_ones() -> None:
    """Covariance sigma^2 (X'X)^-1 with X = [1, 1000 t]; residuals scaled to exactly 1 sigma."""
    mass = Parameter(path="vehicle.mass", start=132.0, low=122.0, high=142.0)
    speed = Parameter(path="initiation.speed", start=3.0, low=2.99, high=3.01)
    t = np.linspace(0.0, 1.0, 101)
    X = np.column_stack([np.ones(101), 1000.0 * t])
    noise = np.random.default_rng(7).normal(size=101)
    noise -= X @ np.linalg.lstsq(X, noise, rcond=None)[0]
    noise *= math.sqrt(99.0 / float(noise @ noise))
    objective = _of(line, X @ [132.0, 3.0] + 2.0 * noise, 2.0, mass, speed)
    found = determine(objective, np.array([0.5, 0.5]))
    expected = 4.0 * np.linalg.inv(X.T @ X)
    half = [Z95 * math.sqrt(expected[0, 0]) / 20.0, Z95 * math.sqrt(expected[1, 1]) / 0.02]
    for interval, width in zip(found.intervals, half, strict=True):
        assert interval.method == "quadratic"
        assert interval.high - 0.5 == pytest.approx(width, rel=1e-3)
        assert 0.5 - interval.low == pytest.approx(width, rel=1e-3)
    correlation = expected[0, 1] / math.sqrt(expected[0, 0] * expected[1, 1])
    assert found.correlation[0, 1] == pytest.approx(correlation, abs=1e-3)
    assert found.undetermined == ("", "")
    for profile, width in zip(found.profiles, half, strict=True):  # of a straight line: the parabola of its interval
        assert profile.places == pytest.approx(
            [0.5 + k * width for k in (-1.4, -1.0, -0.5, 0.0, 0.5, 1.0, 1.4)], rel=1e-3
        )
        assert profile.rises == pytest.approx(((profile.places - 0.5) * Z95 / width) ** 2, rel=5e-3, abs=1e-6)
        assert profile.sigma == pytest.approx(width / Z95, rel=1e-3)


def test_memory_grows_with_the_samples_not_their_square() -> None:
    """A hundred numbers for each of 8,001 samples are 6 MB, one for each pair of them 512 MB."""
    t = np.linspace(0.0, 1.0, 8001)

    def long(scenario: Scenario) -> Recording:
        force = scenario.vehicle.mass + 1000.0 * t * scenario.initiation.speed
        return Recording(title="long", time=t, channels={FORCE: force})

    mass = Parameter(path="vehicle.mass", start=132.0, low=122.0, high=142.0)
    objective = _of(long, long(scene())[FORCE] + np.random.default_rng(3).normal(size=t.size), 1.0, mass)
    tracemalloc.start()
    determine(objective, np.array([0.5]))
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 100 * 8 * t.size


def test_residuals_beyond_the_noise_widen_the_intervals() -> None:
    """Residuals of three times the stated noise give intervals three times as wide."""
    mass = Parameter(path="vehicle.mass", start=132.0, low=122.0, high=142.0)
    noise = np.random.default_rng(8).normal(size=101)
    noise -= noise.mean()
    noise *= math.sqrt(100.0 / float(noise @ noise))
    base = line(scene())[FORCE]
    one, three = (determine(_of(line, base + k * noise, 1.0, mass), np.array([0.5])) for k in (1.0, 3.0))
    assert one.widening == pytest.approx(1.0)
    assert three.widening == pytest.approx(9.0)
    assert three.intervals[0].high - 0.5 == pytest.approx(3.0 * (one.intervals[0].high - 0.5), rel=1e-3)


def decay(scenario: Scenario) -> Recording:
    """F = 100 exp(-v t): weak noise fixes v from above and from below differently."""
    t = np.linspace(0.0, 2.0, 41)
    return Recording(title="decay", time=t, channels={FORCE: 100.0 * np.exp(-scenario.initiation.speed * t)})


def test_a_lopsided_interval_ends_where_the_likelihood_says() -> None:
    """Chi-squared rises by 3.84 at both ends of a profile, found here by a fine scan instead."""
    speed = Parameter(path="initiation.speed", start=3.0, low=0.5, high=19.0)
    sigma = 60.0
    objective = _of(decay, decay(scene())[FORCE], sigma, speed)
    found = determine(objective, np.array([speed.place(3.0)])).intervals[0]
    assert found.method == "profile"
    scan = np.linspace(0.2, 1.0, 321)
    rise = np.array([float(np.sum(objective.residuals(np.array([u])) ** 2)) for u in scan])
    inside = scan[rise < Z95**2]
    assert found.low == pytest.approx(inside[0], abs=0.02 * (inside[-1] - inside[0]))
    assert found.high == pytest.approx(inside[-1], abs=0.02 * (inside[-1] - inside[0]))
    assert found.high - speed.place(3.0) > 1.1 * (speed.place(3.0) - found.low)
    (profile,) = determine(objective, np.array([speed.place(3.0)])).profiles
    alone = [float(np.sum(objective.residuals(np.array([u])) ** 2)) for u in profile.places]
    assert profile.rises == pytest.approx(alone), "with nothing else to fit it is the misfit itself"


def test_a_profile_tells_of_a_better_minimum_than_the_fit() -> None:
    """A fit that stopped short: what lies below it is kept as it is."""
    mass = Parameter(path="vehicle.mass", start=132.0, low=122.0, high=142.0)
    objective = _of(line, line(scene())[FORCE], 1.0, mass)
    short = objective.parameters[0].place(132.15)
    (profile,) = determine(objective, np.array([short])).profiles
    assert profile.fit == short
    assert profile.rises.min() < -0.1
    assert profile.places[profile.rises.argmin()] == pytest.approx(0.5, abs=0.01)


def test_correlated_samples_count_less() -> None:
    """AR(1) with coefficient a: (1 + a)/(1 - a) samples are worth one; white noise one each."""
    rng = np.random.default_rng(9)
    white = rng.normal(size=20_000)
    made = np.zeros_like(white)
    for k in range(1, white.size):
        made[k] = 0.8 * made[k - 1] + white[k]
    assert correlation_time(made) == pytest.approx(9.0, rel=0.15)
    assert correlation_time(white) == pytest.approx(1.0, abs=0.05)


def test_a_late_clock_is_found_and_does_not_move_the_parameters() -> None:
    rng = np.random.default_rng(12)
    late = {"late": recorded(scene(), {"initiation.speed": 3.0}, rng, late=1.2e-3)}
    found = fitted(late, STIFFNESS, MASS)
    assert found.clocks["late"] == pytest.approx(1.2e-3, abs=2e-4)
    assert found.estimates[0].low < 1.0 < found.estimates[0].high
    held = calibrate(
        scene(),
        late,
        [parameter(scene(), STIFFNESS), parameter(scene(), MASS)],
        noise=stated,
        simulate=drop,
        starts=0,
        clock_sigma=0.0,
    )
    assert held.training.after.over_noise > 1.5 > 1.1 > found.training.after.over_noise
    assert any("noise levels away" in w for w in held.warnings)


def test_outliers_do_not_move_the_answer() -> None:
    rng = np.random.default_rng(11)
    made = recorded(scene(), {"initiation.speed": 3.0}, rng)
    spiked = dict(made.channels)
    spiked[FORCE] = spiked[FORCE].copy()
    spiked[FORCE][::50] += 5000.0
    bad = Recording(title="spikes", time=made.time, channels=spiked, conditions=made.conditions, noise=made.noise)
    found = fitted({"spikes": bad}, STIFFNESS, MASS)
    assert found.outliers >= len(spiked[FORCE][::50])
    assert found.estimates[0].value == pytest.approx(1.0, rel=0.01)
    assert found.estimates[1].value == pytest.approx(132.0, rel=0.01)


def test_a_far_start_is_replaced_and_held_out_data_scored() -> None:
    rng = np.random.default_rng(12)
    world = scene({"ground.law.stiffness_scale": 2.4, "vehicle.mass": 150.0})
    drops = {f"at {v}": recorded(world, {"initiation.speed": v}, rng, every=8) for v in (1.5, 2.5, 3.3)}
    out = {"at 3.3": drops.pop("at 3.3")}
    found = fitted(drops, "ground.law.stiffness_scale=0.1:10", "vehicle.mass=50:400", held_out=out, starts=6)
    assert found.estimates[0].value == pytest.approx(2.4, rel=0.01)
    assert found.held_out is not None
    assert found.held_out.recordings == ("at 3.3",)
    assert found.held_out.before.over_noise > 5.0
    assert found.held_out.after.over_noise == pytest.approx(1.0, abs=0.15)
    assert found.held_out.after.iso18571 is not None
    assert found.held_out.before.iso18571 is not None
    assert found.held_out.after.iso18571 > found.held_out.before.iso18571
    assert found.calibrated.ground.law.stiffness_scale == found.estimates[0].value  # type: ignore[attr-defined]


def test_a_value_outside_its_bounds_stops_there_and_says_so() -> None:
    rng = np.random.default_rng(13)
    made = {"a": recorded(scene({"vehicle.mass": 160.0}), {"initiation.speed": 3.0}, rng)}
    found = fitted(made, "vehicle.mass=100:150")
    assert found.estimates[0].at_bound == "high"
    assert "upper bound 150" in found.warnings[0]


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("vehicle.mas", "no such path; did you mean 'vehicle.mass'"),
        ("vehicle.mass=200:100", "not bounds, got '200:100'; LOW:HIGH with LOW < HIGH"),
        ("vehicle.mass=100", "not bounds"),
        ("vehicle.mass=-5:100", "greater than 0"),
        ("ground.friction.coefficient", "has no value to begin from, got 0.0"),
        ("title", "cannot be fitted"),
    ],
)
def test_what_cannot_be_a_parameter(text: str, why: str) -> None:
    with pytest.raises(InputError) as e:
        parameter(scene(), text)
    assert why in str(e.value)


def test_bounds_of_their_own_are_a_third_and_three_times() -> None:
    mass = parameter(scene(), "vehicle.mass")
    assert (mass.low, mass.start, mass.high, mass.unit) == (44.0, 132.0, 396.0, "kg")
    assert mass.value(mass.place(200.0)) == pytest.approx(200.0)


def test_a_stated_condition_is_not_fitted() -> None:
    made = recorded(scene(), {"initiation.speed": 3.0}, np.random.default_rng(0))
    with pytest.raises(InputError, match=r"initiation.speed: stated as a condition of a, got 3.0"):
        fitted({"a": made}, "initiation.speed")
