"""`rollover-recording/1`: one table, NAME.csv or NAME.parquet, and what it means, NAME.yaml."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.recording import Clock, Recording, Sensor, is_run, read_parquet
from rollover.recording.importers.sidecar import Described, Sidecar, read_described
from rollover.recording.importers.signals import Signal, assemble
from rollover.recording.importers.soundness import check_recording
from rollover.recording.tables import (
    csv_heading,
    line_of_row,
    parquet_names,
    read_csv,
    read_parquet_columns,
    write_csv,
    write_parquet_columns,
)
from rollover.spec.channels import describe
from rollover.spec.document import dump_mapping, to_mapping
from rollover.system.errors import Fault, InputError, seen
from rollover.system.writing import check_free, together

FORMAT = "rollover-recording/1"
TABLES = (".csv", ".parquet")
Array = NDArray[np.float64]


def sniff(path: Path) -> bool:
    """A table with a sidecar, the sidecar itself, or the channels of a run."""
    if path.suffix.lower() == ".yaml":
        return any(path.with_suffix(ending).exists() for ending in TABLES)
    if path.suffix.lower() not in TABLES:
        return False
    return path.with_suffix(".yaml").exists() or (path.suffix.lower() == ".parquet" and is_run(path))


def read(path: Path, profile: Described | None = None) -> Recording:
    """Recording of a table and its sidecar, SI; columns without a description are left out. Raises `InputError`."""
    if profile is not None:
        raise InputError(Fault(file=profile.file, message=f"a profile, and {path.name} has a sidecar; one of them"))
    table = _table(path)
    if table.suffix.lower() == ".parquet" and is_run(table):
        return read_parquet(table)
    sidecar = table.with_suffix(".yaml")
    if not sidecar.is_file():
        message = f"no sidecar, got no {sidecar.name} beside it; it says what the columns are (format: {FORMAT})"
        raise InputError(Fault(file=str(path), message=message))
    given = read_described(sidecar, Sidecar)
    is_csv = table.suffix.lower() == ".csv"
    names = csv_heading(table)[0] if is_csv else parquet_names(table)
    wanted = [name for name in given.columns if name in names]
    values = read_csv(table, wanted) if is_csv else read_parquet_columns(table, wanted)
    nothing = Signal(values=np.empty(0))  # a column that is not described is not read
    return assemble(
        table,
        {name: Signal(values=values.pop(name)) if name in wanted else nothing for name in names},
        given,
        line=(lambda row: line_of_row(table, row)) if is_csv else lambda row: None,
    )


def write(recording: Recording, path: Path, *, force: bool = False, with_units: bool = False) -> None:
    """Write a recording, SI, to the last bit: `path` ends in .csv or .parquet. Raises `InputError`.

    Both files stand there at the end or neither; `force` replaces what is there. Columns bear the names of their
    channels, with the unit behind them `with_units`. What `read` would refuse is refused.
    """
    if path.suffix not in TABLES:
        raise InputError(Fault(file=str(path), message=f"no such table, got {path.suffix!r}; .csv or .parquet"))
    sidecar = path.with_suffix(".yaml")
    check_free(path, sidecar, force=force)
    check_recording(path, recording)
    names = columns_of(recording, with_units=with_units)
    with together(path) as part:
        columns = {names[channel]: values for channel, values in table_of(recording).items()}
        (part / sidecar.name).write_text(sidecar_of(recording, names), encoding="utf-8")
        try:
            read_described(part / sidecar.name, Sidecar)
        except InputError as e:
            raise InputError(*(replace(fault, file=str(sidecar), line=None) for fault in e.faults)) from None
        (write_csv if path.suffix == ".csv" else write_parquet_columns)(columns, part / path.name)


def table_of(recording: Recording) -> dict[str, Array]:
    """Time and channels by name, each (n,)."""
    return {"time": recording.time, **recording.channels}


def columns_of(recording: Recording, *, with_units: bool = True) -> dict[str, str]:
    """Name of the column of each channel, of time too: `ground/sinkage [m]`."""
    return {name: f"{name} [{describe(name).unit}]" if with_units else name for name in table_of(recording)}


def sidecar_of(recording: Recording, columns: Mapping[str, str]) -> str:
    """Text of the sidecar of a table whose columns are named so, by channel."""
    about = _about(recording)
    about["channels"] = {columns[name]: entry for name, entry in about["channels"].items()}
    return f"# {seen(_one_line(recording.title))}\n" + dump_mapping(about)


def _table(path: Path) -> Path:
    if path.suffix.lower() in TABLES:
        return path
    found = [path.with_suffix(ending) for ending in TABLES if path.with_suffix(ending).is_file()]
    if len(found) != 1:
        message = f"got {len(found)} tables beside it; one of {path.stem}.csv and {path.stem}.parquet is needed"
        raise InputError(Fault(file=str(path), message=message))
    return found[0]


def _about(recording: Recording) -> dict[str, Any]:
    channels: dict[str, Any] = {}
    for name in ("time", *recording.channels):
        entry: dict[str, Any] = {"channel": name, "unit": describe(name).unit}
        if name in recording.noise:
            entry["noise"] = float(recording.noise[name])
        if name in recording.cfc:
            entry["cfc"] = int(recording.cfc[name])
        if name in recording.sensors:
            entry["sensor"] = _without_defaults(recording.sensors[name])
        channels[name] = entry
    about: dict[str, Any] = {"format": FORMAT, "title": recording.title, "source": recording.source}
    if recording.conditions:
        about["conditions"] = dict(recording.conditions)
    if recording.uncertainty:
        about["uncertainty"] = {k: list(v) if isinstance(v, tuple) else v for k, v in recording.uncertainty.items()}
    if recording.clock != Clock():
        about["clock"] = {k: v for k, v in to_mapping(recording.clock).items() if v is not None}
    if recording.notes:
        about["notes"] = list(recording.notes)
    return {**about, "channels": channels}


def _without_defaults(sensor: Sensor) -> dict[str, Any]:
    bare = to_mapping(Sensor(body=sensor.body))
    return {k: v for k, v in to_mapping(sensor).items() if k in ("body", "position") or v != bare[k]}


def _one_line(text: str) -> str:
    return " ".join(text.split())
