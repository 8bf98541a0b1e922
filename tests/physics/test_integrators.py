"""Both integrators on every shipped scenario that the compiled one takes: the same motion, the same loads."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

from rollover import studies
from rollover.assessment import results
from rollover.assessment.ledger import closure
from rollover.dynamics import simulate
from rollover.dynamics.assembly import grown, tables_of
from rollover.dynamics.result import Run
from rollover.kernels.tables import BLOCK, Tables
from rollover.scenario import Scenario, load
from rollover.spec.document import content_hash, shipped_folder, to_mapping
from rollover.studies.case_store import Row
from rollover.studies.ensemble import extremes, perturbed_starts, spreads
from rollover.studies.runner import Way, conduct
from rollover.system.errors import InputError
from tests.rollover.studies import drops

# s: the first impact, the peak of the loads and what rocks after it
DURATIONS = {
    "ball_drop": 2.7,
    "bank_overturn": 3.0,
    "cone_drop": 0.01,
    "corkscrew_ramp": 1.5,
    "cornering_overturn": 3.0,
    "cube_toss": 0.4,
    "ditch": 2.0,
    "dolly_rollover": 0.5,
    "drop_test": 0.4,
    "field_upset_bent": 2.2,  # its posts bend at 2.01 s
    "field_upset_side": 1.5,
    "field_upset_tubes": 1.5,
    "forwarder_overturn": 1.0,
    "forward_pitch": 0.45,  # behind the first blow one of both halves a step sooner, and its rows lie elsewhere
    "kerb_trip": 0.6,
    "multiple_roll": 1.2,
    "penetrometer_drop": 0.3,
    "quad_rear_overturn": 0.8,
    "rear_overturn": 1.3,
    "rops_drop": 0.5,
    "shaken_platform": 1.0,
    "side_overturn": 1.0,
    "side_overturn_driver": 1.0,
    "side_overturn_slope": 1.0,
    "soil_trip": 1.0,
    "tractor_drop_corner": 0.5,
    "trailer_overturn": 1.0,
}
REFUSED = {"driven_pile", "pendulum", "static_rops_test", "tilt_table", "tilt_table_recorded", "vibrating_plate"}
EQUAL = 1e-6  # of the largest value of a channel, or of its vector, before the first impact
# m/s2: Exudyn finds a turn of x by arccos, to 4 eps/x, here 4e-12 rad for the 1e-4 rad by which a vehicle that stands
# leans; that on an arm of 1 m over beta h^2 is what the pivot's equations make of it at 1 ms
ACCELERATION = 1e-5
# on a platform that shakes Newton stops at 1e-5 of the first residual, and rounding decides after which iteration: so
# far accelerations, and what is carried with them, may differ, of their largest value; so with an occupant, of which
# the head of 6 kg hangs on springs of 2e5 N/m: 2.4e-6 in the first 0.12 s; so with a
# trailer on a hitch of 5e6 N/m, 1.6e-6 of the few mJ in a frame that nothing has touched
ITERATED = {"shaken_platform": 5e-5, "side_overturn_driver": 5e-5, "trailer_overturn": 5e-6}
TURN = 4e-12  # rad: the same of an angle
# rad/s: that turn of 4e-12 rad in a rate, times gamma/(beta h) = 2/h
RATE = 1e-8
FLOORS = {"/acceleration_": ACCELERATION, "/angular_velocity_": RATE, "/roll": TURN, "/pitch": TURN, "/yaw": TURN}
STARTS = 5
# An exudyn run is one more draw beside the compiled ensemble: |x - mean| < t s sqrt(1 + 1/n) but for one in 1000.
WITHIN = float(stats.t.ppf(1.0 - 0.0005, STARTS - 1)) * math.sqrt(1.0 + 1.0 / STARTS)
# what the scatter of a load that hardly scatters leaves to rounding
FLOOR = 1e-6


def largest(run: Run, channel: str) -> float:
    """Largest value of a channel, or of the vector that it is a component of."""
    parts = [channel[:-1] + axis for axis in "xyz"] if channel[-2:] in ("_x", "_y", "_z") else [channel]
    return max(1e-9, *(float(np.abs(run.recording[c]).max()) for c in parts if c in run.recording.channels))


def both(scenario: Scenario) -> tuple[Run, Run]:
    made = [simulate.run(scenario.replaced({"simulation.integrator": i})) for i in ("exudyn", "compiled")]
    return made[0], made[1]


def short(name: str, **changes: object) -> Scenario:
    return load(name).replaced({"simulation.duration": DURATIONS[name], **changes})


def test_every_shipped_scenario_is_run_through_both_or_refused() -> None:
    names = {path.stem for path in Path(shipped_folder()).glob("*.yaml")}
    assert names == set(DURATIONS) | REFUSED
    for name in REFUSED:
        with pytest.raises(InputError, match=r"simulation\.integrator: 'compiled' .*'exudyn' is allowed"):
            load(name).replaced({"simulation.integrator": "compiled"})


@pytest.mark.parametrize("name", sorted(DURATIONS))
def test_the_same_motion_and_the_same_loads(name: str) -> None:
    scenario = short(name)
    engine, loop = both(scenario)
    assert (engine.status, loop.status) == ("done", "done")
    assert np.array_equal(engine.recording.time, loop.recording.time)
    assert set(engine.recording.channels) == set(loop.recording.channels)
    # until a contact first begins or ends: there the smallest difference decides in which step it does
    first = min((e.time for e in engine.events), default=math.inf)
    before = engine.recording.time < first - 0.5 * scenario.simulation.step
    energy = max(engine.released, 1.0)
    for channel, values in engine.recording.channels.items():
        most = energy if channel.startswith("energy/") else largest(engine, channel)
        floor = next((v for part, v in FLOORS.items() if part in channel), 0.0)
        allowed = max(ITERATED.get(name, EQUAL) * most, floor)
        apart = float(np.abs(values - loop.recording[channel])[before].max(initial=0.0))
        assert apart <= allowed, channel
    assert [(e.kind, e.subject) for e in engine.events][:1] == [(e.kind, e.subject) for e in loop.events][:1]
    assert engine.domain_flags == loop.domain_flags
    assert closure(loop).largest <= max(1.5 * closure(engine).largest, 1e-4)
    ensemble = [extremes(simulate.run(s)) for s in perturbed_starts(loop.scenario, STARTS)]
    exudyn = {e.key: e.value for e in extremes(engine)}
    for spread in spreads(ensemble):
        allowed = WITHIN * spread.scatter * abs(spread.mean) + FLOOR * abs(spread.mean)
        assert abs(exudyn[spread.load, spread.filter] - spread.mean) <= allowed, spread


def test_events_and_rest_are_those_of_the_engine() -> None:
    engine, loop = both(short("drop_test", **{"simulation.duration": 1.5, "simulation.stop_at_rest": True}))
    assert [e.kind for e in loop.events] == ["first-touch", "branch-change", "unloading", "rest"]
    assert [(e.time, e.kind, e.subject, e.detail) for e in loop.events] == [
        (e.time, e.kind, e.subject, e.detail) for e in engine.events
    ]
    assert loop.stop_time == engine.stop_time < 1.5
    assert np.array_equal(loop.track.time, engine.track.time)
    assert loop.track.sinkage == pytest.approx(engine.track.sinkage, rel=1e-9)


def test_a_run_that_leaves_the_array_ends_with_the_same_words() -> None:
    away = {"ground.elements.length": 0.3, "ground.elements.centre": [0.0, 0.0]}
    engine, loop = both(short("cube_toss", **away))
    assert loop.status == engine.status == "failed"
    assert loop.sentence == engine.sentence
    assert loop.sentence.startswith("left the array of ground elements at t = ")
    assert loop.stop_time == engine.stop_time < DURATIONS["cube_toss"]


def test_a_run_that_breaks_off_keeps_what_it_had() -> None:
    # where nothing is a state any more, how it ends is chance: at which iteration, by which of two sentences
    engine, loop = both(short("rops_drop", **{"ground.law.stiffness_scale": 1e14}))
    assert loop.status == engine.status == "failed"
    assert "at t = 0.03" in loop.sentence
    assert loop.stop_time == pytest.approx(engine.stop_time, abs=2e-3)
    assert all(np.isfinite(v).all() for v in loop.recording.channels.values())


@pytest.mark.parametrize("integrator", ["exudyn", "compiled"])
def test_memory_that_grows_in_a_run_changes_nothing(integrator: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = short("penetrometer_drop", **{"simulation.integrator": integrator})
    wide = simulate.run(scenario)
    sizes: list[int] = []

    def tight(*given: Any) -> Tables:
        t = tables_of(*given)
        room = len(t.point_a) + 1  # none is left once an element is touched
        sizes.append(room)
        names = ("memory", "state", "s", "active", "trial", "found")
        return t._replace(**{name: getattr(t, name)[:room].copy() for name in names})

    def larger(t: Tables) -> Tables:
        sizes.append(len(t.memory))
        return grown(t)

    monkeypatch.setattr("rollover.dynamics.setup.tables_of", tight)
    monkeypatch.setattr("rollover.dynamics.recorder.grown", larger)
    own = simulate.run(scenario)
    assert len(sizes) == 2
    assert sizes[0] == sizes[1]
    assert all(np.array_equal(wide.recording[c], own.recording[c]) for c in wide.recording.channels)


@pytest.mark.parametrize(("name", "duration"), [("side_overturn", 1.3), ("cube_toss", 0.8), ("multiple_roll", 2.6)])
def test_boxes_leave_out_only_points_that_touch_nothing(
    name: str, duration: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    scenario = short(name, **{"simulation.duration": duration, "simulation.integrator": "compiled"})
    boxed = simulate.run(scenario)
    made: list[Tables] = []

    def boundless(*given: Any) -> Tables:
        t = tables_of(*given)
        made.append(t._replace(block_f=t.block_f.copy()))
        t.block_f[:, 3:] = 1e3  # no box is ever clear of the ground
        return t

    monkeypatch.setattr("rollover.dynamics.setup.tables_of", boundless)
    every = simulate.run(scenario)
    assert "first-touch" in [e.kind for e in boxed.events]
    assert all(np.array_equal(boxed.recording[c], every.recording[c]) for c in boxed.recording.channels)
    (t,) = made
    boxes = 0
    for _, first, end, _, box in t.member_i.tolist():
        for at in range(first, end, BLOCK):
            low, high = t.block_f[box, :3] - t.block_f[box, 3:], t.block_f[box, :3] + t.block_f[box, 3:]
            points = t.point_r[at : min(at + BLOCK, end)]
            assert (low < points).all()
            assert (points < high).all()
            box, boxes = box + 1, boxes + 1
    assert boxes == len(t.block_f)


def test_runs_in_threads_are_those_one_after_another() -> None:
    own = [short("drop_test", **{"initiation.speed": v, "simulation.integrator": "compiled"}) for v in (1.0, 2.0, 3.0)]
    own += [short("cube_toss", **{"simulation.integrator": "compiled"})]
    alone = [simulate.run(s).recording for s in own]
    with ThreadPoolExecutor(4) as pool:
        together = [run.recording for run in pool.map(simulate.run, own)]
    for one, other in zip(alone, together, strict=True):
        assert all(np.array_equal(one[channel], other[channel]) for channel in one.channels)


def test_a_file_that_asks_for_it_on_a_stand_is_told_the_line(tmp_path: Path) -> None:
    text = (Path(shipped_folder()) / "tilt_table.yaml").read_text(encoding="utf-8")
    folder = Path(shipped_folder())
    text = text.replace("simulation: {", "simulation: {integrator: compiled, ").replace(
        "vehicles/", f"{folder.as_posix()}/vehicles/"
    )
    file = tmp_path / "mine.yaml"
    file.write_text(text.replace("soils/", f"{folder.as_posix()}/soils/"), encoding="utf-8")
    line = next(k for k, row in enumerate(text.splitlines(), 1) if "integrator" in row)
    with pytest.raises(
        InputError, match=rf"mine\.yaml:{line}: simulation\.integrator: .* got initiation.kind 'tilt-table'"
    ):
        load(file)


def test_the_key_at_its_default_changes_no_hash() -> None:
    scenario = load("drop_test")
    mapping = to_mapping(scenario)
    assert (mapping["simulation"].pop("integrator"), mapping.pop("inputs")) == ("auto", [])
    assert mapping["ground"]["friction"].pop("bulldozing") is None
    assert to_mapping(scenario, hashed=True) == mapping
    compiled = scenario.replaced({"simulation.integrator": "compiled"})
    assert content_hash(compiled) != content_hash(scenario)
    assert content_hash(compiled.replaced({"simulation.integrator": "auto"})) == content_hash(scenario)


def test_results_say_which_integrator_made_them() -> None:
    engine, loop = both(short("drop_test", **{"simulation.duration": 0.02}))
    assert [results.json_of(run, [])["integrator"] for run in (engine, loop)] == ["exudyn", "compiled"]


def test_a_study_is_the_same_whatever_the_number_of_workers(tmp_path: Path) -> None:
    file = drops(
        tmp_path,
        ("scenario: drop_test.yaml", "scenario: {base: drop_test.yaml, simulation: {integrator: compiled}}"),
        ("simulator: drop", "simulator: full"),
        ("count: 20", "count: 4"),
    )
    study = studies.load(file)
    here = conduct(study, tmp_path / "here", Way(workers=0))
    apart = conduct(study, tmp_path / "apart", Way(workers=2))

    def told(row: Row) -> tuple[str, object]:
        return row.status, dict(row.measures)

    assert [told(row) for row in here.rows] == [told(row) for row in apart.rows]
    assert {row.status for row in here.rows} == {"done"}
