"""One requirement beside what a run gave: the margin, and whether that is a verdict or a comparison."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

from rollover.spec.standards.requirement import Requirement
from rollover.system.numbers import brief, percent

Verdict = Literal["met", "not met", "no verdict", "compared"]
ROUNDING = 1e-9  # relative; a force that is held at what was asked is what was asked


@dataclass(frozen=True, kw_only=True)
class Criterion:
    """One requirement, the simulated value in its unit, and their relation.

    `margin` is (simulated - required)/required, turned round where the requirement is a most; within a range it is 0;
    of a distance that must stay positive it is the distance itself, m. Positive is good. It is None where the simulated
    value is only how far a test was told to go. `met` and `not met` are verdicts; `no verdict` is a test that was not
    told to go as far as asked, `compared` is no test. `at_half_step` is the simulated value at half the step, None if
    not examined.
    """

    requirement: Requirement
    simulated: float
    margin: float | None
    verdict: Verdict
    note: str
    at_half_step: float | None = None

    @property
    def in_words(self) -> tuple[str, str, str]:
        """What is asked, what was simulated and the margin, as people read them; a comparison has a ratio instead."""
        return _in_words(self)

    @property
    def half_step_in_words(self) -> str:
        """By how much half the step changes the simulated value; empty if not examined."""
        return _half_step_in_words(self)


def read(row: Mapping[str, Any]) -> Criterion:
    """The criterion of a row that a results file holds."""
    return Criterion(**{**row, "requirement": Requirement(**row["requirement"])})


def compared(requirement: Requirement, simulated: float, note: str) -> Criterion:
    """A requirement beside a value that was not got as the requirement asks."""
    margin = _margin(requirement, simulated)
    return Criterion(requirement=requirement, simulated=simulated, margin=margin, verdict="compared", note=note)


def judged(requirement: Requirement, simulated: float, note: str, *, otherwise: bool = True) -> Criterion:
    """A requirement and its verdict; it is not met either where it does not hold `otherwise`."""
    row, margin = compared(requirement, simulated, note), _margin(requirement, simulated)
    return replace(row, verdict="met" if otherwise and margin >= -ROUNDING else "not met")


def prescribed(requirement: Requirement, simulated: float, given: float, note: str) -> Criterion:
    """A requirement beside what a test that broke nothing reached: it was told to go as far as `given`, no further."""
    row = judged(requirement, simulated, note)
    if row.verdict == "met":
        return replace(row, margin=None)
    if given < requirement.value * (1.0 - ROUNDING):
        note += "; not loaded far enough: no verdict"
        return replace(row, margin=None, verdict="no verdict", note=note)
    return row


def _margin(requirement: Requirement, simulated: float) -> float:
    required, upper = requirement.value, requirement.upper
    if requirement.quantity == "distance":
        return simulated - required
    if requirement.bound == "range":
        assert upper is not None
        return min(simulated / required - 1.0, 0.0) + min(1.0 - simulated / upper, 0.0)
    sign = 1.0 if requirement.bound == "least" else -1.0
    return sign * (simulated - required) / required


def with_half_step(rows: Sequence[Criterion], finer: Sequence[Criterion]) -> tuple[Criterion, ...]:
    """The rows with the values of the same run at half the step; a verdict that turns there is told."""
    other = {(row.requirement.standard, row.requirement.name): row for row in finer}
    found = []
    for row in rows:
        half = other.get((row.requirement.standard, row.requirement.name))
        if half is not None:
            turned = f"; {half.verdict} at half the step" if half.verdict != row.verdict else ""
            row = replace(row, at_half_step=half.simulated, note=row.note + turned)
        found.append(row)
    return tuple(found)


# SI unit -> unit that people read, and its factor
_READ = {"N": ("kN", 1e-3), "J": ("kJ", 1e-3), "m": ("mm", 1e3), "rad": ("deg", 180.0 / math.pi), "1": ("%", 100.0)}


def _in_words(row: Criterion) -> tuple[str, str, str]:
    asked, q = row.requirement, row.requirement.quantity
    unit, factor = _READ.get(asked.unit, (asked.unit, 1.0))
    if asked.upper is not None:
        needed = f"{asked.value * factor:.4g} to {asked.upper * factor:.4g} {unit}"
    else:
        needed = f"{'at least' if asked.bound == 'least' else 'at most'} {asked.value * factor:.4g} {unit}"
    if q == "distance" and row.margin is not None:
        needed, margin = "stays outside", f"{1e3 * row.margin:+.0f} mm"
    elif row.margin is None:
        margin = "not stated"
    elif asked.upper is not None:
        margin = "within" if row.margin == 0.0 else f"{100.0 * row.margin:+.0f} %"
    elif row.verdict == "compared" and asked.value > 0.0:
        margin = f"{row.simulated / asked.value:.2f} x"
    else:
        margin = f"{round(100.0 * row.margin, 1) + 0.0:+.1f} %"
    simulated = row.simulated * factor
    if unit == "%":
        simulated = round(simulated, 3) + 0.0  # less is rounding of the run
    return needed, f"{simulated:.4g} {unit}", margin


def _half_step_in_words(row: Criterion) -> str:
    if row.at_half_step is None:
        return ""
    change = row.at_half_step - row.simulated
    if row.requirement.quantity == "distance":
        return f"{brief(1e3 * abs(change))} mm"
    if row.requirement.quantity == "share" or not row.simulated:
        return f"{brief(100.0 * abs(change))} points"
    return percent(abs(change / row.simulated))
