"""Clearance zone: signed distances worked out by hand, moving structure, ground plane, and what hull protects it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rollover.assessment.clearance import approaches, protected_margin, signed_distance
from rollover.dynamics.result import Motion
from rollover.scenario import load
from rollover.spec.frames import from_angles
from rollover.spec.rops import ClearanceZone
from rollover.spec.shapes import Box, sample
from rollover.spec.vehicle import Vehicle
from tests.physics.scenes import shipped
from tests.viz import example

ZONE = ClearanceZone(seat_reference_point=(0.30, 0.0, 1.15))


@pytest.mark.parametrize(
    ("point", "distance"),
    [
        ((0.0, 0.0, 1.30), 0.30),  # behind the rear plane
        ((1.15, 0.0, 1.30), 0.30),  # ahead of the front plane, which stands at 0.85
        ((0.50, 0.40, 1.30), 0.15),  # beside the upright plane at 0.25
        ((0.50, -0.40, 1.30), 0.15),
        ((0.50, 0.0, 2.35), 0.30),  # above the top at 2.05
        ((0.50, 0.20, 1.30), -0.05),  # inside, 0.05 from the upright plane
        ((0.50, 0.0, 2.00), -0.05),
        ((0.00, 0.65, 1.30), 0.50),  # behind and beside: 3-4-5
    ],
)
def test_signed_distance_by_hand(point: tuple[float, float, float], distance: float) -> None:
    assert float(signed_distance(ZONE, np.array(point))) == pytest.approx(distance, abs=1e-12)


def test_distance_to_the_leaning_plane() -> None:
    """The plane leans from (0.25, 1.45) to (0.15, 2.05): a point 0.1 along its outward normal is 0.1 away."""
    a, b = np.array([0.25, 1.45]), np.array([0.15, 2.05])
    n = np.array([b[1] - a[1], a[0] - b[0]]) / np.hypot(*(b - a))
    middle = 0.5 * (a + b)
    for sign in (1.0, -1.0):
        y, z = middle + sign * 0.1 * n
        assert float(signed_distance(ZONE, np.array([0.5, y, z]))) == pytest.approx(sign * 0.1, abs=1e-12)


def moved(shift: float, roll: float = 0.0, height: float = 0.0):
    """A stand-in run of two rows: the structure moves by -shift along y; then all rolls about x and is lifted."""
    run = example.overturn()
    n = run.recording.time.size
    late = np.arange(n) >= n // 2
    R = from_angles(roll, 0.0, 0.0)
    quaternion = np.tile([math.sin(roll / 2), 0.0, 0.0, math.cos(roll / 2)], (n, 1))
    chassis = np.tile([0.0, 0.0, height], (n, 1))
    rops = chassis + np.outer(late, R @ np.array([0.0, -shift, 0.0]))
    pose = {
        "chassis": Motion(origin=chassis, quaternion=quaternion),
        "rops": Motion(origin=rops, quaternion=quaternion),
    }
    scenario = shipped("side_overturn")
    return replace(run, scenario=scenario, pose=pose), late


def test_structure_that_sways_into_the_zone() -> None:
    """The left post: 0.08 m thick, axis 0.4 behind the zone, at y = 0.479 where the zone begins (0.229 beside it)."""
    run, late = moved(0.3, roll=1.0)
    vehicle = run.scenario.vehicle
    assert isinstance(vehicle, Vehicle)
    before = approaches(run)[0]
    assert before.least == pytest.approx(0.36, abs=1e-9)  # 0.30 - (-0.10) less half the tube
    pose = dict(run.pose)
    ahead = from_angles(1.0, 0.0, 0.0) @ np.array([0.5, -0.3, 0.0])
    pose["rops"] = Motion(origin=pose["chassis"].origin + np.outer(late, ahead), quaternion=pose["rops"].quaternion)
    after = approaches(replace(run, pose=pose))[0]
    assert after.least < -0.04
    assert after.nearest == "post_left"
    first = run.recording.time[np.argmax(late)]
    assert after.first_intrusion == pytest.approx(first)
    assert after.history[0] == pytest.approx(math.hypot(0.4, 0.2286) - 0.04, abs=5e-4)


def test_ground_plane_enters_the_zone() -> None:
    """Rolled by 90 degrees at a height h of the origin, the zone's side stands h - 0.25 above the ground."""
    run, _ = moved(0.0, roll=math.pi / 2, height=0.35)
    assert approaches(run)[1].least == pytest.approx(0.10, abs=1e-9)
    assert approaches(run)[1].first_intrusion is None
    run, _ = moved(0.0, roll=math.pi / 2, height=0.20)
    assert approaches(run)[1].least == pytest.approx(-0.05, abs=1e-9)
    assert approaches(run)[1].first_intrusion == run.recording.time[0]


def test_ground_that_rises_comes_nearer() -> None:
    """Rolled by 90 degrees, z of the zone points to -y, where this slope rises by tan(20 deg) z."""
    run, _ = moved(0.0, roll=math.pi / 2, height=1.0)
    run = replace(run, scenario=shipped("side_overturn_slope"))
    assert approaches(run)[1].least == pytest.approx(1.0 - 0.15 - math.tan(math.radians(20.0)) * 2.05, abs=1e-9)


def test_hull_that_protects() -> None:
    """The shipped structure protects its zone; one that ends below the operator's head does not."""
    vehicle = shipped("side_overturn").vehicle
    assert isinstance(vehicle, Vehicle)
    assert vehicle.rops is not None
    assert 0.05 < protected_margin(vehicle) < 0.15
    zone = replace(ZONE, seat_reference_point=(0.30, 0.0, 1.75))
    raised = replace(vehicle, rops=replace(vehicle.rops, clearance_zone=zone))
    assert protected_margin(raised) == pytest.approx(protected_margin(vehicle) - 0.6 * hull_slope(vehicle), abs=2e-3)
    with pytest.raises(ValueError, match="clearance_zone"):
        protected_margin(replace(vehicle, rops=None))


def hull_slope(vehicle: Vehicle) -> float:
    """Upward part of the normal of the plane from the crossbar's top to the bonnet's front upper edge, both along y."""
    top, front = np.array([-0.10, 2.50]), np.array([2.70, 1.45])  # crossbar's top (x, z), bonnet
    e = (front - top) / np.hypot(*(front - top))
    return float(e[0])


def test_the_upper_part_of_a_folding_structure_counts() -> None:
    """Its upper part alone, moved 0.6 m ahead and 0.5 m down, stands beside the operator; the lower one stays away."""
    run, late = moved(0.0)
    scenario = run.scenario.replaced({"vehicle": "vehicles/compact_tractor_folding.yaml"})
    rest = run.pose["chassis"]
    ahead = Motion(origin=rest.origin + np.outer(late, [0.6, 0.0, -0.5]), quaternion=rest.quaternion)
    still = replace(run, scenario=scenario, pose={"chassis": rest, "rops": rest, "rops_upper": rest})
    assert approaches(still)[0].least > 0.0
    folded = approaches(replace(still, pose={**still.pose, "rops_upper": ahead}))[0]
    assert folded.least < 0.0
    assert isinstance(scenario.vehicle, Vehicle)
    assert scenario.vehicle.rops is not None
    assert folded.nearest in {member.name for member in scenario.vehicle.rops.parts["rops_upper"][1]}
    assert folded.first_intrusion == run.recording.time[np.argmax(late)]


@pytest.mark.parametrize("sway", [0.0, 0.01, 0.3])
def test_a_roof_is_as_near_as_the_nearest_of_their_points(sway: float) -> None:
    """A cab's roof that sways, tilts and turns against the chassis, for rows by the thousand."""
    scenario = load("static_rops_test").replaced({"vehicle": "vehicles/large_tractor.yaml"})
    vehicle = scenario.vehicle
    assert isinstance(vehicle, Vehicle)
    assert vehicle.rops is not None
    roof = tuple(member for member in vehicle.rops.members if isinstance(member, Box))
    scenario = replace(scenario, vehicle=replace(vehicle, rops=replace(vehicle.rops, members=roof)))
    rows, random = 1300, np.random.default_rng(4)
    time = np.arange(rows) * 1e-3
    waves = np.sin(np.outer(time, random.uniform(2.0, 30.0, 6)) + random.uniform(0.0, 6.0, 6))
    angles = np.array([from_angles(*(sway * w)) for w in waves[:, 3:]])
    resting = np.tile([0.0, 0.0, 0.0, 1.0], (rows, 1))
    pose = {
        "chassis": Motion(origin=np.zeros((rows, 3)), quaternion=resting),
        "rops": Motion(origin=sway * waves[:, :3], quaternion=Rotation.from_matrix(angles).as_quat()),
    }
    run = example.overturn()
    seen = replace(run, scenario=scenario, pose=pose, recording=replace(run.recording, time=time, channels={}))
    zone = vehicle.rops.clearance_zone
    assert zone is not None
    points = np.concatenate([patch.position for member in roof for patch in sample(member, 0.02)])
    at = [
        signed_distance(zone, points @ R.T + p).min()
        for R, p in zip(angles[::50], pose["rops"].origin[::50], strict=True)
    ]
    structure = next(a for a in approaches(seen) if a.what == "structure")
    assert structure.history[::50] == pytest.approx(np.array(at), abs=1e-12)
