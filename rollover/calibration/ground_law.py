"""From recordings to a soil file: what `rollover identify` does between reading and writing."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from ground.drops import Drop, UnusableDrop, found_contact, loading, rest_stiffness, with_terminal_drag
from ground.identify import Identified, LawMass, identify, stiffness
from ground.law import GroundLaw
from ground.penetration import Fitted, chosen, fit_forms, law
from ground.rise import check_one_soil
from rollover.comparison.onset import UnknownOnsetError, timed
from rollover.recording import Recording
from rollover.recording.time_stamps import Zero, from_first
from rollover.scenario import Scenario
from rollover.spec.vehicle import Striker
from rollover.system.errors import Fault, InputError

FORMAT = "rollover-identification/1"
_CHANNELS = {"force": "ground/force_normal", "sinkage": "ground/sinkage", "acceleration": "striker/acceleration_z"}


@dataclass(frozen=True, kw_only=True)
class Found:
    """The answer: the law for the soil file, all numbers for `identify.json`, the lines of the table."""

    law: GroundLaw
    answer: Mapping[str, Any]
    table: tuple[tuple[str, ...], ...]
    remarks: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Usable:
    """Recordings on the scenario's time, the zeros that were found for it, and a sentence for each left out."""

    recordings: Mapping[str, Recording]
    zeros: Mapping[str, Zero]
    refused: tuple[str, ...]


def usable(recordings: Mapping[str, Recording], scenario: Scenario) -> Usable:
    """The recordings with the zero of each clock where a drop begins; those without a speed have their stamps only.

    Raises `InputError` for a condition that the scenario does not know.
    """
    found: dict[str, Recording] = {}
    zeros: dict[str, Zero] = {}
    refused: list[str] = []
    for name, recording in recordings.items():
        if "initiation.speed" not in recording.conditions:  # clock and speed are found together, see `drop_of`
            found[name] = replace(recording, time=from_first(recording.time))
            continue
        try:
            one = timed(name, recording, scenario.replaced(recording.conditions, origin=name))
        except UnknownOnsetError as reason:
            refused.append(str(reason))
            continue
        found[name] = one.recording
        zeros |= {} if one.zero is None else {name: one.zero}
    if not found:
        raise InputError(*(Fault(message=reason) for reason in refused))
    return Usable(recordings=found, zeros=zeros, refused=tuple(refused))


def drop_of(
    name: str,
    recording: Recording,
    scenario: Scenario,
    *,
    buoyancy: float = 0.0,
    terminal: bool = False,
    to_depth: float | None = None,
) -> Drop:
    """A recording as a drop of the scenario's striker, with what its own conditions replace. Raises `InputError`.

    Rows below `to_depth` (m) are of another soil.
    A recording without `initiation.speed` is one whose clock and speed are found from its deceleration.
    """
    stated = {path: value for path, value in recording.conditions.items() if path != "initiation.speed"}
    scenario = scenario.replaced(stated, origin=name) if stated else scenario
    striker = scenario.vehicle
    if not isinstance(striker, Striker):
        raise InputError(
            Fault(file=name, path="vehicle.kind", message=f"not a striker, got {striker.kind!r}; 'striker'")
        )
    is_cone = striker.nose == "cone"
    found = {field: recording.channels.get(channel) for field, channel in _CHANNELS.items()}
    upward = found["acceleration"]
    speed = recording.conditions.get("initiation.speed")
    drop = Drop(
        name=name,
        time=recording.time,
        mass=striker.mass,
        speed=float(speed) if speed is not None else math.nan,
        area=math.pi * striker.nose_radius**2 if is_cone else striker.face_length * striker.face_width,
        force=found["force"],
        sinkage=found["sinkage"],
        acceleration=None if upward is None else -np.asarray(upward),
        cone_height=striker.nose_height if is_cone else 0.0,
        gravity=scenario.gravity,
        buoyancy=buoyancy,
        zero_error=recording.clock.within or 0.0,
        to_depth=math.inf if to_depth is None else to_depth,
    )
    if speed is None:
        drop = found_contact(drop)
    return with_terminal_drag(drop) if terminal else drop


def drops_of(
    recordings: Mapping[str, Recording],
    scenario: Scenario,
    *,
    buoyancy: float = 0.0,
    terminal: bool = False,
    to_depth: float | None = None,
) -> tuple[list[Drop], list[str]]:
    """The usable drops and a sentence for each that is not. Raises `InputError` if none is left."""
    drops, refused = [], []
    for name, recording in recordings.items():
        try:
            drops.append(drop_of(name, recording, scenario, buoyancy=buoyancy, terminal=terminal, to_depth=to_depth))
        except UnusableDrop as reason:
            refused.append(str(reason))
    if not drops:
        raise InputError(*(Fault(message=reason) for reason in refused))
    return drops, refused


def of_one_soil(drops: Sequence[Drop], fraction: float) -> tuple[list[Drop], list[str]]:
    """The drops in which the law's K' falls all the way down, and a sentence for each that reaches a harder layer.

    Raises `InputError` if none is left.
    """
    kept, refused = [], []
    for drop in drops:
        try:
            check_one_soil(loading(drop, fraction))
        except UnusableDrop as reason:
            refused.append(str(reason))
        else:
            kept.append(drop)
    if not kept:
        raise InputError(*(Fault(message=reason) for reason in refused))
    return kept, refused


def zeros_of(drops: Sequence[Drop], recordings: Mapping[str, Recording]) -> dict[str, Zero]:
    """Of the drops whose clock and speed their deceleration told: where their zero is on the recordings' clocks."""
    return {
        drop.name: Zero(
            late=float(recordings[drop.name].time[0]) - float(drop.time[0]),
            sigma=drop.zero_error,
            by="deceleration",
            why="unknown",
            channels=(_CHANNELS["acceleration"],),
        )
        for drop in drops
        if "initiation.speed" not in recordings[drop.name].conditions
    }


def identified(
    drops: Sequence[Drop],
    hashes: Mapping[str, str],
    *,
    form: Literal["ye-2006", "bearing"],
    fraction: float,
    law_mass: LawMass,
    keep: bool,
    source: str,
) -> Found:
    """Identify a law of one form. Raises `InputError`."""
    marks = [f"{drop.name} sha256:{hashes[drop.name]}" for drop in drops]
    try:
        if form == "bearing":
            return _penetration(drops, fit_forms(drops), source, marks)
        found = identify(drops, fraction=fraction, law_mass=law_mass, keep=keep, source=source, recordings=marks)
    except ValueError as reason:  # an unusable drop, a cone, numbers outside the law's bounds
        raise InputError(Fault(message=str(reason))) from None
    return _branches(found, source, marks)


def _branches(found: Identified, source: str, marks: Sequence[str]) -> Found:
    branches = found.branches
    drops = []
    for j, load in enumerate(branches.loads):
        z, K, sd = stiffness(load)
        shown, both = branches.known[j], branches.known[[j, len(branches.loads) + j]].all()
        drops.append(
            {
                "name": load.drop.name,
                "speed": load.drop.speed,
                "mass": load.drop.mass,
                "area": load.drop.area,
                "deepest": load.deepest,
                "time_of_deepest": load.duration,
                "first_stiffness": float(branches.first[j]) if shown else None,
                "branch_change": float(branches.change[j]) if both else None,
                "rest_stiffness": rest_stiffness(load),
                "assumed": list(load.assumed),
                "noise": load.noise,
                "stiffness": {"depth": z.tolist(), "value": K.tolist(), "sd": sd.tolist()},
            }
        )
    rows = [("coefficient", "value", "95 % from", "to", "")]
    for c in found.coefficients:
        note = {"data": "", "kept": "kept as published", "neutral": "neutral"}[c.origin]
        rows.append((c.name, f"{c.value:.5g}", _text(c.low), _text(c.high), ", ".join(filter(None, (note, c.why)))))
    answer = {
        "format": FORMAT,
        "law": "ye-2006",
        "source": source,
        "recordings": list(marks),
        "co_moving_fraction": found.fraction,
        "law_mass": found.law_mass,
        "coefficients": [vars(c) for c in found.coefficients],
        "covariance": found.covariance.tolist(),
        "multiple_correlation": found.correlation,
        "log_scatter": found.log_scatter,
        "between_drops": found.between_drops,
        "drops": drops,
    }
    remarks = [
        f"R = {found.correlation:.3f} (the paper: 0.923); ln K' scatters by {found.log_scatter:.2g} about the law, "
        f"{found.between_drops:.2g} of it between drops"
    ]
    remarks += [f"{c.name}: not determined by these drops: {c.why}" for c in found.coefficients if c.origin != "data"]
    return Found(law=found.law, answer=answer, table=tuple(rows), remarks=tuple(remarks))


def _penetration(drops: Sequence[Drop], forms: Mapping[str, Fitted], source: str, marks: Sequence[str]) -> Found:
    best = chosen(dict(forms))
    soil = law(best, drops, source=source, recordings=marks)
    rows = [("form", "fit, of largest force", "scatter of ln F", "held-out deceleration", "held-out depth")]
    for name, fitted in forms.items():
        rows.append(
            (
                f"{name} *" if fitted is best else name,
                f"{100.0 * fitted.residual:.1f} %",
                f"{fitted.log_scatter:.2f}",
                f"{100.0 * fitted.deceleration_error:.0f} %",
                f"{100.0 * fitted.depth_error:.0f} %",
            )
        )
    answer = {
        "format": FORMAT,
        "law": "bearing",
        "source": source,
        "recordings": list(marks),
        "chosen": best.form.name,
        "drops": [
            {"name": d.name, "speed": d.speed, "mass": d.mass, "area": d.area, "buoyancy": d.buoyancy, "drag": d.drag}
            for d in drops
        ],
        "forms": [
            {
                "name": name,
                "statement": fitted.form.statement,
                "numbers": [
                    {"name": n, "value": v, "low": low, "high": high}
                    for n, v, low, high in zip(
                        fitted.form.names, fitted.value.tolist(), fitted.low.tolist(), fitted.high.tolist(), strict=True
                    )
                ],
                "log_scatter": fitted.log_scatter,
                "between_drops": fitted.between_drops,
                "contact_deeper_by": fitted.contact.tolist(),
                "residual": fitted.residual,
                "held_out": [vars(h) for h in fitted.held_out],
                "held_out_deceleration_error": fitted.deceleration_error,
                "held_out_depth_error": fitted.depth_error,
            }
            for name, fitted in forms.items()
        ],
    }
    remarks = [f"{interval.of}: {_text(interval.low)} to {_text(interval.high)}" for interval in _intervals(soil)]
    better = [name for name, fitted in forms.items() if fitted.error < best.error]
    if better:
        remarks.append(f"{' and '.join(better)} did better on the drops left out, and has no law of its own for a cone")
    return Found(law=soil, answer=answer, table=tuple(rows), remarks=tuple(remarks))


def _intervals(soil: GroundLaw) -> Sequence[Any]:
    return soil.calibration.intervals if soil.calibration is not None else ()


def _text(number: float | None) -> str:
    return "not bounded" if number is None else f"{number:.4g}"


def head(found: Found) -> str:
    """Opening comment of the soil file."""
    lines = ["Soil identified from recorded drops.", str(found.answer["source"])]
    lines += ["  ".join(cell.ljust(20) for cell in row).rstrip() for row in found.table]
    return "\n".join([*lines, *found.remarks])


__all__ = ["FORMAT", "Found", "Usable", "drop_of", "drops_of", "head", "identified", "usable", "zeros_of"]
