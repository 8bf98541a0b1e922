"""A simulation read at a sensor's place, against a rigid body whose motion is known in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rollover.comparison.instruments import at_sensor, at_sensors
from rollover.recording import Recording, Sensor
from rollover.system.errors import InputError

G, SPIN, RATE, N = 9.81, 6.0, 4.0, 2001
CENTRE = (0.3, 0.0, 0.9)
TIME = np.linspace(0.0, 0.5, N)
ANGLE = SPIN * TIME + 0.5 * RATE * TIME**2  # about the body's y, which stays the world's


def falling() -> Recording:
    """A body that falls freely while it pitches ever faster: R_WB = R_y(angle), a_C = -g."""
    R = Rotation.from_rotvec(np.outer(ANGLE, [0.0, 1.0, 0.0])).as_matrix()
    acceleration = np.einsum("nji,j->ni", R, [0.0, 0.0, -G])
    q = Rotation.from_matrix(R).as_quat()
    return Recording(
        title="falls",
        time=TIME,
        channels={
            **{f"chassis/acceleration_{a}": acceleration[:, k] for k, a in enumerate("xyz")},
            "chassis/angular_velocity_x": np.zeros(N),
            "chassis/angular_velocity_y": SPIN + RATE * TIME,
            "chassis/angular_velocity_z": np.zeros(N),
            **{f"chassis/quaternion_{a}": q[:, k] for k, a in enumerate("xyzw")},
            "axle/front/angle": 0.2 * np.sin(5.0 * TIME),
        },
        source="simulation",
    )


def test_a_point_of_a_spinning_falling_body() -> None:
    # P = C + d x_B: its world place is C(t) + d (cos angle, 0, -sin angle). Twice differentiated:
    # a = -g z - d w^2 (cos, 0, -sin) + d w' (-sin, 0, -cos) = g terms - d w^2 x_B - d w' z_B. So a proper
    # accelerometer, blind to free fall, reads x: -d w^2 and z: -d w'.
    d = 0.7
    at = Sensor(body="chassis", position=(CENTRE[0] + d, 0.0, CENTRE[2]), gravity="proper")
    w = SPIN + RATE * TIME
    read = {a: at_sensor(falling(), f"sensor/s/acceleration_{a}", at, centre_of_mass=CENTRE) for a in "xyz"}
    assert read["x"] == pytest.approx(-d * w**2, abs=1e-9)
    assert read["y"] == pytest.approx(np.zeros(N), abs=1e-9)
    assert read["z"] == pytest.approx(np.full(N, -d * RATE), abs=1e-9)


def test_coordinate_acceleration_has_gravity_in_body_axes() -> None:
    at = Sensor(body="chassis", position=CENTRE)
    x = at_sensor(falling(), "chassis/acceleration_x", at, centre_of_mass=CENTRE)
    assert x == pytest.approx(G * np.sin(ANGLE), abs=1e-9)  # x_B = (cos, 0, -sin), so -g z_W . x_B = g sin


@pytest.mark.parametrize("how", ["angles", "matrix"])
def test_axes_of_the_instrument(how: str) -> None:
    # yawed by 90 deg: its x points along the body's y, its y along the body's -x
    turn = ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    at = (
        Sensor(body="rops", position=CENTRE, matrix=turn)
        if how == "matrix"
        else Sensor(body="rops", position=CENTRE, orientation_deg=(0.0, 0.0, 90.0))
    )
    w = SPIN + RATE * TIME
    rate = {a: at_sensor(falling(), f"sensor/g/angular_velocity_{a}", at, centre_of_mass=CENTRE) for a in "xy"}
    assert rate["x"] == pytest.approx(w)
    assert rate["y"] == pytest.approx(np.zeros(N), abs=1e-12)
    y = at_sensor(falling(), "sensor/g/acceleration_y", at, centre_of_mass=CENTRE)
    assert y == pytest.approx(-G * np.sin(ANGLE), abs=1e-9)


def test_angles_do_as_well_as_a_quaternion() -> None:
    body = falling()
    still = {f"chassis/angular_velocity_{a}": np.zeros(N) for a in "xyz"}
    still |= {f"chassis/acceleration_{a}": np.zeros(N) for a in "xyz"}
    still |= {"chassis/roll": np.full(N, 0.3), "chassis/pitch": np.full(N, -0.2), "chassis/yaw": np.full(N, 1.0)}
    tilted = Recording(title="t", time=TIME, channels=still, source=body.source)
    at = Sensor(body="chassis", gravity="proper")
    # at rest it reads what holds it up: g times the body components of the world's z, by hand from ISO 8855 angles
    expected = G * np.array([np.sin(0.2), np.sin(0.3) * np.cos(0.2), np.cos(0.3) * np.cos(0.2)])
    read = [at_sensor(tilted, f"sensor/s/acceleration_{a}", at, centre_of_mass=CENTRE)[7] for a in "xyz"]
    assert read == pytest.approx(expected, abs=1e-12)


def test_on_the_front_axle() -> None:
    # chassis at rest, axle swings by angle(t) about x at the pivot: a point d to its left is at
    # d (0, cos, sin); along the axle's own axes it feels -d angle'^2 in y and d angle'' in z
    d, pivot = 0.8, (1.5, 0.0, 0.4)
    angle = 0.2 * np.sin(5.0 * TIME)
    still = {f"chassis/{q}_{a}": np.zeros(N) for q in ("angular_velocity", "acceleration") for a in "xyz"}
    still |= {"chassis/roll": np.zeros(N), "chassis/pitch": np.zeros(N), "chassis/yaw": np.zeros(N)}
    axle = Recording(title="a", time=TIME, channels={**still, "axle/front/angle": angle})
    at = Sensor(body="front_axle", position=(1.5, d, 0.4))
    y, z = (at_sensor(axle, f"sensor/a/acceleration_{a}", at, centre_of_mass=CENTRE, pivot=pivot) for a in "yz")
    inner = slice(5, -5)
    assert y[inner] == pytest.approx((-d * np.cos(5.0 * TIME) ** 2)[inner], abs=1e-4)
    assert z[inner] == pytest.approx((-0.2 * 25.0 * d * np.sin(5.0 * TIME))[inner], abs=1e-3)
    rate = at_sensor(axle, "sensor/a/angular_velocity_x", at, centre_of_mass=CENTRE, pivot=pivot)
    assert rate[inner] == pytest.approx(np.cos(5.0 * TIME)[inner], abs=1e-4)
    with pytest.raises(InputError, match="the axle's pivot is needed"):
        at_sensor(axle, "sensor/a/acceleration_y", at, centre_of_mass=CENTRE)


def test_all_sensors_of_a_recording_at_once() -> None:
    sensor = Sensor(body="chassis", position=(1.0, 0.0, 0.9), gravity="proper")
    name = "sensor/s/acceleration_x"
    measured = Recording(title="m", time=TIME, channels={name: np.zeros(N)}, sensors={name: sensor})
    both = at_sensors(falling(), measured, centre_of_mass=CENTRE)
    assert both[name] == pytest.approx(at_sensor(falling(), name, sensor, centre_of_mass=CENTRE))
    assert "chassis/acceleration_x" in both.channels


def test_what_no_instrument_reads() -> None:
    with pytest.raises(InputError, match="ground/sinkage: no accelerometer"):
        at_sensor(falling(), "ground/sinkage", Sensor(body="chassis"), centre_of_mass=CENTRE)
    with pytest.raises(InputError, match="striker/acceleration_z: no such channel"):
        at_sensor(falling(), "sensor/s/acceleration_z", Sensor(body="striker"), centre_of_mass=CENTRE)


def test_a_matrix_that_is_no_rotation() -> None:
    with pytest.raises(ValueError, match="matrix: not a rotation"):
        Sensor(body="rops", matrix=((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)))
