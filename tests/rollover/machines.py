"""Commands as a machine may treat them: their lines, a process of their own, one that ends at a given call."""

from __future__ import annotations

import importlib
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from rollover.cli.main import app
from rollover.recording import Recording
from rollover.recording.importers import write_recording
from rollover.spec import document
from tests.fuzz import code
from tests.ground.recorded_drops import recorded as recorded_drops
from tests.rollover import studies

WRONG, MACHINE = 2, 74
# words of the lines that say how far a command is
PROGRESS = (
    "ompil",
    "cases",
    "simulating",
    "runs",
    "headings",
    "Sealed",
    "sensors",
    "looking at",
    "fits of",
    "fitted",
    "depends",
    "effects in",
    "pairs",
    "apart",
)
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
    regressed = baseline_of(folder / "given")
    (folder / "given" / "a.rrd").write_bytes(b"rrd")
    out, as_is = folder / "out", folder / "given" / "as_is.csv"
    shown = out / "v.html"
    return {
        "run": (["run", "drop_test", "--no-half-step", "--out", out / "a"], out / "a"),
        "import": (["import", recording, "--out", out], out),
        "import parquet": (["import", recording, "--out", out, "--to", "parquet"], out),
        "import mme": (["import", recording, "--out", out, "--to", "mme.zip"], out),
        "synthesize": (["synthesize", "drop_test", "--out", out, "--name", "d"], out),
        "compare": (["compare", "drop_test", recording, "--out", out / "a"], out / "a"),
        "study": (["study", study, "--workers", "0", "--out", out / "a"], out / "a"),
        "diagnose": (
            ["diagnose", "drop_test", as_is, "--workers", "0", "--out", out / "a"],
            out / "a",
        ),
        "calibrate": (
            ["calibrate", "drop_test", recording, "--fit", "vehicle.mass", "--starts", "0", "--out", out / "a"],
            out / "a",
        ),
        "identify": (["identify", *drops(folder / "given"), "--out", out / "a"], out / "a"),
        "prove": (["prove", "--cases", "1", "--kinds", "null", "--workers", "0", "--out", out / "a"], out / "a"),
        "regress": (["regress", regressed, "--workers", "0", "--out", out / "a"], out / "a"),
        "stability": (["stability", "side_overturn", "--headings", "1", "--out", out / "a"], out / "a"),
        "view": (["view", folder / "given" / "a.rrd", "--html", shown], shown),
        "new": (["new", "recording", out / "mine"], out),
        "plan": (
            [
                "plan",
                "drop_test",
                "--between",
                "mass,soil-stiffness",
                "--rate",
                "200",
                "--sensor",
                "ground/sinkage",
                "--out",
                out / "a",
            ],
            out / "a",
        ),
        "rolling": (["rolling", "vineyard_tractor", "--out", out / "a"], out / "a"),
        "export": (["export", recording, "--out", out / "e.csv"], out / "e.csv"),
        "export xlsx": (["export", recording, "--to", "xlsx", "--out", out / "e.xlsx"], out / "e.xlsx"),
        "export mat": (["export", recording, "--to", "mat", "--out", out / "e.mat"], out / "e.mat"),
        "export mme": (["export", recording, "--to", "mme.zip", "--out", out], out),
        "diagnose model": (["diagnose", "--model", *of_model(folder), "--workers", "0", "--out", out / "a"], out / "a"),
    }


NAMES = ("run", "import", "import parquet", "import mme", "synthesize", "compare", "study")
NAMES += ("diagnose", "calibrate", "identify", "prove", "regress", "stability", "view", "new")
NAMES += ("plan", "rolling", "export", "export xlsx", "export mat", "export mme", "diagnose model")


def as_it_is(folder: Path) -> None:
    """A recording of a scenario that lacks nothing, in `given`: a diagnosis of it is soon done."""
    words = ("synthesize", "drop_test", "--set", "initiation.speed=3", "--seed", "1", "--name", "as_is")
    assert rollover(*words, "--out", folder / "given").exit_code == 0


def of_model(folder: Path) -> list[object]:
    """A model of one's own and recordings of it."""
    for name, data in code.model().items():
        (folder / "given" / name).write_bytes(data)
    return [folder / "given" / name for name in ("own.py", "r1.csv", "r2.csv")]


def baseline_of(folder: Path) -> Path:
    """A scenario with its baseline, both as they are shipped."""
    shipped = document.shipped_folder()
    (folder / "baselines").mkdir(parents=True, exist_ok=True)
    for name in ("drop_test.yaml", "baselines/drop_test.yaml"):
        (folder / name).write_bytes((shipped / name).read_bytes())
    for path in (shipped / "soils").glob("*.yaml"):
        (folder / "soils").mkdir(exist_ok=True)
        (folder / "soils" / path.name).write_bytes(path.read_bytes())
    return folder / "drop_test.yaml"


def drops(folder: Path) -> list[Path]:
    """Drops of which a ground law can be identified."""
    paths = []
    for drop in recorded_drops(2, noise=0.005, speeds=(1.0, 2.0, 3.0, 3.5)):
        channels = {"ground/force_normal": drop.force, "ground/sinkage": drop.sinkage}
        conditions = {"initiation.speed": drop.speed}
        made = Recording(title=drop.name, time=drop.time, channels=channels, conditions=conditions)  # type: ignore[arg-type]
        paths.append(folder / f"s{drop.speed:g}.csv")
        write_recording(made, paths[-1], force=True)
    return paths


def once(monkeypatch: pytest.MonkeyPatch, *names: str) -> None:
    """Let functions that take long work once, and give that answer again."""
    for name in names:
        module, _, function = name.rpartition(".")
        real, known = getattr(importlib.import_module(module), function), []

        def call(*args: Any, real: Any = real, known: list[Any] = known, **more: Any) -> Any:
            if not known:
                known.append(real(*args, **more))
            return known[0]

        monkeypatch.setattr(name, call)


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
