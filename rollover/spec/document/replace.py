"""One addressing language: values replaced by path, checked exactly like a file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import is_dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from rollover.spec.document.check import check
from rollover.spec.document.include import ENDINGS, expand, index_of
from rollover.spec.document.resolved import paths, to_mapping
from rollover.spec.document.slot import Slot, slot_of
from rollover.spec.document.tree import Node, Place, parse, planted
from rollover.system.errors import Fault, InputError, nearest

T = TypeVar("T")
ANY = "*"  # every element of a list


def replaced(thing: T, changes: Mapping[str, Any], origin: str = "replaced") -> T:
    """Return `thing` with values replaced: ``{"ground.law.stiffness_scale": 1.2}``. Raises `InputError`.

    Elements of a list are addressed by their name or their place, all of them by `*`. A value may be a number, text,
    a list, a mapping, an object of a parameter class or the name of a .yaml file. A new `kind` starts that part
    afresh: what belonged to the other kind is gone. `origin` stands for the file in messages.
    """
    place = Place(file=origin, line=None, folder=Path.cwd())
    tree = to_mapping(thing)
    fresh: dict[int, Any] = {}  # by id, and kept: an id may be given again to what comes later
    # a whole part before what is below it, a kind before what belongs to it, all elements before one of them,
    # whatever the order of a mapping
    for path in sorted(changes, key=lambda p: (p.count("."), not p.endswith("kind"), ANY not in p.split("."))):
        for each in _each(thing, tree, path, place):
            _put(thing, tree, each, changes[path], place, fresh)
    slot = slot_of(type(thing))
    result: T = check(expand(planted(tree, place), slot, ()), type(thing))
    return result


def _each(thing: Any, tree: dict[str, Any], path: str, place: Place) -> list[str]:
    """The paths that a path with `*` stands for, every element of a list; without one the path itself."""
    steps = path.split(".")
    if ANY not in steps:
        return [path]
    at = steps.index(ANY)
    part: Any = tree
    for step in steps[:at]:
        index = _index(part, step) if isinstance(part, list) else None
        part = part.get(step) if isinstance(part, dict) else None if index is None else part[index]
        part = _opened(part) if isinstance(part, Node) else part
    if not isinstance(part, list) or not part:
        raise place.fault(path, f"no list, got {'.'.join(steps[:at])!r} before the *; a list such as vehicle.wheels.*")
    names = [_plain(element.get("name")) if isinstance(element, dict) else None for element in part]
    each = [".".join([*steps[:at], name or str(i), *steps[at + 1 :]]) for i, name in enumerate(names)]
    return [found for one in each for found in _each(thing, tree, one, place)]


def parse_setting(text: str, origin: str = "--set") -> tuple[str, Node]:
    """Split ``PATH=VALUE``; the value is read as in a file. Raises `InputError`."""
    path, equals, value = text.partition("=")
    if not equals or not path.strip() or not value.strip():
        raise InputError(Fault(file=origin, message=f"not a setting, got {text!r}; PATH=VALUE is needed"))
    return path.strip(), parse(value, Place(file=origin, line=None, folder=Path.cwd()))


def _put(thing: Any, tree: dict[str, Any], path: str, value: Any, place: Place, fresh: dict[int, Any]) -> None:
    *above, last = path.split(".")
    part: Any = tree
    slot: Slot | None = slot_of(type(thing))
    for depth, step in enumerate(above, 1):
        if slot and slot.by_key and isinstance(part, dict):
            _freshen(part.setdefault(step, {}), fresh)  # an effect is switched on by naming one of its parameters
        kind = _plain(part.get("kind")) if isinstance(part, dict) else None
        index = _index(part, step) if isinstance(part, list) else None
        slot = slot and (slot.child(step, kind) if index is None else slot.element(index))
        key: Any = step if index is None else index
        if (brought := _brought(part, key, slot, place, ".".join(above[:depth]))) is not None:
            part[key] = brought
            _freshen(brought, fresh)
        part = part.get(step) if isinstance(part, dict) else None if index is None else part[index]
        if not isinstance(part, (dict, list)):
            raise _unknown(thing, path, place)
    bare = _bare(value, path, place)
    key = _index(part, last) if isinstance(part, list) else last
    if isinstance(part, list):
        if key is None:
            raise _unknown(thing, path, place)
    elif last == "kind" and "kind" in part:
        if _plain(part["kind"]) != _plain(bare):
            part.clear()
            fresh[id(part)] = part
    elif last not in part and id(part) not in fresh and not (slot and slot.by_key):
        raise _unknown(thing, path, place)
    part[key] = bare
    _freshen(bare, fresh)


def _brought(part: Any, key: Any, slot: Slot | None, place: Place, path: str) -> Any:
    """What a file that another change put here holds, opened to be reached into; None where there is no such file."""
    found = part.get(key) if isinstance(part, dict) else part[key] if isinstance(key, int) else None
    if isinstance(found, str) and found.endswith(ENDINGS):
        found = planted(found, place)
    if not isinstance(found, Node) or slot is None or not slot.kinds:
        return None
    return _opened(expand(found, slot, (), path))


def _opened(node: Node) -> Any:
    """A tree whose mappings and lists can be changed; its leaves keep their places."""
    if isinstance(node.value, Mapping):
        return {key: _opened(child) for key, child in node.value.items()}
    if isinstance(node.value, tuple):
        return [_opened(child) for child in node.value]
    return node


def _plain(value: Any) -> Any:
    return value.plain if isinstance(value, Node) else value


def _freshen(value: Any, fresh: dict[int, Any]) -> None:
    """Keys that it lacks may be set anywhere in what was just put in: it is checked as a whole in the end."""
    if isinstance(value, (dict, list)):
        fresh[id(value)] = value
        for child in value.values() if isinstance(value, dict) else value:
            _freshen(child, fresh)


def _index(elements: list[Any], step: str) -> int | None:
    return index_of([_plain(e.get("name")) if isinstance(e, dict) else None for e in elements], step)


def _bare(value: Any, path: str, place: Place) -> Any:
    if isinstance(value, Node):
        # text of the command line; a mapping is opened, so that what is below it can be set as well
        return dict(value.value) if isinstance(value.value, Mapping) else value
    if is_dataclass(value) and not isinstance(value, type):
        return to_mapping(value)
    if isinstance(value, Mapping):
        return {str(k): _bare(v, f"{path}.{k}", place) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_bare(v, f"{path}.{i}", place) for i, v in enumerate(value)]
    if isinstance(value, (np.generic, np.ndarray)):
        return _bare(value.tolist(), path, place)
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    raise place.fault(path, f"not a value of a file, got {type(value).__name__}; a number, text, list or mapping")


def _unknown(thing: Any, path: str, place: Place) -> InputError:
    known = [leaf.path for leaf in paths(thing)]
    parts = {p.rsplit(".", n)[0] for p in known for n in range(1, p.count(".") + 1)}
    close = [p for p in nearest(path, [*known, *sorted(parts)], most=4) if p != path][:3]
    help_ = f"did you mean {' or '.join(map(repr, close))}?" if close else "see `rollover list paths SCENARIO`"
    return place.fault(path, f"no such path; {help_}")
