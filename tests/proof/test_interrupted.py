"""A campaign that is interrupted goes on with the cases that are left, and ends as an undisturbed one."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from click.testing import Result
from typer.testing import CliRunner

from rollover.cli.commands.common import app
from rollover.proof import kept, runner
from rollover.system.processes import Failure, Outcome, map_cases

QUICK = ["prove", "--cases", "2", "--kinds", "null", "--workers", "0"]
COUNTED = "tests.proof.diagnoses:counted"


@pytest.fixture
def invoke(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Result]:
    """The command, writing to tmp_path/out, diagnosed by a function that counts and may be interrupted."""
    monkeypatch.setattr(runner, "DIAGNOSIS", COUNTED)
    monkeypatch.setenv("COUNTED", str(tmp_path / "counted"))

    def call(*more: str, interrupt: str = "") -> Result:
        monkeypatch.setenv("INTERRUPT", interrupt)
        return CliRunner().invoke(app, [*QUICK, "--out", str(tmp_path / "out"), *more])

    return call


def counted(tmp_path: Path) -> list[str]:
    """Cases in the order in which they were diagnosed."""
    return (tmp_path / "counted").read_text().split()


def plain(folder: Path) -> Any:
    """prove.json and all answers without what a clock or the salt decides."""
    report = json.loads((folder / "prove.json").read_text())
    for row in report["rows"]:
        del row["seconds"]
    del report["summary"]["seconds"]
    return {**report, "seal": None}, (folder / "diagnoses.jsonl").read_text()


def test_it_ends_as_an_undisturbed_one(tmp_path: Path, invoke: Callable[..., Result]) -> None:
    broken = invoke(interrupt="case-0002")
    assert broken.exit_code == 130
    assert not (tmp_path / "out").exists()
    assert [p.name for p in (tmp_path / ".out.cases").glob("case*")] != []
    after = invoke()
    assert after.exit_code == 0, after.output
    assert "1 of them were diagnosed before an interrupt" in after.output
    assert counted(tmp_path) == ["case-0001", "case-0002", "case-0002"]
    assert not (tmp_path / ".out.cases").exists()
    undisturbed = invoke("--out", str(tmp_path / "whole"))
    assert undisturbed.exit_code == 0, undisturbed.output
    assert plain(tmp_path / "out") == plain(tmp_path / "whole")


def test_the_seal_that_was_shown_stays(tmp_path: Path, invoke: Callable[..., Result]) -> None:
    invoke(interrupt="case-0002")
    shown = json.loads((tmp_path / ".out.cases" / "campaign.json").read_text())["seal"]["digest"]
    assert (tmp_path / ".out.cases" / "campaign.json").stat().st_mode & 0o077 == 0
    invoke()
    assert json.loads((tmp_path / "out" / "prove.json").read_text())["seal"]["digest"] == shown


@pytest.mark.parametrize(
    ("more", "told"),
    [
        (["--seed", "2"], "seed 1 for 2"),
        (["--time-limit", "60"], "time_limit 600.0 for 60.0"),
        (["--background", "0.03"], "background None for 0.03"),
    ],
)
def test_another_one_is_told_and_not_mixed(
    tmp_path: Path, invoke: Callable[..., Result], more: list[str], told: str
) -> None:
    invoke(interrupt="case-0002")
    other = invoke(*more)
    assert other.exit_code == 2
    assert f"got {told}; --force loses its 1 answers" in other.stderr
    assert counted(tmp_path) == ["case-0001", "case-0002"]
    assert invoke(*more, "--force").exit_code == 0
    assert counted(tmp_path)[2:] == ["case-0001", "case-0002"]


def test_other_code_is_told(invoke: Callable[..., Result], monkeypatch: pytest.MonkeyPatch) -> None:
    invoke(interrupt="case-0002")
    monkeypatch.setattr(kept, "code", lambda: "edited")
    other = invoke()
    assert (other.exit_code, "got by other code" in other.stderr) == (2, True)


def test_other_truths_are_told(tmp_path: Path, invoke: Callable[..., Result]) -> None:
    invoke(interrupt="case-0002")
    path = tmp_path / ".out.cases" / "campaign.json"
    path.write_text(path.read_text().replace('"salt": "', '"salt": "0'))
    other = invoke()
    assert (other.exit_code, "have another hash" in other.stderr) == (2, True)


@pytest.mark.parametrize("text", ["", '{"diagnosis": {', '{"diagnosis": 1, "sentence": "", "seconds": 1.0}'])
def test_a_damaged_answer_is_made_again(tmp_path: Path, invoke: Callable[..., Result], text: str) -> None:
    invoke(interrupt="case-0002")
    (tmp_path / ".out.cases" / "case-0001.json").write_text(text)
    assert invoke().exit_code == 0
    assert counted(tmp_path)[2:] == ["case-0001", "case-0002"]


def test_a_failure_is_an_answer_a_crash_is_none(
    tmp_path: Path, invoke: Callable[..., Result], monkeypatch: pytest.MonkeyPatch
) -> None:
    """An exception of a diagnosis would come again; a process may have been ended with the campaign."""

    def worked(function: Any, cases: Any, **kwargs: Any) -> Any:
        for outcome in map_cases(function, cases, **kwargs):
            if function is runner.made:
                yield outcome
            else:
                kind: Any = ("error", "crash")[outcome.index]
                failure = Failure(kind=kind, sentence=kind)
                yield Outcome(index=outcome.index, case=outcome.case, value=None, failure=failure, wall_time=1.0)
        if function is not runner.made:
            raise KeyboardInterrupt

    monkeypatch.setattr(runner, "map_cases", worked)
    assert invoke().exit_code == 130
    assert [p.name for p in (tmp_path / ".out.cases").glob("case*")] == ["case-0001.json"]


def test_the_code_that_decides_is_hashed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = tmp_path / "mine"
    package.mkdir()
    (package / "__init__.py").write_text("")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(kept, "PACKAGES", ("mine",))
    before = kept.code()
    assert kept.code() == before
    (package / "law.yaml").write_text("k: 1\n")
    assert kept.code() != before
