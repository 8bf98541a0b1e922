"""Text of a file in which every key is explained: meaning, unit, range, default, from the table that `schema` reads."""

from __future__ import annotations

import typing
from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from typing import Any, Literal

from rollover.spec.document.resolved import plain
from rollover.spec.document.slot import Slot, slots
from rollover.spec.document.tree import write
from rollover.system.errors import seen

WIDTH = 120  # columns up to which a remark stands behind its value, and at which it is folded above it


def annotated(thing: Any, head: str = "", files: Mapping[str, str] | None = None) -> str:
    """YAML of an object of a parameter class, each key with a remark; `head` becomes the opening comment.

    `files` names, by path, the file that stands in place of a part; None where no part may be a file. Of a list the
    first element is explained.
    """
    lines = [f"# {seen(line)}".rstrip() for line in head.splitlines()]
    _mapping(thing, "", "", lines, files, remarks=True)
    return "\n".join(lines) + "\n"


def _mapping(
    thing: Any, path: str, indent: str, lines: list[str], files: Mapping[str, str] | None, *, remarks: bool
) -> None:
    kind: Any = type(thing)
    defaults = {f.name: _default(f) for f in fields(kind)}
    for name, slot in slots(kind).items():
        value, here = getattr(thing, name), f"{path}.{name}" if path else name
        remark = _remark(slot, value, defaults[name], files is not None) if remarks else ""
        if files and here in files:
            _put(lines, indent, f"{name}: {files[here]}", remark)
        elif is_dataclass(value):
            _put(lines, indent, f"{name}:", remark)
            _mapping(value, here, f"{indent}  ", lines, files, remarks=remarks)
        elif isinstance(value, Mapping) and any(is_dataclass(item) for item in value.values()):
            _put(lines, indent, f"{name}:", remark)
            for i, (key, item) in enumerate(value.items()):
                lines.append(f"{indent}  {_scalar(key)}:")
                _mapping(item, here, f"{indent}    ", lines, files, remarks=remarks and i == 0)
        elif isinstance(value, (tuple, list)) and any(is_dataclass(item) for item in value):
            _put(lines, indent, f"{name}:", remark)
            for i, item in enumerate(value):
                inner: list[str] = []
                _mapping(item, here, f"{indent}    ", inner, files, remarks=remarks and i == 0)
                lines += _item(inner, f"{indent}  ")
        elif value is None:
            _put(lines, indent, f"{name}: null", remark)
        else:
            text = write({name: plain(value, slot)}).rstrip("\n").split("\n")
            _put(lines, indent, text[0], remark)
            lines += [f"{indent}{line}" for line in text[1:]]


def _item(inner: list[str], indent: str) -> list[str]:
    """Lines of a mapping as an element of a list: the dash stands before the first key."""
    first = next(i for i, line in enumerate(inner) if not line.lstrip().startswith("#"))
    inner[first] = f"{indent}- {inner[first].lstrip()}"
    return inner


def _put(lines: list[str], indent: str, text: str, remark: str) -> None:
    whole = f"{indent}{text}  # {remark}" if remark else f"{indent}{text}"
    if len(whole) <= WIDTH or not remark:
        lines.append(whole)
        return
    row = ""
    for word in remark.split(" "):
        if row and len(indent) + len(row) + len(word) + 3 > WIDTH:
            lines.append(f"{indent}# {row}")
            row = word
        else:
            row = f"{row} {word}" if row else word
    lines += [f"{indent}# {row}", f"{indent}{text}"]


def _remark(slot: Slot, value: Any, default: Any, may_be_file: bool) -> str:
    """What a key means, what is allowed, and its default: of a part its class, and the other kinds there are."""
    parts = [slot.meaning] if slot.meaning else []
    if typing.get_origin(slot.type) is Literal and len(typing.get_args(slot.type)) == 1:
        return slot.meaning  # the only thing that may stand there
    if slot.kinds:
        summary = (type(value).__doc__ or "").strip().splitlines() if is_dataclass(value) else []
        parts += [line.rstrip(".") for line in summary[:1]] if not parts else []
        if slot.by_kind is not None:
            parts.append(f"kind: {' | '.join(slot.kinds)}")
        parts += ["or the name of a .yaml file"] if may_be_file else []
    elif slot.is_list and (first := slot.element(0)) is not None and first.kinds:
        parts.append("a list")
    else:
        parts.append(_allowed(slot))
    if default is not MISSING and not is_dataclass(default):
        shown = "null" if default is None else write({"x": plain(default, slot)})[3:].rstrip("\n")
        parts += [f"default {shown}"] if "\n" not in shown and len(shown) < 40 else []
    elif default is MISSING and not slot.kinds:
        parts.append("needed")
    return "; ".join(" ".join(part.split()) for part in parts if part)


def _allowed(slot: Slot) -> str:
    words = slot.allowed().rstrip(",")
    if slot.type is int and slot.quantity is not None and slot.quantity.allowed != "any finite number":
        return words.replace("a whole number", f"a whole number {slot.quantity.allowed}", 1)
    return words


def _default(field: Any) -> Any:
    return field.default_factory() if field.default_factory is not MISSING else field.default


def _scalar(key: Any) -> str:
    return write({str(key): 0}).partition(": 0")[0]
