"""Noise that grows with what is measured: a share of the value beside a floor.

Fourth differences of evenly spaced samples hold the noise and next to nothing of a motion (a sine of 20 samples a
period keeps a thousandth of its size). Sorted by the value their median size s tells the noise at each,

    s^2 = a + b y + c y^2,   level(y) = sqrt(s^2(y)/min s^2)                                                    (D10)

in units of the smallest. Only what is clear in all recordings of a channel counts: a kink or a filter does a little of
the same. What comes after an impact in an overturn is left out: there one contact follows another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.data.dataset import Dataset, Signal
from rollover.diagnosis.forward.interface import first_impact_of
from rollover.diagnosis.noise.autoregression import signals_of_one_recorder
from rollover.diagnosis.settings import SETTINGS
from rollover.recording.noise_floor import LENGTH, USUAL

Array = NDArray[np.float64]
TUNING = SETTINGS.noise.heteroscedasticity


def with_variance_model(dataset: Sequence[Dataset]) -> list[Dataset]:
    """The dataset with each sample's noise where that clearly grows with the value, (D10)."""
    found = [list(e.signals) for e in dataset]
    for members in signals_of_one_recorder(dataset):
        quiet = [t for r, _, s, _ in members if (t := _values_and_noise(dataset[r], s)) is not None and _varies(*t)]
        if not quiet or not _grows(quiet):
            continue
        law, least = _variance_polynomial(quiet)
        for r, k, s, _ in members:
            level = np.sqrt(np.maximum(np.polyval(law, _smoothed(s.values)), least) / least)
            found[r][k] = replace(s, level=level)
    return [replace(e, signals=tuple(s)) for e, s in zip(dataset, found, strict=True)]


def _values_and_noise(e: Dataset, s: Signal) -> tuple[Array, Array] | None:
    """Values (n,) of a signal and the size of its noise there; None of too few or unevenly spaced samples."""
    s = s.cut(e.recording.time[s.rows] < first_impact_of(e.simulator))
    stamps = np.diff(e.recording.time[s.rows])
    if s.values.size < max(TUNING.bins * TUNING.least_samples, LENGTH) or s.scatter > 0.0:
        return None  # the steps of digits are no noise
    if np.mean(np.abs(stamps - np.median(stamps)) > TUNING.even_tolerance * np.median(stamps)) > TUNING.even_tolerance:
        return None
    return s.values[2:-2], np.abs(np.diff(s.values, 4)) / np.sqrt(70.0)


def _sizes(quiet: Sequence[tuple[Array, Array]], by: Array) -> tuple[Array, Array, int]:
    """Median value and size in bins of equally many samples, sorted `by`; samples of one."""
    values, sizes = (np.concatenate(each) for each in zip(*quiet, strict=True))
    parts = np.array_split(np.argsort(by, kind="stable"), TUNING.bins)
    found = np.array([[np.median(values[p]), USUAL * np.median(sizes[p])] for p in parts])
    return found[:, 0], found[:, 1], parts[0].size


def _varies(values: Array, sizes: Array) -> bool:
    """Whether values (n,) are more than noise of `sizes` (n,): sorted by itself, noise seems to grow with its size."""
    low, high = np.quantile(np.abs(values), (0.125, 0.875))
    return bool(high - low > TUNING.least_range * USUAL * np.median(sizes))


def _grows(quiet: Sequence[tuple[Array, Array]]) -> bool:
    """Whether the noise of large values is clearly louder than that of small ones, in all together and in most."""
    ratios, weights = [], []
    for one in quiet:
        _, size, count = _sizes([one], np.abs(one[0]))
        if size.min() <= 0.0:
            return False
        ratios.append(float(np.log(np.median(size[-3:]) / np.median(size[:3]))))
        weights.append(count)
    error = TUNING.level_error / np.sqrt(sum(weights))
    return bool(
        np.median(ratios) > TUNING.least_rise and np.average(ratios, weights=weights) > TUNING.least_errors * error
    )


def _variance_polynomial(quiet: Sequence[tuple[Array, Array]]) -> tuple[Array, float]:
    """Coefficients of s^2 by the value, highest power first, by least squares over what is seen; its least."""
    value, size, _ = _sizes(quiet, np.concatenate([values for values, _ in quiet]))
    scale = float(np.max(np.abs(value)))
    x = np.vander(value / scale, 3)
    law = np.linalg.lstsq(x / size[:, None] ** 2, np.ones(value.size), rcond=None)[0]
    return law / scale ** np.arange(2, -1, -1), float(np.min(size**2))


def _smoothed(values: Array) -> Array:
    """Running mean (n,) of `smoothing` samples, of fewer at the ends."""
    kernel = np.ones(min(TUNING.smoothing, values.size))
    return np.asarray(np.convolve(values, kernel, "same") / np.convolve(np.ones(values.size), kernel, "same"))
