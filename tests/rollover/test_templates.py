"""Every template is valid, says what its keys mean, and is used by its command; what exists is not overwritten."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from typer.testing import CliRunner

from rollover import studies
from rollover.cli import templates
from rollover.cli.commands.new import KINDS
from rollover.cli.main import app
from rollover.recording.importers import read_recording
from rollover.recording.importers.sidecar import Column, Csv, Profile, Sidecar
from rollover.scenario import AnyVehicle, Scenario, load
from rollover.spec import document
from rollover.spec.document.slot import slots
from rollover.spec.rops import Rops
from rollover.system import own_code
from tests.rollover.test_effects_contract import outside

FIRST = {"recording": "my-recording.csv", "law": "my_law.py", "effect": "my_effect.py"}


def called(*words: str) -> tuple[int, str, str]:
    done = CliRunner().invoke(app, list(words))
    return done.exit_code, done.stdout, done.stderr


@pytest.fixture
def own(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a check names in the environment goes again."""
    for variable in own_code.KINDS.values():
        monkeypatch.setenv(variable, "")


@pytest.mark.usefixtures("own")
@pytest.mark.parametrize("kind", [k for k in KINDS if k not in ("law", "effect")])
def test_a_template_passes_its_check(kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert called("new", kind)[0] == 0
    status, said, wrong = called("check", FIRST.get(kind, f"my-{kind}.yaml"))
    assert (status, wrong) == (0, "")
    assert f"{kind}, valid" in said


def test_existing_files_are_kept_and_nothing_is_written(tmp_path: Path) -> None:
    (tmp_path / "rig.csv").write_text("mine\n")
    status, _, wrong = called("new", "recording", str(tmp_path / "rig"))
    assert status == 2
    assert wrong == f"{tmp_path / 'rig.csv'}: exists, and is not replaced; another NAME is needed\n"
    assert [p.name for p in tmp_path.iterdir()] == ["rig.csv"]
    assert (tmp_path / "rig.csv").read_text() == "mine\n"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("scenarios",), "rollover new: no such kind, got 'scenarios'; did you mean 'scenario'?"),
        (("law", "7up"), "rollover new: NAME: not a plain name, got '7up'; letters"),
        (("vehicle", "a b"), "rollover new: NAME: not a plain name, got 'a b'; letters"),
    ],
)
def test_a_wrong_kind_or_name_is_one_line(words: tuple[str, ...], message: str, tmp_path: Path) -> None:
    status, _, wrong = called("new", *words)
    assert status == 2
    assert wrong.startswith(message)
    assert wrong.count("\n") == 1


CLASSES: Mapping[str, list[Any]] = {
    "scenario": [Scenario],
    "rops": [Rops],
    "study": [studies.study.Study],
    "recording": [Sidecar, Column],
    "profile": [Profile, Column, Csv],
}


@pytest.mark.parametrize("kind", CLASSES)
def test_every_key_stands_in_its_template_with_what_it_means(kind: str) -> None:
    text = templates.written(kind, "my")["my.yaml"]
    flat = " ".join(line.strip().lstrip("# ") for line in text.splitlines())
    for each in CLASSES[kind]:
        for key, slot in slots(each).items():
            assert re.search(rf"^\s*(- )?{key}:", text, re.MULTILINE), key
            assert " ".join(slot.meaning.split()) in flat, key


def test_a_key_of_a_template_has_meaning_unit_range_and_default() -> None:
    text = templates.written("scenario", "my")["my.yaml"]
    assert "  length: 10.0  # along x; a number greater than 0 m; needed\n" in text
    assert "  step: 0.001  # of the solver; a number greater than 0 and at most 0.01 s; default 0.001\n" in text
    assert "    loss_share: null\n" in text
    assert "  count: 20  # cases; a whole number at least 1; needed\n" in templates.written("study", "my")["my.yaml"]


def test_the_annotated_objects_come_back_to_the_last_bit(tmp_path: Path) -> None:
    for kind in ("scenario", "vehicle", "rops"):
        for name, text in templates.written(kind, kind).items():
            (tmp_path / name).write_text(text, encoding="utf-8")
    vehicle = document.load(document.find("utility_tractor", "vehicles"), AnyVehicle)
    frames = document.shipped_folder() / "vehicles"
    rops, mounted = (document.load(frames / name, Rops) for name in (templates.FRAME, templates.ROPS))
    (tmp_path / "mounted.yaml").write_text(document.annotated(mounted, "", {}), encoding="utf-8")
    assert document.load(tmp_path / "mounted.yaml", Rops) == mounted
    assert load(tmp_path / "scenario.yaml") == load("side_overturn")
    assert document.load(tmp_path / "vehicle.yaml", AnyVehicle) == vehicle
    assert document.load(tmp_path / "rops.yaml", Rops) == rops


def test_template_study_and_profile_work_in_their_commands(tmp_path: Path) -> None:
    for kind in ("study", "profile"):
        assert called("new", kind, str(tmp_path / kind))[0] == 0
    status, said, wrong = called(
        "study", str(tmp_path / "study.yaml"), "--out", str(tmp_path / "out"), "--workers", "0", "--json"
    )
    assert status == 0, wrong
    assert json.loads(said)["cases"] == {"all": 20, "done": 20, "failed": 0}
    profile, sample = tmp_path / "profile.yaml", tmp_path / "profile-sample.csv"
    status, _, wrong = called("import", str(sample), "--profile", str(profile), "--out", str(tmp_path / "rec"))
    assert status == 0, wrong
    force = read_recording(tmp_path / "rec" / "profile-sample.csv").channels["ground/force_normal"]
    assert force.max() == pytest.approx(3500.0)  # N of the 3.5 kN that a comma divides


def test_template_law_and_effect_run_and_state_their_hash(tmp_path: Path) -> None:
    assert called("new", "law", str(tmp_path / "peat"))[0] == 0
    assert called("new", "effect", str(tmp_path / "soil-mat"))[0] == 0
    law, effect = str(tmp_path / "peat.py"), str(tmp_path / "soil_mat.py")
    checked = outside("-m", "tests.rollover.command", "check", law, effect)
    assert checked.stdout == f"{law}: law peat, valid\n{effect}: effect soil-mat, valid\n", checked.stderr
    words = ["--laws", law, "--effects", effect, "run", "drop_test", "--no-half-step", "--out", str(tmp_path / "run")]
    settings = ["ground.law={kind: peat}", "effects.soil-mat.stiffness=1e4", "simulation.duration=0.05"]
    done = outside("-m", "tests.rollover.command", *words, *(w for s in settings for w in ("--set", s)))
    assert done.returncode == 0, done.stderr
    own = json.loads((tmp_path / "run" / "run.json").read_text())["own_code"]
    assert {kind: list(files) for kind, files in own.items()} == {"effects": ["soil_mat.py"], "laws": ["peat.py"]}


@pytest.mark.parametrize("kind", ["vehicle", "rops", "study", "recording", "profile"])
def test_a_template_fits_the_schema_of_its_kind(kind: str) -> None:
    status, said, _ = called("schema", kind)
    assert status == 0
    validator = jsonschema.Draft202012Validator(json.loads(said))
    path = document.shipped_folder()  # any place: nothing is written
    text = templates.written(kind, "my")["my.yaml"]
    assert path.is_dir()
    assert list(validator.iter_errors(parsed(text))) == []


@pytest.mark.parametrize(
    ("old", "new"),
    [("unit: kN", "unit: 5"), ("noise: 0.05", "noise: -0.05"), ("channel: time", "chanel: time"), ("csv:", "cvs:")],
)
def test_the_schema_of_a_profile_refuses_what_reading_refuses(old: str, new: str) -> None:
    validator = jsonschema.Draft202012Validator(json.loads(called("schema", "profile")[1]))
    assert list(validator.iter_errors(parsed(templates.written("profile", "my")["my.yaml"].replace(old, new))))


def parsed(text: str) -> Any:
    from ruamel.yaml import YAML

    return YAML(typ="safe", pure=True).load(text)
