"""LabVIEW measurement files (.lvm): a header, then segments, each with its own header, names and rows of numbers.

Times are X0 + i Delta_X from the stamp of each channel; the printed X values have six decimals, and are taken where
they do not lie on that grid.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from rollover.recording import Recording
from rollover.recording.importers import csv_profile
from rollover.recording.importers.date_times import SECOND, NotAStampError, Stamp, moment, spelt
from rollover.recording.importers.importer import Importer, starts_with
from rollover.recording.importers.sidecar import Described
from rollover.recording.importers.signals import Signal, assemble, left_out
from rollover.recording.tables import is_number
from rollover.spec.channels import is_known
from rollover.system.errors import Fault, InputError

MAGIC = b"LabVIEW Measurement"
END = "***End_of_Header***"
X = "X_Value"
PRINTED = 1e-6  # s: LabVIEW writes six decimals, so that a printed X lies within half of this of the true one
SINCE_1904 = 1e9  # s: X of this size counts from 1904 and not from the segment's stamp
Array = NDArray[np.float64]


@dataclass(kw_only=True)
class _Segment:
    """Tags of a segment by column, the names of its columns, and its rows with their lines."""

    tags: dict[str, list[str]] = field(default_factory=dict)
    names: list[str] = field(default_factory=list)
    rows: list[tuple[int, list[str]]] = field(default_factory=list)

    def tag(self, name: str, column: int) -> str:
        """What a tag says of a column, or nothing."""
        cells = self.tags.get(name, [])
        return cells[column].strip() if column < len(cells) else ""


@dataclass(frozen=True, kw_only=True)
class _File:
    path: Path
    head: dict[str, list[str]]
    decimal: str
    segments: list[_Segment]
    special: int


def _sniff(path: Path) -> bool:
    return path.is_file() and starts_with(path, MAGIC, b"\xef\xbb\xbf" + MAGIC)


def _read(path: Path, profile: Described | None) -> Recording:
    if profile is not None and "csv" in profile.stated:
        return csv_profile.read(path, profile)
    file = _parsed(path)
    signals: dict[str, Signal] = {}
    began = None
    own_x = profile is not None and X in profile.columns  # the profile has a word on time, such as a factor
    for k, segment in enumerate(file.segments, start=1):
        stamp = _stamp(segment, 1)
        began = began if began is not None or stamp is None else stamp
        for name, signal in _signals(file, segment, began.ns if began else None, own_x=own_x):
            full = f"{k}/{name}" if len(file.segments) > 1 else name
            signals[_unique(full, signals)] = signal
    if profile is not None and len(file.segments) > 1:
        profile = _of_each_segment(profile, signals)
    readable = set(profile.columns) <= set(signals) if profile else any(s.channel for s in signals.values())
    if readable:  # X is the time of the others, and not left out
        clocks = [n for n in signals if n.rpartition("/")[2].startswith(X) and not (profile and n in profile.columns)]
        signals = {n: s for n, s in signals.items() if n not in clocks or s.unit != "s"}
    notes = [f"zero of time is the stamp of the first channel, {spelt(began)}"] if began else []
    if file.special:
        notes.append(f"{file.special} special blocks left out")
    found = assemble(path, signals, profile)
    return replace(found, notes=(*found.notes, *notes))


def _parsed(path: Path) -> _File:
    data = path.read_bytes()
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("cp1252", errors="replace")
    lines = text.splitlines()
    mark = next((line[9:10] for line in lines[:40] if line.startswith("Separator")), "\t")
    rows = iter([(i, [cell.strip() for cell in line.split(mark)]) for i, line in enumerate(lines, start=1)])
    head = _tags(path, rows, {})
    decimal = (head.get("Decimal_Separator") or ["", "."])[1][:1] or "."
    if mark == ",":
        decimal = "."
    segments: list[_Segment] = []
    special = 0
    for number, cells in rows:
        if not any(cells):
            continue
        if cells[0] == "***Start_Special***":
            special += 1
            for _, inner in rows:
                if inner[0] == "***End_Special***":
                    break
        elif cells[0] and not is_number(cells[0], decimal):
            segment = _Segment()
            if cells[0] != X:
                segment.tags = _tags(path, rows, {cells[0]: cells})
                number, cells = next(rows, (number, []))
            segment.names = cells
            if X not in cells:
                _refuse(path, f"a row of names is needed after the header, got {' '.join(cells)[:40]!r}", number)
            segments.append(segment)
        elif not segments:
            _refuse(path, f"no segment, got a row of numbers before {END}", number)
        else:
            segments[-1].rows.append((number, cells))
    if not any(segment.rows for segment in segments):
        _refuse(path, "empty, got headers and no numbers")
    return _File(path=path, head=head, decimal=decimal, segments=segments, special=special)


def _tags(path: Path, rows: Iterator[tuple[int, list[str]]], found: dict[str, list[str]]) -> dict[str, list[str]]:
    """Tags up to the end of a header."""
    for _, cells in rows:
        if cells[0] == END:
            return found
        if cells[0]:
            found.setdefault(cells[0], cells)
    raise InputError(Fault(file=str(path), message=f"cut off, got a header without {END}"))


def _signals(file: _File, segment: _Segment, zero: int | None, *, own_x: bool) -> Iterator[tuple[str, Signal]]:
    """Columns of a segment with their names."""
    names = segment.names
    while names and not names[-1]:
        names.pop()
    at, first = 0, True
    for c, name in enumerate(names):
        if name == X:
            at, first = c, True
            continue
        if name == "Comment" and c == len(names) - 1:
            said = sum(len(cells) > c and cells[c] != "" for _, cells in segment.rows)
            yield name, left_out("text" if said else "empty")
            continue
        values = _column(file, segment, c)
        count = 1 + max((i for i, (_, cells) in enumerate(segment.rows) if len(cells) > c and cells[c]), default=-1)
        stated = segment.tag("Samples", c)
        if stated.isdigit() and count < int(stated):
            _refuse(file.path, f"{name}: Samples: says {stated}, got {count}; a whole file is needed")
        appended = stated.isdigit() and count > int(stated)  # the header is that of the first packet alone
        time = _time(file, segment, c, at, count, zero, first=first, appended=appended)
        shared = first or _grid(file, segment, c) == _grid(file, segment, at + 1)
        if first:
            unit = segment.tag("X_Unit_Label", c) or ("s" if time is not None else "")
            x = time if time is not None else _column(file, segment, at)[:count]
            yield X, Signal(values=x, unit=unit)
        unit = segment.tag("Y_Unit_Label", c)
        channel = name if is_known(name) else ""
        by_x = own_x and shared and names.count(X) == 1
        signal = Signal(values=values[:count], unit=unit, time=None if by_x else time, channel=channel)
        yield name, signal if np.isfinite(values[:count]).any() else left_out("not one number")
        first = False


def _time(
    file: _File, s: _Segment, c: int, at: int, count: int, zero: int | None, *, first: bool, appended: bool
) -> Array | None:
    """Stamps of a channel, s since the first channel's; None where its X is no time, or nothing says what it is."""
    if s.tag("X_Dimension", c) not in ("", "Time"):
        return None
    grid = _grid(file, s, c)
    even = None if grid is None or appended or not grid[1] > 0.0 else grid[0] + grid[1] * np.arange(count)
    stamp = _stamp(s, c)
    away = (stamp.ns - zero) / SECOND if stamp and zero is not None else 0.0
    if first or appended or grid == _grid(file, s, at + 1):
        printed = _column(file, s, at)[:count]
        if printed.size and np.isfinite(printed).all():
            if abs(printed[0]) > SINCE_1904:
                return np.asarray(printed - printed[0] + away)
            if even is None or not (np.abs(even - printed) <= PRINTED * np.maximum(1.0, np.abs(printed))).all():
                return np.asarray(printed + away)
    return None if even is None else np.asarray(even + away)


def _grid(file: _File, segment: _Segment, c: int) -> tuple[float, float] | None:
    """X0 and Delta_X of a column."""
    try:
        start, step = (float(segment.tag(tag, c).replace(file.decimal, ".")) for tag in ("X0", "Delta_X"))
    except ValueError:
        return None
    return start, step


def _stamp(segment: _Segment, c: int) -> Stamp | None:
    """When the first sample of a column was taken, if its header says so."""
    try:
        return moment(f"{segment.tag('Date', c)} {segment.tag('Time', c)}")
    except NotAStampError:
        return None


def _column(file: _File, segment: _Segment, c: int) -> Array:
    """Numbers of a column, gaps NaN. Raises `InputError` with the line."""
    cells = [row[c] if c < len(row) else "" for _, row in segment.rows]
    try:
        return np.array([cell.replace(file.decimal, ".") or "nan" for cell in cells], dtype=np.float64)
    except ValueError:
        k = next(i for i, cell in enumerate(cells) if not is_number(cell, file.decimal))
        message = f"column {segment.names[c]}: not a number, got {cells[k][:40]!r}; a number or an empty cell is needed"
        _refuse(file.path, message, segment.rows[k][0])


def _of_each_segment(profile: Described, signals: dict[str, Signal]) -> Described:
    """A profile that names a column once, for the columns of that name in all segments."""
    columns, lines = {}, {}
    for name, column in profile.columns.items():
        each = [full for full in signals if full.partition("/")[2] == name] if name not in signals else []
        for full in each or [name]:
            columns[full], lines[full] = column, profile.lines.get(name)
    return replace(profile, columns=columns, lines=lines)


def _unique(name: str, known: dict[str, Signal]) -> str:
    k = 2
    wanted = name
    while name in known:
        name, k = f"{wanted} ({k})", k + 1
    return name


def _refuse(path: Path, message: str, line: int | None = None) -> NoReturn:
    raise InputError(Fault(file=str(path), line=line, message=message)) from None


LVM = Importer(name="lvm", meaning="LabVIEW measurement file", sniff=_sniff, read=_read)
