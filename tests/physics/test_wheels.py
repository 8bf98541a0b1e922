"""Wheels that roll, brake, climb and drive, against closed forms; the ledger of the scenarios that drive."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad

from rollover.dynamics.assembly import tables_of
from rollover.dynamics.bodies import bodies_of
from rollover.dynamics.result import Run
from rollover.dynamics.simulate import run
from rollover.kernels.tables import W_AXIS, handle
from rollover.kernels.wheel_spin import keep_spins
from rollover.scenario import Scenario
from tests.physics.regime import climbing, direction
from tests.physics.scenes import shipped

G = 9.81
MASS, A, H = 3000.0, 0.90, 0.82
# inertia of the wheels over their radius squared, kg: what the tractor seems to weigh more when it rolls
ROLLING = 2 * 6.3 / 0.45**2 + 2 * 45.0 / 0.70**2


def driving(changes: dict[str, Any], duration: float = 1.0) -> Scenario:
    """The utility tractor, driving along x over level ground unless changed."""
    wide = {"length": 40.0, "width": 8.0, "centre": [15.0, 0.0], "spacing": [0.1, 0.1]}
    base = shipped("side_overturn").replaced({"ground.elements": wide, "simulation.duration": duration})
    return base.replaced({"initiation": {"kind": "driving", "speed": 2.0}}).replaced(changes)


def done(result: Run) -> Run:
    assert result.status == "done", result.sentence
    assert np.abs(result.recording["energy/residual"]).max() < 5e-3 * result.released  # at every time, not the last
    return result


def test_it_rolls_on_as_it_is_put_down() -> None:
    """On level ground nothing changes: speed, spin v/r of each wheel, its loads."""
    rec = done(run(driving({}))).recording
    assert np.ptp(rec["chassis/velocity_x"]) < 1e-6
    for wheel, radius in (("front_left", 0.45), ("rear_right", 0.70)):
        np.testing.assert_allclose(rec[f"wheel/{wheel}/spin"], 2.0 / radius, rtol=1e-6)
        assert np.ptp(rec[f"wheel/{wheel}/force_normal"]) < 1.0


def test_it_rolls_down_a_slope_with_the_inertia_of_its_wheels() -> None:
    """a = g sin(angle)/(1 + sum I/(m r^2))."""
    angle = math.radians(8.0)
    slope = {"ground.surface": {"kind": "slope", "angle_deg": -8.0, "direction_deg": 0.0}}
    rec = done(run(driving(slope, duration=2.0))).recording
    speed = rec["chassis/velocity_x"] / math.cos(angle)
    # from rest on its brakes to rolling it rocks; over whole rocks the mean is that of the closed form
    slope_found = np.polyfit(rec.time[300:], speed[300:], 1)[0]
    assert ROLLING > 0.05 * MASS
    assert slope_found == pytest.approx(G * math.sin(angle) / (1 + ROLLING / MASS), rel=0.01)


def test_locked_wheels_slide_to_a_halt() -> None:
    """v^2/(2 mu g) with mu = 0.8 of all tyres; brakes of 100 kN m lock at once."""
    rec = done(run(driving({"initiation.speed": 6.0, "initiation.brake": {"torque": 1e5}}, duration=1.2))).recording
    x, v = rec["chassis/position_x"], rec["chassis/velocity_x"]
    halt = int(np.argmax(v < 0.0))
    assert halt > 0
    assert x[halt] - x[0] == pytest.approx(6.0**2 / (2 * 0.8 * G), rel=0.03)


def test_a_ramp_takes_the_speed_that_its_height_costs() -> None:
    """v1^2 = v0^2 - 2 g h/(1 + sum I/(m r^2)): no engine; the tyres' dashpots make it slower, a little."""
    ramp = {"kind": "ramp", "length": 5.0, "height": 0.6, "width": 4.0, "top": 30.0, "start": [4.0, 0.0]}
    rec = done(run(driving({"ground.surface": ramp, "initiation.speed": 6.0}, duration=2.2))).recording
    z, v = rec["chassis/position_z"], rec["chassis/velocity_x"]
    late = rec.time > 2.0
    assert z[late].mean() - z[0] == pytest.approx(0.6, abs=0.01)
    lossless = math.sqrt(36.0 - 2 * G * 0.6 / (1 + ROLLING / MASS))
    assert 0.98 * lossless < v[late].mean() < lossless  # the dashpots take some at both bends
    # on the way its wheels stand where the ramp is: nose up by its slope
    assert math.degrees(rec["chassis/pitch"].min()) < -0.7 * math.degrees(math.atan(0.6 / 5.0))


def test_an_engine_s_work_is_what_the_tractor_gains() -> None:
    """Drive torque 4 kN m on an open axle: F = T/r less what the wheels take; and its limit holds."""
    drive = {"torque": 4000.0, "rise_time": 0.0}
    result = done(run(driving({"initiation.drive": drive})))
    v = result.recording["chassis/velocity_x"]
    assert (v[-1] - v[200]) / 0.8 == pytest.approx(4000.0 / 0.70 / (MASS + ROLLING), rel=0.02)
    assert -result.ledger["drive"] == pytest.approx(result.ledger["kinetic"] - 0.5 * (MASS + ROLLING) * 4.0, rel=0.05)
    limited = done(run(driving({"initiation.drive": {**drive, "limit_rate": 3.0}}, duration=2.0)))
    assert limited.recording["wheel/rear_left/spin"].max() < 3.05  # it rocks on its tyres


def test_a_locked_axle_turns_both_wheels_alike() -> None:
    """One rear wheel on ice: open, it spins away; locked, the other one takes along what it cannot hold."""
    ice = {"vehicle.wheels.rear_left.tyre.friction": 0.02}
    apart = []
    for kind in ("open", "locked"):
        drive = {"torque": 4000.0, "rise_time": 0.0, "differential": kind}
        rec = done(run(driving({**ice, "initiation.drive": drive}, duration=0.5))).recording
        apart.append(abs(rec["wheel/rear_left/spin"][-1] - rec["wheel/rear_right/spin"][-1]))
    assert apart[0] > 5.0
    assert apart[1] < 0.5


def test_steered_front_wheels_turn_it_to_that_side() -> None:
    rec = done(run(driving({"initiation.steer_deg": 10.0}, duration=3.0))).recording
    # L/tan(steer) = 12.8 m: 2 m/s turns by 0.157 rad/s
    assert rec["chassis/angular_velocity_z"][-2000:].mean() == pytest.approx(
        2.0 * math.tan(math.radians(10)) / 2.25, rel=0.1
    )


def rear_times(ratio: float) -> tuple[float, float]:
    """Times (s) to the balance and to 110 degrees of a rigid tractor that pivots at the rear ground contact.

    I w^2/2 = T th - M g (r sin(th + f) - r sin f), r = |(a, h)|, f = atan(h/a), T = ratio M g a; t = int dth/w.
    """
    inertia, r, f = 3000.0 + MASS * (A**2 + H**2), math.hypot(A, H), math.atan(H / A)

    def slowness(root: float) -> float:
        th = root * root  # the pole at rest is that of a square root
        work = ratio * MASS * G * A * th - MASS * G * r * (math.sin(th + f) - math.sin(f))
        return 2.0 * root / math.sqrt(2.0 * work / inertia)

    return tuple(quad(slowness, 1e-9, math.sqrt(to))[0] for to in (math.pi / 2 - f, math.radians(110.0)))  # type: ignore[return-value]


def test_rear_overturn_against_the_rigid_tractor() -> None:
    """Stuck wheels, so that it turns about the axle: I w^2/2 = T th - M g [a sin th + (h - r)(cos th - 1)].

    I = Iyy + M (a^2 + (h - r)^2) without the wheels that the ground holds. Stiff tyres; compared at 30 and 60 degrees
    of pitch, where the chassis' rate is that of the energy. On its back in less than 1.5 s, as the rule of thumb says.
    """
    assert math.degrees(math.atan(A / H)) == pytest.approx(47.7, abs=0.05)
    for ratio in (1.5, 2.0):
        balance, ground = rear_times(ratio)
        assert 0.6 < balance < 0.9
        assert 0.85 < ground < 1.3
    stiff = {f"vehicle.wheels.{w}.tyre.vertical_stiffness": 2e7 for w in ("rear_left", "rear_right")}
    stiff |= {f"vehicle.wheels.{w}.tyre.lateral_stiffness": 2e7 for w in ("rear_left", "rear_right")}
    stiff |= {f"vehicle.wheels.{w}.tyre.friction": 2.0 for w in ("rear_left", "rear_right")}
    base = shipped("rear_overturn")
    torque = 1.75 * MASS * G * A
    at_once = {"initiation.drive": {"torque": torque, "rise_time": 0.0}}
    rec = run(base.replaced({**stiff, **at_once, "simulation.duration": 1.0, "simulation.step": 2e-4})).recording
    pitch, rate = -rec["chassis/pitch"], -rec["chassis/angular_velocity_y"]
    arm = H - 0.675  # the wheels' centres as they are drawn
    inertia = 3000.0 - 2 * 45.0 + MASS * (A**2 + arm**2)
    for degrees in (30.0, 60.0):
        th = math.radians(degrees)
        k = int(np.argmax(pitch > th))
        work = torque * th - MASS * G * (A * math.sin(th) + arm * (math.cos(th) - 1.0))
        assert rate[k] == pytest.approx(math.sqrt(2.0 * work / inertia), rel=0.04), degrees
    shown = done(run(base))
    landed = next(e.time for e in shown.events if e.kind == "first-touch" and e.subject == "rops")
    assert landed < 1.5


@pytest.mark.parametrize(
    ("name", "roll"),
    [("field_upset_side", 90.0), ("bank_overturn", 60.0), ("kerb_trip", 30.0), ("multiple_roll", 360.0)],
)
def test_scenarios_overturn_and_their_ledger_closes(name: str, roll: float) -> None:
    result = done(run(shipped(name)))
    assert np.degrees(np.abs(result.recording["chassis/roll"]).max()) > roll


def test_a_slope_across_turns_a_rear_overturn_to_the_side() -> None:
    """Straight backward on level ground; nearly so, but to the side that lies lower, where it climbs obliquely."""
    level, slight, steep = (direction(climbing(angle)) or 0.0 for angle in (0.0, 10.0, 30.0))
    assert level < 0.1
    assert 0.3 < slight < 0.5 * steep < 22.0


def test_a_blow_on_its_carrier_does_not_turn_a_wheel() -> None:
    """spin + omega . e stays, e the axle: no torque passes a bearing at once."""
    scenario = driving({"initiation.steer_deg": 10.0})
    bodies = bodies_of(scenario.vehicle, scenario.ground.elements)
    t = tables_of(scenario, bodies)
    rng, n = np.random.default_rng(4), 6 * len(bodies)
    before, after = rng.normal(size=(2, n + 4))
    after[n:] = before[n:]
    keep_spins(handle(t), before, after)
    for w, b in enumerate(t.wheel_i.tolist()):
        turned = (after - before)[6 * b + 3 : 6 * b + 6]
        assert abs(turned[1]) > 0.01
        assert after[n + w] - before[n + w] == pytest.approx(-float(turned @ t.wheel_f[w, W_AXIS : W_AXIS + 3]))


def spun(**drive: float) -> Run:
    """A tractor whose rear wheels are driven from rest, nothing holding them."""
    return run(
        shipped("rear_overturn").replaced(
            {
                "initiation": {"kind": "driving", "speed": 0.0, "drive": {"rise_time": 0.1, **drive}},
                "simulation.duration": 1.5,
            }
        )
    )


def test_a_wheel_that_runs_away_is_named_with_what_is_missing() -> None:
    """Half a second off the ground at 200 kN m on two wheels of some 100 kg m2: a thousand rad/s."""
    failed = spun(torque=2e5)
    assert failed.status == "failed"
    assert failed.sentence.startswith("wheel rear_left runs away at t = 0.")
    assert "driven with 200000 N m and no limit; initiation.drive.limit_rate (rad/s) is needed" in failed.sentence
    rate = float(failed.sentence.split("it turns at ")[1].split(" rad/s")[0])
    assert rate == pytest.approx(abs(failed.recording["wheel/rear_left/spin"][-1]), rel=0.01)


@pytest.mark.parametrize("torque", [2e4, -2e4])
def test_the_limit_of_the_engine_holds_forward_and_backward(torque: float) -> None:
    done = spun(torque=torque, limit_rate=8.0)
    assert done.status == "done"
    spin = np.abs(done.recording["wheel/rear_left/spin"])
    assert 7.0 < spin.max() < 9.5
