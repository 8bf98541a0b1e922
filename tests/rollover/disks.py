"""A disk that is full from some write on, for commands run in this process."""

from __future__ import annotations

import errno
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

WRITES = ("open", "mkdir", "mkdtemp", "mkstemp", "write_table", "ftruncate")


class Disk:
    """Counts what takes room below `folder` and refuses it from the `full_from`-th time on, with `reason`."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.folder, self.count, self.full_from, self.reason = folder.resolve(), 0, 10**9, errno.ENOSPC
        self.places: list[str] = []
        opened, mkdir = Path.open, Path.mkdir

        def open_(path: Path, mode: str = "r", *args: Any, **more: Any) -> Any:
            if set(mode) & set("wax+"):
                self.take("open", path)
            return opened(path, mode, *args, **more)

        def mkdir_(path: Path, *args: Any, **more: Any) -> None:
            if not path.exists():
                self.take("mkdir", path)
            mkdir(path, *args, **more)

        monkeypatch.setattr(Path, "open", open_)
        monkeypatch.setattr(Path, "mkdir", mkdir_)
        for name in ("mkdtemp", "mkstemp"):
            monkeypatch.setattr(tempfile, name, self.watched(name, getattr(tempfile, name), _folder))
        monkeypatch.setattr(pq, "write_table", self.watched("write_table", pq.write_table, lambda a, m: a[1]))
        monkeypatch.setattr(os, "ftruncate", self.watched("lock", os.ftruncate, _file))

    def watched(self, name: str, real: Callable[..., Any], where: Callable[..., Any]) -> Callable[..., Any]:
        def call(*args: Any, **more: Any) -> Any:
            self.take(name, where(args, more) if name == "lock" or more.get("dir") or len(args) > 1 else None)
            return real(*args, **more)

        return call

    def take(self, what: str, place: Any) -> None:
        if place is None or not Path(place).resolve().is_relative_to(self.folder):
            return
        self.count += 1
        if self.count >= self.full_from:
            self.places.append(what)
            raise OSError(self.reason, os.strerror(self.reason), str(place))

    def full(self, from_: int) -> None:
        self.count, self.full_from = 0, from_


def _folder(given: tuple[Any, ...], named: dict[str, Any]) -> Any:
    """The folder that something temporary is made in, if one is given: ``mkdtemp(suffix, prefix, dir)``."""
    return named.get("dir") or (given[2] if len(given) > 2 else None)


def _file(given: tuple[Any, ...], named: dict[str, Any]) -> Any:
    """The file of a descriptor, where the system says so."""
    link = Path(f"/proc/self/fd/{given[0]}")
    return os.readlink(link) if link.exists() else None
