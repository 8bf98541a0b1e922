"""Channel filter classes (CFC) of SAE J211 and ISO 6487: a four-pole, zero-phase Butterworth low-pass.

A second-order filter with w_d = 2 pi CFC K is run forward and backward; K = 2.0775 (J211) or 1.25/0.6 (ISO 6487) puts
the two-pass -3 dB point at CFC/0.6 Hz.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ground.compiled import leaf
from rollover.recording.record import CFC, CLASSES

__all__ = ["CFC", "CLASSES", "ISO_6487", "J211", "LowPass", "filtered", "least_rate", "low_pass"]

J211, ISO_6487 = 2.0775, 1.25 / 0.6


def least_rate(cfc: int) -> float:
    """Lowest sampling rate that a class admits, Hz: six times its -3 dB frequency CFC/0.6."""
    return 6.0 * cfc / 0.6


@dataclass(frozen=True, kw_only=True)
class LowPass:
    """A filter class at a sampling rate: b (3), a (3) and the steady state (2) in one, and by how much ends go on."""

    coefficients: NDArray[np.float64]
    pad: int


def low_pass(cfc: int, step: float, *, constant: float = J211) -> LowPass:
    """The filter of a class for values every `step` s.

    Raises ``ValueError`` for an unknown class, and where the rate is too low for the class.
    """
    if cfc not in CLASSES:
        raise ValueError(f"cfc: no such filter class, got {cfc!r}; {', '.join(map(str, CLASSES))} are allowed")
    if 1.0 / step < least_rate(cfc) * (1.0 - 1e-9):
        raise ValueError(
            f"cfc: sampled too slowly for CFC {cfc}, got {1.0 / step:.6g} Hz; at least {least_rate(cfc):.0f} Hz"
        )
    return LowPass(coefficients=_coefficients(cfc * constant, step), pad=max(round(0.01 / step), 100))


def filtered(values: NDArray[np.float64], step: float, cfc: int, *, constant: float = J211) -> NDArray[np.float64]:
    """Values (n,) sampled every `step` s through a filter class; ends are continued by odd reflection.

    Raises ``ValueError`` as `low_pass` does.
    """
    found = low_pass(cfc, step, constant=constant)
    if values.size < 2:
        return np.array(values, dtype=float)
    pad, own = min(found.pad, values.size - 1), found.coefficients
    smooth = np.empty(values.size + 2 * pad)
    # SciPy's filtfilt works the steady state out anew each time, and its lfilter looks at its arguments for longer than
    # a pass takes
    run_through(own[0:3], own[3:6], own[6:8], np.ascontiguousarray(values, dtype=np.float64), pad, smooth)
    return smooth[pad : pad + values.size].copy()


@leaf
def run_through(b: Any, a: Any, steady: Any, values: Any, pad: int, smooth: Any) -> None:
    """Values (n,), continued by `pad` to either side, through a second-order filter forward and backward.

    y = b_0 x + z_0, z_0' = b_1 x - a_1 y + z_1, z_1' = b_2 x - a_2 y (direct form II, transposed), begun as if the
    first had stood there for ever.
    """
    n, last = values.size, values.size - 1
    for i in range(pad):
        smooth[i] = 2.0 * values[0] - values[pad - i]
        smooth[pad + n + i] = 2.0 * values[last] - values[last - 1 - i]
    for i in range(n):
        smooth[pad + i] = values[i]
    end = smooth.size - 1
    for turn in range(2):
        first = end if turn else 0
        z0, z1 = steady[0] * smooth[first], steady[1] * smooth[first]
        for k in range(smooth.size):
            i = end - k if turn else k
            x = smooth[i]
            y = z0 + b[0] * x
            z0 = z1 + x * b[1] - y * a[1]
            z1 = x * b[2] - y * a[2]
            smooth[i] = y


@lru_cache(maxsize=64)
def _coefficients(frequency: float, step: float) -> NDArray[np.float64]:
    """Numerator, denominator, and the filter's state behind a constant 1, (8,)."""
    from scipy.signal import butter, lfilter_zi  # slow to import, and a scenario's check needs only the rates

    b, a = butter(2, frequency, fs=1.0 / step)
    return np.concatenate([b, a, lfilter_zi(b, a)])


def attenuation(frequency: float, step: float, cfc: int, *, constant: float = J211) -> float:
    """Gain of the whole (two-pass) filter at a frequency, from its bilinear transform: 1/(1 + (w/w_a)^4)."""
    w_a = math.tan(math.pi * cfc * constant * step)
    w = math.tan(math.pi * frequency * step)
    return 1.0 / (1.0 + (w / w_a) ** 4)
