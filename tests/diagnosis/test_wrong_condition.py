"""A drop that contradicts the speed that it states is excluded; one that met what others did not is kept."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from rollover.diagnosis import diagnose
from rollover.diagnosis.data.dataset import Dataset, dataset_of
from rollover.diagnosis.data.inconsistent import wrong_conditions
from rollover.diagnosis.forward.forward_model import simulator_of
from rollover.recording import Recording
from tests.diagnosis.drops import ACCELERATION, DEPTH, FORCE, recorded, scenario

SPEED, SPEEDS = "initiation.speed", (1.0, 1.6, 2.2, 2.8, 3.4)
DAMPING = {"effects.soil-viscous-damping.damping": 180.0}
Recordings = list[tuple[str, Recording]]


def drops(changes: dict[str, Any], speeds: tuple[float, ...] = SPEEDS) -> Recordings:
    return recorded(changes, 5, speeds=speeds, channels=(FORCE, DEPTH, ACCELERATION), rate=1000.0)


def stating(made: Recordings, which: int, times: float) -> Recordings:
    """The same, one of them with a speed that it was not dropped at."""
    name, one = made[which]
    wrong = replace(one, conditions={**one.conditions, SPEED: one.conditions[SPEED] / times})
    return [*made[:which], (name, wrong), *made[which + 1 :]]


def dataset(made: Recordings) -> list[Dataset]:
    found = [dataset_of(name, r, simulator_of(scenario(), r)) for name, r in made]
    assert all(e is not None for e in found)
    return [e for e in found if e is not None]


@pytest.mark.parametrize("missing", [{}, DAMPING, {"effects.impact-speed.scale": 1.15}])
@pytest.mark.parametrize(("which", "times"), [(1, 1.5), (4, 0.7), (0, 1.3)])
def test_the_speed_of_a_wrong_drop_is_estimated(missing: dict[str, Any], which: int, times: float) -> None:
    """Beside what is missing too, and to what that bends it: a tenth."""
    every = dataset(stating(drops(missing), which, times))
    [found] = wrong_conditions(every)
    assert found.dataset is every[which]
    assert found.speed == pytest.approx(SPEEDS[which], rel=0.1)
    assert f"not at the stated {SPEEDS[which] / times:.3g} m/s; it was excluded" in found.message()


@pytest.mark.parametrize(
    "missing",
    [
        {},
        DAMPING,
        {"effects.soil-layer.depth": 0.2},  # which only the fastest comes to
        {"effects.soil-layer.depth": 0.14, "effects.soil-layer.stiffness_ratio": 5.0},
        {"effects.impact-speed.scale": 1.2},  # of all
        {"effects.sensor-scale.scale": 1.2, "effects.sensor-scale.channel": DEPTH},
        {"ground.law.stiffness_scale": 2.0},
        {"effects.soil-layer.depth": 0.19, "effects.soil-layer.stiffness_ratio": 0.1},  # as if it came faster
    ],
)
def test_what_ground_and_sensors_do_is_no_other_speed(missing: dict[str, Any]) -> None:
    assert wrong_conditions(dataset(drops(missing))) == []


@pytest.mark.parametrize("which", [1, 4])
def test_another_mass_in_one_drop_is_no_other_speed(which: int) -> None:
    """Another speed leaves a quarter of what it misses, but far more than the others leave."""
    made = drops({})
    made[which] = drops({"vehicle.mass": 110.0})[which]
    assert wrong_conditions(dataset(made)) == []


def test_of_three_drops_none_is_apart_and_two_are_no_one() -> None:
    assert wrong_conditions(dataset(stating(drops({}, SPEEDS[:3]), 1, 1.5))) == []
    assert wrong_conditions(dataset(stating(stating(drops({}), 1, 1.5), 3, 0.6))) == []


@pytest.mark.parametrize(("missing", "named"), [(DAMPING, ["soil-viscous-damping"]), ({}, [])])
def test_such_a_drop_is_left_aside_and_the_others_are_diagnosed(missing: dict[str, Any], named: list[str]) -> None:
    found = diagnose(scenario(), stating(drops(missing), 1, 1.5))
    assert [e.id for e in found.effects] == named
    assert found.verdict == ("missing-physics" if named else "unexplained")
    assert "not at the stated 1.07 m/s; it was excluded" in found.sentence
    assert ("What is stated of a recording is not what was tested. Otherwise" in found.sentence) == (not named)
    assert "v1.6" not in found.training
    assert any("it was excluded" in note for note in found.notes)
