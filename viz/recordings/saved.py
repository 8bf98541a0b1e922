"""A recording for the viewer in its file: whole, or an error that says what the disk said."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb
from rerun.error_utils import catch_and_log_exceptions

from rollover.system.writing import put


@contextlib.contextmanager
def saving(rec: rr.RecordingStream, path: Path, layout: rrb.Blueprint) -> Iterator[None]:
    """What is logged meanwhile goes into the file `path`, which is there whole or not at all.

    It is held in memory until it is whole: a recorder's own file is written by a thread, which ends where the disk
    refuses it, and the recorder (rerun-sdk 0.41) may then wait for its answer for ever. Raises ``OSError``.
    """
    try:
        with catch_and_log_exceptions("recording", strict=True):
            held = rec.memory_recording()
            rec.send_blueprint(layout, make_active=False, make_default=True)
            yield
            made = held.drain_as_bytes()
    finally:
        rec.disconnect()
    put(path, lambda part: part.write_bytes(made))
