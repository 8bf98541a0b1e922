"""Where runs are many: which integrator makes them, what Exudyn says of some of them, and other values by `--set`."""

from __future__ import annotations

import json
import statistics
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from rollover import studies
from rollover.assessment.assessed import assessed
from rollover.assessment.bands import History, bands, history
from rollover.assessment.results import plain
from rollover.cli.main import app
from rollover.dynamics import simulate
from rollover.recording import read_table
from rollover.scenario import load
from rollover.spec.document import content_hash, shipped_folder
from rollover.studies import case_store, reference
from rollover.studies.carry_out import prepared
from rollover.studies.case import _simulated
from rollover.studies.case_store import Row
from rollover.studies.design import Points, points
from rollover.studies.ensemble import perturbed_starts, with_scatter
from rollover.studies.plan import Random
from rollover.studies.runner import START, Builder, Conducted, Way, conduct, evaluate
from rollover.system.errors import InputError
from tests.physics.test_integrators import STARTS, WITHIN
from tests.rollover.studies import drops, made_up

FULL = ("simulator: drop", "simulator: full")
FEW = ("count: 20", "count: 4")
BY_EXUDYN = ("scenario: drop_test.yaml", "scenario: {base: drop_test.yaml, simulation: {integrator: exudyn}}")


def carried_out(folder: Path, *changes: tuple[str, str], **values: Any) -> dict[str, Any]:
    """What study.json of a study of drops says."""
    ready = prepared(drops(folder, *changes), folder / "out", **values)
    ready.carried_out(Way(workers=0), page=lambda *_: "")
    found: dict[str, Any] = json.loads((folder / "out" / case_store.REPORT).read_text(encoding="utf-8"))
    return found


def rollover(*words: str) -> Any:
    return CliRunner().invoke(app, list(words))


def forces(folder: Path) -> np.ndarray[Any, Any]:
    table, _ = read_table(folder / "out" / case_store.TABLE)
    return np.array(table["ground/force_normal"], dtype=float)


@pytest.mark.parametrize("name", sorted(p.stem for p in Path(shipped_folder()).glob("*.yaml")))
def test_one_of_many_runs_is_compiled_where_it_can_be(name: str) -> None:
    scenario = load(name)
    start, driven = scenario.initiation.kind, scenario.excitation is not None
    expected = "exudyn" if driven or start in ("static-test", "pendulum-blow", "tilt-table") else "compiled"
    assert scenario.integrator == "exudyn"
    assert scenario.of_many().integrator == expected
    assert replace(scenario.of_many(), simulation=scenario.simulation) == scenario
    stated = scenario.replaced({"simulation.integrator": "exudyn"})
    assert stated.of_many() is stated


def test_a_study_is_compiled_and_exudyn_checks_a_hundredth(tmp_path: Path) -> None:
    told = carried_out(tmp_path, FULL, FEW)
    assert told["integrator"] == "compiled"
    check = told["reference_check"]
    assert (check["integrator"], check["cases"], check["ended_otherwise"]) == ("exudyn", 1, 0)
    # drops are smooth: both integrators make the same steps but for rounding
    assert 0.0 <= check["median"] <= check["largest"] < 1e-9
    assert [o["name"] for o in check["outputs"]] == ["ground/force_normal", "ground/sinkage"]
    provenance, _ = read_table(tmp_path / "out" / case_store.PROVENANCE)
    assert provenance["integrator"] == ["compiled"] * 4
    assert len(case_store.stored_keys(tmp_path / "out")) == 5
    # where nothing is lacking nothing is run, Exudyn's case neither
    assert carried_out(tmp_path, FULL, FEW)["reference_check"] == check
    assert len(case_store.stored_keys(tmp_path / "out")) == 5


def test_who_states_exudyn_has_it_and_the_same_answer(tmp_path: Path) -> None:
    (tmp_path / "loop").mkdir()
    (tmp_path / "engine").mkdir()
    carried_out(tmp_path / "loop", FULL, FEW)
    told = carried_out(tmp_path / "engine", FULL, FEW, BY_EXUDYN)
    assert (told["integrator"], told["reference_check"]) == ("exudyn", None)
    assert forces(tmp_path / "loop") == pytest.approx(forces(tmp_path / "engine"), rel=1e-9)
    assert not np.array_equal(forces(tmp_path / "loop"), forces(tmp_path / "engine")), "one of them ran both"


def test_a_drop_by_itself_is_of_neither(tmp_path: Path) -> None:
    told = carried_out(tmp_path, FEW)
    assert (told["integrator"], told["reference_check"]) == ("drop", None)


def test_an_axis_may_lead_from_one_to_the_other(tmp_path: Path) -> None:
    soil = "{kind: soil-scatter, name: soil}"
    which = "{kind: choice, name: which, paths: [simulation.integrator], values: [auto, exudyn]}"
    told = carried_out(tmp_path, FULL, FEW, (soil, which))
    assert told["integrator"] == "compiled, exudyn"
    provenance, _ = read_table(tmp_path / "out" / case_store.PROVENANCE)
    table, _ = read_table(tmp_path / "out" / case_store.TABLE)
    by = {"auto": "compiled", "exudyn": "exudyn"}
    assert provenance["integrator"] == [by[word] for word in table["which"]]
    (point,) = told["reference_check"]["points"]
    assert table["which"][point] == "auto"


def test_workers_change_no_bit_of_the_answer(tmp_path: Path) -> None:
    study = studies.load(drops(tmp_path, FULL, FEW))
    tables, checks = [], []
    for workers in (0, 2):
        folder, way = tmp_path / str(workers), Way(workers=workers)
        done = conduct(study, folder, way)
        tables.append((folder / case_store.TABLE).read_bytes())
        checks.append(reference.checked(study, folder, way, done, reference.chosen(study, done)))
    assert tables[0] == tables[1]
    assert checks[0] == checks[1]


def test_overturns_of_a_study_are_exudyn_s_within_their_scatter(tmp_path: Path) -> None:
    """Each response of each case: Exudyn's is one more draw beside the case and its neighbours, by Student's t."""
    coarse = {"ground.elements.spacing": [0.2, 0.2], "vehicle.contact_spacing": 0.1, "simulation.duration": 1.8}
    base = replace(studies.load("soil_side_overturn"), plan=Random(count=3, seed=1))
    study = replace(base, scenario=base.scenario.replaced(coarse))
    stated = replace(study, scenario=study.scenario.replaced({"simulation.integrator": "exudyn"}))
    loop, engine = (conduct(s, tmp_path / name, Way(workers=0)) for s, name in ((study, "loop"), (stated, "engine")))
    builder = Builder(study)
    for k, exudyn in enumerate(engine.rows):
        starts = perturbed_starts(builder.scenario(loop.points.row(k)), STARTS)
        runs = [_simulated(start, clearance=False)[0] for start in starts]
        assert runs[0] == loop.rows[k].measures
        for output in study.outputs:
            drawn = [run[output.name] for run in runs]
            allowed = WITHIN * statistics.stdev(drawn) + 1e-6 * abs(statistics.fmean(drawn))
            assert abs(exudyn.measures[output.name] - statistics.fmean(drawn)) <= allowed, (k, output.name)


def by_loop(done: Conducted) -> Conducted:
    rows = [replace(row, provenance={**row.provenance, "integrator": "compiled"}) for row in done.rows]
    return replace(done, rows=rows)


def test_the_study_s_seed_chooses_a_hundredth(tmp_path: Path) -> None:
    study, done = made_up(tmp_path, 300)
    assert reference.chosen(study, done) == []  # nobody knows who made them
    found = reference.chosen(study, by_loop(done))
    assert len(set(found)) == 3
    assert found == reference.chosen(study, by_loop(done))
    other = replace(study, plan=replace(study.plan, seed=4))
    assert reference.chosen(other, by_loop(done)) != found
    few = made_up(tmp_path, 40)
    assert len(reference.chosen(few[0], by_loop(few[1]))) == 1
    # points that mean one scenario are one case
    alike = replace(by_loop(done), keys=[done.keys[0]] * 300, rows=[by_loop(done).rows[0]] * 300)
    assert reference.chosen(study, alike) == [0]


def checked_with(
    again: list[dict[str, float] | None], beside: list[list[float]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> tuple[dict[str, Any], list[Any]]:
    """The check of three cases of which Exudyn has measures, or none, relative to the loop's; and what was asked for.

    `beside` is what the force of neighbouring starts is, relative to that of the case, for each case looked at.
    """
    study, made = made_up(tmp_path, 300)
    done = by_loop(made)
    at = reference.chosen(study, done)
    rows = [done.rows[k] for k in at]
    assert all(row.status == "done" for row in rows)
    asked: list[Any] = []

    def evaluated(builder: Builder, folder: Path, way: Way, found: Points, show: Any = None) -> list[Row]:
        asked.append((builder.integrator, found))
        if len(asked) == 1:
            return [
                replace(row, status="failed", measures={})
                if factors is None
                else replace(row, measures={n: factors.get(n, 1.0) * v for n, v in row.measures.items()})
                for row, factors in zip(rows, again, strict=True)
            ]
        of = [row for row, factors in zip(rows, again, strict=True) if factors]
        return [
            replace(row, measures={n: factor * v for n, v in row.measures.items()})
            for row, factors in zip(of, beside, strict=True)
            for factor in factors
        ]

    monkeypatch.setattr(reference, "evaluate", evaluated)
    check = reference.checked(study, tmp_path, Way(), done, at)
    assert check is not None
    assert check["points"] == at
    return check, asked


FORCE = "ground/force_normal"
SPREAD = [1.0, 0.9, 1.1, 0.95, 1.05]  # mean 1, standard deviation 0.0791: within is 0.745 of the mean


def test_the_check_counts_what_ended_otherwise(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    check, asked = checked_with([{FORCE: 0.8}, None, {}], [SPREAD], tmp_path, monkeypatch)
    assert (check["cases"], check["ended_otherwise"]) == (3, 1)
    force, sinkage = check["outputs"]
    assert (force["cases"], force["at_point"], sinkage["largest"]) == (2, check["points"][0], 0.0)
    assert force["largest"] == check["largest"] == pytest.approx(0.25)
    assert force["median"] == pytest.approx(0.125)
    where = f"ground/force_normal of point {check['points'][0]}"
    assert reference.sentence(check) == (
        "3 cases run again by Exudyn: responses differ by 0 % (median), 25 % at most; "
        f"the largest, {where}, scatters by 7.9 % between neighbouring starts; "
        "1 of them ended otherwise, done by the one and failed by the other"
    )
    # the loop's own starts, of the one case that is far off
    (_, first), (who, beside) = asked
    assert (first.count, who, beside.count) == (3, "", 5)
    assert beside.columns[START].tolist() == [0, 1, 2, 3, 4]
    assert set(beside.columns["speed"]) == {first.columns["speed"][0]}


@pytest.mark.parametrize(
    ("factor", "spread", "within", "said"),
    [
        (1.0 / (1.0 + 0.7), SPREAD, True, "scatters by 7.9 % between neighbouring starts"),
        # t(0.9995, 4) sqrt(6/5) = 9.43 standard deviations of 0.0791 are 0.746
        (1.0 - 0.744, SPREAD, True, "scatters by 7.9 % between neighbouring starts"),
        (1.0 - 0.748, SPREAD, False, "neighbouring starts; beyond what these scatter by: ground/force_normal of point"),
        (1.0 / 1.011, [1.0] * 5, False, "1.1 % at most; the largest, ground/force_normal of point"),  # from 1 % on
        (0.98, [1.0] * 5, False, "scatters by 0 % between neighbouring starts; beyond what these scatter by: ground/"),
        (0.98, [1.0, 1.0, 1.0, 1.0, float("nan")], None, "cannot be held against its neighbouring starts: 4 were done"),
        (0.98, [0.0] * 5, False, "is 0 in all neighbouring starts; beyond what these scatter by: ground/force_normal"),
    ],
)
def test_a_large_difference_stands_beside_the_runs_scatter(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, factor: float, spread: list[float], within: bool | None, said: str
) -> None:
    check, _ = checked_with([{}, {FORCE: factor}, {}], [spread], tmp_path, monkeypatch)
    beside = check["perturbed"]
    assert (beside["starts"], beside["cases"]) == (5, 1)
    (response,) = beside["responses"]
    assert (response["name"], response["point"], response["within"]) == (FORCE, check["points"][1], within)
    assert response["difference"] == check["largest"] == pytest.approx(abs(1.0 - factor) / factor)
    assert said in reference.sentence(check)
    json.dumps(plain(check), allow_nan=False)


def test_small_differences_ask_for_no_perturbed_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    check, asked = checked_with([{FORCE: 1.009}, {}, {}], [], tmp_path, monkeypatch)
    assert check["perturbed"] is None
    assert len(asked) == 1


def test_a_response_that_is_0_by_exudyn_differs_by_all_of_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    check, _ = checked_with([{}, {}, {FORCE: 0.0}], [SPREAD], tmp_path, monkeypatch)
    assert (check["outputs"][0]["cases"], check["largest"]) == (3, 1.0)
    assert check["perturbed"]["responses"][0]["within"] is False


def test_neighbouring_starts_of_a_point_are_cases_like_others(tmp_path: Path) -> None:
    """Kept like all others: the first is the case itself, the rest differ from it by gravity alone."""
    study = studies.load(drops(tmp_path, FULL, FEW))
    at = dict(points(study).row(2))
    builder = Builder(study)
    own = builder.scenario(at)
    starts = [builder.scenario({**at, START: float(k)}) for k in range(4)]
    assert starts == perturbed_starts(own, 4)
    assert [round(1e6 * (s.gravity / own.gravity - 1.0), 3) for s in starts] == [0.0, 1.0, -1.0, 2.0]
    keys = [builder.key({**at, START: float(k)}) for k in range(4)]
    assert keys[0] == builder.key(at)
    assert len(set(keys)) == 4


def test_the_slope_study_s_largest_difference_is_within_scatter(tmp_path: Path) -> None:
    """Point 130 of 256: two ten-thousandths of the energy by the one, three by the other; no load lies beyond."""
    study = studies.load("slope_side_overturn")
    every = points(study)
    found = Points(columns={name: column[130:131] for name, column in every.columns.items()})
    rows = evaluate(Builder(study), tmp_path, Way(workers=0), found)
    done = Conducted(points=found, keys=[Builder(study).key(found.row(0))], rows=rows, ran=1)
    check = reference.checked(study, tmp_path, Way(workers=0), done, reference.chosen(study, done))
    assert check is not None
    by_name = {output["name"]: output["largest"] for output in check["outputs"]}
    # a residual is what two sums of 1e4 J leave of each other: a tenth of it is nothing that a load would show
    assert max(value for name, value in by_name.items() if name != "ledger/residual") < 0.1
    beside = check["perturbed"]
    assert {one["name"] for one in beside["responses"]} == {n for n, v in by_name.items() if v > reference.LARGE}
    assert all(one["within"] for one in beside["responses"]), beside
    assert len(case_store.stored_keys(tmp_path)) == 2 + 4  # the case, Exudyn's, and four neighbours


def test_the_check_s_limit_is_student_s() -> None:
    assert pytest.approx(WITHIN, rel=1e-6) == reference.WITHIN
    assert reference.STARTS == STARTS


def test_perturbed_starts_of_a_run_are_many_and_the_run_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    made = []

    def seen(scenario: Any, **more: Any) -> Any:
        made.append(scenario.integrator)
        return simulate_run(scenario, **more)

    simulate_run = simulate.run
    monkeypatch.setattr(simulate, "run", seen)
    scenario = load("drop_test")
    found = with_scatter(assessed(scenario, half_step=False), 3, workers=0)
    peaks = found.peaks
    assert made == ["exudyn", "compiled", "compiled"]
    assert all(p.scatter is not None and p.scatter < 1e-5 for p in peaks)
    assert {p.starts_by for p in peaks} == {"compiled"}
    (band,) = found.bands
    assert (band.channel, band.starts, band.cfc) == ("ground/force_normal", 3, 60)
    assert band.mean.max() == pytest.approx(peaks[0].mean, rel=1e-5)
    assert 0.0 < band.deviation.max() < 1e-4 * band.mean.max()


def test_a_band_is_mean_and_deviation_at_each_instant() -> None:
    """Of loads F and 1.2 F the mean is 1.1 F and the standard deviation 0.2 F/sqrt(2); none once one has ended."""
    run = simulate.run(load("drop_test"))
    (force,) = history(run).loads.values()
    ended = run.recording.time.size - 50
    other = History(time=run.recording.time[:ended], loads={"ground/force_normal": 1.2 * force[:ended]})
    (band,) = bands(run, [other])
    np.testing.assert_allclose(band.mean[:ended], 1.1 * force[:ended], rtol=1e-12)
    np.testing.assert_allclose(band.deviation[:ended], 0.2 / np.sqrt(2.0) * force[:ended], rtol=1e-9)
    assert np.isnan(band.mean[ended:]).all()
    assert bands(run, []) == ()


# ---------------------------------------------------------------- --set


def test_set_gives_the_study_s_scenario_another_value_and_tells(tmp_path: Path) -> None:
    file = drops(tmp_path, ("{kind: soil-scatter, name: soil}", "{kind: soil-scatter, name: soil, correlation: 0.99}"))
    plain = rollover("study", str(file), "--workers", "0", "--out", str(tmp_path / "plain"))
    stiff = rollover(
        "study", str(file), "--set", "ground.law.stiffness_scale=4", "--workers", "0", "--out", str(tmp_path / "out")
    )
    assert (plain.exit_code, stiff.exit_code) == (0, 0), stiff.output
    assert "Set: ground.law.stiffness_scale=4" in stiff.stdout
    accounts: list[Mapping[str, Any]] = [
        json.loads((tmp_path / name / case_store.REPORT).read_text(encoding="utf-8")) for name in ("plain", "out")
    ]
    assert [a["set"] for a in accounts] == [[], ["ground.law.stiffness_scale=4"]]
    assert "ground.law.stiffness_scale" in accounts[1]["differs"]
    assert accounts[1]["outputs"][0]["mean"] > 1.1 * accounts[0]["outputs"][0]["mean"]
    written = studies.load(tmp_path / "out" / case_store.STUDY)
    assert written.scenario.ground.law.stiffness_scale == 4.0
    assert content_hash(written.scenario) == accounts[1]["scenario_hash"]
    page = (tmp_path / "out" / case_store.PAGE).read_text(encoding="utf-8")
    assert "--set ground.law.stiffness_scale=4" in page
    assert "Set for this study: ground.law.stiffness_scale=4." in page


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("initiation.speed=2", "--set: initiation.speed: set by the axis 'speed' in every case; another path"),
        ("ground.law.stifness_scale=2", "--set: ground.law.stifness_scale: "),
        ("gravity=-1", "--set: gravity: "),
        ("simulation.integrator=fast", "--set: simulation.integrator: "),
        # the scenario alone would do
        ("vehicle=vehicles/utility_tractor.yaml", "--set: simulator: 'drop' drops a striker, got another vehicle"),
    ],
)
def test_set_of_what_cannot_be_is_refused(tmp_path: Path, given: str, message: str) -> None:
    file = drops(tmp_path)
    done = rollover("study", str(file), "--set", given, "--workers", "0", "--out", str(tmp_path / "out"))
    assert done.exit_code == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "out").exists()


def test_set_below_what_an_axis_exchanges_is_lost_and_refused(tmp_path: Path) -> None:
    soils = ("{kind: soil-scatter, name: soil}",
             "{kind: choice, name: law, paths: [ground.law], values: [soils/natural_clay.yaml]}")  # fmt: skip
    with pytest.raises(InputError, match=r"--set: ground\.law\.stiffness_scale: set by the axis 'law'"):
        prepared(drops(tmp_path, soils), tmp_path / "out", changes={"ground.law.stiffness_scale": 2.0})
