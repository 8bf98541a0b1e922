"""A recording for the viewer in its file: whole, or an error that says what the disk said."""

from __future__ import annotations

import contextlib
import errno
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb
from rerun.error_utils import catch_and_log_exceptions

ENDING = b"RRF2FOOT"  # in the last bytes of a recording that was closed
TAIL = 12  # bytes from there to the end
PROBE = 1 << 20  # bytes; more than a recorder holds back before it writes


@contextlib.contextmanager
def saving(rec: rr.RecordingStream, path: Path, layout: rrb.Blueprint) -> Iterator[None]:
    """What is logged meanwhile goes into the file `path`, which is there whole or not at all.

    The recorder writes in a thread of its own, which ends without a word, or with one that gives no reason, where the
    disk refuses it. Raises ``OSError`` with the reason.
    """
    handle, name = tempfile.mkstemp(prefix=".recording.", suffix=".part", dir=path.parent)
    os.close(handle)
    part = Path(name)
    try:
        try:
            with catch_and_log_exceptions("recording", strict=True), _closed(rec):
                rec.save(part, default_blueprint=layout)
                yield
        except RuntimeError as e:
            if _is_whole(part):
                raise
            raise _reason(part, path) from e
        if not _is_whole(part):
            raise _reason(part, path)
        part.chmod(0o644)
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


@contextlib.contextmanager
def _closed(rec: rr.RecordingStream) -> Iterator[None]:
    """Flush and write the footer whatever happens; what is logged later would be lost without a word."""
    try:
        yield
    finally:
        try:
            rec.flush()
        finally:
            rec.disconnect()


def _is_whole(part: Path) -> bool:
    try:
        with part.open("rb") as file:
            file.seek(-TAIL, os.SEEK_END)
            return file.read().startswith(ENDING)
    except OSError:
        return False


def _reason(part: Path, path: Path) -> OSError:
    """Why the file ends early: what writing more to it meets."""
    try:
        with part.open("r+b") as file:
            file.seek(0, os.SEEK_END)
            file.write(bytes(PROBE))
    except OSError as e:
        return OSError(e.errno, e.strerror, str(path))
    return OSError(errno.EIO, "the recording could not be written to its end", str(path))
