"""Commands as a machine may treat them: their lines, a process of their own, one that ends at a given call."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from rollover.cli.main import app
from rollover.recording import Recording
from rollover.recording.importers import write_recording
from tests.rollover import studies

WRONG, MACHINE = 2, 74
posix = pytest.mark.skipif(sys.platform == "win32", reason="no such locks, links and limits")


def rollover(*words: object) -> Result:
    return CliRunner().invoke(app, [str(w) for w in words])


def tree(folder: Path) -> dict[str, bytes]:
    """Every file below a folder with its content."""
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def recorded(folder: Path, name: str = "d3", force: float = 1000.0) -> Path:
    folder.mkdir(exist_ok=True)
    t = np.linspace(-0.02, 0.4, 127)
    channels = {"ground/force_normal": force * np.sin(4.0 * np.clip(t, 0.0, None)) ** 2}
    write_recording(Recording(title=name, time=t, channels=channels), folder / f"{name}.csv", force=True)
    return folder / f"{name}.csv"


def commands(folder: Path) -> dict[str, tuple[list[object], Path]]:
    """Command lines by name, and what they write."""
    recording = recorded(folder / "given")
    study = studies.drops(folder / "given", ("count: 20", "count: 4"))
    out = folder / "out"
    return {
        "run": (["run", "drop_test", "--no-half-step", "--out", out / "a"], out / "a"),
        "import": (["import", recording, "--out", out], out),
        "import parquet": (["import", recording, "--out", out, "--to", "parquet"], out),
        "import mme": (["import", recording, "--out", out, "--to", "mme.zip"], out),
        "synthesize": (["synthesize", "drop_test", "--out", out, "--name", "d"], out),
        "compare": (["compare", "drop_test", recording, "--out", out / "a"], out / "a"),
        "study": (["study", study, "--workers", "0", "--out", out / "a"], out / "a"),
    }


NAMES = ("run", "import", "import parquet", "import mme", "synthesize", "compare", "study")


def other_process(words: list[object]) -> subprocess.CompletedProcess[str]:
    line = [sys.executable, "-m", "tests.rollover.command", *map(str, words)]
    return subprocess.run(line, capture_output=True, text=True, timeout=300)


class Killed(BaseException):
    """Stands for the end of the process: nothing after it is done, no clearing up either."""


def killed(monkeypatch: pytest.MonkeyPatch, name: str, at: int) -> None:
    """End the process, as it were, at the n-th call of a function of `os`: from there on nothing reaches the disk."""
    count, real = [0], getattr(os, name)

    def call(*args: Any, **more: Any) -> Any:
        count[0] += 1
        if count[0] >= at:
            for gone in ("rename", "replace", "unlink", "rmdir"):
                monkeypatch.setattr(os, gone, lambda *a, **k: None)
            monkeypatch.setattr("shutil.rmtree", lambda *a, **k: None)
            monkeypatch.setattr(Path, "unlink", lambda *a, **k: None)
            monkeypatch.setattr(Path, "rmdir", lambda *a, **k: None)
            raise Killed
        return real(*args, **more)

    monkeypatch.setattr(os, name, call)
