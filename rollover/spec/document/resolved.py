"""An object of a parameter class back to what a file would say: every value, its path, its text, its hash."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import is_dataclass
from typing import Any, NamedTuple

from rollover.spec.document.slot import Slot, slot_of, slots
from rollover.spec.document.tree import write
from rollover.system.errors import seen


class Leaf(NamedTuple):
    """One value of a scenario: where it is, what it is, and what it means."""

    path: str
    value: Any
    unit: str
    meaning: str


def to_mapping(thing: Any) -> dict[str, Any]:
    """Every value of an object, defaults included, as dicts, lists, text and numbers."""
    kind: Any = type(thing)
    return {name: plain(getattr(thing, name), slot) for name, slot in slots(kind).items()}


def plain(value: Any, slot: Slot) -> Any:
    """Dicts, lists, text and numbers for whatever stands at one place."""
    if is_dataclass(value):
        return to_mapping(value)
    if isinstance(value, (tuple, list)):
        return [plain(item, slot.element(i) or slot) for i, item in enumerate(value)]
    if isinstance(value, Mapping):
        return {key: plain(item, slot) for key, item in value.items()}
    if slot.type is float and value is not None:
        return float(value) + 0.0  # 132 and 132.0 are one number, and so are 0.0 and -0.0
    return value


def dump(thing: Any, head: str = "") -> str:
    """Text of a file that gives the same object again, to the last bit; `head` becomes its opening comment."""
    comment = "".join(f"# {seen(line)}".rstrip() + "\n" for line in head.splitlines())
    return comment + write(to_mapping(thing))


def content_hash(thing: Any) -> str:
    """SHA-256 over all values, whatever the order of keys and the files they came from.

    A list that `IfAny` marks counts where something stands in it: what never had one keeps the hash that it had.
    """
    kind: Any = type(thing)
    known = slots(kind)
    stated = {key: value for key, value in to_mapping(thing).items() if value or not known[key].if_any}
    text = json.dumps(stated, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def paths(thing: Any) -> list[Leaf]:
    """Every value with the path by which it is replaced; a list of numbers is one value."""
    found: list[Leaf] = []
    _walk(thing, slot_of(type(thing)), "", found)
    return found


def unit_at(thing: Any, path: str) -> str:
    """Unit of the value at a path, "1" for a bare number; empty where there is no quantity."""
    slot, part = slot_of(type(thing)), thing
    for step in path.split("."):
        if is_dataclass(part):
            kind: Any = type(part)
            inner = slots(kind).get(step)
            part = getattr(part, step, None)
        elif isinstance(part, (tuple, list)):
            names = [getattr(item, "name", None) for item in part]
            at = names.index(step) if step in names else int(step) if step.isdecimal() else len(part)
            inner = slot.element(at) or slot
            part = part[at] if at < len(part) else None
        elif isinstance(part, Mapping):
            inner, part = slot.child(step) if slot.by_key else slot, part.get(step)
        else:
            inner = slot.child(step)
            part = None
        if inner is None:
            return ""
        slot = inner
    return slot.unit


def _walk(value: Any, slot: Slot, path: str, found: list[Leaf]) -> None:
    if is_dataclass(value):
        kind: Any = type(value)
        for name, inner in slots(kind).items():
            _walk(getattr(value, name), inner, f"{path}.{name}" if path else name, found)
    elif isinstance(value, Mapping):
        for key, item in value.items():
            _walk(item, slot, f"{path}.{key}", found)
    elif isinstance(value, (tuple, list)) and any(is_dataclass(item) for item in value):
        names = [getattr(item, "name", None) for item in value]
        named = None not in names and len(set(names)) == len(names)
        for i, item in enumerate(value):
            _walk(item, slot.element(i) or slot, f"{path}.{names[i] if named else i}", found)
    else:
        found.append(Leaf(path, plain(value, slot), slot.unit, slot.meaning))
