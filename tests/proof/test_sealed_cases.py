"""Sealed cases for others: the folder tells nothing, answers are read strictly and scored as a diagnosis is."""

from __future__ import annotations

import json
import shutil
import stat
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import rollover as ro
from rollover.cli.main import app
from rollover.proof.commitment import opened
from rollover.proof.score import score

CASES = 3
ASKED = ["--cases", str(CASES), "--kinds", "single", "--kinds", "null", "--effects", "mass", "--workers", "0"]


def call(*words: object) -> Any:
    return CliRunner().invoke(app, [str(w) for w in words], env={"COLUMNS": "200", "TERM": "dumb", "NO_COLOR": "1"})


@pytest.fixture(scope="module")
def cases(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sealed") / "cases"
    done = call("prove", *ASKED, "--seed", "31", "--export", folder)
    assert done.exit_code == 0, done.output
    return folder


def truth_of(cases: Path) -> Path:
    return cases.with_name("cases-truth.json")


def digest(cases: Path) -> str:
    return str(json.loads((cases / "seal.json").read_text())["digest"])


def right(cases: Path) -> dict[str, Any]:
    """Answers that are right, but for the numbers."""
    answers = []
    for t in opened(digest(cases), truth_of(cases)):
        effects = [{"id": e["id"], "parameters": _numbers(e["parameters"])} for e in t["effects"]]
        answers.append({"case": t["case"], "verdict": t["verdict"], "effects": effects})
    return {"format": "rollover-answers/1", "by": "by hand", "seal": digest(cases), "answers": answers}


def _numbers(true: dict[str, float]) -> dict[str, Any]:
    return {n: {"value": v, "low": v - abs(v), "high": v + abs(v)} for n, v in true.items()}


def scored(cases: Path, answers: Any, out: Path, *more: object) -> Any:
    file = out.with_suffix(".json")
    file.write_text(answers if isinstance(answers, str) else json.dumps(answers, indent=1))
    return call("score", cases, file, "--out", out, "--json", *more)


def test_what_is_handed_over_tells_nothing_of_the_truth(cases: Path) -> None:
    names = sorted(p.name for p in cases.iterdir())
    assert names == [
        "README.md", "baseline.py", "benchmark.json", "candidates.json", "case-0001", "case-0002", "case-0003",
        "seal.json",
    ]  # fmt: skip
    truths = opened(digest(cases), truth_of(cases))
    assert stat.S_IMODE(truth_of(cases).stat().st_mode) == 0o600
    assert json.loads(truth_of(cases).read_text())["asked"]["seed"] == 31
    salt = json.loads(truth_of(cases).read_text())["salt"]
    told = [p for p in cases.rglob("*") if p.is_file()]
    for path in told:
        text = path.read_bytes().decode("latin-1")
        assert salt not in text
        assert "signal_to_noise" not in text
        if path.parent != cases:
            assert "single" not in text, path
            assert "null" not in text.replace("null}", ""), path
    listed = json.loads((cases / "benchmark.json").read_text())
    assert set(listed) == {"format", "rig", "cases", "versions"}, "no seed, no kinds, no effects"
    assert [c["case"] for c in listed["cases"]] == [t["case"] for t in truths]
    known = {c["id"]: c for c in json.loads((cases / "candidates.json").read_text())["candidates"]}
    assert {e["id"] for t in truths for e in t["effects"]} <= set(known)
    assert known["soil-layer"]["parameters"]["depth"]["unit"] == "m"
    assert {"tyre-damping", "empirical"}.isdisjoint(known), "what drops do not show, and what is no name"
    assert digest(cases) in (cases / "README.md").read_text()


def test_the_same_seed_makes_the_same_cases_and_no_seed_others(cases: Path, tmp_path: Path) -> None:
    def hashes(folder: Path) -> list[str]:
        return [c["sha256"] for c in json.loads((folder / "benchmark.json").read_text())["cases"]]

    drawn = []
    for name, seed in (("again", ["--seed", "31"]), ("a", []), ("b", [])):
        done = call("prove", *ASKED, *seed, "--export", tmp_path / name, "--json")
        assert done.exit_code == 0, done.output
        drawn.append(hashes(tmp_path / name))
    assert drawn[0] == hashes(cases)
    assert digest(tmp_path / "again") != digest(cases), "the salt is another one"
    assert drawn[1] != drawn[2]


def test_the_baseline_is_a_function(cases: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where nothing is missing it is what was measured, but for clock and noise; a candidate changes it."""
    monkeypatch.syspath_prepend(str(cases))
    monkeypatch.delitem(sys.modules, "baseline", raising=False)
    import baseline  # type: ignore[import-not-found]

    truths = opened(digest(cases), truth_of(cases))
    (null, *_) = [t["case"] for t in truths if t["kind"] == "null"]
    heard, plain = baseline.measured(null, "r1"), baseline.simulate(null, "r1")
    assert set(plain) == set(heard.channels)
    for channel, values in plain.items():  # a clock is late by up to 20 ms, noise is up to 3 % of the range
        fine = np.isfinite(heard[channel])
        late = [
            np.interp(heard.time[fine] - shift, heard.time, values) - heard[channel][fine]
            for shift in np.linspace(-0.025, 0.025, 101)
        ]
        assert min(float(np.sqrt(np.mean(off**2))) for off in late) < 0.05 * np.ptp(values), channel
    other = baseline.simulate(null, "r1", {"effects.mass.added": 20.0})
    assert any(np.abs(other[c] - plain[c]).max() > 1e-3 * np.abs(plain[c]).max() for c in plain)
    with pytest.raises(ro.InputError, match="mass"):
        baseline.simulate(null, "r1", {"effects.mass.aded": 20.0})


def test_answers_are_scored_as_a_diagnosis_is(cases: Path, tmp_path: Path) -> None:
    answers = right(cases)
    done = scored(cases, answers, tmp_path / "right")
    assert done.exit_code == 0, done.output
    found = json.loads(done.stdout)
    assert found == json.loads((tmp_path / "right" / "score.json").read_text())
    truths = opened(digest(cases), truth_of(cases))
    for row, truth, answer in zip(found["rows"], truths, answers["answers"], strict=True):
        assert row == {**score(truth, json.loads(json.dumps(answer)), 0.0), "failure": ""}
    singles = sum(t["kind"] == "single" for t in truths)
    summary = found["summary"]
    assert (summary["alone_and_right"]["hits"], summary["false_alarms"]["hits"]) == (singles, 0)
    assert summary["coverage"]["hits"] == summary["coverage"]["of"] >= singles
    page = (tmp_path / "right" / "report.html").read_text()
    assert "Answers by by hand to 3 sealed cases" in page
    silent = [{"case": a["case"], "verdict": "no-answer"} for a in answers["answers"]]
    done = scored(cases, {**answers, "answers": silent}, tmp_path / "silent", "--truth", truth_of(cases))
    assert json.loads(done.stdout)["summary"]["failed"] == [a["case"] for a in silent]


def edited(answers: dict[str, Any], k: int, **keys: Any) -> dict[str, Any]:
    each = [dict(a) for a in answers["answers"]]
    each[k] = {**each[k], **keys}
    return {**answers, "answers": each}


NAMED = {"verdict": "parameter", "effects": [{"id": "mass"}]}


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"case": "case-9"}, "answers.0.case: no such case, got 'case-9'"),
        ({"case": "case-0002"}, "answered twice, got 'case-0002'"),
        ({"verdict": "maybe", "effects": []}, "answers.0.verdict: "),
        ({"verdict": "no-mismatch", "effects": [{"id": "mass"}]}, "names nothing, got 'no-mismatch' beside mass"),
        ({"verdict": "sensor", "effects": []}, "effects: none named, got the verdict 'sensor'"),
        ({**NAMED, "effects": [{"id": "mas"}]}, "no such candidate, got 'mas'"),
        ({**NAMED, "effects": [{"id": "mass", "indistinguishable_from": ["air"]}]}, "no such candidate, got 'air'"),
        ({**NAMED, "effects": [{"id": "mass", "sure": 1}]}, "sure"),
        ({**NAMED, "effects": [{"id": "mass", "parameters": {"aded": {"value": 1.0}}}]}, "none of mass, got 'aded'"),
        ({**NAMED, "effects": [{"id": "mass", "parameters": {"added": 1.0}}]}, "parameters.added: got 1"),
        ({**NAMED, "effects": [{"id": "mass", "parameters": {"added": {"value": "x"}}}]}, "not a number, got 'x'"),
        (
            {**NAMED, "effects": [{"id": "mass", "parameters": {"added": {"value": 1.0, "low": 0.0}}}]},
            "one end of an interval",
        ),
        (
            {**NAMED, "effects": [{"id": "mass", "parameters": {"added": {"value": 1.0, "low": 2.0, "high": 3.0}}}]},
            "value outside its interval",
        ),
        ({**NAMED, "probabilities": {"mass": 0.4}}, "probabilities: they add up to 0.4"),
        ({**NAMED, "probabilities": {"mas": 1.0}}, "no such candidate, got 'mas'"),
        ({**NAMED, "seconds": -1.0}, "seconds"),
    ],
)
def test_an_answer_that_is_none_is_refused_in_a_line(cases: Path, tmp_path: Path, keys: Any, said: str) -> None:
    done = scored(cases, edited(right(cases), 0, **keys), tmp_path / "out")
    assert done.exit_code == 2, done.output
    lines = done.stderr.strip().splitlines()
    assert said in lines[0], lines
    assert all(";" in line for line in lines), "each with its cure"
    assert lines[0].startswith(f"{tmp_path / 'out.json'}:")
    assert not (tmp_path / "out").exists()


def test_all_cases_are_answered_and_of_this_seal(cases: Path, tmp_path: Path) -> None:
    answers = right(cases)
    short = scored(cases, {**answers, "answers": answers["answers"][1:]}, tmp_path / "a")
    assert (short.exit_code, "answers: not answered: case-0001; every case" in short.stderr) == (2, True)
    other = scored(cases, {**answers, "seal": "0" * 64}, tmp_path / "b")
    assert (other.exit_code, "seal: of other cases, got '000" in other.stderr) == (2, True)
    for text in ("", "[]", "{", '{"format": "rollover-answers/2"}', "\x00"):
        broken = scored(cases, text, tmp_path / "c")
        assert broken.exit_code == 2, text
        assert len(broken.stderr.strip().splitlines()) >= 1
    assert not any((tmp_path / name).exists() for name in "abc")


def test_another_truth_and_changed_recordings_are_refused(cases: Path, tmp_path: Path) -> None:
    answers = right(cases)
    truth = json.loads(truth_of(cases).read_text())
    truth["truths"][0]["verdict"] = "unexplained"
    (tmp_path / "t.json").write_text(json.dumps(truth))
    done = scored(cases, answers, tmp_path / "a", "--truth", tmp_path / "t.json")
    assert (done.exit_code, "not the truth that was sealed" in done.stderr) == (2, True)
    for text in (
        "",
        "[]",
        "{",
        '{"format": "rollover-truths/1"}',
        truth_of(cases).read_text().replace("0.", "NaN, 0.", 1),
    ):
        (tmp_path / "t.json").write_text(text)
        done = scored(cases, answers, tmp_path / "a", "--truth", tmp_path / "t.json")
        assert (done.exit_code, "t.json: not a" in done.stderr or "t.json: not the" in done.stderr) == (2, True), text
        assert "; " in done.stderr
    missing = scored(cases, answers, tmp_path / "a", "--truth", tmp_path / "none.json")
    assert (missing.exit_code, "none.json: not a readable truth" in missing.stderr) == (2, True)
    copy = tmp_path / "copy"
    shutil.copytree(cases, copy)
    (copy / "case-0002" / "r1.yaml").write_text("format: rollover-recording/1\n")
    done = scored(copy, answers, tmp_path / "b", "--truth", truth_of(cases))
    assert (done.exit_code, "case-0002: no sealed cases: its files are not those" in done.stderr) == (2, True)
    done = scored(tmp_path, answers, tmp_path / "d", "--truth", truth_of(cases))
    assert (done.exit_code, "no sealed cases: it is missing" in done.stderr) == (2, True)


@pytest.mark.parametrize("entry", [{"parameters": 3}, {"parameters": None}, {}, 7, "id"])
def test_candidates_without_their_parameters_are_refused(cases: Path, tmp_path: Path, entry: Any) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(cases, copy)
    listed = json.loads((copy / "candidates.json").read_text())
    first = listed["candidates"][0]
    listed["candidates"][0] = {"id": first["id"], **entry} if isinstance(entry, dict) else entry
    (copy / "candidates.json").write_text(json.dumps(listed))
    done = scored(copy, right(cases), tmp_path / "a", "--truth", truth_of(cases))
    assert (done.exit_code, "candidates.json: no sealed cases: its entries are not" in done.stderr) == (2, True)


def test_the_folder_one_is_in_has_its_truth_beside_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "mine").mkdir()
    monkeypatch.chdir(tmp_path / "mine")
    done = call("prove", "--cases", "1", "--kinds", "null", "--workers", "0", "--export", ".")
    assert done.exit_code == 0, done.output
    assert (tmp_path / "mine" / "case-0001").is_dir()
    assert stat.S_IMODE((tmp_path / "mine-truth.json").stat().st_mode) == 0o600
    said = {"format": "rollover-answers/1", "answers": [{"case": "case-0001", "verdict": "no-mismatch"}]}
    monkeypatch.chdir(tmp_path / "mine")  # the folder was exchanged for another one
    said["seal"] = json.loads(Path("seal.json").read_text())["digest"]
    (tmp_path / "a.json").write_text(json.dumps(said))
    scored = call("score", ".", tmp_path / "a.json", "--out", tmp_path / "out")
    assert scored.exit_code == 0, scored.output


def test_neither_folder_nor_truth_is_written_over(cases: Path, tmp_path: Path) -> None:
    again = call("prove", *ASKED, "--export", cases)
    assert (again.exit_code, "exists; --force replaces it" in again.stderr) == (2, True)
    (tmp_path / "x-truth.json").write_text("mine")
    other = call("prove", *ASKED, "--export", tmp_path / "x")
    assert (other.exit_code, "x-truth.json: exists" in other.stderr) == (2, True)
    assert (tmp_path / "x-truth.json").read_text() == "mine"
    assert not (tmp_path / "x").exists()
    inside = call("prove", *ASKED, "--export", tmp_path / "x", "--truth", tmp_path / "x" / "t.json")
    assert (inside.exit_code, "within the folder that others are given" in inside.stderr) == (2, True)
    alone = call("prove", *ASKED, "--truth", tmp_path / "t.json")
    assert (alone.exit_code, "--truth: without --export" in alone.stderr) == (2, True)
    wrong = call("prove", "--cases", "1", "--effects", "soil-lair", "--export", tmp_path / "y")
    assert (wrong.exit_code, "no such effect, got 'soil-lair'" in wrong.stderr) == (2, True)
    assert not (tmp_path / "y").exists()
    assert not (tmp_path / "y-truth.json").exists()
