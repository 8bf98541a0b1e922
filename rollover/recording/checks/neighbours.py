"""What the samples beside one say of it: a cubic through as many on either side."""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def beside(reach: int) -> NDArray[np.int64]:
    """Places of `reach` neighbours on either side, (2 reach,)."""
    return np.array([k for k in range(-reach, reach + 1) if k != 0])


@functools.lru_cache(maxsize=8)
def _taps(reach: int) -> Array:
    """Weights (2 reach + 1,) of a sample and its neighbours for the value of the cubic at the sample, its own 0."""
    weights = np.linalg.pinv(np.vander(beside(reach) / reach, 4))[-1]
    return np.insert(weights, reach, 0.0)


def off_a_cubic(values: Array, reach: int) -> Array:
    """How far each evenly spaced sample (n,) is off the cubic through `reach` on either side; 0 at the ends."""
    off = values - np.convolve(values, _taps(reach)[::-1], mode="same")
    off[:reach] = off[-reach:] = 0.0
    return np.asarray(off)
