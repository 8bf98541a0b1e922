"""Sheets of an Excel workbook as rows of plain values, read and written; the only home of openpyxl."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from rollover.recording.importers.apart import apart
from rollover.recording.importers.importer import check_library, library, reading
from rollover.system.budget import Budget
from rollover.system.errors import Fault, InputError

IN_CELLS = 5  # bytes in memory of a byte of XML: a cell has some 30 there and 150 as an object
PLACE = 8  # bytes of a place in a row, whether or not a cell fills it
MOST_ROWS = 1_048_576  # of a sheet, in the file format itself
MOST_EMPTY = 100  # rows without a value, after which a sheet is over; programs write 65536 of them

Row = tuple[Any, ...]


def read_workbook(path: Path) -> Mapping[str, list[Row]]:
    """Rows of each sheet by its name, numbers as they were last worked out. Raises `InputError`.

    What counts is the content: an `.xlsx` that is named `.xls` is read too.
    """
    check_library("openpyxl", "xlsx", path)
    return apart(_rows, path, what="Excel", modules=("openpyxl",))


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
        file.seek(0)
        book = openpyxl.load_workbook(file, read_only=True, data_only=True)
        return {sheet.title: list(_filled(sheet, claimed)) for sheet in book.worksheets}


def _filled(sheet: Any, claimed: Budget) -> Iterator[Row]:
    """Rows with a value in them; a row is as wide as its last cell says, however few it has. Raises `InputError`."""
    empty = 0
    for row in sheet.iter_rows(values_only=True):
        claimed.claim(PLACE * len(row), f"sheet {sheet.title}")
        if all(value is None for value in row):
            empty += 1
            if empty > MOST_EMPTY:
                return
            continue
        empty = 0
        yield row
