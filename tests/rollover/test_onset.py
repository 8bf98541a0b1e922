"""The zero of a clock: found from what a recording shows, the same on any clock, told, and refused where nothing tells.

Drops with noise of half a percent, made by the reduced solution at another step; overturns by the full run.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from ground.drops import loading
from ground.identify import identify
from rollover.calibration import ground_law
from rollover.calibration.calibrate import calibrate
from rollover.calibration.objective import parameter
from rollover.cli.main import app
from rollover.comparison.misfit import estimated_noise
from rollover.comparison.onset import KNOWN, SURE, timed
from rollover.comparison.synthesis import synthetic, usual
from rollover.dynamics import simulate
from rollover.dynamics.drop_test import DropModel
from rollover.recording import Clock, Recording
from rollover.recording.importers.plain import write
from rollover.recording.time_stamps import from_first, is_far
from rollover.scenario import Scenario, load
from rollover.system.errors import InputError

FORCE, DEPTH, ACCELERATION = "ground/force_normal", "ground/sinkage", "striker/acceleration_z"
UNKNOWN = Clock(zero="unknown")
OFFSETS = (-1.0, -0.05, 0.003, 0.4, 100.0, 1e6, 1e9)
LEAD = 0.03  # s of the fall that is recorded


def drop(
    seed: int = 0,
    speed: float = 3.0,
    *,
    rate: float = 1000.0,
    channels: tuple[str, ...] = (FORCE, DEPTH, ACCELERATION),
    changes: Mapping[str, Any] | None = None,
) -> Recording:
    """A drop on a clock that is right, begun between two of its samples."""
    rng = np.random.default_rng(seed)
    time = np.arange(-round(LEAD * rate), round(0.45 * rate)) / rate + rng.uniform(0.0, 1.0 / rate)
    run = (
        DropModel(scenario=load("drop_test"), step=2e-4).with_({"initiation.speed": speed, **(changes or {})}).run(time)
    )
    noise = {c: 0.005 * float(np.ptp(run[c])) for c in channels}
    values = {c: run[c] + rng.normal(0.0, noise[c], time.size) for c in channels}
    return Recording(title="d", time=time, channels=values, conditions={"initiation.speed": speed}, noise=noise)


def on(recording: Recording, offset: float, clock: Clock = UNKNOWN) -> Recording:
    return replace(recording, time=recording.time + offset, clock=clock)


def under(recording: Recording) -> Scenario:
    return load("drop_test").replaced(recording.conditions)


@pytest.mark.parametrize("rate", [200.0, 1000.0, 4000.0])
@pytest.mark.parametrize("channels", [(FORCE, DEPTH, ACCELERATION), (FORCE,), (ACCELERATION,), (DEPTH,)])
def test_a_zero_is_found_within_its_uncertainty(rate: float, channels: tuple[str, ...]) -> None:
    """Of ten drops on ground twice as stiff as the scenario's, pulls over 1 sigma and 1 sigma over a sample."""
    pulls = []
    for seed in range(10):
        made = drop(seed, rate=rate, channels=channels, changes={"effects.soil-stiffness.scale": 2.0})
        zero = timed("d", on(made, 0.25), under(made)).zero
        assert zero is not None
        assert zero.by == "onset"
        assert zero.sigma < (2.0 / rate if DEPTH not in channels or len(channels) > 1 else 6.0 / rate)
        pulls.append((zero.late - 0.25) / zero.sigma)
    # of ten pulls that are normal the root mean square is below 1.6 in 99.9 of 100 cases; a ground that is not the
    # scenario's moves it by less than that again
    assert np.sqrt(np.mean(np.square(pulls))) < 2.5


def test_stamps_of_any_clock_are_one_recording() -> None:
    made = drop()
    first = timed("d", on(made, 0.0), under(made))
    for offset in OFFSETS:
        found = timed("d", on(made, offset), under(made))
        assert found.zero is not None
        assert first.zero is not None
        np.testing.assert_allclose(found.recording.time, first.recording.time, rtol=0.0, atol=1e-15)
        assert found.zero.late - offset == pytest.approx(first.zero.late, abs=np.spacing(offset) + 1e-15)
        assert found.zero.sigma == pytest.approx(first.zero.sigma, rel=1e-4)


@pytest.mark.parametrize("rate", [1000.0, 3000.0, 2048.0, 44100.0])
def test_stamps_on_a_grid_within_rounding_are_that_grid(rate: float) -> None:
    count = np.delete(np.arange(700), slice(100, 130))  # with a gap
    for offset in (0.0, 0.3, 1e6, 1.7e9):
        np.testing.assert_allclose(from_first(count / rate + offset), count / rate, rtol=1e-15, atol=0.0)
    uneven = np.cumsum(np.random.default_rng(0).uniform(0.5e-3, 1.5e-3, 500))
    np.testing.assert_array_equal(from_first(uneven), uneven - uneven[0])


def test_a_clock_that_is_said_to_be_right_and_is_stays_as_it_is() -> None:
    made = drop()
    for late in (0.0, 2e-3, -2e-3):
        given = on(made, late, Clock())
        assert timed("d", given, under(made)).recording is given
    soft = drop(1, changes={"effects.soil-layer.depth": 0.03, "effects.soil-layer.stiffness_ratio": 3.0})
    assert timed("d", soft, under(soft)).zero is None


@pytest.mark.parametrize("late", [0.02, 0.3, -0.02, -1.0])
def test_a_clearly_wrong_clock_is_set_though_stated_known(late: float) -> None:
    made = drop()
    zero = timed("d", on(made, late, Clock()), under(made)).zero
    assert zero is not None
    assert abs(late) > SURE * KNOWN
    assert zero.late == pytest.approx(late, abs=5.0 * zero.sigma)


@pytest.mark.parametrize("late", [0.019, -0.025, 0.4])
@pytest.mark.parametrize(
    "lacks", ["effects.soil-viscous-damping.damping", "effects.soil-stiffness.scale", "effects.soil-crust.thickness"]
)
def test_a_wrong_clock_is_set_beside_what_is_left_out(late: float, lacks: str) -> None:
    """The whole drop is hardly nearer on the right clock: what it says before and about its contact is."""
    value = {"effects.soil-viscous-damping.damping": 250.0, "effects.soil-stiffness.scale": 2.0}.get(lacks, 0.05)
    more = {"effects.soil-crust.stiffness_ratio": 3.0} if "crust" in lacks else {}
    made = drop(3, 1.5, changes={lacks: value, **more})
    zero = timed("d", on(made, late, Clock()), under(made)).zero
    assert zero is not None
    assert zero.late == pytest.approx(late, abs=5.0 * zero.sigma)
    assert timed("d", made, under(made)).zero is None


def test_one_late_channel_is_no_late_clock() -> None:
    """The depth gauge 30 ms late, the load cell and the accelerometer not: an instrument's fault."""
    made, late = drop(), drop()
    behind = np.interp(late.time - 0.03, late.time, late[DEPTH])
    faulty = replace(made, channels={**made.channels, DEPTH: behind})
    assert timed("d", faulty, under(made)).zero is None
    slow = replace(made, channels={**made.channels, FORCE: np.interp(made.time - 0.03, made.time, made[FORCE])})
    assert timed("d", slow, under(made)).zero is None
    both = {c: np.interp(made.time - 0.03, made.time, made[c]) for c in (FORCE, ACCELERATION)}
    assert timed("d", replace(made, channels={**made.channels, **both}), under(made)).zero is None


def test_a_hanging_weights_release_is_no_contact() -> None:
    made = drop(channels=(ACCELERATION,))
    held = np.arange(-200, 0) * 1e-3 + made.time[0]
    values = np.concatenate([np.random.default_rng(5).normal(0.0, made.noise[ACCELERATION], 200), made[ACCELERATION]])
    hung = replace(made, time=np.concatenate([held, made.time]), channels={ACCELERATION: values})
    zero = timed("d", on(hung, 0.25), under(made)).zero
    assert zero is not None
    assert zero.late == pytest.approx(0.25, abs=5.0 * zero.sigma)


def test_a_width_that_is_stated_draws_the_zero_towards_it() -> None:
    made = drop(rate=300.0, channels=(DEPTH,))
    free, tight = (timed("d", on(made, 0.01, c), under(made)).zero for c in (UNKNOWN, Clock(within=2e-3)))
    assert free is not None
    assert tight is not None
    assert tight.sigma == pytest.approx((free.sigma**-2 + 2e-3**-2) ** -0.5, rel=1e-6)
    assert tight.late == pytest.approx(tight.sigma**2 * free.late / free.sigma**2, rel=1e-6)


def test_a_clock_that_nothing_tells_is_refused_by_name() -> None:
    made = drop()
    rows = made.time < -0.002
    fall = replace(made, time=made.time[rows], channels={c: v[rows] for c, v in made.channels.items()})
    with pytest.raises(InputError, match=r"^d3: clock: its time zero cannot be determined, got stamps from 99.97"):
        timed("d3", on(fall, 100.0, Clock()), under(made))


@pytest.fixture(scope="module")
def overturn() -> tuple[Scenario, Recording]:
    scenario = load("rear_overturn")
    return scenario, simulate.run(scenario).recording


@pytest.mark.parametrize("offset", [-2.0, 0.4, 1e9])
def test_a_vehicle_is_laid_over_its_simulation(overturn: tuple[Scenario, Recording], offset: float) -> None:
    scenario, run = overturn
    made = synthetic(run, channels=usual(run), rate=500.0, seed=1)
    found = timed("v", on(made, offset), scenario, lambda _: run)
    assert found.zero is not None
    assert found.zero.by == "alignment"
    assert found.zero.channels == usual(run)
    assert found.zero.late - offset == pytest.approx(0.0, abs=5.0 * found.zero.sigma)
    assert found.zero.sigma < 1e-3
    assert timed("v", made, scenario, lambda _: run).zero is None


def test_a_vehicle_that_is_like_nothing_simulated_is_refused(overturn: tuple[Scenario, Recording]) -> None:
    scenario, run = overturn
    made = synthetic(run, channels=usual(run), rate=500.0, seed=1)
    rng = np.random.default_rng(3)
    other = replace(made, channels={c: rng.normal(0.0, 1.0, made.time.size) for c in made.channels})
    with pytest.raises(InputError, match=r"^v: clock: its time zero cannot be determined"):
        timed("v", on(other, 0.0), scenario, lambda _: run)


def identified(recordings: Mapping[str, Recording]) -> dict[str, tuple[float, float | None, float | None]]:
    scenario = load("drop_test")
    drops, refused = ground_law.drops_of(ground_law.usable(recordings, scenario).recordings, scenario)
    assert not refused
    return {c.name: (c.value, c.low, c.high) for c in identify(drops).coefficients}


SPEEDS = (2.0, 2.5, 3.0)


def test_identify_says_the_same_on_any_clock() -> None:
    made = {f"d{v}": drop(k, v) for k, v in enumerate(SPEEDS)}
    right = identified(made)
    first = identified({n: on(r, 0.0) for n, r in made.items()})
    for offset in OFFSETS:
        found = identified({n: on(r, offset) for n, r in made.items()})
        for name, (value, low, high) in found.items():
            assert value == pytest.approx(first[name][0], rel=1e-6)
            assert [low is None, high is None] == [v is None for v in first[name][1:]]
            if low is not None and high is not None:
                assert (low, high) == pytest.approx(first[name][1:], rel=1e-6)
                assert low <= right[name][0] <= high
    for offset in (-1.0, 0.02, 100.0, 1e9):  # and where nobody says so
        found = identified({n: on(r, offset, Clock()) for n, r in made.items()})
        assert found["first_stiffness"] == pytest.approx(first["first_stiffness"], rel=1e-6)


def test_a_depth_that_is_integrated_is_as_unsure_as_its_zero() -> None:
    """An accelerometer alone: 0.5 ms at 3 m/s are 1.5 mm of depth; a depth gauge says itself where the surface is."""
    for channels, more in (((ACCELERATION,), 1.5e-3**2), ((ACCELERATION, DEPTH), 0.0)):
        made = drop(channels=channels)
        one = ground_law.drop_of("d", made, load("drop_test"))
        told = ground_law.drop_of("d", replace(made, clock=Clock(within=0.5e-3)), load("drop_test"))
        least, most = (loading(d, 0.1).covariance[0, 0] for d in (one, told))
        assert most - least == pytest.approx(more, rel=1e-9)


def test_calibrate_says_the_same_on_any_clock() -> None:
    scenario = load("drop_test").replaced({"simulation.duration": 0.45})
    made = {"a": drop(1, 2.0, rate=300.0), "b": drop(2, 3.0, rate=300.0)}

    def fitted(offset: float, clock: Clock = UNKNOWN) -> Any:
        given = {n: on(r, offset, clock) for n, r in made.items()}
        return calibrate(
            scenario, given, [parameter(scenario, "vehicle.mass=120:145")], noise=estimated_noise, starts=0
        )

    first, right = fitted(0.0), fitted(0.0, Clock())
    assert not right.zeros
    for offset in (-1.0, 0.4, 1e9):
        found = fitted(offset)
        assert found.estimates[0].value == pytest.approx(first.estimates[0].value, rel=1e-6)
        assert found.estimates[0].low == pytest.approx(first.estimates[0].low, rel=1e-6)
        assert found.estimates[0].low < right.estimates[0].value < found.estimates[0].high
        for name in made:
            late = found.clocks[name] - offset
            assert late == pytest.approx(right.clocks[name], abs=3.0 * found.clock_errors[name] + np.spacing(offset))
            assert 0.0 < found.clock_errors[name] < 1e-3


def files(folder: Path, offset: float, clock: Clock) -> list[str]:
    folder.mkdir()
    for k, v in enumerate(SPEEDS):
        write(on(drop(k, v), offset, clock), folder / f"d{v}.csv")
    return sorted(str(p) for p in folder.glob("*.csv"))


def rollover(*words: object) -> Any:
    return CliRunner().invoke(app, [str(w) for w in words])


def test_compare_says_the_same_on_any_clock_and_which_it_was(tmp_path: Path) -> None:
    numbers = []
    for offset in (0.02, 1e9):
        name = files(tmp_path / f"{offset:g}", offset, Clock())[2]
        done = rollover("compare", "drop_test", name, "--out", tmp_path / f"c{offset:g}", "--json")
        assert done.exit_code == 0, done.output
        (one,) = json.loads(done.stdout)["comparisons"]
        assert one["zero"]["late"] == pytest.approx(offset, abs=5.0 * one["zero"]["sigma"])
        assert "zero lies at" in (tmp_path / f"c{offset:g}" / "report.html").read_text()
        numbers.append([c["rating"]["nrmse"] for c in one["channels"]] + [one["clock"]["offset"]])
    assert numbers[0] == pytest.approx(numbers[1], rel=1e-6, abs=1e-9)


def test_identify_tells_the_clock(tmp_path: Path) -> None:
    done = rollover("identify", *files(tmp_path / "r", 0.02, Clock()), "--out", tmp_path / "o", "--json")
    assert done.exit_code == 0, done.output
    answer = json.loads(done.stdout)
    assert {name: zero["why"] for name, zero in answer["clocks"].items()} == {f"d{v}": "off" for v in SPEEDS}
    assert sum("the scenario's zero lies at 0.0" in line for line in answer["remarks"]) == 3
    assert answer["multiple_correlation"] > 0.999


def test_check_counts_a_far_clock_from_its_first_stamp(tmp_path: Path) -> None:
    name = files(tmp_path / "r", 1.7e9, Clock())[0]
    plain = rollover("check", name).stdout
    assert "480 samples, 0 to 0.479 s from its first stamp at 1700000000" in plain
    assert "further from zero than they last: read as a clock without a zero" in plain
    told = json.loads(rollover("check", name, "--scenario", "drop_test", "--json").stdout)["files"][0]
    assert told["clock"]["late"] == pytest.approx(1.7e9, abs=1e-3)
    assert not is_far(np.array([-0.02, 0.5]))


@pytest.mark.parametrize("command", [("compare",), ("calibrate", "--fit", "vehicle.mass"), ("diagnose",)])
def test_a_comparison_of_nothing_is_refused_with_its_cause(command: tuple[str, ...], tmp_path: Path) -> None:
    made = drop()
    foreign = replace(made, channels={"chassis/roll": np.sin(made.time)}, noise={"chassis/roll": 0.01})
    write(foreign, tmp_path / "foreign.csv")
    rows = made.time < -0.002
    fall = replace(made, time=made.time[rows] + 100.0, channels={c: v[rows] for c, v in made.channels.items()})
    write(fall, tmp_path / "fall.csv")
    said = {
        "foreign": ("chassis/roll",),
        "fall": ("fall: clock: its time zero cannot be determined, got stamps from 99.97",),
    }
    for name, words in said.items():
        out = tmp_path / "out"
        done = rollover(command[0], "drop_test", tmp_path / f"{name}.csv", *command[1:], "--out", out)
        assert done.exit_code == 2, done.output
        assert all(w in done.stderr.splitlines()[-1] for w in words)
        assert name in done.stderr.splitlines()[-1]
        assert not out.exists()


def test_a_fall_that_ends_before_the_ground_has_no_onset() -> None:
    # let go at 80 m, 4.04 s before the ground, recorded for 2 s by a scenario of 3 s
    scenario = load("ball_drop").replaced({"initiation.height": 80.0, "simulation.duration": 3.0})
    time = np.arange(0.0, 2.0, 1.0 / 15.0)
    noise = np.random.default_rng(1).normal(0.0, 0.05, time.size)
    falling = Recording(
        title="ball",
        time=time,
        channels={"striker/position_z": 80.0 - 4.905 * time**2 + noise},
        clock=Clock(zero="unknown", within=0.1),
    )
    found = timed("ball", falling, scenario)
    assert found.zero is None
    assert found.recording is falling
