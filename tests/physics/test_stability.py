"""Static stability against heading: closed forms for stiff tyres, a derivation with the tyres' give, the tilt table."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from rollover.assessment.stability import SLIPS, StabilityAngle, losses, stability_angles
from rollover.dynamics.support import closed_form, turning_slope
from rollover.scenario import AnyVehicle, Scenario
from rollover.spec import document
from rollover.spec.inertia import MassProperties, combined
from rollover.spec.vehicle import Attached, Vehicle
from rollover.system.errors import InputError
from tests.physics.scenes import SHIPPED, shipped
from tests.physics.test_tipping import HP, A, H, L, M, S, rigid_tractor


def vehicle(name: str) -> Vehicle:
    found = document.load(SHIPPED / "vehicles" / f"{name}.yaml", AnyVehicle)
    assert isinstance(found, Vehicle)
    return found


def standing(name: str) -> Scenario:
    return replace(rigid_tractor(swing_deg=None), vehicle=vehicle(name))


def at(scenario: Scenario, heading_deg: float) -> StabilityAngle:
    (found,) = stability_angles(scenario, np.radians([heading_deg]))
    return found


def stiff(swing_deg: float | None, heading_deg: float) -> tuple[Scenario, StabilityAngle]:
    scenario = rigid_tractor(swing_deg=swing_deg)
    return scenario, at(scenario, heading_deg)


def with_light_axle(name: str) -> Vehicle:
    """The vehicle with an axle of next to no weight, front tyres as narrow as lines."""
    v = vehicle(name)
    assert v.front_axle is not None
    light = MassProperties(mass=1e-3, centre_of_mass=v.front_axle.pivot, inertia=(1e-3, 1e-3, 1e-3))
    wheels = tuple(replace(w, tyre=replace(w.tyre, width=1e-6)) if w.carrier == "front_axle" else w for w in v.wheels)
    return replace(v, front_axle=replace(v.front_axle, body=light), wheels=wheels)


@pytest.mark.parametrize(
    ("name", "free", "rigid"),
    [("utility_tractor", (43.8, 36.9), (46.6, 42.1)), ("vineyard_tractor", (33.7, 27.3), (38.1, 34.2))],
)
def test_closed_forms_across_the_slope(name: str, free: tuple[float, float], rigid: tuple[float, float]) -> None:
    """tan b1 = s (1 - a/L)/(h - h_p a/L) and tan b2 = [s_r (1 - a/L) + s_f a/L]/h, unequal tracks too.

    First: the moment of the weight about the line from the rear tyre (0, s, 0) to the pivot (L, 0, h_p) vanishes; at
    x = a that line stands s (1 - a/L) beside the middle and h_p a/L high. Second: the line to the front tyre
    (L, s_f, 0), which there stands s_r (1 - a/L) + s_f a/L beside it, on the ground. For the rear tyres' outer edges
    and the middle of the front ones, and for the middle of both, as published for these two tractors.
    """
    v = with_light_axle(name)
    rear, front = (next(w for w in v.wheels if w.name == f"{end}_left") for end in ("rear", "front"))
    a, _, h = v.whole.centre_of_mass
    assert v.front_axle is not None
    wheelbase, _, pivot = v.front_axle.pivot
    for k, outer in enumerate((True, False)):
        found = closed_form(v, math.radians(90.0), outer=outer)
        s = rear.centre[1] + (0.5 * rear.tyre.width if outer else 0.0)
        share = a / wheelbase
        assert found.free_pivot == pytest.approx(math.atan(s * (1 - share) / (h - pivot * share)), rel=1e-3)
        assert found.rigid == pytest.approx(math.atan((s * (1 - share) + front.centre[1] * share) / h), rel=1e-3)
        assert math.degrees(found.free_pivot or 0.0) == pytest.approx(free[k], abs=0.06)
        assert math.degrees(found.rigid) == pytest.approx(rigid[k], abs=0.06)


def test_closed_form_over_the_axles_and_of_a_body_that_falls() -> None:
    """Uphill tan b = a/h over the rear wheels, downhill (L - a)/h; a centre outside its support stands on no slope."""
    v = rigid_tractor(swing_deg=20.0).vehicle
    assert isinstance(v, Vehicle)
    for heading, arm in ((0.0, A), (180.0, L - A)):
        found = closed_form(v, math.radians(heading))
        assert found.rigid == pytest.approx(math.atan(arm / H), rel=1e-9)
        assert found.free_pivot == pytest.approx(found.rigid)
    # over the rear wheels a heavy axle comes along
    found = closed_form(vehicle("light_vehicle"), 0.0)
    assert found.free_pivot == found.rigid == pytest.approx(math.atan(0.5 / 0.52), rel=1e-9)
    square = [np.array([x, y, 0.0]) for x in (-1.0, 1.0) for y in (-1.0, 1.0)]
    assert turning_slope(square, np.array([0.0, 0.0, 1.0]), 1.0) == pytest.approx(math.atan(1.0 / math.sin(1.0)))
    assert turning_slope(square, np.array([1.1, 0.0, 1.0]), 1.0) == 0.0


@pytest.mark.parametrize("heading_deg", range(0, 360, 30))
def test_stiff_tyres_without_a_pivot(heading_deg: float) -> None:
    """tan b = r x e . z/(r x e . d), the least over the rectangle of the tyres' outer edges."""
    scenario, found = stiff(None, heading_deg)
    assert isinstance(scenario.vehicle, Vehicle)
    expected = closed_form(scenario.vehicle, math.radians(heading_deg)).rigid
    d = math.radians(heading_deg)
    over = [(A if math.cos(d) > 0 else L - A) / abs(math.cos(d)), S / max(abs(math.sin(d)), 1e-9)]
    assert expected == pytest.approx(math.atan(min(over) / H), rel=1e-9)
    assert found.overturn == pytest.approx(expected, rel=0.01)
    assert found.phase_one is None
    assert found.stop is None


@pytest.mark.parametrize("heading_deg", range(0, 360, 30))
def test_stiff_tyres_on_a_free_pivot(heading_deg: float) -> None:
    """The edge is the line from the lower rear tyre's outer edge to the pivot, or that of an axle.

    With r = (a, -s, h) from the tyre and e = (L, -s, h_p): tan b = s (L - a)/(-cos s (h - h_p) + sin (h L - h_p a)),
    the heading taken to either side.
    """
    scenario, found = stiff(20.0, heading_deg)
    assert isinstance(scenario.vehicle, Vehicle)
    c, s = math.cos(math.radians(heading_deg)), abs(math.sin(math.radians(heading_deg)))
    below = -c * S * (H - HP) + s * (H * L - HP * A)
    line = math.atan(S * (L - A) / below) if below > 0.0 else math.inf
    axle = math.atan((A if c > 0 else L - A) / (H * max(abs(c), 1e-9)))
    assert closed_form(scenario.vehicle, math.radians(heading_deg)).free_pivot == pytest.approx(
        min(line, axle), rel=2e-3
    )
    assert found.balance == pytest.approx(min(line, axle), rel=0.01)
    if line < axle:
        assert found.phase_one == found.balance
        assert {f"rear_{'right' if heading_deg < 180 else 'left'}"} <= set(found.first_off)
    else:
        assert found.phase_one is None


@pytest.mark.parametrize("heading_deg", range(0, 360, 30))
def test_stiff_tyres_with_the_stop_engaged(heading_deg: float) -> None:
    """With hardly any swing the axle is part of the vehicle: the rectangle again, once the stop is met."""
    scenario, found = stiff(0.01, heading_deg)
    assert isinstance(scenario.vehicle, Vehicle)
    assert found.overturn == pytest.approx(closed_form(scenario.vehicle, math.radians(heading_deg)).rigid, rel=0.01)
    across = heading_deg % 180 != 0
    assert (found.stop is not None) == across
    if found.stop is not None:
        assert found.stop < found.overturn
    # a stop that is met with all wheels on the ground ends no balance on the pivot
    assert (found.phase_one is not None) == (found.stop is not None and found.lift_off <= found.stop)


@pytest.mark.parametrize("swing_deg", [1.5, 3.0])
def test_fall_onto_the_stop_that_holds(swing_deg: float) -> None:
    """Past the free pivot's end the chassis turns until the axle meets its stop, and stands on until it is rigid.

    It has turned by p about the unit vector u along e = (L, -s, h_p), whose part about the pivot's axis, p u_x, is the
    swing to first order. The centre of mass is carried to r' = u (u . r) + (r - u (u . r)) cos p + u x r sin p; the
    edge is now that of the two lower tyres, along x: tan b = -r'_y/r'_z.
    """
    _, found = stiff(swing_deg, 90.0)
    first = math.atan(S * (1 - A / L) / (H - HP * A / L))
    u = np.array([L, -S, HP]) / math.sqrt(L**2 + S**2 + HP**2)
    r, p = np.array([A, -S, H]), -math.radians(swing_deg) / u[0]
    turned = u * (u @ r) + (r - u * (u @ r)) * math.cos(p) + np.cross(u, r) * math.sin(p)
    then = math.atan(-turned[1] / turned[2])
    assert first < then < math.atan(S / H)
    assert found.phase_one == pytest.approx(first, rel=0.01)
    assert found.stop == found.phase_one
    assert found.overturn == pytest.approx(then, rel=0.01)


def test_weight_of_a_low_axle_does_not_load_the_pivot() -> None:
    """The closed form's mass is what the pivot carries: with 600 kg of axle 0.3 m below it, the chassis alone.

    The whole has its centre of mass where it was. With M' = M - m, M' a' = M a - m L, M' h' = M h - m (h_p - d), the
    formula becomes s M (1 - a/L)/(M (h - h_p a/L) + m d): an axle whose weight hangs in the pivot changes nothing.
    """
    scenario = rigid_tractor(swing_deg=20.0)
    v = scenario.vehicle
    assert isinstance(v, Vehicle)
    assert v.front_axle is not None
    heavy = MassProperties(mass=600.0, centre_of_mass=(L, 0.0, HP - 0.3), inertia=(100.0, 60.0, 100.0))
    loaded = replace(v, front_axle=replace(v.front_axle, body=heavy))
    expected = math.atan(S * M * (1 - A / L) / (M * (H - HP * A / L) + 600.0 * 0.3))
    assert closed_form(loaded, 0.5 * math.pi).free_pivot == pytest.approx(expected, rel=1e-9)
    assert at(replace(scenario, vehicle=loaded), 90.0).phase_one == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("name", ["vineyard_tractor", "light_vehicle"])
def test_real_tyres_as_derived(name: str) -> None:
    """First lift-off across the slope, to 0.5 percent: what tyre deflection and a round tread take of the stiff angle.

    The axle passes on no moment about the pivot P, so the weight of all but the axle has none about the line from P to
    the lower rear tread's lowest point C: u . ((G - C) x g) = 0, g turned against the body by slope and roll. The
    upper tyre is just unloaded, the lower one pressed in by d = m g cos b (1 - x_G/L)/k_z, so the roll is d/track; a
    tread R - c (2y/w)^2 at that camber stands on y = w^2 tan/(8 c) outside its middle.
    """
    v = vehicle(name)
    assert v.front_axle is not None
    chassis = combined([v.whole], less=[v.front_axle.body])
    m, G, P = chassis.mass, np.array(chassis.centre_of_mass), np.array(v.front_axle.pivot)
    wheel = next(w for w in v.wheels if w.name == "rear_left")
    tyre = wheel.tyre

    def moment(b: float) -> float:
        roll = m * 9.81 * math.cos(b) * (1 - G[0] / P[0]) / tyre.vertical_stiffness / (2 * wheel.centre[1])
        y = tyre.width**2 * math.tan(roll) / (8 * tyre.crown)
        C = np.array(wheel.centre) + np.array([0.0, y, tyre.crown * (2 * y / tyre.width) ** 2 - tyre.radius])
        g = np.array([0.0, math.sin(b + roll), -math.cos(b + roll)])
        return float((P - C) @ np.cross(G - C, g))

    expected = brentq(moment, math.radians(15.0), math.radians(50.0))
    found = at(standing(name), 90.0)
    assert found.lift_off == pytest.approx(expected, rel=0.005)
    assert found.first_off == ("rear_right",)
    # well below tyres that bear on their outer edges, and below even those that bear in their middle
    middle = closed_form(v, math.radians(90.0), outer=False).free_pivot
    assert middle is not None
    assert found.balance < middle


def test_left_and_right_are_alike_and_ballast_is_not() -> None:
    v = vehicle("utility_tractor")
    scenario = replace(standing("utility_tractor"), vehicle=v)
    left, right = stability_angles(scenario, np.radians([75.0, 285.0]))
    for key in ("lift_off", "phase_one", "stop", "overturn"):
        assert getattr(left, key) == pytest.approx(getattr(right, key), abs=math.radians(0.03))
    block = Attached(name="block", mass=150.0, centre_of_mass=(0.5, 0.4, 1.0), size=(0.3, 0.3, 0.3))
    left, right = stability_angles(replace(scenario, vehicle=replace(v, attached=(block,))), np.radians([90.0, 270.0]))
    assert right.balance - left.balance > math.radians(1.0)


def test_what_parts_cost() -> None:
    """With nearly rigid tyres the closed form gives each loss; a load on the ROPS counts."""
    light = standing("light_vehicle")
    v = light.vehicle
    assert isinstance(v, Vehicle)
    hard = {f"vehicle.wheels.{end}_{side}.tyre.{key}": value for end in ("rear", "front") for side in ("left", "right")
            for key, value in (("vertical_stiffness", 4e6), ("lateral_stiffness", 4e6), ("crown", 2e-4))}  # fmt: skip
    lamp = Attached(name="lamp", mass=20.0, centre_of_mass=(-0.1, 0.0, 1.7), size=(0.1, 0.1, 0.1), carried_by="rops")
    stiff = replace(light, vehicle=replace(v, attached=(lamp,))).replaced(hard)
    rops, load, driver = losses(stiff)
    assert (rops.part, load.part, driver.part) == ("ROPS", "lamp", "driver of 75 kg")
    assert isinstance(stiff.vehicle, Vehicle)
    assert v.rops is not None
    with_all = closed_form(stiff.vehicle, math.radians(90.0)).free_pivot
    without_lamp = closed_form(replace(stiff.vehicle, attached=()), math.radians(90.0)).free_pivot
    bare = replace(
        stiff.vehicle,
        whole=combined([v.whole], less=[v.rops.body]),
        rops=None,
        attached=(replace(lamp, carried_by="chassis"),),
    )
    without_rops = closed_form(bare, math.radians(90.0)).free_pivot
    assert with_all is not None
    assert without_lamp is not None
    assert without_rops is not None
    assert load.share == pytest.approx(1.0 - with_all / without_lamp, abs=0.003)
    assert rops.share == pytest.approx(1.0 - with_all / without_rops, abs=0.003)
    assert 0.0 < rops.share < load.share < 0.15
    assert driver.without == rops.beside


def test_the_same_as_the_tilt_table() -> None:
    """The dynamic tilt table lifts, meets the stop and overturns within half a degree of the statics."""
    from rollover.dynamics.simulate import run

    scenario = shipped("tilt_table").replaced({"initiation.from_deg": 34.3, "simulation.duration": 9.0})
    (table,) = run(scenario).tests
    found = at(scenario, 90.0)
    assert found.stop is not None
    assert math.degrees(found.lift_off) == pytest.approx(table["first_lift_off_deg"], abs=0.5)
    assert math.degrees(found.stop) == pytest.approx(table["stop_contact_deg"], abs=0.5)
    assert math.degrees(found.overturn) == pytest.approx(table["unstable_deg"], abs=0.5)


@pytest.mark.parametrize("heading_deg", [165.0, 180.0])
def test_front_wheels_that_roll_without_an_axle(heading_deg: float) -> None:
    """Downhill the locked rear wheels alone hold it, until they all but lift: stiff tyres, the rigid closed form.

    b cos(a) - h sin(a) is their load over that on level ground times b: 0.02 of it are 0.02 b/(b sin(a) + h cos(a)) of
    slope before they carry nothing.
    """
    quad = standing("quad_bike")
    assert isinstance(quad.vehicle, Vehicle)
    changes: dict[str, object] = {f"vehicle.wheels.{w}.rolls": True for w in ("front_left", "front_right")}
    for wheel in quad.vehicle.wheels:
        for key, value in (("vertical_stiffness", 4e6), ("lateral_stiffness", 4e6), ("crown", 2e-4)):
            changes[f"vehicle.wheels.{wheel.name}.tyre.{key}"] = value
    scenario = quad.replaced(changes)
    assert isinstance(scenario.vehicle, Vehicle)
    rigid = closed_form(scenario.vehicle, math.radians(heading_deg)).rigid
    b, h = 1.27 - 0.563, 0.583
    slips = SLIPS * b / (b * math.sin(rigid) + h * math.cos(rigid))
    assert 0.99 * (rigid - slips) < at(scenario, heading_deg).overturn < 1.01 * rigid


def test_a_vehicle_with_a_trailer_is_refused() -> None:
    with pytest.raises(InputError, match="with a trailer; one without"):
        at(standing("tractor_trailer"), 90.0)


def test_what_does_not_stand_says_so() -> None:
    scenario = rigid_tractor(swing_deg=None)
    with pytest.raises(InputError, match="does not stand on level ground"):
        at(scenario.replaced({"vehicle.whole.centre_of_mass": [A, 1.2, H]}), 0.0)
    with pytest.raises(InputError, match="needs wheels to stand on"):
        at(shipped("rops_drop").replaced({"vehicle.wheels": []}), 0.0)
