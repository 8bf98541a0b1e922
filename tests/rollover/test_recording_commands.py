"""`rollover import` and `rollover check` on recordings, as a user types them."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from rollover.cli.main import app
from rollover.recording import Recording
from rollover.recording.importers import read_recording, write_recording

PROFILE = """\
format: rollover-profile/1
title: Bench
csv: {delimiter: ";", decimal: ","}
channels:
  t: {channel: time, unit: s}
  F: {channel: ground/force_normal, unit: kN}
"""


def ask(*words: object) -> tuple[int, str, str]:
    done = CliRunner().invoke(app, [str(word) for word in words])
    return done.exit_code, done.stdout, done.stderr


def test_import_by_profile_and_check(tmp_path: Path) -> None:
    (tmp_path / "raw.csv").write_text("t;F\n0;1,5\n0,1;2\n")
    (tmp_path / "p.yaml").write_text(PROFILE)
    out = tmp_path / "out"
    code, said, _ = ask("import", tmp_path / "raw.csv", "--profile", tmp_path / "p.yaml", "--out", out)
    assert (code, said) == (0, f"{out / 'raw.csv'}: 2 samples of 1 channels\n")
    assert read_recording(out / "raw.csv")["ground/force_normal"].tolist() == [1500.0, 2000.0]
    code, _, faults = ask("import", tmp_path / "raw.csv", "--profile", tmp_path / "p.yaml", "--out", out)
    assert code == 2
    assert "exists; --force replaces it" in faults
    code, said, _ = ask("check", out / "raw.csv")
    assert code == 0
    assert said.startswith(f"{out / 'raw.csv'}: recording, valid: Bench, 2 samples, 0 to 0.1 s\n")


def test_import_says_what_it_left_out(tmp_path: Path) -> None:
    (tmp_path / "raw.csv").write_text("t;F;spare\n0;1,5;1\n0,1;2;1\n")
    (tmp_path / "p.yaml").write_text(PROFILE)
    code, said, _ = ask("import", tmp_path / "raw.csv", "--profile", tmp_path / "p.yaml", "--out", tmp_path / "out")
    assert code == 0
    assert said.splitlines()[1:] == ["  note: 1 of 3 columns left out, without a description: spare"]


def test_check_takes_a_folder_of_recordings_one_by_one(tmp_path: Path) -> None:
    time = np.arange(10) * 0.1
    for name in ("a", "b"):
        write_recording(Recording(title=name, time=time, channels={"ground/sinkage": time}), tmp_path / f"{name}.csv")
    (tmp_path / "scenario.yaml").write_text("what is simulated stands beside its recordings\n")
    code, said, _ = ask("check", tmp_path, "--json")
    assert code == 0
    assert [f["file"] for f in json.loads(said)["files"]] == [str(tmp_path / "a.csv"), str(tmp_path / "b.csv")]
    (tmp_path / "b.csv").write_text("nothing\n")
    code, said, faults = ask("check", tmp_path)
    assert code == 2
    assert said.startswith(f"{tmp_path / 'a.csv'}: recording, valid")
    assert faults.startswith(f"{tmp_path / 'b.csv'}")
    empty = tmp_path / "empty"
    empty.mkdir()
    code, _, faults = ask("check", empty)
    assert (code, faults.count("\n")) == (2, 1)


def test_check_tells_findings_as_json(tmp_path: Path) -> None:
    random = np.random.default_rng(0)
    time = np.arange(1000) * 1e-3
    force = 500.0 + random.normal(size=1000)
    force[700] += 50.0
    recording = Recording(title="spike", time=time, channels={"ground/force_normal": force}, conditions={"a.b": 1.0})
    write_recording(recording, tmp_path / "s.parquet")
    code, said, _ = ask("check", tmp_path / "s.parquet", "--json")
    (file,) = json.loads(said)["files"]
    assert code == 0
    assert [(f["check"], f["start"]) for f in file["findings"]] == [("spike", pytest.approx(0.7))]
    assert file["channels"][0]["noise"] == pytest.approx(1.0, rel=0.1)
    code, _, faults = ask("check", tmp_path / "s.parquet", "--scenario", "drop_test")
    assert code == 2
    assert "s.parquet: conditions: " in faults


def test_wrong_recordings_are_refused_and_nothing_is_written(tmp_path: Path) -> None:
    (tmp_path / "raw.csv").write_text("t;F\n0;1,5\n0;2\n")
    (tmp_path / "p.yaml").write_text(PROFILE)
    out = tmp_path / "out"
    code, said, faults = ask("import", tmp_path / "raw.csv", "--profile", tmp_path / "p.yaml", "--out", out)
    assert (code, said) == (2, "")
    assert faults.count("\n") == 1
    assert "raw.csv:3: time: repeated stamp" in faults
    assert not out.exists()
    assert ask("import", tmp_path / "raw.csv", "--as", "cone-dorps")[0] == 2


def test_list_importers() -> None:
    code, said, _ = ask("list", "importers")
    assert code == 0
    assert "iso-mme" in said
    assert "cube-tosses" in said
    assert "chassis/quaternion_w" in ask("list", "channels")[1]


def test_import_a_published_set(tmp_path: Path) -> None:
    if "ROLLOVER_DATA" not in os.environ:
        pytest.skip("ROLLOVER_DATA names no folder of measured recordings: real recordings are not tested")
    source = Path(os.environ["ROLLOVER_DATA"], "cube_tosses")
    words = ("import", source, "--as", "cube-tosses", "--select", "toss000", "--out", tmp_path, "--to", "parquet")
    assert ask(*words)[0] == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["toss000.parquet", "toss000.yaml"]
