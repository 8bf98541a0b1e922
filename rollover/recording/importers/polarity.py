"""SAE J211 axes (x forward, y right, z down) and ISO 8855 axes (x forward, y left, z up): half a turn about x.

The only place where one becomes the other: a vector's y and z change sign, and so do those of a rotation.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

J211_TO_ISO8855 = np.diag([1.0, -1.0, -1.0])  # its own inverse; det = +1, so right-handed stays right-handed
_AXES = {"_x": 0, "_y": 1, "_z": 2, "/roll": 0, "/pitch": 1, "/yaw": 2}


def turned(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Components (..., 3) in the one set of axes from those in the other; twice gives them back."""
    return np.asarray(vectors @ J211_TO_ISO8855.T)


def sign(channel: str) -> float:
    """Factor on a channel between the two: -1 along or about y and z, 1 along or about x and for what has no axis.

    Quaternions too: half a turn about x of both frames turns the axis of the rotation.
    """
    axis = next((i for ending, i in _AXES.items() if channel.endswith(ending)), 0)
    return float(J211_TO_ISO8855[axis, axis])
