"""On how steep a slope a vehicle stands: what `rollover stability` does between reading and writing."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ground.array import Elements
from ground.ye import Ye2006
from rollover.assessment.results import versions
from rollover.assessment.stability import Loss, StabilityAngle, losses, stability_angles
from rollover.dynamics.support import closed_form
from rollover.scenario import AnyVehicle, Ground, Scenario, Simulation, load
from rollover.spec.document import find, slot_of, stated_kind
from rollover.spec.document import headings as headings_of
from rollover.spec.document import load as load_as
from rollover.spec.initiation import Standing
from rollover.spec.standards.static_sequence import usual_code
from rollover.spec.vehicle import Vehicle
from rollover.system.arguments import within
from rollover.system.errors import Fault, InputError

FORMAT = "rollover-stability/1"
CODE_6 = {
    "limit_deg": 38.0,
    "what": "OECD Codes 6 and 7, narrow tractors: least angle of unstable equilibrium on a tilting plane, pivot free",
    "confidence": "recalled, source not checked",
}


@dataclass(frozen=True, kw_only=True)
class Stability:
    """Static stability of a scenario's vehicle: an angle (rad) for each heading, and what each part costs."""

    scenario: Scenario
    angles: tuple[StabilityAngle, ...]
    losses: tuple[Loss, ...]

    @property
    def least(self) -> StabilityAngle:
        """That of the weakest heading."""
        return min(self.angles, key=lambda a: a.balance)


def stability(vehicle: str | Path | Scenario, *, headings: int = 24) -> Stability:
    """Static stability angle against heading, without the scenario's effects.

    Parameters
    ----------
    vehicle
        Scenario, or the path or name of a scenario or a vehicle.
    headings
        How many, evenly spaced, 1 to 360.

    Returns
    -------
    Stability
        Angles (rad) for each heading, and what each part costs.

    Raises
    ------
    InputError
        For wrong input, and for what has no wheels to stand on.
    ArithmeticError
        Where no balance is found.
    """
    within("headings", headings, 1, 360)
    return found_for(vehicle if isinstance(vehicle, Scenario) else scenario_of(vehicle), headings)


def found_for(scenario: Scenario, headings: int, progress: Callable[[int, int], None] | None = None) -> Stability:
    """Static stability of a scenario's vehicle; `progress(done, of)` is told. Raises as `stability`."""
    found = stability_angles(scenario, 2.0 * math.pi * np.arange(headings) / headings, progress)
    return Stability(scenario=scenario, angles=found, losses=losses(scenario))


def file_of(name: str | Path) -> Path:
    """File of the scenario or vehicle of that name. Raises `InputError`."""
    try:
        return find(name)
    except InputError as no_scenario:
        try:
            return find(name, "vehicles")
        except InputError as no_vehicle:
            raise (no_vehicle if "did you mean" in str(no_vehicle) else no_scenario) from None


def scenario_of(name: str | Path) -> Scenario:
    """The scenario of that name, or a vehicle on level ground."""
    path = file_of(name)
    vehicles = slot_of(AnyVehicle).kinds
    if stated_kind(headings_of(path), vehicles) not in vehicles:
        return load(path)
    vehicle = load_as(path, AnyVehicle)
    if not isinstance(vehicle, Vehicle) or len(vehicle.wheels) < 3:
        message = f"has no wheels to stand on, got {vehicle.name!r}; a vehicle with at least three"
        raise InputError(Fault(file=str(path), path="wheels", message=message))
    try:
        return Scenario(
            title=vehicle.name,
            vehicle=vehicle,
            ground=Ground(elements=Elements(length=1.0, width=1.0), law=Ye2006()),
            initiation=Standing(),
            simulation=Simulation(duration=1.0),
        )
    except ValueError as e:  # what its own file does not show: it does not stand
        raise InputError(Fault(file=str(path), message=str(e).removeprefix("vehicle."))) from None


def json_of(found: Stability, about: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """What stability.json says; `about` names what was asked."""
    vehicle = found.scenario.vehicle
    assert isinstance(vehicle, Vehicle)
    rows: list[dict[str, Any]] = []
    for a in found.angles:
        closed = {
            where: closed_form(vehicle, a.heading, outer=outer)
            for where, outer in (("outer_edge", True), ("centre_line", False))
        }
        rows.append(
            {
                "heading_deg": round(math.degrees(a.heading), 6),
                "lift_off_deg": _deg(a.lift_off),
                "first_off": list(a.first_off),
                "phase_one_deg": _deg(a.phase_one),
                "stop_deg": _deg(a.stop),
                "overturn_deg": _deg(a.overturn),
                "balance_deg": _deg(a.balance),
                "closed_form": {
                    where: {"free_pivot_deg": _deg(c.free_pivot), "rigid_deg": _deg(c.rigid)}
                    for where, c in closed.items()
                },
            }
        )
    weakest = min(rows, key=lambda row: row["balance_deg"])
    return {
        "format": FORMAT,
        **(about or {}),
        "title": found.scenario.title,
        "vehicle": vehicle.name,
        "versions": versions(),
        "least": {"heading_deg": weakest["heading_deg"], "balance_deg": weakest["balance_deg"]},
        "code_6": {**CODE_6, "applies": usual_code(vehicle) in ("code-6", "code-7")},
        "effects_left_out": sorted(found.scenario.effects),
        "headings": rows,
        "losses": [
            {
                "part": p.part,
                "mass": p.mass,
                "without_deg": _deg(p.without),
                "with_deg": _deg(p.beside),
                "share": p.share,
            }
            for p in found.losses
        ],
    }


def _deg(angle: float | None) -> float | None:
    return None if angle is None else math.degrees(angle)
