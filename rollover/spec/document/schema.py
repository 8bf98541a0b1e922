"""JSON Schema of a file, for editors: units and meanings as descriptions, file names and `base` allowed."""

from __future__ import annotations

import typing
from collections.abc import Mapping
from dataclasses import MISSING, fields
from typing import Any, Literal

from ground.quantity import Label
from rollover.spec.document.include import BASE
from rollover.spec.document.resolved import plain
from rollover.spec.document.slot import Slot, required, slot_of, slots

_FILE = {
    "type": "string",
    "pattern": "\\.ya?ml$|^[A-Za-z0-9_-]+$",
    "description": "name of a .yaml file with this part, or of a shipped one",
}
_PARTIAL = "-partial"  # what is laid over a base: nothing in it is required


def schema(kind: Any, title: str, *, entries: Mapping[str, type] | None = None) -> dict[str, Any]:
    """JSON Schema (2020-12) of the files that describe objects of a class or of an annotation that offers several.

    `entries`, class by key, is for files that stand by themselves, without `base` and other files in them: what each
    value of an open mapping under that key has to be.
    """
    slot = slot_of(kind)
    writer = _Writer(entries)
    root = writer.one_of(slot, "", file=False)
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": title,
        **root,
        "$defs": dict(sorted(writer.definitions.items())),
    }


class _Writer:
    def __init__(self, entries: Mapping[str, type] | None = None) -> None:
        self.definitions: dict[str, dict[str, Any]] = {}
        self.entries = entries

    def slot(self, slot: Slot, suffix: str) -> dict[str, Any]:
        """Schema of what may stand at a place."""
        found = self._bare(slot, suffix)
        if slot.optional:
            found = {"anyOf": [found, {"type": "null"}]}
        text = f"{slot.meaning} [{slot.unit}]" if slot.unit not in ("", "1") else slot.meaning
        return {**found, "description": text.strip()} if text else found

    def one_of(self, slot: Slot, suffix: str, file: bool = True) -> dict[str, Any]:
        """Schema of a choice between parameter classes, distinguished by `kind` where there are several."""
        by = slot.by_kind
        choices: list[dict[str, Any]] = [
            {"$ref": f"#/$defs/{self._define(member, suffix, by_kind=by is not None and kind != by.usual)}"}
            for kind, member in slot.kinds.items()
        ]
        choices += [_FILE] if file and self.entries is None else []
        return choices[0] if len(choices) == 1 else {"anyOf": choices}

    def _bare(self, slot: Slot, suffix: str) -> dict[str, Any]:
        if slot.grid:
            return {"anyOf": [self._list(slot), {"type": "string", "pattern": "\\.(csv|npy)$"}]}
        if slot.is_list:
            whole, element = self._list(slot), slot.element(0)
            if not suffix or element is None or not element.kinds:
                return whole
            # over a base's list: a mapping from names to what differs
            return {"anyOf": [whole, {"type": "object", "additionalProperties": self.one_of(element, suffix)}]}
        if slot.by_key:
            table = slot.by_key.table()
            return {
                "type": "object",
                "additionalProperties": False,
                "properties": {key: self.slot(slot_of(member), suffix) for key, member in sorted(table.items())},
            }
        if slot.kinds:
            whole = self.one_of(slot, suffix)
            if slot.written is None:
                return whole
            forms = [{"$ref": f"#/$defs/{self._define(form, '', by_kind=False)}"} for form in slot.written.forms]
            return {"anyOf": [{"type": "number"}, *forms, whole]}
        if typing.get_origin(slot.type) is Literal:
            return {"enum": list(typing.get_args(slot.type))}
        if slot.type is str:
            return {"type": "string", **({"pattern": Label.pattern} if slot.label else {})}
        if slot.type is float:
            q = slot.quantity
            bounds = (
                {"exclusiveMinimum": q.above, "minimum": q.least, "maximum": q.most, "exclusiveMaximum": q.below}
                if q
                else {}
            )
            return {"type": "number", **{name: bound for name, bound in bounds.items() if bound is not None}}
        if typing.get_origin(slot.type) is Mapping:
            return {"type": "object"}
        return {"type": {bool: "boolean", int: "integer"}[slot.type]}

    def _list(self, slot: Slot) -> dict[str, Any]:
        # a list replaces the base's as a whole, so its elements are whole as well
        elements = [self._bare_or_null(slot.element(i)) for i in range(slot.length or 1)]
        if slot.length is None:
            return {"type": "array", "items": elements[0]}
        return {"type": "array", "prefixItems": elements, "minItems": slot.length, "maxItems": slot.length}

    def _bare_or_null(self, slot: Slot | None) -> dict[str, Any]:
        assert slot is not None  # asked for places that exist
        bare = self._bare(slot, "")
        return {"anyOf": [bare, {"type": "null"}]} if slot.optional else bare

    def _define(self, kind: type, suffix: str, by_kind: bool) -> str:
        name = f"{kind.__name__}{suffix}"
        if name in self.definitions:
            return name
        self.definitions[name] = {}  # stands while its own parts are written
        properties = {key: self.slot(slot, suffix) for key, slot in slots(kind).items()}
        for f in fields(kind):
            default = f.default_factory() if f.default_factory is not MISSING else f.default
            if f.init and default is not MISSING:
                properties[f.name] = {**properties[f.name], "default": plain(default, slots(kind)[f.name])}
        for key, entry in (self.entries or {}).items():
            if key in properties and properties[key].get("type") == "object":
                each = {"$ref": f"#/$defs/{self._define(entry, suffix, by_kind=False)}"}
                properties[key] = {**properties[key], "minProperties": 1, "additionalProperties": each}
        definition: dict[str, Any] = {"type": "object", "additionalProperties": False, "properties": properties}
        if kind.__doc__:
            definition["description"] = kind.__doc__.strip().splitlines()[0]
        needed = [*(["kind"] if by_kind else []), *required(kind)]
        if suffix:
            definition["properties"] = {BASE: _FILE, **properties}
        elif self.entries is not None:
            definition["required"] = needed
        else:
            # with a base, whatever is missing here comes from there
            partial = self._define(kind, _PARTIAL, by_kind)
            definition = {
                "description": definition.get("description", ""),
                "if": {"type": "object", "required": [BASE]},
                "then": {"$ref": f"#/$defs/{partial}"},
                "else": {**definition, "required": needed},
            }
        self.definitions[name] = definition
        return name
