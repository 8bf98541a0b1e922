"""Who competes: every effect of the table that can act on these recordings, sensor effects once for each channel."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ground.law import REFERENCE_AREA, REFERENCE_MASS
from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.fit.parameterisation import Candidate, coordinate, physical
from rollover.diagnosis.forward.forward_model import set_up
from rollover.diagnosis.settings import SETTINGS
from rollover.effects import EFFECTS, Heard, Search, effects
from rollover.scenario import Scenario
from rollover.spec.document import value_at
from rollover.spec.vehicle import Striker

Array = NDArray[np.float64]
TUNING = SETTINGS.selection.candidates


def size_of(scenario: Scenario) -> tuple[float, float]:
    """Mass and face over those of the reference striker, for which the ranges are; a vehicle has no face: 1."""
    vehicle = scenario.vehicle
    if not isinstance(vehicle, Striker):
        return min(vehicle.whole.mass / REFERENCE_MASS, 1.0), 1.0
    face = math.pi * vehicle.nose_radius**2 if vehicle.nose == "cone" else vehicle.face_length * vehicle.face_width
    return vehicle.mass / REFERENCE_MASS, face / REFERENCE_AREA


def candidates_of(
    dataset: Sequence[Dataset],
    switched_on: Iterable[str],
    acts: str,
    scenario: Any = None,
    size: tuple[float, float] = (1.0, 1.0),
) -> list[Candidate]:
    """All candidates for these recordings; effects that the scenario has switched on already do not compete.

    `size` is that of what falls, see `size_of`.
    """
    effects()
    found, heard = [], of_sensors(dataset)
    tried = set_up(scenario, dataset[0].recording) if scenario is not None and dataset else scenario
    in_fluid = scenario is not None and scenario.ground.law.fluid
    for name, kind in EFFECTS.items():
        if name in switched_on or acts not in kind.acts or not kind.competes or (kind.solid and in_fluid):
            continue
        if kind.kind == "sensor":
            found += [c for c in heard if c.id == name]
            continue
        sized = {p: _sized(s, kind.grows.get(p), size) for p, s in kind.search.items()}
        wide = {p: s if p in kind.secondary else _widened(s, kind.null.get(p)) for p, s in sized.items()}
        there = {p: own for p, w in wide.items() if (own := kind.looked_for(p, w, tried)) is not None}
        search = {p: s for p, s in there.items() if p not in kind.secondary}
        if not search:
            continue
        secondary = {p: there[p] for p in kind.secondary if p in there}
        unlike = {} if scenario is None else {p: _null_coordinate(kind, p, s, scenario) for p, s in search.items()}
        null = None if acts == "drop" else tuple(unlike.get(p) for p in search)
        held = {p: physical(x, search[p]) for p, x in unlike.items() if x is not None and kind.null.get(p) is None}
        found.append(
            Candidate(
                id=name, kind=kind.kind, family=kind.family, search=search, secondary=secondary, null=null, own=held
            )
        )
    return found


def of_sensors(dataset: Sequence[Dataset]) -> list[Candidate]:
    """Effects of sensors that can act on what was recorded, once for each channel."""
    spans: dict[str, float] = {}
    bounds: dict[str, float] = {}
    for e in dataset:
        for s in e.signals:
            spans[s.channel] = max(spans.get(s.channel, 0.0), s.span)
            bounds[s.channel] = max(bounds.get(s.channel, 0.0), s.end)
    times = _times(dataset)
    heard = [Heard(channel, spans, times.get(channel, 1.0), bounds[channel]) for channel in spans]
    return [
        Candidate(
            id=name,
            kind=kind.kind,
            family=kind.family,
            search={p: s for p, s in ranges.items() if p not in kind.secondary},
            secondary={p: s for p, s in ranges.items() if p in kind.secondary},
            channel=of.channel,
        )
        for name, kind in EFFECTS.items()
        if kind.kind == "sensor"
        for of in heard
        if (ranges := kind.looked_for_on(of)) is not None
    ]


def _null_coordinate(kind: Any, parameter: str, search: Search, scenario: Any) -> float | None:
    """Coordinate at which a parameter changes nothing: its null, or what gives the scenario's own value; else None."""
    null = kind.null.get(parameter)
    if null is not None:
        inside = search.low < null < search.high
        return coordinate(float(null), search) if inside else None

    def off(x: float) -> float | None:
        others = {name: value for name, value in kind.null.items() if name != parameter}
        changed = kind(**{**others, parameter: physical(x, search)}).changes(scenario)
        ways = [d for path, value in changed.items() for d in _apart(value, value_at(scenario, path))]
        return sum(ways) if ways and (min(ways) >= 0.0 or max(ways) <= 0.0) else None

    low, high = 0.0, 1.0
    first, last = off(low), off(high)
    if first is None or last is None or first * last >= 0.0:
        return None
    for _ in range(40):
        middle = 0.5 * (low + high)
        here = off(middle)
        if here is None:
            return None
        low, high = (middle, high) if here * first > 0.0 else (low, middle)
    return 0.5 * (low + high)


def _apart(value: Any, other: Any) -> list[float]:
    """Differences of numbers, or of those in tuples."""
    if isinstance(value, tuple) and isinstance(other, tuple):
        return [d for a, b in zip(value, other, strict=True) for d in _apart(a, b)]
    if isinstance(value, (int, float)) and isinstance(other, (int, float)):
        return [float(value - other)] if value != other else []
    return []


def _sized(search: Search, powers: tuple[float, float] | None, size: tuple[float, float]) -> Search:
    """The range for what falls: all of it smaller with what is smaller, and wider with what is larger in any way."""
    mass, face = (0.0, 0.0) if powers is None else powers
    whole = size[0] ** mass * size[1] ** face
    smaller = min(size[0], 1.0) ** mass * min(size[1], 1.0) ** face
    bounds = (search.low * f for f in (whole, smaller)), (search.high * f for f in (whole, smaller))
    return Search(min(bounds[0]), max(bounds[1]), search.scale)


def _widened(search: Search, null: float | None) -> Search:
    """The range with strengths that only a low noise shows."""
    return search._replace(low=search.low / TUNING.faintest) if search.scale == "log" and null == 0.0 else search


def _times(dataset: Sequence[Dataset]) -> dict[str, float]:
    """How many times as far as the scenario has it each channel moves, the middle recording's.

    Below 0 where it is turned round.
    """
    found: dict[str, list[float]] = {}
    for e in dataset:
        predicted = e.simulator.predict({}, 0.0) or {}
        for s in e.signals:
            made = predicted[s.channel][s.rows] if s.channel in predicted else np.zeros(1)
            simulated = float(np.ptp(made))
            if simulated > 0.0 and math.isfinite(simulated):
                turned = float(s.values @ made) < -TUNING.reversed_correlation * float(
                    np.linalg.norm(s.values) * np.linalg.norm(made)
                )
                found.setdefault(s.channel, []).append((-1.0 if turned else 1.0) * float(np.ptp(s.values)) / simulated)
    return {channel: float(np.median(each)) for channel, each in found.items()}
