"""A channel in another unit or of the opposite sign is said to be that, and what is missing is found beside it."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rollover.diagnosis import diagnose
from rollover.diagnosis.data import inconsistent as slipping
from rollover.diagnosis.data.inconsistent import Inconsistency, find_inconsistencies
from rollover.diagnosis.data.repeatability import without_copies
from rollover.diagnosis.fit.jobs import Executor
from rollover.diagnosis.prepared import prepared
from rollover.recording import Recording
from tests.diagnosis.drops import ACCELERATION, DEPTH, FORCE, recorded, scenario

CHANNELS = (FORCE, DEPTH, ACCELERATION)
LAYER = {"effects.soil-layer.depth": 0.05, "effects.soil-layer.stiffness_ratio": 2.0}
Drops = list[tuple[str, Recording]]


def mistaken(made: Drops, channel: str, factor: float, which: int | None = 1) -> Drops:
    """One recording, or all, with a channel times a factor."""
    return [
        (n, replace(r, channels={**r.channels, channel: factor * r[channel]}) if which in (None, k) else r)
        for k, (n, r) in enumerate(made)
    ]


@pytest.mark.parametrize(
    ("channel", "factor", "said"),
    [
        (FORCE, -1.0, "its sign were the opposite one"),
        (ACCELERATION, 1.0 / 9.80665, "it were in g and not in the unit stated"),
        (ACCELERATION, -9.80665, "it had been converted from g once too often, and its sign the opposite one"),
        (DEPTH, 1000.0, "it were in mm and not in the unit stated"),
    ],
)
def test_a_unit_error_is_unexplained_and_named_as_one(channel: str, factor: float, said: str) -> None:
    found = diagnose(scenario(), mistaken(recorded({}, 4, speeds=(1.5, 2.0, 2.5), channels=CHANNELS), channel, factor))
    assert (found.verdict, found.effects) == ("unexplained", ())
    assert [(p.recording, p.channel, p.share) for p in found.where] == [("v2.0", channel, 1.0)]
    assert f"v2.0: {channel} reads" in found.sentence
    assert said in found.sentence
    assert "Otherwise simulation and 3 recordings agree within the noise" in found.sentence


@pytest.mark.parametrize(
    ("channel", "factor", "which"), [(DEPTH, -1.0, None), (FORCE, -1.0, 1), (FORCE, 1000.0, 1), (DEPTH, 1000.0, None)]
)
def test_what_else_is_missing_is_found_beside_it(channel: str, factor: float, which: int | None) -> None:
    whole = recorded(LAYER, 4, speeds=(1.5, 2.0, 2.5), channels=CHANNELS, rate=1000.0)
    found = diagnose(scenario(), mistaken(whole, channel, factor, which))
    assert [e.id for e in found.effects] == ["soil-layer"]
    depth = found.effects[0].parameters["depth"]
    assert depth.low <= LAYER["effects.soil-layer.depth"] <= depth.high
    assert found.sentence.count("it was excluded") == (1 if which else len(whole))


@pytest.mark.parametrize("factor", [1e-3, -1.0, 9.80665])
def test_what_all_are_too_large_by_is_a_gain(factor: float) -> None:
    whole = recorded({}, 4, speeds=(1.5, 2.0, 2.5), channels=CHANNELS)
    found = diagnose(scenario(), mistaken(whole, FORCE, factor, None))
    assert [(e.id, e.channel) for e in found.effects] == [("sensor-gain", FORCE)]
    assert found.effects[0].parameters["gain"].value == pytest.approx(factor, rel=5e-3)
    assert "it was excluded" not in found.sentence


def test_without_other_recordings_it_cannot_be_distinguished() -> None:
    found = diagnose(scenario(), mistaken(recorded({}, 4, channels=(DEPTH,)), DEPTH, -1.0, None))
    assert (found.verdict, found.effects) == ("cannot-tell", ())
    assert found.sentence.count("its sign were the opposite one") == 3


def inconsistencies(made: Drops) -> tuple[list[Inconsistency], list[Inconsistency]]:
    every, _ = prepared(scenario(), made, Executor())
    return find_inconsistencies(every)


@pytest.mark.parametrize("factor", [0.6, 1.4, math.pi, 4.4482])
def test_no_other_factor_is_a_unit_error(factor: float) -> None:
    """Of a force: 1.4 may be a gain, nobody writes forces down in 1/pi N, and pounds may be ground that is harder."""
    made = recorded({}, 4, speeds=(1.5, 2.0, 2.5), channels=CHANNELS)
    assert inconsistencies(mistaken(made, FORCE, factor)) == ([], [])
    assert len(inconsistencies(mistaken(made, FORCE, 9.80665))[0]) == 1


def test_what_goes_its_own_way_is_no_unit_error() -> None:
    """A channel turned round, with as much again that the simulation does not have: r = 0.7."""
    made = mistaken(recorded({}, 4, speeds=(1.5, 2.0, 2.5), channels=CHANNELS), FORCE, -1.0)
    other = np.roll(made[1][1][FORCE], 40) * 0.8
    made[1] = (made[1][0], replace(made[1][1], channels={**made[1][1].channels, FORCE: made[1][1][FORCE] + other}))
    assert inconsistencies(made) == ([], [])


@pytest.mark.parametrize(("apart", "is_unit_error"), [(0.6, True), (0.8, False)])
def test_what_perturbed_runs_do_as_well_is_no_unit_error(apart: float, is_unit_error: bool) -> None:
    """Runs that nobody could tell apart, by so much of a channel: 0.71 of it leave |r| = 0.7."""
    made = mistaken(recorded({}, 4, speeds=(1.5, 2.0, 2.5), channels=CHANNELS), FORCE, -1.0)
    every, _ = prepared(scenario(), made, Executor())
    there = every[1].simulator.predict({}, 0.0)
    assert there is not None
    perturbed = [{FORCE: size * apart * there[FORCE]} for size in (-1.0, 1.0, 0.0, 3.0, -1.0)]
    every[1] = replace(
        every[1], simulator=SimpleNamespace(predict=every[1].simulator.predict, perturbed=lambda: perturbed)
    )
    assert [inconsistency.signal.channel for inconsistency in find_inconsistencies(every)[0]] == [FORCE] * is_unit_error


def test_ground_three_times_as_stiff_is_no_unit_error() -> None:
    """Sinkages of 0.4 to 0.6 times what is simulated: the layer's work, more so the faster the drop."""
    hard = {"effects.soil-layer.depth": 0.04, "effects.soil-layer.stiffness_ratio": 3.2}
    speeds = (1.1, 1.6, 2.1, 2.6, 3.1)
    found = diagnose(scenario(), recorded(hard, 4, speeds=speeds, channels=CHANNELS, rate=1000.0))
    assert [e.id for e in found.effects] == ["soil-layer"]
    assert "it was excluded" not in found.sentence


@pytest.mark.parametrize(
    ("channel", "factor", "shared"),
    [
        ("striker/acceleration_z", -1.0, True),
        ("ground/sinkage", -1.0, False),
        ("chassis/roll", -1.0, False),
        ("chassis/roll", 57.3, True),
    ],
)
def test_a_scale_is_never_negative(channel: str, factor: float, shared: bool) -> None:
    """A channel turned round in all recordings has a negative gain; a length or an angle has none: it is excluded."""
    every: list[Any] = [SimpleNamespace(name=name, signals=(SimpleNamespace(channel=channel),)) for name in "ab"]
    found = [Inconsistency(dataset=e, signal=e.signals[0], factor=factor, cause="such") for e in every]
    assert slipping._is_shared(found[0], found, every) is shared
    assert not slipping._is_shared(found[0], found[:1], every)


def test_a_copy_of_a_recording_is_no_second_test() -> None:
    drops = recorded({}, noise=0.02)
    name, first = drops[0]
    found, lines = without_copies([*drops, ("again", first)])
    assert [n for n, _ in found] == [n for n, _ in drops]
    assert lines == [f"again: holds the very samples of {name}: a copy, not a second test; it was excluded"]
    answer = diagnose(scenario(), [*drops, ("again", first)])
    assert answer.training == tuple(n for n, _ in drops)
    assert lines[0] in answer.notes


def test_a_copy_that_is_asked_for_or_states_otherwise_stays() -> None:
    drops = recorded({}, noise=0.02)
    found, lines = without_copies([*drops, ("again", drops[0][1])], ("again",))
    assert "again" in dict(found)
    assert lines[0].endswith("one test counts twice")
    other = replace(drops[0][1], conditions={"initiation.speed": 2.5})
    found, lines = without_copies([*drops, ("again", other)])
    assert "again" in dict(found)
    assert lines[0].endswith("one of the two was not made as it states")
    louder = {**drops[0][1].channels, FORCE: drops[0][1][FORCE] + 1.0}
    assert without_copies([*drops, ("again", replace(drops[0][1], channels=louder))])[1] == []
