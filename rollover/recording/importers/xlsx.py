"""Excel workbooks: columns of a sheet by the names in its first row; `SHEET/NAME` where several sheets have any.

A profile's `csv` says in which rows names, units and numbers stand and what is a gap, as in a text table.

What is written is a sheet `channels` (a row for each stamp, SI, names with units) and a sheet `about`, the sidecar's
text line by line, by which it is read back without a profile.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.recording import Recording
from rollover.recording.importers.csv_profile import in_brackets
from rollover.recording.importers.date_times import EPOCH, NotAStampError, moment, over_midnight
from rollover.recording.importers.importer import Importer, starts_with
from rollover.recording.importers.plain import columns_of, sidecar_of, table_of
from rollover.recording.importers.sidecar import DATE_TIME, Csv, Described, Profile, described_inside
from rollover.recording.importers.signals import Signal, assemble, left_out
from rollover.recording.importers.stamps import NANO
from rollover.recording.importers.workbook import DAY, Formula, Moment, Row, read_workbook, write_workbook
from rollover.system.writing import check_free, put

CHANNELS, ABOUT = "channels", "about"
TICK = 1.5e-6  # s: 46,000 days are stored to 7e-12 of one, 0.6 us; what reckons with them errs by two of these
LONGEST_TEXT = 30_000  # characters of a cell; Excel has room for 32,767


def write(recording: Recording, path: Path, *, force: bool = False) -> None:
    """Write a workbook; numbers keep sixteen digits, gaps are empty cells. Raises `InputError`."""
    check_free(path, force=force)
    names = columns_of(recording)
    rows = np.column_stack(list(table_of(recording).values())).tolist()
    lines = sidecar_of(recording, names).splitlines()
    text = [[line[i : i + LONGEST_TEXT] for i in range(0, max(len(line), 1), LONGEST_TEXT)] for line in lines]
    sheets: Mapping[str, Sequence[Row]] = {
        CHANNELS: [tuple(names.values()), *(tuple(None if v != v else v for v in row) for row in rows)],
        ABOUT: [tuple(cells) for cells in text],
    }
    put(path, lambda at: write_workbook(sheets, at, named=path))


def _read(path: Path, profile: Described | None) -> Recording:
    sheets = dict(read_workbook(path, empty=True))
    if profile is None and set(sheets) == {CHANNELS, ABOUT}:
        lines = ("".join(str(cell) for cell in row if cell is not None) for row in sheets[ABOUT] if row)
        profile = described_inside(path, "\n".join(lines))
        sheets.pop(ABOUT)
    about = profile.about if profile is not None and isinstance(profile.about, Profile) else None
    counted = about is not None and about.rate is not None  # there an empty row is a sample that is missing
    signals = _signals(sheets, about.csv if about else Csv(), counted=counted)
    return assemble(path, signals, profile and _in_seconds(profile, signals))


def _in_seconds(profile: Described, signals: Mapping[str, Signal]) -> Described:
    """A profile that calls a column date-times, where the cells were such."""
    stamps = {n for name, s in signals.items() if s.began is not None for n in (name, s.shared)}
    columns = {
        name: replace(column, unit="s") if name in stamps and column.unit == DATE_TIME and not column.rest else column
        for name, column in profile.columns.items()
    }
    return replace(profile, columns=columns)


def _rows_of(rows: Sequence[Row], how: Csv) -> tuple[Row, Row, Sequence[Row]]:
    """Names, units and rows of numbers of a sheet, whose rows a profile counts as the program does that shows them."""
    full = [k for k, row in enumerate(rows, start=1) if row]
    names_at = full[0] if how.names_row is None else how.names_row
    below = next((k for k in full if k > names_at), names_at + 1)

    def row(number: int) -> Row:
        return rows[number - 1] if number <= len(rows) else ()

    names = row(names_at) if names_at else tuple(str(k + 1) for k in range(max(map(len, rows), default=0)))
    units = row(how.units_row) if how.units_row else ()
    first = how.data_row or (how.units_row + 1 if how.units_row else below)
    if how.units_row is None and how.data_row is None and names_at and row(first) and _is_words(row(first)):
        units, first = row(first), first + 1
    return names, units, rows[first - 1 :]


def _signals(sheets: Mapping[str, Sequence[Row]], how: Csv, *, counted: bool) -> dict[str, Signal]:
    filled = {sheet: rows for sheet, rows in sheets.items() if any(rows)}
    signals: dict[str, Signal] = {}
    for sheet, rows in filled.items():
        names, units, data = _rows_of(rows, how)
        data = data if counted else [row for row in data if row]
        heads = ["" if head is None else " ".join(str(head).split()) for head in names]
        for i, name in enumerate(heads):
            if not name:
                continue
            cells = [row[i] if i < len(row) else None for row in data]
            cells = [None if isinstance(cell, str) and cell in how.gaps else cell for cell in cells]
            unit = str(units[i]).strip() if i < len(units) and units[i] is not None else in_brackets(name)
            full = f"{sheet}/{name}" if len(filled) > 1 else name
            is_shared = len(filled) > 1
            if heads.count(name) > 1:
                full, is_shared = f"{full} (column {i + 1})", True
            signals[full] = _signal(cells, unit, shared=name if is_shared else "")
    return signals


def _is_words(row: Row) -> bool:
    """Whether a row holds words and no value: units below the names."""
    return all(cell is None or isinstance(cell, str) for cell in row)


def _signal(cells: Sequence[Any], unit: str, shared: str) -> Signal:
    other = next((c for c in cells if c is not None and (isinstance(c, bool) or not isinstance(c, (int, float)))), None)
    if other is not None:
        if (found := _moments(cells)) is not None:
            return replace(found, shared=shared)
        formula = next((cell for cell in cells if isinstance(cell, Formula)), None)
        if formula is not None:
            got = repr(formula.text[:40])
            return left_out(f"a formula without its value, got {got}; saved by a program that works it out, it has one")
        if isinstance(other, Moment):
            return left_out(f"cells of a {other.kind} beside others")
        if isinstance(other, str) and any(isinstance(cell, (int, float)) for cell in cells):
            got = repr(other[:40])
            return left_out(f"text among numbers, got {got}; where this is none, a profile says csv: {{gaps: [{got}]}}")
        return left_out(f"{'true or false' if isinstance(other, bool) else 'text'}, got {str(other)[:40]!r}")
    values = np.array([np.nan if cell is None else cell for cell in cells], dtype=np.float64)
    return Signal(values=values, unit=unit, shared=shared) if values.size else left_out("empty")


def _moments(cells: Sequence[Any]) -> Signal | None:
    """Dates, times of day or stretches of time as seconds, of cells that hold such or text that says so; else None."""
    kinds = {cell.kind if isinstance(cell, Moment) else type(cell) for cell in cells}
    if kinds == {"time"}:
        return Signal(values=np.array([cell.days * DAY for cell in cells]), unit="s")
    if kinds == {str}:
        try:
            found = [moment(cell) for cell in cells]
        except NotAStampError:
            return None
        if len({(stamp.dated, stamp.zoned) for stamp in found}) > 1:
            return None
        ns = [stamp.ns - EPOCH for stamp in found] if found[0].dated else over_midnight(found)
        notes = () if found[0].dated else (_OF_DAY,)
        return Signal(values=np.array([n - ns[0] for n in ns]) / NANO, unit="s", began=ns[0], notes=notes)
    if kinds not in ({"date"}, {"time of day"}):
        return None
    days = np.array([cell.days for cell in cells])
    if kinds == {"time of day"}:
        days = days + np.concatenate([[0.0], np.cumsum(np.diff(days) < -0.5)])  # over midnight
    notes = () if kinds == {"date"} else (_OF_DAY,)
    at = _without_rounding(days * DAY)
    return Signal(values=(at - at[0]) / NANO, unit="s", began=int(at[0]), notes=notes)


def _without_rounding(seconds: NDArray[np.float64]) -> NDArray[np.int64]:
    """Nanoseconds; of moments that lie within what a number of days rounds to on a grid, those of the grid."""
    for step in (1e-3, 1e-4, 1e-5):
        if np.all(np.abs(seconds - np.round(seconds / step) * step) < TICK):
            return np.asarray(np.round(seconds / step).astype(np.int64) * round(step * NANO))
    return np.asarray(np.round(seconds * 1e6).astype(np.int64) * 1000)


_OF_DAY = "times of day, of a date that is not said"

XLSX = Importer(
    name="xlsx",
    meaning="Excel workbook, columns by the names in the first row",
    sniff=lambda path: path.suffix.lower() == ".xlsx" and starts_with(path, b"PK"),
    read=_read,
)
