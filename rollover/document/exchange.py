"""Values exchanged by path in objects that exist: no text is parsed; the classes check their own bounds."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar, cast

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
        by_key = known[step].by_key if known else None
        fresh = [key for key, p in place.below.items() if p.at is None and key not in inner] if by_key else []
        if by_key and fresh:
            table = by_key.table()
            inner = {**inner, **{key: table[key]() for key in fresh}}
        here[step] = _exchanged(inner, place.below, values)
    if isinstance(thing, tuple):
        names = {getattr(item, "name", None): i for i, item in enumerate(thing)}
        at = {names[step] if step in names else int(step): value for step, value in here.items()}
        return tuple(at.get(i, item) for i, item in enumerate(thing))
    if isinstance(thing, Mapping):
        return {**thing, **here}
    for step in here:
        if step not in known:
            raise KeyError(f"no such path: {step} in {kind.__name__}")
    return replace(thing, **here)


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
