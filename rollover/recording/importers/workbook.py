"""Sheets of an Excel workbook as rows of plain values, read and written; the only home of openpyxl."""

from __future__ import annotations

import datetime as dt
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import repeat
from pathlib import Path
from typing import Any, Literal

from rollover.recording.importers.apart import apart
from rollover.recording.importers.importer import check_library, library, reading
from rollover.system.budget import Budget
from rollover.system.errors import Fault, InputError

IN_CELLS = 5  # bytes in memory of a byte of XML: a cell has some 30 there and 150 as an object
PLACE = 8  # bytes of a place in a row, whether or not a cell fills it
MOST_ROWS = 1_048_576  # of a sheet, in the file format itself
DAY = 86400.0  # s
FROM_1970 = {1900: 25569.0, 1904: 25569.0 - 1462.0}  # days from a workbook's zero to 1970

Row = tuple[Any, ...]


@dataclass(frozen=True, kw_only=True)
class Moment:
    """A cell that holds a date or a time: days since 1970, of a time of day or of a stretch of time its own."""

    kind: Literal["date", "time of day", "time"]
    days: float


@dataclass(frozen=True)
class Formula:
    """A cell with a formula whose value the file does not hold."""

    text: str


def read_workbook(path: Path, *, empty: bool = False) -> Mapping[str, list[Row]]:
    """Rows of each sheet by its name, numbers as they were last worked out. Raises `InputError`.

    With `empty`, rows without a value that lie above others are there too, of no cells. What counts is the content: an
    `.xlsx` that is named `.xls` is read too.
    """
    check_library("openpyxl", "xlsx", path)
    sheets = apart(_rows, path, what="Excel", modules=("openpyxl",))
    return sheets if empty else {sheet: [row for row in rows if row] for sheet, rows in sheets.items()}


def write_workbook(sheets: Mapping[str, Sequence[Row]], path: Path, *, named: Path) -> None:
    """Write rows of numbers and texts, whatever a text looks like; `named` is the file in messages.

    Raises `InputError` for what a sheet has no room for, and where the library is missing.
    """
    openpyxl = library("openpyxl", "xlsx", named)
    for sheet, rows in sheets.items():
        if len(rows) > MOST_ROWS:
            got = f"sheet {sheet}: too long, got {len(rows)} rows; a sheet has {MOST_ROWS}, csv and mat any number"
            raise InputError(Fault(file=str(named), message=got))
    book = openpyxl.Workbook(write_only=True)
    for sheet, rows in sheets.items():
        page = book.create_sheet(sheet)
        page.freeze_panes = "B2"
        for row in rows:
            page.append([_cell(openpyxl, page, value) for value in row])
    book.save(path)


def _cell(openpyxl: Any, page: Any, value: Any) -> Any:
    """A value as it is: a text that begins with = is no formula."""
    if not isinstance(value, str) or not value.startswith("="):
        return value
    cell = openpyxl.cell.WriteOnlyCell(page, value)
    cell.data_type = "s"
    return cell


def _rows(path: Path) -> dict[str, list[Row]]:
    openpyxl = library("openpyxl", "xlsx", path)
    with reading(path, "Excel (.xlsx)"), path.open("rb") as file:
        with zipfile.ZipFile(file) as archive:
            claimed = Budget(path)
            for info in archive.infolist():
                claimed.claim(IN_CELLS * info.file_size, info.filename)
            has_formulas = any(b"<f" in archive.read(i) for i in archive.infolist() if "sheets/" in i.filename)
        file.seek(0)
        book = openpyxl.load_workbook(file, read_only=True, data_only=True)
        texts: dict[str, Any] = {}
        if has_formulas:
            file.seek(0)
            texts = {s.title: s for s in openpyxl.load_workbook(file, read_only=True, data_only=False).worksheets}
        found = {sheet.title: list(_filled(sheet, claimed, texts.get(sheet.title))) for sheet in book.worksheets}
        if not any(
            isinstance(value, dt.date | dt.time | dt.timedelta) for r in found.values() for x in r for value in x
        ):
            return found
        zero = FROM_1970[1904 if book.epoch.year == 1904 else 1900]
        kept = {name: getattr(book, name) for name in _FORMATS}
        for name in _FORMATS:  # else the library rounds what is a date to a millisecond
            setattr(book, name, type(kept[name])())
        plain = {sheet.title: list(_filled(sheet, claimed)) for sheet in book.worksheets}
        return {
            sheet: [tuple(map(_moment, row, plain[sheet][i], repeat(zero))) for i, row in enumerate(rows)]
            for sheet, rows in found.items()
        }


def _without_value(value: Any, text: Any) -> Any:
    """A cell's value, or its formula where the program that wrote it worked out none."""
    return Formula(text) if value is None and isinstance(text, str) and text.startswith("=") else value


_FORMATS = ("_date_formats", "_timedelta_formats")


def _moment(value: Any, plain: Any, zero: float) -> Any:
    """A cell as it is, or the moment that it holds; `plain` is its number."""
    if not isinstance(value, dt.date | dt.time | dt.timedelta):
        return value
    number = float(plain) if isinstance(plain, int | float) else None
    if isinstance(value, dt.timedelta):
        return Moment(kind="time", days=value / dt.timedelta(days=1) if number is None else number)
    if isinstance(value, dt.time):
        apart = dt.timedelta(
            hours=value.hour, minutes=value.minute, seconds=value.second, microseconds=value.microsecond
        )
        return Moment(kind="time of day", days=apart / dt.timedelta(days=1) if number is None else number)
    if number is not None:
        return Moment(kind="date", days=number - zero)
    at = value if isinstance(value, dt.datetime) else dt.datetime(value.year, value.month, value.day)
    return Moment(kind="date", days=(at.replace(tzinfo=dt.UTC) - dt.datetime(1970, 1, 1, tzinfo=dt.UTC)) / _ONE_DAY)


_ONE_DAY = dt.timedelta(days=1)


def _filled(sheet: Any, claimed: Budget, texts: Any = None) -> Iterator[Row]:
    """Rows to the last with a value in it, those without one as none; a row is as wide as its last cell says.

    `texts` is the same sheet with formulas in place of their values. Raises `InputError`.
    """
    empty = 0  # programs write 65536 of them at the end
    formulas = repeat(()) if texts is None else texts.iter_rows(values_only=True)
    for row, formula_row in zip(sheet.iter_rows(values_only=True), formulas, strict=False):
        if formula_row and None in row:
            row = tuple(map(_without_value, row, formula_row))
        claimed.claim(PLACE * len(row), f"sheet {sheet.title}")
        if all(value is None for value in row):
            empty += 1
            continue
        yield from repeat((), empty)
        empty = 0
        yield row
