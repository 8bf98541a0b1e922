"""What an instrument would have read: a simulation at the place and in the axes of a sensor.

    a_P = a_C + alpha x r + omega x (omega x r),   r = P - C                                        (M1)

all in body axes; a proper accelerometer reads R_SB (a_P - g), in free fall nothing and at rest +1 g upwards.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rollover.recording import Recording, Sensor
from rollover.system.errors import Fault, InputError

Array = NDArray[np.float64]
Point = tuple[float, float, float]

GRAVITY = 9.81  # m/s2
_AXES = "xyz"


def at_sensors(
    simulated: Recording,
    measured: Recording,
    *,
    centre_of_mass: Point,
    pivot: Point | None = None,
    gravity: float = GRAVITY,
) -> Recording:
    """The simulated recording with every channel that the measured one's sensors read, on the simulation's clock.

    `centre_of_mass` is the chassis', `pivot` the front axle's (both m, vehicle axes). Raises `InputError` for an
    instrument on a body whose motion the simulation has no channels of.
    """
    found = {
        name: at_sensor(simulated, name, sensor, centre_of_mass=centre_of_mass, pivot=pivot, gravity=gravity)
        for name, sensor in measured.sensors.items()
    }
    return replace(simulated, channels={**simulated.channels, **found})


def at_sensor(
    simulated: Recording,
    channel: str,
    sensor: Sensor,
    *,
    centre_of_mass: Point,
    pivot: Point | None = None,
    gravity: float = GRAVITY,
) -> Array:
    """One acceleration or angular velocity channel (n,) as an instrument reads it; its last letter is the axis.

    On the ROPS the chassis' motion is taken, without the ROPS' own deflection. Raises `InputError`.
    """
    quantity, _, axis = channel.rpartition("_")
    kind = quantity.rpartition("/")[2]
    if axis not in _AXES or kind not in ("acceleration", "angular_velocity"):
        raise _refused(channel, "no accelerometer or gyroscope reads it; an acceleration or angular_velocity channel")
    R_BS = sensor.R_BS
    if sensor.body == "striker":
        a = np.zeros((simulated.time.size, 3))
        omega = np.zeros_like(a)
        a[:, 2] = _column(simulated, "striker/acceleration_z")
        R_WB = np.broadcast_to(np.eye(3), (a.shape[0], 3, 3))
    else:
        omega = _vector(simulated, "chassis/angular_velocity")
        alpha = np.asarray(np.gradient(omega, simulated.time, axis=0, edge_order=2), dtype=np.float64)
        R_WB = attitude(simulated)
        r = np.array(sensor.position) - np.array(centre_of_mass)
        if sensor.body == "front_axle":
            a, omega, R_WB = _on_axle(simulated, sensor, centre_of_mass, pivot, omega, alpha, R_WB)
        else:
            a = np.asarray(_vector(simulated, "chassis/acceleration") + _lever(omega, alpha, r))  # (M1)
    if kind == "angular_velocity":
        return np.asarray((omega @ R_BS)[:, _AXES.index(axis)])
    if sensor.gravity == "proper":
        a = a + gravity * R_WB[:, 2, :]  # -g = +g z_W, in body axes R_WB' z_W
    return np.asarray((a @ R_BS)[:, _AXES.index(axis)])


def attitude(simulated: Recording) -> Array:
    """R_WB of the chassis, (n, 3, 3), from its quaternion, or from roll, pitch and yaw."""
    if "chassis/quaternion_w" in simulated.channels:
        q = np.column_stack([simulated[f"chassis/quaternion_{axis}"] for axis in "xyzw"])
        return np.asarray(Rotation.from_quat(q).as_matrix())
    angles = np.column_stack([_column(simulated, f"chassis/{name}") for name in ("yaw", "pitch", "roll")])
    return np.asarray(Rotation.from_euler("ZYX", angles).as_matrix())


def _lever(omega: Array, alpha: Array, r: Array) -> Array:
    """alpha x r + omega x (omega x r), (n, 3)."""
    return np.asarray(np.cross(alpha, r) + np.cross(omega, np.cross(omega, r)))


def _on_axle(
    simulated: Recording,
    sensor: Sensor,
    centre_of_mass: Point,
    pivot: Point | None,
    omega: Array,
    alpha: Array,
    R_WB: Array,
) -> tuple[Array, Array, Array]:
    """Acceleration, angular velocity and attitude of the front axle, which turns about the chassis' x at its pivot."""
    if pivot is None:
        raise _refused("front_axle", "the axle's pivot is needed, got none")
    angle = _column(simulated, "axle/front/angle")
    rate = np.gradient(angle, simulated.time, edge_order=2)
    R_CA = Rotation.from_rotvec(np.outer(angle, [1.0, 0.0, 0.0])).as_matrix()
    turn = np.outer(rate, [1.0, 0.0, 0.0])
    omega_axle = omega + turn  # in chassis axes
    alpha_axle = alpha + np.gradient(turn, simulated.time, axis=0, edge_order=2) + np.cross(omega, turn)
    r = np.einsum("nij,j->ni", R_CA, np.array(sensor.position) - np.array(pivot))
    a = _vector(simulated, "chassis/acceleration") + _lever(omega, alpha, np.array(pivot) - np.array(centre_of_mass))
    a = a + _lever(omega_axle, alpha_axle, r)
    to_axle = R_CA.transpose(0, 2, 1)
    turned = [np.einsum("nij,nj->ni", to_axle, vector) for vector in (a, omega_axle)]
    return turned[0], turned[1], R_WB @ R_CA


def _vector(simulated: Recording, name: str) -> Array:
    return np.column_stack([_column(simulated, f"{name}_{axis}") for axis in _AXES])


def _column(simulated: Recording, name: str) -> Array:
    if name not in simulated.channels:
        raise _refused(name, "no such channel in the simulation; a sensor on this body cannot be read")
    return simulated[name]


def _refused(channel: str, message: str) -> InputError:
    return InputError(Fault(path=channel, message=message))
