"""Arguments of the functions that scripts call: within which bounds, one of which words, one text or several."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, isnan

from rollover.system.errors import Fault, InputError, hint


def within(name: str, value: float, least: float, most: float = inf) -> None:
    """Refuse a number outside its bounds. Raises `InputError`."""
    if isnan(value) or not least <= value <= most:
        allowed = f"at least {least:g}" if most == inf else f"{least:g} to {most:g}"
        raise InputError(Fault(path=name, message=f"out of bounds, got {value!r}; {allowed} is allowed"))


def one_of(name: str, value: str | None, allowed: Sequence[str]) -> None:
    """Refuse a word that is none of those allowed; None stands for the usual one. Raises `InputError`."""
    if value is not None and value not in allowed:
        raise InputError(Fault(path=name, message=f"unknown, got {value!r}; {hint(str(value), allowed)}"))


def listed(given: str | Sequence[str]) -> list[str]:
    """The texts of a list, or the only one."""
    return [given] if isinstance(given, str) else list(given)
