"""Requirements of the standards for roll-over protective structures, each with formula, clause, source and confidence.

M is the reference mass in kg, energies are in J, forces in N, heights in m. `source checked`: its source's text was
read; everything else was recalled and is only as good as its stated confidence. This is a calculator beside a
simulation: a type approval needs the text in force.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from rollover.spec.standards.iso_3471 import MACHINES, Machine, iso_3471_requirements
from rollover.spec.standards.machine_codes import code_8, iso_8082_1, iso_12117_2
from rollover.spec.standards.requirement import Confidence, Requirement

__all__ = [
    "MACHINES",
    "STANDARDS",
    "Confidence",
    "Machine",
    "Requirement",
    "Tractor",
    "code_3",
    "code_4",
    "code_6",
    "code_7",
    "iso_3471_requirements",
    "osha",
    "pitch_inertia_of_both_formulae",
]

STATIC = "French order of 6 July 1981, annex I (static tests of the EEC and OECD)"
DYNAMIC = "French order of 6 July 1981, annex II (dynamic tests of the EEC and OECD)"
NINE, TEN = "EU 1322/2014 annex IX, source not checked", "EU 1322/2014 annex X, source not checked"
NARROW = "excerpts of the EEC directives on narrow-track tractors"
OSHA_TEXT = "29 CFR 1926.1002 and 1928.52, SAE J1194"
SIDES: tuple[str, ...] = ("left", "right")
ABOVE: tuple[str, ...] = ("above",)
ENDS: tuple[str, ...] = ("front", "rear")
FOOT_POUND, POUND = 1.3558179483314004, 0.45359237  # J, kg


@dataclass(frozen=True, kw_only=True)
class Tractor:
    """What the formulae ask for: reference mass (kg), wheelbase (m), share of the mass on the rear axle.

    `pitch_inertia` (kg m2) is about the rear axle, without the rear wheels; `width` (m) is the least overall width of
    the tractor and `rops_width` (m) the largest of the structure (Code 6).
    """

    mass: float
    wheelbase: float | None = None
    rear_share: float = 0.6
    pitch_inertia: float | None = None
    width: float | None = None
    rops_width: float | None = None
    folding: bool = False

    def __post_init__(self) -> None:
        if not self.mass > 0.0:
            raise ValueError(f"mass: not a mass, got {self.mass!r}; more than 0 kg")
        if not 0.0 <= self.rear_share <= 1.0:
            raise ValueError(f"rear_share: not a share, got {self.rear_share!r}; from 0 to 1")


def code_4(tractor: Tractor) -> tuple[Requirement, ...]:
    """OECD Code 4, ISO 5700, EU 1322/2014 annex VIII: static loads, in their order."""
    standard, M = "OECD Code 4 / ISO 5700", tractor.mass
    behind = tractor.rear_share >= 0.5
    first, second = ("rear", "front") if behind else ("front", "rear")
    found = [
        _energy(
            standard,
            f"longitudinal load, {first}",
            "1.4 M",
            1.4 * M,
            "energy, first longitudinal load",
            come_from=(first,),
        ),
        _force(standard, f"crush, {first}", "20 M", 20.0 * M, "crush, held 5 s after the deflection stops"),
        _energy(standard, "side load", "1.75 M", 1.75 * M, "energy, load from the side", come_from=SIDES),
        _force(standard, f"crush, {second}", "20 M", 20.0 * M, "crush, held 5 s after the deflection stops"),
    ]
    if tractor.folding:
        name = f"second longitudinal load, {second}"
        clause = "tilting or folding frames: other corner"
        found.append(_energy(standard, name, "0.35 M", 0.35 * M, clause, come_from=(second,)))
    return tuple(found)


def code_3(tractor: Tractor) -> tuple[Requirement, ...]:
    """OECD Code 3, ISO 3463, annex VI: heights of the 2000 kg pendulum and crush loads, in their order.

    The rear height is given by wheelbase or by pitch inertia; there is none where the front axle carries half or more.
    """
    standard, M = "OECD Code 3 / ISO 3463", tractor.mass
    found = []
    if tractor.rear_share > 0.5:
        clause = "rear impact, chains at 20 deg"
        if tractor.wheelbase is not None:
            H, formula = 2.165e-8 * M * (1e3 * tractor.wheelbase) ** 2, "2.165e-8 M L^2 mm, L in mm"
            found.append(_height(standard, "rear impact, by wheelbase", formula, H, clause, ("rear",)))
        if tractor.pitch_inertia is not None:
            H, formula = 5.73e-2 * tractor.pitch_inertia, "5.73e-2 I mm, I about the rear axle"
            found.append(_height(standard, "rear impact, by pitch inertia", formula, H, clause, ("rear",)))
    front, side = "25 + 0.07 M, from 2000 kg 125 + 0.02 M", "25 + 0.20 M, from 2000 kg 125 + 0.15 M"
    found += [
        _crush(standard, "rear crush", M),
        _height(standard, "front impact", front, front_height(M), "front impact", ("front",)),
        _height(standard, "side impact", side, side_height(M), "side impact", SIDES),
        _crush(standard, "front crush", M),
        Requirement(
            standard=standard,
            name="elastic deflection",
            formula="largest less residual deflection",
            clause="side impact, 900 mm above and 150 mm ahead of the seat reference point",
            quantity="deflection",
            unit="m",
            value=0.250,
            bound="most",
            source=DYNAMIC,
            confidence="source checked",
            come_from=SIDES,
        ),
    ]
    return tuple(found)


def front_height(mass: float) -> float:
    """Height of the pendulum's fall for a front impact, mm: 25 + 0.07 M, from 2000 kg 125 + 0.02 M."""
    return 25.0 + 0.07 * mass if mass < 2000.0 else 125.0 + 0.02 * mass


def side_height(mass: float) -> float:
    """Height of the pendulum's fall for a side impact, mm: 25 + 0.20 M, from 2000 kg 125 + 0.15 M."""
    return 25.0 + 0.20 * mass if mass < 2000.0 else 125.0 + 0.15 * mass


def code_6(tractor: Tractor) -> tuple[Requirement, ...]:
    """OECD Code 6, ISO 12003-1, annex IX: narrow-track tractors with the structure in front; static loads.

    E_IS = 1.75 M (B6 + B)/(2 B), B the least width of the tractor, B6 the largest of the structure.
    """
    standard, M = "OECD Code 6 / ISO 12003-1", tractor.mass
    widths = tractor.width is not None and tractor.rops_width is not None
    factor = (tractor.rops_width + tractor.width) / (2.0 * tractor.width) if widths else 1.0  # type: ignore[operator]
    side = "1.75 M (B6 + B)/(2 B)" if widths else "1.75 M (B6 + B)/(2 B), widths not given: factor 1"
    first, second = "first longitudinal load", "second longitudinal load"
    return (
        _narrow_angle(standard),
        _energy(standard, "longitudinal load", "500 + 0.5 M", 500.0 + 0.5 * M, first, "recalled", NINE, ENDS),
        _force(standard, "crush, front", "20 M", 20.0 * M, "crush", NARROW),
        _energy(standard, "side load", side, 1.75 * M * factor, "load from the side", "recalled", NINE, SIDES),
        _force(standard, "crush, rear", "20 M", 20.0 * M, "crush", NARROW),
        _energy(standard, second, "0.35 M", 0.35 * M, second, "recalled", NINE, ENDS),
    )


def code_7(tractor: Tractor) -> tuple[Requirement, ...]:
    """OECD Code 7, ISO 12003-2, annex X: narrow-track tractors with the structure behind; static loads."""
    standard, M = "OECD Code 7 / ISO 12003-2", tractor.mass
    first, ahead = "first longitudinal load", "side, 200 mm ahead of the seat reference point"
    return (
        _energy(standard, "longitudinal load", "500 + 0.5 M", 500.0 + 0.5 * M, first, "recalled", TEN, ENDS),
        _force(standard, "crush, rear", "20 M", 20.0 * M, "crush", NARROW),
        _energy(standard, "side load", "1.75 M", 1.75 * M, ahead, "recalled", NARROW, SIDES),
        _force(standard, "crush, front", "20 M", 20.0 * M, "crush", NARROW),
    )


def osha(tractor: Tractor) -> tuple[Requirement, ...]:
    """SAE J1194, 29 CFR 1926.1002: side 723 + 0.4 W ft lbf, rear 0.47 W ft lbf, crush 2 W; W in lb."""
    standard, W = "SAE J1194 / 29 CFR 1926.1002", tractor.mass / POUND
    high: Confidence = "recalled, high confidence"
    weight, side, rear = 2.0 * tractor.mass * 9.80665, (723.0 + 0.4 * W) * FOOT_POUND, 0.47 * W * FOOT_POUND
    return (
        _energy(standard, "side load", "723 + 0.4 W ft lbf", side, "static, side", high, OSHA_TEXT, SIDES),
        _energy(standard, "rear load", "0.47 W ft lbf", rear, "static, rear", high, OSHA_TEXT, ("rear",)),
        _force(standard, "crush", "2 W", weight, "1926.1003, crush", "29 CFR 1926.1003"),
    )  # fmt: skip


def j2194(tractor: Tractor) -> tuple[Requirement, ...]:
    """SAE J2194: what meets ISO 5700 or ISO 3463 passes, with its rules on temperature and belts."""
    return tuple(
        Requirement(**{**vars(r), "standard": f"SAE J2194, by {r.standard.split(' / ')[1]}"})
        for r in (*code_4(tractor), *code_3(tractor))
    )


def pitch_inertia_of_both_formulae(mass: float, wheelbase: float) -> float:
    """I = 0.378 M L^2: the pitch inertia (kg m2) about the rear axle at which both rear heights of Code 3 agree."""
    return 2.165e-8 * 1e6 / 5.73e-2 * mass * wheelbase**2


def pendulum_energy(height: float, mass: float = 2000.0, gravity: float = 9.81) -> float:
    """Energy of the falling block, J; its share in the structure is smaller, tyres and lashings take the rest."""
    return mass * gravity * height


STANDARDS: dict[str, Callable[[Tractor], tuple[Requirement, ...]]] = {
    "code-3": code_3,
    "code-4": code_4,
    "code-6": code_6,
    "code-7": code_7,
    "sae-j1194": osha,
    "sae-j2194": j2194,
    "code-8": lambda tractor: code_8(tractor.mass),
    "iso-8082-1": lambda tractor: iso_8082_1(tractor.mass),
    "iso-12117-2": lambda tractor: iso_12117_2(tractor.mass),
}


def impact_speed(height: float, gravity: float = 9.81) -> float:
    """v = sqrt(2 g H) of the pendulum's block at its lowest point, m/s."""
    return math.sqrt(2.0 * gravity * height)


def _energy(
    standard: str,
    name: str,
    formula: str,
    value: float,
    clause: str,
    confidence: Confidence = "source checked",
    source: str = STATIC,
    come_from: tuple[str, ...] = (),
) -> Requirement:
    return _requirement(standard, name, formula, value, clause, "energy", "J", confidence, source, come_from)


def _force(standard: str, name: str, formula: str, value: float, clause: str, source: str = STATIC) -> Requirement:
    return _requirement(standard, name, formula, value, clause, "force", "N", "source checked", source, ABOVE)


def _crush(standard: str, name: str, mass: float) -> Requirement:
    return _force(standard, name, "twice the weight", 2.0 * mass * 9.81, "crush", DYNAMIC)


def _height(
    standard: str, name: str, formula: str, millimetres: float, clause: str, come_from: tuple[str, ...]
) -> Requirement:
    value = 1e-3 * millimetres
    return _requirement(standard, name, formula, value, clause, "height", "m", "source checked", DYNAMIC, come_from)


def _narrow_angle(standard: str) -> Requirement:
    source = "EU 1322/2014 annex IX, preparation checked, angle recalled"
    return _requirement(
        standard, "lateral stability", "unstable equilibrium on a tilting plane", math.radians(38.0),
        "lateral stability, pivot free", "angle", "rad", "recalled, high confidence", source, SIDES,
    )  # fmt: skip


def _requirement(
    standard: str,
    name: str,
    formula: str,
    value: float,
    clause: str,
    quantity: Literal["energy", "force", "height", "angle"],
    unit: str,
    confidence: Confidence,
    source: str,
    come_from: tuple[str, ...],
) -> Requirement:
    return Requirement(
        standard=standard,
        name=name,
        formula=formula,
        clause=clause,
        quantity=quantity,
        unit=unit,
        value=value,
        bound="least",
        source=source,
        confidence=confidence,
        come_from=come_from,
    )
