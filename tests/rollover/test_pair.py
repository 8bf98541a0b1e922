"""Two runs side by side: what was changed, which loads moved and by how much, from their folders alone."""

from __future__ import annotations

import json
import shutil
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from rollover.assessment import results
from rollover.assessment.criterion import judged
from rollover.assessment.loads import PeakLoad
from rollover.cli.main import app
from rollover.comparison.run_pair import difference, pair, read
from rollover.dynamics.result import Run
from rollover.spec.standards.requirement import Requirement
from rollover.system.errors import InputError
from tests.viz import example

ZONE = Requirement(
    standard="zone",
    name="distance",
    formula="none entered",
    clause="zone",
    quantity="distance",
    unit="m",
    value=0.0,
    bound="least",
    source="the code",
    confidence="source checked",
)


def peak(channel: str, value: float, step: float | None = 0.01) -> PeakLoad:
    return PeakLoad(
        channel=channel,
        unit="N",
        raw=1.1 * value,
        raw_time=1.36,
        filtered=value,
        filtered_time=1.37,
        cfc=60,
        impulse=None,
        domain_flags=("momentum",),
        half_step_change=step,
    )


def written(folder: Path, run: Run, peaks: tuple[PeakLoad, ...], distance: float = 0.1, picture: Any = None) -> Path:
    rows = [asdict(judged(ZONE, distance, ""))]
    results.write(folder, run, peaks, criteria=rows, picture=picture)
    return folder


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A drop at 3 m/s and one at 2 m/s whose stamps are twice as far apart and which ends earlier."""
    root, was, now = tmp_path_factory.mktemp("runs"), example.drop(), example.drop(2.0)
    kept = slice(0, 601, 2)
    channels = {name: values[kept] for name, values in now.recording.channels.items()}
    now = replace(now, recording=replace(now.recording, time=now.recording.time[kept], channels=channels))
    one = (peak("ground/force_normal", 10e3), peak("wheel/a/force_normal", 0.0), peak("rops/force", 5e3, None))
    other = (peak("ground/force_normal", 8e3, 0.02), peak("rops/force", 5e3, None), peak("device/force", 1e3))
    return written(root / "was", was, one), written(root / "now", now, other, distance=-0.05)


def test_what_was_changed_is_told_by_path(folders: tuple[Path, Path]) -> None:
    found = pair(*map(read, folders))
    assert [(c.path, c.was, c.now, c.unit) for c in found.changes] == [("initiation.speed", 3.0, 2.0, "m/s")]
    assert pair(read(folders[0]), read(folders[0])).changes == ()


def test_loads_changes_and_how_sure_they_are(folders: tuple[Path, Path]) -> None:
    loads = {load.channel: load for load in pair(*map(read, folders)).loads}
    assert list(loads) == ["ground/force_normal", "rops/force", "device/force"], (
        "a wheel that never touched is left out"
    )
    ground = loads["ground/force_normal"]
    assert ground.change == pytest.approx(-0.2)
    assert (ground.step, ground.verdict) == (0.02, "changed")
    assert replace(ground, change=0.015).verdict == "within the step's error"
    assert (loads["rops/force"].change, loads["rops/force"].verdict) == (0.0, "as it was")
    assert replace(loads["rops/force"], change=0.5).verdict == "changed, step not examined"
    assert (loads["device/force"].was, loads["device/force"].verdict) == (None, "in one run only")


def test_a_verdict_that_turned_is_told(folders: tuple[Path, Path]) -> None:
    (turned,) = pair(*map(read, folders)).verdicts
    assert (turned.name, turned.was, turned.now) == ("zone: distance", "met", "not met")


def test_the_difference_stands_at_the_baselines_stamps(folders: tuple[Path, Path]) -> None:
    found = pair(*map(read, folders))
    time, less = difference(found, "striker/position_z")
    was, now = found.baseline.recording, found.candidate.recording
    assert time[-1] == now.time[-1] < was.time[-1]
    np.testing.assert_array_equal(time, was.time[: time.size])
    np.testing.assert_array_equal(less[::2], now["striker/position_z"] - was["striker/position_z"][: time.size : 2])
    middle = 0.5 * (now["striker/position_z"][1:] + now["striker/position_z"][:-1])
    np.testing.assert_allclose(less[1::2], middle - was["striker/position_z"][1 : time.size : 2], atol=1e-12)
    _, nothing = difference(pair(found.baseline, found.baseline), "ground/force_normal")
    assert not nothing.any()


def test_a_folder_that_is_not_whole_is_refused(folders: tuple[Path, Path], tmp_path: Path) -> None:
    (tmp_path / "run.json").write_text((folders[0] / "run.json").read_text())
    with pytest.raises(InputError, match=r"no scenario.yaml there; run it again"):
        read(tmp_path)


def test_what_older_versions_did_not_write_of_a_load_is_unknown(folders: tuple[Path, Path], tmp_path: Path) -> None:
    shutil.copytree(folders[0], tmp_path / "old")
    file = tmp_path / "old" / "run.json"
    answer = json.loads(file.read_text())
    may_be_none = [f.name for f in fields(PeakLoad) if f.default is None]
    assert {"half_step_change", "impulse", "mean", "starts_by"} <= set(may_be_none)
    answer["peak_loads"] = [{k: v for k, v in p.items() if k not in may_be_none} for p in answer["peak_loads"]]
    file.write_text(json.dumps(answer))
    old = read(tmp_path / "old")
    assert [(p.half_step_change, p.impulse) for p in old.peaks] == [(None, None)] * 3
    assert pair(old, read(folders[1])).loads
    answer["peak_loads"][0]["starts_by"] = 3
    file.write_text(json.dumps(answer))
    with pytest.raises(InputError, match="starts_by: not text, got 3"):
        read(tmp_path / "old")


def test_the_command(folders: tuple[Path, Path], tmp_path: Path) -> None:
    out = tmp_path / "pair"
    words = ["compare", *map(str, folders), "--out", str(out)]
    done = CliRunner().invoke(app, [*words, "--json"])
    assert done.exit_code == 0, done.output
    answer = json.loads((out / "compare.json").read_text())
    assert json.loads(done.stdout) == answer
    assert answer["format"] == "rollover-compare-runs/1"
    assert answer["answer"] == "ROPS force: 5.00 kN before, 5.00 kN now: +0 %."
    assert answer["changed"] == [{"path": "initiation.speed", "was": 3.0, "now": 2.0, "unit": "m/s"}]
    assert "no recording.rrd there" in done.stderr, "these runs have none"
    page = (out / "report.html").read_text()
    assert "not met" in page
    assert "candidate less baseline" in page
    assert page.index("<svg") < page.index("<table"), "curves first"
    text = CliRunner().invoke(app, words)
    first, *rows = [line.split() for line in text.stdout.splitlines()]
    assert " ".join(first) == answer["answer"]
    assert ["Ground", "force", "10.0", "kN", "8.00", "kN", "-20", "%", "changed"] in rows
    assert ["initiation.speed", "3.0", "m/s", "2.0", "m/s"] in rows
    turned = CliRunner().invoke(app, ["compare", str(folders[1]), str(folders[0]), "--out", str(out)])
    assert (turned.exit_code, "--force" in turned.stderr) == (2, True)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["x.csv"], "the results of a run, got 'x.csv' beside them; the results of one other run are needed"),
        (["NOW", "NOW"], "the results of one other run are needed"),
        (["NOW", "--set", "gravity=9"], "--set: two runs are compared as they are; leave it out"),
        (["NOW", "--cfc", "60"], "--cfc: two runs are compared as they are; leave it out"),
    ],
)
def test_what_two_runs_cannot_be_asked(folders: tuple[Path, Path], tmp_path: Path, more: list[str], said: str) -> None:
    table = tmp_path / "x.csv"
    table.write_text("t,F\n0,1\n")
    words = [{"NOW": str(folders[1]), "x.csv": str(table)}.get(word, word) for word in more]
    said = said.replace("x.csv", str(table))
    done = CliRunner().invoke(app, ["compare", str(folders[0]), *words, "--out", str(tmp_path / "out")])
    assert done.exit_code == 2
    assert said in done.stderr
    assert not (tmp_path / "out").exists()
