"""What a signal can drive (data): a force, the ground, a tilt table, the front wheels' angle, engine and brakes."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from ground.kinds import ByKind
from ground.quantity import Label, Quantity, parameters
from rollover.spec.inputs.signal import Signal, written
from rollover.spec.shapes import Point

Array3 = tuple[float, float, float]


def _check_range(key: str, signal: Signal, least: float, most: float, unit: str) -> None:
    low, high = min(signal.values.tolist()), max(signal.values.tolist())
    if low < least or high > most:
        got = low if low < least else high
        raise ValueError(f"{key}: out of bounds, got {got:.6g} {unit}; {least:g} to {most:g} {unit} is allowed")


def _check_direction(direction: Array3) -> None:
    if math.hypot(*direction) < 1e-6:
        raise ValueError(f"direction: no direction, got {list(direction)}; a vector that is not zero")


@parameters
class Force:
    """A force on a point of a body: of a rope that tows, an exciter, a jack. Straight lines between the samples."""

    kind: Literal["force"] = "force"
    name: Annotated[str, Label("of the input in results")]
    body: Annotated[Literal["chassis", "front_axle", "rops", "striker"], "on which it acts"] = "chassis"
    point: Annotated[
        Point | None, Quantity("m", "where it acts, vehicle axes, goes along with the body; null: the centre of mass")
    ] = None
    direction: Annotated[Array3, Quantity("1", "of a force greater than zero, of any length")]
    axes: Annotated[Literal["world", "body"], "in which the direction is told: body: it turns with the body"] = "world"
    force: Annotated[Signal, written("N", "along the direction")]

    def validate(self) -> None:
        """Refuse a force that acts along nothing."""
        _check_direction(self.direction)


@parameters
class Shake:
    """The ground is shaken along a line, as one: by its displacement, or by its acceleration.

    All is told against the ground: positions, velocities and energies are those that one who stands on it sees, and
    bodies are pushed by -m a. Accelerations of bodies are told against the world, as an accelerometer reads them. A
    displacement is a cubic spline through its samples that begins and ends at rest: its second derivative acts. An
    acceleration is straight lines between its samples. Soil that moves along with a body is not shaken.
    """

    kind: Literal["shake"] = "shake"
    name: Annotated[str, Label("of the input in results")]
    direction: Annotated[Array3, Quantity("1", "world axes, of any length")]
    displacement: Annotated[Signal | None, written("m", "along the direction; null: by its acceleration")] = None
    acceleration: Annotated[Signal | None, written("m/s2", "along the direction; null: by its displacement")] = None

    def validate(self) -> None:
        """Refuse a ground that moves along nothing, and none or two descriptions of its motion."""
        _check_direction(self.direction)
        if (self.displacement is None) == (self.acceleration is None):
            got = "none" if self.displacement is None else "both"
            raise ValueError(f"displacement: one of displacement and acceleration is needed, got {got}; one")


@parameters
class TableAngle:
    """The angle of a tilt table over time: `initiation.kind: tilt-table`, whose own rate it takes the place of.

    A cubic spline through its samples that begins and ends at rest. Told in the table's axes, with what turning them
    adds: -m (alpha x r + omega x (omega x r) + 2 omega x v) and the moments of the bodies' inertia.
    """

    kind: Literal["table-angle"] = "table-angle"
    name: Annotated[str, Label("of the input in results")]
    angle_deg: Annotated[Signal, written("deg", "of the table, downhill is y")]
    axis: Annotated[tuple[float, float], Quantity("m", "y and z of the line about which it turns, table's axes")] = (
        0.0,
        0.0,
    )

    def validate(self) -> None:
        """Refuse angles that no table has."""
        _check_range("angle_deg", self.angle_deg, 0.0, 85.0, "deg")


@parameters
class Steering:
    """The angle of the front wheels over time: `initiation.kind: driving`. Straight lines between the samples."""

    kind: Literal["steering"] = "steering"
    name: Annotated[str, Label("of the input in results")]
    angle_deg: Annotated[Signal, written("deg", "of the front wheels, to the left")]

    def validate(self) -> None:
        """Refuse angles that no steering has."""
        _check_range("angle_deg", self.angle_deg, -60.0, 60.0, "deg")


@parameters
class DriveTorque:
    """The engine's torque over time, on the wheels of `initiation.drive`. Straight lines between the samples."""

    kind: Literal["drive-torque"] = "drive-torque"
    name: Annotated[str, Label("of the input in results")]
    torque: Annotated[Signal, written("N m", "on the axle's wheels together, forward")]


@parameters
class BrakeTorque:
    """The limit of the brakes' torque over time, on the wheels of `initiation.brake`. Straight lines between."""

    kind: Literal["brake-torque"] = "brake-torque"
    name: Annotated[str, Label("of the input in results")]
    torque: Annotated[Signal, written("N m", "limit, of each wheel")]

    def validate(self) -> None:
        """Refuse a brake that pushes."""
        _check_range("torque", self.torque, 0.0, 1e7, "N m")


Input = Annotated[Force | Shake | TableAngle | Steering | DriveTorque | BrakeTorque, ByKind()]
