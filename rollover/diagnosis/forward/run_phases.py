"""Phases of a full run, for what happens in which."""

from __future__ import annotations

from rollover.diagnosis.settings import SETTINGS
from rollover.dynamics.result import Run
from rollover.spec.vehicle import Striker

TUNING = SETTINGS.forward.phases


def phases_of(run: Run) -> tuple[tuple[float, str], ...]:
    """(start s, name) of support, tipping, impact, sliding, rest: sliding is what comes after the last impact.

    An impact is a force of the ground beyond `impact_force` times the weight; support ends with the first wheel that
    lifts off, tipping with the first part that hits the ground and is no wheel.
    """
    marks = list(run.phases)
    start = next((at for at, name in marks if name == "impact"), None)
    if start is None:
        return tuple(marks)
    vehicle = run.scenario.vehicle
    mass = vehicle.mass if isinstance(vehicle, Striker) else vehicle.whole.mass
    time, force = run.recording.time, run.recording["ground/force_normal"]
    blows = time[(force > TUNING.impact_force * mass * run.scenario.gravity) & (time >= start)]
    end = next((at for at, name in marks if name == "rest"), float(time[-1]))
    sliding = float(blows[-1]) if blows.size else start
    if start < sliding < end - TUNING.least_sliding:
        marks.append((sliding, "sliding"))
    return tuple(sorted(marks))
