"""Columns of any file to a Recording: units, one table for several clocks, and what is refused on the way."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.channels import factor, is_known
from rollover.faults import Fault, InputError, nearest
from rollover.importers.sidecar import Column, Described, Profile, doubts_of
from rollover.recording import Recording

Array = NDArray[np.float64]
RATE_INSTEAD = "; a clock too coarse for its samples: `rate` in Hz in a profile, and no column of time"
SAME_INSTANT = 1e-9  # s: stamps of different clocks that lie closer are one row
Line = Callable[[int], int | None]  # row of a channel -> line of the file, for messages


@dataclass(frozen=True, kw_only=True)
class Signal:
    """One column of a file: its numbers, its unit where the file says so, and its own time where it has any.

    A reader hands over everything that a file holds: `left_out` says why a column is no numbers over time (text, all
    invalid, of another test), and is passed on to the recording's notes.
    """

    values: Array
    unit: str = ""
    time: Array | None = None
    cfc: int | None = None
    channel: str = ""  # what a self-describing file says it is
    left_out: str = ""


def left_out(reason: str) -> Signal:
    """What a file holds beside its columns of numbers."""
    return Signal(values=np.empty(0), left_out=reason)


def described(signals: Mapping[str, Signal], path: Path) -> Described:
    """What a file says about itself, where its columns bear names of channels. Raises `InputError`."""
    columns = {}
    for name, signal in signals.items():
        channel = signal.channel or name
        if not signal.left_out and is_known(channel) and not channel.startswith("sensor/"):
            columns[name] = Column(channel=channel, cfc=signal.cfc)  # type: ignore[arg-type]
    if not any(column.channel != "time" for column in columns.values()):
        message = f"no column is a channel, got {_listed(_held(signals))}; --profile FILE"
        raise InputError(Fault(file=str(path), message=message))
    about = Profile(format="rollover-profile/1", channels={name: {} for name in columns})
    return Described(file=str(path), about=about, columns=columns, lines={})


def assemble(
    path: Path, signals: Mapping[str, Signal], given: Described | None, *, line: Line = lambda row: None, **more: Any
) -> Recording:
    """Make a Recording of a file's columns; without a description the names must be channels. Raises `InputError`.

    One column is one channel: columns that mean the same are joined where their times are disjoint, else refused. What
    is not read is named in the notes.
    """
    if given is None:
        signals = {name: _with_readable_unit(name, signal) for name, signal in signals.items()}
    by = given or described(signals, path)
    about = by.about
    for name, column in by.columns.items():
        if name not in signals:
            raise by.refuse(name, f"no such column in {path.name}, got {name!r}; {_there(name, signals)}")
        if signals[name].left_out:
            raise by.refuse(name, f"not a column of numbers over time: {signals[name].left_out}; another column")
        if column.is_stamp:
            raise by.refuse(name, "date-times and stamps in two columns are read from text files by a profile; seconds")
    clocks = _clocks(path, signals, by, line)
    stretches: dict[str, list[_Stretch]] = {}
    for name, column in by.columns.items():
        if column.channel == "time":
            continue
        values = _si(path, name, signals[name], by)
        own = clocks.of(name, signals[name].time)
        if own is None and isinstance(about, Profile) and about.rate is not None:
            own = about.start + np.arange(values.size) / about.rate
        if own is None:
            raise InputError(Fault(file=str(path), message="no time, got no column of channel time; or `rate` in Hz"))
        if not any(own is stamps for stamps in clocks.by_group.values()):
            check_time(path, own, line)
        if own.size != values.size:
            message = f"column {name}: got {values.size} values for {own.size} time stamps; one each"
            raise InputError(Fault(file=str(path), message=message))
        check_values(path, name, values, line)
        stretches.setdefault(column.channel, []).append(_Stretch(name, column, own, values))
    if not stretches:
        raise InputError(Fault(file=by.file, message="nothing but time, got no other channel; one at least is needed"))
    notes = [note for channel, parts in stretches.items() for note in _joined(path, channel, parts)]
    time, table = _one_table({c: (parts[0].time, parts[0].values) for c, parts in stretches.items()})
    known = {c: (parts[0].name, parts[0].column) for c, parts in stretches.items()}
    recording = Recording(
        title=about.title or path.stem,
        time=time,
        channels=table,
        source=about.source,
        conditions=dict(about.conditions),
        uncertainty=doubts_of(about.uncertainty),
        clock=about.clock,
        notes=(*about.notes, *notes, *_not_read(signals, by)),
        noise={
            c: col.noise * factor(_unit(n, signals[n], by), c) for c, (n, col) in known.items() if col.noise is not None
        },
        cfc={c: col.cfc or signals[n].cfc or 0 for c, (n, col) in known.items() if col.cfc or signals[n].cfc},
        sensors={c: col.sensor for c, (_, col) in known.items() if col.sensor is not None},
    )
    return replace(recording, **more) if more else recording


@dataclass
class _Stretch:
    """Samples of a channel from one column."""

    name: str
    column: Column
    time: Array
    values: Array


@dataclass(frozen=True)
class _Clocks:
    """Columns of time: one for the whole file, or one for each group of columns (`group/time`, `struct.t`)."""

    by_group: Mapping[str, Array]

    def of(self, name: str, own: Array | None) -> Array | None:
        """Stamps of a column: those of the innermost group that it stands in, its own, or the only ones there are."""
        around = [g for g in self.by_group if not g or name.startswith((f"{g}/", f"{g}."))]
        inner = max(around, key=len, default=None)
        if inner is not None and (own is None or inner):
            return self.by_group[inner]
        return own if own is not None or len(self.by_group) != 1 else next(iter(self.by_group.values()))


def _clocks(path: Path, signals: Mapping[str, Signal], by: Described, line: Line) -> _Clocks:
    found: dict[str, tuple[str, Array]] = {}
    for name, column in by.columns.items():
        if column.channel != "time":
            continue
        group = name[: max(name.rfind("/"), name.rfind("."), 0)]
        if group in found:
            raise _ambiguous(path, "time", found[group][0], name)
        stamps = _si(path, name, signals[name], by)
        check_time(path, stamps, line)
        found[group] = name, stamps
    return _Clocks({group: stamps for group, (_, stamps) in found.items()})


def _joined(path: Path, channel: str, parts: list[_Stretch]) -> list[str]:
    """Make one stretch of several in place, and say so. Raises `InputError` where two are of the same time."""
    if len(parts) == 1:
        return []
    parts.sort(key=lambda p: float(p.time[0]))
    for before, after in itertools.pairwise(parts):
        same = replace(before.column, unit=after.column.unit, scale=after.column.scale, offset=after.column.offset)
        if float(before.time[-1]) >= float(after.time[0]) or same != after.column:
            raise _ambiguous(path, channel, before.name, after.name)
    each = ", ".join(f"{p.name} ({p.time[0]:g} to {p.time[-1]:g} s)" for p in parts)
    time, values = (np.concatenate([getattr(p, field) for p in parts]) for field in ("time", "values"))
    parts[:] = [replace(parts[0], time=time, values=values)]
    return [f"{channel}: joined from {each}"]


def _with_readable_unit(name: str, signal: Signal) -> Signal:
    """The column itself, or left out where it is a channel in a unit that is none: the others can still be read."""
    channel = signal.channel or name
    if not signal.left_out and channel != "time" and is_known(channel):
        try:
            factor(signal.unit, channel)
        except ValueError:
            return replace(signal, left_out=f"unit {signal.unit!r} does not fit {channel}")
    return signal


def _held(signals: Mapping[str, Signal]) -> list[str]:
    return [f"{name} ({signal.left_out})" if signal.left_out else name for name, signal in signals.items()]


def _there(name: str, signals: Mapping[str, Signal]) -> str:
    """What a file holds, and which of it may have been meant."""
    close = nearest(name, signals)
    meant = f"did you mean {close[0]!r}? " if close else ""
    return f"{meant}the file holds: {_listed(_held(signals))}"


def _ambiguous(path: Path, channel: str, first: str, second: str) -> InputError:
    cure = f"channels: {{{first!r}: {{channel: {channel}, ...}}}}"
    message = f"two columns mean {channel}, got {first!r} and {second!r}; a profile chooses one: {cure}"
    return InputError(Fault(file=str(path), message=message))


def _not_read(signals: Mapping[str, Signal], by: Described) -> list[str]:
    """A note of all that the file holds and the recording does not, with its number."""
    spare: dict[str, list[str]] = {}
    for name, signal in signals.items():
        if name not in by.columns:
            spare.setdefault(signal.left_out or "without a description", []).append(name)
    several = {reason: f"{len(names)} of {len(signals)} columns left out" for reason, names in spare.items()}
    return [f"{several[reason]}, {reason}: {_listed(names)}" for reason, names in spare.items()]


def _listed(names: Sequence[str], most: int = 24) -> str:
    shown = ", ".join(names[:most]) or "none"
    return f"{shown} and {len(names) - most} more" if len(names) > most else shown


def check_time(path: Path, time: Array, line: Line = lambda row: None) -> None:
    """Refuse stamps that are missing, infinite, repeated or run backwards. Raises `InputError` with the line."""
    if time.size == 0:
        raise InputError(Fault(file=str(path), message="empty, got no time stamps"))
    wrong = np.flatnonzero(~np.isfinite(time))
    if wrong.size:
        row = int(wrong[0])
        raise _at(path, line, row, f"time: not a finite number, got {time[row]}; every row needs a stamp")
    wrong = np.flatnonzero(np.diff(time) <= 0.0)
    if wrong.size:
        row = int(wrong[0]) + 1
        what = "repeated stamp" if time[row] == time[row - 1] else "runs backwards"
        cure = RATE_INSTEAD if time[row] == time[row - 1] else ""
        got = f"got {float(time[row])!r} after {float(time[row - 1])!r}"
        raise _at(path, line, row, f"time: {what}, {got}; it must increase{cure}")


def check_values(path: Path, name: str, values: Array, line: Line = lambda row: None) -> None:
    """Refuse a column without a single number, and infinities. Raises `InputError` with the line."""
    total = float(np.sum(values))  # one pass finds any gap or infinity
    if np.isfinite(total):
        return
    wrong = np.flatnonzero(np.isinf(values))
    if wrong.size:
        row = int(wrong[0])
        raise _at(path, line, row, f"column {name}: not a finite number, got {values[row]}; a number or an empty cell")
    if np.isnan(values).all():
        raise _at(path, line, 0, f"column {name}: all gaps, got not one number; leave the column out")


def _at(path: Path, line: Line, row: int, message: str) -> InputError:
    number = line(row)
    message = message if number is not None else f"sample {row}: {message}"
    return InputError(Fault(file=str(path), line=number, message=message))


def _unit(name: str, signal: Signal, by: Described) -> str:
    column = by.columns[name]
    unit = column.unit if column.unit is not None else signal.unit
    if column.unit is None:
        try:
            factor(unit, column.channel)
        except ValueError as e:
            raise by.refuse(name, f"unit: {e}") from None
    return unit


def _si(path: Path, name: str, signal: Signal, by: Described) -> Array:
    column, scale = by.columns[name], factor(_unit(name, signal, by), by.columns[name].channel)
    values = signal.values
    if values.ndim != 1:
        message = f"column {name}: not one column, got shape {values.shape}; one value a row"
        raise InputError(Fault(file=str(path), message=message))
    if column.scale == 1.0 and column.offset == 0.0:
        return values if scale == 1.0 else np.multiply(values, scale, out=values if values.flags.writeable else None)
    return np.asarray((values * column.scale + column.offset) * scale)


def _one_table(channels: Mapping[str, tuple[Array, Array]]) -> tuple[Array, dict[str, Array]]:
    """All channels on the union of their clocks, with gaps where a channel has no sample."""
    clocks = {id(time): time for time, _ in channels.values()}
    first = next(iter(clocks.values()))
    if all(
        time.size == first.size and np.allclose(time, first, rtol=0.0, atol=SAME_INSTANT) for time in clocks.values()
    ):
        return first, {name: values for name, (_, values) in channels.items()}
    stamps = np.unique(np.concatenate(list(clocks.values())))
    time = stamps[np.concatenate([[True], np.diff(stamps) > SAME_INSTANT])]
    table = {}
    for name, (own, values) in channels.items():
        table[name] = np.full(time.size, np.nan)
        table[name][np.searchsorted(time, own, side="right") - 1] = values
    return time, table
