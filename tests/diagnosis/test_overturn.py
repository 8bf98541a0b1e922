"""Full runs under a diagnosis: what is run, what is only read off, instruments, and runs that come to nothing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from rollover.comparison.instruments import at_sensor
from rollover.diagnosis.data.dataset import dataset_of
from rollover.diagnosis.data.phases import phases_of as phases
from rollover.diagnosis.fit import cache
from rollover.diagnosis.fit.ensemble_mean import ensemble_mean_misfit, with_ensemble_scatter
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.forward import full_run
from rollover.diagnosis.forward.forward_model import DropSimulator, simulator_of
from rollover.diagnosis.forward.full_run import RunSimulator, run_phases
from rollover.diagnosis.settings import SETTINGS
from rollover.dynamics import simulate
from rollover.recording import Clock, Recording, Sensor
from rollover.recording.filters import filtered
from rollover.scenario import Scenario
from rollover.system.processes import Children
from tests.physics.scenes import shipped

ROLL, Z = "chassis/angular_velocity_x", "chassis/position_z"
UP = "sensor/corner/acceleration_z"
FRICTION = "effects.ground-friction.coefficient"


def toss() -> Scenario:
    return shipped("cube_toss")


def recording(*channels: str, until: float = 0.3, start: float = 0.0, **more: Any) -> Recording:
    time = np.arange(start, until, 0.0071)
    return Recording(title="toss", time=time, channels={c: np.zeros(time.size) for c in channels}, **more)


def run(changes: Mapping[str, Any] | None = None) -> Recording:
    own = toss().replaced({"simulation.duration": 0.5, **(changes or {})})
    return simulate.run(own.of_many()).recording


def test_a_prediction_is_the_run_at_the_stamps_less_the_shift() -> None:
    made = recording(ROLL, Z)
    simulator = simulator_of(toss(), made)
    assert isinstance(simulator, RunSimulator)
    found = simulator.predict({FRICTION: 0.4}, 0.003)
    expected = run({FRICTION: 0.4})
    assert found is not None
    for name in (ROLL, Z):
        np.testing.assert_array_equal(found[name], np.interp(made.time - 0.003, expected.time, expected[name]))
    plain = simulator.predict({}, 0.003)
    assert plain is not None
    assert np.ptp(found[ROLL] - plain[ROLL]) > 0.1


def test_the_run_is_no_longer_than_the_recording_needs() -> None:
    simulator = RunSimulator(toss(), recording(Z, until=0.3))
    last = float(recording(Z, until=0.3).time[-1])
    assert last + 0.005 < simulator.scenario.simulation.duration < last + 0.02
    loose = RunSimulator(toss(), recording(Z, until=0.3, clock=Clock(zero="unknown")))
    assert last + 0.05 < loose.scenario.simulation.duration < last + 0.1
    assert RunSimulator(toss(), recording(Z, until=3.0)).scenario.simulation.duration > 2.99


def test_shifts_and_sensors_cost_no_run() -> None:
    simulator = RunSimulator(toss(), recording(Z, ROLL))
    first = simulator.predict({}, 0.0)
    simulator.predict({}, 0.002)
    gain = {"effects.sensor-gain.channel": ROLL, "effects.sensor-gain.gain": 1.1}
    read = simulator.predict(gain, 0.0)
    assert simulator.runs == 1
    assert first is not None
    assert read is not None
    np.testing.assert_allclose(read[ROLL], 1.1 * first[ROLL], rtol=1e-12)
    np.testing.assert_array_equal(read[Z], first[Z])
    both = simulator.predict({**gain, FRICTION: 0.4}, 0.0)
    again = simulator.predict({FRICTION: 0.4}, 0.0)
    assert simulator.runs == 2
    assert both is not None
    assert again is not None
    np.testing.assert_allclose(both[ROLL], 1.1 * again[ROLL], rtol=1e-12)


def test_a_sensor_that_the_scenario_knows_of_is_read_once() -> None:
    gain = {"effects.sensor-gain.channel": ROLL, "effects.sensor-gain.gain": 1.1}
    plain = RunSimulator(toss(), recording(ROLL)).predict({}, 0.0)
    known = RunSimulator(toss().replaced(gain), recording(ROLL)).predict({"effects.sensor-bias.channel": ROLL}, 0.0)
    assert plain is not None
    assert known is not None
    np.testing.assert_allclose(known[ROLL], 1.1 * plain[ROLL] + 50.0, rtol=1e-12)


def test_instruments_are_read_where_the_recording_puts_them() -> None:
    sensor = Sensor(body="chassis", position=(0.05, 0.0, 0.02), orientation_deg=(0.0, 30.0, 0.0), gravity="proper")
    made = recording(UP, sensors={UP: sensor})
    found = RunSimulator(toss(), made).predict({}, 0.0)
    whole = run()
    there = at_sensor(whole, UP, sensor, centre_of_mass=(0.0, 0.0, 0.0), gravity=9.81)
    assert found is not None
    early = made.time < 0.28  # ends of the run differ, and its last difference with them
    np.testing.assert_allclose(found[UP][early], np.interp(made.time, whole.time, there)[early], rtol=1e-9)


def test_channels_go_through_the_filter_class_that_was_applied() -> None:
    made = recording("chassis/acceleration_z", cfc={"chassis/acceleration_z": 60})
    found = RunSimulator(toss(), made).predict({}, 0.0)
    whole = run()
    expected = np.interp(made.time, whole.time, filtered(whole["chassis/acceleration_z"], 0.0005, 60))
    assert found is not None
    early = made.time < 0.25
    np.testing.assert_allclose(found["chassis/acceleration_z"][early], expected[early], rtol=1e-6, atol=1e-6)


def test_what_the_run_has_no_rows_of_is_not_predicted() -> None:
    made = recording(Z, start=-0.2)
    found = RunSimulator(toss(), made).predict({}, 0.0)
    assert found is not None
    assert np.all(np.isnan(found[Z][made.time < -0.07]))
    assert np.all(np.isfinite(found[Z][made.time >= 0.0]))


def test_a_run_that_fails_predicts_nothing() -> None:
    lost = RunSimulator(toss().replaced({"initiation.velocity": [60.0, 0.0, 0.0]}), recording(Z))
    assert lost.predict({}, 0.0) is None
    assert lost.predict({}, 0.001) is None
    assert lost.runs == 1


def test_a_run_that_loses_its_way_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    simulator = RunSimulator(toss(), recording(Z, until=4.0))
    tuning = replace(full_run.TUNING, least_wall_time=0.0, slowest_ratio=0.0)
    monkeypatch.setattr(full_run, "TUNING", tuning)
    assert simulator.predict({}, 0.0) is not None

    def endless(_: Scenario, *, progress: Any) -> Any:
        while True:
            progress(0.0, 1.0)

    monkeypatch.setattr(simulate, "run", endless)
    assert simulator.predict({FRICTION: 0.4}, 0.0) is None


def test_runs_made_in_parallel_are_those_made_in_turn() -> None:
    paths = ({"ground.friction.coefficient": 0.2}, {"ground.friction.coefficient": 0.4}, {})
    alone, helped = (RunSimulator(toss(), recording("chassis/acceleration_z")) for _ in range(2))
    children = Children(2)
    try:
        full_run.made_ahead(None, [(helped, changes) for changes in paths])
        assert helped.runs == 0  # nobody to make them
        wrong = {"ground.friction.coefficient": -1.0}
        full_run.made_ahead(children, [(helped, changes) for changes in (*paths, *paths, wrong)])
    finally:
        children.stop()
    assert helped.runs == len(paths)
    assert helped.marks() == alone.marks()
    for changes in paths:
        one, other = alone.predict(changes, 1e-4), helped.predict(changes, 1e-4)
        assert one is not None
        assert other is not None
        for name, values in one.items():
            np.testing.assert_array_equal(values, other[name])
    assert helped.runs == len(paths)


def test_drops_keep_their_own_integrator() -> None:
    time = np.arange(0.0, 0.1, 0.001)
    made = Recording(title="r", time=time, channels={"ground/sinkage": np.zeros(time.size)})
    assert isinstance(simulator_of(shipped("drop_test"), made), DropSimulator)


def test_phases_of_an_overturn_are_those_of_its_forces() -> None:
    own = shipped("side_overturn").replaced(
        {"initiation.excess_deg": 8.0, "initiation.roll_rate": 1.8, "simulation.duration": 0.8}
    )
    done = simulate.run(own)
    marks = {name: at for at, name in run_phases(done)}
    assert list(marks) == ["tipping", "impact", "sliding"]
    time, force = done.recording.time, done.recording["ground/force_normal"]
    weight = 3000.0 * 9.81
    assert marks["impact"] == time[np.argmax(force > 0.1 * weight)]
    assert np.all(force[time > marks["sliding"]] <= 2.0 * weight)
    assert force[time == marks["sliding"]] > 2.0 * weight


def test_phases_are_cut_to_the_recording() -> None:
    made = recording(Z, until=0.4)
    found = dataset_of(
        "toss", replace(made, channels={Z: np.linspace(0.1, 0.0, made.time.size)}), RunSimulator(toss(), made)
    )
    assert found is not None
    names = [name for _, name in phases(found)]
    assert names[:2] == ["approach", "impact"]
    assert phases(found)[0][0] == made.time[0]


def test_perturbed_runs_diverge_after_the_first_contact_only() -> None:
    simulator = RunSimulator(toss(), recording(Z, ROLL, until=0.5))
    perturbed = simulator.perturbed()
    assert len(perturbed) == len(SETTINGS.forward.run.perturbations)
    assert simulator.runs == 1 + len(perturbed)
    time = simulator.recording.time
    touch = next(at for at, name in simulator.marks() if name == "impact")
    for perturbed_run in perturbed:
        assert np.max(np.abs(perturbed_run[Z][time < touch])) < 1e-6
    assert max(np.max(np.abs(s[ROLL][time > touch])) for s in perturbed) > 1e-4


def test_the_whole_ensemble_may_be_run_in_shorter_steps() -> None:
    simulator = RunSimulator(toss(), recording(Z))
    own = simulator.scenario.simulation.step
    steps = {
        simulator.scenario.replaced(simulator._beside(n, 4)).simulation.step for n in SETTINGS.forward.run.perturbations
    }
    assert steps == {own / 4}
    steps = {
        simulator.scenario.replaced(simulator._beside(n)).simulation.step for n in SETTINGS.forward.run.perturbations
    }
    assert steps == {own / n.parts for n in SETTINGS.forward.run.perturbations}


@pytest.mark.parametrize("parts", [1, 4])
def test_ensemble_runs_are_made_at_once_the_longest_first(parts: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """All that `perturbed` asks for; a drop has none."""
    drop = DropSimulator(shipped("drop_test"), recording("ground/sinkage"))
    runs = [RunSimulator(toss(), recording(Z, until=until)) for until in (0.1, 0.2)]
    changes = {FRICTION: 0.3}
    wanted = full_run.perturbations_of([runs[0], drop, runs[1]], changes, parts)
    steps = [toss().replaced(dict(one)).simulation.step for _, one in wanted]
    assert steps == sorted(steps)
    asked: list[tuple[Any, Mapping[str, Any]]] = []
    monkeypatch.setattr(RunSimulator, "predict", lambda own, values, _: asked.append((own, values)) or {})
    for own in runs:
        own.perturbed(changes, parts=parts)
    assert len(wanted) == len(asked) == 2 * (1 + len(SETTINGS.forward.run.perturbations))
    assert all(any(own is other and one == values for other, one in wanted) for own, values in asked)


def test_scatter_is_asked_for_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[int] = []
    monkeypatch.setattr(cache, "made_ahead", lambda _, wanted: made.append(len(list(wanted))))
    empty = recording(Z, until=0.5)
    made_of = replace(empty, channels={Z: np.interp(empty.time, run().time, run()[Z])})
    own = RunSimulator(toss(), made_of)
    found = dataset_of("toss", made_of, own)
    assert found is not None
    problem = Problem([found])
    nothing = problem.fit((), (), rounds=0)
    assert nothing is not None
    made.clear()
    with_ensemble_scatter(problem, nothing, 4)
    ensemble_mean_misfit(problem, nothing)
    assert [n for n in made if n > 1] == 2 * [1 + len(SETTINGS.forward.run.perturbations)]


def test_the_motion_is_estimated_though_not_recorded() -> None:
    simulator = RunSimulator(toss(), recording(Z))
    state = simulator.state(0.002)
    whole = run()
    np.testing.assert_allclose(
        state["chassis/roll"][1:20],
        np.interp(simulator.recording.time - 0.002, whole.time, whole["chassis/roll"])[1:20],
    )
