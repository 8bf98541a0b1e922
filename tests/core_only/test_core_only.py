"""Without any optional package: what needs one says so in one line, all else works (`make test-core`)."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
# extra -> name of a file and how it begins; the reader must stop before it looks any further
FILES = {
    "tdms": ("a.tdms", b"TDSm"),
    "mdf": ("a.mf4", b"MDF     "),
    "hdf5": ("a.h5", b"\x89HDF\r\n\x1a\n"),
    "mcap": ("a.mcap", b"\x89MCAP0\r\n"),
    "ide": ("a.ide", b"\x1a\x45\xdf\xa3" + b"mide"),
}
STUDY = """format: rollover-study/1
title: Speeds
scenario: drop_test.yaml
axes:
  - {kind: normal, name: speed, paths: [initiation.speed], mean: 3.0, deviation: 0.1}
plan: {kind: lhs, count: 4, seed: 1}
outputs:
  - {name: ground/sinkage, limit: 0.6}
"""
COMMANDS = {
    "cluster": ["study", "s.yaml", "--scheduler", "tcp://127.0.0.1:1"],
    "slurm": ["study", "s.yaml", "--scheduler", "slurm"],
    "reliability": ["study", "reliability.yaml"],
    "xlsx": ["import", "balls", "--as", "falling-balls"],
    "posterior": ["calibrate", "drop_test", "d.csv", "--fit", "vehicle.mass", "--posterior"],
    "proof": ["prove", "--kinds", "foreign-engine", "--cases", "1"],
}
CSV = "t,F\n" + "".join(f"{k * 1e-3},{(k * k) % 7 * 1e-2}\n" for k in range(200))
SIDECAR = """format: rollover-recording/1
channels:
  t: {channel: time, unit: s}
  F: {channel: ground/force_normal, unit: kN}
"""


def rollover(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [str(Path(sys.executable).with_name("rollover")), *arguments]
    return subprocess.run(command, capture_output=True, text=True, cwd=cwd, timeout=300)


@pytest.mark.parametrize("extra", EXTRAS)
def test_no_package_of_an_extra_is_here(extra: str) -> None:
    names = [re.split(r"[<>=]", package)[0].replace("-", "_") for package in EXTRAS[extra]]
    assert any(find_spec(name) is None for name in names), f"{extra} is installed: this is no core-only environment"


@pytest.mark.parametrize("extra", FILES)
def test_a_file_that_needs_an_extra_is_refused_by_its_name(extra: str, tmp_path: Path) -> None:
    name, head = FILES[extra]
    (tmp_path / name).write_bytes(head + bytes(64))
    done = rollover("check", name, cwd=tmp_path)
    assert done.returncode == 2
    (line,) = done.stderr.strip().splitlines()
    assert re.fullmatch(rf"{name}: needs \w+, which is not installed; pip install 'rollover\[{extra}\]'", line), line


@pytest.mark.parametrize("extra", COMMANDS)
def test_a_command_that_needs_an_extra_is_refused_by_its_name(extra: str, tmp_path: Path) -> None:
    (tmp_path / "s.yaml").write_text(STUDY)
    (tmp_path / "reliability.yaml").write_text(STUDY + "reliability: {count: 100}\n")
    (tmp_path / "balls").mkdir()
    (tmp_path / "balls" / "Ball_drops_data.xls").write_bytes(b"PK\x03\x04" + bytes(64))
    (tmp_path / "balls" / "balls.txt").write_text("ball,mass,circumference\n")
    (tmp_path / "d.csv").write_text(CSV)
    (tmp_path / "d.yaml").write_text(SIDECAR)
    done = rollover(*COMMANDS[extra], cwd=tmp_path)
    assert done.returncode == 2, done.stderr
    (line,) = done.stderr.strip().splitlines()
    assert f"pip install 'rollover[{extra}]'" in line
    assert not (tmp_path / "out").exists()


def test_recordings_as_csv_need_nothing_more(tmp_path: Path) -> None:
    (tmp_path / "d.csv").write_text(CSV)
    (tmp_path / "d.yaml").write_text(SIDECAR)
    done = rollover("check", "d.csv", cwd=tmp_path)
    assert done.returncode == 0, done.stderr


def test_every_extra_is_asked_for() -> None:
    assert set(EXTRAS) == {*FILES, *COMMANDS}
