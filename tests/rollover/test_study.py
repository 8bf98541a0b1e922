"""Studies: files and their faults, points of plans, cases, store, answers."""

from __future__ import annotations

import errno
import json
import math
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import binom, spearmanr
from typer.testing import CliRunner

from ground.soils import log_scatter
from rollover import studies
from rollover.assessment.loads import peak_loads
from rollover.cli.main import app
from rollover.dynamics import simulate
from rollover.dynamics.drop_test import DropModel
from rollover.recording import read_table
from rollover.scenario import load
from rollover.spec import document
from rollover.studies import case_store
from rollover.studies.axis import LogNormal, Normal, SoilScatter, Triangular
from rollover.studies.carry_out import prepared
from rollover.studies.case import work
from rollover.studies.design import points
from rollover.studies.runner import Builder, Conducted, Way, conduct
from rollover.studies.study import Output, Study
from rollover.studies.summary import clopper_pearson, exceedance, quantile
from rollover.system.errors import InputError
from tests.rollover.studies import drops

runner = CliRunner()
HERE = Way(workers=0)


def conducted(tmp_path: Path, *changes: tuple[str, str]) -> tuple[Study, Conducted]:
    study = studies.load(drops(tmp_path, *changes))
    return study, conduct(study, tmp_path / "out", HERE)


# ---------------------------------------------------------------- files and their faults


@pytest.mark.parametrize(
    ("change", "line", "message"),
    [
        (("initiation.speed]", "initiation.sped]"), 5, "no such path; did you mean"),
        (("low: 1.0, high: 3.5", "low: 3.0, high: 2.0"), 5, "axes.speed.high: not above low"),
        (("low: 1.0, high: 3.5", "low: -1.0, high: 3.5"), 5, "initiation.speed: out of bounds"),
        (("name: soil}", "name: speed}"), 6, "axes.1.name: taken, got 'speed'"),
        (("name: soil}", "name: soil, correlation: 1.0}"), 6, "axes.soil.correlation: out of bounds"),
        (("kind: soil-scatter", "kind: soil-scater"), 6, "did you mean 'soil-scatter'?"),
        (("count: 20", "cuont: 20"), 7, "did you mean 'count'?"),
        (("kind: lhs, count: 20, seed: 3", "kind: sobol-indices, count: 20"), 7, "plan.count: not a power of two"),
        (("ground/force_normal", "ground/force_normall"), 9, "no such measure"),
        (("simulator: drop", "simulator: dorp"), 3, "did you mean 'drop'?"),
        (("drop_test.yaml", "side_overturn.yaml"), 3, "'drop' drops a striker"),
        (("kind: lhs, count: 20, seed: 3", "kind: table, file: a.csv"), 5, "'column' goes with 'table'"),
    ],
)
def test_a_fault_names_its_line_and_cure(tmp_path: Path, change: tuple[str, str], line: int, message: str) -> None:
    path = drops(tmp_path, change)
    with pytest.raises(InputError) as refused:
        studies.load(path)
    said = str(refused.value).splitlines()[0]
    assert said.startswith(f"{path}:{line}: "), said
    assert message in str(refused.value)


def test_check_and_schema_know_studies(tmp_path: Path) -> None:
    assert runner.invoke(app, ["check", str(drops(tmp_path)), "bank_slope_speed"]).exit_code == 0
    broken = drops(tmp_path, ("initiation.speed]", "initiation.sped]"))
    assert runner.invoke(app, ["check", str(broken)]).exit_code == 2
    schema = json.loads(runner.invoke(app, ["schema", "study"]).stdout)
    import jsonschema  # type: ignore[import-untyped]

    text = document.read(drops(tmp_path)).plain
    jsonschema.validate(text, schema)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({**text, "plan": {"kind": "lhs"}}, schema)


def test_nothing_is_written_for_wrong_input(tmp_path: Path) -> None:
    broken = drops(tmp_path, ("initiation.speed]", "initiation.sped]"))
    done = runner.invoke(app, ["study", str(broken), "--out", str(tmp_path / "out")])
    assert done.exit_code == 2
    assert not (tmp_path / "out").exists()


# ---------------------------------------------------------------- axes


def test_soil_scatter_follows_from_the_multiple_correlation() -> None:
    R = 0.923
    axis = SoilScatter(name="soil")
    # R^2 = s^2/(s^2 + e^2): what the residual e is if the curves explain s
    s = log_scatter() * R / math.sqrt(1.0 - R**2)
    assert s**2 / (s**2 + axis.log_deviation**2) == pytest.approx(R**2, rel=1e-12)
    assert 0.25 < axis.log_deviation < 0.29
    drawn = np.log(axis.at((np.arange(20000) + 0.5) / 20000))
    assert float(drawn.std()) == pytest.approx(axis.log_deviation, rel=2e-3)
    tighter = SoilScatter(name="soil", correlation=0.99).log_deviation
    assert s**2 / (s**2 + tighter**2) == pytest.approx(0.99**2, rel=1e-12)


def test_distributions_against_their_moments() -> None:
    u = (np.arange(200_000) + 0.5) / 200_000
    triangle = Triangular(name="x", paths=("gravity",), low=0.13, mode=0.5, high=0.85)
    a, c, b = 0.13, 0.5, 0.85
    assert triangle.at(u).mean() == pytest.approx((a + b + c) / 3.0, rel=1e-6)
    assert triangle.at(u).var() == pytest.approx((a * a + b * b + c * c - a * b - a * c - b * c) / 18.0, rel=1e-5)
    normal = Normal(name="x", paths=("gravity",), mean=9.81, deviation=0.5, low=9.31)
    # of a normal cut off at one deviation below its mean: mu + sigma phi(1)/Phi(1)
    assert normal.at(u).min() >= 9.31
    assert normal.at(u).mean() == pytest.approx(9.81 + 0.5 * 0.2419707 / 0.8413447, rel=1e-5)
    log = LogNormal(name="x", paths=("gravity",), median=2.0, log_deviation=0.3)
    assert log.at(u).mean() == pytest.approx(2.0 * math.exp(0.045), rel=1e-4)


@pytest.mark.parametrize(("of", "asked"), [("normals", 0.55), ("ranks", 0.55)])
def test_a_correlation_is_kept_and_the_distributions_too(tmp_path: Path, of: str, asked: float) -> None:
    copula = f"correlation: {{axes: [soil, speed], matrix: [[1.0, {asked}], [{asked}, 1.0]], of: {of}}}\nplan"
    even = ("{kind: lhs, count: 20, seed: 3}", "{kind: sobol, count: 8192}")
    study = studies.load(drops(tmp_path, even, ("plan", copula)))
    found = points(study).columns
    ranks = spearmanr(found["speed"], found["soil"]).statistic
    wanted = asked if of == "ranks" else 6.0 / math.pi * math.asin(asked / 2.0)
    # a balanced sequence is far nearer than the 0.008 of 8192 draws; 2 sin(pi/6 0.55) differs from 0.55 by 0.018
    assert abs(ranks - wanted) < 0.004
    assert np.quantile(found["speed"], [0.1, 0.5, 0.9]) == pytest.approx([1.25, 2.25, 3.25], abs=0.05)


@pytest.mark.parametrize(
    ("matrix", "message"),
    [
        ("[[1.0, 0.5], [0.4, 1.0]]", "not symmetric"),
        ("[[1.0, 1.0], [1.0, 1.0]]", "no such correlations can be together"),
        ("[[1.0, 0.5]]", "not 2 x 2"),
    ],
)
def test_a_matrix_that_is_none(tmp_path: Path, matrix: str, message: str) -> None:
    path = drops(tmp_path, ("plan", f"correlation: {{axes: [soil, speed], matrix: {matrix}}}\nplan"))
    with pytest.raises(InputError, match=message):
        studies.load(path)


# ---------------------------------------------------------------- plans


def test_points_of_each_plan(tmp_path: Path) -> None:
    def found(plan: str) -> Any:
        return points(studies.load(drops(tmp_path, ("{kind: lhs, count: 20, seed: 3}", plan))))

    u = found("{kind: lhs, count: 20, seed: 3}").unit
    assert [sorted((column * 20).astype(int)) for column in u.T] == [list(range(20))] * 2
    assert found("{kind: grid, levels: 3}").count == 9
    u = found("{kind: sobol, count: 16}").unit
    assert np.bincount((u[:, 0] * 16).astype(int)).tolist() == [1] * 16
    assert found("{kind: sobol-indices, count: 8}").count == 8 * (2 + 2)
    u = found("{kind: morris, count: 5}").unit
    moved = np.abs(np.diff(u.reshape(5, 3, 2), axis=1)) > 1e-9
    assert (moved.sum(axis=2) == 1).all(), "one axis at a time"
    same = [found("{kind: random, count: 50, seed: 7}").columns["speed"] for _ in range(2)]
    assert (same[0] == same[1]).all()


def test_a_table_gives_its_rows_words_too(tmp_path: Path) -> None:
    (tmp_path / "points.csv").write_text(
        "note,law,speed\nx,soils/natural_clay_soft.yaml,2.5\ny,soils/natural_clay.yaml,3\n"
    )
    text = """\
title: Rows
scenario: drop_test.yaml
simulator: drop
axes:
  - {kind: column, name: law, paths: [ground.law]}
  - {kind: column, name: speed, paths: [initiation.speed]}
plan: {kind: table, file: points.csv}
outputs: [{name: ground/sinkage}]
"""
    path = tmp_path / "rows.yaml"
    path.write_text(text)
    study = studies.load(path)
    done = conduct(study, tmp_path / "out", HERE)
    soft = load("drop_test").replaced({"ground.law": "soils/natural_clay_soft.yaml", "initiation.speed": 2.5})
    sinkage = DropModel(scenario=soft).run()["ground/sinkage"].max()
    assert done.rows[0].measures["ground/sinkage"] == sinkage
    (tmp_path / "points.csv").write_text("law,sped\na,2.5\n")
    assert runner.invoke(app, ["check", str(path)]).exit_code == 2
    (tmp_path / "points.csv").write_text("law,speed\nsoils/natural_clay.yaml,\n")
    with pytest.raises(InputError, match="column speed"):
        points(studies.load(path))


# ---------------------------------------------------------------- cases and store


def test_a_case_is_the_run_of_its_scenario() -> None:
    text = drops_full()
    builder = Builder(text)
    values = {"speed": 2.0, "soil": 1.3}
    scenario = builder.scenario(values)
    slow = text.scenario.replaced({"initiation.speed": 2.0, "ground.law.stiffness_scale": 1.3}).of_many()
    assert document.content_hash(scenario) == document.content_hash(slow)
    result = work(builder.case(builder.key(values), values))
    run = simulate.run(slow)
    for peak in peak_loads(run):
        assert result.measures[peak.channel] == peak.filtered
        assert result.measures[f"{peak.channel}/raw"] == peak.raw
    assert result.measures["ground/sinkage"] == np.abs(run.recording["ground/sinkage"]).max()
    assert result.domain_flags == run.domain_flags


def drops_full() -> Study:
    base = load("drop_test").replaced({"simulation.step": 0.001, "simulation.output_step": 0.001})
    speed = {"kind": "uniform", "name": "speed", "paths": ("initiation.speed",), "low": 1.0, "high": 3.5}
    from rollover.studies.axis import Uniform
    from rollover.studies.plan import Lhs

    return Study(
        title="Drops",
        scenario=base,
        axes=(Uniform(**speed), SoilScatter(name="soil")),  # type: ignore[arg-type]
        plan=Lhs(count=4),
        outputs=(Output(name="ground/force_normal"),),
    )


def test_a_factor_scales_what_is_there(tmp_path: Path) -> None:
    twice = "kind: list, name: soil, paths: [ground.elements.spacing], values: [2.0], apply: factor"
    change = ("kind: soil-scatter, name: soil", twice)
    builder = Builder(studies.load(drops(tmp_path, change)))
    scenario = builder.scenario({"speed": 2.0, "soil": 2.0})
    assert scenario.ground.elements.spacing == (0.28, 0.09)


def test_a_changed_study_runs_only_what_is_new(tmp_path: Path) -> None:
    grid = ("{kind: lhs, count: 20, seed: 3}", "{kind: grid, levels: 2}")
    few = ("{kind: uniform, name: speed, paths: [initiation.speed], low: 1.0, high: 3.5}",
           "{kind: list, name: speed, paths: [initiation.speed], values: [1.0, 2.0]}")  # fmt: skip
    more = (few[0], few[1].replace("[1.0, 2.0]", "[2.0, 3.0, 1.0]"))
    assert conducted(tmp_path, grid, few)[1].ran == 4
    assert conducted(tmp_path, grid, few)[1].ran == 0
    study, done = conducted(tmp_path, grid, more)
    assert done.ran == 2
    table, about = read_table(tmp_path / "out" / case_store.TABLE)
    assert table["speed"] == [2.0, 2.0, 3.0, 3.0, 1.0, 1.0]
    assert table["ground/sinkage"] == [row.measures["ground/sinkage"] for row in done.rows]
    assert about["title"] == study.title
    told, _ = read_table(tmp_path / "out" / case_store.PROVENANCE)
    assert told["case"] == table["case"]
    assert all("exudyn" in v for v in told["versions"])


def test_an_invalid_point_is_a_row_and_failures_are_retried(tmp_path: Path) -> None:
    (tmp_path / "points.csv").write_text("speed\n2.0\n-1.0\n3.0\n")
    path = tmp_path / "rows.yaml"
    path.write_text(
        "title: Rows\nscenario: drop_test.yaml\nsimulator: drop\n"
        "axes: [{kind: column, name: speed, paths: [initiation.speed]}]\n"
        "plan: {kind: table, file: points.csv}\noutputs: [{name: ground/sinkage}]\n"
    )
    done = conduct(studies.load(path), tmp_path / "out", HERE)
    assert [row.status for row in done.rows] == ["done", "failed", "done"]
    assert "no such scenario" in done.rows[1].sentence
    assert "out of bounds" in done.rows[1].sentence
    assert conduct(studies.load(path), tmp_path / "out", HERE).ran == 0
    assert conduct(studies.load(path), tmp_path / "out", Way(workers=0, retry="failed")).ran == 1


def test_the_table_is_read_by_others(tmp_path: Path) -> None:
    _, done = conducted(tmp_path)
    path = tmp_path / "out" / case_store.TABLE
    sinkage = [row.measures["ground/sinkage"] for row in done.rows]
    read = {
        "pandas": lambda m: m.read_parquet(path)["ground/sinkage"].tolist(),
        "polars": lambda m: m.read_parquet(path)["ground/sinkage"].to_list(),
        "duckdb": lambda m: [r[0] for r in m.sql(f"select \"ground/sinkage\" from '{path}' order by point").fetchall()],
    }
    import importlib

    there = [name for name in read if importlib.util.find_spec(name)]
    if not there:
        pytest.skip("none of pandas, polars and duckdb is installed")
    for name in there:
        assert read[name](importlib.import_module(name)) == sinkage


def test_another_study_is_not_overwritten(tmp_path: Path) -> None:
    out = str(tmp_path / "out")
    path = drops(tmp_path, ("count: 20", "count: 2"))
    other = path.with_name("others.yaml")
    other.write_text(path.read_text())
    few = ["--workers", "0", "--out", out]
    assert runner.invoke(app, ["study", str(path), *few]).exit_code == 0
    refused = runner.invoke(app, ["study", str(other), *few])
    assert refused.exit_code == 2
    assert "holds another study, got 'drops'" in refused.stderr
    assert runner.invoke(app, ["study", str(other), *few, "--force"]).exit_code == 0
    (tmp_path / "out" / "mine.txt").write_text("a note")
    assert "got 'mine.txt'" in runner.invoke(app, ["study", str(other), *few, "--force"]).stderr


# ---------------------------------------------------------------- answers


def test_intervals_cover_as_they_say() -> None:
    random = np.random.default_rng(5)
    inside = dict.fromkeys((0.5, 0.9), 0)
    for _ in range(1000):
        drawn = random.random(60)
        for q in inside:
            found = quantile(drawn, q, 0.9)
            low = -math.inf if found["low"] is None else found["low"]
            high = math.inf if found["high"] is None else found["high"]
            inside[q] += low <= q < high
    for hits in inside.values():  # at least 90 %, and not so much more that it says nothing
        assert binom.cdf(hits, 1000, 0.9) > 1e-4
        assert hits < 975
    assert quantile(np.arange(10.0), 0.99, 0.95)["high"] is None


def test_clopper_pearson_by_its_definition() -> None:
    for hits, n in ((0, 20), (3, 20), (20, 20), (2, 1000)):
        low, high = clopper_pearson(hits, n, 0.95)
        if hits:
            assert binom.sf(hits - 1, n, low) == pytest.approx(0.025, rel=1e-9)
        else:
            assert low == 0.0
        if hits < n:
            assert binom.cdf(hits, n, high) == pytest.approx(0.025, rel=1e-9)
        else:
            assert high == 1.0


def test_failed_cases_may_lie_on_either_side() -> None:
    found = exceedance(np.array([1.0, 2.0, 3.0]), Output(name="rops/force", limit=2.5), 2, 0.95)
    assert found is not None
    assert (found["hits"], found["cases"]) == (1, 3)
    assert found["low_of_all"] == clopper_pearson(1, 5, 0.95)[0]
    assert found["high_of_all"] == clopper_pearson(3, 5, 0.95)[1]


def test_the_worst_case_repeats(tmp_path: Path) -> None:
    out = tmp_path / "out"
    path = drops(tmp_path, ("simulator: drop\n", ""), ("count: 20", "count: 3"))
    answer = runner.invoke(app, ["study", str(path), "--out", str(out), "--workers", "0", "--json"])
    assert answer.exit_code == 0, answer.stderr
    report = json.loads(answer.stdout)
    worst = report["worst"]
    table, _ = read_table(out / case_store.TABLE)
    peaks = table["ground/force_normal"]
    assert worst["point"] == int(np.argmax(peaks))
    again = runner.invoke(
        app, ["run", str(out / case_store.WORST), "--out", str(tmp_path / "again"), "--no-half-step", "--json"]
    )
    assert again.exit_code == 0, again.stderr
    told = json.loads(again.stdout)
    peak = next(p for p in told["peak_loads"] if p["channel"] == "ground/force_normal")
    assert peak["filtered"] == worst["value"] == max(peaks)
    assert told["scenario_hash"] == worst["scenario_hash"]


@pytest.mark.parametrize(("reason", "named"), [(errno.ENOSPC, True), (errno.EPIPE, False)])
def test_a_disk_that_refuses_a_write_is_named(reason: int, named: bool, tmp_path: Path) -> None:
    # what a library writes to an open file raises without a name; who has stopped reading is no disk
    def full(*_: object) -> None:
        raise OSError(reason, os.strerror(reason))

    ready = prepared(drops(tmp_path, ("count: 20", "count: 2")), tmp_path / "out")
    with pytest.raises(OSError, match=os.strerror(reason)) as fault:
        ready.carried_out(Way(workers=0), page=full)
    assert (fault.value.filename == str(tmp_path / "out")) is named
