"""Tables of numbers in CSV and Parquet files: columns by name, float64, gaps NaN; faults name file and line."""

from __future__ import annotations

import codecs
import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, NoReturn

import numpy as np
from numpy.typing import NDArray

from rollover.faults import Fault, InputError

Array = NDArray[np.float64]

MOST_VALUES = 500_000_000  # 4 GB of float64: more is no recording of one test
LONGEST_LINE = 1 << 16
GAPS = ("", "NaN", "nan", "NAN")
_BLOCK = 1 << 20
_BOMS = {codecs.BOM_UTF32_LE: "UTF-32", codecs.BOM_UTF32_BE: "UTF-32", codecs.BOM_UTF16_LE: "UTF-16"}
_BOMS[codecs.BOM_UTF16_BE] = "UTF-16"


@dataclass(frozen=True, kw_only=True)
class Dialect:
    """How a CSV file is written; the defaults are those of `rollover-recording/1`.

    `before` lines stand above the row of names, `between` lines (such as one of units) between it and the numbers.
    """

    delimiter: str = ","
    decimal: str = "."
    encoding: str = "utf-8"
    comment: str = "#"
    before: int = 0
    between: int = 0
    cure: str = ""  # what a message about a cell should add


PLAIN = Dialect(cure="; a decimal comma or another delimiter is read with a CSV profile: --profile FILE.yaml")


def csv_heading(path: Path, dialect: Dialect = PLAIN) -> tuple[list[str], list[list[str]]]:
    """Names of the columns, and the cells of the lines between them and the numbers. Raises `InputError`."""
    lines = _lines(path, dialect)
    _skip(lines, dialect.before)
    first = next(lines, None)
    if first is None:
        _refuse(path, "empty, got no row of column names")
    number, text = first
    names = [name.strip() for name in _cells(text, dialect)]
    for i, name in enumerate(names):
        if name in names[:i]:
            _refuse(path, f"column given twice, got {name!r}; names that differ are needed", number)
    return names, [_cells(text, dialect) for _, text in _take(lines, dialect.between)]


def read_csv(path: Path, columns: Sequence[str], dialect: Dialect = PLAIN) -> dict[str, Array]:
    """Some columns of a CSV file as numbers. Raises `InputError` that names the line.

    Read in blocks by several threads; every cell that is wanted must be a number or a gap.
    """
    import pyarrow as pa
    import pyarrow.csv as pc

    names, _ = csv_heading(path, dialect)
    with _opened(path) as file:
        try:
            table = pc.read_csv(
                pa.PythonFile(_Numbers(path, file, dialect), mode="r"),
                read_options=pc.ReadOptions(column_names=names, block_size=4 * _BLOCK),
                parse_options=pc.ParseOptions(delimiter=dialect.delimiter),
                convert_options=pc.ConvertOptions(
                    column_types={name: pa.float64() for name in columns},
                    include_columns=list(columns),
                    decimal_point=dialect.decimal,
                    null_values=list(GAPS),
                    strings_can_be_null=True,
                ),
            )
        except InputError:
            raise
        except (pa.ArrowException, OSError, ValueError) as e:
            _find_cell(path, names, columns, dialect)
            if "Empty CSV" in str(e):
                _refuse(path, "empty, got column names and no numbers")
            _refuse(path, f"cannot be read: {str(e).splitlines()[0]}")
    if table.num_rows == 0:
        _refuse(path, "empty, got column names and no numbers")
    return _numpy(table, columns)


def read_words(path: Path, columns: Sequence[str], dialect: Dialect = PLAIN) -> dict[str, list[str]]:
    """Some columns of a short CSV file as text. Raises `InputError`."""
    names, _ = csv_heading(path, dialect)
    for name in columns:
        if name not in names:
            _refuse(path, f"no column {name}, got {', '.join(names[:12])}")
    lines = _lines(path, dialect)
    _skip(lines, dialect.before + 1 + dialect.between)
    rows = [_cells(text, dialect) for _, text in lines]
    return {name: [row[names.index(name)] for row in rows if len(row) == len(names)] for name in columns}


def line_of_row(path: Path, row: int, dialect: Dialect = PLAIN) -> int:
    """Line of a CSV file on which a row of numbers stands, both for messages; the first row is 0."""
    lines = _lines(path, dialect)
    _skip(lines, dialect.before + 1 + dialect.between)
    for i, (number, _) in enumerate(lines):
        if i == row:
            return number
    raise IndexError(row)


def parquet_names(path: Path) -> list[str]:
    """Names of the columns of a Parquet file. Raises `InputError`."""
    return list(_parquet(path).schema_arrow.names)


def read_parquet_columns(path: Path, columns: Sequence[str]) -> dict[str, Array]:
    """Some columns of a Parquet file as numbers. Raises `InputError`."""
    import pyarrow as pa

    file = _parquet(path)
    for name in columns:
        kind = file.schema_arrow.field(name).type
        if not (pa.types.is_floating(kind) or pa.types.is_integer(kind)):
            _refuse(path, f"column {name}: not numbers, got {kind}; floating or whole numbers are allowed")
    if file.metadata.num_rows == 0:
        _refuse(path, "empty, got a table without rows")
    try:
        return _numpy(file.read(columns=list(columns)), columns)
    except (pa.ArrowException, OSError) as e:
        _refuse(path, f"cannot be read: {str(e).splitlines()[0]}")


def write_csv(columns: Mapping[str, Array], path: Path, head: str = "") -> None:
    """Write columns with every bit of every number; gaps are empty cells, `head` becomes comment lines."""
    import pyarrow as pa
    import pyarrow.csv as pc

    with path.open("wb") as file:
        file.writelines(f"# {line}".rstrip().encode() + b"\n" for line in head.splitlines())
        table = pa.table({name: pa.array(values, from_pandas=True) for name, values in columns.items()})
        pc.write_csv(table, file, pc.WriteOptions(quoting_style="needed", quoting_header="needed"))


def write_parquet_columns(columns: Mapping[str, Array], path: Path) -> None:
    """Write columns, float64."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    pq.write_table(pa.table({name: pa.array(values) for name, values in columns.items()}), path)


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
        whole = pc.fill_null(whole, pa.scalar(np.nan, pa.float64()))
    return np.concatenate([np.zeros(0), *(np.from_dlpack(chunk) for chunk in whole.chunks if len(chunk))])


def _parquet(path: Path) -> Any:
    import pyarrow as pa
    import pyarrow.parquet as pq

    with _opened(path):
        pass
    try:
        file = pq.ParquetFile(path)
    except (pa.ArrowException, OSError, ValueError) as e:
        _refuse(path, f"cannot be read: {str(e).splitlines()[0]}")
    rows, size = file.metadata.num_rows, path.stat().st_size
    if rows < 0 or rows * max(1, file.metadata.num_columns) > MOST_VALUES or rows > 100 * size:
        _refuse(path, f"claims too much, got {rows} rows in {size} bytes; at most {MOST_VALUES} values are allowed")
    return file


def _opened(path: Path) -> BinaryIO:
    try:
        if not path.is_file() and path.exists():
            _refuse(path, "a folder, not a file" if path.is_dir() else "not a plain file")
        file = path.open("rb")
    except (OSError, RuntimeError) as e:
        _refuse(path, f"cannot be read: {getattr(e, 'strerror', None) or e}")
    if not file.read(1):
        file.close()
        _refuse(path, "empty, got a file of 0 bytes")
    file.seek(0)
    return file


def _lines(path: Path, dialect: Dialect) -> Iterator[tuple[int, str]]:
    """Lines that are neither blank nor comments, with their numbers."""
    plain = dialect.encoding.lower().replace("_", "-") in ("utf-8", "utf8")
    number = 0
    with _opened(path) as file:
        start = file.read(4)
        file.seek(0)
        what = next((what for mark, what in _BOMS.items() if start.startswith(mark)), None) if plain else None
        if what:
            _refuse(path, f"not UTF-8 text, got {what}; save it as UTF-8, or name its encoding in a CSV profile", 1)
        text = io.TextIOWrapper(file, encoding="utf-8-sig" if plain else dialect.encoding, newline=None)
        try:
            while line := text.readline(LONGEST_LINE):
                number += 1
                if len(line) == LONGEST_LINE:
                    _refuse(path, f"not a table, got a line of more than {LONGEST_LINE} characters", number)
                if "\0" in line or "\ufeff" in line:
                    what = "a NUL byte" if "\0" in line else "a byte order mark inside the text"
                    _refuse(path, f"not a text file, got {what}; save it as UTF-8", number)
                if line.strip() and not (dialect.comment and line.startswith(dialect.comment)):
                    yield number, line.rstrip("\r\n")
        except UnicodeDecodeError as e:
            _refuse(path, f"not {dialect.encoding} text, got byte 0x{e.object[e.start]:02x}", number + 1)


def _cells(line: str, dialect: Dialect) -> list[str]:
    return next(csv.reader([line], delimiter=dialect.delimiter), [])


def _skip(lines: Iterator[tuple[int, str]], count: int) -> None:
    for _ in _take(lines, count):
        pass


def _take(lines: Iterator[tuple[int, str]], count: int) -> Iterator[tuple[int, str]]:
    for _ in range(count):
        line = next(lines, None)
        if line is None:
            return
        yield line


class _Numbers(io.RawIOBase):
    """What stands below the names, as UTF-8, without comments; in blocks that end with a line."""

    def __init__(self, path: Path, file: BinaryIO, dialect: Dialect) -> None:
        self.path, self.file, self.dialect = path, file, dialect
        self.decode = codecs.getincrementaldecoder(dialect.encoding)()
        self.as_it_is = dialect.encoding.lower() in ("utf-8", "utf8", "ascii")
        self.ready, self.rest = b"", b""
        self.above = dialect.before + 1 + dialect.between

    def readable(self) -> bool:
        return True

    def read(self, size: int = -1) -> bytes:
        """At most `size` bytes, b"" at the end."""
        while not self.ready:
            if not self._next_block():
                return b""
        if size < 0:
            size = len(self.ready)
        given, self.ready = self.ready[:size], self.ready[size:]
        return given

    def _next_block(self) -> bool:
        raw = self.file.read(_BLOCK)
        if not raw and not self.rest:
            return False
        block = self.rest + (raw if self.as_it_is else self.decode.decode(raw, not raw).encode())
        self.rest = b""
        if raw:
            cut = max(block.rfind(b"\n"), block.rfind(b"\r", 0, len(block) - 1)) + 1
            if cut == 0 and len(block) > LONGEST_LINE:
                _find_line(self.path, self.dialect)
            block, self.rest = block[:cut], block[cut:]
        if b"\0" in block or codecs.BOM_UTF8 in block[3:]:
            _find_line(self.path, self.dialect)
        comment = self.dialect.comment.encode()
        if self.above or (comment and comment in block):
            kept = []
            for line in block.splitlines(keepends=True):
                if not line.strip(b"\xef\xbb\xbf \t\r\n") or (
                    comment and line.lstrip(codecs.BOM_UTF8).startswith(comment)
                ):
                    continue
                if self.above:
                    self.above -= 1
                else:
                    kept.append(line)
            block = b"".join(kept)
        self.ready = block
        return True


def _find_line(path: Path, dialect: Dialect) -> None:
    """Name the line that is no text."""
    for _ in _lines(path, dialect):
        pass


def _find_cell(path: Path, names: Sequence[str], columns: Sequence[str], dialect: Dialect) -> None:
    """Name the first row that is too short or too long, or the first cell that is not a number."""
    wanted = [names.index(name) for name in columns]
    lines = _lines(path, dialect)
    _skip(lines, dialect.before + 1 + dialect.between)
    for number, line in lines:
        cells = _cells(line, dialect)
        cure = dialect.cure if len(cells) > len(names) or ";" in line or "\t" in line else ""
        if len(cells) != len(names):
            _refuse(path, f"got {len(cells)} cells; {len(names)} are needed, one a column{cure}", number)
        for i in wanted:
            if not _is_number(cells[i], dialect.decimal):
                message = f"column {names[i]}: not a number, got {cells[i][:40]!r}; a number or an empty cell is needed"
                _refuse(path, message + cure, number)


def _is_number(cell: str, decimal: str) -> bool:
    cell = cell.strip()
    if cell in GAPS:
        return True
    try:
        float(cell.replace(decimal, "."))
    except ValueError:
        return False
    return "_" not in cell and (decimal == "." or "." not in cell)


def _refuse(path: Path, message: str, line: int | None = None) -> NoReturn:
    raise InputError(Fault(file=str(path), line=line, message=message)) from None
