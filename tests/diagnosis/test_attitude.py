"""What a diagnosis takes from a recording does not hang on how its attitude is written."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from rollover.comparison.synthesis import synthetic
from rollover.diagnosis.data.dataset import Dataset, dataset_of
from rollover.diagnosis.data.inconsistent import find_inconsistencies
from rollover.diagnosis.data.quantisation import without_spikes
from rollover.diagnosis.forward.averaging import compared
from rollover.dynamics import simulate
from rollover.recording import Recording
from rollover.recording.attitude import ANGLES, QUATERNION
from rollover.scenario import Scenario
from tests.physics.scenes import shipped
from tests.rollover.attitudes import OTHERWISE, within_half_a_turn

ROLL = ANGLES[0]
FRICTION = "ground.friction.coefficient"
SCENES: dict[str, dict[str, Any]] = {
    "multiple_roll": {"simulation.duration": 3.0},
    "side_overturn": {"simulation.duration": 1.5},
    "cube_toss": {"simulation.duration": 0.4},
}


def scene(name: str) -> Scenario:
    return shipped(name).replaced(SCENES[name])


@cache
def recorded(name: str) -> Recording:
    made = simulate.run(scene(name).of_many()).recording  # by the integrator that predicts: another one parts from it
    return synthetic(made, channels=(*ANGLES, *QUATERNION), rate=150.0, seed=4)


def dataset(name: str, recording: Recording) -> tuple[Dataset, np.ndarray]:
    """What `diagnose` makes of a recording, and what it predicts with another friction."""
    _, thin, simulator, averaged = compared(scene(name), without_spikes(recording)[0])
    found = dataset_of("r", thin, simulator, averaged)
    there = simulator.predict({FRICTION: 0.31}, 0.001)
    assert found is not None
    assert there is not None
    return found, found.raw(there)


@cache
def as_it_is(name: str) -> tuple[Dataset, np.ndarray]:
    return dataset(name, recorded(name))


@pytest.mark.parametrize("otherwise", OTHERWISE)
@pytest.mark.parametrize("name", SCENES)
def test_the_dataset_is_the_same(name: str, otherwise: Callable[[Recording], Recording]) -> None:
    (found, there), (expected, there_too) = dataset(name, otherwise(recorded(name))), as_it_is(name)
    assert [s.channel for s in found.signals] == [s.channel for s in expected.signals] == [*ANGLES, *QUATERNION]
    for one, other in zip(found.signals, expected.signals, strict=True):
        np.testing.assert_allclose(one.values, other.values, atol=1e-9)
        assert one.sigma == pytest.approx(other.sigma, rel=1e-6)
    np.testing.assert_allclose(there, there_too, atol=1e-9)
    misfit = found.measured() - found.stacked(found.simulator.predict({}, 0.0) or {})
    assert float(np.sqrt(np.mean(misfit**2))) < 1.2


def test_near_the_lock_a_later_run_is_no_other_attitude() -> None:
    """A cube thrown on its nose: roll and yaw swing by radians within a millisecond, it turns by 6 mrad."""
    start = {"initiation.quaternion": [0.75**0.5, 0.0, 0.5, 0.0], "initiation.angular_velocity": [0.05, 6.0, 0.1]}
    own = shipped("cube_toss").replaced({**start, "simulation.duration": 0.4})
    made = simulate.run(own).recording
    assert max(np.abs(np.interp(made.time - 1e-3, made.time, made[a]) - made[a]).max() for a in ANGLES) > 1.0
    _, _, simulator, _ = compared(own, synthetic(made, channels=ANGLES, rate=500.0, share=1e-4, seed=4))
    now, later = simulator.predict({}, 0.0), simulator.predict({}, 1e-3)
    assert now is not None
    assert later is not None
    # (A2) makes of a turn at most 1/0.366 times as much, and rates rise at an impact
    assert max(float(np.nanmax(np.abs(later[a] - now[a]))) for a in ANGLES) < 3.0 * 6e-3 / 0.366


def test_an_opposite_sign_of_a_wrapped_roll_is_found() -> None:
    made = recorded("multiple_roll")
    roll = replace(made, channels={ROLL: made[ROLL]}, noise={})
    away = within_half_a_turn(replace(roll, channels={ROLL: -made[ROLL]}))
    for recording, said in ((within_half_a_turn(roll), []), (away, [-1.0])):
        some, shared = find_inconsistencies([dataset("multiple_roll", recording)[0]])
        assert [s.factor for s in (*some, *shared)] == pytest.approx(said, abs=0.01)
