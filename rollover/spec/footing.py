"""Whether a vehicle can stand and roll on its wheels: what the tyres hold, what the wheels' inertia leaves."""

from __future__ import annotations

from rollover.spec.connector import Connector
from rollover.spec.estimates import turning_inertia
from rollover.spec.inertia import MassProperties
from rollover.spec.mechanism import Joint, free_motions, in_words
from rollover.spec.vehicle import Carrier, Vehicle, carried, carrier_of, hubs

RIGID = 1e6  # of the stiffest tyre: what stands for the pivot, whose root is a thousandth of what round-off would blur


def check_standing(vehicle: Vehicle) -> None:
    """Raise ``ValueError`` for a vehicle that its tyres leave a motion, such as three wheels in line across it.

    Each tyre holds its foot along all three axes: that wheels roll is meant. The front axle swings as far as its own
    wheels let it.
    """
    parts = {"chassis": carried(vehicle, "chassis")}
    joints = []
    for w in vehicle.wheels:
        foot = (w.centre[0], w.centre[1], 0.0)  # at one height, or springs along x would seem to hold a pitch
        side = w.tyre.lateral_stiffness
        held = Connector(
            name=w.name, position=foot, stiffness=(side, side, w.tyre.vertical_stiffness), damping=(0.0, 0.0, 0.0)
        )
        above = w.carrier if w.bogie is None else w.hub
        joints.append(Joint(path=f"wheels.{w.name}", below="ground", above=above, connector=held))
    if vehicle.front_axle is not None:
        stiff = RIGID * max(max(j.connector.stiffness) for j in joints)
        pivot = Connector(
            name="pivot",
            position=vehicle.front_axle.pivot,
            stiffness=(stiff, stiff, stiff),
            damping=(0.0, 0.0, 0.0),
            rotational_stiffness=(0.0, stiff, stiff),
        )
        parts["front_axle"] = carried(vehicle, "front_axle")
        joints.append(Joint(path="front_axle", below="chassis", above="front_axle", connector=pivot))
    if vehicle.trailer is not None:
        hitch = vehicle.trailer.hitch
        stiff = RIGID * max(max(j.connector.stiffness) for j in joints)
        # where a turn is free up to its stop, the stop holds what the wheels do not
        turns = hitch.turns.stop_stiffness
        ball = Connector(
            name="hitch",
            position=hitch.position,
            stiffness=(stiff, stiff, stiff),
            damping=(0.0, 0.0, 0.0),
            rotational_stiffness=(turns, turns, turns),
        )
        parts["trailer"] = carried(vehicle, "trailer")
        joints.append(Joint(path="trailer.hitch", below="chassis", above="trailer", connector=ball))
    for b in vehicle.bogies:
        stiff = RIGID * max(max(j.connector.stiffness) for j in joints[: len(vehicle.wheels)])
        pin = Connector(
            name=b.name,
            position=b.pivot,
            stiffness=(stiff, stiff, stiff),
            damping=(0.0, 0.0, 0.0),
            rotational_stiffness=(stiff, 0.0, stiff),
        )
        parts[b.part] = b.body
        joints.append(Joint(path=f"bogies.{b.name}", below=carrier_of(vehicle, b), above=b.part, connector=pin))
    if motions := free_motions(parts, joints, gravity=0.0):
        free = motions[0]
        names = [w.name for w in vehicle.wheels if w.carrier in free.parts or w.hub in free.parts]
        raise ValueError(
            f"vehicle.wheels: {in_words([free])} on its tyres, got {', '.join(names) or 'no wheel'} to hold it; "
            f"a further wheel off this axis"
        )


def check_turning(vehicle: Vehicle) -> None:
    """Raise ``ValueError`` for wheels that turn with more inertia than the body that they are part of."""
    of: dict[str, MassProperties] = {**hubs(vehicle), **{b.part: b.body for b in vehicle.bogies}}
    carriers: tuple[Carrier, ...] = ("front_axle", "chassis", "trailer")
    of |= {carrier: carried(vehicle, carrier) for carrier in carriers if any(w.hub == carrier for w in vehicle.wheels)}
    named = {"front_axle": "their axle", "chassis": "the chassis", "trailer": "the trailer"}
    named |= {b.part: f"the bogie {b.name}" for b in vehicle.bogies}
    for carrier, whole in of.items():
        wheels = [w for w in vehicle.wheels if w.hub == carrier]
        turning, most = sum(turning_inertia(vehicle, w) for w in wheels), whole.inertia[1]
        if turning >= most:
            body = named.get(carrier, f"the hub of {wheels[0].name}")
            unstated = [w.name for w in wheels if w.inertia is None]
            by_size = ", by the size of their tyres" if unstated else ""
            cure = f"; state vehicle.wheels.*.inertia of {', '.join(unstated)}" if unstated else ""
            raise ValueError(
                f"initiation.kind: the wheels turn with more inertia than {body} has, got {turning:.3g} kg m2"
                f"{by_size}; less than {most:.3g} kg m2 is allowed{cure}"
            )
