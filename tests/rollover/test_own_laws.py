"""A ground law in a file of one's own: run by studies in child processes, hashed; a wrong file is a line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from rollover.cli import templates
from tests.rollover.test_effects_contract import outside

STUDY = """format: rollover-study/1
title: Drops on a law of one's own
scenario: {base: drop_test.yaml, ground: {law: {kind: peat, stiffness: 3.0e4}}}
axes: [{kind: uniform, name: speed, paths: [initiation.speed], low: 1.0, high: 3.0}]
plan: {kind: random, count: 4}
outputs: [{name: ground/force_normal}]
simulator: drop
"""


@pytest.fixture
def peat(tmp_path: Path) -> Path:
    (path := tmp_path / "peat.py").write_text(templates.written("law", "peat")["peat.py"], encoding="utf-8")
    return path


def test_a_study_takes_own_laws_to_workers_and_sees_changes(peat: Path, tmp_path: Path) -> None:
    """F = k z (1 + c v) at the same point: twice the stiffness of the file's own formula, other forces."""
    (study := tmp_path / "study.yaml").write_text(STUDY, encoding="utf-8")

    def forces(out: str) -> list[float]:
        words = ("--laws", str(peat), "study", str(study), "--workers", "2", "--out", str(tmp_path / out), "--json")
        done = outside("-m", "tests.rollover.command", *words)
        assert done.returncode == 0, done.stderr
        answer = json.loads(done.stdout)
        assert answer["cases"]["done"] == 4, answer
        assert answer["ran"] == 4, answer
        return [answer["outputs"][0]["least"], answer["outputs"][0]["largest"]]

    before = forces("out")
    peat.write_text(peat.read_text().replace("return p[1] * z", "return 2.0 * p[1] * z"), encoding="utf-8")
    after = forces("out")  # the same folder: results of the old law are not taken for the new one's
    assert all(b > 1.2 * a for a, b in zip(before, after, strict=True))  # sqrt(2) without damping: v sqrt(k m)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("p[1] * z", "p[1] * (z", "peat.py:{line}: cannot be used: SyntaxError: "),
        ("class Peat(GroundLaw)", "class Peat(Ground)", "peat.py:{line}: cannot be used: NameError: "),
        ("    @force_law\n", "", "peat.py: Peat: no compiled `force`"),
        ('kind: Literal["peat"] = "peat"', "", "peat.py: Peat: no name, got no `kind`"),
        ('"peat"', '"ye-2006"', "'ye-2006' is taken by"),
        ("p[1] * z", 'p[1] * "z"', "peat.py:{line}: cannot be used: TypingError: "),
        ("\n\n@parameters\n", "\n\n", "peat.py: Peat: no parameters; @parameters"),
    ],
)
def test_a_wrong_file_of_laws_is_one_line_with_its_place(peat: Path, old: str, new: str, said: str) -> None:
    text = peat.read_text()
    assert old in text
    peat.write_text(text.replace(old, new), encoding="utf-8")
    done = outside("-m", "tests.rollover.command", "--laws", str(peat), "list", "laws")
    assert done.returncode == 2, done.stdout + done.stderr
    assert done.stderr.count("\n") == 1, done.stderr
    before, _, after = said.partition("{line}")
    assert before in done.stderr
    if after:
        line = done.stderr.partition(before)[2].partition(":")[0]
        assert line.isdecimal(), done.stderr


def test_a_missing_or_empty_file_of_laws_is_one_line(tmp_path: Path) -> None:
    (empty := tmp_path / "empty.py").write_text("x = 1\n")
    for path, said in ((tmp_path / "no.py", "no such file of laws"), (empty, "no ground law, got no class")):
        done = outside("-m", "tests.rollover.command", "--laws", str(path), "list", "laws")
        assert (done.returncode, done.stderr.count("\n")) == (2, 1), done.stderr
        assert said in done.stderr
