"""How anything is written: whole or not at all, by one process at a time, and what a killed one left is put right.

A command holds what it is going to write (a folder, a file) from before its work to its end, by a lock that ends with
its process. What is not yet whole stands beside the target under a hidden name that the next start knows and sweeps:

    .NAME.xxxxxxxx.part     being written; thrown away
    .NAME.xxxxxxxx.old      what stood there, for the moment of the exchange; put back if its place is empty
    .NAME.xxxxxxxx.commit   files that are whole and on their way to their places; the way is finished
    .NAME.xxxxxxxx.replace  the same, for a folder of which all else is removed first
    .NAME.lock              the lock

A folder that cannot be exchanged, as a mounted one, holds all that itself. One that the command was started in is not
exchanged either, or its shell would stand in a folder that is gone: what is not yet whole stands in it, file by file it
goes to its place.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import os
import re
import secrets
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from rollover.system.errors import Fault, InputError
from rollover.system.names import inside

PART, OLD, COMMIT, REPLACE = ".part", ".old", ".commit", ".replace"
NOTES = "fits"  # what a diagnosis has fitted so far, for a next start to go on with
CAMPAIGN = "cases"  # what came of the cases of a blind proof so far, likewise
SCRATCH = "rollover-"  # how temporary folders begin
_MOST_BYTES = 200  # of a name that others are made of; with what is added it stays below the 255 of a file system
_MODES = 0o666, 0o777
_OF_THE_DISK = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EIO)


class Work:
    """What a command writes to: `targets` it holds, the last of them the one at hand."""

    def __init__(self) -> None:
        self.targets: dict[Path, contextlib.ExitStack] = {}


_work: Work | None = None


@contextlib.contextmanager
def working() -> Iterator[Work]:
    """A command's work: what is held meanwhile is let go at the end, however it ends."""
    global _work
    before, _work = _work, Work()
    try:
        yield _work
    finally:
        for stack in _work.targets.values():
            stack.close()
        _work = before


def hold(target: Path) -> None:
    """Keep a folder or file that is going to be written to this process until its command ends, and sweep it.

    Outside a command nothing is held. Raises `InputError` for what cannot be written, or another process holds.
    """
    target = _resolved(target)
    if _work is not None and target not in _work.targets:
        with contextlib.ExitStack() as stack:
            stack.enter_context(_unmade(target.parent))
            stack.enter_context(_alone(target))
            _work.targets[target] = stack.pop_all()


def check_free(*targets: Path, force: bool = False) -> None:
    """Refuse targets that exist, unless with `force`, and names that are none of a file. Raises `InputError`."""
    for target in targets:
        if target.exists() and not force:
            raise InputError(Fault(file=str(target), message="exists; --force replaces it, another name leaves it"))
    for target in targets:
        inside(target.parent, target.name)


@contextlib.contextmanager
def holding(target: Path) -> Iterator[None]:
    """Hold a target for the moment, where the command does not hold it anyway; a disk that refuses a write is named.

    Raises `InputError` as `hold` does.
    """
    target = _resolved(target)
    with contextlib.nullcontext() if _work and target in _work.targets else _alone(target):
        try:
            yield
        except OSError as e:
            if e.errno in _OF_THE_DISK and e.filename is None:  # a write to an open file names none
                e.filename = str(target)
            raise


@contextlib.contextmanager
def whole(folder: Path, prepare: Callable[[Path, Path], Callable[[], None] | None] | None = None) -> Iterator[Path]:
    """Fill a temporary folder that takes the place of `folder` at the very end, or leaves nothing behind.

    `prepare` (part, target) may give what brings it there instead; from then on that holds, and the next start of its
    command finishes what it leaves undone.
    """
    target = _resolved(folder)
    with holding(target):
        place = _place(target)
        place.mkdir(parents=True, exist_ok=True)  # it may have been removed since the start
        part = Path(tempfile.mkdtemp(prefix=_prefix(target), suffix=PART, dir=place))
        try:
            part.chmod(_MODES[1] & ~_umask())  # mkdtemp makes it private
            yield part
            act = prepare(part, target) if prepare is not None else None
            if act is None:
                exchange(part, target)
        except BaseException:
            shutil.rmtree(part, ignore_errors=True)
            raise
        if act is not None:
            act()


@contextlib.contextmanager
def together(target: Path) -> Iterator[Path]:
    """Fill a temporary folder whose files go beside `target`, the file that names them, all of them or none."""
    with holding(target):
        target.parent.mkdir(parents=True, exist_ok=True)
        part = Path(tempfile.mkdtemp(prefix=_prefix(target), suffix=PART, dir=target.parent))
        try:
            yield part
            done = part.with_suffix(COMMIT)
            os.rename(part, done)  # from here on the next start would finish it
        except BaseException:
            shutil.rmtree(part, ignore_errors=True)
            raise
        new = [target.parent / p.name for p in done.iterdir()]
        undone = not any(p.exists() for p in new)
        try:
            _spread(done, target.parent, target.name)
        except BaseException:
            for path in (*new, done) if undone else ():  # over what stood there, the next start finishes it
                _removed(path)
            raise


def put(path: Path, write: Callable[[Path], Any]) -> None:
    """Let `write` make a file beside its place, and move it there: a process that is killed leaves all or nothing."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = staged(path, write)
    try:
        os.replace(part, path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise


def staged(path: Path, write: Callable[[Path], Any]) -> Path:
    """What `write` makes, whole, beside the place where it is to stand."""
    handle, name = tempfile.mkstemp(prefix=_prefix(path), suffix=PART, dir=path.parent)
    os.close(handle)
    part = Path(name)
    try:
        write(part)
        part.chmod(_MODES[0] & ~_umask())
    except BaseException:
        part.unlink(missing_ok=True)
        raise
    return part


def exchange(part: Path, target: Path) -> None:
    """Let a folder take the place of another, which stays where that fails."""
    if part.parent == target:  # it cannot be moved away: its files are exchanged, which the next start would finish
        done = part.with_suffix(REPLACE)
        os.rename(part, done)
        _replace(done, target)
        return
    if not target.exists():
        os.rename(part, target)
        return
    old = target.with_name(f"{_prefix(target)}{secrets.token_hex(4)}{OLD}")  # it takes no room: the disk may be full
    os.rename(target, old)
    try:
        os.rename(part, target)
    except BaseException:
        if not target.exists():
            os.rename(old, target)
        raise
    shutil.rmtree(old, ignore_errors=True)


def own(target: Path, name: str) -> bool:
    """Whether a file is one of those that stand beside `target`, or in it, while it is written."""
    known = [f"{_prefix(target)}{what}" for what in ("lock", NOTES, CAMPAIGN)]
    return name in known or _left(target).fullmatch(name) is not None


def notes(target: Path, what: str = NOTES) -> Path:
    """Where a command may keep what it has worked out so far, until its results stand there."""
    target = _resolved(target)
    return _anchor(target) / f"{_prefix(target)}{what}"


@contextlib.contextmanager
def scratch() -> Iterator[Path]:
    """A temporary folder, away from all results; those that killed processes left go first."""
    for left in Path(tempfile.gettempdir()).glob(f"{SCRATCH}*"):
        with contextlib.suppress(OSError, InputError):
            mine = not hasattr(os, "getuid") or left.lstat().st_uid == os.getuid()
            if mine and not left.is_symlink() and (left / ".lock").is_file():
                with _locked(left / ".lock", left):
                    shutil.rmtree(left, ignore_errors=True)
    with tempfile.TemporaryDirectory(prefix=SCRATCH) as name, _locked(Path(name) / ".lock", Path(name)):
        yield Path(name)


def sweep(folder: Path) -> None:
    """Remove what was left half-written in a folder that this process holds."""
    for part in folder.glob(f".*{PART}") if folder.is_dir() else ():
        _removed(part)


def _replace(done: Path, folder: Path) -> None:
    """Remove what stands in a folder; only then do files move there, so that none of them is ever taken for old."""
    kept = {*(p.name for p in done.iterdir()), done.name}
    for other in folder.iterdir():
        if other.name not in kept and not own(folder, other.name):
            _removed(other)
    moving = done.with_suffix(COMMIT)
    os.rename(done, moving)
    _spread(moving, folder)


def _spread(done: Path, folder: Path, last: str = "") -> None:
    """Move files to their folder, `last` at the end."""
    names = sorted(p.name for p in done.iterdir())
    if last in names:  # what a recording's table means changes while there is no table
        (folder / last).unlink(missing_ok=True)
    for name in sorted(names, key=lambda name: name == last):
        if (folder / name).is_dir() and not (folder / name).is_symlink():
            shutil.rmtree(folder / name)
        os.replace(done / name, folder / name)
    done.rmdir()


def _settle(target: Path) -> None:
    """Put right what a killed process left of writing to a target, beside it or in it."""
    known = _left(target)
    for place in (target.parent, target):
        for entry in sorted(place.iterdir()) if place.is_dir() else ():
            found = known.fullmatch(entry.name)
            if found is None:
                continue
            if found[1] == OLD and not target.exists():
                os.rename(entry, target)
            elif found[1] == COMMIT and not entry.is_symlink() and entry.is_dir():
                _spread(entry, place, "" if place == target else target.name)
            elif found[1] == REPLACE and place == target and not entry.is_symlink() and entry.is_dir():
                _replace(entry, target)
            else:
                _removed(entry)


def _removed(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


@contextlib.contextmanager
def _alone(target: Path) -> Iterator[None]:
    with contextlib.ExitStack() as stack:
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            if target.is_dir() and not os.access(target, os.W_OK | os.X_OK):
                raise OSError(errno.EACCES, "it is read-only")
            _check_not_below(target)
            stack.enter_context(_locked(_anchor(target) / f"{_prefix(target)}lock", target))
            _settle(target)
        except OSError as e:
            what = f"cannot be written: {e.strerror or e}; a place with room that may be written is needed"
            raise InputError(Fault(file=str(target), message=what)) from None
        yield


@contextlib.contextmanager
def _unmade(folder: Path) -> Iterator[None]:
    """Take away again, at the end, what was made of a folder's path, where nothing came to stand there."""
    missing = [f for f in (folder, *folder.parents) if not f.exists()]
    try:
        yield
    finally:
        for made in missing:
            with contextlib.suppress(OSError):
                made.rmdir()


@contextlib.contextmanager
def _locked(path: Path, target: Path) -> Iterator[None]:
    """A lock that ends with its process; its file goes with it, and is taken over where it was left."""
    flags = os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0)
    handle, again = -1, True
    while again:  # whoever had it may have removed it just now
        handle = os.open(path, flags, 0o644)
        if not _taken(handle):
            owner = os.read(handle, 20).decode("ascii", "replace").strip()
            os.close(handle)
            what = f"is being written by another process{f' {owner}' if owner.isdecimal() else ''}"
            raise InputError(Fault(file=str(target), message=f"{what}; wait for it, or another --out"))
        again = not path.exists() or not os.path.samestat(os.fstat(handle), path.stat())
        if again:
            os.close(handle)
    try:
        os.ftruncate(handle, 0)
        os.write(handle, f"{os.getpid()}\n".encode())  # which a full disk refuses before any work is done
        yield
    finally:
        with contextlib.suppress(OSError):
            path.unlink()
        os.close(handle)


def _taken(handle: int) -> bool:
    """Whether this process has the lock of an open file; a file system without locks cannot keep anybody out."""
    try:
        if sys.platform == "win32":
            import msvcrt

            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as e:
        return e.errno not in (errno.EWOULDBLOCK, errno.EAGAIN, errno.EACCES)
    return True


def _anchor(target: Path) -> Path:
    """Where its lock stands, wherever a command was started: beside the target, in it where beside it is no way."""
    stays = target.is_dir() and (os.path.ismount(target) or not os.access(target.parent, os.W_OK))
    return target if stays else target.parent


def _place(target: Path) -> Path:
    """Where what is not yet whole stands: in the target too where this process was started in it."""
    return target if _started_in() == target else _anchor(target)


def _check_not_below(target: Path) -> None:
    """Refuse a folder above the one that this process was started in, which might be replaced with it."""
    here = _started_in()
    if here is not None and target in here.parents and target.is_dir():
        what = f"holds the folder that this was started in, got {here}; start from elsewhere, or another --out"
        raise InputError(Fault(file=str(target), message=what))


def _started_in() -> Path | None:
    """The folder that the shell stands in; None where it is gone."""
    try:
        return Path.cwd()
    except OSError:
        return None


def _resolved(target: Path) -> Path:
    try:
        return target.parent.resolve() / target.name if not target.is_dir() else target.resolve()
    except (OSError, RuntimeError) as e:  # a link that leads to itself
        raise InputError(Fault(file=str(target), message=f"leads nowhere: {e}; another --out is needed")) from None


def _prefix(target: Path) -> str:
    name = target.name
    if len(os.fsencode(name)) > _MOST_BYTES:
        name = hashlib.sha256(os.fsencode(name)).hexdigest()
    return f".{name}."


def _left(target: Path) -> re.Pattern[str]:
    return re.compile(rf"{re.escape(_prefix(target))}[a-z0-9_]{{8}}(\.(?:part|old|commit|replace))")


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
