"""A run against the standards: what is asked, what the simulation gave, and the margin.

Static tests prescribe energies and forces of a test, not of an overturn: beside a rollover they are a measure
("compared"), E_dyn/E_standard. What holds in an overturn as well is asked of it: nothing enters the clearance zone.
A virtual test is judged by the rules of its standard.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rollover.assessment import virtual_tests
from rollover.assessment.clearance import Approach, approaches
from rollover.assessment.criterion import Criterion, Verdict, compared, judged, with_half_step
from rollover.dynamics.result import Run
from rollover.spec.initiation import Driving, Standing, TipOver
from rollover.spec.stand import PendulumBlow, StaticTest, TiltTable
from rollover.spec.standards.codes import STANDARDS, STATIC
from rollover.spec.standards.requirement import Requirement
from rollover.spec.standards.static_sequence import sequence, tractor_of, usual_code
from rollover.spec.vehicle import Vehicle

__all__ = ["Criterion", "Verdict", "criteria", "in_words", "rops_share", "tractor_of", "with_half_step"]

# share of the ROPS for a vehicle of 450 kg: on natural clay, on ground a hundred times as stiff, there with soft mounts
LIGHT_SHARES = (0.16, 0.25, 0.44)
RATIO_IN_WORDS = (
    "A ratio above 1 says that the structure took up more energy in this overturn than the static test puts in, at "
    "least, from that side. It does not say that the structure failed, for the test does not ask how much more it can "
    "take; nor does a ratio below 1 say that it passed. Whether the operator's space was kept is the distance of the "
    "clearance zone, which is judged."
)


def criteria(run: Run, near: Sequence[Approach] | None = None) -> tuple[Criterion, ...]:
    """All that a finished run can be held against, by the scenario's `loads.standards`; nothing for a bare striker.

    `near` are its `approaches`, where they have been worked out.
    """
    vehicle, begin = run.scenario.vehicle, run.scenario.initiation
    if not isinstance(vehicle, Vehicle) or run.status == "failed":
        return ()
    tractor = tractor_of(vehicle, folding=True if isinstance(begin, StaticTest) else None)
    asked = [r for name in _standards(run, vehicle) for r in STANDARDS[name](tractor)]
    if isinstance(begin, TiltTable):
        return tuple(virtual_tests.tilt(run, begin, asked))
    if vehicle.rops is None:
        return ()
    if near is None:
        near = approaches(run)
    if isinstance(begin, (StaticTest, PendulumBlow)):
        structure = next((approach for approach in near if approach.what == "structure"), None)
        zone = [] if structure is None else [_zone(structure)]
        if isinstance(begin, StaticTest):
            return (*virtual_tests.static_test(run, sequence(vehicle, begin), asked, structure), *zone)
        return (*virtual_tests.blow(run, begin, asked), *zone)
    rows = [_zone(approach) for approach in near]
    rows += [row for requirement in _once(run, asked) if (row := _compared(run, requirement)) is not None]
    share = rops_share(run) if isinstance(begin, (TipOver, Standing, Driving)) else None
    return (*rows, *([] if share is None else [_share(share)]))


def in_words(rows: Sequence[Criterion]) -> list[str]:
    """What people need to know to read the rows: what a ratio says, and why a verdict or a margin is missing."""
    found = []
    if any(row.verdict == "compared" and row.requirement.quantity == "energy" for row in rows):
        found.append(RATIO_IN_WORDS)
    if short := [row.requirement.name for row in rows if row.verdict == "no verdict"]:
        found.append(f"Not loaded far enough, so no verdict: {', '.join(short)}.")
    if any(row.margin is None for row in rows):
        found.append(
            "A margin is not stated where a test went only to its prescribed load: what more a frame can take shows "
            "when it is pushed until it fails (initiation.push_on: the name of a load)."
        )
    return found


def _standards(run: Run, vehicle: Vehicle) -> tuple[str, ...]:
    """Those of the scenario, or the code that the static test follows or that applies; Code 4 where none does."""
    begin = run.scenario.initiation
    if run.scenario.loads.standards is not None:
        return run.scenario.loads.standards
    if isinstance(begin, StaticTest) and begin.code is not None:
        return (begin.code,)
    return (usual_code(vehicle),)


def _once(run: Run, asked: Sequence[Requirement]) -> list[Requirement]:
    """Of each standard one energy, for the side that the frame was loaded from, and one force; the rest as it is.

    A run has one absorbed energy and one greatest force down: beside two requirements each would count twice.
    """
    side = loaded_from(run)
    found: list[Requirement] = []
    for standard in dict.fromkeys(r.standard for r in asked):
        of = [r for r in asked if r.standard == standard]
        energies = [r for r in of if r.quantity == "energy"]
        lengthways = [r for r in energies if set(r.come_from) & {"front", "rear"}]
        # a code that names one end only still asks for that energy lengthways
        chosen = [r for r in energies if side in r.come_from] or (lengthways if side in ("front", "rear") else [])
        keep = [*chosen[:1], *[r for r in of if r.quantity == "force"][:1]]
        found += [r for r in of if r in keep or r.quantity not in ("energy", "force")]
    return found


def loaded_from(run: Run) -> str:
    """The side that the ground mostly pushed the ROPS from, by the momentum along each vehicle axis."""
    time = run.recording.time
    x, y = (float(np.trapezoid(run.recording[f"rops/force_{axis}"], time)) for axis in "xy")
    if abs(x) > abs(y):
        return "rear" if x > 0.0 else "front"
    return "right" if y > 0.0 else "left"


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
        confidence="source checked",
    )
    clay, firm, soft = (f"{100.0 * value:.0f} %" for value in LIGHT_SHARES)
    note = (
        "of the kinetic energy when the ROPS lands. Published shares come from ground and frames that are not stated; "
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
        confidence="source checked",
    )
    where = f"nearest: {approach.nearest}" if approach.what == "structure" else "height above the undisturbed surface"
    note = f"{where}, at {approach.time:.3f} s"
    if approach.first_intrusion is not None:
        note += f"; first entered at {approach.first_intrusion:.3f} s"
    return judged(requirement, approach.least, note)


def _compared(run: Run, requirement: Requirement) -> Criterion | None:
    recording = run.recording
    if requirement.quantity == "energy":
        side = loaded_from(run)
        note = f"absorbed by the structure in all, mostly from the {side}, over what the static test asks at least: "
        note += "E_dyn/E_standard"
        return compared(requirement, float(recording["rops/energy"].max()), note)
    if requirement.quantity == "force":
        force = np.abs(recording["rops/force_z"])
        k = int(np.argmax(force))
        note = f"vertical force of the ground, raw, at {recording.time[k]:.3f} s"
        return compared(requirement, float(force[k]), note)
    if requirement.quantity == "deflection":
        most, left, _ = virtual_tests.elastic_deflection(run)
        return compared(requirement, most - left, "upper corner, less the permanent set at the end of the run")
    return None  # heights and angles are settings of a test, not results of a rollover
