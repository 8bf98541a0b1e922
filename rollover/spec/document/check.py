"""A tree of values to an object of a parameter class, or all its faults. The only pydantic home."""

from __future__ import annotations

import functools
import json
import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from pydantic import TypeAdapter, ValidationError

from ground.quantity import Label
from rollover.spec.document.overlaid import breaker
from rollover.spec.document.slot import Slot, slot_of, slots
from rollover.spec.document.tree import Node, Place
from rollover.system.errors import Fault, InputError, hint

_DECIMAL_COMMA = re.compile(r"\s*[-+]?\d*,\d+([eE][-+]?\d+)?\s*")
_NUMBER_FIRST = re.compile(r"\s*[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?\s*")
_FIELD_FIRST = re.compile(r"([A-Za-z_][\w.]*): (.*)", re.DOTALL)


def check(node: Node, kind: Any) -> Any:
    """Build the object that a tree describes; `kind` is a parameter class or an annotation. Raises `InputError`."""
    try:
        return _validated(node, kind)
    except ValidationError as e:
        slot = slot_of(kind)
        faults = [_fault(node, slot, error, kind) for error in e.errors(include_url=False)]
        # one line each, in the order of the file; a list that lacks two elements says so once
        unique = dict.fromkeys(sorted(faults, key=lambda f: (f.file or "", f.line or 0)))
        raise InputError(*unique) from None
    except ArithmeticError:  # of a rule that works with the numbers, each of which is allowed by itself
        message = "numbers that cannot be worked out together, too large or too small; those of a machine are needed"
        raise node.place.fault("", message) from None


def _validated(node: Node, kind: Any) -> Any:
    # JSON rather than Python values: strict there means no text for a number, yet lists may stand for tuples
    return adapter(kind).validate_json(json.dumps(node.plain))


def _holds(node: Node, kind: Any, location: tuple[Any, ...]) -> bool:
    """Whether nothing is wrong at a location and below."""
    try:
        _validated(node, kind)
    except ValidationError as e:
        return not any(error["loc"][: len(location)] == location for error in e.errors(include_url=False))
    except ArithmeticError:
        return False
    return True


def adapter(kind: Any) -> TypeAdapter[Any]:
    """Return the validator of a class as it is now: a new law or effect makes a new one."""
    tables = _open_tables(slot_of(kind))
    return _adapter(kind, tuple(tuple(sorted(table().items())) for table in tables))


@functools.lru_cache(maxsize=32)
def _adapter(kind: Any, _state: tuple[Any, ...]) -> TypeAdapter[Any]:
    return TypeAdapter(kind)


@functools.cache
def _open_tables(slot: Slot) -> tuple[Any, ...]:
    found: dict[Any, None] = {}
    seen: set[Any] = set()

    def visit(slot: Slot) -> None:
        for marker in (slot.by_kind, slot.by_key):
            if marker is not None and marker.table is not None:
                found[marker.table] = None
                return
        for member in slot.kinds.values():
            if member not in seen:
                seen.add(member)
                for child in slots(member).values():
                    visit(child)
        if slot.is_list and (element := slot.element(0)):
            visit(element)

    visit(slot)
    return tuple(found)


def _fault(node: Node, slot: Slot, error: Any, kind: Any) -> Fault:
    where = _Where(node, slot).follow(error["loc"])
    reason, ctx = error["type"], error.get("ctx", {})
    if reason == "value_error":
        holds = functools.partial(_holds, kind=kind, location=error["loc"])
        return _of_rule(where, str(ctx["error"]), breaker(node, tuple(where.steps), holds))
    if reason in ("missing", "missing_keyword_only_argument"):
        return where.missing()
    if reason in ("unexpected_keyword_argument", "extra_forbidden"):
        by_key = where.slot.by_key
        help_ = hint(where.rest, where.slot.keys(where.node.kind))
        if by_key and by_key.elsewhere:
            help_ += f" ({by_key.elsewhere})"
        return where.fault(f"unknown {by_key.noun if by_key else 'key'}, got {where.rest!r}; {help_}")
    if reason in ("union_tag_invalid", "union_tag_not_found"):
        return where.wrong_kind()
    if reason == "literal_error":
        choices = where.slot.type.__args__
        help_ = (
            hint(str(where.node.plain), choices)
            if isinstance(choices[0], str)
            else f"{where.slot.allowed()} is allowed"
        )
        return where.fault(f"not one of the choices, got {_got(where.node)}; {help_}")
    sentence = {
        "finite_number": "not finite",
        "greater_than": "out of bounds",
        "greater_than_equal": "out of bounds",
        "less_than": "out of bounds",
        "less_than_equal": "out of bounds",
        "float_type": "not a number",
        "int_type": "not a whole number",
        "bool_type": "not true or false",
        "string_type": "not text",
        "string_pattern_mismatch": "not a plain name",
        "tuple_type": "not a list",
        "too_long": "too long",
        "dict_type": "not a mapping",
        "dataclass_type": "not a mapping",
    }.get(reason, error["msg"])
    if reason == "string_pattern_mismatch":
        return where.fault(f"{sentence}, got {_got(where.node)}; {Label.allowed} are allowed")
    spelling = _spelling(where.node.value) if reason == "float_type" else ""
    return where.fault(f"{sentence}, got {_got(where.node)}; {where.slot.allowed()} is allowed{spelling}")


def _of_rule(where: _Where, sentence: str, own: Place | None) -> Fault:
    """A broken rule at the key that broke it, `own`, with where else the value stands that the sentence is about."""
    fault = where.broken_rule(sentence)
    if own is None or own.file == fault.file:
        return fault
    beside = "" if fault.line is None else f" ({fault.path or 'the rest'} stands in {fault.file}:{fault.line})"
    return replace(fault, file=own.file, line=own.line, message=fault.message + beside)


def _spelling(value: Any) -> str:
    """How a number has to be written, for text that was meant as one."""
    number = _NUMBER_FIRST.match(value) if isinstance(value, str) else None
    if number is None:
        return ""
    if number.end() == len(value):
        return " (without quotes)"
    return " (with a decimal point)" if _DECIMAL_COMMA.fullmatch(value) else " (the bare number, without its unit)"


class _Where:
    """A place in the tree, found by following the validator's location."""

    def __init__(self, node: Node, slot: Slot) -> None:
        self.node, self.slot = node, slot
        self.place: Place = node.place
        self.path: list[str] = []
        self.steps: list[str | int] = []  # the same as the tree has them
        self.rest = ""  # last step of the location, where nothing stands

    def follow(self, location: tuple[Any, ...]) -> _Where:
        steps = list(location)
        kind_node: Node | None = None  # whose kind was a step: a key below may bear the same name
        while steps:
            value, kind = self.node.value, self.slot.kind(self.node.kind)
            if self.slot.by_kind and isinstance(value, Mapping) and steps[0] == kind and kind_node is not self.node:
                steps.pop(0)  # the validator names the chosen kind as a step of its own
                kind_node = self.node
                continue
            step = steps.pop(0)
            below: Node | None = None
            inner: Slot | None = None
            if isinstance(value, Mapping):
                below, inner = value.get(step), self.slot.child(step, kind)
            elif isinstance(value, tuple):
                below, inner = (value[step] if step < len(value) else None), self.slot.element(step)
            if below is None or inner is None:
                self.rest = str(step)
                if isinstance(value, Mapping):
                    self.path.append(self.rest)
                    self.place = below.key if below else self.node.key
                break
            self.path.append(_address(below, step))
            self.steps.append(step)
            self.node, self.slot, self.place = below, inner, below.place
        return self

    def fault(self, message: str, place: Place | None = None, path: str | None = None) -> Fault:
        place = place or self.place
        return Fault(
            file=place.file, line=place.line, path=".".join(self.path) if path is None else path, message=message
        )

    def missing(self) -> Fault:
        if isinstance(self.node.value, tuple):
            return self.fault(f"too short, got {_got(self.node)}; {self.slot.allowed()} is needed")
        inner = self.slot.child(self.rest, self.node.kind)
        return self.fault(f"missing; {inner.allowed() if inner else 'a value'} is needed")

    def wrong_kind(self) -> Fault:
        kinds = list(self.slot.kinds)
        path = ".".join([*self.path, "kind"])
        given = self.node.value.get("kind") if isinstance(self.node.value, Mapping) else None
        if given is None:
            return self.fault(f"missing; one of {', '.join(kinds)} is needed", self.node.key, path)
        return self.fault(f"unknown kind, got {_got(given)}; {hint(str(given.plain), kinds)}", given.place, path)

    def broken_rule(self, sentence: str) -> Fault:
        """A rule of the class itself; its sentence begins with the field that it is about."""
        match = _FIELD_FIRST.fullmatch(sentence)
        known = self.slot.keys(self.node.kind)
        if match is None or match[1].split(".")[0] not in known:
            return self.fault(sentence)
        node = self.node
        keys = match[1].split(".")
        for i, key in enumerate(keys):
            if isinstance(node.value, Mapping) and (whole := node.value.get(".".join(keys[i:]))):
                node = whole  # a scenario path is one key
                break
            child = node.value.get(key) if isinstance(node.value, Mapping) else None
            if isinstance(node.value, tuple):
                child = next((e for k, e in enumerate(node.value) if key in (_address(e, k), str(k))), None)
            if child is None:
                break
            node = child
        return self.fault(match[2], node.place, ".".join([*self.path, match[1]]))


def _address(node: Node, step: Any) -> str:
    """Name of a list's element where it has one, as in paths; otherwise its place."""
    name = node.value.get("name") if isinstance(step, int) and isinstance(node.value, Mapping) else None
    return str(step) if name is None or not isinstance(name.value, str) else name.value


def _got(node: Node) -> str:
    value = node.value
    if isinstance(value, str):
        return f"text {value if len(value) <= 40 else value[:37] + '...'!r}"
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Mapping):
        return f"a mapping ({', '.join(value)})"
    if isinstance(value, tuple):
        return f"a list of {len(value)}"
    text = repr(value)
    return text if len(text) <= 40 else f"{text[:37]}..."
