"""A run against the standards: what is asked, what the simulation gave, and the margin.

Static tests prescribe energies and forces of a test, not of an overturn: beside a rollover they are a measure
("compared"), E_dyn/E_standard. What holds in an overturn as well is asked of it: nothing enters the clearance zone.
A virtual test is judged by the rules of its standard.
"""

from __future__ import annotations

import numpy as np

from rollover import virtual_tests
from rollover.clearance import Approach, approaches
from rollover.criterion import Criterion, Verdict, compared, judged, with_half_step
from rollover.initiation import Driving, Standing, TipOver
from rollover.requirement import Requirement
from rollover.run import Run
from rollover.stand import PendulumBlow, StaticTest, TiltTable
from rollover.standards import STANDARDS, STATIC, Tractor
from rollover.vehicle import Vehicle

__all__ = ["Criterion", "Verdict", "criteria", "rops_share", "tractor_of", "with_half_step"]

# share of the ROPS for a vehicle of 450 kg: on natural clay, on ground a hundred times as stiff, there with soft mounts
LIGHT_SHARES = (0.16, 0.25, 0.44)


def criteria(run: Run) -> tuple[Criterion, ...]:
    """All that a finished run can be held against, by the scenario's `loads.standards`; nothing for a bare striker."""
    vehicle, begin = run.scenario.vehicle, run.scenario.initiation
    if not isinstance(vehicle, Vehicle) or run.status == "failed":
        return ()
    tractor = tractor_of(vehicle, folding=True if isinstance(begin, StaticTest) else None)
    asked = [r for name in run.scenario.loads.standards for r in STANDARDS[name](tractor)]
    if isinstance(begin, TiltTable):
        return tuple(virtual_tests.tilt(run, begin, asked))
    if vehicle.rops is None:
        return ()
    if isinstance(begin, (StaticTest, PendulumBlow)):
        zone = [_zone(approach) for approach in approaches(run) if approach.what == "structure"]
        if isinstance(begin, StaticTest):
            return (*virtual_tests.static_test(run, begin, asked), *zone)
        return (*virtual_tests.blow(run, begin, asked), *zone)
    rows = [_zone(approach) for approach in approaches(run)]
    rows += [row for requirement in asked if (row := _compared(run, requirement)) is not None]
    share = rops_share(run) if isinstance(begin, (TipOver, Standing, Driving)) else None
    return (*rows, *([] if share is None else [_share(share)]))


def tractor_of(vehicle: Vehicle, *, folding: bool | None = None) -> Tractor:
    """What the standards ask of a vehicle: its mass without what is attached, wheelbase, rear share, widths.

    A ROPS with hinges tilts or folds, unless `folding` says otherwise.
    """
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
        folding=bool(rops is not None and rops.hinges) if folding is None else folding,
    )


def rops_share(run: Run) -> float | None:
    """Share of the kinetic energy at its landing that the ROPS took; None without a ROPS or a landing."""
    recording = run.recording
    if "rops/energy" not in recording.channels or not np.any(landed := recording["rops/force"] > 0.0):
        return None
    first = int(np.argmax(landed))
    kinetic = float(recording["energy/kinetic"][first])
    taken = float(recording["rops/energy"].max() - recording["rops/energy"][first])
    return taken / kinetic if kinetic > 0.0 else None


def _share(share: float) -> Criterion:
    requirement = Requirement(
        standard="published overturns of 300 to 600 kg vehicles",
        name="share of the ROPS",
        formula="energy absorbed by the ROPS over kinetic energy",
        clause="flat ground and side slopes",
        quantity="share",
        unit="1",
        value=0.43,
        upper=0.61,
        bound="range",
        source="HSE research report 432",
        confidence="seen",
    )
    clay, firm, soft = (f"{100.0 * value:.0f} %" for value in LIGHT_SHARES)
    note = (
        "of the kinetic energy when the ROPS lands. Published shares come from ground and frames that are not told; "
        f"soil that yields takes its part first: here a vehicle of 450 kg has {clay} on natural clay, {firm} on ground "
        f"a hundred times as stiff and {soft} there with mounts that yield at a third"
    )
    return compared(requirement, share, note)


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
    return judged(requirement, approach.least, note)


def _compared(run: Run, requirement: Requirement) -> Criterion | None:
    recording = run.recording
    if requirement.quantity == "energy":
        note = "absorbed by the structure in all, over what the static test asks: E_dyn/E_standard"
        return compared(requirement, float(recording["rops/energy"].max()), note)
    if requirement.quantity == "force":
        force = np.abs(recording["rops/force_z"])
        k = int(np.argmax(force))
        note = f"vertical force of the ground, raw, at {recording.time[k]:.3f} s"
        return compared(requirement, float(force[k]), note)
    if requirement.quantity == "deflection":
        most, left, _ = virtual_tests.elastic_deflection(run)
        return compared(requirement, most - left, "upper corner, less what was left at the end of the run")
    return None  # heights and angles are settings of a test, not results of a rollover
