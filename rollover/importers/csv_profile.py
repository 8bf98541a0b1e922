"""CSV as loggers write it: delimiter, decimal mark, encoding and rows by a profile."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rollover.faults import Fault, InputError
from rollover.importers.importer import Importer
from rollover.importers.sidecar import Described, Profile
from rollover.importers.signals import Signal, assemble
from rollover.recording import Recording
from rollover.recording.tables import Dialect, csv_heading, line_of_row, read_csv


def _sniff(path: Path) -> bool:
    return path.suffix.lower() in (".csv", ".txt", ".asc", ".dat", ".tsv") and path.is_file()


def _read(path: Path, profile: Described | None) -> Recording:
    if profile is None or not isinstance(profile.about, Profile):
        message = f"no sidecar, got no {path.stem}.yaml beside it; write one, or say with --profile how to read it"
        raise InputError(Fault(file=str(path), message=message))
    how = profile.about.csv
    last = (how.data_row or (how.units_row or how.names_row) + 1) - 1
    dialect = Dialect(
        delimiter=how.delimiter,
        decimal=how.decimal,
        encoding=how.encoding,
        comment=how.comment,
        before=how.names_row - 1,
        between=last - how.names_row,
    )
    names, between = csv_heading(path, dialect)
    units = dict(zip(names, between[how.units_row - how.names_row - 1], strict=False)) if how.units_row else {}
    wanted = [name for name in profile.columns if name in names]
    values = read_csv(path, wanted, dialect)
    nothing = Signal(values=np.empty(0))
    signals = {
        name: Signal(values=values.pop(name), unit=units.get(name, "").strip().strip("[]()"))
        if name in wanted
        else nothing
        for name in names
    }
    return assemble(path, signals, profile, line=lambda row: line_of_row(path, row, dialect))


CSV = Importer(name="csv", meaning="CSV of any logger, by a profile", sniff=_sniff, read=_read)
