"""Small probabilities: FORM for the design point, importance sampling about it. The only OpenTURNS home.

The limit state is g(u) > 0 over independent standard normals u; the axes' distributions make values of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.studies.study import Reliability
from rollover.system.errors import Fault, InputError

Array = NDArray[np.float64]
BLOCK = 20  # cases of the importance sampling that are handed out together


class NoDesignPointError(Exception):
    """The search found no point at which the limit is met, or a case on its way failed."""


def installed() -> None:
    """Raise `InputError` with the cure where OpenTURNS is missing."""
    try:
        import openturns  # noqa: F401
    except ImportError:
        message = "openturns is not installed; pip install 'rollover[reliability]' brings it, or leave reliability out"
        raise InputError(Fault(file="reliability", message=message)) from None


def form_and_importance_sampling(
    limit_state: Callable[[Array], Array], names: list[str], asked: Reliability, confidence: float
) -> dict[str, Any]:
    """Probability that `limit_state` (n, d) -> (n,) is positive, with its interval; d standard normals.

    FORM: Phi(-beta) at the nearest point where it vanishes (exact if it is a plane there). Importance sampling:
    p = mean of 1[g > 0] phi(u)/phi(u - u*), u drawn about that point; its interval is that of the mean of `count`
    draws, and the one to believe. The gradient is a difference over `asked.step`, wider than what chance does to a
    load. Raises `NoDesignPointError`.
    """
    import openturns as ot

    d, calls = len(names), [0]

    def sample(points: Any) -> list[list[float]]:
        u = np.array(points, dtype=np.float64)
        calls[0] += len(u)
        g = limit_state(u)
        if not np.isfinite(g).all():
            raise NoDesignPointError("a case on the way to the design point failed; its row says why")
        return [[float(v)] for v in g]

    ot.RandomGenerator.SetSeed(asked.seed)
    bare = ot.PythonFunction(d, 1, func=lambda u: sample([u])[0], func_sample=sample)
    function = ot.Function(ot.MemoizeFunction(bare))
    gradient = ot.CenteredFiniteDifferenceGradient(ot.Point([asked.step] * d), function.getEvaluation())
    function.setGradient(gradient)
    normals = ot.Normal(d)
    output = ot.CompositeRandomVector(function, ot.RandomVector(normals))
    event = ot.ThresholdEvent(output, ot.Greater(), 0.0)
    search = ot.AbdoRackwitz()
    search.setMaximumIterationNumber(asked.iterations)
    search.setMaximumAbsoluteError(0.05)
    search.setMaximumRelativeError(0.05)
    search.setMaximumResidualError(0.05)
    search.setMaximumConstraintError(0.01)
    search.setCheckStatus(False)
    try:
        search.setStartingPoint(ot.Point(d))
        form = ot.FORM(search, event)
        form.run()
    except (TypeError, ValueError, RuntimeError) as e:
        raise NoDesignPointError(str(e).splitlines()[0]) from None
    result = form.getResult()
    point = np.array(result.getStandardSpaceDesignPoint())
    steps = calls[0]
    draws = _drawn_about(point, limit_state, asked, confidence)
    factors = np.array(result.getImportanceFactors())
    return {
        "beta": float(result.getHasoferReliabilityIndex()),
        "form_probability": float(result.getEventProbability()),
        "design_point": dict(zip(names, map(float, point), strict=True)),
        "importance_factors": dict(zip(names, map(float, factors), strict=True)),
        "search_cases": steps,
        **draws,
    }


def _drawn_about(
    point: Array, limit_state: Callable[[Array], Array], asked: Reliability, confidence: float
) -> dict[str, Any]:
    """Importance sampling with unit normals about `point`: weights w = exp(|u*|^2/2 - u* . u)."""
    from scipy.special import ndtri

    random = np.random.default_rng(asked.seed)
    u = point + random.standard_normal((asked.count, len(point)))
    g = limit_state(u)
    good = np.isfinite(g)
    weight = np.exp(0.5 * point @ point - u @ point)
    n = int(good.sum())
    if n < 2:
        raise NoDesignPointError("nearly all cases of the importance sampling failed; their rows say why")
    terms = np.where(g[good] > 0.0, weight[good], 0.0)
    p, error = float(terms.mean()), float(terms.std(ddof=1)) / math.sqrt(n)
    half = float(ndtri(0.5 + 0.5 * confidence)) * error
    return {
        "probability": p,
        "low": max(p - half, 0.0),
        "high": min(p + half, 1.0),
        "variation": error / p if p > 0.0 else None,
        "cases": n,
        "failed": int(len(g) - n),
        "hits": int((g[good] > 0.0).sum()),
    }
