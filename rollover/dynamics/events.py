"""Events of a run: what the kernels note, by name."""

from __future__ import annotations

import math
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from rollover.dynamics.bodies import Body
from rollover.dynamics.result import Event
from rollover.kernels import tables as c
from rollover.kernels.tables import Tables
from rollover.scenario import Scenario
from rollover.spec.vehicle import Vehicle

KINDS: dict[int, str] = {
    c.TOUCH: "first-touch",
    c.BRANCH_CHANGE: "branch-change",
    c.TURN: "unloading",
    c.WHEEL_OFF: "lift-off",
    c.WHEEL_ON: "touch-down",
    c.AXLE_STOP: "axle-stop",
    c.HINGE: "plastic-hinge",
    c.AXLE_BLOW: "axle-stop",
}


def unseen(t: Tables) -> NDArray[np.bool_]:
    """Nothing seen yet: (EVENT_KINDS, subjects), whatever a subject is: a body, a wheel, a connector."""
    return np.zeros((c.EVENT_KINDS, max(len(t.pose), len(t.wheel_i), len(t.mount_f))), dtype=np.bool_)


def place_of(x: Any) -> tuple[float, float, float]:
    """Three numbers of an array."""
    return (float(x[0]), float(x[1]), float(x[2]))


def collect(t: Tables, now: float, bodies: tuple[Body, ...], scenario: Scenario, events: list[Event]) -> None:
    """Turn the kernels' event rows into events."""
    vehicle = scenario.vehicle
    for k in range(int(t.counts[c.EVENTS])):
        kind, who = int(t.event[k, c.EV_KIND]), int(t.event[k, c.EV_SUBJECT])
        value, detail = float(t.event[k, c.EV_VALUE]), ""
        if kind in (c.WHEEL_OFF, c.WHEEL_ON) and isinstance(vehicle, Vehicle):
            subject = vehicle.wheels[who].name
        elif kind == c.HINGE and isinstance(vehicle, Vehicle) and vehicle.rops is not None:
            way = "along" if value < 3 else "about"
            subject, detail = vehicle.rops.connectors[who].name, f"yields {way} {'xyz'[int(value) % 3]}"
        elif kind == c.AXLE_BLOW:
            subject, detail = "front_axle", f"strikes with {value:.3g} N m s"
        elif kind == c.AXLE_STOP:
            subject, detail = "front_axle", f"{math.degrees(value):.1f} deg"
        else:
            subject = bodies[who].name
            detail = f"{value:.3g} m/s" if kind == c.TOUCH else f"sinkage {1e3 * value:.1f} mm"
        place = place_of(t.event[k, c.EV_PLACE : c.EV_PLACE + 3])
        events.append(Event(time=now, kind=cast(Any, KINDS[kind]), subject=subject, place=place, detail=detail))
    t.counts[c.EVENTS] = 0
