"""Channel filter classes (CFC) of SAE J211 and ISO 6487: a four-pole, zero-phase Butterworth low-pass.

A second-order filter with w_d = 2 pi CFC K is run forward and backward; K = 2.0775 (J211) or 1.25/0.6 (ISO 6487) puts
the two-pass -3 dB point at CFC/0.6 Hz.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

CFC = Literal[60, 180, 600, 1000]
J211, ISO_6487 = 2.0775, 1.25 / 0.6
CLASSES = (60, 180, 600, 1000)


def least_rate(cfc: int) -> float:
    """Lowest sampling rate that a class admits, Hz: six times its -3 dB frequency CFC/0.6."""
    return 6.0 * cfc / 0.6


def filtered(values: NDArray[np.float64], step: float, cfc: int, *, constant: float = J211) -> NDArray[np.float64]:
    """Values (n,) sampled every `step` s through a filter class; ends are continued by odd reflection.

    Raises ``ValueError`` for an unknown class, and where the rate is too low for the class.
    """
    if cfc not in CLASSES:
        raise ValueError(f"cfc: no such filter class, got {cfc!r}; {', '.join(map(str, CLASSES))} are allowed")
    if 1.0 / step < least_rate(cfc) * (1.0 - 1e-9):
        raise ValueError(
            f"cfc: sampled too slowly for CFC {cfc}, got {1.0 / step:.6g} Hz; at least {least_rate(cfc):.0f} Hz"
        )
    if values.size < 2:
        return np.array(values, dtype=float)
    from scipy.signal import lfilter  # slow to import, and a scenario's check needs only the rates

    b, a, steady = _coefficients(cfc * constant, step)
    pad = min(max(round(0.01 / step), 100), values.size - 1)
    # SciPy's filtfilt works the steady state out anew each time, which takes longer than the filter
    smooth = np.concatenate([2.0 * values[0] - values[pad:0:-1], values, 2.0 * values[-1] - values[-2 : -pad - 2 : -1]])
    for _ in range(2):
        smooth = lfilter(b, a, smooth, zi=steady * smooth[0])[0][::-1]
    return np.array(smooth[pad : pad + values.size])


@lru_cache(maxsize=64)
def _coefficients(frequency: float, step: float) -> tuple[NDArray[np.float64], ...]:
    """Numerator, denominator, and the filter's state behind a constant 1."""
    from scipy.signal import butter, lfilter_zi

    b, a = butter(2, frequency, fs=1.0 / step)
    return b, a, lfilter_zi(b, a)


def attenuation(frequency: float, step: float, cfc: int, *, constant: float = J211) -> float:
    """Gain of the whole (two-pass) filter at a frequency, from its bilinear transform: 1/(1 + (w/w_a)^4)."""
    w_a = math.tan(math.pi * cfc * constant * step)
    w = math.tan(math.pi * frequency * step)
    return 1.0 / (1.0 + (w / w_a) ** 4)
