"""The one way into a recording stream: strict, either static or in columns, with one time line.

Habits of the viewer's SDK that shape it: floats of seconds are truncated to nanoseconds, hence `stamps`; mistakes
only warn unless it is told to be strict; and columns overtake what was logged before them, hence `settle`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from viz.content.entities import TIMELINE


class Stream:
    """A recording stream with one way to write what stands still and one for what changes."""

    def __init__(self, rec: rr.RecordingStream) -> None:
        self.rec = rec

    def static(self, path: str, what: Any) -> None:
        """Write what holds at all times."""
        self.rec.log(path, what, static=True, strict=True)

    def settle(self) -> None:
        """Let all that is static come first in the file: a mesh without its triangles is an error."""
        self.rec.flush()

    def columns(self, path: str, time: NDArray[np.float64], columns: Any) -> None:
        """Write one row for each time, s; columns without rows are legal and write nothing."""
        if len(time):
            self.rec.send_columns(path, [rr.TimeColumn(TIMELINE, duration=stamps(time))], columns, strict=True)


def stamps(time: NDArray[np.float64]) -> NDArray[np.timedelta64]:
    """Seconds as whole nanoseconds, rounded to the nearest; negative times are legal and shown as such."""
    return np.round(np.asarray(time) * 1e9).astype("timedelta64[ns]")


def colour(*values: int) -> NDArray[np.uint32]:
    """Colours 0xRRGGBBAA as the viewer understands them; a bare number or four in a list would be channels."""
    return np.array(values, dtype=np.uint32)
