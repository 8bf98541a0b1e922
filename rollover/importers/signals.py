"""Columns of any file to a Recording: units, one table for several clocks, and what is refused on the way."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.channels import factor, is_known
from rollover.faults import Fault, InputError, hint
from rollover.importers.sidecar import Column, Described, Profile, doubts_of
from rollover.recording import Recording

Array = NDArray[np.float64]
SAME_INSTANT = 1e-9  # s: stamps of different clocks that lie closer are one row
Line = Callable[[int], int | None]  # row of a channel -> line of the file, for messages


@dataclass(frozen=True, kw_only=True)
class Signal:
    """One column of a file: its numbers, its unit where the file says so, and its own time where it has any."""

    values: Array
    unit: str = ""
    time: Array | None = None
    cfc: int | None = None
    channel: str = ""  # what a self-describing file says it is


def described(signals: Mapping[str, Signal], path: Path) -> Described:
    """What a file says about itself, where its columns bear names of channels. Raises `InputError`."""
    columns = {}
    for name, signal in signals.items():
        channel = signal.channel or name
        if is_known(channel) and not channel.startswith("sensor/"):
            columns[name] = Column(channel=channel, cfc=signal.cfc)  # type: ignore[arg-type]
    if not any(column.channel != "time" for column in columns.values()):
        names = ", ".join(list(signals)[:12]) or "none"
        raise InputError(Fault(file=str(path), message=f"no column is a channel, got {names}; --profile FILE.yaml"))
    about = Profile(format="rollover-profile/1", channels={name: {} for name in columns})
    return Described(file=str(path), about=about, columns=columns, lines={})


def assemble(
    path: Path, signals: Mapping[str, Signal], given: Described | None, *, line: Line = lambda row: None, **more: Any
) -> Recording:
    """Make a Recording of a file's columns; without a description the names must be channels. Raises `InputError`."""
    by = given or described(signals, path)
    about = by.about
    rate = about.rate if isinstance(about, Profile) else None
    for name in by.columns:
        if name not in signals:
            raise by.refuse(name, f"no such column in {path.name}; {hint(name, signals)}")
    clock = next((name for name, column in by.columns.items() if column.channel == "time"), None)
    common: Array | None = None
    if clock is not None:
        common = _si(path, clock, signals[clock], by)
        check_time(path, common, line)
    channels: dict[str, tuple[Array, Array]] = {}
    for name, column in by.columns.items():
        if name == clock:
            continue
        values = _si(path, name, signals[name], by)
        own = signals[name].time if common is None else common
        if own is None and rate is not None and isinstance(about, Profile):
            own = about.start + np.arange(values.size) / rate
        if own is None:
            raise InputError(Fault(file=str(path), message="no time, got no column of channel time; or `rate` in Hz"))
        if own is not common:
            check_time(path, own, line)
        if own.size != values.size:
            message = f"column {name}: got {values.size} values for {own.size} time stamps; one each"
            raise InputError(Fault(file=str(path), message=message))
        check_values(path, name, values, line)
        channels[column.channel] = (own, values)
    if not channels:
        raise InputError(Fault(file=by.file, message="nothing but time, got no other channel; one at least is needed"))
    time, table = _one_table(channels, common)
    known = {column.channel: (name, column) for name, column in by.columns.items()}
    recording = Recording(
        title=about.title or path.stem,
        time=time,
        channels=table,
        source=about.source,
        conditions=dict(about.conditions),
        uncertainty=doubts_of(about.uncertainty),
        clock=about.clock,
        notes=about.notes,
        noise={
            c: col.noise * factor(_unit(n, signals[n], by), c) for c, (n, col) in known.items() if col.noise is not None
        },
        cfc={c: col.cfc or signals[n].cfc or 0 for c, (n, col) in known.items() if col.cfc or signals[n].cfc},
        sensors={c: col.sensor for c, (_, col) in known.items() if col.sensor is not None},
    )
    spare = [name for name in signals if name not in by.columns]
    if spare and given is not None:
        shown = ", ".join(spare[:6]) + (", ..." if len(spare) > 6 else "")
        recording = replace(recording, notes=(*recording.notes, f"columns without a description, left out: {shown}"))
    return replace(recording, **more) if more else recording


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
        raise _at(
            path, line, row, f"time: {what}, got {float(time[row])!r} after {float(time[row - 1])!r}; it must increase"
        )


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


def _one_table(channels: Mapping[str, tuple[Array, Array]], common: Array | None) -> tuple[Array, dict[str, Array]]:
    """All channels on the union of their clocks, with gaps where a channel has no sample."""
    if common is not None:
        return common, {name: values for name, (_, values) in channels.items()}
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
