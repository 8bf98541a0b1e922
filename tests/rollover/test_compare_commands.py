"""synthesize, compare and calibrate from the command line: what they write, refuse and answer."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from rollover.cli.main import app
from rollover.comparison.synthesis import synthetic, usual
from rollover.recording import Recording
from rollover.recording.importers import read_recording
from rollover.scenario import load


def rollover(*words: object) -> Result:
    return CliRunner().invoke(app, [str(w) for w in words])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two drops of a heavier striker on a stiffer soil, which the recordings do not state."""
    out = tmp_path_factory.mktemp("recordings")
    hidden = ["--hide", "ground.law.stiffness_scale=1.3", "--hide", "vehicle.mass=140"]
    for speed in (1.5, 3.0):
        done = rollover(
            "synthesize",
            "drop_test",
            "--set",
            f"initiation.speed={speed}",
            *hidden,
            "--out",
            out,
            "--name",
            f"d{speed}",
        )
        assert done.exit_code == 0, done.output
    return out


def test_a_synthetic_recording_states_what_it_may(folder: Path) -> None:
    made = read_recording(folder / "d3.0.csv")
    assert made.conditions == {"initiation.speed": 3.0}
    assert set(made.noise) == {"ground/force_normal", "ground/sinkage", "striker/acceleration_z"}
    assert np.median(np.diff(made.time)) == pytest.approx(1e-3)
    # half a percent of the range by default
    span = np.ptp(made["ground/sinkage"])
    assert made.noise["ground/sinkage"] == pytest.approx(0.005 * span, rel=0.05)
    assert rollover("synthesize", "drop_test", "--out", folder, "--name", "d3.0").exit_code == 2


@pytest.mark.parametrize("option", ["--set", "--hide"])
def test_a_wrong_value_is_reported_at_its_option(option: str, tmp_path: Path) -> None:
    wrong = {
        "effects.soil-viscous-damping.coefficient=180": "effects.soil-viscous-damping.coefficient: unknown key, got",
        "vehicle.mass": "not a setting, got 'vehicle.mass'; PATH=VALUE is needed",
    }
    for given, why in wrong.items():
        done = rollover("synthesize", "drop_test", option, given, "--out", tmp_path)
        assert (done.exit_code, done.stderr.splitlines()[-1][: len(f"{option}: {why}")]) == (2, f"{option}: {why}")
    twice = rollover("synthesize", "drop_test", *2 * (option, "vehicle.mass=140"), "--out", tmp_path)
    assert twice.stderr.splitlines()[-1] == f"{option}: vehicle.mass: given twice; once is allowed"
    assert not list(tmp_path.iterdir())


def test_no_two_recordings_share_their_noise_unless_told_so(tmp_path: Path) -> None:
    for name, seed in (("a", ()), ("b", ()), ("c", ("--seed", 4)), ("d", ("--seed", 4))):
        done = rollover("synthesize", "drop_test", "--rate", 200, *seed, "--out", tmp_path, "--name", name)
        assert done.exit_code == 0, done.output
    a, b, c, d = (read_recording(tmp_path / f"{name}.csv")["ground/sinkage"] for name in "abcd")
    before = slice(0, 4)  # of the contact, where all that is recorded is noise
    assert not np.any(a[before] == b[before])
    assert np.array_equal(c, d)


def test_compare_writes_its_folder(folder: Path, tmp_path: Path) -> None:
    done = rollover("compare", "drop_test", folder / "d3.0.csv", "--out", tmp_path / "c", "--json")
    assert done.exit_code == 0, done.output
    answer = json.loads((tmp_path / "c" / "compare.json").read_text())
    assert json.loads(done.stdout) == answer
    (one,) = answer["comparisons"]
    force = next(c for c in one["channels"] if c["channel"] == "ground/force_normal")
    assert force["cfc"] == 60
    assert force["rating"]["iso18571"]["grade"] in ("fair", "poor")
    # a stiffer soil: the recorded peak is higher than the simulated one
    assert force["rating"]["peak"]["relative_error"] < -0.1
    assert [cell["phase"] for cell in force["cells"]][:3] == ["approach", "loading", "unloading"]
    files = ["compare.json", "compare.rrd", "measured.parquet", "report.html", "simulated.parquet"]
    assert sorted(p.name for p in (tmp_path / "c").iterdir()) == files
    answers_first_in_the_viewer(tmp_path / "c" / "compare.rrd")
    page = (tmp_path / "c" / "report.html").read_text()
    assert "ISO/TS 18571" in page
    assert page.count("<svg") == 3
    # the same again is no other result; another scenario's is
    again = rollover("compare", "drop_test", folder / "d3.0.csv", "--out", tmp_path / "c")
    assert again.exit_code == 0
    other = rollover("compare", "drop_test", folder / "d3.0.csv", "--out", tmp_path / "c", "--set", "gravity=9.8")
    assert other.exit_code == 2


def answers_first_in_the_viewer(path: Path) -> None:
    """The layout names what was logged; the rating and the recording's own phases stand in it."""
    from viz.recordings.verify import blueprint_queries, check_rrd, read_column

    assert check_rrd(path) == []
    rules = dict(blueprint_queries(path))
    assert rules["Measured against simulated"] == "/report/comparison"
    assert rules["Phase, measured"] == "/phase_measured"
    _, (words,) = read_column(path, "/report/comparison", "TextDocument:text")
    assert words[0].startswith("# ISO/TS 18571 0.")
    assert "| ground force | 60 | 0." in words[0]
    colours = [
        read_column(path, f"/residual/{s}", "SeriesLines:colors")[1]
        for s in ("ground_force_normal_kN", "ground_sinkage_mm")
    ]
    assert colours[0] != colours[1]


def test_compare_refuses_and_writes_nothing(folder: Path, tmp_path: Path) -> None:
    slow = rollover("compare", "drop_test", folder / "d3.0.csv", "--out", tmp_path / "x", "--cfc", 180)
    assert slow.exit_code == 2
    assert "sampled too slowly for CFC 180, got 1000 Hz; at least 1800 Hz" in slow.stderr
    assert not (tmp_path / "x").exists()
    twice = rollover("compare", "drop_test", folder / "d3.0.csv", folder / "d3.0.yaml", "--out", tmp_path / "x")
    assert twice.exit_code == 2
    assert "a second recording by this name" in twice.stderr


def test_calibrate_finds_the_truth_and_writes_a_scenario(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "fit"
    words = ["calibrate", "drop_test", folder / "d1.5.csv", folder / "d3.0.csv", "--hold-out", "d3.0", "--starts", 2]
    done = rollover(*words, "--fit", "ground.law.stiffness_scale=0.3:3", "--fit", "vehicle.mass=90:200", "--out", out)
    assert done.exit_code == 0, done.output
    answer = json.loads((out / "calibrate.json").read_text())
    for path, truth in (("ground.law.stiffness_scale", 1.3), ("vehicle.mass", 140.0)):
        found = answer["parameters"][path]
        assert found["value"] == pytest.approx(truth, rel=0.005)
        assert found["determined"]
    assert answer["fit"]["held_out"]["after"]["over_noise"] < 1.3 < answer["fit"]["held_out"]["before"]["over_noise"]
    text = (out / "scenario-calibrated.yaml").read_text()
    assert "base: drop_test.yaml" in text
    calibrated = load(out / "scenario-calibrated.yaml")
    assert calibrated.vehicle.mass == answer["override"]["vehicle.mass"]  # type: ignore[union-attr]
    assert sorted(p.name for p in out.iterdir()) == [
        "calibrate.json",
        "override.yaml",
        "report.html",
        "scenario-calibrated.yaml",
    ]


@pytest.mark.parametrize(
    ("options", "why"),
    [
        (["--fit", "initiation.speed"], "stated as a condition of d3.0, got 3.0"),
        (["--fit", "vehicle.mass", "--hold-out", "d9"], "no such recording, got 'd9'"),
        (["--fit", "vehicle.mass", "--hold-out", "d3.0"], "nothing left to fit"),
        (["--fit", "vehicle.mass", "--fit", "vehicle.mass"], "given twice"),
        (["--fit", "vehicle.mas"], "did you mean 'vehicle.mass'"),
    ],
)
def test_calibrate_refuses(folder: Path, tmp_path: Path, options: list[str], why: str) -> None:
    done = rollover("calibrate", "drop_test", folder / "d3.0.csv", *options, "--out", tmp_path / "x")
    assert done.exit_code == 2
    assert why in done.stderr
    assert not (tmp_path / "x").exists()


def test_synthetic_noise_is_what_is_stated_and_repeats() -> None:
    t = np.linspace(0.0, 1.0, 10_001)
    quiet = Recording(title="flat", time=t, channels={"ground/sinkage": np.sin(3.0 * t)})
    made, again, other = (
        synthetic(quiet, channels=["ground/sinkage"], rate=5000.0, sigmas={"ground/sinkage": 0.01}, seed=s)
        for s in (4, 4, 5)
    )
    assert made.noise == {"ground/sinkage": 0.01}
    assert np.std(made["ground/sinkage"] - np.sin(3.0 * made.time)) == pytest.approx(0.01, rel=0.05)
    assert np.array_equal(made["ground/sinkage"], again["ground/sinkage"])
    assert not np.array_equal(made["ground/sinkage"], other["ground/sinkage"])
    with pytest.raises(ValueError, match="channel: not simulated, got 'rops/force'"):
        synthetic(quiet, channels=["rops/force"], rate=1000.0)


def test_a_test_records_the_axis_that_the_vehicle_turns_about() -> None:
    t = np.linspace(0.0, 1.0, 11)
    still = {f"chassis/{c}": 0.0 * t for c in ("roll", "pitch", "acceleration_x", "acceleration_y", "acceleration_z")}

    def made(x: float, y: float) -> tuple[str, ...]:
        turning = {"chassis/angular_velocity_x": x * t, "chassis/angular_velocity_y": y * t}
        return usual(Recording(title="turned", time=t, channels=still | turning))

    assert made(-2.0, 1.0) == tuple(
        f"chassis/{c}" for c in ("roll", "angular_velocity_x", "acceleration_y", "acceleration_z")
    )
    assert made(1.0, -2.0) == tuple(
        f"chassis/{c}" for c in ("pitch", "angular_velocity_y", "acceleration_x", "acceleration_z")
    )
