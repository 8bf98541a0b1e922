"""JSON files that an earlier command wrote, read back: a mapping whose values are of the kinds that its reader uses."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rollover.system.arguments import is_finite_number

NUMBER, TEXT, COUNT = "a number", "text", "a whole number"


def read_json(path: Path, shape: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """The mapping in a file. Raises ``OSError``, and ``ValueError`` for anything else than a mapping of that `shape`.

    For `shape` see `misfit_of`.
    """
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except RecursionError:
        raise ValueError("lists or mappings within each other, too many of them") from None
    refuse_other(found, shape or {})
    return dict(found)


def refuse_other(value: Any, shape: Any) -> None:
    """Raise ``ValueError`` with path and sentence, without a cure, for a value that is not of its shape."""
    if wrong := misfit_of(value, shape):
        raise ValueError(": ".join(filter(None, wrong)).partition(";")[0])


def misfit_of(value: Any, shape: Any, path: str = "") -> tuple[str, str] | None:
    """Path and sentence of the first value that is not of its shape; None where all are.

    A shape is a type's name, a list of one shape for each element, a mapping of those that must be there, or a tuple
    of one shape where null is allowed as well.
    """
    if isinstance(shape, tuple):
        return None if value is None else misfit_of(value, shape[0], path)
    if isinstance(shape, list):
        if not isinstance(value, list):
            return path, f"not a list, got {_got(value)}; a list is needed"
        found = (misfit_of(element, shape[0], f"{path}.{i}") for i, element in enumerate(value))
        return next((f for f in found if f), None)
    if isinstance(shape, Mapping):
        if not isinstance(value, dict):
            return path, f"not a mapping, got {_got(value)}; a mapping is needed"
        # what may be null was not written by older versions
        if missing := [key for key, inner in shape.items() if key not in value and not isinstance(inner, tuple)]:
            return path, f"lacks {', '.join(missing)}; each is needed"
        there = [(key, inner) for key, inner in shape.items() if key in value]
        found = (misfit_of(value[key], inner, f"{path}.{key}" if path else key) for key, inner in there)
        return next((f for f in found if f), None)
    return None if _is(value, shape) else (path, f"not {shape}, got {_got(value)}; {shape} is needed")


def _is(value: Any, shape: str) -> bool:
    if shape == TEXT:
        return isinstance(value, str)
    return is_finite_number(value) and (shape != COUNT or isinstance(value, int))


def _got(value: Any) -> str:
    if isinstance(value, (dict, list)):
        return f"a {'mapping' if isinstance(value, dict) else 'list'} of {len(value)}"
    if isinstance(value, int) and abs(value) > 1 << 64:  # its digits may be too many to be written
        return "a whole number beyond 64 bits"
    return repr(value)[:40]
