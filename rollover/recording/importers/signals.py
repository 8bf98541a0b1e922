"""Columns of any file to a Recording: units, one table for several clocks, and what is refused on the way."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.recording import Clock, Recording
from rollover.recording.importers import stamps
from rollover.recording.importers.sidecar import DATE_TIME, Column, Csv, Described, Profile, Sidecar, uncertainties_of
from rollover.recording.importers.soundness import Line, check_time, check_values
from rollover.recording.tables import is_number
from rollover.spec.channels import factor, is_known
from rollover.system.errors import Fault, InputError, nearest

Array = NDArray[np.float64]
SAME_UNIT = 1e-6  # units differ by more than this, spellings of a constant such as g by less
SAME_INSTANT = 1e-9  # s: stamps of different clocks that lie closer are one row


@dataclass(frozen=True, kw_only=True)
class Signal:
    """One column of a file: its numbers, its unit where the file says so, and its own time where it has any.

    A reader hands over everything that a file holds: `left_out` says why a column is no numbers over time (text, all
    invalid, of another test), and is passed on to the recording's notes. `unreadable` says why its numbers would be
    wrong as they stand (a scale that is not known): refused where the column is to be read, else left out like others.
    """

    values: NDArray[Any]
    unit: str = ""
    time: Array | None = None
    cfc: int | None = None
    channel: str = ""  # what a self-describing file says it is
    left_out: str = ""
    unreadable: str = ""
    began: int | None = None  # ns since 1970 from which `time`, or a column of time in s, counts
    shared: str = ""  # name without its group, which a profile may give for the columns of all groups
    clock: str = ""  # column of stamps beside it, which it goes by where a profile calls that one time
    notes: tuple[str, ...] = ()  # what is to be said of it where it is read


def left_out(reason: str) -> Signal:
    """What a file holds beside its columns of numbers."""
    return Signal(values=np.empty(0), left_out=reason)


def described(signals: Mapping[str, Signal], path: Path) -> Described:
    """What a file says about itself, where its columns bear names of channels. Raises `InputError`."""
    columns = {}
    for name, signal in signals.items():
        channel = signal.channel or name
        if not signal.left_out and is_known(channel) and not channel.startswith("sensor/"):
            if signal.unreadable:
                message = f"column {name}: {signal.unreadable}; a profile without it reads the others"
                raise InputError(Fault(file=str(path), message=message))
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
    by = _of_all_groups(given, signals) if given else described(signals, path)
    about = by.about
    if isinstance(about, Profile) and about.csv.gaps:
        signals = {
            name: _with_gaps(signal, about.csv) if name in by.columns else signal for name, signal in signals.items()
        }
    for name, column in by.columns.items():
        if name not in signals:
            raise by.refuse(name, f"no such column in {path.name}, got {name!r}; {_cure(name, signals)}")
        if signals[name].left_out:
            raise by.refuse(name, f"not a column of numbers over time: {signals[name].left_out}; another column")
        if signals[name].unreadable:
            raise by.refuse(name, f"{signals[name].unreadable}; another column")
        if column.is_stamp:
            raise by.refuse(name, "date-times and stamps in two columns are read from text files by a profile; seconds")
    clocks = _clocks(path, signals, by, line)
    stretches: dict[str, list[_Stretch]] = {}
    for name, column in by.columns.items():
        if column.channel == "time":
            continue
        values = _si(path, name, signals[name], by)
        clock = clocks.of(name, signals[name])
        if clock is None and isinstance(about, Profile) and about.rate is not None:
            clock = _Stamps(about.start + np.arange(values.size) / about.rate)
        if clock is None:
            raise InputError(Fault(file=str(path), message="no time, got no column of channel time; or `rate` in Hz"))
        own = clock.time
        if not any(clock is known for known in clocks.by_group.values()):
            check_time(path, own, line, signals[name].clock)
        if own.size != values.size:
            message = f"column {name}: got {values.size} values for {own.size} time stamps; one each"
            raise InputError(Fault(file=str(path), message=message))
        check_values(path, name, values, line)
        stretches.setdefault(column.channel, []).append(_Stretch(name, column, own, values, clock.began))
    if not stretches:
        raise InputError(Fault(file=by.file, message="nothing but time, got no other channel; one at least is needed"))
    all_parts = [part for parts in stretches.values() for part in parts]
    idle = [n for n, clock in clocks.by_name.items() if not any(clock.time is part.time for part in all_parts)]
    origin = _one_origin(path, all_parts)
    notes = [f"{name}: a column of time that no column goes by" for name in idle]
    notes += [note for channel, parts in stretches.items() for note in _joined(path, channel, parts)]
    time, table = _one_table({c: (parts[0].time, parts[0].values) for c, parts in stretches.items()})
    known = {c: (parts[0].name, parts[0].column) for c, parts in stretches.items()}
    recording = Recording(
        title=about.title or path.stem,
        time=time,
        channels=table,
        source=about.source,
        conditions=dict(about.conditions),
        uncertainty=uncertainties_of(about.uncertainty),
        clock=about.clock if not origin or "clock" in by.stated else Clock(zero="unknown"),
        notes=(*about.notes, *origin, *notes, *_of_columns(signals, by), *_not_read(signals, by)),
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
    began: int | None


@dataclass(frozen=True, eq=False)
class _Stamps:
    """Seconds, from their own zero or from an instant."""

    time: Array
    began: int | None = None


@dataclass(frozen=True)
class _Clocks:
    """Columns of time: one for the whole file, or one for each group of columns (`group/time`, `struct.t`)."""

    by_group: Mapping[str, _Stamps]
    by_name: Mapping[str, _Stamps]

    def of(self, name: str, signal: Signal) -> _Stamps | None:
        """Stamps of a column: those of the innermost group that it stands in, its own, or the only ones there are."""
        if signal.clock in self.by_name:
            return self.by_name[signal.clock]
        own = None if signal.time is None else _Stamps(signal.time, signal.began)
        around = [g for g in self.by_group if not g or name.startswith((f"{g}/", f"{g}."))]
        inner = max(around, key=len, default=None)
        if inner is not None and (own is None or inner):
            return self.by_group[inner]
        return own if own is not None or len(self.by_group) != 1 else next(iter(self.by_group.values()))


def _clocks(path: Path, signals: Mapping[str, Signal], by: Described, line: Line) -> _Clocks:
    found: dict[str, tuple[str, _Stamps]] = {}
    for name, column in by.columns.items():
        if column.channel != "time":
            continue
        group = name[: max(name.rfind("/"), name.rfind("."), 0)]
        if group in found:
            raise _ambiguous(path, "time", found[group][0], name)
        clock = _instants(path, name, signals[name], by)
        check_time(path, clock.time, line)
        found[group] = name, clock
    return _Clocks({group: clock for group, (_, clock) in found.items()}, dict(found.values()))


def _instants(path: Path, name: str, signal: Signal, by: Described) -> _Stamps:
    """A column of time in s; stamps of a calendar, which count years from 1970, as seconds since the first of them."""
    if signal.began is not None:
        return _Stamps(np.asarray(signal.values, dtype=np.float64), signal.began)
    column, unit = by.columns[name], factor(_unit(name, signal, by), "time")
    step = round(unit * stamps.NANO)
    first = float(signal.values[0]) * unit if signal.values.ndim == 1 and signal.values.size else 0.0
    is_bare = column.scale == 1.0 and column.offset == 0.0 and not isinstance(by.about, Sidecar)
    if is_bare and stamps.CALENDAR < first < np.inf:
        try:
            return _Stamps(*stamps.seconds_from_first(signal.values, step))
        except ValueError as e:
            raise by.refuse(name, str(e)) from None
    if is_bare and (got := stamps.clock_digits(signal.values)):
        message = f"times of day as HHMMSS, not seconds, got {got[1]:.10g} after {got[0]:.10g}; unit: {DATE_TIME}"
        raise by.refuse(name, f"unit: {message}, of a text file")
    return _Stamps(_si(path, name, replace(signal, values=signal.values.astype(np.float64, copy=False)), by))


def _one_origin(path: Path, parts: list[_Stretch]) -> list[str]:
    """Count all stretches from the earliest instant in place, and say which that is. Raises `InputError`."""
    stated = {part.name: part.began for part in parts if part.began is not None}
    if not stated:
        return []
    bare = [part.name for part in parts if part.began is None]
    zero = min(stated.values())
    other = next((name for name, began in stated.items() if began != zero), None)
    if bare and other is not None:
        first = min(stated, key=lambda name: stated[name])
        what = f"columns start at different instants, and one states none, got {first!r}, {other!r}, {bare[0]!r}"
        raise InputError(Fault(file=str(path), message=f"{what}; a profile with the columns of one clock"))
    moved: dict[tuple[int, int], Array] = {}
    for part in parts:
        if part.began is not None and part.began != zero:
            key = id(part.time), part.began
            part.time = moved.setdefault(key, part.time + (part.began - zero) / stamps.NANO)
    return [f"time counts from {stamps.said(zero)}" + (f", taken for {_listed(bare)} too" if bare else "")]


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


def _with_gaps(signal: Signal, how: Csv) -> Signal:
    """The column with gaps for the numbers that the profile calls such, of any format, and their count."""
    numbers = [float(gap.replace(how.decimal, ".")) for gap in how.gaps if is_number(gap, how.decimal)]
    missing = np.isin(signal.values, numbers) if numbers else np.zeros(0, dtype=bool)
    if not missing.any():
        return signal
    note = f"{int(missing.sum())} of {signal.values.size} values are gaps by the profile"
    return replace(signal, values=np.where(missing, np.nan, signal.values), notes=(*signal.notes, note))


def _with_readable_unit(name: str, signal: Signal) -> Signal:
    """The column itself, or left out where it is a channel in a unit that is none: the others can still be read."""
    channel = signal.channel or name
    if not signal.left_out and not signal.unreadable and channel != "time" and is_known(channel):
        try:
            factor(signal.unit, channel)
        except ValueError:
            return replace(signal, left_out=f"unit {signal.unit!r} does not fit {channel}")
    return signal


def _ambiguous(path: Path, channel: str, first: str, second: str) -> InputError:
    cure = f"channels: {{{first!r}: {{channel: {channel}, ...}}}}"
    message = f"two columns mean {channel}, got {first!r} and {second!r}; a profile chooses one: {cure}"
    return InputError(Fault(file=str(path), message=message))


def _not_read(signals: Mapping[str, Signal], by: Described) -> list[str]:
    """A note of all that the file holds and the recording does not, with its number."""
    spare: dict[str, list[str]] = {}
    for name, signal in signals.items():
        if name not in by.columns:
            spare.setdefault(signal.left_out or signal.unreadable or "without a description", []).append(name)
    several = {reason: f"{len(names)} of {len(signals)} columns left out" for reason, names in spare.items()}
    return [f"{several[reason]}, {reason}: {_listed(names)}" for reason, names in spare.items()]


def _of_columns(signals: Mapping[str, Signal], by: Described) -> list[str]:
    return [f"{name}: {note}" for name in by.columns for note in signals[name].notes]


def _of_all_groups(by: Described, signals: Mapping[str, Signal]) -> Described:
    """A description in which a name that several groups share stands for the columns of all of them."""
    columns, lines = {}, {}
    for name, column in by.columns.items():
        shared = [n for n, s in signals.items() if s.shared == name] if name not in signals else []
        for each in [n for n in shared if not signals[n].left_out] or shared or [name]:
            columns[each], lines[each] = by.columns.get(each, column), by.lines.get(each, by.lines.get(name))
    return replace(by, columns=columns, lines=lines)


def _held(signals: Mapping[str, Signal]) -> list[str]:
    """Names of all that a file holds, with the reason where one is not to be read."""
    reasons = {name: signal.left_out or signal.unreadable for name, signal in signals.items()}
    return [f"{name} ({reason})" if reason else name for name, reason in reasons.items()]


def _cure(name: str, signals: Mapping[str, Signal]) -> str:
    """What to write instead of a name that the file does not hold: the nearest, and what there is."""
    parts = [n for n in signals if n.startswith((f"{name}[", f"{name}.", f"{name} ("))]
    if parts:
        return f"it is {_listed(parts)}"
    close = nearest(name, signals)
    there = f"the file holds: {_listed(_held(signals))}"
    return f"did you mean {close[0]!r}? {there}" if close else there


def _listed(names: Sequence[str], most: int = 24) -> str:
    shown = ", ".join(names[:most]) or "none"
    return f"{shown} and {len(names) - most} more" if len(names) > most else shown


def _unit(name: str, signal: Signal, by: Described) -> str:
    """The unit of a column; the file and the profile may both say it, but not two that differ. Raises `InputError`."""
    column = by.columns[name]
    unit = column.unit if column.unit is not None else signal.unit
    if column.unit is not None and column.scale == 1.0 and column.offset == 0.0:
        try:
            ratio = factor(signal.unit, column.channel) / factor(column.unit, column.channel)
        except ValueError:
            ratio = 1.0  # the file states none that fits, such as the volts of an amplifier
        if signal.unit and abs(ratio - 1.0) > SAME_UNIT:
            cure = f"leave `unit` out, or where the file is wrong: unit: {signal.unit}, scale: {1.0 / ratio:.6g}"
            raise by.refuse(name, f"unit: the file states {signal.unit!r}, got {unit!r}; {cure}")
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
