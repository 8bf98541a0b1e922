"""What a MATLAB 5 file claims, summed up from its headers: scipy unpacks all of it at once, what is nested too."""

from __future__ import annotations

import math
import struct
import zlib
from pathlib import Path
from typing import BinaryIO, Protocol

from rollover.system.budget import Budget

_HEADER = 128  # bytes, the last two of which tell the order of bytes
_MATRIX, _COMPRESSED = 14, 15  # types of elements
_CELL, _STRUCT, _OBJECT, _CHAR, _DOUBLE, _LAST_NUMBER = 1, 2, 3, 4, 6, 15  # classes of arrays
_ARRAY = 200  # bytes of an array as an object, whatever it holds
_TEXT = 4  # bytes of a character
_BLOCK = 1 << 16


class _Source(Protocol):
    def read(self, count: int) -> bytes: ...


class _Packed:
    """Contents of a compressed element, unpacked as far as they are asked for."""

    def __init__(self, file: BinaryIO, size: int) -> None:
        self._file, self._left, self._inflate = file, size, zlib.decompressobj()

    def read(self, count: int) -> bytes:
        """Bytes that follow, fewer at the end."""
        found = bytearray()
        while len(found) < count and not self._inflate.eof:
            block = self._inflate.unconsumed_tail
            if not block:
                block = self._file.read(min(_BLOCK, self._left))
                self._left -= len(block)
                if not block:
                    break
            found += self._inflate.decompress(block, count - len(found))
        return bytes(found)


def check_claims(path: Path) -> None:
    """Refuse a file whose arrays are larger in all than they may be. Raises `InputError`.

    A file that is cut off or damaged is left to its reader, which says what is wrong.
    """
    claimed = Budget(path)
    with path.open("rb") as file:
        order = ">" if file.read(_HEADER)[-2:] == b"MI" else "<"
        while len(tag := file.read(8)) == 8:
            kind, size = struct.unpack(f"{order}II", tag)
            following = file.tell() + size
            source: _Source = _Packed(file, size) if kind == _COMPRESSED else file
            try:
                if kind == _COMPRESSED:
                    kind, size = struct.unpack(f"{order}II", source.read(8))
                if kind == _MATRIX:
                    _Walk(source, order, claimed).matrix(size, "", is_last=True)
            except (struct.error, zlib.error, EOFError, RecursionError):
                return
            file.seek(following)


class _Walk:
    """One array of a file, and those in it."""

    def __init__(self, source: _Source, order: str, claimed: Budget) -> None:
        self._source, self._order, self._claimed = source, order, claimed

    def matrix(self, size: int, above: str, *, is_last: bool = False) -> None:
        """Add what an array of `size` bytes claims, named `above` where it has no name of its own.

        What follows it is not looked for if it `is_last`: its numbers need not be unpacked then.
        """
        if size == 0:
            self._claimed.claim(_ARRAY, above)
            return
        self._bytes(8)
        flags, _ = struct.unpack(f"{self._order}II", self._bytes(8))
        dims, took = self._element()
        shape = struct.unpack(f"{self._order}{len(dims) // 4}i", dims)
        name, more = self._element()
        at = name.decode("latin-1") or above
        left = size - 16 - took - more
        count, kind = math.prod(shape), flags & 0xFF
        self._claimed.claim(_ARRAY, at)
        if kind in (_CELL, _STRUCT, _OBJECT):
            self._inside(kind, count, left, at)
            return
        width = _TEXT if kind == _CHAR else 8 if _DOUBLE <= kind <= _LAST_NUMBER else 0
        self._claimed.claim(left + width * count, at)  # as stored, and as text or numbers of a column
        if not is_last:
            self._pass(left)

    def _inside(self, kind: int, count: int, left: int, at: str) -> None:
        fields: list[str] = []
        if kind == _OBJECT:
            left -= self._element()[1]
        if kind != _CELL:
            (width,), took = struct.unpack(f"{self._order}i", (found := self._element())[0]), found[1]
            names, more = self._element()
            left -= took + more
            width = max(1, width)
            fields = [names[k : k + width].split(b"\0")[0].decode("latin-1") for k in range(0, len(names), width)]
        self._claimed.claim(8 * count * max(1, len(fields)), at)
        k = 0
        while left > 0:
            _, size = struct.unpack(f"{self._order}II", self._bytes(8))
            self.matrix(size, f"{at}.{fields[k % len(fields)]}" if fields else at)
            left -= 8 + size
            k += 1

    def _element(self) -> tuple[bytes, int]:
        """Contents of a short element, and the bytes that it takes."""
        tag = self._bytes(8)
        kind, size = struct.unpack(f"{self._order}II", tag)
        if kind >> 16:  # so short that it stands in its tag
            return tag[4 : 4 + (kind >> 16)], 8
        padded = -(-size // 8) * 8
        if padded > _BLOCK:  # no names and no shape are as long
            raise EOFError
        return self._bytes(padded)[:size], 8 + padded

    def _pass(self, count: int) -> None:
        while count > 0:
            count -= len(self._bytes(min(count, _BLOCK)))

    def _bytes(self, count: int) -> bytes:
        found = self._source.read(count)
        if len(found) < count:
            raise EOFError
        return found
