"""A thrown rigid body: flight in closed form, axes and signs, rest, sliding; a cone's area in the array."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rollover.dynamics.result import Run
from rollover.dynamics.simulate import run
from rollover.scenario import Scenario
from rollover.system.errors import InputError
from tests.physics.scenes import shipped

HALF = 0.0524  # m, half the cube's edge


def thrown(**changes: object) -> Run:
    return run(shipped("cube_toss").replaced({path.replace("__", "."): value for path, value in changes.items()}))


@pytest.fixture(scope="module")
def toss() -> Run:
    return run(shipped("cube_toss"))


def test_flight_is_a_parabola_and_a_steady_turn(toss: Run) -> None:
    scenario, found = toss.scenario, toss.recording
    start = scenario.initiation
    assert start.kind == "throw"
    touch = min(e.time for e in toss.events if e.kind == "first-touch")
    t = found.time[found.time < touch - 1e-3]
    assert t.size > 100
    fall = np.array([0.0, 0.0, -9.81])
    place = np.array(start.position) + t[:, None] * np.array(start.velocity) + 0.5 * t[:, None] ** 2 * fall
    got = np.stack([found[f"chassis/position_{k}"][: t.size] for k in "xyz"], axis=1)
    assert np.abs(got - place).max() < 1e-5
    # an inertia that is the same about every axis: the angular velocity stays, in body axes and in the world
    w, x, y, z = start.quaternion or ()
    first = Rotation.from_quat([x, y, z, w])
    turn = first * Rotation.from_rotvec(t[:, None] * np.array(start.angular_velocity))
    q = np.stack([found[f"chassis/quaternion_{k}"][: t.size] for k in "xyzw"], axis=1)
    assert (turn.inv() * Rotation.from_quat(q)).magnitude().max() < 1e-5
    spin = np.stack([found[f"chassis/angular_velocity_{k}"][: t.size] for k in "xyz"], axis=1)
    assert np.abs(spin - start.angular_velocity).max() < 1e-9
    # in free fall the coordinate acceleration is g, whatever the attitude
    size = np.linalg.norm([found[f"chassis/acceleration_{k}"][1 : t.size] for k in "xyz"], axis=0)
    assert size == pytest.approx(9.81, rel=1e-6)


def test_quaternion_is_scalar_first_and_body_to_world() -> None:
    """A quarter turn about z, w = z = sqrt(1/2): yaw +90 degrees; the body's x points along the world's y."""
    quarter = [math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)]
    found = thrown(
        initiation__quaternion=quarter, initiation__angular_velocity=[2.0, 0.0, 0.0], simulation__duration=0.02
    ).recording
    assert found["chassis/yaw"][0] == pytest.approx(math.pi / 2)
    # turning about the body's x, which is the world's y, tips the body's z towards the world's x
    q = [found[f"chassis/quaternion_{k}"][-1] for k in "xyzw"]
    assert Rotation.from_quat(q).apply([0.0, 0.0, 1.0])[0] == pytest.approx(math.sin(2.0 * found.time[-1]), rel=1e-6)
    angles = thrown(initiation__quaternion=None, initiation__yaw_deg=90.0, simulation__duration=0.02).recording
    assert [angles[f"chassis/quaternion_{k}"][0] for k in "wxyz"] == pytest.approx(quarter)


def test_it_comes_to_rest_on_a_face_and_the_ledger_closes(toss: Run) -> None:
    found = toss.recording
    assert toss.status == "done"
    # four corners share the weight: 0.37 * 9.81/(50 000 * 4 * 27.4576/63) = 0.042 mm
    sunk = 0.37 * 9.81 / (5e4 * 4.0 * 0.00274576 / 0.0063)
    assert found["chassis/position_z"][-1] == pytest.approx(HALF - sunk, abs=2e-6)
    assert found["ground/force_normal"][-1] == pytest.approx(0.37 * 9.81, rel=1e-3)
    assert found["ground/sinkage"].max() < 0.002
    assert np.abs(found["energy/residual"]).max() < 0.005 * toss.released
    assert found["ground/force_normal"].min() >= 0.0
    tilt = [found[f"chassis/quaternion_{k}"][-1] for k in "xyzw"]
    upright = np.abs(Rotation.from_quat(tilt).as_matrix()[2]).max()
    assert upright == pytest.approx(1.0, abs=1e-4)


@pytest.mark.parametrize("mu", [0.1, 0.3])
def test_it_slides_as_far_as_friction_lets_it(mu: float) -> None:
    """Flat on a face with 0.8 m/s: v^2/(2 mu g), and the ledger's friction is the kinetic energy."""
    sunk = 0.37 * 9.81 / (5e4 * 4.0 * 0.00274576 / 0.0063)
    result = thrown(
        initiation__position=[-0.3, 0.013, HALF - sunk],
        initiation__velocity=[0.8, 0.0, 0.0],
        initiation__quaternion=[1.0, 0.0, 0.0, 0.0],
        initiation__angular_velocity=[0.0, 0.0, 0.0],
        ground__friction__coefficient=mu,
        simulation__duration=1.2,
    )
    way = result.recording["chassis/position_x"][-1] + 0.3
    assert way == pytest.approx(0.8**2 / (2.0 * mu * 9.81), rel=0.01)
    assert result.ledger["friction"] == pytest.approx(0.5 * 0.37 * 0.8**2, rel=0.01)


def test_what_is_no_throw_is_refused() -> None:
    scenario = shipped("cube_toss")

    def said(changes: dict[str, object], of: Scenario = scenario) -> str:
        with pytest.raises(InputError) as error:
            run(of.replaced(changes))
        return str(error.value)

    assert "not of length 1, got 2" in said({"initiation.quaternion": [1.0, 1.0, 1.0, 1.0]})
    assert "one of both" in said({"initiation.yaw_deg": 5.0})
    assert "the centre of mass is in the ground" in said({"initiation.position": [0.0, 0.0, -0.01]})
    assert "nothing can touch the ground" in said({"vehicle.outline": []})
    assert "only a rigid body is thrown" in said(
        {"initiation": {"kind": "throw", "position": [0, 0, 1]}}, shipped("rops_drop")
    )


def test_a_cone_covers_the_square_of_its_depth() -> None:
    scenario = shipped("penetrometer_drop").replaced({"simulation.duration": 0.3, "vehicle.contact_spacing": 0.002})
    found = run(scenario).recording
    z, area = found["ground/sinkage"], found["ground/contact_area"]
    going = (found.time > 0.002) & (z < 0.0755)
    whole = math.pi * 0.04375**2
    assert np.abs(area[going] / whole - (z[going] / 0.0755) ** 2).max() < 0.03
    assert area[z > 0.08] == pytest.approx(whole, rel=1e-6)


def test_the_penetrometer_is_slowed_as_its_law_says() -> None:
    """m z'' = m g - A(z) q(z middle, z'), integrated apart from the array."""
    from ground.drops import Drop
    from ground.penetration import FORMS, predicted

    result = run(shipped("penetrometer_drop"))
    drop = Drop(
        name="", time=np.zeros(1), mass=7.71, speed=4.3, area=math.pi * 0.04375**2, cone_height=0.0755, gravity=6.58
    )
    deceleration, depth = predicted(FORMS["bearing-rate"], np.array([2.0, 6.3, 1.2, 0.15]), drop)
    assert result.recording["ground/sinkage"].max() == pytest.approx(depth, rel=0.01)
    assert result.recording["striker/acceleration_z"].max() == pytest.approx(deceleration, rel=0.01)
    assert np.abs(result.recording["energy/residual"]).max() < 1e-3 * result.released
