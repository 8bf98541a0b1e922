"""Foreign binary formats in a child process: what a reader does there costs its file, in one line with a cure."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rollover.recording.importers.apart import apart
from rollover.system import budget
from rollover.system.errors import Fault, InputError
from rollover.system.processes import map_cases


def reader(path: Path, wish: str = "") -> Any:
    """A stand-in for a reader, which does what it is asked for."""
    match wish:
        case "sleep":
            threading.Event().wait()
        case "busy":
            while True:
                pass
        case "exit":
            os._exit(7)
        case "eat":
            return len(bytearray(3_000_000_000))
        case "refuse":
            raise InputError(Fault(file=str(path), path="F", message="no"), Fault(file="b", message="neither"))
        case "raise":
            raise KeyError("block")
        case "process":
            return os.getpid()
    return path.read_text()


def refused(path: Path, wish: str) -> str:
    with pytest.raises(InputError) as caught:
        apart(reader, path, wish, what="TEST")
    (line,) = str(caught.value).splitlines()
    assert line.startswith(f"{path}: not ")
    assert apart(reader, path, what="TEST") == "1 2 3"  # the next file is read
    return line


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "a.bin"
    path.write_text("1 2 3")
    assert apart(reader, path, what="TEST") == "1 2 3"  # the child is there
    return path


def test_one_child_reads_file_after_file(file: Path) -> None:
    found = {apart(reader, file, "process", what="TEST") for _ in range(3)}
    assert len(found) == 1
    assert os.getpid() not in found


def test_a_reader_that_hangs_is_ended(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(budget, "WALL", 1.0)
    monkeypatch.setattr(budget, "PROCESSOR", 0.5)
    line = refused(file, "sleep")
    assert "the reader of TEST takes too long; 0.5 s of the processor, 3 s in all are allowed" in line
    assert line.endswith("ROLLOVER_BUDGET=3 in the environment allows it")


@pytest.mark.skipif(sys.platform == "win32", reason="platform: no limit of the processor's time")
def test_a_reader_that_never_ends_is_ended_by_processor_time(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(budget, "PROCESSOR", 0.5)
    began = os.times().elapsed
    assert "the reader of TEST takes too long" in refused(file, "busy")
    assert os.times().elapsed - began < budget.WALL  # long before all of the time is up


def test_a_reader_that_crashes_is_said(file: Path) -> None:
    line = refused(file, "exit")
    assert "the reader of TEST crashed, its process ended with exit code 7; the file is damaged" in line


@pytest.mark.skipif(sys.platform != "linux", reason="platform: no limit of the address space")
def test_memory_is_bounded_by_the_size_of_the_file(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert "the reader of TEST needs more than 1.012 GB of memory" in refused(file, "eat")
    monkeypatch.setenv(budget.VARIABLE, "50")
    assert apart(reader, file, "eat", what="TEST") == 3_000_000_000


def test_file_faults_come_back_unchanged_others_in_one_line(file: Path) -> None:
    with pytest.raises(InputError) as caught:
        apart(reader, file, "refuse", what="TEST")
    assert str(caught.value) == f"{file}: F: no\nb: neither"
    assert "not a readable TEST file: damaged, or of a kind that is not read; a sound file is needed" in refused(
        file, "raise"
    )


def test_a_relative_path_is_that_of_the_folder_of_now(file: Path, tmp_path: Path, monkeypatch: Any) -> None:
    for name in ("x", "y"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "a.bin").write_text(name)
        monkeypatch.chdir(tmp_path / name)
        assert apart(reader, Path("a.bin"), what="TEST") == name
    assert refused_at(Path("a.bin")) == "a.bin: F: no"


def refused_at(path: Path) -> str:
    with pytest.raises(InputError) as caught:
        apart(reader, path, "refuse", what="TEST")
    return str(caught.value).splitlines()[0]


def inside(path: Path) -> tuple[int, int]:
    return os.getpid(), apart(reader, path, "process", what="TEST")


def test_a_child_reads_by_itself(file: Path) -> None:
    (outcome,) = map_cases(inside, [file], workers=1)
    assert outcome.value is not None
    assert outcome.value[0] == outcome.value[1]


SCRIPT = """
import sys
sys.path[:0] = {path!r}
from rollover.recording.importers import read_recording
print("begins", flush=True)
print(read_recording("a.h5")["ground/force_normal"].tolist(), "h5py" in sys.modules)
"""


@pytest.mark.skipif(importlib.util.find_spec("h5py") is None, reason="h5py is not installed: HDF5 is not tested")
def test_a_script_without_a_guard_is_not_run_again(tmp_path: Path) -> None:
    import h5py

    with h5py.File(tmp_path / "a.h5", "w") as made:
        made["time"] = np.arange(3.0)
        made["ground/force_normal"] = np.arange(3.0) * 2.0
        made["time"].attrs["units"], made["ground/force_normal"].attrs["units"] = "s", "N"
    (tmp_path / "script.py").write_text(SCRIPT.format(path=[p for p in sys.path if p]))
    done = subprocess.run([sys.executable, "script.py"], cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.stdout.splitlines() == ["begins", "[0.0, 2.0, 4.0] False"], done.stderr
