"""`rollover rolling` between reading and writing: what a vehicle says of itself, and what rolling.json says."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from ground.quantity import quantities
from rollover.assessment.results import versions
from rollover.assessment.rolling import NarrowTractor, Rolling, calculate
from rollover.scenario import Scenario
from rollover.spec.shapes import Box
from rollover.spec.vehicle import Vehicle, laden
from rollover.system.errors import Fault, InputError, hint

FORMAT = "rollover-rolling/1"
OPTION = "--input"
SOURCE = (
    "EU 1322/2014 annex IX B4 (OECD Code 6), computer program for continuous or interrupted rolling; formulae recalled "
    "and derived anew, text not checked: no type approval"
)
NARROW = 1.150  # m: least track of a narrow tractor, recalled
WHERE = {  # where a vehicle file would say what it does not
    "rops": ("H6", "L6", "B6"),
    "front_axle": ("H0", "D0"),
    "a box called bonnet in its outline": ("H7", "B7", "L7"),
}


@dataclass(frozen=True, kw_only=True)
class Asked:
    """A vehicle's name, inputs with where each comes from, and what of it lies outside the calculation's field.

    `effects_left_out` are the scenario's, of which the calculation knows none.
    """

    vehicle: str
    tractor: NarrowTractor
    origins: Mapping[str, str]
    outside: tuple[str, ...]
    effects_left_out: tuple[str, ...]


def asked(scenario: Scenario, given: Mapping[str, Any] | None = None) -> Asked:
    """Inputs of a scenario's vehicle, `given` ones before its own. Raises `InputError` for what nobody states."""
    vehicle, given = scenario.vehicle, given or {}
    names = [f.name for f in fields(NarrowTractor)]
    for name in given:
        if name not in names:
            raise InputError(Fault(file=OPTION, path=name, message=f"not an input, got {name!r}; {hint(name, names)}"))
    if not isinstance(vehicle, Vehicle):
        message = f"has no wheels, got {vehicle.name!r}; a vehicle of kind 'vehicle'"
        raise InputError(Fault(path="vehicle", message=message))
    if vehicle.trailer is not None:
        message = f"the calculation knows no trailer, got {vehicle.name!r} with one; a vehicle without"
        raise InputError(Fault(path="vehicle.trailer", message=message))
    known = {**_known(vehicle)}
    origins = dict.fromkeys(known, "vehicle")
    known.update(given)
    origins.update(dict.fromkeys(given, OPTION))
    needed = [f.name for f in fields(NarrowTractor) if f.name not in ("A0", "U", "T")]
    if missing := [name for name in needed if name not in known]:
        of = quantities(NarrowTractor)
        said = ", ".join(f"{name} ({of[name].meaning})" for name in missing)
        absent = " and ".join(part for part, symbols in WHERE.items() if set(symbols) & set(missing))
        cure = f"{OPTION} {missing[0]}=VALUE for each"
        message = f"missing, got no {absent}; {cure}: {said}"
        raise InputError(Fault(path="vehicle", message=message))
    try:
        tractor = NarrowTractor(**known)
    except ValueError as e:
        raise _fault(e, given) from None
    origins.update({name: "regulation, recalled" for name in ("A0", "U", "T") if name not in given})
    return Asked(
        vehicle=vehicle.name,
        tractor=tractor,
        origins=origins,
        outside=_outside(vehicle, tractor),
        effects_left_out=tuple(sorted(scenario.effects)),
    )


def _known(vehicle: Vehicle) -> dict[str, float]:
    """What a vehicle with two axles says of itself."""
    whole = laden(vehicle)
    x, _, z = whole.centre_of_mass
    front = [w for w in vehicle.wheels if vehicle.on_axle(w, "front")]
    rear = [w for w in vehicle.wheels if vehicle.on_axle(w, "rear")]
    found = {"H1": z, "Mc": whole.mass, "Q": whole.inertia[0]}
    if front and rear:
        last = max(rear, key=lambda w: abs(w.centre[1]))
        found |= {
            "L3": x - last.centre[0],
            "L2": front[0].centre[0] - x,
            "D3": 2.0 * last.tyre.radius,
            "D2": 2.0 * front[0].tyre.radius,
            "S": 2.0 * abs(last.centre[1]),
            "B0": last.tyre.width,
        }
    if vehicle.front_axle is not None:
        found |= {"H0": vehicle.front_axle.pivot[2], "D0": vehicle.front_axle.swing}
    if vehicle.rops is not None:
        corner = vehicle.rops.corner
        found |= {"H6": corner[2], "L6": x - corner[0], "B6": 2.0 * abs(corner[1])}
    for shape in vehicle.outline:
        if isinstance(shape, Box) and shape.name == "bonnet":
            found |= {"H7": shape.high[2], "B7": 2.0 * max(abs(shape.low[1]), abs(shape.high[1]))}
            found["L7"] = shape.high[0] - x
    return found


def _outside(vehicle: Vehicle, t: NarrowTractor) -> tuple[str, ...]:
    """Sentences on what the calculation is not meant for."""
    said = []
    if vehicle.rops is not None and vehicle.rops.frame != "two-post-front":
        said.append(f"The ROPS is not front-mounted ({vehicle.rops.frame}): Code 6 does not ask for this calculation.")
    if t.S > NARROW:
        said.append(f"The track of {t.S:.2f} m is no narrow one (at most {NARROW:.2f} m, recalled).")
    return tuple(said)


def rolled(scenario: Scenario, given: Mapping[str, Any] | None = None) -> tuple[Asked, Rolling]:
    """Inputs and verdict. Raises `InputError`, also for shapes that the calculation does not cover."""
    found = asked(scenario, given)
    try:
        return found, calculate(found.tractor)
    except ValueError as e:
        raise _fault(e, given or {}) from None


def _fault(e: ValueError, given: Mapping[str, Any]) -> InputError:
    """What is wrong with an input, and whether it was given or the vehicle's own."""
    symbol, _, message = str(e).partition(": ")
    return InputError(Fault(file=OPTION if symbol in given else "", path=symbol, message=message))


def json_of(of: Asked, found: Rolling, about: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """What rolling.json says; `about` names what was asked."""
    unit = quantities(NarrowTractor)
    return {
        "format": FORMAT,
        **(about or {}),
        "vehicle": of.vehicle,
        "versions": versions(),
        "verdict": found.verdict,
        "sentence": found.sentence,
        "version": found.version,
        "outside": list(of.outside),
        "effects_left_out": list(of.effects_left_out),
        "source": SOURCE,
        "inputs": [
            {
                "symbol": name,
                "what": unit[name].meaning,
                "value": float(getattr(of.tractor, name)),
                "unit": unit[name].unit,
                "from": origin,
            }
            for name, origin in sorted(of.origins.items())
        ],
        "steps": [
            {"symbol": s.symbol, "what": s.what, "value": s.value, "unit": s.unit, "basis": s.basis}
            for s in found.steps
        ],
        "positions": {
            str(number): {name: [float(c) for c in point] for name, point in points.items()}
            for number, points in found.positions.items()
        },
        "slope_deg": math.degrees(of.tractor.A0),
    }
