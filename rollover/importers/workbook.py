"""Sheets of an Excel workbook as rows of plain values; the only home of openpyxl."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from rollover.importers.importer import library, reading

MOST_UNPACKED = 1 << 26  # bytes of one workbook: those of the published sets have half a megabyte
MOST_EMPTY = 100  # rows without a value, after which a sheet is over; programs write 65536 of them

Row = tuple[Any, ...]


def read_workbook(path: Path) -> Mapping[str, list[Row]]:
    """Rows of each sheet by its name, numbers as they were last worked out. Raises `InputError`.

    What counts is the content: an `.xlsx` that is named `.xls` is read too.
    """
    openpyxl = library("openpyxl", "xlsx", path)
    with reading(path, "Excel (.xlsx)"), path.open("rb") as file:
        with zipfile.ZipFile(file) as archive:
            size = sum(info.file_size for info in archive.infolist())
        if size > MOST_UNPACKED:
            raise ValueError(f"unpacks to {size} bytes; at most {MOST_UNPACKED} are allowed")
        file.seek(0)
        book = openpyxl.load_workbook(file, read_only=True, data_only=True)
        return {sheet.title: list(_filled(sheet.iter_rows(values_only=True))) for sheet in book.worksheets}


def _filled(rows: Iterator[Row]) -> Iterator[Row]:
    """Rows with a value in them."""
    empty = 0
    for row in rows:
        if all(value is None for value in row):
            empty += 1
            if empty > MOST_EMPTY:
                return
            continue
        empty = 0
        yield row
