"""Parameters with a unit and bounds, declared once and checked from files and from Python alike."""

from __future__ import annotations

import functools
import math
import re
import typing
from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from typing import Annotated, Any, TypeVar, dataclass_transform

T = TypeVar("T")


@dataclass(frozen=True)
class Quantity:
    """Unit, meaning and bounds of a number: ``Annotated[float, Quantity("kg", "striker mass", above=0)]``."""

    unit: str
    meaning: str = ""
    above: float | None = None
    least: float | None = None
    most: float | None = None
    below: float | None = None

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> dict[str, Any]:
        """Hand the bounds to the validator of files, in lists to each element, so that every fault is found at once."""
        bounds = {"gt": self.above, "ge": self.least, "le": self.most, "lt": self.below}
        given = {name: bound for name, bound in bounds.items() if bound is not None}

        def bounded(schema: dict[str, Any]) -> dict[str, Any]:
            if schema["type"] == "nullable":
                return {**schema, "schema": bounded(schema["schema"])}
            if schema["type"] == "tuple":
                return {**schema, "items_schema": [bounded(item) for item in schema["items_schema"]]}
            return {**schema, **given}

        return bounded(handler(source))

    @property
    def allowed(self) -> str:
        """The bounds in words, for messages."""
        parts = [
            f"{word} {bound:g}"
            for word, bound in (
                ("greater than", self.above),
                ("at least", self.least),
                ("at most", self.most),
                ("less than", self.below),
            )
            if bound is not None
        ]
        return (" and ".join(parts) or "any finite number") + (f" {self.unit}" if self.unit not in ("", "1") else "")

    def admits(self, value: float) -> bool:
        """Whether `value` is finite and within the bounds."""
        try:
            finite = math.isfinite(value)
        except OverflowError:  # an integer of 309 digits and more
            return False
        return (
            finite
            and (self.above is None or value > self.above)
            and (self.least is None or value >= self.least)
            and (self.most is None or value <= self.most)
            and (self.below is None or value < self.below)
        )

    def nearest(self, value: float) -> float:
        """The bound that `value` is beyond, else itself."""
        low = max((b for b in (self.least, self.above) if b is not None), default=-math.inf)
        high = min((b for b in (self.most, self.below) if b is not None), default=math.inf)
        return min(max(value, low), high)


@dataclass(frozen=True)
class Grid:
    """Rows of numbers, which a file may also name as a .csv or .npy file; read by the scenario loader."""

    unit: str
    meaning: str = ""

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> dict[str, Any]:
        """Ask for nothing more than numbers."""
        return handler(source)  # type: ignore[no-any-return]


@dataclass(frozen=True)
class Label:
    """A name that paths and channels are built from: letters, digits, ``_`` and ``-``, a letter first."""

    meaning: str = ""

    pattern = "^[A-Za-z][A-Za-z0-9_-]*$"
    allowed = "letters, digits, '_' and '-' with a letter first"

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> dict[str, Any]:
        """Hand the pattern to the validator of files."""
        return {**handler(source), "pattern": self.pattern}


@dataclass(frozen=True)
class Later:
    """A key that joined its class later: at its default it is no part of a content's hash, which stays what it was."""

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> dict[str, Any]:
        """Ask for nothing more of a file."""
        return handler(source)  # type: ignore[no-any-return]


def quantity_of(annotation: object) -> Quantity | None:
    """Find the `Quantity` an annotation carries, also inside ``X | None`` and tuples."""
    if typing.get_origin(annotation) is Annotated:
        for item in annotation.__metadata__:  # type: ignore[attr-defined]
            if isinstance(item, Quantity):
                return item
    for inner in typing.get_args(annotation):
        found = quantity_of(inner)
        if found is not None:
            return found
    return None


@functools.cache  # parameter classes are few
def quantities(kind: Any) -> dict[str, Quantity]:
    """Map each field of a parameter class that carries a `Quantity` to it."""
    hints = typing.get_type_hints(kind, include_extras=True)
    found = {f.name: quantity_of(hints[f.name]) for f in fields(kind)}
    return {name: quantity for name, quantity in found.items() if quantity is not None}


@functools.cache  # parameter classes are few
def _labels(kind: Any) -> tuple[str, ...]:
    hints = typing.get_type_hints(kind, include_extras=True)
    return tuple(f.name for f in fields(kind) if any(isinstance(m, Label) for m in _metadata(hints[f.name])))


@functools.cache  # parameter classes are few
def _nullable(kind: Any) -> frozenset[str]:
    """Fields whose annotation allows None somewhere in it."""
    hints = typing.get_type_hints(kind, include_extras=True)
    return frozenset(f.name for f in fields(kind) if _allows_none(hints[f.name]))


def _allows_none(annotation: object) -> bool:
    return annotation is type(None) or any(_allows_none(inner) for inner in typing.get_args(annotation))


def _metadata(annotation: Any) -> tuple[Any, ...]:
    return getattr(annotation, "__metadata__", ())


def _flat(value: Any) -> Iterator[Any]:
    """The numbers of a value, also of a list of points."""
    if isinstance(value, tuple):
        for item in value:
            yield from _flat(item)
    else:
        yield value


def _check(self: Any) -> None:
    kind: Any = type(self)
    for name in _labels(kind):
        if not re.match(Label.pattern, getattr(self, name)):
            raise ValueError(f"{name}: not a plain name, got {getattr(self, name)!r}; {Label.allowed} are allowed")
    for name, quantity in quantities(kind).items():
        value = getattr(self, name)
        if type(value) is float and quantity.admits(value):
            continue  # as nearly all, and a fit makes a hundred thousand of them
        for number in _flat(value):
            if isinstance(number, bool) or not isinstance(number, (int, float)):
                if number is not None or name not in _nullable(kind):
                    raise ValueError(f"{name}: not a number, got {number!r}; a number in {quantity.unit} is allowed")
            elif not quantity.admits(number):
                raise ValueError(f"{name}: out of bounds, got {number!r}; {quantity.allowed} is allowed")
    further = getattr(self, "validate", None)
    if further is not None:
        further()


@dataclass_transform(frozen_default=True, kw_only_default=True, field_specifiers=(field,))
def parameters(kind: type[T]) -> type[T]:
    """Make a frozen, keyword-only dataclass whose bounds hold from files and from Python alike.

    A class may add a method ``validate`` for rules that join several fields; it raises ``ValueError``.
    """
    kind.__post_init__ = _check  # type: ignore[attr-defined]
    # read by the scenario loader's validator: unknown keys, NaN and 1e6 written as text are refused
    kind.__pydantic_config__ = {"extra": "forbid", "strict": True, "allow_inf_nan": False}  # type: ignore[attr-defined]
    return dataclass(frozen=True, kw_only=True)(kind)
