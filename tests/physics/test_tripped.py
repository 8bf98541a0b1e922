"""Ditch, ramp, braked descent and dolly against closed forms; machines overturn and their ledger closes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from rollover.dynamics.result import Run
from rollover.dynamics.simulate import run
from rollover.scenario import Scenario
from rollover.spec.document import to_mapping
from rollover.spec.inputs import Shake
from rollover.spec.vehicle import Vehicle, laden
from tests.physics.machines import PAIRS, lean, scene
from tests.physics.scenes import shipped
from tests.physics.test_tipping import S

G = 9.81
MPH, INCH, FOOT = 0.44704, 0.0254, 0.3048


def done(scenario: Scenario) -> Run:
    result = run(scenario.replaced({"simulation.integrator": "compiled"}))
    assert result.status == "done", result.sentence
    assert np.abs(result.recording["energy/residual"]).max() < 5e-3 * result.released
    return result


def stiff(scenario: Scenario, friction: float) -> Scenario:
    """Nearly rigid, flat-treaded tyres without side walls."""
    tyre = {
        "crown": 2e-4, "side_wall": 1e-3, "vertical_stiffness": 4e6, "lateral_stiffness": 4e6,
        "vertical_damping": 2e4, "friction": friction,
    }  # fmt: skip
    return scenario.replaced({f"vehicle.wheels.*.tyre.{key}": value for key, value in tyre.items()})


def seat(scenario: Scenario) -> tuple[float, float, float]:
    """Of the laden vehicle: ahead of the rear axle, height, both over stiff tyres, m; and the wheelbase."""
    vehicle = scenario.vehicle
    assert isinstance(vehicle, Vehicle)
    x, _, z = laden(vehicle).centre_of_mass
    front, rear = (next(w for w in vehicle.wheels if w.name == name) for name in ("front_left", "rear_left"))
    base = front.centre[0] - rear.centre[0]
    sunk = [w.tyre.radius - w.centre[2] for w in (rear, front)]  # by which they are drawn deflected
    return x, z + sunk[0] + (sunk[1] - sunk[0]) * x / base, base


# ---------------------------------------------------------------- ditch


def test_in_a_ditch_it_leans_as_the_depth_says() -> None:
    """asin(depth/track) = 15.5 degrees, on stiff tyres and a wide bottom, once it has rocked itself out."""
    wide = {"kind": "ditch", "depth": 0.4, "bottom": 4.0, "angle_deg": 60.0, "centre": [0.0, 3.9]}
    base = stiff(shipped("ditch"), 2.0).replaced(
        {"ground.surface": wide, "initiation.speed": 3.0, "simulation.duration": 3.0}
    )
    rec = done(base).recording
    lean = math.degrees(-rec["chassis/roll"][rec.time > 2.2].mean())
    assert lean == pytest.approx(math.degrees(math.asin(0.4 / 1.5)), abs=0.6)  # 15.0: 10 mm of sinkage more are 0.4


@pytest.mark.parametrize(("depth", "over"), [(0.4, False), (1.1, True)])
def test_it_leans_in_a_shallow_ditch_and_overturns_in_a_deep_one(depth: float, over: bool) -> None:
    """Limit at rest: track sin(34.9 deg) = 0.86 m; half of that leans it by asin(depth/track), and its tyres."""
    rec = done(shipped("ditch").replaced({"ground.surface.depth": depth})).recording
    lean = math.degrees(-rec["chassis/roll"].min())
    assert lean > 60.0 if over else lean < math.degrees(math.asin(depth / 1.5)) + 10.0
    assert bool(rec["rops/force"].max() > 0.0) is over


# ---------------------------------------------------------------- corkscrew ramp


@pytest.mark.parametrize(("share", "over"), [(0.7, False), (1.06, True)])
def test_a_ramp_overturns_at_track_times_sine_of_the_balance(share: float, over: bool) -> None:
    """Up a ramp with a level top: the left wheels stand asin(H/track) high, balance atan(s/h), H = track sin of that.

    It rolls on its own speed, and a little below that height what it turns with carries it over: v (H/8)/(track cos) is
    0.3 rad/s, 60 J, and more as the front left wheel gets to the top before the rear one. 0.7 of it is enough below.
    """
    base = stiff(shipped("corkscrew_ramp"), 2.0)
    x, h, wheelbase = seat(base)
    s = 0.635 + 0.5 * (0.28 + (0.23 - 0.28) * x / wheelbase)  # to the line of the tyres' outer edges
    height = share * 1.27 * math.sin(math.atan(s / h))
    ramp = {"kind": "ramp", "length": 8.0, "height": height, "width": 0.8, "top": 8.0, "start": [2.4, 0.635]}
    changes = {"ground.surface": ramp, "initiation.speed": 4.0, "simulation.duration": 5.0}
    rigid = {f"vehicle.wheels.{w.name}.suspension": None for w in base.vehicle.wheels}  # as the closed form has it
    rec = done(
        base.replaced({**changes, **rigid, "vehicle.outline": []})
    ).recording  # whose floor would bear on the ramp
    roll = rec["chassis/roll"]
    assert bool(math.degrees(roll.max()) > 80.0) is over
    if not over:  # on the top it leans as the height of its wheels says
        top = math.degrees(np.median(roll[rec.time > 4.4]))
        assert top == pytest.approx(math.degrees(math.asin(height / 1.27)), abs=2.0)


def test_the_ramp_overturns_the_side_by_side_above_a_speed() -> None:
    """Not at 5 m/s, at which it comes back on its wheels; at the 10 m/s of the scenario it does."""
    slow = done(shipped("corkscrew_ramp").replaced({"initiation.speed": 5.0, "simulation.duration": 4.0})).recording
    assert math.degrees(slow["chassis/roll"].max()) < 48.5
    assert abs(math.degrees(slow["chassis/roll"][-1])) < 5.0
    assert math.degrees(done(shipped("corkscrew_ramp")).recording["chassis/roll"].max()) > 90.0


# ---------------------------------------------------------------- forward pitch


def braked(friction: float, slope_deg: float, **changes: Any) -> Scenario:
    """The quad bike on stiff tyres, sliding down a plane on locked wheels."""
    return stiff(shipped("forward_pitch"), friction).replaced(
        {
            "ground.surface": {"kind": "slope", "angle_deg": slope_deg, "direction_deg": 180.0},
            "initiation": {"kind": "driving", "speed": 12.0, "brake": {"torque": 1e5}},
            "simulation.duration": 0.7,
            **changes,
        }
    )


@pytest.mark.parametrize("slope_deg", [0.0, 15.0])
def test_braking_takes_load_off_the_rear_wheels(slope_deg: float) -> None:
    """Locked wheels slide: N_rear = m g cos(slope) (b - mu h)/L, b the centre's way behind the front wheels."""
    mu, scenario = 0.5, braked(0.5, slope_deg)
    x, h, wheelbase = seat(scenario)
    rec = done(scenario).recording
    assert isinstance(scenario.vehicle, Vehicle)
    weight = laden(scenario.vehicle).mass * G * math.cos(math.radians(slope_deg))
    rear = rec["wheel/rear_left/force_normal"] + rec["wheel/rear_right/force_normal"]
    late = rec.time > 0.3
    assert rear[late].mean() == pytest.approx(weight * (wheelbase - x - mu * h) / wheelbase, rel=0.02)
    assert rear[late].mean() < 0.65 * weight * (wheelbase - x) / wheelbase


@pytest.mark.parametrize(("share", "over"), [(0.85, False), (1.1, True)])
def test_brakes_pitch_it_over_where_friction_exceeds_b_over_h(share: float, over: bool) -> None:
    """Below, what the sudden blow of the brakes lifts comes down again; above, the nose goes down for good."""
    level = braked(1.0, 15.0)
    x, h, wheelbase = seat(level)
    assert (wheelbase - x) / h > 1.1  # above what tyres have: brakes alone do not do it
    rec = done(braked(share * (wheelbase - x) / h, 15.0)).recording
    nose = np.degrees(rec["chassis/pitch"]) - 15.0
    assert bool(nose[-1] > 10.0) is over
    assert over or nose.max() < 4.0


@pytest.mark.parametrize(("speed", "over"), [(2.5, False), (5.0, True)])
def test_the_ditch_pitches_the_quad_over_above_a_speed(speed: float, over: bool) -> None:
    """3.8 m/s by the account in the scenario's head, of a machine that is stopped at its front hubs."""
    rec = done(shipped("forward_pitch").replaced({"initiation.speed": speed})).recording
    upright = 1.0 - 2.0 * (rec["chassis/quaternion_x"] ** 2 + rec["chassis/quaternion_y"] ** 2)
    assert bool(upright.min() < -0.9) is over
    assert bool(rec["rops/force"].max() > 0.0) is over


# ---------------------------------------------------------------- dolly


def test_the_dolly_stops_as_the_standard_says() -> None:
    """FMVSS 208 S5.3 as recalled: 30 mph to rest within 3 ft, at 20 g for 0.04 s at least; 23 degrees, 4 in, 9 in."""
    scenario = shipped("dolly_rollover")
    (shake,) = scenario.inputs
    assert isinstance(shake, Shake)
    assert shake.acceleration is not None
    time, value = np.array(shake.acceleration.time), np.array(shake.acceleration.value)
    t = np.linspace(time[0], time[-1], 20001)
    a = np.interp(t, time, value)
    gained = np.concatenate([[0.0], np.cumsum(0.5 * (a[1:] + a[:-1]) * np.diff(t))])
    assert -gained[-1] == pytest.approx(30.0 * MPH, rel=1e-3)
    assert np.trapezoid(30.0 * MPH + gained, t) < 3.0 * FOOT
    assert np.sum(a <= -20.0 * 9.80665) * (t[1] - t[0]) > 0.04
    bank, platform, flange = to_mapping(scenario)["ground"]["surface"]["parts"]
    assert math.degrees(math.atan(platform["height"] / platform["length"])) == pytest.approx(23.0, abs=0.02)
    assert (bank["height"], flange["height"]) == pytest.approx((9.0 * INCH, 4.0 * INCH), abs=1e-3)  # given in mm


def test_without_a_flange_it_leaves_the_dolly_at_its_speed() -> None:
    """Nothing holds it: 13.41 m/s sideways but for the tyres' grip in the first ms, then a parabola without a roll."""
    base = shipped("dolly_rollover")
    parts = to_mapping(base)["ground"]["surface"]["parts"]
    free = base.replaced({"ground.surface": {"kind": "sum", "parts": parts[:2]}, "simulation.duration": 0.25})
    rec = done(free).recording
    v, k, n = rec["chassis/velocity_y"], int(np.searchsorted(rec.time, 0.13)), int(np.searchsorted(rec.time, 0.2))
    assert v[k] == pytest.approx(30.0 * MPH, rel=5e-3)
    assert v[n] == pytest.approx(v[k], rel=1e-3)  # what the frame does on its mounts
    fall = rec["chassis/velocity_z"][k] - rec["chassis/velocity_z"][n]
    assert fall == pytest.approx(G * (rec.time[n] - rec.time[k]), rel=5e-3)
    tripped = done(base.replaced({"simulation.duration": 0.25})).recording
    slower = v[k] - tripped["chassis/velocity_y"][k]
    rate = [-r["chassis/angular_velocity_x"][k] for r in (rec, tripped)]
    # what the flange takes acts below the centre of mass: it rolls the vehicle towards its way, by less than if all of
    # it acted 0.69 m below, J z/I with I = 50 kg m2
    assert slower > 0.2
    assert 0.3 < rate[1] - rate[0] < 450.0 * slower * 0.69 / 50.0


# ---------------------------------------------------------------- machines


@pytest.mark.parametrize(("machine", "name"), PAIRS)
def test_every_machine_overturns_where_it_belongs(machine: str, name: str) -> None:
    """For the full time of each scenario: over by 60 degrees and more, onto its frame; the ledger closes throughout."""
    result = done(scene(machine, name))
    assert math.degrees(lean(result)) > 60.0
    if "rops/force" in result.recording.channels:
        assert result.recording["rops/force"].max() > 0.0


def test_the_hoop_stops_the_quad_bike_where_without_it_rolls_on() -> None:
    """A hoop 0.5 m above the seat: on flat ground the roll ends on it; taken off, the machine goes further over."""
    rest = []
    for frame in ({}, {"vehicle.rops": None}):
        rec = done(shipped("side_overturn").replaced({"vehicle": "vehicles/quad_bike.yaml"}).replaced(frame)).recording
        rest.append(math.degrees(-rec["chassis/roll"].min()))
    assert 100.0 < rest[0] < 165.0  # found 148: short of its back
    assert rest[1] > 180.0  # found 220: over it


def test_a_higher_battery_tips_earlier() -> None:
    """h = (2730 h0 + 500 z)/3230, and the balance moves with atan(s/h): 0.7 m of battery are 0.11 m of the centre."""
    lean = []
    for z in (0.5, 1.2):
        tipped = shipped("side_overturn").replaced({"vehicle": "vehicles/electric_tractor.yaml"})
        place = {"vehicle.attached.battery.centre_of_mass": [1.7, 0.0, z], "simulation.duration": 0.01}
        rec = run(tipped.replaced(place)).recording
        lean.append(-rec["chassis/roll"][0])
    centre = [(2730.0 * 0.79 + 500.0 * z) / 3230.0 for z in (0.5, 1.2)]
    rigid = [math.atan(S / h) for h in centre]
    assert lean[0] - lean[1] == pytest.approx(rigid[0] - rigid[1], rel=0.08)  # tyres add 5 %
