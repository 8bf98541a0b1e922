"""The door between files and parameter classes: strict reading, replacing by path, writing back.

It serves any class made with `ground.quantity.parameters`; `rollover.scenario` uses it for scenarios.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rollover.spec.document.annotated import annotated
from rollover.spec.document.check import check
from rollover.spec.document.exchange import Itself, exchanged, exchanged_below, value_at
from rollover.spec.document.include import beside, expand, find, headings, named, shipped_folder, stated_kind
from rollover.spec.document.replace import parse_setting, replaced
from rollover.spec.document.resolved import Leaf, content_hash, dump, paths, to_mapping, unit_at
from rollover.spec.document.schema import schema
from rollover.spec.document.slot import Written, slot_of
from rollover.spec.document.tree import Node, Place, parse, planted, read, shown
from rollover.spec.document.tree import write as dump_mapping

__all__ = [
    "Itself",
    "Leaf",
    "Node",
    "Place",
    "Written",
    "annotated",
    "beside",
    "check",
    "content_hash",
    "dump",
    "dump_mapping",
    "exchanged",
    "exchanged_below",
    "find",
    "headings",
    "load",
    "named",
    "parse",
    "parse_setting",
    "paths",
    "planted",
    "read",
    "replaced",
    "schema",
    "shipped_folder",
    "shown",
    "slot_of",
    "stated_kind",
    "to_mapping",
    "unit_at",
    "value_at",
]


def load(path: str | Path, kind: Any) -> Any:
    """Object of a parameter class (or of an annotation that offers several) from a file. Raises `InputError`."""
    path = Path(path)
    slot = slot_of(kind)
    root = read(path)
    if not isinstance(root.value, Mapping):
        raise root.place.fault("", f"not a mapping, got {root.plain!r}; {slot.allowed()} is needed")
    return check(expand(root, slot, (path.resolve(),)), kind)
