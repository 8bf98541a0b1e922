"""What `rollover rops` is given, and what rops.json says."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from ground.array import Elements
from ground.ye import Ye2006
from rollover.assessment import standing
from rollover.assessment.frame_test import FrameTest
from rollover.assessment.results import versions
from rollover.scenario import Ground, Scenario, Simulation
from rollover.spec.document import find, headings, load, named
from rollover.spec.inertia import cuboid
from rollover.spec.rops import Rops
from rollover.spec.stand import StaticTest
from rollover.spec.vehicle import Vehicle
from rollover.system.errors import Fault, InputError

FORMAT = "rollover-rops/1"
SHELF = "vehicles/rops"
METHOD = (
    "Euler beams with fibre sections, elastic and then plastic with straight kinematic hardening; each load leans with "
    "the frame. Joints are rigid{joints}; shear deflection, local buckling, tearing{more} are "
    "left out."
)


def file_of(name: str | Path) -> Path:
    """File of the scenario, vehicle or ROPS of that name. Raises `InputError`."""
    try:
        return standing.file_of(name)
    except InputError as other:
        try:
            return find(name, SHELF)
        except InputError as e:
            raise (e if "did you mean" in str(e) else other) from None


@contextmanager
def faults_of(path: Path) -> Iterator[None]:
    """Within it, a fault of the scenario made of a file is told as one of that file."""
    with named(path):
        try:
            yield
        except InputError as e:
            if "members" not in headings(path):
                raise
            own = [replace(f, path=f.path.removeprefix("vehicle.rops.")) for f in e.faults]
            raise InputError(*own) from None


def scenario_of(name: str | Path, mass: float | None = None) -> Scenario:
    """The scenario of that name, or a vehicle or a ROPS in a static test; `mass` (kg) instead of the vehicle's own.

    A ROPS by itself is tested by Code 4, from the rear first. Raises `InputError`.
    """
    path = file_of(name)
    keys = headings(path)
    if "members" not in keys:
        chosen = standing.scenario_of(path)
        return chosen if mass is None else chosen.replaced({"vehicle.whole.mass": mass}, origin="--mass")
    rops = load(path, Rops)
    if mass is None:
        message = (
            "needed for a ROPS by itself, got none; the vehicle's mass in kg: what the standard asks follows from it"
        )
        raise InputError(Fault(file=str(path), path="--mass", message=message))
    try:
        # a stand-in of a tractor's size: the static test takes nothing but its mass
        whole = cuboid(mass, (0.7, 0.0, 0.9), (3.0, 2.0, 2.0))
        vehicle = Vehicle(name=Path(path).stem, whole=whole, rops=rops)
    except ValueError as e:
        raise InputError(Fault(file="rollover rops", path="--mass", message=f"too little for this ROPS: {e}")) from None
    return Scenario(
        title=f"{vehicle.name} alone",
        vehicle=vehicle,
        ground=Ground(elements=Elements(length=1.0, width=1.0), law=Ye2006()),
        initiation=StaticTest(code="code-4"),
        simulation=Simulation(duration=1.0),
    )


def json_of(found: FrameTest, about: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """What rops.json says; `about` names what was asked."""
    vehicle = found.scenario.vehicle
    assert isinstance(vehicle, Vehicle)
    return {
        "format": FORMAT,
        **(about or {}),
        "vehicle": vehicle.name,
        "mass": vehicle.whole.mass,
        "frame_mass": sum(b.body.mass for b in found.rops.beams),
        "base": "clamped" if found.clamped or not found.rops.mounts else "mounts",
        "segments": found.segments,
        **({"speed": found.speed} if found.speed else {}),
        "elements": len(found.frame.mesh.ends),
        "versions": versions(),
        "method": _method(found.speed, found.rops),
        "members": [_member(b) for b in found.rops.beams],
        **({"connections": connections(found.rops)} if found.rops.connections else {}),
        "tests": list(found.tests),
        "criteria": [asdict(row) for row in found.criteria],
        "verdict": _verdict(found),
        "warnings": warnings(found),
    }


def _method(speed: float, rops: Rops) -> str:
    joints = ", and give way as their welds, bolts and cast pieces do, where these are given"
    joints = joints if rops.connections else " and as strong as what they join"
    if speed == 0.0:
        return METHOD.format(joints=joints, more=" and the rate of strain")
    said = f" Loads go at {speed:g} m/s, and what has a rate factor yields higher by it (Cowper and Symonds)."
    text = METHOD.format(joints=joints, more="").replace("local buckling, tearing", "local buckling and tearing")
    return text + said


def _member(b: Any) -> dict[str, Any]:
    n, m_h, m_b, torque = b.plastic_resistance
    return {
        "name": b.name,
        "section": b.section.text,
        "corners": b.section.corners if b.section.tube is not None else None,
        "steel": b.material.name,
        "length": b.length,
        "mass": b.body.mass,
        "class": b.classes,
        "plastic_force": n,
        "plastic_moment_depth": m_h,
        "plastic_moment_width": m_b,
        "plastic_torque": torque,
        **asdict(b.section.properties),
    }


def connections(rops: Rops) -> list[dict[str, Any]]:
    """What each connection carries, each force alone, and of its member's plastic resistances."""
    beams, rows = {b.name: b for b in rops.beams}, []
    for c in rops.connections:
        beam = beams[c.member]
        alone, plastic = c.resistances(beam), beam.plastic_resistance
        rows.append(
            {
                "name": c.name,
                "kind": c.kind,
                "member": c.member,
                "end": c.end,
                **dict(zip(("force", "moment_depth", "moment_width"), alone, strict=True)),
                "of_member": min(own / of for own, of in zip(alone, plastic[:3], strict=True)),
            }
        )
    return rows


def _verdict(found: FrameTest) -> str:
    verdicts = [row.verdict for row in found.criteria]
    return "not met" if "not met" in verdicts else "no verdict" if "no verdict" in verdicts or not verdicts else "met"


def warnings(found: FrameTest) -> list[str]:
    """What of a frame the calculation says too well, in sentences."""
    said = []
    for b in found.rops.beams:
        worst = max(b.classes["h"], b.classes["b"])
        if worst > 1:
            what = {
                2: "its walls may buckle where a plastic hinge turns far",
                3: "its walls buckle before its plastic moment: it carries less than is calculated",
                4: "its walls buckle before it yields: it carries far less than is calculated",
            }[worst]
            said.append(f"{b.name}, {b.section.text} of {b.material.name}, is of class {worst} in bending: {what}.")
    for e in found.tests:
        if e.get("strain_over_uniform", 0.0) > 1.0:
            said.append(
                f"Load {e['name']!r} strains {e['strained']} by {100.0 * e['strain']:.0f} %, beyond the uniform strain "
                "of its steel: it may tear."
            )
    for c in connections(found.rops):
        if c["of_member"] < 1.0:
            said.append(
                f"{c['name']}, {c['kind']}, carries {100.0 * c['of_member']:.0f} % of what {c['member']} does: it "
                "gives way before the tube, without a plastic hinge."
            )
    others = [m.name for m in found.rops.members if m.name not in {b.name for b in found.rops.beams}]
    if others:
        said.append(f"Members without a section carry nothing here: {', '.join(others)}.")
    if not found.clamped and any(any(m.play) or any(m.rotational_play_deg) for m in found.rops.mounts):
        said.append("The mounts' play is left out.")
    stated = ("side_stiffness", "side_yield", "play")
    names = [f.name for f in found.rops.feet if any(getattr(f, name) for name in stated)]
    if names:
        said.append(f"What is stated of feet is left out, sections and steel count: {', '.join(names)}.")
    if effects := sorted(found.scenario.effects):
        said.append(f"Effects of the scenario are left out: {', '.join(effects)}.")
    if found.speed and (slow := sorted({b.material.name for b in found.rops.beams if b.material.rate_factor is None})):
        said.append(f"Without a rate factor, and so without the rate of strain: {', '.join(slow)}.")
    return said
