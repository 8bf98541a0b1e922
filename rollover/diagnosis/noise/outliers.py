"""Noise of a channel whose misfit comes in bursts: a loose contact leaves no window quiet, and is no noise for that."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.settings import SETTINGS
from rollover.recording.noise_floor import LENGTH, USUAL

Array = NDArray[np.float64]
TUNING = SETTINGS.noise.outliers


def without_outliers(values: Array) -> Array:
    """Evenly spaced values (n,), those far from their neighbours replaced by the middle one of these.

    As they are where so many lie far off that these are the rule.
    """
    from scipy.ndimage import median_filter

    if values.size < LENGTH:
        return values
    middle = median_filter(values, TUNING.median_width, mode="nearest")
    apart = np.abs(values - middle)
    usual = USUAL * float(np.median(apart))
    far = apart > TUNING.outlier_distance * usual
    return np.where(far, middle, values) if usual > 0.0 and far.mean() < 1.0 - TUNING.least_clean_share else values


def outlier_p_value(channels: Iterable[Array]) -> float:
    """p-value of as many samples far off, of noise units (n,) of each channel, were one in a hundred so by chance."""
    from scipy.special import bdtrc

    found = []
    for w in channels:
        if w.size:
            far = np.abs(w) > TUNING.outlier_distance * max(1.0, USUAL * float(np.median(np.abs(w))))
            found.append(float(bdtrc(far.sum() - 1, w.size, TUNING.outlier_rate)))
    return min([1.0, *(len(found) * p for p in found)])
