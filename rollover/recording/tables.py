"""Tables of numbers in CSV and Parquet files: columns by name, float64, gaps NaN; faults name file and line."""

from __future__ import annotations

import contextlib
import time
import weakref
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.recording.text_rows import (
    BLOCK,
    PLAIN,
    WHITESPACE,
    Dialect,
    Numbers,
    cells_of,
    distinct_names,
    fitted,
    lines_of,
    opened,
    refuse,
    skip,
    take,
)
from rollover.system.boundary import CURE, worded
from rollover.system.budget import Budget
from rollover.system.errors import InputError

Array = NDArray[np.float64]

IN_TABLE = 16  # bytes of a value: in Arrow's table and in numpy's array
LOOKED_AT = 200  # rows, for how many columns there are where no row holds names
LONGEST_READ = 5.0  # s, that a thread may take to read one more block
GAPS = ("", "NaN", "nan", "NAN")


def csv_heading(path: Path, dialect: Dialect = PLAIN) -> tuple[list[str], list[list[str]]]:
    """Names of the columns, and the cells of the lines between them and the numbers. Raises `InputError`."""
    lines = lines_of(path, dialect)
    skip(lines, dialect.before)
    if not dialect.named:
        between = [cells_of(text, dialect) for _, text in take(lines, dialect.between)]
        width = max((len(row) for row in first_rows(path, dialect, LOOKED_AT)), default=0)
        if width == 0:
            refuse(path, "empty, got no row of numbers")
        return [str(i + 1) for i in range(width)], between
    first = next(lines, None)
    if first is None:
        refuse(path, "empty, got no row of column names")
    number, text = first
    names = [name.strip() for name in cells_of(text, dialect)]
    names = distinct_names(names) if dialect.loose else names
    for i, name in enumerate(names):
        if name in names[:i]:
            refuse(path, f"column given twice, got {name!r}; names that differ are needed", number)
    return names, [cells_of(text, dialect) for _, text in take(lines, dialect.between)]


def first_rows(path: Path, dialect: Dialect, count: int) -> list[list[str]]:
    """Cells of the first rows of numbers, without the empty ones at the end. Raises `InputError`."""
    lines = lines_of(path, dialect)
    skip(lines, dialect.above)
    return [fitted(cells_of(text, dialect), 0, 0) for _, text in take(lines, count)]


def read_csv(path: Path, columns: Sequence[str], dialect: Dialect = PLAIN) -> dict[str, Array]:
    """Some columns of a CSV file as numbers. Raises `InputError` that names the line.

    Read in blocks by several threads; every cell that is wanted must be a number or a gap.
    """
    return read_columns(path, columns, (), dialect)[0]


def read_columns(
    path: Path, columns: Sequence[str], words: Sequence[str], dialect: Dialect
) -> tuple[dict[str, Array], dict[str, list[str | None]]]:
    """Some columns of a CSV file as numbers, and some as text, of as many rows. Raises `InputError` with the line."""
    import pyarrow as pa

    names, _ = csv_heading(path, dialect)
    wanted = [*columns, *words]
    needed = 1 + max((names.index(name) for name in wanted), default=-1)
    try:
        if dialect.delimiter == WHITESPACE:
            table = _arrow(path, names, columns, words, dialect, needed)
        else:
            try:
                table = _arrow(path, names, columns, words, dialect, None)
            except pa.ArrowInvalid:
                if not dialect.loose:
                    raise
                table = _arrow(path, names, columns, words, dialect, needed)
    except (pa.ArrowException, OSError, ValueError) as e:
        if isinstance(e, InputError):
            raise
        _find_cell(path, names, columns, needed, dialect)
        if "Empty CSV" in str(e):
            refuse(path, "empty, got column names and no numbers")
        refuse(path, f"cannot be read: {worded(e)}")
    if table.num_rows == 0:
        refuse(path, "empty, got column names and no numbers")
    text = {name: table.column(name).to_pylist() for name in words}
    return _numpy(table.select(list(columns)), columns), text


def _arrow(
    path: Path, names: Sequence[str], columns: Sequence[str], words: Sequence[str], dialect: Dialect, needed: int | None
) -> Any:
    import pyarrow as pa
    import pyarrow.csv as pc

    kinds = {**dict.fromkeys(columns, pa.float64()), **dict.fromkeys(words, pa.string())}
    fit = None if needed is None else (len(names), needed)
    with opened(path) as file, _let_go(Numbers(path, file, dialect, fit)) as rows:
        return pc.read_csv(
            pa.PythonFile(rows.pop(), mode="r"),
            read_options=pc.ReadOptions(column_names=names, block_size=4 * BLOCK),
            parse_options=pc.ParseOptions(delimiter="\t" if dialect.delimiter == WHITESPACE else dialect.delimiter),
            convert_options=pc.ConvertOptions(
                column_types=kinds,
                include_columns=list(kinds),
                decimal_point=dialect.decimal,
                null_values=[*GAPS, *dialect.gaps],
                strings_can_be_null=True,
            ),
        )


@contextlib.contextmanager
def _let_go(rows: Numbers) -> Iterator[list[Numbers]]:
    """Rows to be handed over, and no end before the reader's threads hold them no more.

    A reader that has found a fault still reads ahead: a thread that enters Python as it ends takes the process along.
    """
    rows_left, handed = weakref.ref(rows), [rows]
    del rows
    try:
        yield handed
    finally:
        until = time.monotonic() + LONGEST_READ
        while rows_left() is not None and time.monotonic() < until:
            time.sleep(1e-3)


def read_words(path: Path, columns: Sequence[str], dialect: Dialect = PLAIN) -> dict[str, list[str]]:
    """Some columns of a short CSV file as text. Raises `InputError`."""
    names, _ = csv_heading(path, dialect)
    for name in columns:
        if name not in names:
            refuse(path, f"no column {name}, got {', '.join(names[:12])}")
    lines = lines_of(path, dialect)
    skip(lines, dialect.above)
    rows = [cells_of(text, dialect) for _, text in lines]
    return {name: [row[names.index(name)] for row in rows if len(row) == len(names)] for name in columns}


def blank_lines(path: Path, dialect: Dialect) -> list[int]:
    """Lines without a cell between the first row of numbers and the last; none where one stands behind every row."""
    between: list[list[int]] = []
    since: list[int] = []
    rows = -dialect.above
    for number, text in lines_of(path, dialect, blank=True):
        if not text.strip():
            since.append(number)
            continue
        rows += 1
        if rows > 1:
            between.append(since)
        since = []
    return [] if {len(lines) for lines in between} == {1} else [number for lines in between for number in lines]


def line_of_row(path: Path, row: int, dialect: Dialect = PLAIN) -> int:
    """Line of a CSV file on which a row of numbers stands, both for messages; the first row is 0."""
    lines = lines_of(path, dialect)
    skip(lines, dialect.above)
    for i, (number, _) in enumerate(lines):
        if i == row:
            return number
    raise IndexError(row)


def parquet_names(path: Path) -> list[str]:
    """Names of the columns of a Parquet file. Raises `InputError`."""
    return list(open_parquet(path).schema_arrow.names)


def read_parquet_columns(path: Path, columns: Sequence[str]) -> dict[str, Array]:
    """Some columns of a Parquet file as numbers. Raises `InputError`."""
    import pyarrow as pa

    file = open_parquet(path)
    for name in columns:
        kind = file.schema_arrow.field(name).type
        if not (pa.types.is_floating(kind) or pa.types.is_integer(kind)):
            refuse(path, f"column {name}: not numbers, got {kind}; floating or whole numbers are allowed")
    if file.metadata.num_rows == 0:
        refuse(path, "empty, got a table without rows")
    try:
        return _numpy(file.read(columns=list(columns)), columns)
    except (pa.ArrowException, OSError, ValueError) as e:
        refuse(path, f"cannot be read: {worded(e)}; {CURE}")


def write_csv(columns: Mapping[str, Array], path: Path, head: str = "") -> None:
    """Write columns with every bit of every number; gaps are empty cells, `head` becomes comment lines."""
    import pyarrow as pa
    import pyarrow.compute as pc
    from pyarrow import csv

    with path.open("wb") as file:
        file.writelines(f"# {line}".rstrip().encode() + b"\n" for line in head.splitlines())
        found = {name: arrow_column(values) for name, values in columns.items()}
        gaps = {name: pa.nulls(len(values), pa.float64()) for name, values in found.items()}
        table = pa.table({name: pc.if_else(pc.is_nan(values), gaps[name], values) for name, values in found.items()})
        csv.write_csv(table, file, csv.WriteOptions(quoting_style="needed", quoting_header="needed"))


def write_parquet_columns(columns: Mapping[str, Array], path: Path) -> None:
    """Write columns, float64."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    pq.write_table(pa.table({name: arrow_column(values) for name, values in columns.items()}), path)


def arrow_column(values: Array) -> Any:
    """Numbers (n,) as an array of Arrow, float64, NaN as they are; its own way there would import pandas for it."""
    import pyarrow as pa

    whole = np.ascontiguousarray(values, dtype=np.float64)
    return pa.Array.from_buffers(pa.float64(), whole.size, [None, pa.py_buffer(whole)])


def _numpy(table: Any, columns: Sequence[str]) -> dict[str, Array]:
    """Columns one by one, each let go of as it is copied, so that the table never stands in memory twice."""
    found = {}
    for name in columns:
        at = table.column_names.index(name)
        found[name] = numbers(table.column(at))
        table = table.remove_column(at)
    return found


def numbers(column: Any) -> Array:
    """A column of a table of Arrow as numbers, gaps as NaN; its own way there would import pandas for it."""
    import pyarrow as pa
    import pyarrow.compute as pc

    whole = column.cast(pa.float64(), safe=False)
    if whole.null_count:
        whole = pc.fill_null(whole, arrow_column(np.array([np.nan]))[0])
    return np.concatenate([np.zeros(0), *(np.from_dlpack(chunk) for chunk in whole.chunks if len(chunk))])


def open_parquet(path: Path) -> Any:
    """An open Parquet file, of which nothing but what it says of itself is read yet. Raises `InputError`."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    with opened(path):
        pass
    try:
        file = pq.ParquetFile(path)
    except (pa.ArrowException, OSError, ValueError) as e:
        refuse(path, f"cannot be read: {worded(e)}; {CURE}")
    Budget(path).claim(IN_TABLE * file.metadata.num_rows * max(1, file.metadata.num_columns))
    return file


def _find_cell(path: Path, names: Sequence[str], columns: Sequence[str], needed: int, dialect: Dialect) -> None:
    """Name the first row that is too short or too long, or the first cell that is not a number."""
    wanted = [names.index(name) for name in columns]
    lines = lines_of(path, dialect)
    skip(lines, dialect.above)
    for number, line in lines:
        cells = cells_of(line, dialect)
        cells = fitted(cells, len(names), needed) if dialect.loose else cells
        cure = dialect.cure if len(cells) > len(names) or ";" in line or "\t" in line else ""
        if len(cells) != len(names):
            refuse(path, f"got {len(cells)} cells; {len(names)} are needed, one a column{cure}", number)
        for i in wanted:
            if not is_number(cells[i], dialect.decimal) and cells[i] not in dialect.gaps:
                message = f"column {names[i]}: not a number, got {cells[i][:40]!r}; a number or an empty cell is needed"
                if dialect.loose and not cure:
                    cure = f", or in the profile, where this is none: csv: {{gaps: [{cells[i][:40]!r}]}}"
                refuse(path, message + cure, number)


def is_number(cell: str, decimal: str = ".") -> bool:
    """Whether a cell is a number, or a gap."""
    cell = cell.strip()
    if cell in GAPS:
        return True
    try:
        float(cell.replace(decimal, "."))
    except ValueError:
        return False
    return "_" not in cell and (decimal == "." or "." not in cell)
