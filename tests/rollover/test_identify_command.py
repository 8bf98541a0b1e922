"""`rollover identify`: recordings in, a soil file that runs, numbers as JSON; wrong input is one line and no file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from ground.ye import Ye2006
from rollover.cli.main import app
from rollover.recording import Recording, write_parquet
from rollover.scenario import AnyLaw, load
from rollover.spec import document
from tests.ground.recorded_drops import TRUTH, recorded
from tests.viz.html import Parts


def files(folder: Path, *, noise: float = 0.005, speeds: tuple[float, ...] = (1.0, 2.0, 3.0, 3.5)) -> list[str]:
    """Recordings as files."""
    names = []
    for drop in recorded(2, noise=noise, speeds=speeds):
        assert drop.acceleration is not None
        assert drop.force is not None
        assert drop.sinkage is not None
        path = folder / f"drop_{drop.speed:g}.parquet"
        recording = Recording(
            title=drop.name,
            time=drop.time,
            channels={
                "ground/force_normal": drop.force,
                "ground/sinkage": drop.sinkage,
                "striker/acceleration_z": -drop.acceleration,
            },
            source="made up",
            conditions={"initiation.speed": drop.speed},
        )
        write_parquet(recording, path)
        names.append(str(path))
    return names


def call(*arguments: str) -> Any:
    return CliRunner().invoke(app, ["identify", *arguments])


def test_it_writes_a_soil_that_a_scenario_takes(tmp_path: Path) -> None:
    names = files(tmp_path)
    out = tmp_path / "soil"
    done = call(*names, "--out", str(out))
    assert done.exit_code == 0, done.output
    assert sorted(p.name for p in out.iterdir()) == ["identify.json", "report.html", "soil.yaml"]
    law = document.load(out / "soil.yaml", AnyLaw)
    assert isinstance(law, Ye2006)
    assert law.second_stiffness == pytest.approx(TRUTH["second_stiffness"], rel=0.03)
    scenario = load("drop_test").replaced({"ground.law": str(out / "soil.yaml")})
    assert scenario.ground.law == law
    assert scenario.ground.law.domain.speed_most == 3.5
    assert law.calibration is not None
    assert [mark.split(" sha256:")[0] for mark in law.calibration.recordings] == [Path(n).stem for n in names]
    assert all(len(mark.split(":")[1]) == 64 for mark in law.calibration.recordings)
    assert "second_stiffness" in done.output
    page = Parts((out / "report.html").read_text())
    answer = f"Law ye-2006 from {len(names)} drops: 6 of 6 coefficients are determined."
    assert done.stdout.startswith(answer)
    assert answer in page.said
    assert {"law, at the speed of each drop", "stiffness F/z, kN/m"} <= {*page.words}
    (row,) = (row for row in page.rows if row[0] == "second_stiffness")
    assert float(row[1]) == pytest.approx(law.second_stiffness, rel=1e-4)
    assert "R = 1.000 (the paper: 0.923)" in done.output


def test_json_has_curves_intervals_and_covariance(tmp_path: Path) -> None:
    done = call(*files(tmp_path), "--out", str(tmp_path / "soil"), "--json")
    answer = json.loads(done.stdout)
    assert answer == json.loads((tmp_path / "soil" / "identify.json").read_text())
    assert answer["format"] == "rollover-identification/1"
    assert [c["name"] for c in answer["coefficients"]] == list(TRUTH)
    assert len(answer["covariance"]) == 6
    curve = answer["drops"][2]["stiffness"]
    assert len(curve["depth"]) == len(curve["value"]) == len(curve["sd"]) > 20
    assert answer["drops"][2]["branch_change"] == pytest.approx(0.02395, rel=0.05)
    assert answer["drops"][2]["rest_stiffness"] == pytest.approx(3965, rel=0.01)


def test_what_slow_drops_leave_open_is_kept_on_demand(tmp_path: Path) -> None:
    names = files(tmp_path, noise=0.007, speeds=(1.0, 1.5, 2.0, 2.5))
    said = call(*names, "--out", str(tmp_path / "a")).output
    assert "speed_exponent: not determined by these drops" in said
    assert "kept as published" not in said
    kept = call(*names, "--out", str(tmp_path / "b"), "--keep").output
    assert "kept as published" in kept
    law = document.load(tmp_path / "b" / "soil.yaml", AnyLaw)
    assert law.speed_exponent == 18.71
    origin = {i.of: i.origin for i in law.calibration.intervals}
    assert (origin["speed_exponent"], origin["second_stiffness"]) == ("kept", "data")


def test_wrong_input_is_one_line_and_leaves_nothing(tmp_path: Path) -> None:
    names = files(tmp_path, speeds=(2.0,))
    out = tmp_path / "soil"
    short = recorded(0, speeds=(2.0,))[0]
    assert short.force is not None
    write_parquet(
        Recording(
            title="no force",
            time=short.time,
            channels={"ground/sinkage": short.sinkage},  # type: ignore[dict-item]
            conditions={"initiation.speed": 2.0},
        ),
        tmp_path / "blind.parquet",
    )
    done = call(str(tmp_path / "blind.parquet"), "--out", str(out))
    assert done.exit_code == 2
    assert done.stderr.strip() == "blind: neither force nor acceleration was recorded; one of both is needed"
    done = call(names[0], names[0], "--out", str(out))
    assert (done.exit_code, "two recordings share a name" in done.stderr) == (2, True)
    done = call(names[0], "--scenario", "rops_drop", "--out", str(out))
    assert (done.exit_code, "not a striker, got 'vehicle'" in done.stderr) == (2, True)
    assert not out.exists()


def test_results_are_not_replaced_without_force(tmp_path: Path) -> None:
    names = files(tmp_path, speeds=(2.0,))
    out = tmp_path / "soil"
    assert call(*names, "--out", str(out)).exit_code == 0
    before = (out / "soil.yaml").read_bytes()
    done = call(*names, "--out", str(out), "--keep")
    assert (done.exit_code, "--force" in done.stderr) == (2, True)
    assert (out / "soil.yaml").read_bytes() == before
    assert call(*names, "--out", str(out), "--keep", "--force").exit_code == 0
    assert (out / "soil.yaml").read_bytes() != before
    (out / "mine.txt").write_text("")
    assert call(*names, "--out", str(out), "--force").exit_code == 2
