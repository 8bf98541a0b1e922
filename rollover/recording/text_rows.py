"""Rows of text tables: how they are written, their lines without comments, their cells; faults name file and line."""

from __future__ import annotations

import codecs
import csv
import io
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, NoReturn

from rollover.system.errors import Fault, InputError, cured

LONGEST_LINE = 1 << 16
CURE = "a table of numbers in UTF-8 is needed; --profile FILE says how another one is written"
WHITESPACE = "whitespace"  # as a delimiter: any number of blanks and tabs
BLOCK = 1 << 20
_BOMS = {codecs.BOM_UTF32_LE: "UTF-32", codecs.BOM_UTF32_BE: "UTF-32", codecs.BOM_UTF16_LE: "UTF-16"}
_BOMS[codecs.BOM_UTF16_BE] = "UTF-16"


@dataclass(frozen=True, kw_only=True)
class Dialect:
    """How a CSV file is written; the defaults are those of `rollover-recording/1`.

    `before` lines stand above the row of names, `between` lines (such as one of units) between it and the numbers.
    Columns of a table that is not `named` are 1, 2, ... In a `loose` table, rows may end in empty cells, and may end
    after the last column that is read; columns without a name are numbered.
    """

    delimiter: str = ","
    decimal: str = "."
    encoding: str = "utf-8"
    comment: str = "#"
    before: int = 0
    between: int = 0
    named: bool = True
    loose: bool = False
    gaps: tuple[str, ...] = ()  # cells that hold no value, beside those of `tables.GAPS`
    cure: str = ""  # what a message about a cell should add

    @property
    def above(self) -> int:
        """How many lines stand above the first of numbers."""
        return self.before + self.named + self.between


PLAIN = Dialect(cure="; a decimal comma or another delimiter is read with a CSV profile: --profile FILE.yaml")


def opened(path: Path) -> BinaryIO:
    """A plain file that holds something, for reading. Raises `InputError`."""
    try:
        if not path.is_file() and path.exists():
            refuse(path, "a folder, not a file" if path.is_dir() else "not a plain file")
        file = path.open("rb")
    except (OSError, RuntimeError) as e:
        refuse(path, f"cannot be read: {getattr(e, 'strerror', None) or e}")
    if not file.read(1):
        file.close()
        refuse(path, "empty, got a file of 0 bytes")
    file.seek(0)
    return file


def lines_of(path: Path, dialect: Dialect, *, blank: bool = False) -> Iterator[tuple[int, str]]:
    """Lines that are neither blank nor comments, with their numbers; with `blank` those that are blank too."""
    plain = dialect.encoding.lower().replace("_", "-") in ("utf-8", "utf8")
    number = 0
    with opened(path) as file:
        start = file.read(4)
        file.seek(0)
        what = next((what for mark, what in _BOMS.items() if start.startswith(mark)), None) if plain else None
        if what:
            refuse(path, f"not UTF-8 text, got {what}; save it as UTF-8, or name its encoding in a CSV profile", 1)
        text = io.TextIOWrapper(file, encoding="utf-8-sig" if plain else dialect.encoding, newline=None)
        try:
            while line := text.readline(LONGEST_LINE):
                number += 1
                if len(line) == LONGEST_LINE:
                    refuse(path, f"not a table, got a line of more than {LONGEST_LINE} characters", number)
                if "\0" in line or "\ufeff" in line:
                    what = "a NUL byte" if "\0" in line else "a byte order mark inside the text"
                    refuse(path, f"not a text file, got {what}; save it as UTF-8", number)
                if (blank or line.strip()) and not (dialect.comment and line.startswith(dialect.comment)):
                    yield number, line.rstrip("\r\n")
        except UnicodeDecodeError as e:
            what = f"not {dialect.encoding} text, got byte 0x{e.object[e.start]:02x}"
            refuse(path, f"{what}; csv.encoding of a profile (--profile) names another, such as cp1252", number + 1)


def cells_of(line: str, dialect: Dialect) -> list[str]:
    """Cells of a line."""
    if dialect.delimiter == WHITESPACE:
        return line.split()
    return next(csv.reader([line], delimiter=dialect.delimiter), [])


def distinct_names(names: list[str]) -> list[str]:
    """Names without the empty ones at the end; those that are empty or stand twice get their place."""
    while names and not names[-1]:
        names.pop()
    return [
        f"{name or 'no name'} (column {i + 1})" if not name or names.count(name) > 1 else name
        for i, name in enumerate(names)
    ]


def fitted(cells: list[str], width: int, needed: int) -> list[str]:
    """Cells of a row, without empty ones beyond the width, and with those that it lacks after the last needed."""
    while len(cells) > width and not cells[-1].strip():
        cells.pop()
    return cells + [""] * (width - len(cells)) if len(cells) >= needed else cells


def skip(lines: Iterator[tuple[int, str]], count: int) -> None:
    """Pass by the next lines."""
    for _ in take(lines, count):
        pass


def take(lines: Iterator[tuple[int, str]], count: int) -> Iterator[tuple[int, str]]:
    """The next lines, as many as there are."""
    for _ in range(count):
        line = next(lines, None)
        if line is None:
            return
        yield line


class Numbers(io.RawIOBase):
    """What stands below the names, as UTF-8, without comments; in blocks that end with a line.

    With `fit`, the number of columns and of those needed, every row is brought to as many cells.
    """

    def __init__(self, path: Path, file: BinaryIO, dialect: Dialect, fit: tuple[int, int] | None = None) -> None:
        self.path, self.file, self.dialect, self.fit = path, file, dialect, fit
        self.decode = codecs.getincrementaldecoder(dialect.encoding)()
        self.as_it_is = dialect.encoding.lower() in ("utf-8", "utf8", "ascii")
        self.ready, self.rest = b"", b""
        self.above = dialect.above
        self.by_line = dialect.delimiter in (" ", "\t", WHITESPACE)  # a line of nothing but these is blank

    def readable(self) -> bool:
        """Always."""
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
        raw = self.file.read(BLOCK)
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
        if self.above or self.fit or self.by_line or (comment and comment in block):
            kept = []
            for line in block.splitlines(keepends=True):
                if not line.strip(b"\xef\xbb\xbf \t\r\n") or (
                    comment and line.lstrip(codecs.BOM_UTF8).startswith(comment)
                ):
                    continue
                if self.above:
                    self.above -= 1
                else:
                    kept.append(line if self.fit is None else self._row(line, *self.fit))
            block = b"".join(kept)
        self.ready = block
        return True

    def _row(self, line: bytes, width: int, needed: int) -> bytes:
        mark = self.dialect.delimiter
        bare = line.decode(errors="surrogateescape").strip("\ufeff\r\n")
        if '"' not in bare or mark == WHITESPACE:
            cells = bare.split() if mark == WHITESPACE else bare.split(mark)
            text = ("\t" if mark == WHITESPACE else mark).join(fitted(cells, width, needed)) + "\n"
        else:
            out = io.StringIO()
            cells = cells_of(bare, self.dialect)
            csv.writer(out, delimiter=mark, lineterminator="\n").writerow(fitted(cells, width, needed))
            text = out.getvalue()
        return text.encode(errors="surrogateescape")


def _find_line(path: Path, dialect: Dialect) -> None:
    """Name the line that is no text."""
    for _ in lines_of(path, dialect):
        pass


def refuse(path: Path, message: str, line: int | None = None) -> NoReturn:
    """Raise `InputError` with what is wrong with a file, or with one of its lines."""
    raise InputError(cured(Fault(file=str(path), line=line, message=message), CURE)) from None
