"""How often the right one of two fitted effects is chosen, before noise is drawn.

What is chosen leaves less, two more for each fitted number: so much less does a number leave of what it is fitted to
than of what it is not (Akaike 1974). Of a true effect A with p_A numbers and a rival B with p_B, both linear about
where they leave least without noise, d what B leaves there, lambda = |d|^2 and n the noise

    D = lambda + 2 d'n + G_A(n) - G_B(d + n) + 2 (p_B - p_A),   G(y) = y' J (J'J + I/s^2)^-1 J' y,
    P(A) = P(D > 0)                                                                                             (P2)

J are an effect's slopes; a coordinate at an end of its range is free where that leads into it, else held.
s^2 = 1/12 is the variance of a coordinate that is anywhere in its range: one that noise hides is fitted by no more.
D depends on the few directions of d, J_A and J_B. Of one number each that begin at nothing it is a product of two
normal numbers: with L = |s_A|^2 what nothing leaves and c^2 = 1 - lambda/L the squared cosine of both,

    P(A) = Phi(g) Phi(h) + Phi(-g) Phi(-h),   g^2 = L (1 - c)/2,   h^2 = L (1 + c)/2                            (P3)

and Phi(sqrt(lambda)/2) of two that are nearly alike.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.settings import SETTINGS

Array = NDArray[np.float64]
TUNING = SETTINGS.planning


@dataclass(frozen=True, kw_only=True)
class Tangent:
    """A fit where it ended: slopes (n, p), whitened, and of each coordinate the way into its range: 1, -1, 0 inside."""

    slopes: Array
    inwards: tuple[int, ...]


def right_choice(noncentrality: float, d: Array, own: Tangent, rival: Tangent) -> float:
    """(P2): d (n,), whitened. By quasi-random draws of the noise, to about 0.001."""
    basis = np.linalg.qr(np.column_stack([own.slopes, rival.slopes, d]))[0]
    n, left = _normal_draws(basis.shape[1]), basis.T @ d
    gained = _gain(n, basis.T @ own.slopes, own.inwards) - _gain(n + left, basis.T @ rival.slopes, rival.inwards)
    D = noncentrality + 2.0 * (n @ left) + gained + 2.0 * (len(rival.inwards) - len(own.inwards))
    return float(np.mean(D > 0.0) + 0.5 * np.mean(D == 0.0))


def _gain(y: Array, J: Array, inwards: Sequence[int]) -> Array:
    """G of (P2) of each draw: y (draws, m), J (m, p)."""
    ends, best = [k for k, way in enumerate(inwards) if way], np.zeros(len(y))
    for held in (set(some) for r in range(len(ends) + 1) for some in combinations(ends, r)):
        free = [k for k in range(J.shape[1]) if k not in held]
        if not free:
            continue
        along = y @ J[:, free]
        step = along @ np.linalg.inv(J[:, free].T @ J[:, free] + 12.0 * np.eye(len(free)))
        leads_in = np.all(step * np.array([inwards[k] for k in free]) >= 0.0, axis=1)
        best = np.maximum(best, np.where(leads_in, np.sum(along * step, axis=1), 0.0))
    return best


def choice(noncentrality: float, unopposed: float = math.inf) -> float:
    """(P3): probability that the misfit chooses the right one of two; `unopposed` is L, of the effect alone."""
    if math.isinf(unopposed):
        return _normal(0.5 * math.sqrt(noncentrality))
    cosine = math.sqrt(max(1.0 - noncentrality / unopposed, 0.0)) if unopposed > 0.0 else 1.0
    # 1 - c without the rounding of a difference
    g = math.sqrt(0.5 * min(noncentrality, unopposed) / (1.0 + cosine))
    h = math.sqrt(0.5 * unopposed * (1.0 + cosine))
    return _normal(g) * _normal(h) + _normal(-g) * _normal(-h)


@lru_cache(maxsize=8)
def _normal_draws(dimensions: int) -> Array:
    from scipy.stats.qmc import MultivariateNormalQMC

    return np.asarray(MultivariateNormalQMC(np.zeros(dimensions), rng=1).random(TUNING.quasi_draws))


def _normal(z: float) -> float:
    return 0.5 * math.erfc(-z / math.sqrt(2.0))
