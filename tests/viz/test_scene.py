"""Bodies, the rig, and from where they are seen; what is drawn of them is read back in `test_log`."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from rollover.dynamics.result import Run
from rollover.scenario import load
from rollover.spec.inertia import MassProperties
from rollover.spec.initiation import Driving, Throw, TipOver
from rollover.spec.shapes import Disc, Point, Points
from rollover.spec.vehicle import Attached, RigidBody, Striker, Vehicle
from tests.viz import example
from viz.recordings.scene import extent, parts, path_of_centre, rotation
from viz.recordings.solids import Balls, Block, Hull, Rod


def by_path(run: Run) -> dict[str, object]:
    found = {p.path: p for p in parts(run)}
    assert len(found) == len(parts(run))  # each part is an entity of its own
    return found


def with_vehicle(run: Run, vehicle: Vehicle | Striker) -> Run:
    return dataclasses.replace(run, scenario=dataclasses.replace(run.scenario, vehicle=vehicle))


def test_striker_stands_on_its_face_and_weighs_what_it_should(drop: Run) -> None:
    found = by_path(drop)
    nose, mass = found["world/striker/nose"], found["world/striker/mass"]
    assert isinstance(nose, Block)
    assert isinstance(mass, Block)
    striker = drop.scenario.vehicle
    assert isinstance(striker, Striker)
    assert nose.size[:2] == (striker.face_length, striker.face_width)
    assert nose.centre[2] == pytest.approx(0.5 * nose.size[2], rel=1e-12)  # the face lies in the origin's plane
    assert math.prod(mass.size) * 7850.0 == pytest.approx(132.0, rel=1e-12)  # steel
    # the rut is never deeper than the nose is long
    assert nose.size[2] > -drop.motion["striker"].origin[:, 2].min()


def test_guide_reaches_from_the_ground_over_the_block(drop: Run) -> None:
    found = by_path(drop)
    bar, mass = found["world/guide/front"], found["world/striker/mass"]
    assert isinstance(bar, Rod)
    assert isinstance(mass, Block)
    assert bar.start[2] == 0.0
    assert bar.end[2] > drop.motion["striker"].origin[:, 2].max() + mass.centre[2] + 0.5 * mass.size[2]
    assert bar.start[0] - bar.radius > 0.5 * mass.size[0]


def test_vehicle_without_outline_is_its_equivalent_cuboid(overturn: Run) -> None:
    vehicle = overturn.scenario.vehicle
    assert isinstance(vehicle, Vehicle)
    a, b, c, m = 2.4, 1.4, 1.2, 3000.0
    whole = MassProperties(
        mass=m,
        centre_of_mass=(0.3, 0.0, 0.9),
        inertia=(m * (b * b + c * c) / 12, m * (a * a + c * c) / 12, m * (a * a + b * b) / 12),
    )
    rig = dataclasses.replace(vehicle, whole=whole, outline=())
    block = by_path(with_vehicle(overturn, rig))["world/chassis/equivalent_cuboid"]
    assert isinstance(block, Block)
    assert block.size == pytest.approx((a, b, c), rel=1e-9)
    assert block.centre == whole.centre_of_mass


def test_tubes_that_meet_have_a_joint_as_thick_as_the_thickest(overturn: Run) -> None:
    joints = by_path(overturn)["world/rops/joints"]
    assert isinstance(joints, Balls)
    np.testing.assert_allclose(joints.centres, [(-0.25, 0.55, 2.35), (-0.25, -0.55, 2.35)])
    assert joints.radii.tolist() == [0.04, 0.04]


def test_outer_face_of_a_disc_lies_where_it_is_said(overturn: Run) -> None:
    vehicle = overturn.scenario.vehicle
    assert isinstance(vehicle, Vehicle)
    disc = Disc(name="plate", centre=(0.1, 0.9, 0.7), normal=(0.0, 2.0, 0.0), radius=0.4)
    plate = by_path(with_vehicle(overturn, dataclasses.replace(vehicle, outline=(disc,))))["world/chassis/plate"]
    assert isinstance(plate, Rod)
    assert plate.end == disc.centre
    assert plate.start == pytest.approx((0.1, 0.895, 0.7), abs=1e-12)


def test_the_attitude_of_a_wheel_can_be_seen(overturn: Run) -> None:
    wheel = by_path(overturn)["world/chassis/rear_left"]
    assert isinstance(wheel, Hull)
    near_hub = np.hypot(wheel.vertices[:, 0], wheel.vertices[:, 2] - 0.71) < 0.01
    assert len(set(wheel.colours[near_hub].tolist())) == 2
    np.testing.assert_allclose(np.linalg.norm(wheel.normals, axis=1), 1.0, atol=1e-12)


def test_rotation_is_that_of_the_quaternion() -> None:
    half = 0.5 * math.radians(90.0)
    # 90 degrees about z: forward becomes left
    turned = rotation(np.array([0.0, 0.0, math.sin(half), math.cos(half)])) @ np.array([1.0, 0.0, 0.0])
    np.testing.assert_allclose(turned, [0.0, 1.0, 0.0], atol=1e-12)


def test_path_of_the_centre_turns_with_the_vehicle(overturn: Run, drop: Run) -> None:
    centre = path_of_centre(overturn)
    i = 120
    roll = float(np.interp(overturn.frame_time[i], overturn.recording.time, overturn.recording["chassis/roll"]))
    height = overturn.motion["chassis"].origin[i, 2] + 0.78 * math.cos(roll)  # centre of mass 0.78 m up, on the middle
    assert centre[i, 2] == pytest.approx(height, abs=1e-9)
    assert centre.shape == (overturn.frame_time.size, 3)
    assert path_of_centre(drop).shape == (0, 3)


def test_ball_around_the_run_holds_every_wheel_in_every_frame(overturn: Run) -> None:
    centre, radius = extent(overturn)
    vehicle = overturn.scenario.vehicle
    assert isinstance(vehicle, Vehicle)
    for wheel in vehicle.wheels:
        motion = overturn.motion[wheel.carrier]
        places = [o + rotation(q) @ wheel.centre for o, q in zip(motion.origin, motion.quaternion, strict=True)]
        assert np.linalg.norm(np.array(places) - centre, axis=1).max() < radius
    assert extent(overturn, at=0)[1] < radius


@pytest.mark.parametrize(("side", "sign"), [("left", 1.0), ("right", -1.0)])
def test_the_eye_is_where_the_vehicle_falls_to(overturn: Run, side: str, sign: float) -> None:
    blueprint = pytest.importorskip(
        "viz.recordings.blueprint", reason="no rerun wheel for this platform", exc_type=ImportError
    )
    start = TipOver(side=side, heading_deg=90.0)
    run = dataclasses.replace(overturn, scenario=dataclasses.replace(overturn.scenario, initiation=start))
    towards = blueprint._seen_from(run)
    # headed along y, left is -x and behind is -y
    assert towards[0] * sign < 0.0
    assert towards[1] < 0.0
    assert towards[2] > 0.0


@pytest.mark.parametrize("turn_deg", [0.0, 110.0])
def test_the_eye_is_before_a_rops_that_lands_after_a_turn(overturn: Run, turn_deg: float) -> None:
    blueprint = pytest.importorskip(
        "viz.recordings.blueprint", reason="no rerun wheel for this platform", exc_type=ImportError
    )
    half = math.radians(0.5 * turn_deg)
    chassis = overturn.motion["chassis"]
    x, y, z, w = chassis.quaternion.T
    c, s = math.cos(half), math.sin(half)
    about_z = np.stack([c * x - s * y, c * y + s * x, c * z + s * w, c * w - s * z], axis=1)
    vehicle = overturn.scenario.vehicle
    assert isinstance(vehicle, Vehicle)
    vehicle = dataclasses.replace(
        vehicle, wheels=tuple(dataclasses.replace(wheel, inertia=1.0) for wheel in vehicle.wheels)
    )
    run = dataclasses.replace(
        overturn,
        scenario=dataclasses.replace(overturn.scenario, vehicle=vehicle, initiation=Driving(speed=7.0)),
        motion={**overturn.motion, "chassis": dataclasses.replace(chassis, quaternion=about_z)},
    )
    first = int(np.flatnonzero(np.any(overturn.contact["rops"].force, axis=1))[0])
    roof = rotation(about_z[first])[:2, 2]  # from the wheels to the frame
    towards = blueprint._seen_from(run)[:2]
    assert towards @ roof > 0.8 * np.linalg.norm(towards) * np.linalg.norm(roof)


def test_arrows_stay_in_the_picture(overturn: Run) -> None:
    draw = pytest.importorskip("viz.recordings.draw", reason="no rerun wheel for this platform", exc_type=ImportError)
    force = overturn.contact["rops"].force
    own = extent(overturn, at=0)[1]
    longest = np.linalg.norm(force, axis=1).max() / draw.picture(overturn).force
    assert 0.5 * own < longest <= 1.3 * own
    # a chassis that is hit ten times as hard makes the ROPS's arrow shorter, but not ten times
    chassis = dataclasses.replace(overturn.contact["chassis"], force=10.0 * force)
    hit = dataclasses.replace(overturn, contact={**overturn.contact, "chassis": chassis})
    of_chassis = 10.0 * np.linalg.norm(force, axis=1).max() / draw.picture(hit).force
    assert 0.9 * own < of_chassis <= 1.9 * own


def test_soil_is_brightest_where_most_ruts_are_deep(overturn: Run) -> None:
    draw = pytest.importorskip("viz.recordings.draw", reason="no rerun wheel for this platform", exc_type=ImportError)
    sinkage = np.zeros((overturn.track.time.size, overturn.track.element.size))
    sinkage[-1] = 0.03
    sinkage[-1, 0] = 0.4
    deep = dataclasses.replace(overturn, track=dataclasses.replace(overturn.track, sinkage=sinkage))
    assert draw.picture(deep).soil == pytest.approx(0.05, rel=1e-9)
    assert draw.picture(deep).scales[1] == "soil yellow from 50 mm"


def test_a_run_without_frames_still_has_an_extent() -> None:
    run = dataclasses.replace(example.drop(), motion={}, frame_time=np.zeros(0))
    centre, radius = extent(run)
    assert np.all(np.isfinite(centre))
    assert radius > 0.0


def test_upper_and_carried_parts_hang_under_their_bodies(overturn: Run) -> None:
    vehicle = load("side_overturn").replaced({"vehicle": "vehicles/compact_tractor_folding.yaml"}).vehicle
    assert isinstance(vehicle, Vehicle)
    found = by_path(with_vehicle(overturn, vehicle))
    bar, post = found["world/rops_upper/crossbar"], found["world/rops/post_left"]
    assert isinstance(bar, Rod)
    assert isinstance(post, Rod)
    assert bar.colour != post.colour
    assert "world/rops/crossbar" not in found
    hinges = found["world/rops/hinges"]
    assert isinstance(hinges, Balls)
    assert hinges.centres[:, 2] == pytest.approx([1.45, 1.45])
    weights, driver = found["world/chassis/ballast/weights"], found["world/chassis/driver/mass"]
    assert isinstance(weights, Block)
    assert isinstance(driver, Block)
    assert weights.size == pytest.approx((0.30, 0.60, 0.30))
    assert not weights.see_through
    assert driver.see_through  # it cannot touch anything
    assert driver.size == pytest.approx((0.40, 0.45, 0.85))


def test_the_centre_that_is_followed_is_the_laden_one(overturn: Run) -> None:
    vehicle = overturn.scenario.vehicle
    assert isinstance(vehicle, Vehicle)
    heavy = Attached(name="tank", mass=vehicle.whole.mass, centre_of_mass=(5.0, 0.0, 2.0), size=(1.0, 1.0, 1.0))
    before = path_of_centre(overturn)
    after = path_of_centre(with_vehicle(overturn, dataclasses.replace(vehicle, attached=(heavy,))))
    way = 0.5 * (np.array([5.0, 0.0, 2.0]) - np.array(vehicle.whole.centre_of_mass))
    assert np.linalg.norm(after - before, axis=1) == pytest.approx(np.linalg.norm(way), rel=1e-9)


def body(run: Run, *at: Point) -> dict[str, object]:
    """What is drawn of a body that touches with these points."""
    whole = MassProperties(mass=1.0, centre_of_mass=(0.0, 0.0, 0.0), inertia=(1.0, 1.0, 1.0))
    outline = (Points(name="corners", at=at, area=0.1),)
    vehicle = RigidBody(name="body", whole=whole, outline=outline)
    scenario = dataclasses.replace(run.scenario, vehicle=vehicle, initiation=Throw(position=(0.0, 0.0, 1.0)))
    return by_path(dataclasses.replace(run, scenario=scenario))


def test_a_body_of_corners_is_drawn_with_outward_sides(overturn: Run) -> None:
    corners = [(x, y, z) for x in (-1.0, 1.0) for y in (-0.5, 0.5) for z in (-0.25, 0.25)]
    hull = body(overturn, *corners)["world/chassis/corners"]
    assert isinstance(hull, Hull)
    a, b, c = (hull.vertices[hull.triangles[:, k]] for k in range(3))
    cross = np.cross(b - a, c - a)
    assert float(np.linalg.norm(cross, axis=1).sum()) / 2.0 == pytest.approx(2.0 * (2.0 + 1.0 + 0.5), rel=1e-12)
    # volume by the divergence theorem: positive only if the triangles turn outwards
    assert float(np.sum(a * cross)) / 6.0 == pytest.approx(2.0 * 1.0 * 0.5, rel=1e-12)
    assert np.sum(cross * hull.normals[hull.triangles[:, 0]], axis=1) == pytest.approx(np.linalg.norm(cross, axis=1))
    # the two triangles of a side share a shade
    assert all(len({int(s) for s in hull.colours[np.all(hull.normals == n, axis=1)]}) == 1 for n in hull.normals)


def test_corners_that_span_no_body_are_balls(overturn: Run) -> None:
    drawn = body(overturn, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (1.0, 1.0, 0.0))["world/chassis/corners"]
    assert isinstance(drawn, Balls)
    assert len(drawn.centres) == 4


def test_a_cone_nose_stands_on_its_tip(drop: Run) -> None:
    striker = Striker(nose="cone", nose_radius=0.1, nose_height=0.3)
    found = by_path(with_vehicle(drop, striker))
    nose, shaft = found["world/striker/nose"], found["world/striker/shaft"]
    assert isinstance(nose, Hull)
    assert isinstance(shaft, Rod)
    assert nose.vertices.min(axis=0) == pytest.approx([-0.1, -0.1, 0.0])
    assert nose.vertices.max(axis=0) == pytest.approx([0.1, 0.1, 0.3])
    a, b, c = (nose.vertices[nose.triangles[:, k]] for k in range(3))
    assert np.all(np.sum(np.cross(b - a, c - a) * nose.normals[::3], axis=1) > 0.0)
    assert (shaft.start[2], shaft.radius) == (0.3, 0.1)
