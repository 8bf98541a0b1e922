"""The Python API: each function answers as its command does, to the last bit."""

from __future__ import annotations

import inspect
import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import rollover as ro
from rollover.assessment import standing
from rollover.assessment.results import plain
from rollover.calibration import identification
from rollover.calibration import io as calibrated
from rollover.cli.main import app
from rollover.comparison import compared
from rollover.diagnosis import json_of as diagnosed
from rollover.recording import write_parquet

HEAVY = (
    "numpy",
    "scipy",
    "pyarrow",
    "exudyn",
    "numba",
    "pydantic",
    "ruamel",
    "matplotlib",
    "typer",
    "rich",
    "jinja2",
    "viz",
)
STUDY = """format: rollover-study/1
title: Speeds of a drop
scenario: drop_test
simulator: drop
axes:
  - {kind: normal, name: speed, paths: [initiation.speed], mean: 3.0, deviation: 0.1}
plan: {kind: lhs, count: 4, seed: 1}
outputs:
  - {name: ground/sinkage, limit: 0.6}
"""
FIT = "vehicle.mass"


def cli(*arguments: object) -> None:
    done = CliRunner().invoke(app, [str(a) for a in arguments])
    assert done.exit_code in (0, 1), f"{done.output}\n{done.exception!r}"


def read_json(path: Path) -> Any:
    return json.loads(path.read_text())


def said(report: object) -> Any:
    """An account as its file has it."""
    return json.loads(json.dumps(plain(report)))


def without(report: Any, *keys: str) -> Any:
    """What does not depend on the clock, nor on where it is written."""
    if isinstance(report, dict):
        return {k: without(v, *keys) for k, v in report.items() if k not in keys}
    return [without(v, *keys) for v in report] if isinstance(report, list) else report


@pytest.fixture(scope="module")
def drops(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of recorded drops with a mass that the scenario does not know."""
    folder = tmp_path_factory.mktemp("drops")
    for k, speed in enumerate(("2.0", "3.0")):
        stated = ("--set", f"initiation.speed={speed}", "--hide", "vehicle.mass=140", "--seed", k)
        cli("synthesize", "drop_test", "--out", folder, "--name", f"d{k}", *stated)
    return folder


# ---------------------------------------------------------------- what an import costs, and what it shows


def test_an_import_loads_nothing_heavy() -> None:
    code = "import sys, rollover; dir(rollover); print(' '.join(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = {name.partition(".")[0] for name in done.stdout.split()}
    assert loaded.isdisjoint(HEAVY)
    assert not [name for name in done.stdout.split() if name.startswith("rollover.") and ".system" not in name]


def test_a_command_line_that_runs_nothing_loads_nothing_heavy() -> None:
    code = "import sys, rollover.cli.main; print(' '.join(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = {name.partition(".")[0] for name in done.stdout.split()}
    assert loaded.isdisjoint({"numpy", "scipy", "pyarrow", "exudyn", "numba", "pandas", "rerun"})


def test_dir_shows_the_api_and_nothing_else() -> None:
    names = dir(ro)
    assert {"load", "run", "read", "compare", "calibrate", "identify", "diagnose", "study", "regress"} <= {*names}
    assert {"annotations", "importlib", "Path"}.isdisjoint(names)
    for name in names:
        assert getattr(ro, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'diagnoze'"):
        ro.diagnoze  # type: ignore[attr-defined]  # noqa: B018


def test_every_function_says_what_it_takes_and_gives() -> None:
    functions = [getattr(ro, name) for name in dir(ro) if name.islower() and not name.startswith("_")]
    assert len(functions) == 11
    for function in functions:
        text = function.__doc__
        parameters, _, rest = text.partition("Returns\n")
        assert "Raises\n" in rest, function.__name__
        names = function.__code__.co_varnames[: function.__code__.co_argcount + function.__code__.co_kwonlyargcount]
        told = re.split(r"[,\s]+", " ".join(re.findall(r"^    ([a-z_, ]+)$", parameters, flags=re.MULTILINE)))
        assert {*names} <= {*told}, function.__name__


def public_methods() -> Iterator[tuple[str, Any, list[str]]]:
    """Methods of the API's classes that take something, with what they take."""
    for kind in (name for name in dir(ro) if name[0].isupper()):
        for name, method in vars(getattr(ro, kind)).items():
            taken = [*inspect.signature(method).parameters] if inspect.isfunction(method) else []
            if taken[1:] and not name.startswith("_"):
                yield f"{kind}.{name}", method, taken[1:]


def test_every_method_says_what_it_takes_and_gives() -> None:
    methods = {name: (method, taken) for name, method, taken in public_methods()}
    assert methods.keys() >= {"Scenario.replaced", "Run.report", "ForwardModel.simulate", "Recording.samples"}
    for name, (method, taken) in methods.items():
        parameters, _, rest = (method.__doc__ or "").partition("Returns\n")
        assert rest, name
        said = re.split(r"[,\s]+", " ".join(re.findall(r"^ +([a-z_, ]+)$", parameters, flags=re.MULTILINE)))
        assert {*taken} <= {*said}, name


# ---------------------------------------------------------------- equal to the commands


def test_run(tmp_path: Path) -> None:
    cli("run", "drop_test", "--out", tmp_path / "run")
    done = ro.run("drop_test")
    clock = ("wall_time", "files", "origin")
    assert without(said(done.as_dict), *clock) == without(read_json(tmp_path / "run" / "run.json"), *clock)
    write_parquet(done.recording, tmp_path / "own.parquet")
    assert (tmp_path / "own.parquet").read_bytes() == (tmp_path / "run" / "channels.parquet").read_bytes()
    again = ro.read(tmp_path / "run")
    assert again.time.tobytes() == done.recording.time.tobytes()
    assert again["ground/force_normal"].tobytes() == done.recording["ground/force_normal"].tobytes()
    table = done.to_arrow()
    assert table.column_names == ["time", *done.recording.channels]
    assert table.schema.field("ground/sinkage").metadata[b"unit"] == b"m"
    assert np.asarray(table["ground/sinkage"]).tobytes() == done.recording["ground/sinkage"].tobytes()
    frame = pytest.importorskip("pandas") and done.to_pandas()
    assert frame.index.name == "time"
    assert frame["ground/sinkage"].to_numpy().tobytes() == done.recording["ground/sinkage"].tobytes()
    page = done.report(tmp_path / "page.html")
    assert (tmp_path / "page.html").read_text(encoding="utf-8") == page
    figures = re.findall(r"<svg.*?</svg>", page, flags=re.DOTALL)
    assert figures
    assert figures == re.findall(r"<svg.*?</svg>", (tmp_path / "run" / "report.html").read_text(), flags=re.DOTALL)
    peak = next(p for p in done.peaks if p.channel == "ground/force_normal")
    assert f"{peak.raw:.5g}" in done._repr_html_()


def test_synthesize(drops: Path) -> None:
    made = ro.synthesize("drop_test", {"initiation.speed": 2.0}, hidden={"vehicle.mass": 140}, seed=0)
    kept = ro.read(drops / "d0.csv")
    assert made.conditions == kept.conditions == {"initiation.speed": 2.0}
    assert list(made.channels) == list(kept.channels)
    for name in made.channels:
        assert made[name].tobytes() == kept[name].tobytes()


def test_compare(drops: Path, tmp_path: Path) -> None:
    cli("compare", "drop_test", drops, "--out", tmp_path / "compare")
    found = ro.compare("drop_test", drops)
    told = said(compared.json_of(found))
    assert told["comparisons"] == read_json(tmp_path / "compare" / "compare.json")["comparisons"]
    assert [c["recording"] for c in told["comparisons"]] == ["d0", "d1"]
    one = found["d1"].channels[0]
    assert one.channel in found._repr_html_()
    by_name = ro.compare(ro.load("drop_test"), {"d1": ro.read(drops / "d1.csv")})
    assert np.array_equal(by_name["d1"].channels[0].residual, one.residual)


def test_calibrate(drops: Path, tmp_path: Path) -> None:
    few = ("--starts", "1", "--hold-out", "d1")
    cli("calibrate", "drop_test", drops, "--fit", FIT, *few, "--out", tmp_path / "fit")
    found = ro.calibrate("drop_test", drops, FIT, hold_out="d1", starts=1)
    written = read_json(tmp_path / "fit" / "calibrate.json")
    told = said(calibrated.json_of(found))
    assert told == {key: written[key] for key in told}
    assert found.calibrated.vehicle.mass == found.override[FIT] == pytest.approx(140.0, rel=0.02)


def test_identify(drops: Path, tmp_path: Path) -> None:
    cli("identify", drops, "--out", tmp_path / "soil")
    found = ro.identify(drops)
    assert said(identification.json_of(found)) == read_json(tmp_path / "soil" / "identify.json")
    assert found.soil == (tmp_path / "soil" / "soil.yaml").read_text(encoding="utf-8")


def test_diagnose(drops: Path, tmp_path: Path) -> None:
    cli("diagnose", "drop_test", drops, "--workers", "0", "--out", tmp_path / "found")
    found = ro.diagnose("drop_test", drops)
    written = read_json(tmp_path / "found" / "diagnosis.json")
    told = said(diagnosed(found))
    asked = (
        "seconds",
        "prechecks",
        "scenario_hash",
        "recordings",
        "hold_out",
        "tolerance",
        "reference",
        "estimate",
        "origin",
    )
    assert {k: v for k, v in told.items() if k not in asked} == {k: v for k, v in written.items() if k not in asked}
    shown = found._repr_html_()
    assert found.sentence.split(".")[0] in Text(shown).text
    assert all(e.id in shown for e in found.effects)


def test_stability(tmp_path: Path) -> None:
    cli("stability", "utility_tractor", "--headings", 1, "--out", tmp_path / "slopes")
    found = ro.stability("utility_tractor", headings=1)
    written = read_json(tmp_path / "slopes" / "stability.json")
    told = said(standing.json_of(found))
    assert told == {key: written[key] for key in told}
    assert np.degrees(found.least.balance) == written["least"]["balance_deg"]


def test_regress(tmp_path: Path) -> None:
    cli("regress", "drop_test", "--workers", "0", "--out", tmp_path / "regress")
    (found,) = ro.regress("drop_test")
    (written,) = read_json(tmp_path / "regress" / "regress.json")["answers"]
    assert found.verdict == written["verdict"]
    assert [d.now for d in found.differences] == [d["now"] for d in written["differences"]]


def test_study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("speeds.yaml").write_text(STUDY)
    cli("study", "speeds.yaml", "--workers", "0", "--out", "by_command")
    told = ro.study("speeds.yaml", "by_script")
    clock = ("run_time",)
    assert said(told) == read_json(Path("by_script/study.json"))
    assert without(said(told), *clock) == without(read_json(Path("by_command/study.json")), *clock)
    names = {p.name for p in Path("by_command").iterdir()}
    assert {p.name for p in Path("by_script").iterdir()} == names
    assert ro.study("speeds.yaml", "by_script")["kept"] == 4, "what is there is not run again"


# ---------------------------------------------------------------- wrong input


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda d: ro.load("drop_tset"), "did you mean 'drop_test'"),
        (lambda d: ro.run("drop_test", ensemble=0), "ensemble: out of bounds, got 0; 1 to 100 is allowed"),
        (lambda d: ro.compare("drop_test", []), "recordings: none, got nothing; at least one is needed"),
        (lambda d: ro.compare("drop_test", {"a": d}), "2 recordings for one name, got 'a'"),
        (lambda d: ro.compare("drop_test", [ro.read(d / "d0.csv")] * 2), "a second recording by this name, got"),
        (lambda d: ro.calibrate("drop_test", d, []), "fit: nothing to fit, got none"),
        (lambda d: ro.calibrate("drop_test", d, [FIT, FIT]), "fit: a path given twice"),
        (lambda d: ro.calibrate("drop_test", d, FIT, hold_out="d7"), "hold_out: no such recording, got 'd7'"),
        (lambda d: ro.calibrate("drop_test", d, FIT, clock_sigma=float("nan")), "clock_sigma: out of bounds, got nan"),
        (lambda d: ro.identify(d, law="baring"), "law: unknown, got 'baring'"),
        (lambda d: ro.identify(d, buoyancy=-1.0), "buoyancy: out of bounds, got -1.0; 0 to 1e+06 is allowed"),
        (
            lambda d: ro.diagnose("drop_test", d, tolerance=0.6),
            "tolerance: out of bounds, got 0.6; 0 to 0.5 is allowed",
        ),
        (lambda d: ro.diagnose("drop_test", d, hold_out=["d0", "d1"]), "hold_out: nothing left to fit, got all of"),
        (lambda d: ro.stability("utility_tractor", headings=0), "headings: out of bounds, got 0; 1 to 360 is allowed"),
        (lambda d: ro.synthesize("drop_test", sigmas={"ground/sinkage": -1.0}), "ground/sinkage: out of bounds, got"),
        (lambda d: ro.study("no_study"), "no such file"),
    ],
)
def test_wrong_input_is_one_line(call: Any, says: str, drops: Path) -> None:
    with pytest.raises(ro.InputError) as caught:
        call(drops)
    (line,) = str(caught.value).splitlines()
    assert says in line


# ---------------------------------------------------------------- what a notebook shows


class Text(HTMLParser):
    """Tags and text of a block of HTML, every tag of which is closed."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[str] = []
        self.text = ""
        self.feed(html)
        assert not self.open

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        self.open.append(tag)
        self.tags.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


def test_a_notebook_escapes_what_files_say() -> None:
    wild = ro.load("drop_test").replaced({"title": "<script>alert(1)</script>", "simulation.duration": 0.02})
    shown = Text(ro.run(wild, half_step=False)._repr_html_())
    assert "script" not in shown.tags
    assert "<script>alert(1)</script>" in shown.text
    assert "table" in shown.tags


# ---------------------------------------------------------------- the commands as a module, the version


def test_the_module_and_its_version() -> None:
    for words in (["-m", "rollover"], [str(Path(sys.executable).with_name("rollover"))]):
        command = [sys.executable, *words] if words[0] == "-m" else words
        done = subprocess.run([*command, "--version"], capture_output=True, text=True, check=True)
        assert done.stdout == f"rollover {ro.__version__}\n"
    done = subprocess.run([sys.executable, "-m", "rollover", "rn"], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    root = Path(__file__).resolve().parents[2]
    project = (root / "pyproject.toml").read_text()
    assert f'\nversion = "{ro.__version__}"\n' in project
    sources = "\n".join(p.read_text() for p in (root / "rollover").rglob("*.py"))
    assert f'"{ro.__version__}"' not in sources, "the version stands in one place"


# ---------------------------------------------------------------- types

OUTSIDE = """
import rollover as ro

scenario: ro.Scenario = ro.load("drop_test").replaced({"initiation.speed": 3.0})
run: ro.Run = ro.run(scenario)
recording: ro.Recording = ro.read("d3.csv")
reveal_type(ro.load)
reveal_type(ro.read)
reveal_type(ro.run)
reveal_type(ro.compare)
reveal_type(ro.calibrate)
reveal_type(ro.identify)
reveal_type(ro.diagnose)
reveal_type(ro.study)
reveal_type(ro.regress)
reveal_type(ro.stability)
reveal_type(ro.synthesize)
reveal_type(scenario.replaced)
reveal_type(run.peaks)
reveal_type(run.status)
reveal_type(run.report)
reveal_type(ro.compare(scenario, [recording, "d4.csv"])["d4"].channels[0].cfc)
reveal_type(ro.calibrate(scenario, {"a": recording}, "vehicle.mass").override)
reveal_type(ro.identify(recording).soil)
reveal_type(ro.diagnose(scenario, recording).effects[0].parameters["x"].low)
reveal_type(ro.study("s.yaml"))
reveal_type(ro.regress()[0].ok)
reveal_type(ro.stability("utility_tractor").least.balance)
reveal_type(ro.__version__)
ro.run(3)
ro.diagnose(scenario)
ro.identify(recording, law="baring")
"""


def test_an_outside_project_sees_types(tmp_path: Path) -> None:
    (tmp_path / "outside.py").write_text(OUTSIDE)
    for name in ("rollover", "ground", "viz"):
        assert (Path(__file__).resolve().parents[2] / name / "py.typed").is_file()
    command = [sys.executable, "-m", "mypy", "--strict", "--config-file", os.devnull, "outside.py"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, check=False, timeout=600)
    told = [line for line in done.stdout.splitlines() if line.startswith("outside.py")]
    notes = [line for line in told if "Revealed type" in line]
    assert len(notes) == OUTSIDE.count("reveal_type("), done.stdout
    assert not [line for line in notes if "Any" in line]
    errors = [re.findall(r"\[([a-z-]+)\]$", line)[0] for line in told if ": error:" in line]
    assert errors == ["arg-type", "call-arg", "arg-type"], done.stdout
