"""Codes of tracklayers, forestry machines and excavators: requirements in the mass M (kg), as those of ISO 3471.

What was read is the scope of ISO 8082-1:2009 and of ISO 12117-2:2008, with the note of the former that its levels are
those of ISO 3471; every number was recalled. OECD Code 9 (telehandlers) has none here: none could be read or recalled.
"""

from __future__ import annotations

from dataclasses import replace

from rollover.spec.standards.iso_3471 import LEAST_MASS, excavator, iso_3471_requirements
from rollover.spec.standards.requirement import Requirement

SIDES, ABOVE, ENDS = ("left", "right"), ("above",), ("front", "rear")
EXCAVATORS = (6000.0, 50_000.0)  # kg, read: over 6 t and less than 50 t
# kg above which, and below which, a code of this file asks anything
SCOPES: dict[str, tuple[float, float]] = {
    "code-8": (LEAST_MASS, float("inf")),
    "iso-8082-1": (LEAST_MASS, float("inf")),
    "iso-12117-2": EXCAVATORS,
}
OF = {
    "code-8": "OECD Code 8, recalled: the rows of crawler machines of ISO 3471, themselves recalled",
    "iso-8082-1": (
        "ISO 8082-1:2009, read: its levels are those of ISO 3471, log skidders stand with wheel loaders (SAE J1040); "
        "the numbers of ISO 3471 recalled"
    ),
    "iso-12117-2": "ISO 12117-2:2008, its scope read, its numbers recalled",
}


def code_8(mass: float) -> tuple[Requirement, ...]:
    """OECD Code 8, EU 1322/2014 annex VII: tracklaying tractors."""
    rows = _as_iso_3471("crawler", mass, "OECD Code 8", OF["code-8"])
    return tuple(replace(r, confidence="recalled") for r in rows)


def iso_8082_1(mass: float) -> tuple[Requirement, ...]:
    """ISO 8082-1: forwarders, skidders, feller-bunchers, harvesters, loaders without a rotating platform."""
    return _as_iso_3471("wheel-loader", mass, "ISO 8082-1:2009", OF["iso-8082-1"])


def iso_12117_2(mass: float) -> tuple[Requirement, ...]:
    """ISO 12117-2: excavators of over 6 t and less than 50 t."""
    value = excavator(mass)
    rows = (
        ("side energy", "13 000 m^1.25, m = M/10 000", "energy", "J", SIDES),
        ("longitudinal energy", "4300 m^1.25, m = M/10 000", "energy", "J", ENDS),
        ("vertical force", "12.75 M", "force", "N", ABOVE),
        ("side force", "35 000 m^1.2, m = M/10 000", "force", "N", SIDES),
    )
    return tuple(
        Requirement(
            standard="ISO 12117-2:2008",
            name=name,
            formula=formula,
            clause="hydraulic excavators",
            quantity=quantity,  # type: ignore[arg-type]
            unit=unit,
            value=value[name],
            bound="least",
            source=OF["iso-12117-2"],
            confidence="recalled",
            come_from=side,
        )
        for name, formula, quantity, unit, side in rows
    )


def outside(code: str, mass: float) -> str:
    """What is wrong with a code for a mass (kg); nothing where it may be asked."""
    low, high = SCOPES.get(code, (0.0, float("inf")))
    if low < mass < high:
        return ""
    allowed = f"more than {low:g} kg" if high == float("inf") else f"more than {low:g} and less than {high:g} kg"
    return f"{code!r} is outside its scope, got {mass:g} kg; {allowed}, or another standard"


def _as_iso_3471(machine: str, mass: float, standard: str, source: str) -> tuple[Requirement, ...]:
    """Rows of ISO 3471 under another name, the vertical force first of the forces: a run has that one."""
    rows = {r.name: r for r in iso_3471_requirements(machine, mass)}
    sides = {"side energy": SIDES, "vertical force": ABOVE, "side force": SIDES, "longitudinal force": ENDS}
    return tuple(replace(rows[name], standard=standard, source=source, come_from=side) for name, side in sides.items())
