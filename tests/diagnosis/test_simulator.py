"""How exactly the many drops of a diagnosis are integrated."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from rollover.diagnosis.data.dataset import dataset_of
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.parameterisation import coordinate
from rollover.diagnosis.forward.averaging import simulated
from rollover.diagnosis.forward.discontinuities import DISCONTINUITY_IN
from rollover.diagnosis.forward.forward_model import DropSimulator, Exchanged, set_up, simulator_of
from rollover.diagnosis.selection.candidates import candidates_of
from rollover.diagnosis.settings import SETTINGS
from rollover.dynamics.drop_test import DropModel
from rollover.effects.empirical import Empirical
from rollover.recording import Recording
from rollover.spec.initiation import Drop
from tests.diagnosis.drops import ACCELERATION, DEPTH, FORCE, recorded, scenario

ENOUGH = 1e-4  # of the range, root mean square: half of what counts as an error of the model


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"effects.soil-crust.thickness": 0.03},
        {"effects.soil-crust.thickness": 0.03, "effects.soil-crust.width": 0.05},
        {"effects.soil-layer.depth": 0.1, "effects.soil-layer.width": 0.002},
        {"effects.guide-friction.force": 40.0},
        {"effects.guide-friction.force": 400.0, "effects.soil-elastic-rebound.recovery": 0.15},
        {"effects.structural-compliance.stiffness": 2e6},
        {"effects.structural-compliance.stiffness": 5e6, "effects.structural-compliance.damping": 30.0},
        {"effects.structural-compliance.stiffness": 2e4, "effects.structural-compliance.damping": 100.0},
        {"effects.soil-viscous-damping.damping": 300.0, "effects.soil-viscous-damping.exponent": 0.5},
        {"effects.soil-rate-hardening.per_decade": 0.3},
        {"effects.structural-compliance.stiffness": 2e5, "effects.guide-friction.force": 100.0},
        {"effects.soil-viscous-damping.damping": 1500.0, "effects.soil-layer.depth": 0.08},
    ],
    ids=str,
)
@pytest.mark.parametrize("speed", [1.3, 3.2])
def test_a_diagnosis_drop_equals_one_at_a_hundredth_step(changes: dict[str, Any], speed: float) -> None:
    ((_, recording),) = recorded({}, speeds=(speed,), rate=1000.0, channels=(FORCE, DEPTH, ACCELERATION), noise=0.0)
    model = DropModel(scenario=scenario(), step=1e-5).with_({"initiation.speed": speed, **changes})
    shift = 1.3e-4  # no stamp is an instant of the drop's own
    exact = model.run(recording.time - shift)
    made = DropSimulator(scenario().replaced({"initiation.speed": speed}), recording).predict(changes, shift)
    assert made is not None
    # a guide's friction turns from one instant to the next: a stamp within 0.2 ms of that may be on either side
    before, after = (np.sign(model.run(recording.time - shift + d)["striker/velocity_z"]) for d in (-2e-4, 2e-4))
    there = (before == after) | ("effects.guide-friction.force" not in changes)
    assert there.sum() > there.size - 5
    for channel in (FORCE, DEPTH, ACCELERATION):
        off = np.sqrt(np.mean((made[channel] - exact[channel])[there] ** 2)) / np.ptp(exact[channel])
        assert off < ENOUGH, channel


def test_the_mean_of_many_stamps_is_that_of_two_times() -> None:
    """A tone of frequency w: over n stamps dt apart cos has the mean sin(n w dt/2)/(n sin(w dt/2)) of its middle.

    Two times at the standard deviation s = dt sqrt((n^2 - 1)/12) give cos(w s): apart by (w n dt)^4/4320.
    """
    changes = {"effects.structural-compliance.stiffness": 2e6, "effects.structural-compliance.damping": 100.0}
    ((_, recording),) = recorded({}, speeds=(2.2,), rate=9000.0, channels=(FORCE, DEPTH, ACCELERATION), noise=0.0)
    own = scenario().replaced({"initiation.speed": 2.2})
    thin, simulator, many = simulated(own, recording)
    assert many > 4
    made = simulator.predict(changes, 0.0)
    whole = DropSimulator(own, recording).predict(changes, 0.0)
    assert made is not None
    assert whole is not None
    bins = thin.time.size
    away = np.abs(thin.time) > 0.02
    exact = whole[ACCELERATION][: many * bins].reshape(bins, many).mean(axis=1)
    off = np.abs(made[ACCELERATION] - exact)[away & (thin.time < 0.1)]
    assert np.sqrt(np.mean(off**2)) < 1e-4 * np.ptp(exact)


def test_stamps_may_lie_as_close_as_a_shifts_difference_step() -> None:
    stamps = np.arange(200) * 2.0**-14  # exact in binary: each, a step less, is the one before
    recording = Recording(title="drop", time=stamps, channels={FORCE: 0.0 * stamps})
    simulator = DropSimulator(scenario(), recording)
    simulator.effort = replace(simulator.effort, later=2.0**-14)
    now, later = simulator.predict({}, 0.0), simulator.predict({}, 2.0**-14)
    assert now is not None
    assert later is not None
    np.testing.assert_array_equal(later[FORCE][1:], now[FORCE][:-1])


def test_a_scenarios_own_sensor_effects_are_applied_once() -> None:
    stamps = np.arange(-20, 900) * 1e-3
    recording = Recording(title="drop", time=stamps, channels={FORCE: 0.0 * stamps})
    own = scenario().replaced({"effects.sensor-gain.gain": 1.5, "effects.sensor-lag.time": 0.004})
    bias = {"effects.sensor-bias.bias": 100.0, "effects.sensor-bias.channel": FORCE}
    alone, beside = (DropSimulator(own, recording).predict(changes, 0.0) for changes in ({}, bias))
    assert alone is not None
    assert beside is not None
    assert alone[FORCE][-1] == pytest.approx(1.5 * 132.0 * 9.81, rel=1e-3)
    np.testing.assert_allclose(beside[FORCE], alone[FORCE] + 100.0, rtol=1e-12)


@pytest.mark.parametrize(
    ("is_smooth", "force", "step"),
    [
        (True, 300.0, SETTINGS.forward.drop.longest_step),
        (False, 300.0, SETTINGS.forward.drop.shortest_step),
        (False, 0.0, SETTINGS.forward.drop.longest_step),
    ],
)
def test_a_discontinuous_force_term_takes_the_shortest_steps(
    monkeypatch: pytest.MonkeyPatch, is_smooth: bool, force: float, step: float
) -> None:
    """Roots of 30 kN/m that tear at 50 mm are 0.5 mm off at 2 ms, 0.01 mm at 0.2 ms: the kernel knows of no jump."""
    monkeypatch.setattr(Empirical, "is_smooth", is_smooth)
    _, recording = recorded({}, speeds=(2.0,))[0]
    made = DropSimulator(scenario(), recording)._model(Exchanged({"effects.empirical.first_force": force}))
    assert made.step == step


def test_drops_share_what_their_conditions_leave_as_it_is() -> None:
    """Two speeds: one ground, and one table of numbers for the kernel, whatever effect is switched on."""
    own = scenario()
    made = [set_up(own, recording) for _, recording in recorded({}, speeds=(1.3, 2.2))]
    assert [s.initiation.speed for s in made if isinstance(s.initiation, Drop)] == [1.3, 2.2]
    assert made[0].ground is made[1].ground is own.ground
    layer = {"effects.soil-layer.depth": 0.1}
    one, other = (DropModel(scenario=s).with_(layer).kernel_law[1] for s in made)
    assert one is other
    assert one.tolist() != DropModel(scenario=own).kernel_law[1].tolist()


def test_a_scenario_under_conditions_is_made_once() -> None:
    base = scenario()
    ((_, asked),) = recorded({}, speeds=(2.0,))
    assert asked.conditions == {"initiation.speed": 2.0}
    found = set_up(base, asked)
    assert set_up(base, asked) is found
    assert isinstance(found.initiation, Drop)
    assert found.initiation.speed == 2.0
    # another value, another scenario; and a value that has no hash
    for other in (2.5, np.float64(3.0)):
        moved = set_up(base, replace(asked, conditions={"initiation.speed": other})).initiation
        assert isinstance(moved, Drop)
        assert moved.speed == other
    assert set_up(base.replaced({"gravity": 9.0}), asked).gravity == 9.0
    wide = {"ground.elements.spacing": [0.05, 0.05]}
    assert set_up(base, replace(asked, conditions=wide)).ground.elements.spacing == (0.05, 0.05)


def test_a_clock_of_its_own_is_simulated_at_its_own_stamps() -> None:
    name, recording = recorded({}, speeds=(2.0,), channels=(FORCE, DEPTH, ACCELERATION), noise=1e-4)[0]
    simulator = simulator_of(scenario(), recording)
    late = simulator.predict(
        {"effects.sensor-clock-offset.channel": FORCE, "effects.sensor-clock-offset.offset": 0.004}, 0.0
    )
    shifted, plain = simulator.predict({}, 0.004), simulator.predict({}, 0.0)
    assert late is not None
    assert shifted is not None
    assert plain is not None
    assert np.array_equal(late[FORCE], shifted[FORCE])
    assert np.array_equal(late[DEPTH], plain[DEPTH]), name
    # and what leaps in it leaps there: on which side a sample lies is this clock's to say
    assert np.any(late[DISCONTINUITY_IN + FORCE] > 0.0)
    assert np.array_equal(late[DISCONTINUITY_IN + FORCE], shifted[DISCONTINUITY_IN + FORCE])
    assert not np.array_equal(late[DISCONTINUITY_IN + FORCE], plain[DISCONTINUITY_IN + FORCE])
    lag = {"effects.sensor-lag.channel": FORCE, "effects.sensor-lag.time": 0.002}
    behind = simulator.predict(lag, 0.0)
    assert behind is not None
    assert DISCONTINUITY_IN + FORCE not in behind  # which makes a kink of it


def test_a_drifting_clock_is_masked_at_contact_samples() -> None:
    """The load cell's clock loses 0.3 %, and one of its samples lies at the contact: 10 us to either side are alike."""
    (name, made), *_ = recorded({}, speeds=(1.4,), rate=1000.0)
    time, rng = np.arange(-30, 350) * 1e-3 + 1e-6, np.random.default_rng(4)
    model = DropModel(scenario=scenario(), step=2e-4).with_({"initiation.speed": 1.4})
    runs = {FORCE: model.run(0.997 * time)[FORCE], DEPTH: model.run(time)[DEPTH]}
    channels = {c: v + 3e-3 * np.ptp(v) * rng.normal(size=v.size) for c, v in runs.items()}
    one = dataset_of(name, *simulated(scenario(), replace(made, time=time, channels=channels)))
    assert one is not None
    problem = Problem([one])
    c = next(c for c in candidates_of(problem.dataset, (), "drop") if c.key == f"sensor-clock-drift:{FORCE}")
    there = (coordinate(0.003, c.search["drift"]),)

    def left(shift: float) -> float:
        e, raw = problem.dataset[0], problem.raw(0, (c,), there, shift)
        assert raw is not None
        return float(np.sum((e.measured() - e.whitened(raw)) ** 2))

    assert left(1e-5) == pytest.approx(left(-1e-5), rel=0.1)
    assert left(1e-5) < 1.2 * 2 * time.size
