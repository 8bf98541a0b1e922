"""Values exchanged by path in objects that exist: no text is parsed; the classes check their own bounds."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar, cast

from ground.kinds import ByKey
from rollover.document.slot import slots

T = TypeVar("T")


@dataclass(slots=True)
class _Place:
    """Where the k-th value goes, if one does, and the places below."""

    at: int | None = None
    below: dict[str, _Place] = field(default_factory=dict)


def exchanged(thing: T, changes: Mapping[str, Any]) -> T:
    """Return `thing` with the values at some paths exchanged, a hundred times faster than `replaced`.

    For values that are already what they are meant to be: numbers, tuples, objects of parameter classes. Parts in a
    list go by name or place; an effect is switched on by naming one of its parameters. Raises ``ValueError`` for a
    value out of bounds and ``KeyError`` for a path that does not exist.
    """
    return cast(T, _exchanged(thing, _places(tuple(changes)), tuple(changes.values())))


@functools.lru_cache(maxsize=1024)  # a fit exchanges values at the same paths time and again
def _places(paths: tuple[str, ...]) -> dict[str, _Place]:
    whole = _Place()
    for k, path in enumerate(paths):
        place = whole
        for step in path.split("."):
            place = place.below.setdefault(step, _Place())
        place.at = k
    return whole.below


def _exchanged(thing: Any, places: Mapping[str, _Place], values: tuple[Any, ...]) -> Any:
    kind: Any = type(thing)
    known = {} if isinstance(thing, (tuple, Mapping)) else slots(kind)
    here: dict[str, Any] = {}
    for step, place in places.items():
        if not place.below:
            here[step] = values[cast(int, place.at)]
            continue
        inner = _part(thing, step) if place.at is None else values[place.at]
        if known and (by_key := known[step].by_key):
            here[step] = _exchanged_by_key(inner, place.below, values, by_key)
        else:
            here[step] = _exchanged(inner, place.below, values)
    if isinstance(thing, tuple):
        names = {getattr(item, "name", None): i for i, item in enumerate(thing)}
        at = {names[step] if step in names else int(step): value for step, value in here.items()}
        return tuple(at.get(i, item) for i, item in enumerate(thing))
    if isinstance(thing, Mapping):
        return {**thing, **here}
    return replace(thing, **_named(kind, here))


def _exchanged_by_key(
    table: Mapping[str, Any], places: Mapping[str, _Place], values: tuple[Any, ...], by_key: ByKey
) -> dict[str, Any]:
    """A mapping whose keys say what their values are: one that is not there begins with what it is given."""
    found = dict(table)
    for key, place in places.items():
        if not place.below:
            found[key] = values[cast(int, place.at)]
        elif place.at is not None or key in found:
            found[key] = _exchanged(found[key] if place.at is None else values[place.at], place.below, values)
        elif any(p.below for p in place.below.values()):
            found[key] = _exchanged(by_key.table()[key](), place.below, values)
        else:
            kind = by_key.table()[key]
            found[key] = kind(**_named(kind, {step: values[cast(int, p.at)] for step, p in place.below.items()}))
    return found


def _named(kind: Any, own: dict[str, Any]) -> dict[str, Any]:
    """The same. Raises ``KeyError`` for a name that the class does not know."""
    for name in own:
        if name not in slots(kind):
            raise KeyError(f"no such path: {name} in {kind.__name__}")
    return own


def value_at(thing: Any, path: str) -> Any:
    """The value at a path, with parts of a list by name or place. Raises ``KeyError`` for one that does not exist."""
    for step in path.split("."):
        thing = _part(thing, step)
    return thing


def _part(thing: Any, step: str) -> Any:
    if isinstance(thing, tuple):
        return next((item for item in thing if getattr(item, "name", None) == step), None) or thing[int(step)]
    if isinstance(thing, Mapping):
        return thing[step]
    kind: Any = type(thing)
    if step not in slots(kind):
        raise KeyError(f"no such path: {step} in {kind.__name__}")
    return getattr(thing, step)
