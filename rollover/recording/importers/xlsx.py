"""Excel workbooks: columns of a sheet by the names in its first row; `SHEET/NAME` where several sheets have any.

What is written is a sheet `channels` (a row for each stamp, SI, names with units) and a sheet `about`, the sidecar's
text line by line, by which it is read back without a profile.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rollover.recording import Recording
from rollover.recording.importers.importer import Importer, starts_with
from rollover.recording.importers.plain import columns_of, sidecar_of, table_of
from rollover.recording.importers.sidecar import Described, described_inside
from rollover.recording.importers.signals import Signal, assemble, left_out
from rollover.recording.importers.workbook import Row, read_workbook, write_workbook
from rollover.system.writing import check_free, put

CHANNELS, ABOUT = "channels", "about"
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
    sheets = dict(read_workbook(path))
    if profile is None and set(sheets) == {CHANNELS, ABOUT}:
        lines = ("".join(str(cell) for cell in row if cell is not None) for row in sheets[ABOUT])
        profile = described_inside(path, "\n".join(lines))
        sheets.pop(ABOUT)
    return assemble(path, _signals(sheets), profile)


def _signals(sheets: Mapping[str, Sequence[Row]]) -> dict[str, Signal]:
    filled = {sheet: rows for sheet, rows in sheets.items() if rows}
    signals: dict[str, Signal] = {}
    for sheet, rows in filled.items():
        units, data = (rows[1], rows[2:]) if len(rows) > 1 and _is_words(rows[1]) else ((), rows[1:])
        for i, head in enumerate(rows[0]):
            if head is None:
                continue
            name = " ".join(str(head).split())
            cells = [row[i] if i < len(row) else None for row in data]
            unit = str(units[i]).strip() if i < len(units) and units[i] is not None else ""
            full = f"{sheet}/{name}" if len(filled) > 1 else name
            full = full if full not in signals else f"{full} (column {i + 1})"
            signals[full] = _signal(cells, unit, shared=name if len(filled) > 1 else "")
    return signals


def _is_words(row: Row) -> bool:
    """Whether a row holds words and no value: units below the names."""
    return all(cell is None or isinstance(cell, str) for cell in row)


def _signal(cells: Sequence[Any], unit: str, shared: str) -> Signal:
    other = next((c for c in cells if c is not None and (isinstance(c, bool) or not isinstance(c, (int, float)))), None)
    if other is not None:
        kind = "true or false" if isinstance(other, bool) else "text" if isinstance(other, str) else "dates"
        return left_out(f"{kind}, got {str(other)[:40]!r}")
    values = np.array([np.nan if cell is None else cell for cell in cells], dtype=np.float64)
    return Signal(values=values, unit=unit, shared=shared) if values.size else left_out("empty")


XLSX = Importer(
    name="xlsx",
    meaning="Excel workbook, columns by the names in the first row",
    sniff=lambda path: path.suffix.lower() == ".xlsx" and starts_with(path, b"PK"),
    read=_read,
)
