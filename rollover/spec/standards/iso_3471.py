"""ISO 3471:2008 and its kin: side force and energy, vertical and longitudinal force of earth-moving machines.

F and U are pieces in the mass M (kg): k M, or c m^p with m = M/10 000. All constants were recalled; that every branch
meets the next within 0.25 % at its breakpoint is strong evidence, not proof, that they are right.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from rollover.spec.standards.requirement import Requirement

SOURCE = "ISO 3471:2008, table 1, recalled"
LEAST_MASS = 700.0  # kg, scope of the standard


@dataclass(frozen=True, kw_only=True)
class Piece:
    """c m^p up to a mass; p = 1 with c = 10 000 k is k M."""

    up_to: float
    factor: float
    power: float

    def value(self, mass: float) -> float:
        """The formula's value at a mass (kg)."""
        return float(self.factor * (mass / 1e4) ** self.power)

    @property
    def formula(self) -> str:
        """As the table prints it."""
        return f"{self.factor / 1e4:g} M" if self.power == 1.0 else f"{self.factor:g} m^{self.power:g}, m = M/10 000"


def _linear(up_to: float, k: float) -> Piece:
    return Piece(up_to=up_to, factor=1e4 * k, power=1.0)


def _power(up_to: float, c: float, p: float) -> Piece:
    return Piece(up_to=up_to, factor=c, power=p)


@dataclass(frozen=True, kw_only=True)
class Machine:
    """Side force and side energy of one family of machines, in pieces of the mass."""

    name: str
    force: tuple[Piece, ...]
    energy: tuple[Piece, ...]


END = math.inf
MACHINES: dict[str, Machine] = {
    "crawler": Machine(
        name="crawler dozer, loader, pipelayer or trencher",
        force=(_linear(4630, 6), _power(59_500, 70_000, 1.2), _linear(END, 10)),
        energy=(_power(59_500, 13_000, 1.25), _linear(END, 2.03)),
    ),
    "grader": Machine(
        name="grader",
        force=(_linear(2140, 6), _power(38_010, 70_000, 1.1), _linear(END, 8)),
        energy=(_power(38_010, 15_000, 1.25), _linear(END, 2.09)),
    ),
    "wheel-loader": Machine(
        name="wheel loader, wheel dozer, compactor or backhoe loader",
        force=(_linear(10_000, 6), _power(128_600, 60_000, 1.2), _linear(END, 10)),
        energy=(_power(128_600, 12_500, 1.25), _linear(END, 2.37)),
    ),
    "prime-mover": Machine(
        name="prime mover of a scraper or an articulated dumper",
        force=(_linear(1010, 6), _power(32_160, 95_000, 1.2), _linear(END, 12)),
        energy=(_power(32_160, 20_000, 1.25), _linear(END, 2.68)),
    ),
    "roller": Machine(
        name="roller",
        force=(_linear(10_000, 5), _power(53_780, 50_000, 1.2), _linear(END, 7)),
        energy=(_power(53_780, 9500, 1.25), _linear(END, 1.45)),
    ),
    "rigid-dumper": Machine(
        name="rigid-frame dumper",
        force=(
            _linear(1750, 6),
            _power(22_540, 85_000, 1.2),
            _linear(58_960, 10),
            _power(111_660, 413_500, 0.2),
            _linear(END, 6),
        ),
        energy=(
            _power(22_540, 15_000, 1.25),
            _linear(58_960, 1.84),
            _power(111_660, 61_450, 0.32),
            _linear(END, 1.19),
        ),
    ),
}


def piece_at(pieces: tuple[Piece, ...], mass: float) -> Piece:
    """The piece that holds at a mass (kg); a breakpoint belongs to the piece below it."""
    return next(p for p in pieces if mass <= p.up_to)


def iso_3471_requirements(machine: str, mass: float) -> tuple[Requirement, ...]:
    """Side force (N) and energy (J), vertical 19.61 M and longitudinal force 0.8 F of a machine of `MACHINES`.

    Raises ``ValueError`` for an unknown machine, and below the scope's 700 kg.
    """
    if machine not in MACHINES:
        raise ValueError(f"machine: not in ISO 3471, got {machine!r}; {', '.join(MACHINES)}")
    if not LEAST_MASS < mass < END:
        raise ValueError(f"mass: outside the scope of ISO 3471, got {mass!r}; more than {LEAST_MASS:g} kg")
    force, energy = (piece_at(p, mass) for p in (MACHINES[machine].force, MACHINES[machine].energy))
    rows = (
        ("side force", force.formula, "force", "N", force.value(mass)),
        ("side energy", energy.formula, "energy", "J", energy.value(mass)),
        ("vertical force", "19.61 M", "force", "N", 19.61 * mass),
        ("longitudinal force", "0.8 of the side force", "force", "N", 0.8 * force.value(mass)),
    )
    return tuple(
        Requirement(
            standard="ISO 3471:2008",
            name=name,
            formula=formula,
            clause=f"table 1, {MACHINES[machine].name}",
            quantity=quantity,  # type: ignore[arg-type]
            unit=unit,
            value=value,
            bound="least",
            source=SOURCE,
            confidence="recalled, high confidence",
        )
        for name, formula, quantity, unit, value in rows
    )


def excavator(mass: float) -> dict[str, float]:
    """ISO 12117-2, recalled: side 13 000 m^1.25 J and 35 000 m^1.2 N, along 4300 m^1.25 J, vertical 12.75 M N."""
    m = mass / 1e4
    return {
        "side energy": 13_000.0 * m**1.25,
        "side force": 35_000.0 * m**1.2,
        "longitudinal energy": 4300.0 * m**1.25,
        "vertical force": 12.75 * mass,
    }
