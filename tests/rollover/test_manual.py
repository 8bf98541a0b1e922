"""Every command's help is a manual, and what is mistyped gets its cure."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from rollover.cli.main import app
from rollover.system.errors import absent

WIDE = {"COLUMNS": "400", "TERM": "dumb", "NO_COLOR": "1"}
COMMANDS = sorted(c.name or c.callback.__name__ for c in app.registered_commands if c.callback)


def asked(*words: str) -> Any:
    return CliRunner().invoke(app, list(words), env=WIDE)


def manual_of(command: str) -> str:
    done = asked(command, "--help")
    assert done.exit_code == 0, done.output
    return str(done.output)


def test_there_are_commands() -> None:
    assert {"run", "view", "compare", "diagnose", "prove", "regress", "study"} <= set(COMMANDS)


@pytest.mark.parametrize("command", COMMANDS)
def test_help_says_what_how_where_and_with_which_status(command: str) -> None:
    text = manual_of(command)
    lines = [line.strip() for line in text.splitlines()]
    first = next(line for line in lines if line and not line.startswith("Usage:"))
    assert len(first) > 25, "what it does"
    assert first.endswith(".")
    assert any(line.startswith("Writes:  ") and len(line) > 20 for line in lines)
    (status,) = [line for line in lines if line.startswith("Exit status:")]
    assert re.match(r"Exit status:  0 done; (1 .*; )?2 the input is wrong.*\.$", status)


@pytest.mark.parametrize("command", COMMANDS)
def test_its_examples_use_what_there_is(command: str) -> None:
    text = manual_of(command)
    examples = re.findall(r"Example:  (rollover .*?)\s*$", text, flags=re.MULTILINE)
    assert examples
    for example in examples:
        words = shlex.split(example)
        assert words[1] == command
        for option in (word.partition("=")[0] for word in words[2:] if word.startswith("--")):
            assert re.search(rf"(^|[\s/]){option}\b", text, flags=re.MULTILINE), option


def test_defaults_are_not_swallowed() -> None:
    assert "[default: (out/run/NAME)]" in manual_of("run")
    assert "[default: (all shipped)]" in manual_of("regress")


def test_the_first_page_names_every_command_and_the_exit_status() -> None:
    text = asked("--help").output
    for command in COMMANDS:
        assert re.search(rf"^\W*{command}\s", text, flags=re.MULTILINE), command
    for status in ("0 done", "1 the answer is no", "2 the input is wrong", "3 a simulation failed"):
        assert status in text


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "recordings").mkdir()
    (tmp_path / "recordings" / "drop3.csv").write_text("t,F\n0,0\n")
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "recording.rrd").write_bytes(b"")
    return tmp_path


@pytest.mark.parametrize(
    ("words", "cure"),
    [
        ("rnu drop_test", "Did you mean 'run'?"),
        ("run drop_test --forse", "--force"),
        ("run drop_tset", "drop_tset: no such file; did you mean 'drop_test'?"),
        ("run side/overtrun.yaml", "no such file"),
        ("run drop_test --set initiation.sped=3", "did you mean 'initiation.speed'"),
        ("list efects", "got 'efects'; did you mean 'effects'?"),
        ("list paths drop_tset", "did you mean 'drop_test'?"),
        ("schema scenarios", "got 'scenarios'; did you mean 'scenario'?"),
        ("check recordings/drop_3.csv", "did you mean 'recordings/drop3.csv'?"),
        ("compare drop_test recrdings/drop3.csv", "did you mean 'recordings/drop3.csv'?"),
        ("compare drop_test recordings/x/drop3.csv", "the folder 'recordings' is there, 'x' in it is not"),
        ("diagnose drop_test recording", "did you mean 'recordings'?"),
        ("identify recordings/drop2.csv", "did you mean 'recordings/drop3.csv'?"),
        ("import recordings/drop3.cvs", "did you mean 'recordings/drop3.csv'?"),
        ("view result", "did you mean 'results'?"),
        ("view results/recoding.rrd", "did you mean 'results/recording.rrd'?"),
        ("view nowhere", "nowhere: no such file; `rollover run` writes results"),
        ("view recordings", "no recording.rrd there; `rollover run` writes one"),
        ("view recordings/drop3.csv", "not a recording for the viewer; an .rrd file is needed"),
        ("view results --html page.pdf", "--html: not the name of a page, got 'page.pdf'; NAME.html is needed"),
        ("regress side_overtrun", "did you mean 'side_overturn'?"),
        ("stability utility_tracto", "did you mean 'utility_tractor'?"),
        ("calibrate drop_test recordings/drop4.csv --fit vehicle.mass", "did you mean 'recordings/drop3.csv'?"),
        ("synthesize drop_tset", "did you mean 'drop_test'?"),
        ("prove --kinds nul", "got 'nul'; null, decoy"),
    ],
)
def test_what_is_mistyped_gets_its_cure_and_nothing_is_written(here: Path, words: str, cure: str) -> None:
    before = sorted(here.rglob("*"))
    done = asked(*shlex.split(words))
    assert done.exit_code == 2, done.output
    assert cure in " ".join(done.stderr.split())
    assert sorted(here.rglob("*")) == before


def test_a_wrong_path_is_corrected_where_it_goes_wrong(here: Path) -> None:
    wanted = here / "recordings" / "drop3.csv"
    assert absent(here / "recording" / "drop3.csv") == f"no such file; did you mean {str(wanted)!r}?"
    assert absent(here / "recordings" / "zzz.txt") == "no such file"
    assert absent(here / "recordings" / "drop3.csv" / "more") == "no such file", "below a file there is nothing"
    (here / "recordingz").mkdir()
    assert str(wanted) in absent(here / "recordingz_" / "drop3.csv"), "the neighbour that has the rest"


@pytest.mark.parametrize("command", [*COMMANDS, ""])
def test_a_flag_has_no_type_and_what_replaces_can_be_taken_back(command: str) -> None:
    text = asked(*filter(None, [command]), "--help").output
    assert "<bool>" not in text
    assert "--help" in text
    if "--force" in text:
        assert re.search(r"--force\s.*--no-force\s", text)


def test_what_takes_a_value_still_says_of_which_kind() -> None:
    assert re.search(r"--ensemble\s+<int", manual_of("run"))
    assert re.search(r"--set\s+PATH=VALUE", manual_of("run"))
