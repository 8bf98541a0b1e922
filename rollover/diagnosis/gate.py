"""When a gain is more than chance: the null distribution of the best of all candidates.

Each candidate looked at in a few places gives directions d in the space of the whitened samples, freed of what the
time shifts explain. On noise alone the gain of a direction is z^2, z = d'n/|d|, and the best of all is max z^2: drawn
from N(0, G), G the matrix of the directions' cosines, without a single simulation.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.fit import Block

Array = NDArray[np.float64]
DRAWS = 4000


def freed(vectors: Array, block: Block) -> Array:
    """Vectors (n, m) without what the recording's time shift explains, given its prior."""
    s = block.slope
    shrink = (1.0 - np.sqrt(block.prior**-2 / block.weight)) / max(float(s @ s), 1e-300)
    return np.asarray(vectors - shrink * np.outer(s, s @ vectors))


def null_of_the_best(directions: Sequence[Array], draws: int = DRAWS, seed: int = 0) -> Array:
    """Largest gain on noise (draws,), sorted; `directions` are, for each recording, arrays (n_r, m)."""
    m = directions[0].shape[1] if len(directions) else 0
    if m == 0:
        return np.zeros(draws)
    G = sum((np.asarray(d).T @ np.asarray(d) for d in directions), np.zeros((m, m)))
    size = np.sqrt(np.maximum(np.diag(G), 1e-300))
    C = G / np.outer(size, size)
    values, vectors = np.linalg.eigh(C)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    z = np.random.default_rng(seed).standard_normal((draws, m)) @ root.T
    return np.asarray(np.sort(np.max(z * z, axis=1)))


def p_value(gain: float, null: Array) -> float:
    """Share of the null at or above a gain; beyond the draws the tail goes on as that of chi-square."""
    above = int(null.size - np.searchsorted(null, gain))
    if above >= 10:
        return (above + 1) / (null.size + 1)
    from scipy.stats import chi2

    anchor = float(null[-10])
    return float(10.0 / null.size * chi2.sf(gain, 1) / max(chi2.sf(anchor, 1), 1e-300))
