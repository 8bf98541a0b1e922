"""A ground law in a file of one's own: run by studies in child processes, hashed; a wrong file is a line."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from rollover.cli import templates
from rollover.effects import effects
from rollover.scenario import load
from rollover.spec.laws import laws
from rollover.system import own_code
from rollover.system.errors import InputError
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
        (
            "force(p, s, z, v)",
            "force(p, s, z)",
            "peat.py:{line}: cannot be used: TypeError: arguments of another number",
        ),
        ("force(p, s, z, v)", "force(p, s, z, *v)", "peat.py:{line}: cannot be used: TypeError: arguments of another"),
        ("return p[1] * z", "return 5.0 + p[1] * z", "peat.py: Peat: force without any sinkage, got 5 N at z = 0 m"),
        ("return p[1] * z", "return p[3] * z", "peat.py: Peat: force is not finite at z = 0 m"),
        ("return p[1] * z", "return s[3] + p[1] * z", "peat.py: Peat: force is not finite at z = 0 m"),
        ("return p[1] * z", "return -p[1] * z", "peat.py: Peat: force -3e-05 N at z = 1e-09 m"),
        ("return p[1] * z", "s[0] = 1.0\n        return p[1] * z", "peat.py: Peat: force writes to p or s"),
        ("return p[1] * z", "return p[1] * z / (z - 0.1)", "peat.py: Peat: force -"),
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


def test_regress_says_that_a_law_was_of_another_file(peat: Path, tmp_path: Path) -> None:
    (folder := tmp_path / "gate").mkdir()
    scenario = "base: drop_test.yaml\ntitle: A drop on peat\nground: {law: {kind: peat}}\nsimulation: {duration: 0.1}\n"
    (folder / "peat_drop.yaml").write_text(scenario, encoding="utf-8")

    def regress(*words: str) -> tuple[int, str]:
        done = outside("-m", "tests.rollover.command", "--laws", str(peat), "regress", str(folder), *words)
        return done.returncode, done.stdout + done.stderr

    status, said = regress("--update", "--reason", "first", "--out", str(tmp_path / "a"))
    assert status == 0, said
    assert "peat.py " in (folder / "baselines" / "peat_drop.yaml").read_text()
    same, said = regress("--out", str(tmp_path / "b"))
    assert same == 0, said
    assert "made with" not in said
    peat.write_text(peat.read_text() + "# a word more\n", encoding="utf-8")  # the same numbers by another file
    same, said = regress("--out", str(tmp_path / "c"))
    assert same == 0, said
    assert "made with peat.py " in " ".join(said.split())
    peat.write_text(peat.read_text().replace("return p[1] * z", "return 1.5 * p[1] * z"), encoding="utf-8")
    changed, said = regress("--out", str(tmp_path / "d"))
    assert changed == 1, said


EFFECT = {
    "p[0] * z if z < p[1] else 0.0": {
        "p[2] * z": "force is not finite at z = 0 m",
        "7.0": "force without any sinkage, got 7 N",
        "p[0] * z + 3.0 * z": "at the null; no force is needed",
    },
    'null: ClassVar = {"stiffness": 0.0}': {"pass": "null: missing", 'null: ClassVar = {"x": 0.0}': "null: of no"},
    "def term(p, s, z, v)": {"def term(p, z)": "TypeError: arguments of another number, got term(p, z)"},
    "\n\n@parameters\n": {"\n\n": "no parameters; @parameters"},
    "(Effect)": {"": "no effect, got no class derived from Effect"},
}


@pytest.mark.parametrize(
    ("old", "new", "said"), [(a, b, c) for a, changes in EFFECT.items() for b, c in changes.items()]
)
def test_a_wrong_file_of_effects_is_one_line_too(old: str, new: str, said: str, tmp_path: Path) -> None:
    text = templates.written("effect", "weed")["weed.py"]
    assert text.count(old) == 1
    (path := tmp_path / "weed.py").write_text(text.replace(old, new), encoding="utf-8")
    done = outside("-m", "tests.rollover.command", "--effects", str(path), "list", "effects")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1), done.stdout + done.stderr
    assert "weed.py" in done.stderr
    assert said in done.stderr


def test_a_missing_or_empty_file_of_laws_is_one_line(tmp_path: Path) -> None:
    (empty := tmp_path / "empty.py").write_text("x = 1\n")
    for path, said in ((tmp_path / "no.py", "no such file of laws"), (empty, "no ground law, got no class")):
        done = outside("-m", "tests.rollover.command", "--laws", str(path), "list", "laws")
        assert (done.returncode, done.stderr.count("\n")) == (2, 1), done.stderr
        assert said in done.stderr


@pytest.mark.parametrize("kind", ["laws", "effects"])
def test_a_refused_file_leaves_nothing_behind(kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In one process that keeps the refusal, as a notebook does: scenarios load as before, the mended file too."""
    monkeypatch.setenv(own_code.KINDS[kind], str(path := tmp_path / "weed.py"))
    (text,) = templates.written(kind.removesuffix("s"), "weed").values()
    path.write_text(f"{text}\nraise OSError('no such file')\n", encoding="utf-8")
    table = {"laws": laws, "effects": effects}[kind]
    with pytest.raises(InputError, match="no such file") as kept:
        table()
    with monkeypatch.context() as without:
        without.delenv(own_code.KINDS[kind])
        assert not [each for each in table() if "weed" in each]
        assert load("drop_test").title
    path.write_text(text, encoding="utf-8")
    (made,) = (each for name, each in table().items() if "weed" in name)
    chosen = {"ground.law": {"kind": "weed", "stiffness": 2e4}} if kind == "laws" else {f"effects.{made.id}": {}}
    assert load("drop_test").replaced(chosen).title
    assert kept.value.faults
    monkeypatch.delenv(own_code.KINDS[kind])
    del sys.modules[made.__module__]
    assert not [each for each in table() if "weed" in each]
