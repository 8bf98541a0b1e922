"""Whether what is prescribed fits the vehicle and the start, and nothing is given twice or not at all."""

from __future__ import annotations

from collections.abc import Sequence

from rollover.spec.initiation import Driving, Initiation
from rollover.spec.inputs.kinds import BrakeTorque, DriveTorque, Force, Input, Shake, Steering, TableAngle
from rollover.spec.stand import TiltTable
from rollover.spec.vehicle import RigidBody, Striker, Vehicle

ONE_ALONE = (TableAngle, Steering, DriveTorque, BrakeTorque)  # kinds of which a scenario can have one


def check_inputs(inputs: Sequence[Input], vehicle: Vehicle | Striker | RigidBody, start: Initiation) -> None:
    """Raise ``ValueError`` for an input that has nothing to act on, or acts where something else does already."""
    names = [i.name for i in inputs]
    if twice := next((n for n in names if names.count(n) > 1), None):
        raise ValueError(f"inputs: two inputs share a name, got {twice!r}; each name once")
    for kind in ONE_ALONE:
        same = [i.name for i in inputs if isinstance(i, kind)]
        if len(same) > 1:
            raise ValueError(f"inputs.{same[1]}: a second one of kind {kind.kind!r}, got {', '.join(same)}; one")
    for one in inputs:
        if isinstance(one, Force):
            bodies = bodies_of(vehicle)
            if one.body not in bodies:
                raise ValueError(f"inputs.{one.name}.body: no such body, got {one.body!r}; {' or '.join(bodies)}")
        elif isinstance(one, TableAngle):
            _check_table(one, start)
        elif isinstance(one, Shake):
            continue
        elif not isinstance(start, Driving):
            raise ValueError(
                f"inputs.{one.name}.kind: {one.kind!r} acts on wheels that turn, got initiation.kind {start.kind!r}; "
                "'driving' is needed"
            )
        elif isinstance(one, Steering) and start.steer_deg != 0.0:
            raise ValueError(
                f"initiation.steer_deg: the input {one.name!r} gives the angle, got {start.steer_deg!r} too; 0"
            )
    _check_torques(inputs, start)


def bodies_of(vehicle: Vehicle | Striker | RigidBody) -> list[str]:
    """Names of the bodies that a force may act on."""
    if isinstance(vehicle, Striker):
        return ["striker"]
    axle = ["front_axle"] if vehicle.front_axle is not None else []
    return ["chassis", *axle, *(["rops"] if vehicle.rops is not None else [])]


def _check_table(one: TableAngle, start: Initiation) -> None:
    if not isinstance(start, TiltTable):
        raise ValueError(
            f"inputs.{one.name}.kind: turns a tilt table, got initiation.kind {start.kind!r}; 'tilt-table' is needed"
        )
    usual = TiltTable()
    for key in ("from_deg", "to_deg", "rate_deg", "creep"):
        if getattr(start, key) != getattr(usual, key):
            raise ValueError(
                f"initiation.{key}: the input {one.name!r} gives the angle, got {getattr(start, key)!r} too; "
                "leave it out"
            )


def _check_torques(inputs: Sequence[Input], start: Initiation) -> None:
    if not isinstance(start, Driving):
        return
    for key, part, kind in (("drive", start.drive, DriveTorque), ("brake", start.brake, BrakeTorque)):
        given = next((i for i in inputs if isinstance(i, kind)), None)
        if part is None and given is not None:
            raise ValueError(f"initiation.{key}: the input {given.name!r} acts on its wheels, got null; {key}: {{}}")
        if part is None:
            continue
        if part.torque is None and given is None:
            raise ValueError(f"initiation.{key}.torque: missing; a number in N m, or an input of kind {kind.kind}")
        if part.torque is not None and given is not None:
            raise ValueError(
                f"initiation.{key}.torque: the input {given.name!r} gives it, got {part.torque!r} too; leave it out"
            )
