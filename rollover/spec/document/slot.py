"""What may stand at one place of a file, read off the annotations of the parameter classes."""

from __future__ import annotations

import functools
import types
import typing
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, fields, is_dataclass
from typing import Annotated, Any, Literal

from ground.kinds import ByKey, ByKind
from ground.quantity import Grid, Label, Later, Quantity


@dataclass(frozen=True, kw_only=True)
class Written:
    """Marks what a file may write in other ways too: ``Annotated[Signal, Written(read=..., ...)]``.

    `read` (node, its path, unit) gives the node that the class needs, or None for one that is written so already;
    it raises `InputError`. `unit` is that of the numbers, `forms` are the parameter classes of the other mappings.
    """

    unit: str
    meaning: str
    read: Callable[[Any, str, str], Any]
    forms: tuple[type, ...] = ()
    allowed: str = ""


@dataclass(frozen=True, kw_only=True)
class Slot:
    """One place: its bare type, what its annotations say about it, and what may stand below it."""

    type: Any
    quantity: Quantity | None = None
    meaning: str = ""
    label: bool = False
    optional: bool = False
    by_kind: ByKind | None = None
    by_key: ByKey | None = None
    grid: Grid | None = None
    written: Written | None = None
    later: bool = False

    @property
    def unit(self) -> str:
        """Unit of the number or numbers here, or nothing."""
        return next((m.unit for m in (self.quantity, self.grid, self.written) if m is not None), "")

    @property
    def kinds(self) -> Mapping[str, type]:
        """The parameter classes that may stand here, by kind; one alone has no kind to go by."""
        if self.by_kind:
            return self.by_kind.classes(self.type)
        return {"": self.type} if is_dataclass(self.type) else {}

    @property
    def is_list(self) -> bool:
        """Whether a list belongs here."""
        return typing.get_origin(self.type) is tuple

    @property
    def length(self) -> int | None:
        """Number of elements of a list; None if any number will do."""
        arguments = typing.get_args(self.type)
        return None if arguments[-1] is Ellipsis else len(arguments)

    def element(self, index: int) -> Slot | None:
        """What may stand at a place of a list; its unit and bounds are those of the list."""
        arguments = typing.get_args(self.type)
        if not self.is_list or (self.length is not None and index >= self.length):
            return None
        inner = slot_of(arguments[0 if self.length is None else index])
        return Slot(**{**vars(inner), "quantity": inner.quantity or self.quantity})

    def kind(self, said: object) -> object:
        """The kind that is meant: what is said, or the usual one."""
        return self.by_kind.usual if said is None and self.by_kind else said

    def child(self, key: str, kind: object = None) -> Slot | None:
        """What may stand under a key of a mapping of this kind; None where the key is not known."""
        if self.by_key:
            member = self.by_key.table().get(key)
            return None if member is None else slot_of(member)
        kinds, kind = self.kinds, self.kind(kind)
        chosen = [kinds[kind]] if isinstance(kind, str) and kind in kinds else kinds.values()
        for member in chosen:
            if key in slots(member):
                return slots(member)[key]
        return None

    def keys(self, kind: object = None) -> list[str]:
        """Keys of a mapping here."""
        if self.by_key:
            return list(self.by_key.table())
        kinds, kind = self.kinds, self.kind(kind)
        chosen = [kinds[kind]] if isinstance(kind, str) and kind in kinds else list(kinds.values())
        return list(dict.fromkeys(key for member in chosen for key in slots(member)))

    def allowed(self, kind: object = None) -> str:
        """What is allowed here, in words."""
        words = self._allowed(kind)
        return f"{words.rstrip(',')}, or null" if self.optional else words

    def _allowed(self, kind: object) -> str:
        if self.grid:
            return f"rows of numbers in {self.unit}, or the name of a .csv or .npy file,"
        if self.written:
            return f"a number in {self.unit}, {self.written.allowed}"
        if self.is_list:
            first = self.element(0)
            inside = first.allowed() if first else ""
            return f"a list{'' if self.length is None else f' of {self.length}'}, each {inside},"
        if self.by_key:
            return f"a mapping from {self.by_key.noun} to its parameters"
        kinds = self.kinds
        if kinds:
            several = len(kinds) > 1 and kind not in kinds
            inside = f"kind: {' or '.join(kinds)}" if several else ", ".join(self.keys(kind))
            return f"a mapping ({inside}) or the name of a .yaml file"
        if typing.get_origin(self.type) is Literal:
            return " or ".join(repr(choice) for choice in typing.get_args(self.type))
        if typing.get_origin(self.type) is Mapping:
            return "a mapping"
        if self.type is float:
            quantity = self.quantity or Quantity("1")
            bounds = quantity.allowed.removeprefix("any finite number").strip()
            return f"a number {'in ' if bounds and bounds == quantity.unit else ''}{bounds}".strip()
        return {bool: "true or false", str: "text", int: "a whole number"}.get(self.type, "another value")


@functools.cache
def slots(kind: type) -> dict[str, Slot]:
    """What may stand under each key of a parameter class, `kind` first; what follows from others is no key."""
    hints = typing.get_type_hints(kind, include_extras=True)
    names = sorted((f.name for f in fields(kind) if f.init), key=lambda name: name != "kind")
    return {name: slot_of(hints[name]) for name in names}


@functools.cache
def required(kind: type) -> tuple[str, ...]:
    """Keys without a default."""
    return tuple(f.name for f in fields(kind) if f.init and f.default is MISSING and f.default_factory is MISSING)


def slot_of(annotation: Any) -> Slot:
    """Read one annotation."""
    origin = typing.get_origin(annotation)
    if origin is Annotated:
        bare, *metadata = typing.get_args(annotation)
        by_kind = next((m for m in metadata if isinstance(m, ByKind)), None)
        inner = Slot(type=bare) if by_kind else slot_of(bare)
        quantity = next((m for m in metadata if isinstance(m, Quantity)), inner.quantity)
        grid = next((m for m in metadata if isinstance(m, Grid)), None)
        written = next((m for m in metadata if isinstance(m, Written)), None)
        label = next((m for m in metadata if isinstance(m, Label)), None)
        text = next((m for m in metadata if isinstance(m, str)), "")
        return Slot(
            **{
                **vars(inner),
                "quantity": quantity,
                "meaning": text or next((m.meaning for m in (grid, written, label, quantity, inner) if m), ""),
                "label": label is not None or inner.label,
                "grid": grid or inner.grid,
                "written": written or inner.written,
                "later": any(isinstance(m, Later) for m in metadata),
                "by_kind": by_kind or inner.by_kind,
                "by_key": next((m for m in metadata if isinstance(m, ByKey)), inner.by_key),
            }
        )
    if origin in (typing.Union, types.UnionType):
        members = [a for a in typing.get_args(annotation) if a is not type(None)]
        if len(members) != 1:
            raise TypeError(f"{annotation}: a choice of classes needs ByKind()")
        return Slot(**{**vars(slot_of(members[0])), "optional": True})
    return Slot(type=annotation)
