"""Named numbers in small Parquet files, and tables of numbers and words: what a study keeps of its cases."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.system.budget import Budget
from rollover.system.writing import put

KEY = b"rollover"
IN_LIST = 40  # bytes of a value: in Arrow's table, and as a number of Python in a list
Column = NDArray[Any] | Sequence[Any]


class UnreadableError(ValueError):
    """A file is not what it ought to be: cut off, or made by somebody else."""


def write_pairs(values: Mapping[str, float], about: Mapping[str, Any], path: Path) -> None:
    """Write names and numbers, two columns, with `about` (bare JSON values) in the file's metadata; whole or not."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    numbers = pa.array(list(values.values()), pa.float64())
    table = pa.table({"name": pa.array(list(values), pa.string()), "value": numbers})
    table = table.replace_schema_metadata({KEY: json.dumps(about)})
    # small as they are, dictionaries and statistics would be most of the file
    small = {"compression": "none", "use_dictionary": False, "write_statistics": False}
    put(path, lambda at: pq.write_table(table, at, write_page_checksum=True, **small))


def read_pairs(path: Path) -> tuple[dict[str, float], dict[str, Any]]:
    """What `write_pairs` wrote, to the last bit. Raises `UnreadableError`, also where a bit has turned since."""
    import pyarrow as pa

    try:
        table = _opened(path).read(use_threads=False)
        about = _mapping(table.schema.metadata[KEY])
        if table["name"].type != pa.string() or table["value"].type != pa.float64():
            raise TypeError("name and value: not text and numbers")
        values = dict(zip(table["name"].to_pylist(), table["value"].to_pylist(), strict=True))
    except (OSError, pa.ArrowException, KeyError, RecursionError, TypeError, ValueError) as e:
        raise UnreadableError(f"{path}: {e}") from None
    return values, about


def write_table(
    columns: Mapping[str, Column], path: Path, meanings: Mapping[str, Mapping[str, str]], about: Mapping[str, Any]
) -> None:
    """Write columns of float64, whole numbers or words, each with unit and meaning; the same table, the same bytes."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    arrays = {name: pa.array(values) for name, values in columns.items()}
    arrays = {name: a.cast(pa.string()) if pa.types.is_null(a.type) else a for name, a in arrays.items()}
    fields = [pa.field(name, array.type, metadata=dict(meanings.get(name, {}))) for name, array in arrays.items()]
    schema = pa.schema(fields, metadata={KEY: json.dumps(about)})
    table = pa.Table.from_arrays(list(arrays.values()), schema=schema)
    put(path, lambda at: pq.write_table(table, at, write_page_checksum=True))


def read_table(path: Path) -> tuple[dict[str, list[Any]], dict[str, Any]]:
    """Columns as lists, None where there is nothing, and what the table says of itself. Raises `UnreadableError`."""
    import pyarrow as pa

    try:
        table = _opened(path).read()
        about = _mapping((table.schema.metadata or {}).get(KEY, b"{}"))
        return {name: table[name].to_pylist() for name in table.column_names}, about
    except (OSError, pa.ArrowException, RecursionError, TypeError, ValueError) as e:
        raise UnreadableError(f"{path}: {e}") from None


def _opened(path: Path) -> Any:
    """An open Parquet file, whose claims are within bounds; pages are held against their checksums where they have any.

    Raises `InputError`, which is a ``ValueError``; what reads a damaged page ``OSError``.
    """
    import pyarrow.parquet as pq

    file = pq.ParquetFile(path, page_checksum_verification=True)
    Budget(path).claim(IN_LIST * file.metadata.num_rows * max(1, file.metadata.num_columns))
    return file


def _mapping(text: bytes) -> dict[str, Any]:
    found = json.loads(text)
    if not isinstance(found, dict):
        raise TypeError(f"not a mapping, got {type(found).__name__}")
    return found


def as_numbers(values: Sequence[Any]) -> NDArray[np.float64]:
    """A column as float64, NaN where there is nothing."""
    return np.array([np.nan if v is None else v for v in values], dtype=np.float64)


def put_text(path: Path, text: str) -> None:
    """Write a text file, whole or not at all."""
    put(path, lambda at: at.write_text(text, encoding="utf-8"))
