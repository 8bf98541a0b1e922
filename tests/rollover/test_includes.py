"""What a file may name, and how little of a foreign file a message shows; see rollover/spec/document/README.md."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from rollover.recording.importers import read_recording
from rollover.scenario import load
from rollover.spec.document import headings
from rollover.system.errors import InputError
from tests.fuzz.oracle import is_whole

SECRET = "root:x:0:0:secret"
PROFILE = """format: rollover-profile/1
channels:
  t: {channel: time, unit: s}
  F: {channel: ground/force_normal, unit: N}
"""


@pytest.mark.parametrize("how", ["above", "absolute", "link"])
def test_a_scenario_names_a_vehicle_of_a_shared_library(how: str, tmp_path: Path) -> None:
    (tmp_path / "shared").mkdir()
    vehicle = tmp_path / "shared" / "striker.yaml"
    vehicle.write_text("kind: striker\nname: Shared\nmass: 77.0\nface_length: 0.14\nface_width: 0.045\n")
    folder = tmp_path / "mine"
    folder.mkdir()
    (folder / "link.yaml").symlink_to(vehicle)
    name = {"above": "../shared/striker.yaml", "absolute": str(vehicle), "link": "link.yaml"}[how]
    (folder / "s.yaml").write_text(f"base: drop_test.yaml\nvehicle: {name}\n")
    assert getattr(load(folder / "s.yaml").vehicle, "mass") == 77.0  # noqa: B009


@pytest.mark.parametrize(
    ("content", "line"),
    [
        (SECRET, "vehicle: {0}"),
        (f"- {SECRET}\n- b\n", "base: {0}"),
        (f'"{SECRET}"', "base: {0}"),
        ("\x00" + SECRET, "base: {0}"),
    ],
)
def test_of_a_file_that_is_none_nothing_is_told(content: str, line: str, tmp_path: Path) -> None:
    (tmp_path / "passwd").write_text(content)
    (tmp_path / "x.yaml").symlink_to("passwd")
    base = "" if "base" in line else "base: drop_test.yaml\n"
    (tmp_path / "s.yaml").write_text(f"{base}{line.replace('{0}', 'x.yaml')}\n")
    with pytest.raises(InputError) as caught:
        load(tmp_path / "s.yaml")
    assert "secret" not in str(caught.value)


def test_a_scenario_names_no_program(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text("raise SystemExit('it was run')")
    for line in ("effects: own.py", "effects: {own.py: {}}", "vehicle: own.py", "base: own.py"):
        (tmp_path / "s.yaml").write_text(f"base: drop_test.yaml\n{line}\n" if "base" not in line else line)
        with pytest.raises(InputError):
            load(tmp_path / "s.yaml")


# ---- HDF5


def hdf5(folder: Path, kind: str) -> Path:
    h5py = pytest.importorskip("h5py", reason="h5py is not installed: HDF5 is not tested")
    t, force = np.arange(50.0) / 1000.0, np.linspace(0.0, 9.0, 50)
    (folder / "raw.bin").write_bytes(force.tobytes())
    with h5py.File(folder / "other.h5", "w") as other:
        other["F"] = force
    (folder / "p.yaml").write_text(PROFILE)
    path = folder / f"{kind}.h5"
    with h5py.File(path, "w") as file:
        file["t"] = t
        if kind in ("storage", "deep storage"):
            where = "F" if kind == "storage" else "a/b/c"
            file.create_dataset(where, shape=(50,), dtype="f8", external=[(str(folder / "raw.bin"), 0, 400)])
        if kind == "virtual":
            layout = h5py.VirtualLayout(shape=(50,), dtype="f8")
            layout[:] = h5py.VirtualSource(str(folder / "other.h5"), "F", shape=(50,))
            file.create_virtual_dataset("F", layout)
        if kind == "link":
            file["F"] = h5py.ExternalLink(str(folder / "other.h5"), "/F")
        if kind == "soft link out":
            file["away"] = h5py.ExternalLink(str(folder / "other.h5"), "/")
            file["F"] = h5py.SoftLink("/away/F")
        if kind in ("plain", "cycle", "soft link", "deep storage"):
            file["F"] = force
        if kind == "cycle":
            file["g/F"] = force
            file["g/up"] = file["/"]
        if kind == "soft link":
            file["also"] = h5py.SoftLink("/F")
            file["nowhere"] = h5py.SoftLink("/none")
    return path


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("storage", "F: numbers kept in another file, '"),
        ("deep storage", "a/b/c: numbers kept in another file, '"),
        ("virtual", "F: a virtual data set, put together from '"),
        ("link", "F: a link into another file, '"),
        ("soft link out", "away: a link into another file, '"),
    ],
)
def test_numbers_of_other_files_are_not_fetched(kind: str, words: str, tmp_path: Path) -> None:
    path = hdf5(tmp_path, kind)
    with pytest.raises(InputError) as caught:
        read_recording(path, profile=tmp_path / "p.yaml")
    said = str(caught.value)
    assert said.startswith(f"{path}: {words}")
    assert said.endswith("h5repack, or a copy made with h5py, puts them in")


@pytest.mark.parametrize("kind", ["plain", "cycle", "soft link"])
def test_a_file_that_stands_alone_is_read(kind: str, tmp_path: Path) -> None:
    found = read_recording(hdf5(tmp_path, kind), profile=tmp_path / "p.yaml")
    assert found["ground/force_normal"][-1] == 9.0


# ---- signals


def driven(folder: Path, signal: str) -> str:
    """What a scenario is refused with whose table follows that signal."""
    base = "base: tilt_table_recorded\ninputs:\n  table:\n    angle_deg: "
    (folder / "s.yaml").write_text(f"{base}{{{signal}, channel: input/table/angle, offset: 0.0}}\n")
    with pytest.raises(InputError) as caught:
        load(folder / "s.yaml")
    assert "secret" not in str(caught.value)
    assert is_whole(str(caught.value)) == ""
    return str(caught.value)


@pytest.mark.parametrize("name", ["passwd", "key.pem", "environ", "own.py"])
def test_a_signal_is_a_recording_and_no_other_file(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(SECRET)
    (tmp_path / "p.yaml").write_text("format: rollover-profile/1\nchannels: {t: {channel: time, unit: s}}\n")
    place = f"{tmp_path / 's.yaml'}:4: inputs.table.angle_deg.file: not the name of a recording, got '{name}'"
    assert driven(tmp_path, f"file: {name}, profile: p.yaml").startswith(place)
    (tmp_path / "r.csv").write_text("t,F\n0,1\n1,2\n")
    said = driven(tmp_path, f"file: r.csv, profile: {tmp_path / name}")
    assert "inputs.table.angle_deg.profile: not the name of a profile" in said
    assert said.endswith("one that ends in .yaml, .yml is needed")


@pytest.mark.parametrize("content", [SECRET, f"- {SECRET}\n", f'"{SECRET}"', "\x00" + SECRET])
def test_of_a_profile_that_is_none_nothing_is_told(content: str, tmp_path: Path) -> None:
    (tmp_path / "passwd").write_text(content)
    (tmp_path / "p.yaml").symlink_to("passwd")
    (tmp_path / "r.csv").write_text("t,F\n0,1\n1,2\n")
    driven(tmp_path, "file: r.csv, profile: p.yaml")


@pytest.mark.parametrize(
    "line", ["base: {0}.yaml", "base: drop_test\nvehicle: {0}.yaml", "base: drop_test\nvehicle: {0}"]
)
def test_a_name_that_no_file_can_have_is_none(line: str, tmp_path: Path) -> None:
    for name in ("n" * 5000, "a/" * 3000 + "b"):
        (tmp_path / "s.yaml").write_text(line.replace("{0}", name) + "\n")
        with pytest.raises(InputError) as caught:
            load(tmp_path / "s.yaml")
        assert str(caught.value).startswith(f"{tmp_path / 's.yaml'}:{line.count(chr(10)) + 1}: ")
    said = driven(tmp_path, f"file: {'n' * 5000}.csv")
    assert said.startswith(f"{tmp_path / 's.yaml'}:4: inputs.table.angle_deg.file: no such file")


def test_a_pipe_a_device_or_a_folder_is_told_as_one(tmp_path: Path) -> None:
    """Nothing waits for a pipe, and what is there is not called missing, with itself as what was meant."""
    os.mkfifo(tmp_path / "pipe.yaml")
    (tmp_path / "zero.yaml").symlink_to("/dev/zero")
    (tmp_path / "folder.yaml").mkdir()
    for name in ("pipe.yaml", "zero.yaml", "folder.yaml"):
        (tmp_path / "s.yaml").write_text(f"base: {name}\n")
        with pytest.raises(InputError) as caught:
            load(tmp_path / "s.yaml")
        said = str(caught.value)
        assert is_whole(said) == ""
        assert f"base: not a file, got '{name}', a folder, a device or a pipe" in said


def test_what_a_circle_describes_is_not_guessed(tmp_path: Path) -> None:
    for name, other in (("a", "b"), ("b", "a")):
        (tmp_path / f"{name}.yaml").write_text(f"base: {other}.yaml\n")
    with pytest.raises(
        InputError, match=r"a file includes itself, got \S*a.yaml -> \S*b.yaml -> \S*a.yaml; no circles"
    ):
        headings(tmp_path / "a.yaml")
