"""What recordings have in common: noise of one has nothing of another, whatever its colour; what is missing has.

The misfits of one channel in R recordings, each taken at the same K slow cosines of the time since the contact, are
Y (R, K). Noise has the same variance s_k^2 in every row; a mean over the rows, or a trend with the condition they were
run under, has

    F = sum_k |P Y_k|^2/s_k^2/(q K) with s_k^2 = |(1 - P) Y_k|^2/(R - q), averaged over neighbouring k             (D8)

for P the projection (rank q) on the constant and on that condition: near 1 on noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
WAVES = 24
NEAR = 4  # neighbours on either side
FEWEST = 3  # recordings


@dataclass(frozen=True, kw_only=True)
class Common:
    """p-value of "nothing in common", and F."""

    p_value: float
    ratio: float


def common(times: Sequence[Array], misfits: Sequence[Array], condition: Sequence[float]) -> Common:
    """(D8) for stamps (s) and misfits (n_r,) of one channel, in noise units or any other that all share."""
    from scipy.stats import f as f_distribution

    R = len(misfits)
    if R < FEWEST:
        return Common(p_value=1.0, ratio=1.0)
    start, end = max(float(t[0]) for t in times), min(float(t[-1]) for t in times)
    inside = [(t >= start) & (t <= end) for t in times]
    waves = min([WAVES, *(int(i.sum()) // 8 for i in inside)])
    if end <= start or waves < 4:
        return Common(p_value=1.0, ratio=1.0)
    Y = np.array([_waves(t[i], w[i], start, end, waves) for t, w, i in zip(times, misfits, inside, strict=True)])
    X = np.ones((R, 1))
    u = np.asarray(condition, dtype=float)
    if R > FEWEST and np.ptp(u) > 0.0:
        X = np.column_stack([X, (u - u.mean()) / np.ptp(u)])
    Q, _ = np.linalg.qr(X)
    q = X.shape[1]
    along = np.sum((Q.T @ Y) ** 2, axis=0) / q
    across = (np.sum(Y**2, axis=0) - q * along) / (R - q)
    near = [across[max(k - NEAR, 0) : k + NEAR + 1] for k in range(waves)]
    # of a variance known by n squares the inverse is too large by n/(n - 2) on the average
    fair = np.array([(n.size * (R - q) - 2.0) / (n.size * (R - q)) / max(float(n.mean()), 1e-300) for n in near])
    ratio = float(np.mean(along * fair))
    return Common(p_value=float(f_distribution.sf(ratio, q * waves, (R - q) * waves)), ratio=ratio)


def _waves(t: Array, w: Array, start: float, end: float, waves: int) -> Array:
    """Strength of slow cosines in a misfit, (waves,), by least squares: stamps may be uneven."""
    basis = np.cos(np.pi * ((t - start) / (end - start))[:, None] * np.arange(waves))
    return np.asarray(np.linalg.lstsq(basis, w, rcond=None)[0])
