"""`rollover regress` on short scenarios: what is planted is caught and named, what is the same passes."""

from __future__ import annotations

import json
import re
import shlex
import shutil
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from ground.law import GroundLaw
from ground.ye import Ye2006
from rollover.cli.main import app
from rollover.scenario import load
from rollover.studies import baseline as baselines
from rollover.studies import regression
from rollover.studies.baseline import against
from rollover.studies.ensemble import measured, perturbed_starts

runner = CliRunner()
DROP = """\
base: drop_test.yaml
ground: {law: soil/soil.yaml}
simulation: {duration: 0.25}
"""
CORNER = """\
base: rops_drop.yaml
ground: {law: soil/soil.yaml}
simulation: {duration: 0.15}
"""
SOIL = "base: soils/natural_clay.yaml\nstiffness_scale: {scale}\n"


def regress(*arguments: object, workers: int = 0) -> Any:
    return runner.invoke(app, ["regress", *map(str, arguments), "--workers", str(workers)])


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("made") / "scenarios"
    folder.mkdir()
    (folder / "drop.yaml").write_text(DROP)
    (folder / "corner.yaml").write_text(CORNER)
    (folder / "soil").mkdir()
    (folder / "soil" / "soil.yaml").write_text(SOIL.format(scale=1.0))
    done = regress(folder, "--update", "--reason", "first", "--out", folder.parent / "out")
    assert done.exit_code == 0, done.stderr
    assert "2 baselines written" in done.stdout.lower()
    return folder


@pytest.fixture
def folder(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return Path(shutil.copytree(made, tmp_path / "scenarios"))


def kept(folder: Path) -> dict[str, bytes]:
    return {p.name: p.read_bytes() for p in (folder / "baselines").iterdir()}


def test_the_same_tree_passes_in_child_processes(folder: Path) -> None:
    done = regress(folder, "--json", workers=2)
    assert done.exit_code == 0, done.stdout + done.stderr
    found = json.loads(done.stdout)
    assert found["ok"]
    assert [a["scenario"] for a in found["answers"]] == ["corner", "drop"]
    changes = [d["change"] for a in found["answers"] for d in a["differences"] if d["change"] is not None]
    assert len(changes) > 10
    assert max(map(abs, changes)) <= 5e-10  # the digits of a value in a file
    out = folder.parent / "out" / "regress"
    assert json.loads((out / "regress.json").read_text()) == found
    assert (out / "regress.csv").read_text().count("\n") == 1 + sum(len(a["differences"]) for a in found["answers"])
    page = (out / "report.html").read_text()
    assert "No peak load of 2 scenarios has moved beyond its tolerance." in page
    assert "http" not in page


def test_softer_soil_is_caught(folder: Path) -> None:
    (folder / "soil" / "soil.yaml").write_text(SOIL.format(scale=0.95))
    done = regress(folder)
    assert done.exit_code == 1
    assert "corner: the scenario's own values have changed" in done.stdout
    rows = [line.split() for line in done.stdout.splitlines()]
    assert any(r[:3] == ["drop", "ground/force_normal", "raw"] for r in rows)
    assert any(r[:4] == ["corner", "rops/force", "CFC", "60"] for r in rows)


def test_more_mass_is_caught(folder: Path) -> None:
    path = folder / "drop.yaml"
    path.write_text(path.read_text() + "vehicle: {mass: 134.64}\n")
    done = regress(path, folder / "corner.yaml", "--json")
    assert done.exit_code == 1
    corner, drop = sorted(json.loads(done.stdout)["answers"], key=lambda a: a["scenario"])
    assert corner["verdict"] == "same"
    assert drop["verdict"] == "changed"
    assert {d["load"] for d in drop["differences"] if not d["same"]} == {"ground/force_normal", "ground/sinkage"}


def test_a_flipped_sign_in_the_law_is_caught(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    numbers = vars(GroundLaw)["p"].fget

    def flipped(self: Ye2006) -> Any:
        p = numbers(self)
        p[p == self.sinkage_exponent] *= -1.0
        return p

    monkeypatch.setattr(Ye2006, "p", property(flipped))
    done = regress(folder)
    assert done.exit_code == 1
    assert "2 of 2 scenarios are not as they were" in done.stdout
    assert "ground/force_normal" in done.stdout


def test_a_perturbation_of_the_last_digits_passes(folder: Path) -> None:
    for name in ("drop", "corner"):
        scenario = load(folder / f"{name}.yaml")
        known = baselines.read(folder / "baselines" / f"{name}.yaml")
        again = measured(scenario.replaced({"gravity": scenario.gravity * (1.0 + 1e-12)}))
        answer = against(known, scenario, [again])
        assert answer.ok, answer.sentence
        moved = max(abs(d.change) for d in answer.differences if d.change is not None)
        assert moved < 1e-6


def test_the_shipped_overturn_passes_under_other_rounding() -> None:
    # 1e-12 of gravity is as good as another processor: each start falls otherwise, the mean stays
    scenario = load("side_overturn")
    known = baselines.read(baselines.path_of(regression.chosen(["side_overturn"]).files[0]))
    assert known.starts > 1
    starts = [s.replaced({"gravity": s.gravity * (1.0 + 1e-12)}) for s in perturbed_starts(scenario, known.starts)]
    answer = against(known, scenario, [measured(s) for s in starts])
    assert answer.ok, answer.sentence
    moved = max(abs(d.change) for d in answer.differences if d.change is not None)
    assert moved > 1e-4, "chaos was expected"


def test_a_missing_baseline_an_unknown_one_and_one_left_out(folder: Path) -> None:
    (folder / "new.yaml").write_text((folder / "drop.yaml").read_text())
    (folder / "baselines" / "gone.yaml").write_text("")
    done = regress(folder)
    assert done.exit_code == 1
    assert "new" in done.stdout
    (advised,) = re.findall(r"`rollover (regress .*? --update) --reason TEXT` makes one", done.stdout)
    assert Path(shlex.split(advised)[1]) == folder / "new.yaml"
    assert "baselines/gone.yaml: no scenario of that name" in done.stdout
    assert "2 of 4 scenarios are not as they were" in done.stdout
    (folder / "baselines" / "gone.yaml").unlink()
    text = "format: rollover-excluded/1\nscenarios:\n  - {name: new, reason: a sketch}\n"
    (folder / "baselines" / "excluded.yaml").write_text(text)
    done = regress(folder, "--force")
    assert (done.exit_code, "excluded" in done.stdout, "a sketch" in done.stdout) == (0, True, True)
    none = "excluded, its line in baselines/excluded.yaml removed gives a baseline: new."
    assert f"No peak load of 2 scenarios has moved beyond its tolerance; {none}" in done.stdout
    for more in ((), ("--update", "--reason", "now")):
        done = regress(folder / "new.yaml", "--force", *more)
        assert (done.exit_code, f"Nothing was compared; {none}" in done.stdout) == (0, True)
    assert not (folder / "baselines" / "new.yaml").exists()
    (folder / "baselines" / "excluded.yaml").write_text(
        text + "  - {name: drop, reason: no}\n  - {name: drp, reason: no}\n"
    )
    done = regress(folder)
    assert done.exit_code == 1
    assert "has a baseline and stands in baselines/excluded.yaml as well" in done.stdout
    assert "baselines/excluded.yaml: no scenario of that name; did you mean 'drop'?" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["--update"], "--update: without a reason; --reason TEXT is needed"),
        (["--update", "--reason", " "], "--update: without a reason; --reason TEXT is needed"),
        (["--reason", "x"], "--reason: nothing to give a reason for; --update is needed"),
    ],
)
def test_an_update_needs_a_reason(folder: Path, arguments: list[str], line: str) -> None:
    before = kept(folder)
    done = regress(folder, *arguments)
    assert (done.exit_code, done.stderr) == (2, line + "\n")
    assert kept(folder) == before
    assert not Path("out").exists()


def test_a_failed_scenario_costs_itself_and_stops_an_update(folder: Path) -> None:
    before = kept(folder)
    path = folder / "corner.yaml"
    path.write_text(path.read_text().replace("law: soil", "elements: {length: 0.1, width: 0.1}, law: soil"))
    done = regress(folder)
    assert done.exit_code == 1
    assert "the run failed: FailedRunError: left the array of ground elements at t = " in done.stdout
    assert "4 loads as they were" in done.stdout
    done = regress(folder, "--update", "--reason", "x")
    assert done.exit_code == 3
    assert "Nothing was written to the baselines." in done.stderr
    assert kept(folder) == before


def test_an_update_names_changes_and_the_next_run_passes(folder: Path) -> None:
    path = folder / "drop.yaml"
    path.write_text(path.read_text() + "initiation: {speed: 2.9}\n")
    done = regress(path, "--update", "--reason", "slower")
    assert done.exit_code == 0
    assert "ground/force_normal" in done.stdout
    found = baselines.read(folder / "baselines" / "drop.yaml")
    assert (found.reason, [f.reason for f in found.history]) == ("slower", ["first"])
    assert regress(path).exit_code == 0


def test_an_update_without_change_writes_nothing(folder: Path) -> None:
    before = kept(folder)
    done = regress(folder, "--update", "--reason", "no reason at all")
    assert done.exit_code == 0
    assert done.stdout.count("nothing new to write; ") == 2
    assert "No peak load of 2 scenarios has moved beyond its tolerance." in done.stdout
    assert kept(folder) == before


def test_results_of_another_selection_are_not_overwritten(folder: Path) -> None:
    drop = folder / "drop.yaml"
    assert regress(drop).exit_code == 0
    assert regress(drop).exit_code == 0
    done = regress(folder / "corner.yaml")
    assert done.exit_code == 2
    assert "out/regress: holds results of something else; --force replaces regress.json" in done.stderr


def test_names_that_make_no_sense(folder: Path) -> None:
    (folder / "empty").mkdir()
    done = regress(folder / "empty")
    assert (done.exit_code, "no scenario there" in done.stderr) == (2, True)
    done = regress("drop_tst")
    assert (done.exit_code, "did you mean 'drop_test'?" in done.stderr) == (2, True)
    shutil.copy(folder / "drop.yaml", folder / "empty" / "drop.yaml")
    done = regress(folder, folder / "empty" / "drop.yaml")
    assert (done.exit_code, "two scenarios of that name" in done.stderr) == (2, True)


def test_the_advised_command_works_as_printed(folder: Path) -> None:
    (folder / "my new.yaml").write_text((folder / "drop.yaml").read_text())
    first = regress(folder)
    assert first.exit_code == 1
    (advised,) = re.findall(r"`rollover (.*?--reason) TEXT` makes one", first.stdout)
    done = runner.invoke(app, [*shlex.split(advised), "a first one", "--workers", "0"])
    assert done.exit_code == 0, done.stderr
    assert "replaces the report of corner, drop, my new" in done.stderr
    assert "`rollover regress '../my new.yaml'`" in (folder / "baselines" / "my new.yaml").read_text()
    assert regress(folder).exit_code == 0


def test_what_is_no_scenario_is_left_out_of_a_folder_and_said(folder: Path) -> None:
    (folder / "tractor.yaml").write_text("kind: vehicle\nname: mine\n")
    (folder / "clay.yaml").write_text(SOIL.format(scale=1.0))
    (folder / "plan.yaml").write_text("format: rollover-study/1\ntitle: x\nscenario: drop.yaml\n")
    choice = regression.chosen([str(folder)])
    assert [f.stem for f in choice.files] == ["corner", "drop"]
    assert [f.stem for f in choice.left_out] == ["clay", "plan", "tractor"]
    (folder / "broken.yaml").write_text("title: [")
    assert "broken" in [f.stem for f in regression.chosen([str(folder)]).files], "its fault has to be told"
    for name in ("drop", "corner", "broken"):
        (folder / f"{name}.yaml").unlink()
    done = regress(folder)
    assert (done.exit_code, "no scenario there" in done.stderr) == (2, True)
