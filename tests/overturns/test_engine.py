"""Overturns by another engine: the same tractor, the same motion up to the first blow, effects where they act."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest

from rollover.dynamics.setup import set_up
from rollover.dynamics.simulate import run
from rollover.effects import EFFECTS as EVERY
from rollover.effects.effect import Heard
from rollover.proof.generator import Order
from rollover.proof.overturns import engine, generator
from rollover.proof.overturns.engine import CHANNELS, EFFECTS, overturn
from rollover.proof.overturns.generator import make, plan
from rollover.scenario import Scenario
from rollover.spec.vehicle import laden

mujoco = pytest.importorskip("mujoco", reason="the group oracle is not installed")

SHOT = generator.Shot(
    side="left", excess=6.0, rate=1.96, inclination=3.0, direction=-60.0, late=0.0, shifted=(0.0, 0.0)
)
BEFORE = 0.25  # s: before the wheels' sides hit the ground


def scenario(**more: object) -> Scenario:
    return generator._base().replaced({**SHOT.conditions, "simulation.duration": 0.3, **more})


def model(of: Scenario) -> tuple[object, object]:
    rig = set_up(of)
    lab = engine._Tractor(scenario=of, vehicle=of.vehicle, bodies=rig.bodies, q=rig.start.q.reshape(-1, 6))
    built = mujoco.MjModel.from_xml_string(lab.text())
    return built, mujoco.MjData(built)


def test_it_has_the_tractors_mass_centre_and_inertia() -> None:
    """Wheels on springs are taken off their carriers: as designed the whole is what the vehicle says it is."""
    of = scenario()
    built, data = model(of)
    data.qpos[:7] = 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0
    mujoco.mj_forward(built, data)
    whole, chassis = laden(of.vehicle), set_up(of).bodies[0].centre
    assert built.body_subtreemass[1] == pytest.approx(whole.mass)
    assert data.subtree_com[1] + chassis == pytest.approx(np.array(whole.centre_of_mass), abs=1e-9)
    J = np.zeros((3, 3))
    for b in range(1, built.nbody):
        R, d = data.ximat[b].reshape(3, 3), data.xipos[b] - data.subtree_com[1]
        J += R @ np.diag(built.body_inertia[b]) @ R.T
        J += built.body_mass[b] * (float(d @ d) * np.eye(3) - np.outer(d, d))
    assert np.diag(J) == pytest.approx(np.array(whole.inertia), rel=1e-6)


def test_up_to_the_first_impact_both_engines_move_alike() -> None:
    """Tyres that do not give sideways make roll and its rate differ by about a tenth in a quarter of a second."""
    of = scenario()
    ours, theirs = run(of).recording, overturn(of)
    assert tuple(theirs.channels) == CHANNELS
    assert theirs.time[0] == 0.0
    assert np.diff(theirs.time) == pytest.approx(engine.EVERY * engine.STEP)
    before = ours.time <= BEFORE
    turned, rate = (
        float(np.ptp(ours["chassis/roll"][before])),
        float(np.max(np.abs(ours["chassis/angular_velocity_x"]))),
    )
    for channel, size in (("chassis/roll", turned), ("chassis/angular_velocity_x", rate)):
        there = np.interp(ours.time, theirs.time, theirs[channel])[before]
        assert 0.0 < np.max(np.abs(there - ours[channel][before])) < 0.15 * size
        assert there[0] == pytest.approx(ours[channel][0], abs=1e-3)
    # the accelerometer tells no gravity: at a roll of 60 to 90 degrees it would add up to 5 m/s2, 3 on the average
    fall = float(np.mean(theirs["chassis/acceleration_z"][theirs.time < BEFORE]))
    assert fall == pytest.approx(float(np.mean(ours["chassis/acceleration_z"][before])), abs=1.5)
    assert not theirs["rops/force_y"][theirs.time < BEFORE].any()


def test_what_is_written_into_the_scenario_acts() -> None:
    one = overturn(scenario(**{"simulation.duration": 0.6}))
    for changes in (
        {"ground.friction.coefficient": 0.2},
        {"vehicle.wheels.rear_left.tyre.vertical_damping": 30_000.0},
        {"vehicle.front_axle.swing_deg": 6.0},
        {"vehicle.whole.centre_of_mass": [0.9, 0.02, 0.88]},
        {"vehicle.whole.inertia": [1700.0, 3900.0, 4300.0]},
        {"ground.surface.angle_deg": 5.0},
    ):
        other = overturn(scenario(**{"simulation.duration": 0.6, **changes}))
        assert max(np.ptp(other[c] - one[c]) / np.ptp(one[c]) for c in CHANNELS[:6]) > 0.01, changes
    again = overturn(scenario(**{"simulation.duration": 0.6}))
    assert all(np.array_equal(one[c], again[c]) for c in CHANNELS)


def test_the_axle_turns_between_its_stops() -> None:
    built, _ = model(scenario(**{"vehicle.front_axle.swing_deg": 7.0}))
    assert built.joint("axle").range == pytest.approx([-math.radians(7.0), math.radians(7.0)])
    assert built.joint("axle").limited


def test_a_plan_has_effects_beside_the_engine_or_it_alone() -> None:
    orders = plan(3 * len(EFFECTS), 3, ["foreign-engine", "background"])
    kinds = Counter(o.kind for o in orders)
    assert set(kinds) == {"foreign-engine", "background"}
    assert {o.ids for o in orders if o.kind == "background"} == {()}
    assert {o.ids[0] for o in orders if o.kind == "foreign-engine"} == set(EFFECTS)
    with pytest.raises(ValueError, match="none of kind foreign-engine, got soil-layer"):
        plan(3, 1, ["foreign-engine"], ["soil-layer"])


def test_a_gain_of_an_attitude_bears_the_name_of_the_table() -> None:
    spans = dict.fromkeys(CHANNELS, 1.0)
    for seed in range(40):
        change = EFFECTS["sensor-gain"](np.random.default_rng(seed), spans)
        kind = EVERY[change.id]
        heard = Heard(change.channel, spans, 1.0, 0.0)
        assert kind.looked_for_on(heard) is not None
        assert set(change.parameters) == set(kind.search)
        assert change.fault.gain == next(iter(change.parameters.values()))


def test_without_the_engine_one_line_says_what_brings_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine, "is_installed", lambda: False)
    with pytest.raises(ValueError, match=r"got foreign-engine; mujoco, which is not installed, .* 'rollover\[proof\]'"):
        plan(3, 1, ["foreign-engine"])
    assert plan(3, 1, ["null"])


@pytest.mark.parametrize(
    ("kind", "ids", "verdict"), [("background", (), "no-mismatch"), ("foreign-engine", ("slope",), "parameter")]
)
def test_a_case_is_recorded_by_the_other_engine(
    kind: str, ids: tuple[str, ...], verdict: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(generator, "LENGTH", 0.2)
    case = make(Order(index=0, seed=5, kind=kind, ids=ids))
    assert case.truth["verdict"] == verdict
    assert [e["id"] for e in case.truth["effects"]] == list(ids)
    assert all(tuple(r.channels) == CHANNELS for r in case.recordings)
    assert all(e["over_noise"] > 0.0 for e in case.truth["effects"])
    assert len(case.references) == generator.REFERENCES
    assert not any(r.conditions == one.conditions for r in case.references for one in case.recordings)
