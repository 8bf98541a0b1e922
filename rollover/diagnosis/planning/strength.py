"""How strong an effect must be for a test to show it, and how probably it is seen and told from another one.

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
from collections.abc import Callable
from typing import Any

from rollover.diagnosis.fit.parameterisation import (
    Candidate,
    coordinate,
    coordinates,
    followed,
    is_limit,
    null_of,
    physical,
)
from rollover.diagnosis.settings import SETTINGS
from rollover.effects import EFFECTS, units_of
from rollover.effects.effect import CHANNELS_OWN

TUNING = SETTINGS.planning
Coordinates = tuple[float, ...]
Shows = Callable[[Coordinates], float]


def usual(c: Candidate) -> Coordinates | None:
    """Coordinates of an effect as strong as it usually is; None where that depends on the channel alone."""
    kind: Any = EFFECTS[c.id]
    own = kind() if c.channel is None else kind(channel=c.channel)
    values = {name: getattr(own, name) for name in c.search}
    if any(units_of(kind)[name] == CHANNELS_OWN or value is None for name, value in values.items()):
        return None
    if any(c.search[name].scale == "log" and value <= 0.0 for name, value in values.items()):
        return None
    return coordinates(values, c.search)


def scaled(c: Candidate, x: Coordinates, factor: float) -> Coordinates | None:
    """`followed`, and the same of what has the scenario's own value for its zero; None where no value is known."""
    name, zero = null_of(c)
    if zero is None or EFFECTS[c.id].null.get(name) is not None:
        return followed(c, x, factor)
    search, at = c.search[name], list(c.search).index(name)
    value = zero + factor * (physical(x[at], search) - zero)
    inside = coordinate(min(max(value, search.low), search.high), search)
    return (*x[:at], inside, *x[at + 1 :])


def point_where_it_acts(c: Candidate, shows: Shows) -> Coordinates | None:
    """Its usual place, or the first of its starts that does anything in a test; None where none does."""
    own = usual(c)
    points = [*([] if own is None else [own]), *c.starts(), *c.scan_points()]
    return next((x for x in points if shows(x) > TUNING.nothing), None)


def strength_with(c: Candidate, at: Coordinates, shows: Shows, noncentrality: float) -> Coordinates | None:
    """Coordinates of the effect that has this noncentrality, from a place where it acts; None: its range ends before.

    What has a zero is made weaker or stronger by the root of what is asked for; of a limit the value itself is sought.
    """
    if scaled(c, at, 1.0) is None:
        return _limit_with(c, at, shows, noncentrality)
    low, high, x, factor = 0.0, math.inf, at, 1.0
    for _ in range(TUNING.approaches):
        found = shows(x)
        if abs(found / noncentrality - 1.0) < TUNING.close:
            return x
        low, high = (factor, high) if found < noncentrality else (low, factor)
        guess = factor * math.sqrt(noncentrality / max(found, 1e-6 * noncentrality))
        factor = guess if low < guess < high else math.sqrt(max(low, 1e-6 * high) * high) if high < math.inf else guess
        there = scaled(c, at, factor)
        if there is None or there == x:
            break
        x = there
    return x if shows(x) > noncentrality * (1.0 - TUNING.close) else None


def _limit_with(c: Candidate, at: Coordinates, shows: Shows, noncentrality: float) -> Coordinates | None:
    """The same for a limit, by halving: the lower, the stronger; others as at one of their starts that shows enough."""
    if not is_limit(c):
        return min((x for x in [at, *c.starts()] if shows(x) >= noncentrality), key=shows, default=None)
    low, high = 0.0, 1.0
    if shows((low, *at[1:])) < noncentrality:
        return None
    for _ in range(TUNING.approaches):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if shows((middle, *at[1:])) >= noncentrality else (low, middle)
    return (low, *at[1:])


def of_one(false_alarm: float, many: int) -> float:
    """Size of each of `many` tests of which noise alone passes none but with `false_alarm` (Sidak)."""
    return -math.expm1(math.log1p(-false_alarm) / max(many, 1))


def detection(noncentrality: float, size: float, freedoms: int = 1) -> float:
    """(P1): probability that an effect of `freedoms` fitted numbers is seen by a test of this size."""
    from scipy.stats import chi2, ncx2

    return float(ncx2.sf(chi2.isf(size, freedoms), freedoms, noncentrality)) if noncentrality > 0.0 else size


def required_noncentrality(power: float, size: float, freedoms: int = 1) -> float:
    """Noncentrality at which (P1) is `power`; 0 where that is no more than the size."""
    from scipy.optimize import brentq

    if power <= size:
        return 0.0
    return float(brentq(lambda v: detection(v, size, freedoms) - power, 0.0, 1e4))


def choice(noncentrality: float, unopposed: float = math.inf) -> float:
    """(P2): probability that the misfit chooses the right one of two; `unopposed` is L, of the effect alone."""
    if math.isinf(unopposed):
        return _normal(0.5 * math.sqrt(noncentrality))
    cosine = math.sqrt(max(1.0 - noncentrality / unopposed, 0.0)) if unopposed > 0.0 else 1.0
    # 1 - c without the rounding of a difference
    g = math.sqrt(0.5 * min(noncentrality, unopposed) / (1.0 + cosine))
    h = math.sqrt(0.5 * unopposed * (1.0 + cosine))
    return _normal(g) * _normal(h) + _normal(-g) * _normal(-h)


def _normal(z: float) -> float:
    return 0.5 * math.erfc(-z / math.sqrt(2.0))
