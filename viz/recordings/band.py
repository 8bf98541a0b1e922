"""Curves in the viewer with a band of 1 sigma to each side: of the noise of a measured one, of an ensemble."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from viz.content.entities import MEASURED
from viz.recordings.stream import Stream, colour

Array = NDArray[np.float64]
POLICY = rr.components.AggregationPolicy.MinMax  # any other draws a short peak lower than it was


def broken(time: Array, *columns: Array) -> tuple[Array, ...]:
    """Stamps, s, and columns (n,) with a gap where the recording has one: a line is not drawn over it."""
    step = np.diff(time)
    breaks = np.flatnonzero(step > 2.5 * float(np.median(step))) + 1 if step.size else np.array([], dtype=int)
    at = np.insert(time, breaks, time[breaks] - 1e-6)
    return (at, *(np.insert(column, breaks, np.nan) for column in columns))


def look(out: Stream, path: str, *, name: str, width: float, unit: str, is_band: bool, shade: int = MEASURED) -> None:
    """How a curve is drawn whose band is known, or is not."""
    drawn = {"names": [name], "colors": colour(shade), "widths": [width], "aggregation_policy": POLICY}
    line = rr.Measurements.from_fields(**drawn, units=[unit]) if is_band else rr.SeriesLines(**drawn)
    out.static(path, line)


def rows(out: Stream, path: str, time: Array, values: Array, sigma: Array | None) -> None:
    """Values (n,) at stamps, s, and 1 sigma (n,) of each in their unit; None: of no band."""
    if sigma is None:
        at, shown = broken(time, values)
        out.columns(path, at, rr.Scalars.columns(scalars=shown))
        return
    at, shown, wide = broken(time, values, sigma)
    out.columns(path, at, rr.Measurements.columns(values=shown, variances=np.nan_to_num(wide) ** 2))
