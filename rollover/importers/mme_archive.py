"""Files of an ISO-MME test, in a folder, a zip or a tar alike; nothing is unpacked, and no bomb goes off."""

from __future__ import annotations

import tarfile
import zipfile
import zlib
from pathlib import Path
from typing import NoReturn

from rollover.boundary import worded
from rollover.faults import Fault, InputError

MOST_BYTES = 1 << 28  # of one file inside: ten million samples
MOST_FILES = 10_000
MOST_RATIO = 200  # numbers as text shrink to a fifth or so
SMALL = 1 << 20


def names_in(place: Path) -> list[str]:
    """Names of the files inside, with forward slashes. Raises `InputError`."""
    if place.is_dir():
        here = [p for p in place.iterdir() if p.is_file()]
        here += [p for sub in place.iterdir() if sub.is_dir() and sub.name.lower() == "channel" for p in sub.iterdir()]
        return [p.relative_to(place).as_posix() for p in here if not _of_a_file_manager(p.name)]
    try:
        if zipfile.is_zipfile(place):
            with zipfile.ZipFile(place) as archive:
                sizes = [(i.filename, i.file_size, i.compress_size) for i in archive.infolist() if not i.is_dir()]
        elif tarfile.is_tarfile(place):
            sizes = _tar_sizes(place)
        else:
            _refuse(place, "neither a folder nor a readable zip or tar file")
    except (OSError, zipfile.BadZipFile, tarfile.TarError, EOFError, zlib.error, NotImplementedError) as e:
        _refuse(place, f"cannot be read: {worded(e)}")
    if len(sizes) > MOST_FILES:
        _refuse(place, f"too many files inside, got {len(sizes)}; at most {MOST_FILES}")
    total = sum(size for _, size, _ in sizes)
    for name, size, packed in sizes:
        if size > MOST_BYTES or (size > SMALL and size > MOST_RATIO * max(1, packed)):
            _refuse(place, f"{name[:80]}: unpacks to {size} bytes from {packed}; at most {MOST_BYTES} are allowed")
    if total > SMALL and total > MOST_RATIO * place.stat().st_size:
        _refuse(place, f"unpacks to {total} bytes from {place.stat().st_size}; that is no test")
    names = [name.replace("\\", "/") for name, _, _ in sizes]
    return [name for name in names if not _of_a_file_manager(name)]


def content(place: Path, name: str) -> bytes:
    """Bytes of a file inside, never more than allowed. Raises `InputError`."""
    try:
        if place.is_dir():
            path = place / name
            if path.stat().st_size > MOST_BYTES:
                _refuse(place, f"{name}: {path.stat().st_size} bytes; at most {MOST_BYTES} are allowed")
            return path.read_bytes()
        if zipfile.is_zipfile(place):
            with zipfile.ZipFile(place) as archive, archive.open(_inside(archive.namelist(), name)) as packed:
                data = packed.read(MOST_BYTES + 1)
        else:
            with tarfile.open(place) as tar:
                member = tar.extractfile(_inside(tar.getnames(), name))
                data = member.read(MOST_BYTES + 1) if member else b""
    except (
        OSError,
        zipfile.BadZipFile,
        tarfile.TarError,
        EOFError,
        zlib.error,
        RuntimeError,
        NotImplementedError,
    ) as e:
        _refuse(place, f"{name}: cannot be read: {worded(e)}")
    if len(data) > MOST_BYTES:
        _refuse(place, f"{name}: unpacks to more than {MOST_BYTES} bytes")
    return data


def _of_a_file_manager(name: str) -> bool:
    """What macOS puts beside each file of an archive, under the same ending."""
    return name.startswith("__MACOSX/") or "/__MACOSX/" in name or name.rpartition("/")[2].startswith("._")


def _inside(names: list[str], name: str) -> str:
    return next(n for n in names if n.replace("\\", "/") == name)


def _tar_sizes(place: Path) -> list[tuple[str, int, int]]:
    """Sizes of the files in a tar; stops at the first that is too large, before it is unpacked."""
    found: list[tuple[str, int, int]] = []
    whole = place.stat().st_size
    with tarfile.open(place) as archive:
        for member in archive:
            if member.isfile():
                found.append((member.name, member.size, whole))
            if member.size > MOST_BYTES or len(found) > MOST_FILES:
                break
            if sum(size for _, size, _ in found) > max(SMALL, MOST_RATIO * whole):
                break
    return found


def _refuse(place: Path, message: str) -> NoReturn:
    raise InputError(Fault(file=str(place), message=message)) from None
