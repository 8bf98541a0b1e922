"""On a clock at any offset from -1 s to 1e9 s every number of every command is the same, but where its zero lies."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from rollover.cli.main import app
from rollover.recording import Clock, Recording
from rollover.recording.importers.plain import write
from tests.diagnosis.drops import recorded
from tests.rollover.test_onset import drop

UNKNOWN = Clock(zero="unknown")
SAME = 1e-6  # of each number
DRAWN = np.random.default_rng(57).uniform(-3.0, 9.0, 2)  # of log10: two offsets that nobody chose
OFFSETS = (-1.0, 1e9, *(float(10.0**power) for power in DRAWN))
DAMPING = "effects.soil-viscous-damping.damping"
# where the zero lies, and what hangs on the time of day or the name of a folder
OWN = (
    "clocks",
    "clock_offsets",
    "late",
    "zero",
    "notes",
    "remarks",
    "seconds",
    "origin",
    "offset",
    "source",
    "recordings",
    "sha256",
)


def three() -> dict[str, Recording]:
    return {f"d{v}": drop(k, v, rate=500.0) for k, v in enumerate((2.0, 2.5, 3.0))}


def damped() -> dict[str, Recording]:
    return dict(recorded({DAMPING: 180.0}, 3, speeds=(1.0, 3.0)))


COMMANDS: dict[str, tuple[Any, tuple[str, ...]]] = {
    "identify": (three, ("identify",)),
    "calibrate": (three, ("calibrate", "drop_test", "--fit", "vehicle.mass")),
    "compare": (three, ("compare", "drop_test")),
    "diagnose": (damped, ("diagnose", "drop_test", "--set", "simulation.duration=0.4", "--workers", "1")),
}


def answered(folder: Path, command: str, offset: float, clock: Clock) -> Any:
    made, words = COMMANDS[command]
    place = folder / f"{command}{offset:g}{clock.zero}"
    place.mkdir()
    for name, one in made().items():
        write(replace(one, time=one.time + offset, clock=clock), place / f"{name}.csv")
    done = CliRunner().invoke(app, [*words, str(place), "--out", str(place / "out"), "--json"])
    assert done.exit_code == 0, done.output
    return json.loads(done.stdout)


def numbers(answer: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[tuple[Any, ...], Any]]:
    """What an answer says, by place, without what is of the clock itself."""
    if isinstance(answer, Mapping):
        for key, value in answer.items():
            if key not in OWN:
                yield from numbers(value, (*path, key))
    elif isinstance(answer, list):
        for k, value in enumerate(answer):
            yield from numbers(value, (*path, k))
    elif isinstance(answer, (int, float)):
        yield path, answer


@pytest.fixture(scope="module")
def answers(tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder, known = tmp_path_factory.mktemp("clocks"), {}

    def answer(command: str, offset: float, clock: Clock = UNKNOWN) -> Any:
        key = (command, offset, clock)
        if key not in known:
            known[key] = answered(folder, command, offset, clock)
        return known[key]

    return answer


@pytest.mark.parametrize("command", COMMANDS)
def test_every_number_is_the_same_on_any_clock(command: str, answers: Any) -> None:
    first = dict(numbers(answers(command, 0.0)))
    assert len(first) > 20
    for offset in OFFSETS[: 2 if command == "diagnose" else None]:
        found = dict(numbers(answers(command, offset)))
        assert found.keys() == first.keys()
        # of stamps at 1e9 s the file holds 1e-7 s, and a number that is nought up to rounding has no digits
        off = {p: (v, first[p]) for p, v in found.items() if not math.isclose(v, first[p], rel_tol=SAME, abs_tol=1e-9)}
        assert not off, f"{command} at {offset:g} s"


def test_intervals_on_an_unknown_clock_hold_the_value_on_time(answers: Any) -> None:
    right, late = (answers("identify", *how) for how in ((0.0, Clock()), (1e9,)))
    for one, other in zip(right["coefficients"], late["coefficients"], strict=True):
        if other["low"] is not None and other["high"] is not None:
            assert other["low"] <= one["value"] <= other["high"], one["name"]
    (right,), (late,) = (answers("calibrate", *how)["parameters"].values() for how in ((0.0, Clock()), (1e9,)))
    assert late["low"] <= right["value"] <= late["high"]
    (right,), (late,) = (answers("diagnose", *how)["effects"] for how in ((0.0, Clock()), (1e9,)))
    assert right["id"] == late["id"] == "soil-viscous-damping"
    of = late["parameters"]["damping"]
    assert of["low"] <= right["parameters"]["damping"]["value"] <= of["high"]
    assert of["low"] <= 180.0 <= of["high"]
