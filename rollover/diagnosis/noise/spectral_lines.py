"""What is in a residual beside broadband noise and physics: spectral lines, as of mains hum, and outliers.

The periodograms of all recordings, each over its own running median times 1/ln 2, add up at a frequency to a sum that
is Gamma(R) distributed on noise of any smooth spectrum; a line is where that is beyond chance at all frequencies.
No autoregression fits a line. Outliers, as of a loose contact, leave no window quiet, and are not noise for that.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.settings import SETTINGS
from rollover.recording.noise_floor import LENGTH, USUAL

Array = NDArray[np.float64]
TUNING = SETTINGS.noise.spectral_lines
OUTLIERS = SETTINGS.noise.outliers


def lines(times: Sequence[Array], misfits: Sequence[Array]) -> tuple[float, ...]:
    """Frequencies (Hz) of lines in misfits (n_r,) at stamps (s), of one channel, the strongest first."""
    use = [
        (t, w - w.mean())
        for t, w in zip(times, misfits, strict=True)
        if w.size >= TUNING.least_samples and np.ptp(w) > 0.0
    ]
    found: list[float] = []
    while use and len(found) < TUNING.most_lines:
        f = _strongest(use)
        if f is None:
            break
        found.append(f)
        use = [(t, without(t, w, (f,))) for t, w in use]
    return tuple(found)


def without(t: Array, w: Array, frequencies: Sequence[float]) -> Array:
    """What is left of a misfit beside sines at these frequencies, by least squares."""
    if not frequencies or w.size < TUNING.least_samples:
        return w
    return w - fitted(t, w, frequencies)


def fitted(t: Array, w: Array, frequencies: Sequence[float]) -> Array:
    """The sines themselves; a constant is fitted beside them and left."""
    B = basis(t, frequencies)
    x = np.linalg.lstsq(np.column_stack([B, np.ones(t.size)]), w, rcond=None)[0]
    return np.asarray(B @ x[:-1])


def basis(t: Array, frequencies: Sequence[float]) -> Array:
    """Cosines and sines, (n, 2 k)."""
    turns = 2.0 * np.pi * t[:, None] * np.asarray(frequencies)
    return np.hstack([np.cos(turns), np.sin(turns)])


def _strongest(use: Sequence[tuple[Array, Array]]) -> float | None:
    """The frequency of the strongest line, if it is one."""
    from scipy.special import gammaincc

    spans = [float(t[-1] - t[0]) for t, _ in use]
    low = TUNING.least_periods / min(spans)
    high = min(TUNING.highest_frequency * (t.size - 1) / span for (t, _), span in zip(use, spans, strict=True))
    step = 1.0 / (TUNING.padding * max(spans))
    if high - low < 4.0 * TUNING.median_half_width * step:
        return None
    at = np.arange(low, high, step)
    S = np.sum([_over_median(t, w, at) for t, w in use], axis=0)
    k = int(np.argmax(S))
    if gammaincc(len(use), S[k]) * at.size / TUNING.padding > TUNING.p_value:
        return None
    near = at[k] + np.linspace(-1.0, 1.0, TUNING.fine_count) * step * 0.75
    power = [sum(float(np.sum(fitted(t, w, (float(f),)) ** 2)) for t, w in use) for f in near]
    return float(near[int(np.argmax(power))])


def _over_median(t: Array, w: Array, at: Array) -> Array:
    """A recording's periodogram over what is usual beside each frequency, at frequencies (Hz)."""
    from scipy.ndimage import median_filter

    n = t.size
    even = np.linspace(t[0], t[-1], n)
    P = np.abs(np.fft.rfft(np.interp(even, t, w) * np.hanning(n), TUNING.padding * n)) ** 2
    usual = median_filter(P, 2 * TUNING.padding * TUNING.median_half_width + 1, mode="nearest") / np.log(2.0)
    f = np.arange(P.size) / (TUNING.padding * n * (even[1] - even[0]))
    return np.asarray(np.interp(at, f, P / np.maximum(usual, 1e-300)))


def without_outliers(values: Array) -> Array:
    """Evenly spaced values (n,), those far from their neighbours replaced by the middle one of these.

    As they are where so many lie far off that these are the rule.
    """
    from scipy.ndimage import median_filter

    if values.size < LENGTH:
        return values
    middle = median_filter(values, OUTLIERS.median_width, mode="nearest")
    apart = np.abs(values - middle)
    usual = USUAL * float(np.median(apart))
    far = apart > OUTLIERS.outlier_distance * usual
    return np.where(far, middle, values) if usual > 0.0 and far.mean() < 1.0 - OUTLIERS.least_clean_share else values


def outlier_p_value(channels: Iterable[Array]) -> float:
    """p-value of as many samples far off, of noise units (n,) of each channel, were one in a hundred so by chance."""
    from scipy.special import bdtrc

    found = []
    for w in channels:
        if w.size:
            far = np.abs(w) > OUTLIERS.outlier_distance * max(1.0, USUAL * float(np.median(np.abs(w))))
            found.append(float(bdtrc(far.sum() - 1, w.size, OUTLIERS.outlier_rate)))
    return min([1.0, *(len(found) * p for p in found)])
