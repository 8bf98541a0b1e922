"""diagnose from the command line: what it writes, answers and refuses."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from rollover.cli.commands.diagnose import tolerances
from rollover.cli.main import app
from rollover.diagnosis import Diagnosis, json_of
from rollover.diagnosis.overlay import overlays_of
from rollover.diagnosis.result import Estimate
from rollover.dynamics.drop_test import DropModel
from rollover.recording import Recording
from rollover.recording.importers import read_recording, write_recording
from rollover.scenario import load
from rollover.spec.document import find
from rollover.system.errors import Fault, InputError
from tests.rollover.diagnosed import nothing_found, sensor_at_fault

SPEEDS = (1.0, 2.0, 3.0)
DAMPING = 900.0
SIGMA = {"ground/force_normal": 40.0, "ground/sinkage": 3e-4}
VERDICTS = ("no-mismatch", "parameter", "sensor", "missing-physics", "unexplained", "cannot-tell")
NUMBER = (int, float)


def rollover(*words: object) -> Result:
    return CliRunner().invoke(app, [str(w) for w in words])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Drops on a ground with viscous damping, which the scenario lacks; one recording has a gap."""
    out = tmp_path_factory.mktemp("recordings")
    random = np.random.default_rng(5)
    for speed in SPEEDS:
        changes = {"initiation.speed": speed, "effects.soil-viscous-damping.damping": DAMPING}
        t = np.arange(-0.02, 0.45, 1.0 / 300.0)
        run = DropModel(scenario=load(find("drop_test"))).with_(changes).run(t)
        channels = {name: run[name] + random.normal(0.0, sigma, t.size) for name, sigma in SIGMA.items()}
        if speed == 3.0:
            channels["ground/sinkage"][70:90] = np.nan
        made = Recording(title=f"{speed} m/s", time=t, channels=channels, conditions={"initiation.speed": speed})
        write_recording(made, out / f"v{speed:g}.csv")
    (out / "README.md").write_text("not a recording\n")
    return out


@pytest.fixture(scope="module")
def done(folder: Path) -> tuple[Path, Result]:
    out = folder.parent / "diagnosed"
    return out, rollover("diagnose", "drop_test", folder, "--hold-out", "v2", "--out", out, "--json")


def test_it_names_what_was_left_out_and_writes_all_four(done: tuple[Path, Result]) -> None:
    out, result = done
    assert result.exit_code == 0, result.output
    assert sorted(p.name for p in out.iterdir()) == [
        "diagnosis.json",
        "diagnosis.rrd",
        "report.html",
        "scenario-diagnosed.yaml",
    ]
    answer = json.loads((out / "diagnosis.json").read_text())
    assert json.loads(result.stdout) == answer
    assert answer["verdict"] == "missing-physics"
    (effect,) = answer["effects"]
    assert effect["id"] == "soil-viscous-damping"
    assert effect["parameters"]["damping"]["low"] < DAMPING < effect["parameters"]["damping"]["high"]
    assert answer["fit"]["training"]["recordings"] == ["v1", "v3"]
    assert answer["fit"]["held_out"]["recordings"] == ["v2"]
    assert "looking at" in result.stderr
    (gap,) = [f for f in answer["prechecks"] if f["check"] == "gap"]
    assert (gap["recording"], gap["channel"]) == ("v3", "ground/sinkage")
    assert f"v3: ground/sinkage: {gap['sentence']}" in answer["notes"]
    assert_contract(answer)


def assert_contract(answer: Mapping[str, Any]) -> None:
    """Keys and kinds of values of diagnosis.json."""
    assert answer["format"] == "rollover-diagnosis/1"
    assert answer["verdict"] in VERDICTS
    assert set(answer["remaining"]) >= {"significant", "where", "depends_on"}
    assert isinstance(answer["remaining"]["significant"], bool)
    assert isinstance(answer["remaining"]["where"], list)
    assert all(isinstance(v, NUMBER) for v in answer["smallest_detectable"].values())
    assert isinstance(answer["significance"]["p_value"], NUMBER)
    assert all(isinstance(v, NUMBER) for v in answer["significance"]["noise"].values())
    for place in answer["where"]:
        assert set(place) == {"recording", "channel", "phase", "start", "end", "share", "depends_on"}
        assert place["start"] <= place["end"]
        assert 0.0 < place["share"] <= 1.0
    for effect in answer["effects"]:
        keys = {"id", "kind", "statement", "parameters", "indistinguishable_from", "discriminating_test"}
        assert keys <= set(effect)
        assert effect["kind"] in ("physics", "parameter", "sensor")
        assert ("channel" in effect) == (effect["kind"] == "sensor")
        for parameter in effect["parameters"].values():
            assert all(isinstance(parameter[k], NUMBER) for k in ("value", "low", "high"))
            assert isinstance(parameter["unit"], str)
            assert parameter["low"] <= parameter["value"] <= parameter["high"]
        assert all(isinstance(id, str) for id in effect["indistinguishable_from"])
    assert bool(answer["effects"]) == (answer["verdict"] in ("parameter", "sensor", "missing-physics"))
    for which in ("training", "held_out"):
        part = answer["fit"][which]
        assert set(part) == {"recordings", "before", "after"}
        for when in ("before", "after"):
            assert set(part[when]) == {"nrmse", "iso18571", "peak_force_error"}
            assert isinstance(part[when]["nrmse"], NUMBER)
    for candidate in answer["candidates"]:
        assert {"id", "held_out_gain", "reason"} <= set(candidate)
        assert isinstance(candidate["held_out_gain"], NUMBER)


def test_a_sensor_s_channel_stands_beside_its_numbers() -> None:
    found: Diagnosis = sensor_at_fault()
    answer = json_of(found)
    assert_contract(answer)
    assert answer["effects"][0]["channel"] == "ground/force_normal"
    assert set(answer["effects"][0]["parameters"]) == {"gain"}


def test_the_diagnosed_scenario_runs_and_follows_the_recordings(
    done: tuple[Path, Result], folder: Path, tmp_path: Path
) -> None:
    out, _ = done
    diagnosed = load(out / "scenario-diagnosed.yaml")
    answer = json.loads((out / "diagnosis.json").read_text())
    squares, count = 0.0, 0
    for name in ("v1", "v2", "v3"):
        recording = read_recording(folder / f"{name}.csv")
        run = DropModel(scenario=diagnosed).with_(dict(recording.conditions)).run(recording.time)
        left = recording["ground/force_normal"] - run["ground/force_normal"]
        left[np.abs(recording.time) < 0.004] = 0.0  # the leap of force at contact, where a microsecond decides
        assert float(np.sqrt(np.mean(left**2))) == pytest.approx(40.0, rel=0.25)
        if name in answer["fit"]["training"]["recordings"]:
            for channel, noise in answer["significance"]["noise"].items():
                there = np.isfinite(recording[channel]) & (np.abs(recording.time) >= 0.004)
                squares += float(np.sum(((recording[channel] - run[channel])[there] / noise) ** 2))
                count += int(there.sum())
    # what is left after the fit, of which time shifts of microseconds explain a little
    after_fit = answer["fit"]["training"]["after"]["nrmse"]
    assert float(np.sqrt(squares / count)) == pytest.approx(after_fit, rel=0.05)
    # the full run of it, shortened, is the drop by itself
    shortened = ["--set", "simulation.duration=0.03", "--set", "simulation.output_step=0.001"]
    ran = rollover("run", out / "scenario-diagnosed.yaml", *shortened, "--out", tmp_path / "run")
    assert ran.exit_code == 0, ran.output
    full = read_recording(tmp_path / "run")
    drop = DropModel(scenario=diagnosed).run(full.time)
    after = full.time > 0.002
    assert full["ground/force_normal"][after] == pytest.approx(drop["ground/force_normal"][after], rel=0.02)
    without = DropModel(scenario=load(find("drop_test"))).run(full.time)
    assert np.max(drop["ground/force_normal"]) > 1.5 * np.max(without["ground/force_normal"])


def test_series_are_what_the_diagnosed_scenario_predicts(folder: Path) -> None:
    effect = replace(
        sensor_at_fault().effects[0], id="soil-viscous-damping", settings={"damping": DAMPING}, channel=None
    )
    found = replace(sensor_at_fault(), effects=(effect,), training=("v1",), held_out=("v2",))
    recordings = [(name, read_recording(folder / f"{name}.csv")) for name in ("v1", "v2")]
    shown = overlays_of(load(find("drop_test")), recordings, found)
    assert [(one.recording, one.held_out) for one in shown] == [("v1", False), ("v2", True)]
    for one, (_, recording) in zip(shown, recordings, strict=True):
        assert abs(one.shift) < 5e-4
        assert [name for _, name in one.phases][:3] == ["free-fall", "first-contact", "loading"]
        sinkage = next(t for t in one.tracks if t.channel == "ground/sinkage")
        assert sinkage.measured == pytest.approx(recording["ground/sinkage"])
        assert sinkage.after is not None
        off = {"before": sinkage.before, "after": sinkage.after}
        rms = {when: float(np.sqrt(np.mean((sinkage.measured - v) ** 2))) for when, v in off.items()}
        assert rms["after"] == pytest.approx(SIGMA["ground/sinkage"], rel=0.25)
        assert rms["before"] > 10.0 * rms["after"]
    assert all(t.after is None for t in overlays_of(load(find("drop_test")), recordings[:1], nothing_found())[0].tracks)


def test_the_page_says_it_all(done: tuple[Path, Result], folder: Path) -> None:
    out, _ = done
    page = (out / "report.html").read_text()
    assert "Physics is missing from the scenario: soil-viscous-damping." in page
    for heading in (
        "What was found",
        "Where they differ",
        "How well the recordings are followed",
        "What was considered",
    ):
        assert heading in page
    assert page.count("<svg") == 6
    assert f"rollover diagnose drop_test {folder} --hold-out v2" in page
    assert json.loads((out / "diagnosis.json").read_text())["scenario_hash"] in page
    assert "v2, held out: ground/" in page
    assert "v3, held out" not in page


def test_the_picture_is_whole(done: tuple[Path, Result]) -> None:
    verify = pytest.importorskip(
        "viz.recordings.verify", reason="no rerun wheel for this platform", exc_type=ImportError
    )
    assert verify.check_rrd(done[0] / "diagnosis.rrd") == []


def test_results_of_other_recordings_are_not_overwritten(done: tuple[Path, Result], folder: Path) -> None:
    other = rollover("diagnose", "drop_test", folder / "v1.csv", "--out", done[0])
    assert other.exit_code == 2
    assert "holds results of something else" in other.stderr


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["drop_test", "{folder}", "--hold-out", "v22"], "--hold-out: no such recording, got 'v22'; did you mean 'v2'"),
        (["drop_test", "{folder}/v1.csv", "--hold-out", "v1"], "nothing left to fit, got all of v1"),
        (["drop_test", "{empty}"], "no recordings in this folder"),
        (["drop_test", "{folder}/none.csv"], "no such file"),
        (["drop_test", "{folder}", "{folder}/v1.csv"], "a second recording by this name, got 'v1'"),
        (["side_overturn", "{folder}/v1.csv"], "initiation.speed: no such path"),
        (["drop_test", "{folder}", "--set", "initiation.sped=2"], "initiation.sped"),
    ],
)
def test_wrong_input_is_one_line_and_nothing_is_written(
    words: list[str], says: str, folder: Path, tmp_path: Path
) -> None:
    (tmp_path / "empty").mkdir()
    given = [w.format(folder=folder, empty=tmp_path / "empty") for w in words]
    refused = rollover("diagnose", *given, "--out", tmp_path / "out")
    assert refused.exit_code == 2, refused.output
    assert says in refused.stderr
    assert len(refused.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--tolerance", "lots"), "--tolerance: not a share of a range, got 'lots'; a number from 0 to 0.5"),
        (("--tolerance", "0.7"), "--tolerance: not a share of a range, got '0.7'"),
        (("--tolerance", "ground/sinkag=0.05"), "no such channel in the recordings, got 'ground/sinkag'"),
        (("--reference", "v9"), "--reference: no such recording, got 'v9'"),
        (("--reference", "v1", "--hold-out", "v1"), "--reference: held out too, got 'v1'"),
        (("--reference", "v1", "--tolerance", "0.05"), "--reference: beside --tolerance, got both"),
        (("--second-opinion", "--estimate"), "--second-opinion: beside --estimate, got both; one of them says it"),
        (("--no-estimate", "--second-opinion"), "--second-opinion: beside --no-estimate, got both"),
        (("--reference", "v1", "--reference", "v2", "--hold-out", "v3"), "--reference: nothing left to fit"),
    ],
)
def test_what_is_no_share_no_channel_or_no_recording_is_one_line(
    folder: Path, tmp_path: Path, words: tuple[str, ...], said: str
) -> None:
    found = rollover("diagnose", "drop_test", folder, "--out", tmp_path / "out", *words)
    assert found.exit_code == 2
    assert said in found.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("words", "asked"),
    [
        ((), "unexplained"),
        (("--second-opinion",), "unexplained"),
        (("--estimate",), True),
        (("--no-estimate",), False),
        (("--no-second-opinion",), False),
    ],
)
def test_an_estimate_is_made_as_it_is_asked_for(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...], asked: Estimate
) -> None:
    seen: list[Estimate] = []

    def diagnosed(*_: object, estimate: Estimate, **__: object) -> None:
        seen.append(estimate)
        raise InputError(Fault(message="enough"))

    monkeypatch.setattr("rollover.diagnosis.asked.diagnosed_with_prechecks", diagnosed)
    assert rollover("diagnose", "drop_test", folder, "--out", tmp_path / "out", *words).exit_code == 2
    assert seen == [asked]


def test_shares_by_channel_leave_the_others_to_the_general_one() -> None:
    made = {"a": Recording(title="a", time=np.arange(3.0), channels={"x": np.ones(3), "y": np.ones(3)})}
    assert tolerances(["0.02", "y=0.1"], made) == {"x": 0.02, "y": 0.1}
    assert tolerances(["y=0.1"], made) == {"x": 0.0, "y": 0.1}
    assert tolerances(["0.02"], made) == 0.02
    assert tolerances([], made) == 0.0
