"""A drop by itself against the full run: one physics, two integrators; fingerprints of effects; the ledger."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rollover.dynamics.drop_test import DropModel, simulate_drop, unfit
from rollover.dynamics.result import Run
from rollover.dynamics.simulate import run
from rollover.effects import EFFECTS
from rollover.scenario import Scenario
from tests.ground.reference_drop import solve
from tests.ground.test_laws_contract import EXAMPLES
from tests.physics.scenes import drop, shipped

STEP = 1e-4
CHANGES: dict[str, dict[str, Any]] = {
    "nothing": {},
    "slow": {"initiation.speed": 1.0},
    "lead": {"initiation.lead_time": 0.1},
    "another face": {"vehicle.face_length": 0.07, "vehicle.mass": 60.0, "ground.striker_mass": "effective"},
    "clamped momentum": {"vehicle.mass": 300.0, "ground.striker_mass": "clamped"},
    "third branch": {"ground.law.unloading": "rest-stiffness"},
    # the full run meets a force that is there at once a step late: 0.06 % at 0.1 ms, where the other is exact to 1e-8
    "viscous": {
        "effects.soil-viscous-damping.damping": 1500.0,
        "simulation.step": 5e-5,
        "simulation.output_step": 5e-5,
    },
    "rate": {"effects.soil-rate-hardening.per_decade": 0.1},
    "drag": {"effects.soil-inertial-drag.coefficient": 4.0},
    "growth": {"effects.soil-added-mass-growth.rate": 40.0},
    "rebound": {"effects.soil-elastic-rebound.recovery": 0.15},
    "adhesion": {"effects.soil-elastic-rebound.recovery": 0.4, "effects.soil-adhesion.stress": 20_000.0},
    "layer": {"effects.soil-layer.depth": 0.1},
    "crust": {"effects.soil-crust.thickness": 0.04},
    "mass": {"effects.mass.added": 10.0},
    "speed": {"effects.impact-speed.scale": 1.1},
    "co-moving": {"effects.co-moving-mass.fraction": 0.3},
    "guide": {"effects.guide-friction.force": 150.0, "initiation.lead_time": 0.1},
    "creeping guide": {"effects.guide-friction.force": 150.0, "effects.guide-friction.creep": 0.005},
    "air": {"effects.air-drag.area": 3.0, "initiation.lead_time": 0.1},
    "thin air": {
        "effects.air-drag.area": 3.0,
        "effects.air-drag.crisis_speed": 3.05,
        "effects.air-drag.crisis_ratio": 0.1,
        "initiation.lead_time": 0.1,
    },
    "two parts": {"effects.structural-compliance.stiffness": 1e5, "effects.structural-compliance.damping": 100.0},
}


def scene(changes: dict[str, Any]) -> Scenario:
    return drop(3.0, step=STEP, duration=0.45).replaced(changes)


@pytest.mark.parametrize("changes", CHANGES.values(), ids=CHANGES)
def test_a_track_knows_each_jump_of_its_force_and_no_other(changes: dict[str, Any]) -> None:
    """On rows 2 us apart the force changes by 1 % of its most only where it is said to jump, and by as much."""
    track = DropModel(scenario=scene(changes)).track(0.46)
    times = np.arange(-0.01, 0.45, 2e-6)
    force = track.rows(times)[:, 0]
    most = 0.01 * float(np.max(np.abs(force)))
    instants, apart = track.jumps
    shown = np.flatnonzero(np.abs(np.diff(force)) > most)
    large = np.abs(apart[:, 0]) > 1.5 * most
    within = np.clip(np.searchsorted(times, instants[large]) - 1, 0, None)
    assert set(within) <= set(shown)
    assert np.diff(force)[within] == pytest.approx(apart[large, 0], abs=0.05 * most)
    jumps = np.searchsorted(times, instants) - 1
    assert set(shown) <= set(jumps)


def test_a_force_that_rises_steeply_has_not_jumped(monkeypatch: pytest.MonkeyPatch) -> None:
    """A nose of 0.04 of the mass on 73 MN/m rings at 4 kHz: within nanoseconds its force changes, and by their number.

    What jumps does not depend on how near it is looked at.
    """
    stiff = {"stiffness": 7.3e7, "damping": 1300.0, "nose_share": 0.04}
    fall = DropModel(scenario=scene({f"effects.structural-compliance.{name}": v for name, v in stiff.items()}))
    told = []
    for beside in (1e-9, 1e-11):
        monkeypatch.setattr("rollover.dynamics.drop_test.BESIDE", beside)
        instants, apart = fall.track(0.46).jumps
        told.append((instants, apart[:, 0]))
    (wide, sizes), (close, same) = told
    assert wide.tolist() == close.tolist()
    assert sizes == pytest.approx(same, rel=0.01)


def peaks(result: Any) -> list[float]:
    names = ("ground/sinkage", "ground/force_normal", "ground/impulse_normal")
    return [float(result[name].max()) for name in names] + [float(result["striker/position_z"].min())]


@pytest.mark.parametrize("name", CHANGES)
def test_both_paths_give_the_same_drop_and_the_ledger_closes(name: str) -> None:
    """Peaks within 0.05 %; the full run's own error at this step is 0.002 % without effects, 0.04 % with damping."""
    scenario = scene(CHANGES[name])
    full: Run = run(scenario)
    alone = simulate_drop(scenario, full.recording.time)
    assert full.status == "done", full.sentence
    # a second hit after a rebound depends on how high it jumped
    rel = 1e-3 if name in ("rebound", "adhesion", "two parts") else 5e-4
    expected = [pytest.approx(v, rel=rel) for v in peaks(full.recording)]
    if name == "guide":  # whose friction turns at the peak: m_b1 a leaps by 2 F_c/(1 + m_s/m_b1), wherever a row is
        jump = 2.0 * CHANGES[name]["effects.guide-friction.force"] / 11.0
        expected[1] = pytest.approx(peaks(full.recording)[1], abs=jump)
    assert peaks(alone) == expected
    for channel, scale in (("striker/position_z", 0.3), ("striker/velocity_z", 3.0)):
        error = np.abs(alone[channel] - full.recording[channel])
        after = np.abs(full.recording.time) > 2 * STEP
        # all but the instants of a second hit, which the full run meets within a step
        assert np.quantile(error[after], 0.999) < 1e-3 * scale, channel
    assert np.abs(full.recording["energy/residual"]).max() < 1e-3 * full.released


@pytest.mark.parametrize("step", [1e-3, 4.1e-4])
def test_flight_time_after_rebound_is_that_of_gravity(step: float) -> None:
    """Thrown up at v from the rut, the striker is back at the rut after 2 v/g; its steps end at both places."""
    scenario = scene({"effects.soil-elastic-rebound.recovery": 0.1, "effects.soil-elastic-rebound.damping_ratio": 0.1})
    at = np.arange(0.15, 0.5, 1e-5)
    found = DropModel(scenario=scenario, step=step).run(at)
    flies = (found["ground/force_normal"] == 0.0) & (found["ground/sinkage"] == 0.0)
    first = int(np.argmax(flies))
    last = first + int(np.argmin(flies[first:]))
    thrown = found["striker/velocity_z"][first] + scenario.gravity * 5e-6  # on the average it left half a row before
    assert thrown > 0.2
    # rows are 1e-5 s apart: either end is seen up to one row late, the speed is that of half a row before
    assert at[last] - at[first] == pytest.approx(2.0 * thrown / scenario.gravity, abs=1.5e-5)


@pytest.mark.parametrize("effect", ["soil-crust", "soil-layer", "soil-adhesion"])
def test_a_force_jump_is_located_whatever_the_step(effect: str) -> None:
    rebound = {"effects.soil-elastic-rebound.recovery": 0.1, "effects.soil-elastic-rebound.damping_ratio": 0.1}
    changes: dict[str, dict[str, Any]] = {
        "soil-crust": {"effects.soil-crust.thickness": 0.0794, "effects.soil-crust.stiffness_ratio": 2.405},
        "soil-layer": {"effects.soil-layer.depth": 0.1, "effects.soil-layer.stiffness_ratio": 3.0},
        "soil-adhesion": {"effects.soil-adhesion.stress": 9119.0, "effects.soil-adhesion.reach": 0.0076} | rebound,
    }
    at, model = np.arange(0.0, 0.45, 1e-3), DropModel(scenario=scene(changes[effect]))
    fine = DropModel(scenario=model.scenario, step=1e-5).run(at)["striker/position_z"]
    for step in (1e-3, 5e-4, 3.7e-4):
        coarse = DropModel(scenario=model.scenario, step=step).run(at)["striker/position_z"]
        assert np.abs(coarse - fine).max() < 3e-6, step


@pytest.mark.parametrize("law", EXAMPLES.values(), ids=EXAMPLES.keys())
def test_both_paths_agree_for_every_law(law: Any) -> None:
    scenario = drop(2.0, step=STEP, duration=0.3, law=law)
    full = run(scenario)
    assert peaks(simulate_drop(scenario)) == pytest.approx(peaks(full.recording), rel=1e-3)


@pytest.mark.parametrize("speed", [1.0, 2.0, 3.0, 3.5])
def test_a_drop_by_itself_follows_the_independent_solution(speed: float) -> None:
    expected = solve(speed)
    t = np.linspace(1e-6, expected.t_max, 400)
    r = simulate_drop(drop(speed), t)
    assert r["ground/sinkage"] == pytest.approx(expected.z(t), rel=1e-6, abs=1e-8)
    assert r["striker/velocity_z"] == pytest.approx(-expected.v(t), abs=1e-6)
    assert r["ground/force_normal"] == pytest.approx(expected.load_cell(t), rel=1e-5, abs=1e-2)
    assert r["ground/impulse_normal"] == pytest.approx(expected.impulse, rel=1e-12)


def test_times_may_be_any_and_do_not_change_the_motion() -> None:
    model = DropModel(scenario=shipped("drop_test"))
    fine = np.linspace(-0.02, 0.6, 6201)
    odd = np.sort(np.random.default_rng(1).choice(fine, 200, replace=False))
    assert np.array_equal(model.rows(odd), model.rows(fine)[np.isin(fine, odd)])
    coarse, close = model.rows(fine), DropModel(scenario=model.scenario, step=2e-5).rows(fine)
    assert np.abs(coarse - close).max(axis=0) == pytest.approx(0.0, abs=2e-3)


def test_what_is_no_drop_test_is_said() -> None:
    assert "not a drop test" in unfit(shipped("side_overturn"))
    tilted = drop(3.0).replaced({"ground.surface": {"kind": "slope", "angle_deg": 5.0}})
    ditch = drop(3.0).replaced({"ground.surface": {"kind": "ditch", "depth": 0.3, "angle_deg": 45.0, "bottom": 1.0}})
    for uneven in (tilted, ditch):
        with pytest.raises(ValueError, match="not level"):
            DropModel(scenario=uneven)
    with pytest.raises(KeyError, match="no such path: masss in Striker"):
        DropModel(scenario=drop(3.0)).with_({"vehicle.masss": 1.0})
    with pytest.raises(ValueError, match="mass: out of bounds"):
        DropModel(scenario=drop(3.0)).with_({"vehicle.mass": -1.0})


# ---------------------------------------------------------------- fingerprints: recorded with the effect less simulated

T = np.linspace(-0.05, 0.5, 1101)
BASE = DropModel(scenario=drop(3.0).replaced({"initiation.lead_time": 0.05}))


def residual(changes: dict[str, Any], channel: str, speed: float = 3.0) -> Any:
    at = {"initiation.speed": speed}
    return BASE.with_({**at, **changes}).run(T)[channel] - BASE.with_(at).run(T)[channel]


EARLY = (T > 0.002) & (T < 0.03)
FALL = T < -1e-9


@pytest.mark.parametrize(
    "changes",
    [
        {"effects.soil-viscous-damping.damping": 1500.0},
        {"effects.soil-inertial-drag.coefficient": 4.0},
        {"effects.soil-rate-hardening.per_decade": 0.1},
    ],
)
def test_rate_dependence_adds_early_force_and_stops_sooner(changes: dict[str, Any]) -> None:
    force = residual(changes, "ground/force_normal")
    assert np.all(force[EARLY] > 0.0)
    assert abs(force[-1]) < 1.0
    assert np.all(force[FALL] == 0.0)
    assert BASE.with_(changes).run(T)["ground/sinkage"].max() < BASE.run(T)["ground/sinkage"].max()


def test_damping_goes_with_v_and_drag_with_its_square() -> None:
    def early(changes: dict[str, Any], speed: float) -> float:
        return float(residual(changes, "ground/force_normal", speed)[np.searchsorted(T, 1e-3)])

    viscous = {"effects.soil-viscous-damping.damping": 500.0}
    drag = {"effects.soil-inertial-drag.coefficient": 10.0}
    assert early(viscous, 2.0) / early(viscous, 1.0) == pytest.approx(2.0, rel=0.05)
    assert early(drag, 2.0) / early(drag, 1.0) == pytest.approx(4.0, rel=0.05)


def test_a_layer_keeps_its_depth_at_every_speed() -> None:
    for speed in (2.0, 3.0, 3.5):
        model = BASE.with_({"initiation.speed": speed, "effects.soil-layer.depth": 0.1})
        plain = BASE.with_({"initiation.speed": speed}).run(T)["ground/force_normal"]
        r = model.run(T)
        going = (r["striker/velocity_z"] < -0.05) & (T > 0)
        kink = going & (np.abs(r["ground/force_normal"] - plain) > 500.0)
        assert r["ground/sinkage"][kink].min() == pytest.approx(0.1, abs=0.002)


def test_a_crust_is_early_and_locked_to_its_depth() -> None:
    force = residual({"effects.soil-crust.thickness": 0.02}, "ground/force_normal")
    z = BASE.with_({"effects.soil-crust.thickness": 0.02}).run(T)["ground/sinkage"]
    assert np.all(force[(z > 0.001) & (z < 0.019) & (T > 0)] > 0.0)
    assert np.abs(force[(z > 0.03) & (T < 0.1)]).max() < 0.2 * force.max()


def test_rebound_shows_only_after_the_deepest_point() -> None:
    z = residual({"effects.soil-elastic-rebound.recovery": 0.1}, "ground/sinkage")
    turn = T[BASE.run(T)["ground/sinkage"].argmax()]
    assert np.all(z[turn - 1e-3 > T] == 0.0)
    changed = BASE.with_({"effects.soil-elastic-rebound.recovery": 0.1}).run(T)
    assert changed["striker/velocity_z"].max() > 0.1
    assert -changed["striker/position_z"][-1] < 0.99 * -BASE.run(T)["striker/position_z"][-1]


def test_growing_mass_has_less_impulse_and_brakes_mid_stroke() -> None:
    """As much mass at the end as the constant one has throughout, but none at the start."""
    changes = {"effects.soil-added-mass-growth.rate": 13.2 / 0.3, "effects.co-moving-mass.fraction": 0.0}
    assert residual(changes, "ground/impulse_normal")[-1] < -30.0
    middle = (T > 0.02) & (T < 0.1)
    assert residual(changes, "ground/force_normal")[middle].mean() > 50.0


def test_guide_friction_and_air_show_in_free_fall() -> None:
    guide = residual({"effects.guide-friction.force": 100.0}, "striker/acceleration_z")
    assert guide[FALL] == pytest.approx(100.0 / 132.0, rel=1e-9)
    air = residual({"effects.air-drag.area": 0.05}, "striker/acceleration_z")
    assert 0.0 < air[FALL].max() < 5e-3  # a negative control: nothing that an instrument sees
    assert np.all(residual({"effects.soil-stiffness.scale": 1.2}, "striker/acceleration_z")[FALL] == 0.0)


def test_mass_shows_at_rest() -> None:
    assert residual({"effects.mass.added": 5.0}, "ground/force_normal")[-1] == pytest.approx(5.0 * 9.81, rel=1e-2)
    for effect in ("soil-viscous-damping.damping", "soil-layer.depth", "soil-elastic-rebound.damping_ratio"):
        long = BASE.with_({f"effects.{effect}": 0.5}).run(np.array([10.0]))
        assert long["ground/force_normal"][0] == pytest.approx(132.0 * 9.81, rel=1e-4)


def test_a_striker_that_gives_way_rings() -> None:
    a = residual({"effects.structural-compliance.stiffness": 2e7}, "striker/acceleration_z")
    t = T[(T > 0.001) & (T < 0.03)]
    ring = a[(T > 0.001) & (T < 0.03)]
    crossings = int(np.sum(np.diff(np.sign(ring - ring.mean())) != 0))
    assert crossings > 5, (crossings, t[0])


def test_a_damping_with_the_square_of_the_speed_is_a_drag() -> None:
    """What `becomes` says: both give the same force with C = 2 d/(rho A)."""
    t = np.linspace(0.0, 0.3, 200)
    other, (own, times) = next(iter(EFFECTS["soil-viscous-damping"].becomes["soil-inertial-drag"].items()))
    model = DropModel(scenario=shipped("drop_test"))
    square = model.with_({f"effects.soil-viscous-damping.{own}": 40.0, "effects.soil-viscous-damping.exponent": 2.0})
    drag = model.with_({f"effects.soil-inertial-drag.{other}": 40.0 * times})
    np.testing.assert_allclose(square.run(t)["ground/force_normal"], drag.run(t)["ground/force_normal"], rtol=1e-9)


@pytest.mark.parametrize("id", [id for id, effect in EFFECTS.items() if effect.mirrors])
def test_mirrored_effects_agree_beside_another_stiffness(id: str) -> None:
    """K' r below and K' above are (r K') / r above and r K' below: with s a scale, (d, r, s) and (d, 1/r, r s)."""
    own = {name: 0.06 if getattr(EFFECTS[id](), name) < 1.0 else 1.7 for name in list(EFFECTS[id].search)[:2]}
    t = np.linspace(0.0, 0.4, 300)
    model = DropModel(scenario=shipped("drop_test"))
    for other, told in EFFECTS[id].mirrors.items():
        there = {f"effects.{other}.{p}": own[n] ** power for p, (n, power) in told.items()}
        scale = "effects.soil-stiffness.scale"
        one = model.with_({**{f"effects.{id}.{n}": v for n, v in own.items()}, scale: 1.2})
        same = model.with_({**there, scale: 1.2 * 1.7})
        np.testing.assert_allclose(
            same.run(t)["ground/force_normal"], one.run(t)["ground/force_normal"], rtol=1e-9, atol=1e-6
        )
