"""Options that are numbers: refused where they are read, in one line that names them, before anything else is done."""

from __future__ import annotations

from collections.abc import Iterator
from typing import get_args, get_type_hints

import numpy as np
import pytest
import typer.main
from typer.testing import CliRunner

import rollover as ro
from rollover.cli.main import app
from rollover.comparison.synthesis import check_clock
from rollover.recording import Recording
from rollover.recording.record import CLASSES
from rollover.system.arguments import LEAST_CFC, MOST_CFC
from rollover.system.errors import InputError
from tests.fuzz.oracle import is_whole

COMMANDS = typer.main.get_command(app).commands  # type: ignore[attr-defined]


def numbers(kind: type) -> Iterator[tuple[str, str]]:
    """Command and option of every number of a kind that a command takes."""
    for name, command in sorted(COMMANDS.items()):
        hints = get_type_hints(command.callback)
        for option in command.params:
            if kind in (hints[option.name], *get_args(hints[option.name])):
                yield name, option.opts[0]


NUMBERS, WHOLE = list(numbers(float)), list(numbers(int))


def test_there_are_such_options() -> None:
    assert {("synthesize", "--late"), ("identify", "--buoyancy"), ("study", "--memory-limit")} <= set(NUMBERS)
    assert len(NUMBERS) >= 9
    assert {("compare", "--cfc"), ("prove", "--seed"), ("study", "--workers")} <= set(WHOLE)


@pytest.mark.parametrize("value", ["nan", "inf", "-inf", "1e300", "-1e300", "1e30", "NaN"])
@pytest.mark.parametrize(("name", "option"), NUMBERS)
def test_a_number_beyond_all_bounds_is_refused(name: str, option: str, value: str) -> None:
    refused(name, option, value)


@pytest.mark.parametrize("value", ["1" + "0" * 25, "-1" + "0" * 25, "9" * 400])
@pytest.mark.parametrize(("name", "option"), WHOLE)
def test_a_whole_number_beyond_all_bounds_is_refused(name: str, option: str, value: str) -> None:
    refused(name, option, value)


def refused(name: str, option: str, value: str) -> None:
    words = ["nothing" for p in COMMANDS[name].params if p.param_type_name == "argument" and p.required]
    required = [
        w for p in COMMANDS[name].params if p.param_type_name == "option" and p.required for w in (p.opts[0], "x")
    ]
    result = CliRunner().invoke(app, [name, *words, *required, f"{option}={value}"])
    assert result.exit_code == 2, result.output
    (line,) = result.stderr.splitlines()
    assert f"'{option}'" in line
    assert is_whole(line) == ""
    assert "np.float" not in line


def test_filter_classes_of_options_are_those_of_recordings() -> None:
    assert (min(CLASSES), max(CLASSES)) == (LEAST_CFC, MOST_CFC)


@pytest.mark.parametrize(("rate", "late"), [(1e6, 1e10), (1e6, -1e10), (1e3, 1e13)])
def test_stamps_that_a_double_cannot_tell_apart(rate: float, late: float) -> None:
    with pytest.raises(InputError, match="late: stamps cannot be distinguished"):
        check_clock(rate, late)


@pytest.mark.parametrize(("rate", "late"), [(1e3, 1.8e9), (1e5, 1e9), (1e6, 1e5), (1e3, -1e9)])
def test_clocks_of_an_epoch_are_told_apart(rate: float, late: float) -> None:
    check_clock(rate, late)
    Recording(title="", time=np.round(late + np.arange(1000) / rate, 9), channels={})  # which refuses equal stamps


@pytest.mark.parametrize("late", [float("nan"), float("inf"), 1e30])
def test_scripts_are_held_to_the_same(late: float) -> None:
    with pytest.raises(InputError, match="late: out of bounds"):
        ro.synthesize("drop_test", late=late)
    with pytest.raises(InputError, match="clock_sigma: out of bounds"):
        ro.calibrate("drop_test", [], fit="vehicle.mass", clock_sigma=late)


def test_noise_beyond_all_numbers_is_refused() -> None:
    with pytest.raises(InputError, match=r"noise: beyond all numbers, got .* for ground/force_normal; a smaller"):
        ro.synthesize("drop_test", sigmas={"ground/force_normal": 1e308})


@pytest.mark.parametrize("words", [["--effects", "\ud800"], ["run", "\ud800"], ["check", "a.yaml", "--\ud800"]])
def test_half_a_character_is_no_word(words: list[str]) -> None:
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 2
    assert result.stderr.splitlines()[0].startswith("rollover: not text, got '")
    assert is_whole(result.stderr.strip()) == ""


def test_a_name_that_is_no_text_in_any_encoding_is_a_name() -> None:
    result = CliRunner().invoke(app, ["check", "gone\udcff.yaml"])
    assert result.exit_code == 2
    assert "no such" in result.stderr
