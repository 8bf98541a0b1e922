"""How far a simulation can be trusted, sample by sample: the scatter of neighbours that nobody could tell apart.

After some contacts an overturn depends on where the grid's elements lie and on how long a step is. What neighbours
differ by there is no mismatch. With scatter s(t) beside the noise sigma, each sample counts

    w(t) = sigma / sqrt(sigma^2 + c L s(t)^2)                                                                  (D3)

of what it would: L samples of the scatter go together, so that each of them is worth 1/L of one that stands alone;
c makes up for the few neighbours.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.evidence import Evidence, Signal

Array = NDArray[np.float64]
WINDOW = 0.02  # s, over which the neighbours' squares are averaged: what is off by a little in time is off in size
FEW = 1.5  # c, for six neighbours
LONGEST = 0.1  # s, that scatter goes together
UNTOUCHED = 0.99  # weights all above need no mention


def weighted(e: Evidence, strays: Sequence[Mapping[str, Array]]) -> Evidence:
    """The evidence with each sample's weight (D3); `strays` are the neighbours' deviations at its stamps."""
    if not strays:
        return e
    signals = tuple(_weighted(e, s, np.stack([d[s.channel][s.rows] for d in strays])) for s in e.signals)
    stacked = [e.raw(d) for d in strays]
    return replace(e, signals=signals, strays=tuple(d for d in stacked if np.all(np.isfinite(d))))


def _weighted(e: Evidence, s: Signal, strays: Array) -> Signal:
    """A signal with its weights; `strays` (k, n), SI."""
    strays = strays[np.all(np.isfinite(strays), axis=1)]
    if not len(strays):
        return s
    time = e.recording.time[s.rows]
    scatter = averaged(np.mean(strays**2, axis=0), time)
    together = min(memory(strays), max(1.0, LONGEST / float(np.median(np.diff(time)))))
    weight = s.sigma / np.sqrt(s.sigma**2 + FEW * together * scatter)
    return s if weight.min() > UNTOUCHED else replace(s, weight=weight)


def averaged(squares: Array, time: Array) -> Array:
    """Running mean of (n,) over `WINDOW`, centred, fewer values at the ends."""
    half = max(1, round(0.5 * WINDOW / float(np.median(np.diff(time)))))
    sums = np.concatenate([[0.0], np.cumsum(squares)])
    k = np.arange(squares.size)
    low, high = np.maximum(k - half, 0), np.minimum(k + half + 1, squares.size)
    return np.asarray((sums[high] - sums[low]) / (high - low))


def memory(strays: Array) -> float:
    """How many samples of deviations (k, n) go together: (1 + rho)/(1 - rho), rho from one sample to the next."""
    power = float(np.sum(strays**2))
    if power <= 0.0:
        return 1.0
    rho = float(np.sum(strays[:, 1:] * strays[:, :-1])) / power
    return max(1.0, (1.0 + rho) / max(1.0 - rho, 1e-3))
