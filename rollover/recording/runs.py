"""Channels of a run: one Parquet file that says all about itself."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rollover.recording.record import CLASSES, Clock, Recording, Sensor
from rollover.recording.tables import arrow_column, numbers, open_parquet
from rollover.spec.channels import describe
from rollover.system.arguments import is_finite_number
from rollover.system.boundary import CURE, worded
from rollover.system.errors import Fault, InputError

if TYPE_CHECKING:
    from pandas import DataFrame as DataFrame
    from pyarrow import Table as Table

FORMAT = "rollover-channels/1"


def write_parquet(recording: Recording, path: Path) -> None:
    """Write one row per time stamp and one column per channel, each with its unit and meaning."""
    import pyarrow.parquet as pq

    pq.write_table(arrow_table(recording), path)


def arrow_table(recording: Recording) -> Table:
    """One row per time stamp, one column per channel (SI), each with its unit and meaning as metadata."""
    import pyarrow as pa

    table = {"time": recording.time, **recording.channels}
    known = {name: describe(name) for name in table}
    fields = [
        pa.field(name, pa.float64(), metadata={"unit": channel.unit, "meaning": channel.meaning})
        for name, channel in known.items()
    ]
    about = {
        "format": FORMAT,
        "title": recording.title,
        "source": recording.source,
        "conditions": dict(recording.conditions),
        **({"uncertainty": dict(recording.uncertainty)} if recording.uncertainty else {}),
        "noise": dict(recording.noise),
        "cfc": dict(recording.cfc),
        "clock": asdict(recording.clock),
        "sensors": {name: asdict(sensor) for name, sensor in recording.sensors.items()},
        "notes": list(recording.notes),
    }
    schema = pa.schema(fields, metadata={"rollover": json.dumps(about)})
    return pa.table([arrow_column(values) for values in table.values()], schema=schema)


def data_frame(recording: Recording) -> DataFrame:
    """One column per channel (SI), the index is the time, s. Raises ``ImportError`` without pandas."""
    try:
        return arrow_table(recording).to_pandas().set_index("time")
    except ImportError as e:
        if (e.name or "pandas").partition(".")[0] != "pandas":
            raise
        raise ImportError("pandas is not installed; `pip install pandas`, or `to_arrow()`", name="pandas") from None


def is_run(path: Path) -> bool:
    """Whether a Parquet file holds the channels of a run."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        return b"rollover" in (pq.read_schema(path).metadata or {})
    except (OSError, pa.ArrowException, ValueError):
        return False


def read_parquet(path: Path) -> Recording:
    """Read what `write_parquet` wrote, to the last bit. Raises `InputError`."""
    import pyarrow as pa

    try:
        if path.stat().st_size == 0:
            raise InputError(Fault(file=str(path), message=f"cannot be read: empty, got 0 bytes; {CURE}"))
        table = open_parquet(path).read()
    except (OSError, pa.ArrowException, ValueError) as e:
        if isinstance(e, InputError):
            raise
        raise InputError(Fault(file=str(path), message=f"cannot be read: {worded(e)}; {CURE}")) from None
    not_a_run = Fault(file=str(path), message=f"not channels of a run; a file of format {FORMAT} is needed")
    try:
        about = json.loads((table.schema.metadata or {}).get(b"rollover", b"{}"))
        if about.pop("format", None) != FORMAT:
            raise InputError(not_a_run)
        _check(about)
        columns = {name: numbers(table[name]) for name in table.column_names}
        for name in columns:
            describe(name)
        about["clock"] = Clock(**about.get("clock", {}))
        about["uncertainty"] = {path: _tuples(sigma) for path, sigma in about.get("uncertainty", {}).items()}
        about["sensors"] = {name: _sensor(values) for name, values in about.get("sensors", {}).items()}
        about["notes"] = tuple(about.get("notes", ()))
        time = columns.pop("time")
    except InputError:
        raise
    except (AttributeError, KeyError, OverflowError, RecursionError, TypeError, ValueError, pa.ArrowException):
        # someone else wrote it
        raise InputError(not_a_run) from None
    try:
        return Recording(time=time, channels=columns, **about)
    except ValueError as e:
        raise InputError(Fault(file=str(path), message=str(e))) from None
    except TypeError:
        raise InputError(not_a_run) from None


def _check(about: Any) -> None:
    """Look at the types of what is stated of a run. Raises ``TypeError``."""
    kinds: dict[str, type | tuple[type, ...]] = {"title": str, "source": str, "notes": list}
    for key in ("title", "source", "notes", "conditions", "uncertainty", "noise", "cfc", "clock", "sensors"):
        if key in about and not isinstance(about[key], kinds.get(key, dict)):
            raise TypeError(key)
    if not set(about.get("cfc", {}).values()) <= {0, *CLASSES}:
        raise TypeError("cfc")
    numbers_of = [*about.get("noise", {}).values(), *about.get("cfc", {}).values()]
    if not all(is_finite_number(n) for n in numbers_of):
        raise TypeError("noise, cfc")
    if not all(isinstance(note, str) for note in about.get("notes", ())):
        raise TypeError("notes")
    clock = about.get("clock", {})
    within = clock.get("within")
    if clock.get("zero", "known") not in ("known", "unknown") or not (within is None or float(within) > 0.0):
        raise TypeError("clock")


def _sensor(values: dict[str, object]) -> Sensor:
    """Lists of JSON back to the tuples they were."""
    return Sensor(**{k: _tuples(v) for k, v in values.items()})  # type: ignore[arg-type]


def _tuples(value: object) -> object:
    return tuple(map(_tuples, value)) if isinstance(value, list) else value
