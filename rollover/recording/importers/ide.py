"""IDE files of enDAQ and Slam Stick recorders: sub-channels by name, each sensor with its own clock."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rollover.recording import Recording
from rollover.recording.importers.apart import apart
from rollover.recording.importers.importer import Importer, check_claim, check_library, library, reading, starts_with
from rollover.recording.importers.sidecar import Described
from rollover.recording.importers.signals import Signal, assemble
from rollover.system.errors import Fault, InputError

EBML = b"\x1a\x45\xdf\xa3"  # what any EBML file begins with; Matroska too
KIND = b"mide"  # what says which EBML this is, in the first bytes
MICROSECOND = 1e-6
UNITS = {"Ill": "", "Index": "", "RH": "%"}  # of sensors that no channel is of


def sniff(path: Path) -> bool:
    """Whether a file is an IDE one, by its first bytes."""
    if not starts_with(path, EBML):
        return False
    with path.open("rb") as file:
        return KIND in file.read(64)


def read_ide(path: Path, wanted: Collection[str] | None = None) -> dict[str, Signal]:
    """Every sub-channel as a `Signal` by `CHANNEL/SUB-CHANNEL`, calibrated, its time in s since the file's zero.

    Of those that are not in `wanted` only the name. Raises `InputError`.
    """
    check_library("idelib", "ide", path)
    return apart(_signals, path, None if wanted is None else tuple(wanted), what="IDE", modules=("idelib",))


def _signals(path: Path, wanted: Collection[str] | None) -> dict[str, Signal]:
    idelib = library("idelib", "ide", path)
    with reading(path, "IDE"), idelib.importFile(str(path)) as data:
        _check_whole(path)
        signals: dict[str, Signal] = {}
        claimed = 0
        for channel, subs in _sessions(data):
            names = {f"{channel.name}/{sub.name or sub.displayName}": sub for sub in subs}
            if wanted is not None and not set(names) & set(wanted):
                signals |= {name: Signal(values=np.empty(0)) for name in names}
                continue
            events = channel.getSession()
            claimed += len(events) * len(names)
            check_claim(path, claimed, most_per_byte=2.0)
            table = np.asarray(events.arraySlice(), dtype=np.float64)
            time = table[0] * MICROSECOND
            for row, (name, sub) in enumerate(names.items(), start=1):
                unit = str((sub.units or ("", ""))[1])
                signals[name] = Signal(values=table[row].copy(), unit=UNITS.get(unit, unit), time=time)
    if not signals:
        raise InputError(Fault(file=str(path), message="holds no samples, got no channel that was recorded"))
    return signals


def _sessions(data: Any) -> Iterator[tuple[Any, list[Any]]]:
    """Channels with samples, and their sub-channels in the order of their columns."""
    channels: Mapping[int, Any] = data.channels
    for channel in channels.values():
        if data.sessions and len(channel.getSession()):
            yield channel, list(channel.subchannels)


def _check_whole(path: Path) -> None:
    """Refuse a file whose elements claim more bytes than there are: the library passes over what is cut off."""
    size = path.stat().st_size
    with path.open("rb") as file:
        at = 0
        while at < size:
            file.seek(at)
            head = file.read(12)
            id_width = _width(head[:1])
            length, width = _length(head[id_width:])
            if length == (1 << 7 * width) - 1:  # "not known": goes on to the end
                return
            at += id_width + width + length
    if at > size:
        raise ValueError(f"cut off, got {size} bytes and not the {at} that its last part claims")


def _width(first: bytes) -> int:
    """Bytes of an EBML number by its first byte: leading zero bits and one."""
    if not first or not first[0]:
        raise ValueError("damaged: no EBML element where one must begin")
    return 9 - first[0].bit_length()


def _length(head: bytes) -> tuple[int, int]:
    """Bytes that an element claims, and bytes that say so."""
    width = _width(head[:1])
    if len(head) < width:
        raise ValueError("cut off inside the head of an element")
    return int.from_bytes(head[:width], "big") & ((1 << 7 * width) - 1), width


def _read(path: Path, profile: Described | None) -> Recording:
    return assemble(path, read_ide(path, None if profile is None else profile.columns), profile)


IDE = Importer(name="ide", meaning="IDE of enDAQ and Slam Stick recorders, by a profile", sniff=sniff, read=_read)
