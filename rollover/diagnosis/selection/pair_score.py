"""What two effects gain together, told from the directions of each: neither need gain anything alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.settings import SETTINGS

Array = NDArray[np.float64]
TUNING = SETTINGS.selection.pair_score


@dataclass(frozen=True, kw_only=True)
class Both:
    """Two directions, by their places among all, what they gain together, and how far along each that is."""

    places: tuple[int, int]
    gain: float
    along: tuple[float, float]


def best_direction_pairs(along: Array, cosines: Array, owners: Sequence[str]) -> list[Both]:
    """The best two directions of each pair of owners, the pair that gains most first.

    With z (m,) the misfit along unit directions and c their cosines (m, m), two gain
    g = (z_i^2 + z_j^2 - 2 c z_i z_j)/(1 - c^2) along a_i = (z_i - c z_j)/(1 - c^2): least squares of two columns. What
    two that are nearly one would gain by their difference is no more than arithmetic.
    """
    z, c = along, np.clip(cosines, -1.0, 1.0)
    rest = 1.0 - c**2
    able = rest > TUNING.same_direction
    rest = np.where(able, rest, 1.0)
    gains = np.where(able, (z[:, None] ** 2 + z[None, :] ** 2 - 2.0 * c * np.outer(z, z)) / rest, 0.0)
    best: dict[frozenset[str], Both] = {}
    upper = np.triu_indices(z.size, 1)
    for k in np.argsort(-gains[upper], kind="stable"):
        i, j = int(upper[0][k]), int(upper[1][k])
        pair = frozenset((owners[i], owners[j]))
        if len(pair) == 2 and pair not in best:
            far = ((z[i] - c[i, j] * z[j]) / rest[i, j], (z[j] - c[i, j] * z[i]) / rest[i, j])
            best[pair] = Both(places=(i, j), gain=float(gains[i, j]), along=(float(far[0]), float(far[1])))
            if len(best) == TUNING.most_pairs:
                break
    return list(best.values())
