"""CSV and other text tables as loggers write them: delimiter, decimal mark, encoding, rows and stamps by a profile."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from rollover.recording import Clock, Recording
from rollover.recording.importers.date_times import (
    EXACT,
    SECOND,
    NotAStampError,
    Stamp,
    fraction,
    is_moment,
    moment,
    over_midnight,
    seconds,
    spelt,
    whole_seconds,
)
from rollover.recording.importers.importer import Importer
from rollover.recording.importers.sidecar import DATE_TIME, Column, Csv, Described, Profile
from rollover.recording.importers.signals import Signal, assemble
from rollover.recording.importers.soundness import RATE_CURE
from rollover.recording.tables import blank_lines, csv_heading, first_rows, is_number, line_of_row, read_columns
from rollover.recording.text_rows import Dialect, lines_of
from rollover.spec import units
from rollover.spec.channels import UNITS
from rollover.system.errors import Fault, InputError

Words = Mapping[str, list[str | None]]


def sniff(path: Path) -> bool:
    """A text file by its ending; with a profile, any that no other importer knows is one."""
    return path.suffix.lower() in (".csv", ".txt", ".asc", ".dat", ".tsv", ".lvm") and path.is_file()


def read(path: Path, profile: Described | None) -> Recording:
    """Recording of a text table by a profile, SI. Raises `InputError`."""
    if profile is None or not isinstance(profile.about, Profile):
        cure = "write one, or say with --profile how to read it (rollover new profile)"
        message = f"no sidecar, got no {path.stem}.yaml beside it; {cure}"
        raise InputError(Fault(file=str(path), message=message))
    dialect, notes = _dialect(path, profile)
    names, between = csv_heading(path, dialect)
    how = profile.about.csv
    units = {name: in_brackets(name) for name in names}
    if how.units_row:
        below = between[how.units_row - dialect.before - dialect.named - 1 :]
        units = dict(zip(names, below[0], strict=False)) if below else {}
    _refuse_twins(profile, names)
    nothing = Signal(values=np.empty(0))
    if not set(profile.columns) <= set(names):
        try:
            return assemble(path, dict.fromkeys(names, nothing), profile)  # which refuses it
        except InputError as e:
            if how.names_row is not None or not set(profile.columns).isdisjoint(names):
                raise
            cure = "where other rows stand above, csv.names_row says which one holds the names"
            raise InputError(*(replace(fault, message=f"{fault.message}; {cure}") for fault in e.faults)) from None
    wanted = list(profile.columns)
    first = dict(zip(names, next(iter(first_rows(path, dialect, 1)), []), strict=False))
    stamps = {name: column for name, column in profile.columns.items() if _is_stamp(column, first.get(name, ""))}
    for name, column in stamps.items():
        for rest in column.rest:
            if rest not in names:
                raise profile.refuse(
                    name, f"rest: no such column in {path.name}, got {rest!r}; the file holds: {', '.join(names)}"
                )
    rests = [rest for column in stamps.values() for rest in column.rest]
    text = list(dict.fromkeys([*stamps, *rests]))
    values, words = read_columns(path, [name for name in wanted if name not in text], text, dialect)
    signals = {
        name: _column(values.pop(name), units.get(name, "").strip(), dialect) if name in values else nothing
        for name in names
        if name in wanted or name not in rests
    }
    columns, clock = dict(profile.columns), profile.about.clock
    for name, column in stamps.items():
        time, note = _seconds(path, name, column, words, dialect)
        signals[name] = Signal(values=time)
        columns[name] = replace(column, unit="s", rest=(), rest_unit=None)
        if note:
            notes = [*notes, note]
            clock = clock if "clock" in profile.stated else Clock(zero="unknown")
    if profile.about.rate is not None and (blank := blank_lines(path, dialect)):
        what = f"{len(blank)} blank lines between rows of numbers, which `rate` counts as no samples"
        cure = "a gap, such as NaN, for each sample that is missing"
        raise InputError(Fault(file=str(path), line=blank[0], message=f"{what}; {cure}"))
    about = replace(profile.about, clock=clock, notes=(*profile.about.notes, *notes))
    by = replace(profile, about=about, columns=columns)
    return assemble(path, signals, by, line=lambda row: line_of_row(path, row, dialect))


def _column(values: np.ndarray, unit: str, dialect: Dialect) -> Signal:
    """A column of numbers, without those that the profile calls gaps, which a note counts."""
    numbers = [float(gap.replace(dialect.decimal, ".")) for gap in dialect.gaps if is_number(gap, dialect.decimal)]
    if numbers:  # -9999 is -9999.000 too
        values = np.where(np.isin(values, numbers), np.nan, values)
    missing = int(np.isnan(values).sum()) if dialect.gaps else 0
    return Signal(values=values, unit=unit, notes=(f"{missing} of {values.size} values are gaps",) if missing else ())


def _dialect(path: Path, profile: Described) -> tuple[Dialect, list[str]]:
    """How the file is written, and what was found out about it."""
    assert isinstance(profile.about, Profile)
    how, notes = profile.about.csv, []
    mark = _separator(path, Dialect(encoding=how.encoding, comment=how.comment))
    if mark:
        if how.delimiter not in (Csv().delimiter, mark):
            what = f"csv.delimiter: {path.name} says sep={mark} in its first line, got {how.delimiter!r}"
            raise InputError(
                Fault(file=profile.file, path="csv.delimiter", message=f"{what}; {mark!r}, or leave it out")
            )
        how = replace(how, delimiter=mark, names_row=2 if how.names_row is None else how.names_row)
        notes = [f"sep={mark} in its first line says what stands between cells"]
    names_row = 1 if how.names_row is None else how.names_row
    last = (how.data_row or (how.units_row or names_row) + 1) - 1
    dialect = Dialect(
        delimiter=how.delimiter,
        decimal=how.decimal,
        encoding=how.encoding,
        comment=how.comment,
        before=max(names_row - 1, 0),
        between=last - names_row,
        named=names_row > 0,
        loose=True,
        gaps=how.gaps,
    )
    if how.names_row is None and how.units_row is None and how.data_row is None:
        names, _ = csv_heading(path, dialect)
        bare = [cell for row in first_rows(path, replace(dialect, named=False), 1) for cell in row]
        if bare and all(is_number(cell, how.decimal) for cell in bare) and not set(profile.columns) <= set(names):
            return replace(dialect, named=False), ["the first row holds numbers and no names: columns are 1, 2, ..."]
    return dialect, notes


def _separator(path: Path, dialect: Dialect) -> str:
    """What a first line `sep=;`, as Excel reads and writes it, says to stand between cells; else nothing."""
    first = next(iter(lines_of(path, dialect)), (0, ""))[1].strip().strip('"')
    return first[4:] if re.fullmatch(r"(?i)sep=[;,|\t]", first) or first.lower() == "sep=" else ""


def in_brackets(name: str) -> str:
    """Unit that a name of a column holds, as Force [kN], F (front) [kN], F/kN or F in kN; else what it ends in in
    brackets, or nothing.
    """
    own = re.sub(r"\s*\(column \d+\)$", "", name)
    bracketed = [*reversed(re.findall(r"[\[({]([^\[\](){}]*)[\])}]", own)), *re.findall(r"(?:.*/| in )([^/ ]+)$", own)]
    match = re.fullmatch(r"[^\[(]*[\[(](.*)[\])]", own)
    bracketed = [match[1], *bracketed] if match else bracketed
    known = (unit for unit in bracketed if any(units.find(unit, table, {}) is not None for table in UNITS.values()))
    return next(known, match[1] if match else "")


def _refuse_twins(profile: Described, names: list[str]) -> None:
    """Refuse a column that is described and whose name stands twice."""
    for name in profile.columns:
        twins = [repr(n) for n in names if re.fullmatch(re.escape(name) + r" \(column \d+\)", n)]
        if name not in names and len(twins) > 1:
            raise profile.refuse(name, f"column given twice, got {name!r}; one of {', '.join(twins)}")


def _is_stamp(column: Column, cell: str) -> bool:
    """Whether a column of time is to be put together, or holds date-times where seconds were to be."""
    return column.is_stamp or (column.channel == "time" and column.unit in (None, "s") and is_moment(cell))


def _seconds(path: Path, name: str, column: Column, words: Words, dialect: Dialect) -> tuple[np.ndarray, str]:
    """Seconds of the stamps of a column and of the rest of them, and where they count from, if not from their own zero.

    Raises `InputError` with the line of a stamp that is none, is repeated or runs backwards.
    """
    rows = list(zip(words[name], *(words[rest] for rest in column.rest), strict=True))
    dated = column.unit == DATE_TIME or not column.rest

    def refused(row: int, message: str) -> InputError:
        return InputError(Fault(file=str(path), line=line_of_row(path, row, dialect), message=f"time: {message}"))

    found: list[Stamp] = []
    for i, cells in enumerate(rows):
        try:
            found.append(_stamp(cells, column.rest_unit, dated=dated, decimal=dialect.decimal))
        except NotAStampError as e:
            raise refused(i, f"column {name}: {e}") from None
        if (found[i].dated, found[i].zoned) != (found[0].dated, found[0].zoned):
            raise refused(
                i, f"column {name}: {' '.join(map(str, cells))!r} is of another form than the first; one form"
            )
    ns = [stamp.ns for stamp in found] if found[0].dated else over_midnight(found)
    for i in range(1, len(ns)):
        if ns[i] <= ns[i - 1]:
            before, after = (" ".join(map(str, rows[k])) for k in (i - 1, i))
            what, cure = ("repeated stamp", RATE_CURE) if ns[i] == ns[i - 1] else ("runs backwards", "")
            raise refused(i, f"{what}, got {after!r} after {before!r}; it must increase{cure}")
    if not dated and abs(ns[0]) < EXACT and abs(ns[-1]) < EXACT:
        return np.array(ns, dtype=np.int64) / SECOND, ""
    began = spelt(found[0]) if dated else f"{ns[0] // SECOND}.{ns[0] % SECOND:09} s"
    of = " and ".join([name, *column.rest])
    return seconds(ns), f"time of {of}: zero is the first stamp, {began}"


def _stamp(cells: tuple[str | None, ...], rest_unit: str | None, *, dated: bool, decimal: str) -> Stamp:
    if any(cell is None for cell in cells):
        raise NotAStampError("empty; every row needs a stamp")
    text = [cell for cell in cells if cell is not None]
    more = fraction(text.pop(), rest_unit, decimal) if rest_unit else 0
    if not dated:
        return Stamp(ns=whole_seconds(text[0]) + more, dated=True, zoned=False)
    stamp = moment(" ".join(text))
    return replace(stamp, ns=stamp.ns + more)


CSV = Importer(name="csv", meaning="CSV and other text tables of any logger, by a profile", sniff=sniff, read=read)
