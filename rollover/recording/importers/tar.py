"""Tar files, packed or not, of which no header is believed: one may say that its own text has gigabytes."""

from __future__ import annotations

import bz2
import gzip
import io
import lzma
import tarfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from rollover.system import budget
from rollover.system.errors import Fault, InputError

_PACKED: dict[bytes, Callable[..., Any]] = {b"\x1f\x8b": gzip.open, b"BZh": bz2.open, b"\xfd7zXZ\x00": lzma.open}
_HEADER = 512  # bytes


class _Bounded(io.RawIOBase):
    """A file of which no more is read than it may unpack to."""

    def __init__(self, file: IO[bytes], path: Path) -> None:
        self._file, self._path = file, path
        self._size = path.stat().st_size
        self._most = budget.unpacked(self._size)

    def read(self, size: int = -1) -> bytes:
        """Bytes that follow. Raises `InputError` where they would be too many."""
        until = self._file.tell() + (self._most + 1 if size < 0 else size)
        if until > self._most + _HEADER:
            got = f"got a part that ends after {budget.amount(until)} in a file of {budget.amount(self._size)}"
            most = f"at most {budget.amount(self._most)} are allowed; {budget.cure(until / self._most)}"
            raise InputError(Fault(file=str(self._path), message=f"claims too much, {got}; {most}"))
        return self._file.read(size)

    def seek(self, offset: int, whence: int = 0) -> int:
        """Go there, by unpacking what lies between. Raises `InputError` for what lies too far."""
        if whence == 0 and offset > self._most + _HEADER:
            self.read(offset - self._file.tell())
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        """Where it is."""
        return self._file.tell()

    def readable(self) -> bool:
        """It is."""
        return True

    def seekable(self) -> bool:
        """It is."""
        return True


def _opened(path: Path) -> IO[bytes]:
    with path.open("rb") as file:
        start = file.read(6)
    unpack = next((function for mark, function in _PACKED.items() if start.startswith(mark)), None)
    return path.open("rb") if unpack is None else unpack(path, "rb")


def is_tar(path: Path) -> bool:
    """Whether a file is a tar, packed or not, by its first header."""
    try:
        with _opened(path) as file:
            tarfile.TarInfo.frombuf(file.read(_HEADER), "utf-8", "surrogateescape")
    except (OSError, EOFError, zlib.error, lzma.LZMAError, tarfile.TarError):
        return False
    return True


@contextmanager
def open_tar(path: Path) -> Iterator[tarfile.TarFile]:
    """The open tar. Raises `InputError` for a part of it, read then or later, that is larger than it may be."""
    with _opened(path) as file, tarfile.open(fileobj=_Bounded(file, path), mode="r:") as archive:
        yield archive
