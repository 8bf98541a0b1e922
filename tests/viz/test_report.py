"""Report pages: nothing is fetched, the numbers are those of run.json, the verdict says what it rests on."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from rollover.assessment.bands import Band
from rollover.assessment.clearance import approaches
from rollover.assessment.criteria import Criterion
from rollover.assessment.loads import PeakLoad, peak_loads
from rollover.cli.main import app
from rollover.dynamics.result import Run
from rollover.spec.channels import CHANNELS
from rollover.spec.standards.requirement import Requirement
from rollover.studies.baseline import Answer, Difference
from tests.viz import example
from tests.viz.html import Parts
from viz.content import blocks
from viz.content.blocks import Cell, Details, Footer, Headline, Note, Pairs, Table
from viz.content.entities import series
from viz.pages import page as pages
from viz.pages import regression, report
from viz.recordings import blueprint

ANSWER: dict[str, Any] = {
    "scenario_hash": "abc123",
    "versions": {"rollover": "0.1.0", "exudyn": "1.13"},
    "files": ["run.json"],
    "half_step": None,
}
ASKED = Requirement(
    standard="OECD Code 4 / ISO 5700",
    name="side load",
    formula="1.75 M",
    clause="3.2",
    quantity="energy",
    unit="J",
    value=5250.0,
    bound="least",
    source="the code",
    confidence="recalled, high confidence",
)
SIDE = Criterion(requirement=ASKED, simulated=4200.0, margin=-0.2, verdict="compared", note="a measure")
ZONE = replace(
    SIDE,
    requirement=replace(ASKED, name="distance of the structure", quantity="distance", unit="m", value=0.0),
    simulated=-0.012,
    margin=-0.012,
    verdict="not met",
)


@pytest.fixture(scope="module")
def peaks(overturn: Run) -> tuple[PeakLoad, ...]:
    return peak_loads(overturn)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A real run, two starts, through the command."""
    folder = tmp_path_factory.mktemp("run")
    (folder / "drop.yaml").write_text("base: drop_test.yaml\nsimulation: {duration: 0.25}\n")
    arguments = ["run", str(folder / "drop.yaml"), "--set", "title=A <drop>", "--out", str(folder / "out")]
    done = CliRunner().invoke(app, [*arguments, "--ensemble", "2"])
    assert done.exit_code == 0, done.output
    assert "scatter" in done.stdout
    return folder / "out"


def test_a_run_writes_a_page_that_opens_without_a_network(folder: Path) -> None:
    found = json.loads((folder / "run.json").read_text())
    text = (folder / "report.html").read_text()
    parts = Parts(text)
    assert parts.fetched() == []
    assert "report.html" in found["files"]
    assert {*found["files"]} == {p.name for p in folder.iterdir()}
    assert found["scenario_hash"] in parts.said
    assert f"exudyn {found['versions']['exudyn']}" in parts.said
    assert "drop.yaml --set 'title=A <drop>'" in parts.said
    assert "A <drop>" in parts.said
    assert "<drop>" not in text
    assert pages.NOT_APPROVAL in parts.said
    assert sum(tag == "svg" for tag, _ in parts.tags) >= 3


def test_the_pages_numbers_are_those_of_run_json(folder: Path) -> None:
    found = json.loads((folder / "run.json").read_text())
    rows = Parts((folder / "report.html").read_text()).rows
    [peak] = found["peak_loads"]
    [row] = [r for r in rows if r[0] == "Ground force"]
    heading = rows[rows.index(row) - 1]
    shown = dict(zip(heading, row, strict=True))
    assert shown["raw"] == f"{peak['raw'] / 1e3:.4g}"
    assert shown["CFC 60"] == f"{peak['filtered'] / 1e3:.4g}"
    assert row[3] == f"{peak['raw_time']:.3f}"
    assert shown["impulse, N\N{NO-BREAK SPACE}s"] == f"{peak['impulse']:.4g}"
    assert shown["change at half step"] == f"{100 * peak['half_step_change']:.2g} %"
    assert (peak["starts"], shown["mean of 2"]) == (2, f"{peak['mean'] / 1e3:.4g}")
    assert shown["scatter"] == f"{100 * peak['scatter']:.2g} %"
    assert 0.0 < peak["scatter"] < 1e-6
    assert shown["calibrated domain"] == (", ".join(peak["domain_flags"]) or "inside")


def test_the_page_of_an_overturn(overturn: Run, peaks: tuple[PeakLoad, ...]) -> None:
    parts = Parts(report.page(overturn, peaks, ANSWER, rows=[SIDE, ZONE]))
    assert parts.fetched() == []
    ids = [a["id"] for _, a in parts.tags if "id" in a]
    assert len(ids) == len(set(ids))
    for peak in peaks:
        if peak.raw:
            assert any(f"{peak.raw / 1e3:.4g}" in row for row in parts.rows), peak.channel
    side = next(row for row in parts.rows if row[0] == "OECD Code 4 / ISO 5700: side load")
    assert side[1:6] == ["at least 5.25 kJ", "4.2 kJ", "0.80 x", "compared", "3.2"]
    assert side[6] == "1.75 M; the code; recalled, high confidence"
    zone = next(row for row in parts.rows if row[0].endswith("distance of the structure"))
    assert zone[2:5] == ["-12 mm", "-12 mm", "not met"]
    for flag in overturn.domain_flags:
        assert any(row[0] == flag for row in parts.rows)
    residual = f"{abs(overturn.ledger['residual']) / overturn.released * 100:.2g} % of the "
    assert residual in parts.said
    assert "OECD Code 4 / ISO 5700: side load" in " ".join(parts.words)
    assert "clearance zone" in parts.said
    assert "neighbouring starts" not in parts.said
    time, force = overturn.recording.time, overturn.recording["rops/force"]
    band = Band(channel="rops/force", cfc=60, starts=3, time=time, mean=force, deviation=0.1 * force)
    parts = Parts(report.page(overturn, peaks, ANSWER, bands=[band]))
    assert "Band: standard deviation over 3 neighbouring starts." in parts.said
    assert "mean of 3" in " ".join(parts.words)


def test_the_same_run_gives_the_same_page(overturn: Run, peaks: tuple[PeakLoad, ...]) -> None:
    assert report.page(overturn, peaks, ANSWER) == report.page(overturn, peaks, ANSWER)


def test_the_verdict_says_what_it_rests_on(overturn: Run, peaks: tuple[PeakLoad, ...]) -> None:
    def head(rows: Any = (), **changes: Any) -> Headline:
        return report.headline(overturn, [replace(p, **changes) for p in peaks], rows)

    rops = next(p for p in peaks if p.channel == "rops/force")
    inside = head(domain_flags=(), half_step_change=0.004)
    assert inside.sentence.startswith(f"ROPS force: at most {rops.raw / 1e3:.1f} kN at {rops.raw_time:.3f} s (raw)")
    assert inside.detail == "Inside the calibrated domain; converged: half the step changes it by 0.4 %."
    assert inside.state == "pass"
    coarse = head(domain_flags=(), half_step_change=0.2)
    assert ("not converged: half the step changes it by 20 %" in coarse.detail, coarse.state) == (True, "warn")
    outside = head(domain_flags=("momentum",), half_step_change=None)
    assert (outside.state, "convergence was not examined" in outside.detail) == ("warn", True)
    assert "5 neighbouring starts scatter by 1.5 %" in head(starts=5, mean=1.0, scatter=0.015).detail
    missed = head([ZONE], domain_flags=())
    assert (missed.state, "not met: distance of the structure" in missed.detail) == ("fail", True)


def test_trajectory_then_loads_then_standards(overturn: Run, peaks: tuple[PeakLoad, ...]) -> None:
    text = report.page(overturn, peaks, ANSWER, rows=[SIDE, ZONE])
    order = re.findall(r"<h2>(.*?)</h2>", text)
    assert order[:4] == ["How it went", "Peak loads", "Calibrated domain", "Against standards"]
    strip = text[text.index("<h2>How it went") : text.index("<h2>Peak loads")]
    overlays = re.search(r"At ([\d., ]+) s: hull", strip)
    assert overlays is not None
    stamps = [float(x) for x in overlays[1].split(", ")]
    assert (stamps[0], stamps[-1]) == pytest.approx((overturn.frame_time[0], overturn.frame_time[-1]), abs=0.006)
    assert stamps == sorted(stamps)
    assert "How it went" not in report.page(example.drop(), (), ANSWER), "a striker goes straight down"


def test_a_test_stand_answers_whether_all_is_met(overturn: Run, peaks: tuple[PeakLoad, ...]) -> None:
    tested = replace(overturn, tests=({"kind": "tilt", "name": "x"},))
    near = min(a.least for a in approaches(overturn))
    met, missed = replace(SIDE, verdict="met", margin=0.1), replace(SIDE, verdict="not met")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(report, "findings", lambda _: None)
        good = report.headline(tested, peaks, [met, met, SIDE])
        bad = report.headline(tested, peaks, [met, missed])
        untold = report.headline(tested, peaks, [replace(SIDE, verdict="no verdict")])
    assert good.sentence.startswith(f"All 2 requirements are met; least clearance {1e3 * near:.0f} mm, to the ")
    assert "ROPS force: at most" in good.detail
    assert (bad.sentence[:28], bad.state) == ("1 of 2 requirements are met;", "fail")
    assert untold.sentence.startswith("ROPS force: at most")
    assert report.headline(overturn, peaks, [met]).sentence.startswith("ROPS force: at most"), "an overturn is no test"


def test_a_failed_run_has_a_page_without_peaks() -> None:
    run = example.overturn(failed=True)
    parts = Parts(report.page(run, (), ANSWER))
    assert f"The run failed at {run.stop_time:.3f} s" in parts.said
    assert run.sentence in parts.said
    assert "Peak loads" not in parts.said


def test_the_page_of_a_drop(drop: Run) -> None:
    parts = Parts(report.page(drop, peak_loads(drop), ANSWER))
    assert "Force of the ground over sinkage" in parts.said


def test_a_half_step_that_failed_is_a_warning(overturn: Run, peaks: tuple[PeakLoad, ...]) -> None:
    answer = {**ANSWER, "half_step": {"status": "failed", "sentence": "diverged at t = 1 s"}}
    assert "At half the step the run failed: diverged at t = 1 s" in Parts(report.page(overturn, peaks, answer)).said


def test_the_page_of_a_regression() -> None:
    load = Difference(
        load="rops/force", filter="CFC 60", unit="N", was=18000.0, now=19000.0, time_was=2.0, time_now=2.1,
        change=1 / 18, tolerance=0.02, same=False,
    )  # fmt: skip
    fine = replace(load, load="ground/sinkage", filter="raw", unit="m", was=0.2, now=0.2, change=0.0, same=True)
    changed = Answer(
        scenario="tip", verdict="changed", sentence="1 of 2 changed", differences=(load, fine), notes=("n!",)
    )
    good = Answer(scenario="drop", verdict="same", sentence="as they were")
    parts = Parts(regression.page([changed, good], command="rollover regress"))
    assert parts.fetched() == []
    assert "1 of 2 scenarios are not as they were: tip." in parts.said
    row = ["rops/force", "CFC 60", "kN", "18", "19", "+5.56 %", "2 %", "2.100", "2.000", "changed"]
    assert ["tip", *row] in parts.rows
    assert row in parts.rows
    assert "tip: n!" in parts.said
    assert "No peak load has moved beyond its tolerance." in Parts(regression.page([good], command="x")).said


def test_text_is_text_and_a_row_fits_its_headings() -> None:
    blocks = [
        Note(text="a < b & c", warning=True),
        Pairs(rows=[("k<", "<i>v</i>")]),
        Details(summary="<more>", blocks=[Table(columns=["<h>", "n"], rows=[["<x>", Cell("1", "pass")]], numeric=[1])]),
    ]
    text = pages.render(title="<t>", headline=Headline(sentence="<s>"), blocks=blocks, footer=Footer(command="<c>"))
    parts = Parts(text)
    for word in ("a < b & c", "k<", "<i>v</i>", "<more>", "<t>", "<s>", "<c>"):
        assert word in parts.said
    assert ["<x>", "1"] in parts.rows
    assert ("td", {"class": "number pass"}) in parts.tags
    assert ("details", {}) in parts.tags
    with pytest.raises(ValueError, match="got 1 cells in a row; 2, one for each column"):
        Table(columns=["a", "b"], rows=[["x"]])


def test_pages_print_and_know_the_dark() -> None:
    text = pages.render(title="t", headline=Headline(sentence="s"), blocks=[], footer=Footer(command="c"), study=False)
    assert "@media print" in text
    assert "prefers-color-scheme: dark" in text
    assert pages.NOT_APPROVAL not in text


def figures(run: Run) -> dict[str, str]:
    """Caption and text of each figure over time."""
    section = report._histories(run, peak_loads(run))[0]
    assert isinstance(section, blocks.Section)
    return {b.caption: b.svg for b in section.blocks if isinstance(b, blocks.Figure)}


def test_one_axis_has_one_quantity(overturn: Run) -> None:
    """Spin beside a wheel's load has an axis of its own."""
    n = overturn.recording.time.size
    swing = np.sin(np.linspace(0.0, 9.0, n))
    turned = {f"wheel/{w}/spin": 20.0 + swing for w in ("rear_left", "rear_right")}
    turned |= {f"rops/mount/left/force_{k}": 1e3 * swing for k in "xyz"}
    recording = replace(overturn.recording, channels={**overturn.recording.channels, **turned})
    found = figures(replace(overturn, recording=recording))
    labels = {"Wheel spin": "wheel spin, deg/s", "Wheel loads": "wheel loads, kN", "Mount forces": "mount forces, kN"}
    for begins, label in labels.items():
        svg = next(svg for caption, svg in found.items() if caption.startswith(begins))
        assert label in svg
    loads = next(svg for caption, svg in found.items() if caption.startswith("Wheel loads"))
    assert "spin" not in loads


def test_a_plot_of_the_viewer_with_several_units_becomes_several() -> None:
    names = ["wheel/rear_left/force_normal", "wheel/rear_left/spin", "wheel/rear_right/spin"]
    assert blueprint.matching(names, (("Wheels, kN", ("wheel/*",)),)) == [
        ("Wheels, kN", names[:1]),
        ("Wheels, deg/s", names[1:]),
    ]
    for title, fitting in blueprint.matching([*CHANNELS], (*blueprint.TOP, *blueprint.LOADS, *blueprint.MOTION)):
        assert {series(c).unit for c in fitting} == {title.rpartition(", ")[2]}
