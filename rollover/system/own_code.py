"""Python files of one's own beside the package: how they are found, loaded once, and hashed.

Each kind of file has an environment variable that names its files as PATH does; child processes inherit it. A module is
named after the kind and the path of its file, and is found again by that name wherever an object of it is unpickled.
"""

from __future__ import annotations

import functools
import hashlib
import importlib
import importlib.util
import os
import sys
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType
from typing import Any

from rollover.system.errors import Fault, InputError, cured, excerpt

KINDS = {"effects": "ROLLOVER_EFFECTS", "laws": "ROLLOVER_LAWS", "models": "ROLLOVER_MODELS"}


def add(kind: str, files: Sequence[Path]) -> None:
    """Name further files of a kind, for this process and those that it starts."""
    known = os.environ.get(KINDS[kind], "")
    os.environ[KINDS[kind]] = os.pathsep.join([*filter(None, [known]), *(str(path.resolve()) for path in files)])


def named(kind: str) -> list[Path]:
    """The files of a kind that the environment names, each once."""
    names = filter(None, os.environ.get(KINDS[kind], "").split(os.pathsep))
    return list(dict.fromkeys(Path(name).resolve() for name in names))


@contextmanager
def none_named() -> Iterator[None]:
    """Within it no file is named: what is imported before children are forked is the package's, as files may change."""
    before = {name: os.environ.pop(name) for name in KINDS.values() if name in os.environ}
    try:
        yield
    finally:
        os.environ.update(before)


def load(kind: str, examine: Callable[[ModuleType], str] = lambda module: "") -> None:
    """Load the files of a kind that are not loaded yet. Raises `InputError`.

    `examine` says what is wrong with a module that was loaded, and nothing if it is well.
    """
    for path in named(kind):
        _load(kind, path, examine)


def load_one(kind: str, path: Path, examine: Callable[[ModuleType], str] = lambda module: "") -> ModuleType:
    """Name and load one file of a kind; one that cannot be used is not named any more. Raises `InputError`."""
    before, path = os.environ.get(KINDS[kind]), path.resolve()
    if path not in named(kind):
        add(kind, [path])
    try:
        _load(kind, path, examine)
    except InputError:
        del os.environ[KINDS[kind]]
        if before is not None:
            os.environ[KINDS[kind]] = before
        raise
    return sys.modules[_module(kind, path)]


def _load(kind: str, path: Path, examine: Callable[[ModuleType], str]) -> None:
    name = _module(kind, path)
    if name in sys.modules:
        return
    if not path.is_file():
        raise InputError(Fault(file=str(path), message=f"no such file of {kind}; a Python file is needed"))
    if path.suffix != ".py":
        message = f"not a Python file of {kind}, got {path.name!r}; a name that ends in .py is needed"
        raise InputError(Fault(file=str(path), message=message))
    try:
        module = importlib.import_module(name)
    except Exception as e:
        sys.modules.pop(name, None)
        fault = Fault(file=str(path), line=_line(e, path), message=_worded(e))
        raise InputError(cured(fault, "a file that Python imports is needed")) from e
    if wrong := examine(module):
        del sys.modules[name]
        raise InputError(Fault(file=str(path), message=wrong))


def hashes(kind: str) -> dict[str, str]:
    """SHA-256 of each file of a kind, by the file's name: what it says decides a result as a version does."""
    return _hashes(tuple(str(path) for path in named(kind)))


def is_own(kind: str, thing: object) -> bool:
    """Whether an object is of a class that stands in a file of one's own."""
    return type(thing).__module__.startswith(_prefix(kind))


def file_of(kind: str, own_class: type) -> Path | None:
    """The file of one's own that a class stands in; None for a class of the package."""
    return next((path for path in named(kind) if _module(kind, path) == own_class.__module__), None)


@functools.cache  # a study asks for it with each of its cases
def _hashes(paths: tuple[str, ...]) -> dict[str, str]:
    found: dict[str, str] = {}
    for path in map(Path, paths):
        name = path.name if path.name not in found else str(path)
        found[name] = hashlib.sha256(path.read_bytes() if path.is_file() else b"").hexdigest()
    return found


def _prefix(kind: str) -> str:
    return f"rollover_{kind}_"


def _module(kind: str, path: Path) -> str:
    return f"{_prefix(kind)}{hashlib.sha256(str(path).encode()).hexdigest()[:12]}"


def _line(e: Exception, path: Path) -> int | None:
    """The line of the file at which an exception began."""
    if isinstance(e, SyntaxError):
        return e.lineno
    lines = [frame.lineno for frame in traceback.extract_tb(e.__traceback__) if frame.filename == str(path)]
    return lines[-1] if lines else None


def _worded(e: Exception) -> str:
    text = e.msg if isinstance(e, SyntaxError) else str(e)
    return f"cannot be used: {type(e).__name__}: {excerpt(' '.join(text.split()))}"


class _Finder:
    """Finds a module of one's own by its name."""

    @staticmethod
    def find_spec(name: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        """The module of that name, if a file that the environment names has it."""
        for kind in KINDS:
            if name.startswith(_prefix(kind)):
                own = next((file for file in named(kind) if _module(kind, file) == name), None)
                return None if own is None else importlib.util.spec_from_file_location(name, own)
        return None


sys.meta_path.append(_Finder)
