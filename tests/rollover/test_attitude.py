"""An attitude is an attitude: how it is written changes no rating, no objective and no finding."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rollover.calibration.calibrate import simulator
from rollover.calibration.objective import Objective, case, parameter
from rollover.comparison import rating
from rollover.comparison.misfit import Misfit, estimated_noise, misfit, summary
from rollover.comparison.run_pair import Result, difference, pair
from rollover.comparison.synthesis import synthetic
from rollover.dynamics import simulate
from rollover.dynamics.result import Run
from rollover.recording import Recording
from rollover.recording.attitude import ANGLES, QUATERNION, beside, continuous
from rollover.recording.checks import prechecks
from rollover.spec.channels import CHANNELS
from rollover.spec.frames import angles as angles_of
from rollover.spec.frames import from_angles, one_branch, other_branch, rotation_vector
from tests.physics.scenes import shipped
from tests.rollover.attitudes import (
    OTHERWISE,
    TURN,
    by_either_branch,
    by_either_sign,
    by_its_negative,
    within_a_turn,
    within_half_a_turn,
)

ROLL, PITCH, YAW = ANGLES
SPIN = "chassis/angular_velocity_x"
# stood on its nose, a cube passes the lock of roll and yaw within a few degrees
NOSE: dict[str, Any] = {
    "initiation.quaternion": [math.cos(math.radians(30.0)), 0.0, math.sin(math.radians(30.0)), 0.0],
    "initiation.angular_velocity": [0.05, 6.0, 0.1],
    "simulation.duration": 0.4,
}
SCENES: dict[str, tuple[str, dict[str, Any]]] = {
    "multiple_roll": ("multiple_roll", {"simulation.duration": 4.0}),
    "side_overturn": ("side_overturn", {}),
    "cube_toss": ("cube_toss", {"simulation.duration": 0.5}),
    "rear_overturn": ("rear_overturn", {}),
    "nose": ("cube_toss", NOSE),
}
RATES = {"multiple_roll": 25.0, "side_overturn": 50.0, "cube_toss": 100.0, "rear_overturn": 50.0, "nose": 100.0}


@pytest.fixture(autouse=True)
def _rated_sparsely(monkeypatch: pytest.MonkeyPatch) -> None:
    """A thousand samples tell notations apart as ten thousand do; the time warp costs the square of their number."""
    monkeypatch.setattr(rating, "MOST_SAMPLES", 1000)


@cache
def run(scene: str) -> Run:
    name, changes = SCENES[scene]
    return simulate.run(shipped(name).replaced(changes) if changes else shipped(name))


def recorded(scene: str, *channels: str, rate: float = 200.0, share: float = 0.005) -> Recording:
    return synthetic(run(scene).recording, channels=channels, rate=rate, share=share, seed=1)


def compared(scene: str, recording: Recording, cfc: int | None = None) -> Misfit:
    return misfit(run(scene), recording, cfc=cfc, noise=estimated_noise)


@cache
def as_it_is(scene: str) -> Misfit:
    return compared(scene, recorded(scene, *ANGLES, *QUATERNION, rate=RATES[scene]))


def alike(one: Any, other: Any) -> bool:
    """Whether two answers are the same to 1e-9."""
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(alike(one[k], other[k]) for k in one)
    if isinstance(one, list):
        return len(one) == len(other) and all(map(alike, one, other))
    if isinstance(one, float):
        return bool(one == pytest.approx(other, rel=1e-9, abs=1e-9))
    return bool(one == other)


@pytest.mark.parametrize("otherwise", OTHERWISE)
@pytest.mark.parametrize("scene", SCENES)
def test_a_comparison_is_independent_of_attitude_notation(
    scene: str, otherwise: Callable[[Recording], Recording]
) -> None:
    made = recorded(scene, *ANGLES, *QUATERNION, rate=RATES[scene])
    found, expected = compared(scene, otherwise(made)), as_it_is(scene)
    for one, other in zip(found.channels, expected.channels, strict=True):
        np.testing.assert_allclose(one.measured, other.measured, atol=1e-9)
    # a clock is found by a scan in steps of 1e-7 s, which rounding may end elsewhere
    assert alike(summary(replace(found, clock=None)), summary(replace(expected, clock=None)))
    assert max(float(np.std(c.residual)) / (c.noise or 1.0) for c in found.channels) < 1.5


@pytest.mark.parametrize("channels", [(ROLL,), (YAW,), (ROLL, PITCH), (ROLL, YAW), (PITCH, YAW)])
def test_some_of_the_angles_do_as_well(channels: tuple[str, ...]) -> None:
    made = recorded("multiple_roll", *channels, rate=100.0)
    ways = [within_half_a_turn, within_a_turn, *([by_either_branch] if len(channels) > 1 else [])]
    for otherwise in ways:
        found, expected = (beside(r, run("multiple_roll").recording) for r in (otherwise(made), made))
        for name in channels:
            np.testing.assert_allclose(found[name], expected[name], atol=1e-9)
            np.testing.assert_allclose(expected[name], made[name], atol=1e-9)


def test_filters_see_no_jump() -> None:
    """Roll and quaternion are put right before CFC 60 smears a jump over its neighbours."""
    made = recorded("multiple_roll", ROLL, *QUATERNION, rate=1000.0)
    found, expected = (compared("multiple_roll", r, cfc=60) for r in (by_either_sign(within_half_a_turn(made)), made))
    assert all(c.cfc == 60 for c in found.channels)
    for one, other in zip(found.channels, expected.channels, strict=True):
        np.testing.assert_allclose(one.measured, other.measured, atol=1e-9)


@pytest.mark.parametrize("scene", ["multiple_roll", "nose"])
@pytest.mark.parametrize("otherwise", [within_half_a_turn, by_either_sign, by_either_branch])
def test_an_objective_does_not_hang_on_it(scene: str, otherwise: Callable[[Recording], Recording]) -> None:
    made = recorded(scene, *ANGLES, *QUATERNION, rate=100.0)
    scenario = run(scene).scenario
    fitted = (parameter(scenario, "ground.friction.coefficient=0.05:0.9"),)
    how = simulator(scenario)
    both = []
    for each in (otherwise(made), made):
        one = case(scenario, each, how, name="r", noise=estimated_noise)
        both.append(Objective(cases=(one,), parameters=fitted, simulate=how).residuals(np.array([0.4])))
    np.testing.assert_allclose(both[0], both[1], atol=1e-6)  # over a noise of 0.005: 1e-9 of the channel


def test_a_gap_with_a_turn_is_bridged_by_the_simulation() -> None:
    made = recorded("multiple_roll", ROLL, *QUATERNION, rate=100.0)
    roll = run("multiple_roll").recording[ROLL]
    gap = (made.time > 1.2) & (made.time < 3.4)
    assert np.ptp(np.interp([1.2, 3.4], run("multiple_roll").recording.time, roll)) > math.pi
    made = replace(made, channels={n: np.where(gap, np.nan, v) for n, v in made.channels.items()})
    found = beside(by_its_negative(within_half_a_turn(made)), run("multiple_roll").recording)
    for name in made.channels:
        np.testing.assert_allclose(found[name], made[name], atol=1e-9)


def test_turns_between_samples_follow_the_simulation() -> None:
    """At 1 Hz it turns by more than half a turn: nothing in the samples themselves says how far."""
    made = recorded("multiple_roll", ROLL, SPIN, rate=1.0, share=0.0005)
    assert np.abs(np.diff(made[ROLL])).max() > math.pi
    found = compared("multiple_roll", within_half_a_turn(made))
    assert float(np.abs(found.channels[0].residual).max()) < 0.1
    assert any(ROLL in note and "from one sample to the next" in note for note in found.notes)
    assert not compared("multiple_roll", recorded("multiple_roll", ROLL, SPIN)).notes


def faults(recording: Recording) -> list[tuple[str, str]]:
    return [(f.check, f.channel) for f in prechecks(recording) if f.check != "wrap-around"]


def test_noise_about_half_a_turn_is_no_fault_of_a_sensor() -> None:
    """A vehicle on its roof reads now +180, now -180 degrees."""
    rng = np.random.default_rng(3)
    time = np.arange(2000) / 500.0
    roll = -math.pi * np.minimum(time, 1.0) + 0.02 * rng.normal(size=time.size)
    made = Recording(title="on its roof", time=time, channels={ROLL: (roll + math.pi) % TURN - math.pi})
    assert np.abs(np.diff(made[ROLL])).max() > 6.0
    assert [f.check for f in prechecks(made)] == ["wrap-around"]  # said as information
    spiked = made[ROLL].copy()
    spiked[1500] += 1.0
    assert faults(replace(made, channels={ROLL: spiked})) == [("spike", ROLL)]


@pytest.mark.parametrize("otherwise", OTHERWISE)
def test_a_check_finds_no_spike_where_only_the_branch_changes(otherwise: Callable[[Recording], Recording]) -> None:
    made = recorded("cube_toss", *ANGLES, *QUATERNION, rate=1000.0)
    assert faults(otherwise(made)) == faults(made)


def test_an_opposite_sign_of_the_roll_stays_one() -> None:
    made = recorded("multiple_roll", *ANGLES)
    away = replace(made, channels={**made.channels, ROLL: -made[ROLL]})
    found = beside(within_half_a_turn(away), run("multiple_roll").recording)
    np.testing.assert_allclose(found[ROLL], -made[ROLL], atol=1e-9)
    np.testing.assert_allclose(found[PITCH], made[PITCH], atol=1e-9)


def test_half_a_turn_off_is_one_whatever_rounding_says() -> None:
    time = np.arange(50) / 50.0
    still = {n: np.zeros(50) for n in ANGLES} | {n: np.full(50, float(n.endswith("w"))) for n in QUATERNION}
    reference = Recording(title="upright", time=time, channels=still)
    for off in (math.pi, -math.pi, math.pi - 1e-12, -math.pi + 1e-12, 3.0 * math.pi):
        made = Recording(title="on its roof", time=time, channels={ROLL: np.full(50, off)})
        np.testing.assert_allclose(beside(made, reference)[ROLL], math.pi, atol=1e-9)


def test_near_the_lock_a_small_turn_is_a_small_difference() -> None:
    """Two noses down, a twentieth of a radian apart: roll and yaw differ by radians, and the attitudes do not."""
    n, small = 60, 0.05
    swing = Rotation.from_euler("Y", np.linspace(1.2, 1.9, n)[:, None])
    for axis in np.eye(3):
        turned = swing * Rotation.from_rotvec(small * axis)
        reference, made = (_recording(r) for r in (swing, turned))
        found = beside(by_either_branch(made), reference)
        away = np.column_stack([found[a] - reference[a] for a in ANGLES])
        size = np.linalg.norm(away, axis=1)
        assert size.max() < small / 0.366 * 1.05  # (A2) at its least factor
        assert size.min() > 0.9 * small / math.sqrt(2.0)  # and at its largest, sqrt 2


def test_away_from_the_lock_angles_differ_by_their_difference() -> None:
    n = 60
    rng = np.random.default_rng(5)
    reference = _recording(
        Rotation.from_euler("ZYX", np.column_stack([np.linspace(0.0, a, n) for a in (2.0, 0.6, 3.0)]))
    )
    made = replace(reference, channels={a: reference[a] + 0.3 * rng.normal(size=n) for a in ANGLES})
    for name in ANGLES:
        np.testing.assert_allclose(beside(by_either_branch(made), reference)[name], made[name], atol=1e-9)


def test_a_run_stays_on_one_branch_over_a_right_angle() -> None:
    """Rearing over, it pitches on; that roll and yaw are half a turn instead is a matter of rounding."""
    found = run("rear_overturn").recording
    assert np.ptp(found[PITCH]) > 2.5
    # it falls back along a line that is unstable sideways: rounding grows, to 1.4 mrad here; half a turn is 3 rad
    assert max(float(np.abs(found[a]).max()) for a in (ROLL, YAW)) < 0.05
    for pitch in (np.linspace(0.0, 4.0, 101), -np.linspace(0.0, 4.0, 401), np.radians(np.arange(0.0, 200.0, 45.0))):
        made = angles_of(np.array([rotation_vector(from_angles(0.0, p, math.pi)) for p in pitch]))
        np.testing.assert_allclose(np.column_stack(made), [[0.0, p, math.pi] for p in pitch], atol=1e-7)


def test_branches_are_told_in_spite_of_samples_that_are_lost() -> None:
    rng = np.random.default_rng(6)
    rpy = np.cumsum(0.05 * rng.normal(size=(200, 3)), axis=0)
    written = np.where(rng.random((200, 1)) < 0.5, other_branch(rpy), rpy)
    written[rng.random(200) < 0.2] = np.nan
    written[0] = rpy[0]
    found = one_branch(written)
    there = np.isfinite(written)
    np.testing.assert_allclose(found[there], rpy[there], atol=1e-9)


def test_a_recording_on_one_branch_is_itself() -> None:
    made = recorded("multiple_roll", *ANGLES, *QUATERNION)
    assert continuous(made) is made
    plain = recorded("multiple_roll", SPIN)
    assert beside(plain, run("multiple_roll").recording) is plain
    found = beside(made, run("multiple_roll").recording)
    for name in made.channels:
        np.testing.assert_array_equal(found[name], made[name])


def test_pitch_alone_is_compared_in_the_range_it_is_recorded_in() -> None:
    """An instrument that tells no pitch beyond a right angle makes no mismatch of a vehicle that rears over."""
    made = recorded("rear_overturn", PITCH, share=0.001)
    folded = replace(made, channels={PITCH: np.arcsin(np.sin(made[PITCH]))})
    for each in (made, folded):
        found = compared("rear_overturn", each).channels[0]
        assert float(np.std(found.residual)) < 2.0 * made.noise[PITCH]


def test_two_runs_are_compared_on_one_branch() -> None:
    made = run("nose").recording
    turned = replace(by_its_negative(made), channels={**by_its_negative(made).channels, ROLL: made[ROLL] + TURN})
    results = [_result(r) for r in (made, turned)]
    found = pair(*results)
    for name in (*ANGLES, *QUATERNION):
        np.testing.assert_allclose(difference(found, name)[1], 0.0, atol=1e-9)


def test_the_table_of_channels_knows_what_is_periodic() -> None:
    behind = {f"trailer/{angle}" for angle in ("roll", "pitch", "yaw")}
    assert {n for n, c in CHANNELS.items() if c.period is not None} == {*ANGLES, *behind, "axle/front/angle"}
    time = np.arange(200) / 100.0
    angle = 0.05 * np.sin(time * 9.0)
    made = Recording(title="pivot", time=time, channels={"axle/front/angle": angle % TURN})
    reference = Recording(title="run", time=time, channels={"axle/front/angle": angle})
    np.testing.assert_allclose(beside(made, reference)["axle/front/angle"], angle, atol=1e-9)


def _recording(turns: Rotation) -> Recording:
    yaw, pitch, roll = turns.as_euler("ZYX").T
    rpy = one_branch(np.column_stack([roll, pitch, yaw]))
    q = turns.as_quat(canonical=True)
    channels = {a: rpy[:, k].copy() for k, a in enumerate(ANGLES)} | {n: q[:, k - 1] for k, n in enumerate(QUATERNION)}
    return continuous(Recording(title="turns", time=np.arange(rpy.shape[0]) / 200.0, channels=channels))


_result = partial(
    lambda recording, scene: Result(
        folder=None,  # type: ignore[arg-type]
        answer={"criteria": []},
        scenario=run(scene).scenario,
        recording=recording,
        peaks=(),
    ),
    scene="nose",
)
