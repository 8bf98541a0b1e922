"""What the machine refuses (a full disk, memory, a place that may not be written), in one line: place, cause, cure."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterable
from concurrent.futures import BrokenExecutor
from pathlib import Path

from rollover.system.errors import Fault

_STANDS = "nothing half-written is left"
_CURES = {
    errno.ENOSPC: "make room there, or take another --out",
    errno.EDQUOT: "make room in your quota, or take another --out",
    errno.EFBIG: "raise the limit on the size of files (ulimit -f)",
    errno.EROFS: "take another --out",
    errno.EACCES: "let it be written, or take another --out",
    errno.EPERM: "let it be written, or take another --out",
    errno.ENOENT: "it was there and has been removed meanwhile; start again",
    errno.ENOTDIR: "it was a folder and is none any more; start again",
    errno.ENAMETOOLONG: "take a shorter --out",
    errno.EMFILE: "raise the limit on open files (ulimit -n), or take fewer --workers",
    errno.ENFILE: "close other programs, or take fewer --workers",
    errno.EAGAIN: "raise the limit on processes (ulimit -u), or take fewer --workers",
    errno.ENOMEM: "free memory, or take fewer --workers",
    errno.EIO: "the disk does not answer; look at it, or take another --out",
    errno.ESTALE: "the network's disk has gone; mount it again, or take another --out",
    errno.EPIPE: "whoever was reading has ended",
}


_OF_INPUT = (errno.ENAMETOOLONG, errno.ELOOP, errno.ENOENT, errno.ENOTDIR, errno.EISDIR, errno.EACCES, errno.EPERM)
_NEEDED = "the path of a file that may be read is needed"


def refused(fault: BaseException, targets: Iterable[Path]) -> Fault | None:
    """What is wrong with a path that was to be read; None for a fault of the machine, or of what is being written."""
    if not isinstance(fault, OSError) or fault.errno not in _OF_INPUT or fault.filename is None or fault.filename2:
        return None
    path = Path(os.fsdecode(fault.filename))
    if any(path.absolute().is_relative_to(target.parent) for target in targets):
        return None
    return Fault(file=str(path), message=f"cannot be read: {os.strerror(fault.errno).lower()}; {_NEEDED}")


def message_of(fault: OSError | MemoryError | BrokenExecutor, target: Path | None) -> str:
    """One line about a fault of the machine; `target` is what was being written, if anything."""
    place = str(target) if target is not None else "rollover"
    if isinstance(fault, MemoryError):
        cause, cure = "memory ran out", _CURES[errno.ENOMEM]
    elif isinstance(fault, BrokenExecutor):
        cause, cure = "processes that work for it are ended from outside, as when memory runs out", _CURES[errno.ENOMEM]
    else:
        named = [str(name) for name in (fault.filename, fault.filename2) if isinstance(name, (str, bytes, Path))]
        # what stands for a short while only, under a hidden name, says nobody anything
        if named and (target is None or not any(part.startswith(".") for part in Path(named[-1]).parts)):
            place = named[-1]
        cause = os.strerror(fault.errno) if fault.errno else str(fault) or type(fault).__name__
        cure = _CURES.get(fault.errno or 0, "mend it, and start again")
    return str(Fault(file=place, message=f"{cause[:1].lower()}{cause[1:]}: {cure}; {_STANDS}"))
