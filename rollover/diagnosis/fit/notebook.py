"""What was simulated, remembered: the same values are never simulated twice, unless there is no room for them all."""

from __future__ import annotations

from collections.abc import Hashable

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.settings import SETTINGS

Array = NDArray[np.float64]
TUNING = SETTINGS.fit.notebook


class Memory:
    """Arrays by key, of at most so many bytes: beyond that the older half of them is let go of, never the newest."""

    def __init__(self, most: int = TUNING.most_bytes) -> None:
        self._most, self._bytes = most, 0
        self._arrays: dict[Hashable, Array | None] = {}

    def __len__(self) -> int:
        return len(self._arrays)

    def __contains__(self, key: Hashable) -> bool:
        return key in self._arrays

    def __getitem__(self, key: Hashable) -> Array | None:
        return self._arrays[key]

    def __setitem__(self, key: Hashable, array: Array | None) -> None:
        self._arrays[key] = array
        self._bytes += _size(array)
        if self._bytes > self._most:
            for old in list(self._arrays)[: len(self._arrays) // 2]:
                self._bytes -= _size(self._arrays.pop(old))


def _size(array: Array | None) -> int:
    return 0 if array is None else array.nbytes
