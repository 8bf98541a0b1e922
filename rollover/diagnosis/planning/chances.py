"""From a noncentrality to a probability: of seeing an effect, and of choosing the right one of two.

Recordings whitened, y = s_A(t) + n. What stays of the effect A at strength t where a rival B and the instruments'
errors are refitted is d = (1 - P_B) s_A(t), and lambda = |d|^2 its noncentrality.

    detection  the gain of A over nothing is chi^2(k, lambda); seen if above the quantile of the false alarms    (P1)
    choice     D = |r_B|^2 - |r_A|^2 after both are refitted, less its mean k_A - k_B at lambda = 0:
               E D = lambda,  var D = 4 lambda + 2 tr (P_A - P_B)^2,  P(A) = Phi(E D/sqrt(var D))                 (P2)

Between two fixed hypotheses, which fit nothing, (P2) is Phi(sqrt(lambda)/2).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def of_one(false_alarm: float, many: int) -> float:
    """Size of each of `many` tests of which noise alone passes none but with `false_alarm` (Sidak)."""
    return -math.expm1(math.log1p(-false_alarm) / max(many, 1))


def detection(noncentrality: float, size: float, freedoms: int = 1) -> float:
    """(P1): probability that an effect of `freedoms` fitted numbers is seen by a test of this size."""
    from scipy.stats import chi2, ncx2

    return float(ncx2.sf(chi2.isf(size, freedoms), freedoms, noncentrality)) if noncentrality > 0.0 else size


def needed(power: float, size: float, freedoms: int = 1) -> float:
    """Noncentrality at which (P1) is `power`; 0 where that is no more than the size."""
    from scipy.optimize import brentq

    if power <= size:
        return 0.0
    return float(brentq(lambda v: detection(v, size, freedoms) - power, 0.0, 1e4))


def choice(noncentrality: float, spread: float = 0.0) -> float:
    """(P2): probability that the misfit chooses the right one of two; `spread` is tr (P_A - P_B)^2."""
    deviation = math.sqrt(4.0 * noncentrality + 2.0 * spread)
    return 0.5 * math.erfc(-noncentrality / (deviation * math.sqrt(2.0))) if deviation > 0.0 else 0.5


def spread_of(J: Array, other: Array) -> float:
    """tr (P - P_other)^2 of the projections on the columns of two Jacobians (n, p) and (n, q), whitened."""
    Q, R = (_basis(v) for v in (J, other))
    shared = float(np.sum((Q.T @ R) ** 2))
    return max(Q.shape[1] + R.shape[1] - 2.0 * shared, 0.0)


def _basis(J: Array) -> Array:
    """Orthonormal columns that span those of J; what is rounding beside the largest spans nothing."""
    U, S, _ = np.linalg.svd(J, full_matrices=False)
    rounding = max(J.shape) * np.finfo(float).eps * max(float(S.max(initial=0.0)), 1e-300)
    return np.asarray(U[:, rounding < S])
