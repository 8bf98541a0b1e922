"""Columns of what a binary format holds: which are to be read, those of a matrix, names that occur once only."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from rollover.recording.importers.sidecar import Described
from rollover.spec.channels import is_known

MOST_COLUMNS = 4096  # of a matrix: more are no channels of one test, and each has a name
Index = tuple[int | slice, ...]


def is_wanted(profile: Described | None, name: str, *, channel: str = "", shared: str = "") -> bool:
    """Whether a column is to be read: a profile names it, or without one it bears the name of a channel."""
    if profile is None:
        return is_known(channel or name)
    return name in profile.columns or (shared != "" and shared in profile.columns)


def channel_of(name: str) -> str:
    """The channel that a path ends in (`run 1/ground/sinkage`, `table.time`), else nothing."""
    parts = name.rpartition(".")[2].split("/") if is_known(name.rpartition(".")[2]) else name.split("/")
    return next((end for k in range(len(parts)) if is_known(end := "/".join(parts[k:]))), "")


def matrix(name: str, shape: Sequence[int], *, along: int | None = None) -> dict[str, Index]:
    """Columns of an array by name, each with the index that takes it out; none of an array of more than two dimensions
    or as large as a picture.

    Axes of one entry do not count. Samples run along the longer axis, or `along`; columns count from 0: `name[0]`.
    """
    axes = [axis for axis, length in enumerate(shape) if length != 1]
    if len(axes) > 2 or sum(shape[axis] > MOST_COLUMNS for axis in axes) > 1:
        return {}
    if len(axes) < 2:
        at = axes[0] if axes else 0
        return {name: tuple(slice(None) if axis == at else 0 for axis in range(len(shape)))}
    time = along if along in axes else max(axes, key=lambda axis: shape[axis])  # the first of two of the same length
    (across,) = (axis for axis in axes if axis != time)
    whole: list[int | slice] = [slice(None) if axis == time else 0 for axis in range(len(shape))]
    return {f"{name}[{k}]": (*whole[:across], k, *whole[across + 1 :]) for k in range(shape[across])}


def no_numbers(dtype: np.dtype[Any]) -> str:
    """Why an array of this type is no column of numbers; nothing where it is one."""
    if dtype.kind in "fiu":
        return ""
    kinds = {"b": "true or false", "c": "complex numbers", "S": "text", "U": "text", "M": "dates", "V": "records"}
    return kinds.get(dtype.kind, "text or references")


def text(value: Any) -> str:
    """An attribute as text: bytes, an array of one entry and a NUL at the end are writers' ways to say the same."""
    if isinstance(value, np.ndarray):
        value = value.ravel()[0] if value.size == 1 else ""
    if isinstance(value, bytes):
        value = value.decode("utf-8", errors="replace")
    return value.strip("\0 ") if isinstance(value, str) else ""


def number(value: Any) -> float | None:
    """An attribute as a number, also where it is written as text or as an array of one entry."""
    if isinstance(value, (str, bytes)) or (isinstance(value, np.ndarray) and value.dtype.kind in "OSU"):
        value = text(value)
    elif isinstance(value, np.ndarray):
        value = value.ravel()[0] if value.size == 1 else None
    try:
        return None if value is None or isinstance(value, bool) else float(value)
    except (TypeError, ValueError):
        return None


def unique(names: Sequence[str], groups: Sequence[str]) -> list[str]:
    """Names with their group where several columns share one: `F`, else `GROUP/F`, else `F (group 2)`.

    `groups[i]` is the title of the group that column i stands in, or its number where it has none.
    """
    several = Counter(names)
    full = [f"{n} (group {g})" if g.isdigit() else f"{g}/{n}" for n, g in zip(names, groups, strict=True)]
    found = [f if several[n] > 1 else n for n, f in zip(names, full, strict=True)]
    again, seen = Counter(found), Counter[str]()
    for at, name in enumerate(found):
        if again[name] > 1:
            found[at] = f"{name} ({seen[name]})"
            seen[name] += 1
    return found
