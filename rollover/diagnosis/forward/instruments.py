"""Compiled: what the instruments of a drop show at the stamps, all channels in one go, those with a class filtered."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ground.compiled import compiled
from rollover.diagnosis.forward.filtering import Rows
from rollover.dynamics.drop_test import COLUMNS
from rollover.recording import Recording
from rollover.recording.filters import LowPass, low_pass, run_through

Array = NDArray[np.float64]
NO_FILTER = LowPass(coefficients=np.zeros(8), pad=-1)


class Instruments:
    """The channels of a drop that a recording has, `names`: in which column each stands, its sign, its filter class.

    Raises ``ValueError`` for a filter class that the rows are too slow for.
    """

    def __init__(self, recording: Recording, rows: Rows) -> None:
        self.names = tuple(name for name in recording.channels if name in COLUMNS)
        self._rows = rows
        self._columns = np.array([COLUMNS[name][0] for name in self.names], dtype=np.int64)
        self._signs = np.array([COLUMNS[name][1] for name in self.names])
        classes = [recording.cfc.get(name) for name in self.names]
        # between even rows that are not the stamps is read behind the filter, not by it
        self._between = [(k, cfc) for k, cfc in enumerate(classes) if cfc is not None and not rows.are_stamps]
        passes = [
            NO_FILTER if cfc is None or not rows.are_stamps or rows.even.size < 2 else low_pass(cfc, rows.step)
            for cfc in classes
        ]
        self._filters = np.array([one.coefficients for one in passes]).reshape(-1, NO_FILTER.coefficients.size)
        self._pads = np.array([min(one.pad, rows.even.size - 1) for one in passes], dtype=np.int64)

    def shown(self, drop: Array) -> dict[str, Array]:
        """Channels (n,) at the stamps by name, from `Track.rows` (m, OUT_COLUMNS) at the times of the rows."""
        every = at_stamps(drop, self._columns, self._signs, self._rows.stamps, self._filters, self._pads)
        found = dict(zip(self.names, every, strict=True))
        for k, cfc in self._between:
            found[self.names[k]] = self._rows.behind(self._signs[k] * drop[:, self._columns[k]], cfc)
        return found


@compiled
def at_stamps(drop: Any, columns: Any, signs: Any, stamps: Any, filters: Any, pads: Any) -> Any:
    """Columns of a drop (m, k) as channels (c, n) at the stamps, times their signs; filtered where `pads` are not < 0.

    `filters` (c, 8) are b, a and the steady state of each.
    """
    n = stamps.size
    found = np.empty((columns.size, n))
    raw = np.empty(n)
    for c in range(columns.size):
        for i in range(n):
            raw[i] = signs[c] * drop[stamps[i], columns[c]]
        pad = pads[c]
        if pad >= 0:
            smooth = np.empty(n + 2 * pad)
            run_through(filters[c, 0:3], filters[c, 3:6], filters[c, 6:8], raw, pad, smooth)
            for i in range(n):
                found[c, i] = smooth[pad + i]
        else:
            for i in range(n):
                found[c, i] = raw[i]
    return found
