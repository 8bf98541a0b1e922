"""A run against the standards: what is asked, what the simulation gave, and the margin.

Static tests prescribe energies and forces of a test, not of an overturn: beside a rollover they are a measure
("compared"), E_dyn/E_standard. What holds in an overturn as well is asked of it: nothing enters the clearance zone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from rollover.clearance import Approach, approaches
from rollover.requirement import Requirement
from rollover.run import Run
from rollover.standards import STANDARDS, STATIC, Tractor
from rollover.vehicle import Vehicle

Verdict = Literal["met", "not met", "compared"]


@dataclass(frozen=True, kw_only=True)
class Criterion:
    """One requirement, the simulated value in its unit, and their relation.

    `margin` is (simulated - required)/required, turned round where the requirement is a most; of a distance that must
    stay positive it is the distance itself, m. Positive is good. `met` and `not met` are verdicts, `compared` is none.
    """

    requirement: Requirement
    simulated: float
    margin: float
    verdict: Verdict
    note: str


def criteria(run: Run) -> tuple[Criterion, ...]:
    """All that a finished run can be held against, by the scenario's `loads.standards`; nothing for a bare striker."""
    vehicle = run.scenario.vehicle
    if not isinstance(vehicle, Vehicle) or vehicle.rops is None or run.status == "failed":
        return ()
    found = [_zone(approach) for approach in approaches(run)]
    for name in run.scenario.loads.standards:
        for requirement in STANDARDS[name](tractor_of(vehicle)):
            found += _compared(run, requirement)
    return tuple(found)


def tractor_of(vehicle: Vehicle) -> Tractor:
    """What the standards ask of a vehicle: its mass as it stands, wheelbase, share on the rear axle, widths."""
    x = [wheel.centre[0] for wheel in vehicle.wheels]
    wheelbase = max(x) - min(x) if x else 0.0
    sides = [abs(w.centre[1]) + 0.5 * w.tyre.width for w in vehicle.wheels]
    rops = vehicle.rops
    share = 1.0 - (vehicle.whole.centre_of_mass[0] - min(x)) / wheelbase if wheelbase > 0.0 else 0.6
    return Tractor(
        mass=vehicle.whole.mass,
        wheelbase=wheelbase or None,
        rear_share=min(max(share, 0.0), 1.0),
        width=2.0 * max(sides) if sides else None,
        rops_width=2.0 * abs(rops.corner[1]) if rops is not None else None,
    )


def rops_share(run: Run) -> float | None:
    """Share of the released energy that the structure took, largest over the run; None without a structure.

    Published trials with vehicles of 300 to 600 kg on flat ground and side slopes: 43 to 61 %.
    """
    if "rops/energy" not in run.recording.channels or run.released <= 0.0:
        return None
    return float(run.recording["rops/energy"].max()) / run.released


def _zone(approach: Approach) -> Criterion:
    of = "the structure" if approach.what == "structure" else "the ground"
    requirement = Requirement(
        standard="clearance zone, OECD Code 4 / ISO 5700",
        name=f"distance of {of}",
        formula="no part of the zone entered" if approach.what == "structure" else "no part of the zone unprotected",
        clause="clearance zone",
        quantity="distance",
        unit="m",
        value=0.0,
        bound="least",
        source=STATIC,
        confidence="seen",
    )
    where = f"nearest: {approach.nearest}" if approach.what == "structure" else "height above the undisturbed surface"
    note = f"{where}, at {approach.time:.3f} s"
    if approach.first_intrusion is not None:
        note += f"; first entered at {approach.first_intrusion:.3f} s"
    return Criterion(
        requirement=requirement,
        simulated=approach.least,
        margin=approach.least,
        verdict="met" if approach.least >= 0.0 else "not met",
        note=note,
    )


def _compared(run: Run, requirement: Requirement) -> list[Criterion]:
    recording = run.recording
    if requirement.quantity == "energy":
        simulated, note = float(recording["rops/energy"].max()), "absorbed by the structure; E_dyn/E_standard - 1"
    elif requirement.quantity == "force":
        force = np.abs(recording["rops/force_z"])
        k = int(np.argmax(force))
        simulated, note = float(force[k]), f"vertical force of the ground, raw, at {recording.time[k]:.3f} s"
    elif requirement.quantity == "deflection":
        deflection = recording["rops/deflection"]
        simulated = float(deflection.max() - deflection[-1])
        note = "upper corner, less what was left at the end of the run"
    else:
        return []  # heights and angles are settings of a test, not results of a rollover
    sign = 1.0 if requirement.bound == "least" else -1.0
    margin = sign * (simulated - requirement.value) / requirement.value
    return [Criterion(requirement=requirement, simulated=simulated, margin=margin, verdict="compared", note=note)]
