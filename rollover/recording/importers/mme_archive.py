"""Files of an ISO-MME test, in a folder, a zip or a tar alike; nothing is unpacked, and no bomb goes off."""

from __future__ import annotations

import lzma
import tarfile
import zipfile
import zlib
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import NoReturn

from rollover.recording.importers.tar import is_tar, open_tar
from rollover.system import budget
from rollover.system.boundary import worded
from rollover.system.errors import Fault, InputError

Sizes = list[tuple[str, int, int]]  # name, bytes unpacked, bytes packed
_FAULTS = (OSError, zipfile.BadZipFile, tarfile.TarError, EOFError, zlib.error, lzma.LZMAError, RuntimeError)


def names_in(place: Path) -> list[str]:
    """Names of the files inside, with forward slashes. Raises `InputError`."""
    if place.is_dir():
        here = [p for p in place.iterdir() if p.is_file()]
        here += [p for sub in place.iterdir() if sub.is_dir() and sub.name.lower() == "channel" for p in sub.iterdir()]
        return [p.relative_to(place).as_posix() for p in here if not _of_a_file_manager(p.name)]
    names = [_spelt(name) for name, _, _ in _sizes(place)]
    return [name for name in names if not _of_a_file_manager(name)]


def content(place: Path, name: str) -> bytes:
    """Bytes of a file inside, never more than allowed. Raises `InputError`."""
    most = int(budget.factor() * budget.IN_ARCHIVE)
    try:
        if place.is_dir():
            if (size := (place / name).stat().st_size) > most:
                _refuse(place, f"{name}: {size} bytes; at most {most} are allowed; {budget.cure(size / most)}")
            return (place / name).read_bytes()
        if sum(size for _, size, _ in _sizes(place)) <= budget.KEPT:
            return _all(*_as_it_is(place))[name]
        return next(data for found, data in _contents(place, name) if found == name)
    except (KeyError, StopIteration):
        _refuse(place, f"{name}: not in it; a whole archive is needed")
    except _FAULTS as e:
        _refuse(place, f"{name}: cannot be read: {worded(e)}")


def _as_it_is(place: Path) -> tuple[Path, int, int]:
    about = place.stat()
    return place, about.st_size, about.st_mtime_ns


def _sizes(place: Path) -> Sizes:
    return _checked(*_as_it_is(place), budget.factor())


@lru_cache(maxsize=1)  # asked for again with each of its files
def _checked(place: Path, packed: int, _changed: int, times: float) -> Sizes:
    """Sizes of the files inside, none of them unpacked. Raises `InputError` for what is too much in all."""
    try:
        if zipfile.is_zipfile(place):
            with zipfile.ZipFile(place) as archive:
                sizes = [(i.filename, i.file_size, i.compress_size) for i in archive.infolist() if not i.is_dir()]
        elif is_tar(place):
            sizes = _tar_sizes(place)
        else:
            _refuse(place, "neither a folder nor a readable zip or tar file")
    except _FAULTS as e:
        _refuse(place, f"cannot be read: {worded(e)}")

    def refuse(message: str) -> InputError:
        return InputError(Fault(file=str(place), message=message))

    budget.check_count(len(sizes), budget.FILES, refuse, "files inside")
    total = 0
    for name, size, part in sizes:
        total += size
        most = int(times * min(budget.IN_ARCHIVE, max(budget.SMALL, budget.RATIO * part)))
        in_all = int(times * max(budget.SMALL, budget.RATIO * packed))
        if size > most:
            allowed = f"at most {most} are allowed; {budget.cure(size / most)}"
            _refuse(place, f"{name[:80]}: unpacks to {size} bytes from {part}; {allowed}")
        if total > in_all:
            allowed = f"at most {in_all} are allowed; {budget.cure(total / in_all)}"
            _refuse(place, f"unpacks to {total} bytes or more from {packed}; {allowed}")
    return sizes


@lru_cache(maxsize=1)  # each file of a tar would unpack what stands before it again
def _all(place: Path, _size: int, _changed: int) -> dict[str, bytes]:
    return dict(_contents(place))


def _contents(place: Path, only: str = "") -> Iterator[tuple[str, bytes]]:
    """Name and bytes of one file after the other, or of the first of one name."""
    if zipfile.is_zipfile(place):
        with zipfile.ZipFile(place) as archive:
            for info in archive.infolist():
                if not info.is_dir() and only in ("", _spelt(info.filename)):
                    yield _spelt(info.filename), archive.read(info)
        return
    with open_tar(place) as tar:
        for member in tar:
            if member.isfile() and only in ("", _spelt(member.name)) and (file := tar.extractfile(member)) is not None:
                yield _spelt(member.name), file.read()


def _spelt(name: str) -> str:
    return name.replace("\\", "/")


def _of_a_file_manager(name: str) -> bool:
    """What macOS puts beside each file of an archive, under the same ending."""
    return name.startswith("__MACOSX/") or "/__MACOSX/" in name or name.rpartition("/")[2].startswith("._")


def _tar_sizes(place: Path) -> Sizes:
    """Sizes of the files in a tar; stops at the first that is too large, before it is unpacked."""
    found: Sizes = []
    whole = place.stat().st_size
    times, total = budget.factor(), 0
    with open_tar(place) as archive:
        for member in archive:
            if member.isfile():
                found.append((member.name, member.size, whole))
                total += member.size
            if member.size > times * budget.IN_ARCHIVE or len(found) > times * budget.FILES:
                break
            if total > times * max(budget.SMALL, budget.RATIO * whole):
                break
    return found


def _refuse(place: Path, message: str) -> NoReturn:
    raise InputError(Fault(file=str(place), message=message)) from None
