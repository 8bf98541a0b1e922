"""Channel filters of a test, applied to what simulates it: at even rows as close as a class asks for.

A rig samples fast, filters, and keeps a row in five; or loses some. What the filter saw were even rows all the same, so
that is what it is given here, and the stamps of the recording are read off behind it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.settings import SETTINGS
from rollover.recording import Recording
from rollover.recording.filters import filtered, least_rate

Array = NDArray[np.float64]
TUNING = SETTINGS.forward.filtering


@dataclass(frozen=True, kw_only=True)
class Rows:
    """Times (m,) at which a test is simulated, s: its `stamps` are among them, and `even` rows, `step` apart."""

    times: Array
    stamps: NDArray[np.int64]
    even: NDArray[np.int64]
    step: float

    @property
    def are_stamps(self) -> bool:
        """Whether all rows are even, and stamps."""
        return self.even.size == self.stamps.size == self.times.size

    def behind(self, values: Array, cfc: int) -> Array:
        """A channel (m,) or several (m, k) behind a filter class, at the stamps."""
        if values.ndim == 2:
            return np.stack([self.behind(column, cfc) for column in values.T], axis=1)
        smooth = filtered(values[self.even], self.step, cfc)
        if self.are_stamps:
            return smooth
        return np.interp(self.times[self.stamps], self.times[self.even], smooth)


def rows_of(recording: Recording) -> Rows:
    """The stamps themselves where they are even and close enough for the filters; others as well where they are not."""
    stamps = recording.time
    all_of_them, apart = np.arange(stamps.size), np.diff(stamps)
    step = float(np.median(apart)) if apart.size else 1.0
    if not recording.cfc:
        return Rows(times=stamps, stamps=all_of_them, even=all_of_them, step=step)
    least = max(least_rate(cfc) for cfc in recording.cfc.values())
    parts = max(1, math.ceil(least * step * (1.0 - 1e-9)))
    is_even = apart.size == 0 or bool(np.max(np.abs(apart - step)) <= TUNING.even_tolerance * step)
    if is_even and parts == 1:
        return Rows(times=stamps, stamps=all_of_them, even=all_of_them, step=step)
    fine = step / parts
    even = stamps[0] + fine * np.arange(math.ceil((stamps[-1] - stamps[0]) / fine - 1e-6) + 1)
    beside = stamps[np.clip(np.searchsorted(stamps, even - TUNING.same_stamp * fine), 0, stamps.size - 1)]
    even = np.where(np.abs(even - beside) <= TUNING.same_stamp * fine, beside, even)
    times, back = np.unique(np.concatenate([stamps, even]), return_inverse=True)
    return Rows(times=times, stamps=back[: stamps.size], even=back[stamps.size :], step=fine)


def filtered_like(channels: Mapping[str, Array], recording: Recording, rows: Rows) -> dict[str, Array]:
    """Simulated channels (m,) that the recording has, at its stamps, each through the filter class that it states."""
    found = {}
    for name in recording.channels:
        if name in channels:
            cfc = recording.cfc.get(name)
            found[name] = channels[name][rows.stamps] if cfc is None else rows.behind(channels[name], cfc)
    return found
