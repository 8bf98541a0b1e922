"""The verdicts of a virtual test: a static test, a pendulum's blow, a tilt table, each by the rules of its standard.

Only what was tested is judged. A load is held against the requirement of the vehicle's own mass, whatever energy or
force the scenario gave it: the first requirement of a standard, in its order, that asks for an energy or a force from
the side that the load came from. How far a load was told to go is no margin: the margin is what the frame took until
it failed. It fails where a part of it enters the clearance zone, gives way too far, or holds the force no longer.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from rollover.assessment.clearance import Approach
from rollover.assessment.criterion import ROUNDING, Criterion, compared, judged, prescribed
from rollover.dynamics.result import Run
from rollover.dynamics.stands.static_load import OVERLOAD_DROP
from rollover.spec.stand import PendulumBlow, StaticTest, TiltTable
from rollover.spec.standards.codes import STATIC
from rollover.spec.standards.requirement import Requirement
from rollover.spec.standards.static_sequence import Push

HELD = 5.0  # s for which the static tests hold a crush force
AT_REST = 0.2  # s at the end of a run over which the residual deflection is taken


def static_test(
    run: Run, loads: Sequence[Push], asked: Sequence[Requirement], structure: Approach | None = None
) -> list[Criterion]:
    """Energy or force of each load, and the overload rule after a load that was asked for an energy.

    `structure` is how near the frame came to the clearance zone.
    """
    found: list[Criterion] = []
    results = {entry["name"]: entry for entry in run.tests}
    for load, requirement in pairs(loads, asked):
        entry = results.get(load.name, {"status": "never began: the run ended before"})
        found.append(_load(run, load, entry, requirement, structure))
        if entry.get("overload") and requirement.source == STATIC:
            found.append(overload(load, entry, requirement))
    return found


def pairs(loads: Sequence[Push], asked: Sequence[Requirement]) -> list[tuple[Push, Requirement]]:
    """Each requirement with the first load that it can be asked of and that none before it had."""
    found: list[tuple[Push, Requirement]] = []
    had: set[tuple[str, str]] = set()
    for requirement in asked:
        for load in loads:
            kind = "energy" if load.energy is not None else "force" if load.force is not None else "none"
            key = (requirement.standard, load.name)
            if kind == requirement.quantity and load.come_from in requirement.come_from and key not in had:
                had.add(key)
                found.append((load, requirement))
                break
    return sorted(found, key=lambda pair: [load.name for load in loads].index(pair[0].name))


def _load(
    run: Run, load: Push, entry: Mapping[str, Any], requirement: Requirement, structure: Approach | None
) -> Criterion:
    done = entry["status"] == "reached"
    simulated = float(entry.get(requirement.quantity, 0.0))
    if "reached_at" not in entry and "begun_at" in entry:
        simulated = float(run.recording[f"device/{requirement.quantity}"][-1])
    note = f"load {load.name!r} {entry['status']}"
    if "deflection" in entry:
        note += f" at {1e3 * entry['deflection']:.0f} mm and {1e-3 * entry['force']:.1f} kN"
    if "permanent_set" in entry:
        note += f", {round(1e3 * entry['permanent_set']) + 0:d} mm permanent set"
    if requirement.quantity == "force" and done:
        assert isinstance(run.scenario.initiation, StaticTest)
        note += f"; held {run.scenario.initiation.hold:g} s after the deflection stopped, the test holds {HELD:g} s"
    entered = _entered(run, entry, structure)
    if entered is not None:
        simulated = min(simulated, float(run.recording[f"device/{requirement.quantity}"][entered]))
        note += f"; a part of the frame entered the clearance zone at {run.recording.time[entered]:.3f} s"
        return judged(requirement, simulated, note)
    return concluded(load, entry, requirement, simulated, note)


def concluded(load: Push, entry: Mapping[str, Any], requirement: Requirement, simulated: float, note: str) -> Criterion:
    """What a load that kept out of the clearance zone shows of its requirement, by how it ended."""
    if entry["status"] == "reached":
        return prescribed(requirement, simulated, float(load.energy or load.force or 0.0), note)
    if load.until_failure and simulated >= requirement.value * (1.0 - ROUNDING):
        row = judged(requirement, simulated, note)
        return row if "reached_at" in entry else replace(row, margin=None)
    # an energy is there even where the overload test that followed was given up; a force must stand still
    return judged(requirement, simulated, note, otherwise=requirement.quantity == "energy")


def _entered(run: Run, entry: Mapping[str, Any], structure: Approach | None) -> int | None:
    """Row of the recording in which this load first pushed the frame into the clearance zone, None if it did not."""
    if structure is None or "begun_at" not in entry:
        return None
    time = run.recording.time
    during = (time >= entry["begun_at"]) & (time <= entry.get("reached_at", np.inf)) & (structure.history < 0.0)
    k = int(np.argmax(during))
    before = structure.history[k - 1] if k > 0 else 0.0
    # a frame that an earlier load left in the zone is that load's failure
    return k if during.any() and before >= 0.0 else None


def overload(load: Push, entry: Mapping[str, Any], of: Requirement) -> Criterion:
    """The overload rule after a load that was asked for an energy."""
    rule = entry["overload"]
    requirement = replace(
        of,
        name=f"overload rule, {of.name}",
        formula="force falls by at most 3 % over the last 5 % of the deflection, or an overload test is passed",
        clause="overload test",
        quantity="share",
        unit="1",
        value=OVERLOAD_DROP,
        bound="most",
        come_from=(),
    )
    if not rule["required"]:
        return judged(requirement, rule["fall"], f"load {load.name!r}: no overload test is due")
    extra = f"{100.0 * rule['extra_energy']:.0f} % more energy"
    passed = bool(rule["passed"])
    note = f"load {load.name!r}: overload test due, {'passed' if passed else 'not passed'} with {extra}"
    return replace(compared(requirement, rule["fall"], note), verdict="met" if passed else "not met")


def blow(run: Run, blow_: PendulumBlow, asked: Sequence[Requirement]) -> list[Criterion]:
    """The height of the fall, and what springs back of a deflection from the side."""
    found = []
    struck = bool(run.tests) and run.tests[0]["status"] != "not struck"
    for requirement in asked:
        if blow_.come_from not in requirement.come_from:
            continue
        if requirement.quantity == "height":
            note = f"fall of the block of {blow_.mass:g} kg, a setting" + ("" if struck else "; it did not strike")
            found.append(judged(requirement, blow_.height, note, otherwise=struck))
        elif requirement.quantity == "deflection":
            most, left, swing = elastic_deflection(run)
            note = (
                f"upper corner: at most {1e3 * most:.0f} mm, {1e3 * left:.0f} mm permanent set (+-{1e3 * swing:.0f} mm)"
            )
            found.append(judged(requirement, most - left, note, otherwise=struck))
    return found


def elastic_deflection(run: Run) -> tuple[float, float, float]:
    """Largest and residual deflection of the ROPS, m, and how far it still swings about the latter."""
    time, deflection = run.recording.time, run.recording["rops/deflection"]
    last = deflection[time >= time[-1] - AT_REST]
    return float(deflection.max()), float(last.mean()), 0.5 * float(np.ptp(last))


def tilt(run: Run, table: TiltTable, asked: Sequence[Requirement]) -> list[Criterion]:
    """The angle at which the vehicle goes over, of a vehicle across the table."""
    if abs(math.sin(math.radians(table.heading_deg))) > 1e-6:
        return []
    found, entry = [], run.tests[0]
    for requirement in (r for r in asked if r.quantity == "angle"):
        side = "left" if math.cos(math.radians(table.heading_deg)) > 0.0 else "right"
        if entry["unstable_deg"] is not None:
            note = f"over its {side} side; the test takes the less stable one"
            found.append(judged(requirement, math.radians(entry["unstable_deg"]), note))
            continue
        reached = judged(requirement, math.radians(entry["table_deg"]), f"still stood there, {side} side downhill")
        # a table that stopped too early has shown nothing
        # and one that stopped beyond what is asked has not shown how far it could go
        met = reached.verdict == "met"
        found.append(replace(reached, margin=None) if met else replace(reached, verdict="compared"))
    return found
