"""Arrays of scientific formats with their attributes: columns, scales, fill values and clocks by convention."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.recording.importers import cf
from rollover.recording.importers.columns import Index, channel_of, is_wanted, matrix, no_numbers
from rollover.recording.importers.sidecar import Described
from rollover.recording.importers.signals import Signal, left_out
from rollover.recording.importers.steps import even_stamps
from rollover.spec.channels import UNITS
from rollover.system.budget import Budget

Stamps = tuple[NDArray[np.float64], int | None]  # s, and the instant in ns since 1970 that they count from


@dataclass(frozen=True, kw_only=True)
class Array:
    """One array: `load` takes an index and gives numbers; `around` are its attributes, its group's, and so outward."""

    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    load: Callable[[Index], Any]
    attributes: Mapping[str, Any] = field(default_factory=dict)
    around: Sequence[Mapping[str, Any]] = ()
    scales: Mapping[int, Array] = field(default_factory=dict)  # axis -> its coordinate
    fill: Any = None  # what the file keeps where nothing was written
    last_axis_first: bool = False  # whether the writer's rows are the file's columns, as MATLAB's
    part: int = 0  # numbers that are unpacked at a time, be it for one of them
    reason: str = ""  # why it is no numbers
    unclear: str = ""  # why it cannot be said what its numbers stand for

    @property
    def claim(self) -> int:
        """Bytes that it takes as it is stored, and as float64."""
        count = max(int(np.prod(self.shape, dtype=object)), self.part)
        return count * (int(self.dtype.itemsize) + 8)


def signals_of(path: Path, contents: Mapping[str, Array | str], profile: Described | None) -> dict[str, Signal]:
    """Columns of all arrays by name, read where they are wanted. Raises `InputError` for claims beyond the file."""
    signals: dict[str, Signal] = {}
    claimed = Budget(path)
    for name, thing in contents.items():
        reason = thing if isinstance(thing, str) else thing.reason or no_numbers(thing.dtype)
        if isinstance(thing, str) or reason or 0 in thing.shape:
            signals[name] = left_out(reason or "empty")
            continue
        columns = matrix(name, thing.shape, along=_axis_of_time(thing))
        if not columns:
            signals[name] = left_out(f"an array {thing.shape}")
        wanted = [column for column in columns if is_wanted(profile, column, channel=channel_of(column))]
        if wanted:
            claimed.claim(thing.claim, name)
        if len(wanted) > 1:  # read at once: each column by itself would unpack all of it
            thing = replace(thing, load=_once(thing.load))
        for at, (column, index) in enumerate(columns.items()):
            channel = channel_of(column)
            signals[column] = Signal(values=np.empty(0), channel=channel)
            if column in wanted:
                for scale in thing.scales.values():
                    claimed.claim(scale.claim, column)
                found = _signal(thing, index, (at, len(columns)), profile, column)
                signals[column] = replace(found, channel=channel)
    return signals


def _once(load: Callable[[Index], Any]) -> Callable[[Index], Any]:
    """The same array, loaded whole when a first part of it is."""
    whole: list[Any] = []

    def part(index: Index) -> Any:
        if not whole:
            whole.append(np.asarray(load(())))
        return whole[0][index]

    return part


def _axis_of_time(thing: Array) -> int | None:
    """The axis along which samples run, where a coordinate of time or the writer's order of storage says so."""
    of_time = [axis for axis, scale in thing.scales.items() if _is_time(scale)]
    if of_time:
        return of_time[0]
    long = [axis for axis, length in enumerate(thing.shape) if length != 1]
    is_square = len(long) == 2 and thing.shape[long[0]] == thing.shape[long[1]]
    return long[1] if is_square and thing.last_axis_first else None


def _is_time(scale: Array) -> bool:
    unit = cf.unit_of(scale.attributes)
    return scale.dtype.kind in "fiu" and len(scale.shape) == 1 and (" since " in unit or unit in UNITS["s"])


def _stamps_of(scale: Array) -> Stamps:
    """Stamps of a coordinate of time. Raises ``ValueError``."""
    values, _ = cf.decoded(np.asarray(scale.load(())), scale.attributes, scale.fill)
    since = cf.time_of(values, scale.attributes)
    return since or (values * UNITS["s"][cf.unit_of(scale.attributes)], None)


def _own_stamps(thing: Array, index: Index, count: int) -> tuple[NDArray[np.float64] | None, int | None]:
    """Stamps of an array's coordinate of time, else of the step that its attributes state. Raises ``ValueError``."""
    scale = next((s for axis, s in thing.scales.items() if index[axis] == slice(None) and _is_time(s)), None)
    return even_stamps(thing.around, count) if scale is None else _stamps_of(scale)


def _has_time(profile: Described | None, name: str) -> bool:
    """Whether a profile names a column of time for this one: in its group, or in a group around it."""
    columns = {} if profile is None else profile.columns
    groups = [n[: max(n.rfind("/"), n.rfind("."), 0)] for n, column in columns.items() if column.channel == "time"]
    return any(not group or name.startswith((f"{group}/", f"{group}.")) for group in groups)


def _scale_around(thing: Array) -> tuple[str, str]:
    """Why packed numbers cannot be read beside what their attributes or their group's say; and what is only to be said.

    A group's scale is no convention: it may be that of one of its arrays, or of all.
    """
    unknown = cf.unknown_scale(thing.attributes, thing.dtype)
    own = cf.other_scales(thing.attributes) or cf.beside(thing.attributes, thing.dtype)
    groups = [said for level in thing.around if level is not thing.attributes and (said := cf.stated_scale(level))]
    if not groups or cf.stated_scale(thing.attributes):
        return unknown, own
    said = f"{groups[0]} of its group"
    if thing.dtype.kind in "iu":
        return cf.undefined(said), ""
    return unknown, said


def _signal(thing: Array, index: Index, place: tuple[int, int], profile: Described | None, name: str) -> Signal:
    given = None if profile is None else profile.columns[name]
    states_scale = profile is not None and name in profile.scaled
    unknown, beside = ("", "") if states_scale else _scale_around(thing)
    if thing.unclear and not states_scale and not (given and given.channel == "time" and thing.dtype.kind == "f"):
        unknown = thing.unclear
    try:
        values, notes = cf.decoded(np.asarray(thing.load(index)), thing.attributes, thing.fill, place)
        if beside:
            notes.append(cf.not_applied(beside))
        unit = cf.unit_of(thing.attributes, *place)
        if (since := cf.time_of(values, thing.attributes)) is not None:
            return Signal(values=since[0], unit="s", began=since[1])
        if (given.channel if given is not None else channel_of(name)) == "time":
            return Signal(values=values, unit=unit, unreadable=unknown)  # whole numbers stay whole
        time, began = (None, None) if _has_time(profile, name) else _own_stamps(thing, index, values.size)
    except ValueError as e:
        return Signal(values=np.empty(0), unreadable=str(e))
    if np.isnan(values.astype(np.float64, copy=False)).all():
        return left_out("all gaps")
    return Signal(
        values=values.astype(np.float64), unit=unit, time=time, began=began, unreadable=unknown, notes=tuple(notes)
    )
