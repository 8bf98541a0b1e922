"""Compiled: the stacked samples of a recording in units of their noise, and whitened."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ground.compiled import leaf
from rollover.recording.noise_floor import grown

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Noise:
    """Of one signal: samples, sigma (SI), autoregression; `sd` (n,), SI, where its own, and `weight` (n,), if any."""

    count: int
    sigma: float
    ar: tuple[float, ...]
    sd: Array | None
    weight: Array | None


class Whitening:
    """Whitens stacks of some signals, one after another."""

    def __init__(self, signals: Sequence[Noise]) -> None:
        self.stops = np.cumsum([s.count for s in signals], dtype=np.int64)
        self._sigma = np.array([s.sigma for s in signals], dtype=np.float64)
        self._ar = np.zeros((len(signals), max((len(s.ar) for s in signals), default=0)))
        self._orders = np.array([len(s.ar) for s in signals], dtype=np.int64)
        self._gains = np.array([grown(s.ar) for s in signals], dtype=np.float64)
        for k, s in enumerate(signals):
            self._ar[k, : len(s.ar)] = s.ar
        self._sd = np.concatenate([np.zeros(s.count) if s.sd is None else s.sd for s in signals])
        self._weight = np.concatenate([np.ones(s.count) if s.weight is None else s.weight for s in signals])

    def __call__(self, raw: Array) -> Array:
        """Stacked samples (n,), or columns of them (n, m), SI, whitened: as white noise of variance 1 where noise."""
        # each column in one piece, as a single one is
        columns = np.ascontiguousarray(np.atleast_2d(raw.T), dtype=np.float64)
        out = np.empty(columns.shape)
        into(columns, self.stops, self._sigma, self._sd, self._weight, self._orders, self._ar, self._gains, out)
        return out[0] if raw.ndim == 1 else np.ascontiguousarray(out.T)


@leaf
def into(raw: Any, stops: Any, sigma: Any, sd: Any, weight: Any, orders: Any, ar: Any, gains: Any, out: Any) -> None:
    """y_i = w g (x_i - sum_j a_j x_i-j), x = raw/sigma, or raw/loud where that is not 0, g of the autoregression.

    `raw` and `out` are (m, n), a stack in each row.
    """
    for c in range(raw.shape[0]):
        first = 0
        for k in range(stops.size):
            last, order = stops[k], orders[k]
            for i in range(first, last):
                out[c, i] = raw[c, i] / sigma[k]
                if sd[i] != 0.0:
                    out[c, i] = out[c, i] * sigma[k] / sd[i]
            if order > 0:
                for i in range(last - 1, first + order - 1, -1):
                    for j in range(order):
                        out[c, i] -= ar[k, j] * out[c, i - 1 - j]
                    out[c, i] *= gains[k]
                for i in range(first, min(first + order, last)):
                    out[c, i] = 0.0  # no past to whiten with
            for i in range(first, last):
                out[c, i] *= weight[i]
            first = last
