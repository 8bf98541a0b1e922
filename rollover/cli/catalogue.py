"""What exists: shipped files, laws, effects, channels, paths; and whether a file is valid."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterable
from dataclasses import fields
from pathlib import Path
from typing import Any, Literal

from ground.quantity import quantities
from rollover import scenario as scenarios
from rollover.effects import effects as known_effects
from rollover.effects import units_of
from rollover.spec import channels as table
from rollover.spec import document
from rollover.spec.laws import laws as known_laws
from rollover.spec.rops import Rops
from rollover.spec.steel import Steel
from rollover.spec.vehicle import Vehicle, pitch_inertia
from rollover.system import own_code
from rollover.system.errors import Fault, InputError

Row = dict[str, Any]


def files(folder: str) -> list[Row]:
    """Shipped files of a folder, each with the first sentence of its opening comment."""
    shelf = document.shipped_folder() / folder
    return [{"name": path.stem, "is": headline(path)} for path in sorted(shelf.glob("*.yaml"))]


def headline(path: Path) -> str:
    """First sentence of the comment that a file opens with."""
    lines = []
    for line in path.read_text(encoding="utf-8").splitlines():
        if not line.startswith("#") or not line.strip("# "):
            break
        lines.append(line.strip("# "))
    first = re.split(r"(?<=[.?!]) ", " ".join(lines), maxsplit=1)[0]
    return first.rstrip(".")


def vehicles() -> list[Row]:
    """Shipped vehicles, with their pitch inertia about the rear axle beside what pendulum tests expect."""
    shelf = document.shipped_folder() / "vehicles"
    found = []
    for row in files("vehicles"):
        vehicle = document.load(shelf / f"{row['name']}.yaml", scenarios.AnyVehicle)
        inertia = pitch_inertia(vehicle) if isinstance(vehicle, Vehicle) else None
        found.append({**row, "pitch": "" if inertia is None else pitch_line(*inertia)})
    return found


def pitch_line(about: float, anchor: float) -> str:
    """A pitch inertia about the rear axle against 0.378 M L^2, as vehicle files state it."""
    change = 100.0 * (about / anchor - 1.0)
    return (
        f"pitch inertia about the rear axle {about:.0f} kg m2 against 0.378 M L^2 = {anchor:.0f} kg m2, {change:+.1f} %"
    )


def laws() -> list[Row]:
    """Ground laws by kind."""
    return [{"kind": kind, "is": _first_line(law)} for kind, law in known_laws().items()]


def effects() -> list[Row]:
    """Effects by id."""
    known: dict[str, Any] = dict(known_effects())
    return [
        {"id": name, "kind": effect.kind, "parameters": _numbers(effect), "is": _first_line(effect)}
        for name, effect in known.items()
    ]


def candidates(kind: Literal["drop", "rollover"]) -> list[Row]:
    """Effects that may be named as what a test of this kind misses, with all that is needed to try them."""
    known: dict[str, Any] = dict(known_effects())
    return [
        {
            "id": name,
            "kind": effect.kind,
            "is": _first_line(effect),
            "equation": effect.equation,
            "switched_on_by": f"effects.{name}.PARAMETER",
            "needs_a_channel": effect.kind == "sensor",
            "parameters": {
                n: {"unit": units_of(effect)[n], "low": s.low, "high": s.high, "spaced": s.scale}
                for n, s in _searched(effect).items()
            },
        }
        for name, effect in known.items()
        if effect.competes and kind in effect.acts
    ]


def _searched(effect: Any) -> dict[str, Any]:
    """Ranges of an effect's numbers, those of its other forms among them."""
    return {**{n: s for form in effect.forms for n, s in form.search.items()}, **effect.search}


def _numbers(effect: Any) -> str:
    """Parameters of an effect with their defaults: ``depth 0.25 m, stiffness_ratio 3``."""
    units = quantities(effect)
    typical = {f.name: getattr(effect(), f.name) for f in fields(effect)}
    words = [
        f"{name} {text(list(value) if isinstance(value, tuple) else value)}"
        + (f" {units[name].unit}" if name in units and units[name].unit != "1" and value is not None else "")
        for name, value in typical.items()
    ]
    return ", ".join(words)


def channels() -> list[Row]:
    """All channels with their units."""
    return [vars(channel) for channel in table.CHANNELS.values()]


def importers() -> list[Row]:
    """File formats that `rollover import` reads, and published sets of recordings."""
    from rollover.recording.importers import COLLECTIONS
    from rollover.recording.importers import importers as known

    formats = [{"name": i.name, "is": i.meaning, "where": ""} for i in known().values()]
    return formats + [
        {"name": c.name, "is": c.meaning, "where": f"{c.where}, {c.licence}"} for c in COLLECTIONS.values()
    ]


def paths(name: str) -> list[Row]:
    """Every value of a scenario with the path by which it is replaced."""
    return [leaf._asdict() for leaf in document.paths(scenarios.load(name))]


TABLES: dict[str, Callable[[], list[Row]]] = {
    "scenarios": lambda: files(""),
    "studies": lambda: files("studies"),
    "vehicles": vehicles,
    "soils": lambda: files("soils"),
    "steels": lambda: files("steels"),
    "laws": laws,
    "effects": effects,
    "channels": channels,
    "importers": importers,
}


def check(name: str) -> str:
    """Validate a file and say what it is: scenario, study, vehicle, ROPS, steel, soil, baseline, profile, law, effect.

    Raises `InputError`.
    """
    path = _found(name)
    if path.suffix.lower() == ".py":
        return _check_code(path)
    keys = document.headings(path)
    kind = document.stated_kind(keys, (*known_laws(), *document.slot_of(scenarios.AnyVehicle).kinds))
    form = str(keys["format"].plain if "format" in keys else "")
    if form.startswith("rollover-profile/"):
        from rollover.recording.importers.sidecar import Profile, read_described

        read_described(path, Profile)
        return "profile"
    if form.startswith("rollover-baseline/"):
        from rollover.studies import baseline  # brings the simulator along, which the other files need not

        baseline.read(path)
        return "baseline"
    if form.startswith("rollover-study/") or "axes" in keys:
        from rollover import studies as study
        from rollover.studies.design import points

        points(study.load(path))  # reads the plan's table as well
        return "study"
    for what, annotation, meant in (
        ("soil", scenarios.AnyLaw, kind in known_laws()),
        ("vehicle", scenarios.AnyVehicle, kind in document.slot_of(scenarios.AnyVehicle).kinds),
        ("rops", Rops, bool({"mounts", "feet"} & set(keys))),
        ("steel", Steel, "yield_strength" in keys),
    ):
        if meant:
            document.load(path, annotation)
            return what
    if kind is None and not set(keys) & set(document.slot_of(scenarios.Scenario).keys()) - {"title"}:
        raise InputError(Fault(file=str(path), line=1, path="kind", message=_which_kind(keys)))
    scenarios.load(path)
    return "scenario"


def _check_code(path: Path) -> str:
    """Load a Python file of one's own and say what it adds. Raises `InputError`."""
    kind: Literal["effects", "laws"] = "laws" if "GroundLaw" in path.read_text("utf-8", "replace") else "effects"
    own_code.add(kind, [path])
    table: dict[str, Any] = dict(known_laws() if kind == "laws" else known_effects())
    found = [name for name, thing in table.items() if own_code.file_of(kind, thing) == path.resolve()]
    if not found:
        message = "neither a ground law nor an effect, got no class derived from GroundLaw or Effect; one is needed"
        raise InputError(Fault(file=str(path), message=message))
    return f"{kind.removesuffix('s')} {', '.join(found)}"


def _which_kind(keys: Iterable[str]) -> str:
    """Ask what a file without a `kind` is; the kind whose keys it has most of comes first."""
    slots = {"a vehicle": document.slot_of(scenarios.AnyVehicle), "a soil": document.slot_of(scenarios.AnyLaw)}
    found = {
        f"{kind} ({what})": len(set(keys) & set(slot.keys(kind))) for what, slot in slots.items() for kind in slot.kinds
    }
    words = ", ".join(sorted(found, key=lambda word: -found[word]))
    return f"missing, got {', '.join(keys) or 'nothing'}; {words}, or `vehicle`, `ground` ... of a scenario, are needed"


def _found(name: str) -> Path:
    """A file, or a shipped scenario or study of that name. Raises `InputError` that speaks of scenarios."""
    try:
        return document.find(name)
    except InputError:
        study = document.shipped_folder() / "studies" / f"{name}.yaml"
        if study.is_file():
            return study
        raise


def text(value: Any) -> str:
    """A value as a file would have it."""
    if isinstance(value, bool) or value is None:
        return {True: "true", False: "false", None: "null"}[value]
    if isinstance(value, list):
        return f"[{', '.join(map(text, value))}]"
    return f"{value:g}" if isinstance(value, float) and float(f"{value:g}") == value else str(value)


def _first_line(thing: type) -> str:
    return (inspect.getdoc(thing) or "").partition("\n")[0]
