"""The commands: what they answer, where, and with which exit status. Runs are made up by hand."""

from __future__ import annotations

import json
import sys
import types
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

import viz.pages
import viz.recordings
from rollover.assessment import assessed, loads, results
from rollover.assessment.criterion import Criterion, compared, judged
from rollover.cli.main import app
from rollover.dynamics import simulate
from rollover.scenario import Scenario, load
from rollover.spec import document
from rollover.spec.channels import CHANNELS
from rollover.spec.standards.requirement import Requirement
from tests.rollover.example import TEXT, Peak, run_of

runner = CliRunner()
ROOT = Path(__file__).resolve().parents[2]


def rollover(*arguments: str) -> Any:
    return runner.invoke(app, list(arguments))


SIMULATIO = "--set: simulatio: no such path; did you mean 'simulation' or 'simulation.step' or 'simulation.duration'?\n"


class Bench:
    """Stands in for the simulator, the loads and the pictures, and remembers what it was asked."""

    def __init__(self) -> None:
        self.asked: list[Scenario] = []
        self.sentence = ""
        self.finer_sentence = ""
        self.halves: list[bool] = []
        self.rows: list[tuple[Criterion, ...]] = [()]
        self.unconverged = ""

    def run(self, scenario: Scenario, *, progress: Callable[[float, float], None] | None = None) -> Any:
        self.asked.append(scenario)
        assert progress is not None
        progress(0.1, 0.2)
        return run_of(scenario, self.finer_sentence if len(self.asked) > 1 else self.sentence)

    def peak_loads(self, run: Any, half_step: Any) -> tuple[Peak, ...]:
        self.halves.append(half_step is not None)
        return (Peak(domain_flags=("speed",), half_step_change=0.001 if half_step else None),)


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Bench:
    bench = Bench()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(simulate, "run", bench.run)
    monkeypatch.setattr("ground.compiled.is_warm", lambda *_: True)
    log, report = types.ModuleType("viz.recordings.log"), types.ModuleType("viz.pages.report")
    log.write_rrd = lambda run, path, peaks, bands: path.write_bytes(b"rrd")  # type: ignore[attr-defined]
    report.page = lambda run, peaks, answer, rows, command, near, bands: f"<p>{command}</p>"  # type: ignore[attr-defined]
    report.headline = lambda *_: types.SimpleNamespace(sentence="The answer.")  # type: ignore[attr-defined]
    for module in (log, report):
        monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.setattr(assessed, "peak_loads", bench.peak_loads)
    for place in (assessed, loads):
        monkeypatch.setattr(place, "unconverged", lambda peaks: bench.unconverged)
    monkeypatch.setattr(
        assessed, "criteria", lambda run, near=(): bench.rows.pop(0) if len(bench.rows) > 1 else bench.rows[0]
    )
    monkeypatch.setattr(viz.recordings, "log", log, raising=False)
    monkeypatch.setattr(viz.pages, "report", report, raising=False)
    return bench


ASKED = Requirement(
    standard="OECD Code 4 / ISO 5700",
    name="side load",
    formula="1.75 M",
    clause="energy, load from the side",
    quantity="energy",
    unit="J",
    value=5250.0,
    bound="least",
    source="the code",
    confidence="source checked",
)


# ---------------------------------------------------------------- run


def test_run_writes_results_and_prints_peaks(bench: Bench) -> None:
    done = rollover("run", "drop_test")
    assert done.exit_code == 0, done.stderr
    folder = Path("out/run/drop_test")
    assert sorted(p.name for p in folder.iterdir()) == sorted(results.FILES)
    assert [s.simulation.step for s in bench.asked] == [0.0002, 0.0001]
    assert bench.asked[0] == load("drop_test")
    assert done.stdout.splitlines()[1] == "The answer."
    assert "ground/force_normal *" in done.stdout
    assert "3.552" in done.stdout  # kN
    assert "calibrated domain: speed." in done.stdout
    assert f"Results: {folder}" in done.stdout


def test_run_prints_and_keeps_what_it_is_held_against(bench: Bench) -> None:
    bench.rows = [(judged(ASKED, 5512.5, "load 'side' reached"),), (judged(ASKED, 5501.475, ""),)]
    done = rollover("run", "drop_test", "--require")
    assert done.exit_code == 0, done.stderr
    [line] = [line for line in done.stdout.splitlines() if "side load" in line]
    for word in ("OECD Code 4", "at least 5.25 kJ", "5.513 kJ", "+5.0 %", "0.2 %", "met"):
        assert word in line
    assert "all 1 verdicts are met" in done.stderr
    [row] = results.read_run_json(Path("out/run/drop_test"))["criteria"]
    wanted = {
        "clause": "energy, load from the side",
        "source": "the code",
        "confidence": "source checked",
        "value": 5250.0,
    }
    assert {key: row["requirement"][key] for key in wanted} == wanted
    assert (row["simulated"], row["verdict"], row["note"]) == (5512.5, "met", "load 'side' reached")
    assert row["margin"] == pytest.approx(0.05)
    assert row["at_half_step"] == 5501.475


def test_require_says_no_by_name(bench: Bench) -> None:
    bench.rows = [(judged(ASKED, 4200.0, "given up"), compared(replace(ASKED, name="rear load"), 1.0, ""))]
    assert rollover("run", "drop_test").exit_code == 0, "only where it is required"
    done = rollover("run", "drop_test", "--require")
    assert done.exit_code == 1
    said = "not met: OECD Code 4 / ISO 5700: side load, got 4.2 kJ; asked: at least 5.25 kJ. given up\n"
    assert done.stderr.endswith(said)
    assert done.stderr.count("not met") == 1
    assert done.stdout.splitlines()[2] == "Not met: side load."
    assert results.read_run_json(Path("out/run/drop_test"))["criteria"][0]["verdict"] == "not met"
    as_json = rollover("run", "drop_test", "--require", "--json")
    assert as_json.exit_code == 1
    assert json.loads(as_json.stdout)["criteria"][1]["verdict"] == "compared"
    bench.sentence = "it blew up"
    bench.asked.clear()
    assert rollover("run", "drop_test", "--require").exit_code == 3, "a failed run is no answer"


def test_require_where_nothing_is_judged_is_said(bench: Bench) -> None:
    bench.rows = [(compared(ASKED, 1.0, ""),)]
    done = rollover("run", "drop_test", "--require")
    assert done.exit_code == 0
    assert "nothing to judge" in done.stderr


def test_a_run_that_is_not_converged_is_said(bench: Bench) -> None:
    bench.unconverged = "not converged: half the step changes rops/force"
    assert "Not converged: half the step changes rops/force." in rollover("run", "drop_test").stdout


def test_run_as_json_prints_nothing_else(bench: Bench) -> None:
    done = rollover("run", "drop_test", "--json", "--out", "here")
    assert done.exit_code == 0
    assert json.loads(done.stdout) == results.read_run_json(Path("here"))
    assert done.stderr == ""


def test_run_sets_values_and_leaves_out_the_half_step(bench: Bench) -> None:
    done = rollover("run", "drop_test", "--no-half-step", "--set", "initiation.speed=2", "--set", "title=A: b")
    assert done.exit_code == 2
    assert done.stderr == "--set: title: not text, got a mapping (A); text is allowed\n"
    done = rollover("run", "drop_test", "--no-half-step", "--set", "initiation.speed=2", "--set", "title=A b")
    assert done.exit_code == 0
    assert bench.asked == [load("drop_test").replaced({"initiation.speed": 2.0, "title": "A b"})]
    assert bench.halves == [False]
    assert results.read_run_json(Path("out/run/drop_test"))["half_step"] is None


@pytest.mark.parametrize(
    ("arguments", "lines"),
    [
        (["drop_tst"], "drop_tst: no such file; did you mean 'drop_test'?\n"),
        (
            ["bad.yaml"],
            "bad.yaml:8: initiation.speed: out of bounds, got -3; "
            "a number greater than 0 and at most 20 m/s is allowed\n",
        ),
        (["drop_test", "--set", "x"], "--set: not a setting, got 'x'; PATH=VALUE is needed\n"),
        (["drop_test", "--set", "title=a", "--set", "title=b"], "--set: title: given twice; once is allowed\n"),
        (["drop_test", "--set", "simulatio=3"], SIMULATIO),
    ],
)
def test_wrong_input_is_2_and_nothing_is_run_or_written(bench: Bench, arguments: list[str], lines: str) -> None:
    Path("bad.yaml").write_text(TEXT.replace("speed: 3.0", "speed: -3"))
    done = rollover("run", *arguments)
    assert (done.exit_code, done.stderr, done.stdout) == (2, lines, "")
    assert bench.asked == []
    assert not Path("out").exists()


def test_other_results_are_kept_before_any_simulation(bench: Bench) -> None:
    assert rollover("run", "drop_test").exit_code == 0
    again = rollover("run", "drop_test")
    assert again.exit_code == 0  # the same run
    asked = len(bench.asked)
    other = rollover("run", "drop_test", "--set", "initiation.speed=2.0")
    assert other.exit_code == 2
    assert "holds another run" in other.stderr
    assert len(bench.asked) == asked
    assert rollover("run", "drop_test", "--set", "initiation.speed=2.0", "--force").exit_code == 0


def test_a_failed_run_is_3_with_its_results(bench: Bench) -> None:
    bench.sentence = "diverged at t = 0.0100 s"
    done = rollover("run", "drop_test", "--json")
    assert done.exit_code == 3
    assert done.stderr.endswith("drop_test.yaml: the simulation failed: diverged at t = 0.0100 s\n")
    assert (json.loads(done.stdout)["status"], json.loads(done.stdout)["peak_loads"]) == ("failed", [])
    assert len(bench.asked) == 1  # no half step after a failure
    assert results.read_run_json(Path("out/run/drop_test"))["sentence"] == bench.sentence


def test_a_half_step_that_fails_is_told_and_not_compared(bench: Bench) -> None:
    bench.finer_sentence = "diverged at t = 0.0100 s"
    done = rollover("run", "drop_test")
    assert done.exit_code == 0
    assert "At half the step the run failed: diverged at t = 0.0100 s" in done.stdout
    assert bench.halves == [False]


def test_without_rerun_everything_but_the_picture_is_written(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(viz.recordings, "log")
    monkeypatch.delitem(sys.modules, "viz.recordings.log")
    monkeypatch.setitem(sys.modules, "rerun", None)  # importing it fails as where it is not installed
    done = rollover("run", "drop_test")
    assert done.exit_code == 0, done.output
    assert done.stderr == "No rerun wheel for this platform: recording.rrd was not written.\n"
    assert not Path("out/run/drop_test/recording.rrd").exists()
    assert Path("out/run/drop_test/run.json").exists()


def test_an_interrupt_leaves_nothing(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(scenario: Scenario, *, progress: Any = None) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(simulate, "run", interrupted)
    done = rollover("run", "drop_test")
    assert (done.exit_code, done.stderr) == (130, "Interrupted.\n")
    assert not Path("out").exists()


def test_the_first_run_says_that_it_compiles(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ground.compiled.is_warm", lambda *_: False)
    done = rollover("run", "drop_test")
    assert done.stderr.startswith("Compiling the contact kernels, once per installation and once per new law: about ")
    assert done.stderr.count("\n") == 1
    assert "(most of it compiling, once)" in done.stdout, "its time tells no speed"
    monkeypatch.setattr("ground.compiled.is_warm", lambda *_: True)
    assert "x real time)" in rollover("run", "drop_test", "--force").stdout


def test_progress_in_lines_where_there_is_no_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    from rollover.cli import console

    with console.progress("simulating", -0.5, 3.0) as show:
        show(0.1, 1.0)  # too short to speak of
        show(0.5, 2.5)
        show(0.6, 2.6)  # too soon after
    assert capsys.readouterr().err == "simulating: 0.50 of 3 s, 0.4 x real time\n"


# ---------------------------------------------------------------- list, check, schema, view


@pytest.mark.parametrize(
    ("what", "names"),
    [
        ("scenarios", {"drop_test", "side_overturn"}),
        ("vehicles", {"utility_tractor", "rops_rig"}),
        ("soils", {"natural_clay"}),
        ("laws", {"ye-2006", "treated"}),
        ("effects", {"soil-layer", "sensor-gain", "mass"}),
        ("channels", set(CHANNELS)),
    ],
)
def test_list(what: str, names: set[str]) -> None:
    done = rollover("list", what)
    assert done.exit_code == 0
    assert names <= {line.split()[0] for line in done.stdout.splitlines()}
    rows = json.loads(rollover("list", what, "--json").stdout)
    assert len(rows) == len(done.stdout.splitlines())
    assert names <= {next(iter(row.values())) for row in rows}


def test_list_paths() -> None:
    lines = rollover("list", "paths", "drop_test").stdout.splitlines()
    assert any(
        line.split() == ["initiation.speed", "3", "m/s", "downward,", "at", "first", "contact"] for line in lines
    )
    rows = json.loads(rollover("list", "paths", "drop_test", "--json").stdout)
    assert {"path": "initiation.speed", "value": 3.0, "unit": "m/s", "meaning": "downward, at first contact"} in rows


def test_list_refuses_what_does_not_fit() -> None:
    assert rollover("list", "nothing").exit_code == 2
    assert rollover("list", "paths").stderr == "rollover list paths: whose paths, got no scenario; name one\n"
    assert rollover("list", "laws", "x").exit_code == 2


def test_check_names_an_effect_that_nothing_feels(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    effects = "effects: {mount-play: {gap: 0.01}, mass: {added: 50.0}}"
    Path("own.yaml").write_text(f"base: side_overturn\ntitle: own\nvehicle: {{rops: null}}\n{effects}\n")
    done = rollover("check", "own.yaml")
    assert done.exit_code == 0, done.output
    said = "effects.mount-play: needs a ROPS; nothing feels it here"
    assert done.stdout == f"own.yaml: scenario, valid\n  note: {said}\n"
    assert json.loads(rollover("check", "own.yaml", "--json").stdout)["files"][0]["notes"] == [said]


def test_check_tells_all_faults_of_all_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.yaml").write_text(TEXT.replace("speed: 3.0", "sped: 3.0"))
    Path("b.yaml").write_text(TEXT)
    Path("c.yaml").write_text("kind: ye-2006\nrecovery: 2\n")
    done = rollover("check", "a.yaml", "b.yaml", "c.yaml", "nope")
    assert done.exit_code == 2
    assert done.stdout == "b.yaml: scenario, valid\n"
    assert [line.split(": ")[0] for line in done.stderr.splitlines()] == ["a.yaml:6", "a.yaml:8", "c.yaml:2", "nope"]
    answer = json.loads(rollover("check", "a.yaml", "b.yaml", "--json").stdout)
    assert answer["ok"] is False
    assert [len(file["faults"]) for file in answer["files"]] == [2, 0]
    assert answer["files"][0]["faults"][1]["line"] == 8
    assert json.loads(rollover("check", "b.yaml", "--json").stdout)["ok"] is True


def test_check_follows_base_to_see_what_a_file_is() -> None:
    shelf = document.shipped_folder()
    files = [
        "drop_test",
        "side_overturn_slope",
        "vehicles/rops_rig",
        "soils/natural_clay_soft",
        "vehicles/rops/two_post_rear_3t",
    ]
    done = rollover("check", *(str(shelf / f"{name}.yaml") for name in files))
    assert done.exit_code == 0, done.stderr
    assert [line.split(": ")[1].split(",")[0] for line in done.stdout.splitlines()] == [
        "scenario",
        "scenario",
        "vehicle",
        "soil",
        "rops",
    ]


def test_schema() -> None:
    assert json.loads(rollover("schema").stdout)["title"] == "rollover scenario"
    assert json.loads(rollover("schema", "soil", "--json").stdout)["title"] == "rollover soil"


def test_view(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[Path] = []

    def open_viewer(path: Path) -> int:
        shown.append(path)
        return 0 if len(shown) < 3 else 7

    monkeypatch.setattr("viz.recordings.viewer.open_viewer", open_viewer)
    monkeypatch.setenv("DISPLAY", ":0")
    done = rollover("view", str(tmp_path))
    assert (done.exit_code, done.stderr) == (2, f"{tmp_path}: no recording.rrd there; `rollover run` writes one\n")
    picture = tmp_path / "recording.rrd"
    picture.write_bytes(b"rrd")
    assert rollover("view", str(tmp_path)).exit_code == 0
    assert rollover("view", str(picture)).exit_code == 0
    assert shown == [picture, picture]
    assert "it ended with status 7" in rollover("view", str(picture)).stderr
