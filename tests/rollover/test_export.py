"""`rollover export`: what a result holds, in formats of other programs, is what our own importers read back."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from rollover import scenario as scenarios
from rollover.cli.main import app
from rollover.dynamics import simulate
from rollover.recording import Clock, Recording, Sensor, write_parquet
from rollover.recording.importers import read_recording, write_recording
from rollover.recording.importers.mat import legal_names
from rollover.spec.channels import describe
from rollover.spec.document import shipped_folder

SCENARIOS = sorted(p.stem for p in shipped_folder().glob("*.yaml"))
FORMATS = ("csv", "xlsx", "mme.zip", "mat")
SIXTEEN_DIGITS = 5e-16 + 2.0**-53  # half a unit of the sixteenth digit of 1.0, as a workbook rounds, and of a double
EVEN = 1e-12  # s; an ISO-MME file states even stamps by their first and their step


def export(*words: str | Path) -> tuple[int, str, str]:
    done = CliRunner().invoke(app, ["export", *map(str, words)])
    return done.exit_code, done.stdout, done.stderr


def close(found: np.ndarray, given: np.ndarray, relative: float) -> bool:
    return bool(np.array_equal(np.isnan(found), np.isnan(given))) and bool(
        np.all(np.abs(found - given)[~np.isnan(given)] <= relative * np.abs(given)[~np.isnan(given)])
    )


@pytest.fixture(scope="module")
def runs() -> dict[str, Recording]:
    return {}


@pytest.fixture
def run(request: pytest.FixtureRequest, runs: dict[str, Recording]) -> Recording:
    """The first 20 ms of a shipped scenario: all its channels, few rows."""
    name = request.param
    if name not in runs:
        short = scenarios.load(shipped_folder() / f"{name}.yaml").replaced({"simulation.duration": 0.02})
        runs[name] = simulate.run(short).recording
    return runs[name]


@pytest.mark.parametrize("run", SCENARIOS, indirect=True, ids=SCENARIOS)
def test_every_shipped_channel_comes_back_from_every_format(run: Recording, tmp_path: Path) -> None:
    for to in FORMATS:
        folder = tmp_path / to
        folder.mkdir()
        write_parquet(run, folder / "channels.parquet")
        status, _, said = export(folder, "--to", to, "--out", tmp_path / f"back.{to}")
        assert status == 0, said
        found = read_recording(tmp_path / f"back.{to}")
        assert list(found.channels) == list(run.channels), to
        exact = SIXTEEN_DIGITS if to == "xlsx" else 0.0
        for name, values in run.channels.items():
            assert close(found[name], values, exact), (to, name)
        if to == "mme.zip":
            assert np.abs(found.time - run.time).max() <= EVEN
        else:
            assert close(found.time, run.time, exact), to


def odd() -> Recording:
    """Gaps, a clock of its own, names that meet in MATLAB, words that a workbook could take for something else."""
    values = np.random.default_rng(1).normal(size=(4, 30)) * 1e3 / 3.0
    values[1, 4:9] = np.nan
    names = ("sensor/a-b/acceleration_x", "sensor/a_b/acceleration_x", "rops/force_y", "chassis/quaternion_w")
    sensor = Sensor(body="rops", position=(0.1, -0.2, 1.7), gravity="proper")
    return Recording(
        title="=1+1 Überschlag: # 'eins' 🚜",
        source="_x0041_ lab, a\nb",
        time=np.cumsum(np.random.default_rng(2).uniform(1e-4, 1e-3, 30)) - 0.01,
        channels=dict(zip(names, values, strict=True)),
        conditions={"initiation.speed": 3.1},
        uncertainty={"initiation.speed": 0.05},
        noise={"rops/force_y": 0.1},
        cfc={"rops/force_y": 600},
        clock=Clock(zero="unknown"),
        sensors={names[0]: sensor, names[1]: sensor},
        notes=("=A1", "  two", "x" * 40_000),
    )


@pytest.mark.parametrize("to", ["csv", "xlsx", "mat"])
def test_what_is_known_of_the_channels_goes_along(to: str, tmp_path: Path) -> None:
    write_recording(odd(), tmp_path / f"odd.{to}", with_units=True)
    found = read_recording(tmp_path / f"odd.{to}")
    for part in ("title", "source", "conditions", "uncertainty", "noise", "cfc", "clock", "sensors", "notes"):
        assert getattr(found, part) == getattr(odd(), part), part
    for name, values in odd().channels.items():
        assert close(found[name], values, SIXTEEN_DIGITS if to == "xlsx" else 0.0), name


@pytest.mark.parametrize("to", FORMATS)
def test_a_single_sample_is_a_recording_too(to: str, tmp_path: Path) -> None:
    one = Recording(title="one", time=np.array([0.25]), channels={"ground/sinkage": np.array([0.1])})
    write_recording(one, tmp_path / f"one.{to}")
    found = read_recording(tmp_path / f"one.{to}")
    assert (found.time.tolist(), found["ground/sinkage"].tolist()) == ([0.25], [0.1])


def test_a_matlab_structure_has_legal_and_original_names(tmp_path: Path) -> None:
    from scipy.io import loadmat

    write_recording(odd(), tmp_path / "a.mat")
    held = loadmat(str(tmp_path / "a.mat"), simplify_cells=True)["recording"]
    names = held["names"]
    assert set(names.values()) == set(odd().channels)
    assert set(held["channels"]) == set(names)
    assert "sensor_a_b_acceleration_x" in names
    assert "sensor_a_b_acceleration_x_2" in names
    for field, channel in names.items():
        assert field.isidentifier()
        assert field.isascii()
        assert held["units"][field] == describe(channel).unit
        assert np.array_equal(held["channels"][field], odd()[channel], equal_nan=True)
    assert np.array_equal(held["time"], odd().time)
    long = [f"sensor/{'n' * 70}{i}/angular_velocity_x" for i in range(12)]
    made = list(legal_names(long).values())
    assert len(set(made)) == 12
    assert max(map(len, made)) <= 63  # MATLAB's namelengthmax


def test_headings_of_tables_have_names_and_si_units(tmp_path: Path) -> None:
    write_parquet(odd(), tmp_path / "channels.parquet")
    assert export(tmp_path, "--out", tmp_path / "e.csv", "--channel", "rops/*")[0] == 0
    lines = (tmp_path / "e.csv").read_text().splitlines()
    assert lines[0].replace('"', "") == "time [s],rops/force_y [N]"
    assert float(lines[1].split(",")[1]) == odd()["rops/force_y"][0]
    from openpyxl import load_workbook

    assert export(tmp_path, "--to", "xlsx", "--out", tmp_path / "e.xlsx")[0] == 0
    sheet = load_workbook(tmp_path / "e.xlsx")["channels"]
    assert [c.value for c in sheet[1]] == ["time [s]", *(f"{n} [{describe(n).unit}]" for n in odd().channels)]
    assert sheet["C6"].value is None  # a gap is an empty cell


def test_a_workbook_of_somebody_else_is_read_by_a_profile(tmp_path: Path) -> None:
    from openpyxl import Workbook

    book = Workbook()
    page = book.active
    for row in (["t", "Kraft", "Notiz"], ["ms", "kN", None], [0, 1.5, "a"], [1, None, "b"], [2, 2, "c"]):
        page.append(row)
    book.save(tmp_path / "a.xlsx")
    profile = tmp_path / "p.yaml"
    head = "format: rollover-profile/1\nchannels:\n  t: {channel: time}\n"
    profile.write_text(f"{head}  Kraft: {{channel: ground/force_normal}}\n")
    found = read_recording(tmp_path / "a.xlsx", profile=profile)
    assert found.time.tolist() == [0.0, 1e-3, 2e-3]
    assert found["ground/force_normal"][[0, 2]].tolist() == [1500.0, 2000.0]
    assert np.isnan(found["ground/force_normal"][1])
    assert any("text, got 'a': Notiz" in note for note in found.notes)


def made_comparison(tmp_path: Path) -> Path:
    for speed in ("2.0", "3.0"):
        words = ["synthesize", "drop_test", "--set", f"initiation.speed={speed}", "--out", str(tmp_path / "rec")]
        assert CliRunner().invoke(app, [*words, "--name", f"d{speed[0]}"]).exit_code == 0
    done = CliRunner().invoke(app, ["compare", "drop_test", str(tmp_path / "rec"), "--out", str(tmp_path / "c")])
    assert done.exit_code == 0, done.output
    return tmp_path / "c"


def test_a_comparison_gives_both_sides_of_each_recording(tmp_path: Path) -> None:
    status, out, said = export(made_comparison(tmp_path), "--to", "mat", "--out", tmp_path / "e", "--json")
    assert status == 0, said
    names = [Path(row["file"]).name for row in json.loads(out)["files"]]
    assert names == ["d2-measured.mat", "d2-simulated.mat", "d3-measured.mat", "d3-simulated.mat"]
    measured, simulated = (read_recording(tmp_path / "e" / f"d3-{side}.mat") for side in ("measured", "simulated"))
    said_of = {c["recording"]: c for c in json.loads((tmp_path / "c" / "compare.json").read_text())["comparisons"]}
    raw = read_recording(tmp_path / "rec" / "d3.csv")
    force = "ground/force_normal"
    assert set(np.round(measured.time, 9)) <= set(np.round(raw.time, 9))
    assert np.nanmax(np.abs(measured[force] - simulated[force])) < 0.1 * np.nanmax(measured[force])
    assert not np.array_equal(measured[force], simulated[force])
    assert set(measured.channels) == {c["channel"] for c in said_of["d3"]["channels"]}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("nowhere",), "nowhere: no such file"),
        (("run", "--to", "xls"), "--to: no such format, got 'xls'; csv, xlsx, mme.zip, mat are allowed"),
        (("run", "--to", "csv", "--out", "a.mat"), "--out: another ending than --to csv, got 'a.mat'"),
        (("run", "--channel", "ropes/*"), "--channel: no such channel, got 'ropes/*'"),
        (("empty",), "empty: no recordings in this folder"),
        (("run", "--out", "there.csv"), "there.csv: exists; --force replaces it"),
        (("run", "--to", "csv", "--out", "beside.csv"), "beside.yaml: exists; --force replaces it"),
        (("pair",), "pair: two runs compared, got no histories of its own; those of the runs: a, b"),
        (("old",), "old: no measured.parquet there; `rollover compare` writes it anew"),
    ],
)
def test_what_cannot_be_exported_is_one_line(
    words: tuple[str, ...], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for folder in ("run", "empty", "pair", "old"):
        Path(folder).mkdir()
    write_parquet(odd(), Path("run", "channels.parquet"))
    sides: dict[str, Any] = {"baseline": {"folder": "a"}, "candidate": {"folder": "b"}}
    Path("pair", "compare.json").write_text(json.dumps({"format": "rollover-pair/1", "recordings": [], **sides}))
    Path("old", "compare.json").write_text(json.dumps({"format": "rollover-compare/1", "recordings": ["d"]}))
    for file in ("there.csv", "beside.yaml"):
        Path(file).write_text("mine\n")
    before = sorted(os.listdir())
    status, out, err = export(*words)
    assert (status, out, err.count("\n")) == (2, "", 1), err
    assert said in err
    assert sorted(os.listdir()) == before
    assert Path("there.csv").read_text() == "mine\n"


def test_what_has_no_place_in_iso_mme_is_said(tmp_path: Path) -> None:
    named = {name: values for name, values in odd().channels.items() if not name.startswith("sensor/")}
    write_parquet(replace(odd(), channels=named, sensors={}), tmp_path / "channels.parquet")
    status, _, said = export(tmp_path, "--to", "mme.zip", "--out", tmp_path / "a.mme.zip")
    assert status == 0
    assert "without its conditions, uncertainty, noise, for which an ISO-MME test has no place" in said


def test_a_placed_instrument_is_no_channel_of_iso_mme(tmp_path: Path) -> None:
    write_parquet(odd(), tmp_path / "channels.parquet")
    status, _, said = export(tmp_path, "--to", "mme.zip", "--out", tmp_path / "a.mme.zip")
    assert (status, said.count("\n")) == (2, 1), said
    assert "where an instrument sits, got sensor/a-b/acceleration_x" in said
    assert sorted(os.listdir(tmp_path)) == ["channels.parquet"]
