"""What the machine code of a file depends on: the file itself, and all that it imports of what is written here.

A kernel has the numbers of other modules frozen into it and their functions laid out in it. The compiler's own record
knows one file and its time only; machine code is therefore kept under a hash of everything that it may hold.
"""

from __future__ import annotations

import functools
import hashlib
import re
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
OWN = ("ground", "rollover")  # packages whose code kernels may hold; all else is a library
DIGITS = 16  # 64 bits: no two of some thousand folders have the same
# a whole block under TYPE_CHECKING is there for the eye only
_TYPES = re.compile(rb"^if (?:typing\.)?TYPE_CHECKING:[^\n]*\n(?:[ \t]+[^\n]*\n|[ \t]*\n)*", re.MULTILINE)
_IMPORT = re.compile(
    rb"^[ \t]*(?:from[ \t]+(\.*[\w.]*)(?:[ \t]|\\\n)+import[ \t]*(\([^)]*\)|(?:[^\n\\]|\\\n)*)"
    rb"|import[ \t]+((?:[^\n\\]|\\\n)*))",
    re.MULTILINE,
)
_COMMENT = re.compile(r"#[^\n]*")


def hash_of(files: Iterable[Path], about: str = "") -> str:
    """Hash over `about` and files with all that they import, at any depth, but libraries: hexadecimal digits."""
    found = {Path(__file__)}  # which says where machine code is kept, and is no part of it
    ahead = list(files)
    while ahead:
        file = ahead.pop()
        if file not in found:
            found.add(file)
            ahead += _read(file)[1]
    whole = hashlib.sha256(about.encode())
    for digest, name in sorted((_read(file)[0], file.name) for file in found if file != Path(__file__)):
        whole.update(name.encode() + digest)
    return whole.hexdigest()[:DIGITS]


@functools.cache
def _read(file: Path) -> tuple[bytes, tuple[Path, ...]]:
    """Digest of a file and what it imports; a notebook's cell is no file, and the compiler itself looks at it."""
    text = file.read_bytes() if file.is_file() else b""
    return hashlib.sha256(text).digest(), tuple(dict.fromkeys(_imported(file, text)))


def _imported(file: Path, text: bytes) -> Iterator[Path]:
    for module, names, plain in _IMPORT.findall(_TYPES.sub(b"", text)):
        if plain:
            for name in _names(plain):
                yield from _files(name)
            continue
        base = module.decode()
        up = len(base) - len(base.lstrip("."))
        for name in _names(names):
            below = base[up:]
            if up:  # an import that begins with dots
                place = file.parents[up - 1].joinpath(*filter(None, below.split(".")))
                yield from _module(place / name) or _module(place)
            else:
                yield from _files(f"{base}.{name}") or _files(base)


def _names(given: bytes) -> list[str]:
    """Names of an import: without brackets, comments and what they are called here."""
    words = _COMMENT.sub("", given.decode(errors="replace")).replace("\\\n", " ").strip("() \t\r\n")
    return [part.split()[0] for part in words.split(",") if part.split()]


@functools.cache
def _module(place: Path) -> list[Path]:
    """File of a module, or of a package, at a place without suffix; none if there is none."""
    return [file for file in (place.with_name(f"{place.name}.py"), place / "__init__.py") if file.is_file()][:1]


def _files(name: str) -> list[Path]:
    """File of a module by its whole name; none of a library, and of what is no module."""
    first = name.partition(".")[0]
    if first in OWN:
        return _module(ROOT.joinpath(*name.split(".")))
    if first in sys.stdlib_module_names:
        return []
    file = getattr(sys.modules.get(name), "__file__", None)
    is_own = file is not None and file.endswith(".py") and "site-packages" not in Path(file).parts
    return [Path(file)] if file is not None and is_own else []
