"""The whole way: made, sealed, diagnosed in other processes, opened, scored, written."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from rollover.cli.commands.common import app
from rollover.proof import runner
from rollover.proof.commitment import opened
from rollover.proof.runner import prove
from rollover.system.processes import map_cases

BY_HAND = "tests.proof.diagnoses:"
QUICK = ["--cases", "2", "--kinds", "null", "--kinds", "single", "--effects", "mass", "--workers", "0"]


def test_the_hash_comes_before_the_first_diagnosis() -> None:
    order: list[str] = []
    proof = prove(
        2,
        4,
        kinds=["null"],
        workers=0,
        diagnosis=BY_HAND + "says_nothing",
        on_seal=lambda seal: order.append(seal.digest),
        show=lambda done, of: order.append(f"{done}/{of}"),
    )
    assert order == [proof.seal.digest, "1/2", "2/2"]
    assert proof.report["summary"]["false_alarms"]["hits"] == 0
    assert proof.report["summary"]["p_values"]["of"] == 2
    assert len(proof.diagnoses) == 2


def test_answers_go_to_their_own_cases(monkeypatch: pytest.MonkeyPatch) -> None:
    """Cases are done in any order."""

    def backwards(*args: Any, **kwargs: Any) -> Any:
        return reversed(list(map_cases(*args, **kwargs)))

    monkeypatch.setattr(runner, "map_cases", backwards)
    proof = prove(2, 4, kinds=["null"], workers=0, diagnosis=BY_HAND + "says_nothing")
    assert {name: found["folder"] for name, found in proof.diagnoses.items()} == {n: n for n in proof.diagnoses}


def test_in_processes_of_their_own() -> None:
    kinds, found = ["null", "single"], BY_HAND + "always_damping"
    proof = prove(2, 8, kinds=kinds, effects=["soil-viscous-damping"], workers=1, diagnosis=found)
    summary = proof.report["summary"]
    assert (summary["false_alarms"]["hits"], summary["named_first"]["hits"]) == (1, 1)
    assert [row["case"] for row in proof.report["rows"]] == ["case-0001", "case-0002"]


def test_a_diagnosis_that_changes_its_recordings_is_no_proof() -> None:
    with pytest.raises(RuntimeError, match="case-0001: its recordings were changed"):
        prove(1, 4, kinds=["null"], workers=0, diagnosis=BY_HAND + "spoils")


def test_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runner, "DIAGNOSIS", BY_HAND + "says_nothing")
    out = tmp_path / "proof"
    answer = CliRunner().invoke(app, ["prove", *QUICK, "--out", str(out), "--json"])
    assert answer.exit_code == 0, answer.output
    report = json.loads(answer.stdout)
    assert report["seal"]["digest"] in answer.stderr
    assert report == json.loads((out / "prove.json").read_text())
    assert sorted(p.name for p in out.iterdir()) == [
        "diagnoses.jsonl",
        "prove.json",
        "report.html",
        "seal.json",
        "truth.json",
    ]
    assert len(opened(report["seal"]["digest"], out / "truth.json")) == 2
    assert len((out / "diagnoses.jsonl").read_text().splitlines()) == 2
    other = CliRunner().invoke(app, ["prove", *QUICK, "--seed", "2", "--out", str(out)])
    assert other.exit_code == 2
    assert "--force" in other.stderr


def test_a_background_is_asked_for_reported_and_recorded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runner, "DIAGNOSIS", BY_HAND + "says_nothing")
    out = tmp_path / "proof"
    asked = ["prove", "--cases", "1", "--kinds", "background", "--workers", "0", "--out", str(out)]
    answer = CliRunner().invoke(app, [*asked, "--background", "0.03"])
    assert answer.exit_code == 0, answer.output
    assert "a background alone named as an effect" in answer.output
    report = json.loads((out / "prove.json").read_text())
    assert report["background"] == 0.03
    assert report["summary"]["real"]["background_alone"]["false_name"]["of"] == 1
    (truth,) = opened(report["seal"]["digest"], out / "truth.json")
    assert truth["background"]["share"] == 0.03
    assert "--kinds background --background 0.03" in (out / "report.html").read_text()
    other = CliRunner().invoke(app, [*asked, "--background", "drawn"])
    assert (other.exit_code, "--force" in other.stderr) == (2, True)
    for share, rig in (("2", "drop"), ("some", "drop"), ("0.03", "overturn")):
        wrong = CliRunner().invoke(app, ["prove", "--background", share, "--rig", rig, "--out", str(tmp_path / "no")])
        assert wrong.exit_code == 2
        assert "rollover prove: background: " in wrong.stderr
    assert not (tmp_path / "no").exists()


def test_diagnoses_that_fail_are_listed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runner, "DIAGNOSIS", BY_HAND + "fails")
    answer = CliRunner().invoke(app, ["prove", *QUICK, "--out", str(tmp_path / "proof")])
    assert answer.exit_code == 3
    assert "RuntimeError: no idea" in answer.stderr
    report = json.loads((tmp_path / "proof" / "prove.json").read_text())
    assert report["summary"]["failed"] == ["case-0001", "case-0002"]


def test_an_effect_that_does_not_exist(tmp_path: Path) -> None:
    answer = CliRunner().invoke(app, ["prove", "--effects", "soil-lair", "--out", str(tmp_path / "proof")])
    assert answer.exit_code == 2
    assert "no such effect, got 'soil-lair'" in answer.stderr
    assert not (tmp_path / "proof").exists()
