"""What is told of the energy ledger: in the terminal, run.json, the page, the recording, a study and a regression."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from rollover.assessment import ledger, results
from rollover.assessment.ledger import closure
from rollover.cli import console
from rollover.cli.commands.study import sentences
from rollover.cli.main import app
from rollover.dynamics import simulate
from rollover.dynamics.result import Run
from rollover.recording import Recording
from rollover.scenario import load
from rollover.spec.vehicle import Vehicle
from rollover.studies.summary import answers
from tests.rollover.studies import made_up
from tests.viz.example import overturn
from viz.content.verdict import verdict
from viz.pages import report
from viz.pages.study import page as study_page

runner = CliRunner()


@pytest.fixture(scope="module")
def example() -> Run:
    return overturn()


def widened(run: Run, most: float) -> Run:
    """The run with a residual whose largest magnitude is a share of the energy released, and less at the end."""
    channels = dict(run.recording.channels)
    residual = 0.0 * channels["energy/residual"]
    residual[residual.size // 2], residual[-1] = -most * run.released, 0.1 * most * run.released
    found = replace(run.recording, channels={**channels, "energy/residual": residual})
    assert isinstance(found, Recording)
    return replace(run, recording=found)


def told(run: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> tuple[dict[str, float], str, str, str]:
    answer = results.write(tmp_path / "out", run, [], force=True)
    console.report(run, [], [], answer, "out", headline="It fell.")
    pages = report.page(run, [], answer, rows=[], command="rollover run")
    return answer["ledger"], capsys.readouterr().out, pages, verdict(run, [])


def test_the_largest_counts_not_the_last(example: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = widened(example, 0.02)
    numbers, terminal, page, recording = told(run, tmp_path, capsys)
    assert numbers["largest_residual"] == pytest.approx(0.02)
    assert numbers["residual_at_end"] == pytest.approx(0.002)
    assert numbers["at"] == run.recording.time[run.recording.time.size // 2]
    step = f"{run.scenario.simulation.step:g}"
    for text in (terminal, page, recording):
        assert "nergy ledger does not close: 2 % of the energy released" in text
        assert f"a smaller simulation.step than {step} s is needed" in text
    assert 'class="warning"' in page or "warning" in page.split("nergy ledger does not close")[0][-200:]


def test_one_that_closes_is_told_without_a_warning(
    example: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    numbers, terminal, page, recording = told(widened(example, 0.004), tmp_path, capsys)
    assert numbers["largest_residual"] == pytest.approx(0.004)
    for text in (terminal, page, recording):
        assert "at most 0.4 % of the energy released is unaccounted for" in text
        assert "does not close" not in text


def test_without_energy_there_is_no_share(example: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    numbers, terminal, _, _ = told(replace(example, released=0.0), tmp_path, capsys)
    assert numbers["largest_residual"] is None
    assert "nergy ledger" not in terminal


@pytest.mark.parametrize(
    ("left", "released", "most"),
    [
        (0.9, 1e-3, math.nan),  # 90,000 % of next to nothing, within what the start leaves open
        (0.9, 199.0, math.nan),  # 0.5 % of what was released is not resolved either
        (0.9, 201.0, 0.9 / 201.0),
        (1.1, 1e-3, 1100.0),  # more than numbers can do: made of nothing
    ],
)
def test_a_share_of_next_to_nothing_is_none(
    left: float, released: float, most: float, example: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    vehicle = example.scenario.vehicle
    assert isinstance(vehicle, Vehicle)
    weight = vehicle.whole.mass * example.scenario.gravity
    way = weight / sum(w.tyre.vertical_stiffness for w in vehicle.wheels)  # that the tyres are pressed in
    least = 1e-7 * weight * way  # J: what a balance of 1e-7 leaves open; rounding is a thousandth of that here
    run = widened(replace(example, released=released * least), left / released)
    run = replace(run, ledger={**run.ledger, "residual": float(run.recording["energy/residual"][-1])})
    numbers, terminal, page, recording = told(run, tmp_path, capsys)
    assert numbers["largest_residual"] == (None if math.isnan(most) else pytest.approx(most))
    for text in (terminal, page, recording):
        assert ("does not close" in text) is (most > 0.005)
    for text in (page, recording):
        assert (" released" in text) is math.isfinite(most)


def test_a_stand_that_has_not_moved_yet_has_no_share() -> None:
    done = simulate.run(load("static_rops_test").replaced({"simulation.duration": 0.1}))
    assert 0.0 < done.released < 1e-6
    assert np.abs(done.recording["energy/residual"]).max() > done.released
    assert not closure(done).is_wide
    assert not closure(done).sentence


def test_a_failed_run_is_judged_as_far_as_it_came(example: Run) -> None:
    run = widened(example, 0.02)
    residual = run.recording.channels["energy/residual"].copy()
    residual[-1] = math.nan
    broken = replace(
        run, recording=replace(run.recording, channels={**run.recording.channels, "energy/residual": residual})
    )
    assert closure(broken).largest == pytest.approx(0.02)


def test_a_study_has_a_column_and_a_warning(tmp_path: Path) -> None:
    study, done = made_up(tmp_path, 40)
    rows = [
        row if row.status == "failed" else replace(row, measures={**row.measures, "ledger/residual": 1e-4 * k})
        for k, row in enumerate(done.rows)
    ]
    rows[12] = replace(rows[12], measures={**rows[12].measures, "ledger/residual": 0.031})
    done = replace(done, rows=rows)
    head = {"title": "made up", "name": "x", "scenario_hash": "", "versions": {}, "reliability": None, "worst": None}
    report = {**head, **answers(study, done), "ran": 40}
    assert report["ledger"] == {"largest_residual": 0.031, "at_point": 12, "limit": 0.005, "open": 1}
    page = study_page(study, done, report, command="rollover study x")
    assert "ledger open by, %" in page
    said = "energy ledger does not close in 1 cases: up to 3.1 % of the energy released"
    assert said in page
    assert any(said in line for line in sentences(report))


def test_a_regression_notes_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "scenarios"
    folder.mkdir()
    (folder / "drop.yaml").write_text("base: drop_test.yaml\nsimulation: {duration: 0.25}\n")
    monkeypatch.chdir(tmp_path)

    def regress(*more: str) -> dict[str, object]:
        done = runner.invoke(app, ["regress", str(folder), "--workers", "0", "--json", "--force", *more])
        assert done.exit_code == 0, done.stdout + done.stderr
        found: dict[str, object] = json.loads(done.stdout)["answers"][0]
        return found

    regress("--update", "--reason", "first")
    plain = regress()
    assert 0.0 < plain["largest_residual"] < 1e-3  # type: ignore[operator]
    assert not plain["notes"]
    monkeypatch.setattr(ledger, "LIMIT", 1e-9)
    assert "the energy ledger does not close" in regress()["notes"][0]  # type: ignore[index]
