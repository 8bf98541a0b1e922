"""From a noncentrality to a probability: of seeing an effect, and of choosing the right one of two.

Recordings whitened, y = s_A(t) + n. What stays of the effect A at strength t where a rival B and the instruments'
errors are refitted is d = (1 - P_B) s_A(t), and lambda = |d|^2 its noncentrality.

    detection  the gain of A over nothing is chi^2(k, lambda); seen if above the quantile of the false alarms    (P1)
    choice     D = |r_B|^2 - |r_A|^2 after one number of each is refitted; with L = |s_A|^2 beside nothing and
               c^2 = 1 - lambda/L the squared cosine of the two, D is a product of two independent normal numbers:
               P(A) = Phi(g) Phi(h) + Phi(-g) Phi(-h),  g^2 = L (1 - c)/2,  h^2 = L (1 + c)/2                    (P2)

Of two that are nearly alike, or where nothing is fitted, (P2) is Phi(sqrt(lambda)/2).
"""

from __future__ import annotations

import math


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


def choice(noncentrality: float, beside_nothing: float = math.inf) -> float:
    """(P2): probability that the misfit chooses the right one of two; `beside_nothing` is L, of the effect alone."""
    if math.isinf(beside_nothing):
        return _normal(0.5 * math.sqrt(noncentrality))
    cosine = math.sqrt(max(1.0 - noncentrality / beside_nothing, 0.0)) if beside_nothing > 0.0 else 1.0
    # 1 - c without the rounding of a difference
    g = math.sqrt(0.5 * min(noncentrality, beside_nothing) / (1.0 + cosine))
    h = math.sqrt(0.5 * beside_nothing * (1.0 + cosine))
    return _normal(g) * _normal(h) + _normal(-g) * _normal(-h)


def _normal(z: float) -> float:
    return 0.5 * math.erfc(-z / math.sqrt(2.0))
