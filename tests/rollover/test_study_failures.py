"""Failed cases of a study not at random are said, and bound what is answered; grids give no probabilities."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import mannwhitneyu

from rollover import studies
from rollover.assessment import results
from rollover.cli.commands.study import sentences
from rollover.spec import document
from rollover.studies.case_store import Row
from rollover.studies.design import points
from rollover.studies.failures import along_axes, sentence
from rollover.studies.runner import Conducted
from rollover.studies.study import axis_unit
from rollover.studies.summary import answers
from tests.rollover.studies import drops
from tests.viz.html import Parts
from viz.pages.study import page

GRID = """\
title: A grid of slopes and speeds
scenario: bank_overturn.yaml
axes:
  - {kind: range, name: slope, paths: [ground.surface.angle_deg], low: 30.0, high: 60.0, count: 4}
  - {kind: range, name: speed, paths: [initiation.speed], low: 1.0, high: 3.0, count: 3}
plan: {kind: grid}
outputs: [{name: rops/force, limit: 15000.0}]
"""


def done(study: Any, failed: Any) -> Conducted:
    """Rows made up by hand: each load is 1000 times the case's place, `failed(values)` says which failed."""
    found = points(study)
    rows = []
    for k in range(found.count):
        out = bool(failed(found.row(k)))
        rows.append(
            Row(
                key=f"{k:040x}",
                status="failed" if out else "done",
                failure="error" if out else "",
                sentence="it broke off" if out else "",
                measures={} if out else {study.outputs[0].name: 1000.0 * k},
                domain_flags=(),
                peak_flags=(),
                provenance={},
            )
        )
    return Conducted(points=found, keys=[r.key for r in rows], rows=rows, ran=found.count)


def told(study: Any, conducted: Conducted) -> tuple[dict[str, Any], str]:
    head = {
        "title": study.title,
        "scenario_hash": document.content_hash(study.scenario),
        "versions": results.versions(),
    }
    report = {**head, **answers(study, conducted), "reliability": None, "worst": None, "ran": 0}
    plain: dict[str, Any] = results.plain(report)
    return plain, page(study, conducted, plain, command="rollover study x")


def grid(tmp_path: Path) -> Any:
    (tmp_path / "grid.yaml").write_text(GRID)
    return studies.load(tmp_path / "grid.yaml")


def test_failures_at_an_axis_end_bound_the_probability(tmp_path: Path) -> None:
    study = studies.load(drops(tmp_path, ("count: 20", "count: 24")))
    conducted = done(study, lambda values: values["speed"] > 2.5)
    report, html = told(study, conducted)
    rows = {row["axis"]: row for row in report["failures_along"]}
    speed = conducted.points.columns["speed"]
    failed = np.array([row.status == "failed" for row in conducted.rows])
    assert rows["speed"]["p"] == pytest.approx(2 * mannwhitneyu(speed[failed], speed[~failed]).pvalue)
    assert rows["speed"]["differs"]
    assert rows["speed"]["more"] == "high"
    assert not rows["soil"]["differs"]
    assert "not at random" in Parts(html).said
    assert "at high speed" in "\n".join(sentences(report))
    found = report["outputs"][0]["exceedance"]
    assert found["least"] == pytest.approx(found["hits"] / 24)
    assert found["most"] == pytest.approx((found["hits"] + failed.sum()) / 24)
    for share in (found["least"], found["most"]):
        assert f"{100.0 * share:.3g} %" in Parts(html).said


def test_clustered_failures_are_no_chance_scattered_ones_are() -> None:
    x = np.linspace(0.0, 1.0, 40)
    words = np.array(["clay", "sand"] * 20, dtype=object)
    ends = along_axes({"x": x}, np.abs(x - 0.5) > 0.4)
    assert (ends[0]["more"], ends[0]["differs"]) == ("ends", True)
    sand = along_axes({"x": x, "soil": words}, (words == "sand") & (x > 0.3))
    assert (sand[1]["more"], sand[1]["differs"], sand[1]["test"]) == ("sand", True, "Fisher's exact")
    scattered = np.random.default_rng(2)
    wrong = sum(bool(sentence(along_axes({"x": x, "soil": words}, scattered.random(40) < 0.3))) for _ in range(200))
    assert wrong < 20  # 5 % of 200 are 10; 20 or more have a chance of 0.3 %
    assert along_axes({"x": x}, np.zeros(40, dtype=bool)) == []


def test_a_grid_has_a_map_but_no_quantiles_or_probability(tmp_path: Path) -> None:
    study = grid(tmp_path)
    report, html = told(study, done(study, lambda values: values["slope"] > 55.0 and values["speed"] > 2.5))
    said = Parts(html).said + "\n".join(sentences(report))
    for word in ("quantile", "probability", "odds", "share of cases below"):
        assert word not in said.lower()
    assert report["outputs"][0]["quantiles"] == []
    assert report["outputs"][0]["exceedance"] is None
    assert "over both axes" in said
    for label in ("slope, deg", "speed, m/s"):
        assert label in html
    assert any(row[:1] == ["above 15 kN"] and row[1].endswith("1 failed") for row in Parts(html).rows)


@pytest.mark.parametrize(
    ("path", "apply", "unit"),
    [
        ("initiation.speed", "value", "m/s"),
        ("initiation.speed", "factor", "1"),
        ("vehicle.wheels.rear_left.tyre.vertical_stiffness", "value", "N/m"),
        ("vehicle.wheels.0.tyre.vertical_stiffness", "offset", "N/m"),
        ("ground.friction.coefficient", "factor", "1"),
    ],
)
def test_an_axis_has_the_unit_of_what_it_sets(tmp_path: Path, path: str, apply: str, unit: str) -> None:
    (tmp_path / "grid.yaml").write_text(GRID.replace("paths: [initiation.speed]", f"paths: [{path}], apply: {apply}"))
    study = studies.load(tmp_path / "grid.yaml")
    assert axis_unit(study.scenario, study.axes[1]) == unit
