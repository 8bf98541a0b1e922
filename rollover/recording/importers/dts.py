"""CSV as DTS software exports it: rows of a key and a value for each channel, `Data Starts Here`, names, numbers.

The ISO channel code says what a channel is, the engineering unit its unit.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from rollover.recording import Recording
from rollover.recording.importers import csv_profile
from rollover.recording.importers import mme_codes as codes
from rollover.recording.importers.importer import Importer
from rollover.recording.importers.polarity import sign
from rollover.recording.importers.sidecar import Described
from rollover.recording.importers.signals import Signal, assemble
from rollover.recording.tables import csv_heading, first_rows, line_of_row, read_columns
from rollover.recording.text_rows import Dialect
from rollover.system.errors import Fault, InputError

MARK = re.compile(rb"^\W*data starts here(.?)", re.IGNORECASE | re.MULTILINE)
LOOKED_AT = 1 << 16  # bytes, in which the header ends
SLACK = 0.01  # of the stated rate: more is another rate, less the rounding of the printed stamps


def _sniff(path: Path) -> bool:
    return path.suffix.lower() in (".csv", ".txt") and path.is_file() and MARK.search(_start(path)) is not None


def _start(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(LOOKED_AT)


def _read(path: Path, profile: Described | None) -> Recording:
    if profile is not None and "csv" in profile.stated:
        return csv_profile.read(path, profile)
    dialect, head = _header(path)
    names, _ = csv_heading(path, dialect)
    clock = next((i for i, name in enumerate(names) if re.match(r"time\b", name, re.IGNORECASE)), None)
    shift = 0 if clock is not None else 1  # values of the header stand in the columns of the channels
    signals: dict[str, Signal] = {}
    for i, name in enumerate(names):
        if i == clock:
            signals[name] = Signal(values=np.empty(0), unit=csv_profile.in_brackets(name) or "s", channel="time")
            continue
        code = _of(head, "iso channel code", i + shift)
        unit = _of(head, "engineering unit", i + shift) or csv_profile.in_brackets(name)
        channel = codes.channel_of(code) if len(code) == 16 else None
        signals[name] = Signal(values=np.empty(0), unit=unit, cfc=codes.cfc_of(code), channel=channel or "")
    known = [name for name, signal in signals.items() if signal.channel]
    wanted = known if profile is None else [name for name in profile.columns if name in signals]
    values, _ = read_columns(path, wanted, (), dialect)
    size = len(next(iter(values.values()), ()))
    rate = _rate(head)
    stamps = None if clock is not None or rate is None else np.arange(size) / rate
    for name, column in values.items():
        signals[name] = replace(signals[name], values=column, time=stamps)
    found = assemble(path, signals, profile, line=lambda row: line_of_row(path, row, dialect))
    notes = list(found.notes)
    if rate and found.time.size > 1 and abs((step := float(np.median(np.diff(found.time)))) * rate - 1.0) > SLACK:
        notes.append(f"Sample Rate says {rate:g} Hz, the column of time {1.0 / step:g} Hz: read by the column")
    turned = [c for c in found.channels if profile is None and sign(c) < 0.0]
    if turned:
        notes.append(f"turned from SAE J211 axes to ISO 8855, as the ISO codes have it: {', '.join(turned)}")
    table = {c: -v if c in turned else v for c, v in found.channels.items()}
    return replace(found, channels=table, notes=tuple(notes))


def _header(path: Path) -> tuple[Dialect, dict[str, list[str]]]:
    start = _start(path)
    match = MARK.search(start)
    assert match is not None
    mark = match[1].decode("latin-1")
    dialect = Dialect(delimiter=mark if mark in (",", ";", "\t") else ",", comment="", loose=True, named=False)
    try:
        start.decode("utf-8-sig")
    except UnicodeDecodeError as e:
        if e.start < len(start) - 4:  # and not a character cut in two
            dialect = replace(dialect, encoding="cp1252")
    head: dict[str, list[str]] = {}
    for i, row in enumerate(first_rows(path, dialect, LOOKED_AT)):
        key = row[0].strip().lower() if row else ""
        if key.startswith("data starts here"):
            numbers = first_rows(path, replace(dialect, before=i + 2), 1)
            decimal = "," if dialect.delimiter != "," and any("," in cell for row in numbers for cell in row) else "."
            return replace(dialect, before=i + 1, named=True, decimal=decimal), head
        head[key] = [cell.strip() for cell in row]
    raise InputError(Fault(file=str(path), message="no row Data Starts Here at the start of a line; one is needed"))


def _of(head: dict[str, list[str]], key: str, column: int) -> str:
    cells = head.get(key, [])
    return cells[column] if column < len(cells) else ""


def _rate(head: dict[str, list[str]]) -> float | None:
    cells = next((cells for key, cells in head.items() if key.startswith("sample rate")), [])
    try:
        return next((float(cell) for cell in cells[1:] if cell), None)
    except ValueError:
        return None


DTS = Importer(name="dts", meaning="CSV of DTS data acquisition", sniff=_sniff, read=_read)
