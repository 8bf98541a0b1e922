"""What a study answers: quantiles, probabilities beyond a limit, sensitivities, the worst case; all with intervals."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.assessment.ledger import LIMIT
from rollover.studies import failures, sensitivity
from rollover.studies import plan as plans
from rollover.studies.case_store import Row
from rollover.studies.runner import Conducted
from rollover.studies.study import Output, Study

Array = NDArray[np.float64]
COUNTED = ("start/from_rest",)  # 0 or 1 in each case: a share, without quantiles
ENDS = 0.2  # share of the cases that stand for an axis' low and high end

DRAWN = {
    "random": "independent samples: intervals are exact",
    "lhs": "a Latin hypercube: intervals are those of independent samples, which for it are rather too wide",
    "sobol": "a Sobol sequence: intervals are those of independent samples, which for it are rather too wide",
    "sobol-indices": "quantiles over the first half of Saltelli's points; intervals are those of independent samples",
}


def values_of(output: Output, rows: Sequence[Row]) -> Array:
    """An output of all points (n,), NaN where a case failed or has no such measure."""
    return np.array([row.measures.get(output.name, math.nan) for row in rows], dtype=np.float64)


def answers(study: Study, done: Conducted) -> dict[str, Any]:
    """All answers as bare values."""
    rows = done.rows
    drawn = isinstance(study.plan, (plans.Random, plans.Lhs, plans.Sobol, plans.SobolIndices))
    chosen = _independent(study, len(rows))
    return {
        "cases": _counts(rows),
        "drawn": drawn,
        "meaning_of_quantiles": DRAWN.get(
            study.plan.kind, "the cases of a plan, which are no random sample: they tell the range"
        ),
        "from_rest": sum(row.measures.get("start/from_rest", 0.0) > 0.0 for row in rows),
        "outputs": [_output(study, output, done, chosen, drawn) for output in study.outputs],
        "flags": _flags(rows),
        "failures": _failures(rows),
        "failures_along": failures.along_axes(
            done.points.columns, np.array([row.status == "failed" for row in rows], dtype=bool)
        ),
        "ledger": _ledger(rows),
    }


def _counts(rows: Sequence[Row]) -> dict[str, int]:
    failed = sum(row.status == "failed" for row in rows)
    return {"all": len(rows), "done": len(rows) - failed, "failed": failed}


def _ledger(rows: Sequence[Row]) -> dict[str, Any]:
    """Largest residual of the energy ledger over the energy released in any case, and how many leave it open."""
    found = [(row.measures["ledger/residual"], k) for k, row in enumerate(rows) if "ledger/residual" in row.measures]
    most, at = max(found, default=(None, None))
    wide = sum(share > LIMIT for share, _ in found)
    return {"largest_residual": most, "at_point": at, "limit": LIMIT, "open": wide}


def _independent(study: Study, n: int) -> slice:
    """Points that are draws of the axes: all, or of Saltelli's scheme the base points and their partners."""
    if not isinstance(study.plan, plans.SobolIndices):
        return slice(0, n)
    # each block of d + 2 begins with a point of A and ends with one of B; only A's share nothing with each other
    return slice(0, n, len(study.axes) + 2)


def _output(study: Study, output: Output, done: Conducted, chosen: slice, drawn: bool) -> dict[str, Any]:
    y, counted = values_of(output, done.rows), output.name in COUNTED
    part, failed = y[chosen], sum(row.status == "failed" for row in done.rows[chosen])
    good = part[np.isfinite(part)]
    found: dict[str, Any] = {
        "name": output.name,
        "unit": output.unit,
        "limit": output.limit,
        "beyond": output.beyond,
        "cases": len(good),
        "missing": int(len(part) - len(good) - failed),
        "mean": float(good.mean()) if len(good) else None,
        "deviation": float(good.std(ddof=1)) if len(good) > 1 else None,
        "least": float(good.min()) if len(good) else None,
        "largest": float(good.max()) if len(good) else None,
        "quantiles": [quantile(good, q, study.confidence) for q in study.quantiles]
        if drawn and len(good) and not counted
        else [],
        "exceedance": exceedance(good, output, failed, study.confidence) if drawn and len(good) else None,
        "beyond_limit": None if drawn else share(good, output, failed),
        "worst": _worst(output, y, done),
        "ends": _ends(study, done, y),
        "rank_correlation": _ranks(study, done, y) if drawn else [],
        "sobol": _named(study, _sobol(study, y)),
        "morris": _named(study, _morris(study, done, y)),
    }
    return found


def quantile(values: Array, q: float, confidence: float) -> dict[str, Any]:
    """Quantile with its interval by order statistics, which holds for any distribution.

    P(x_(l) <= x_q < x_(u)) = sum_{k=l}^{u-1} C(n,k) q^k (1-q)^(n-k) >= confidence; an end that n values do not bound is
    None. `values` (n,) are independent samples.
    """
    from scipy.stats import binom

    n, x = len(values), np.sort(values)
    tail = 0.5 * (1.0 - confidence)
    low, high = int(binom.ppf(tail, n, q)), int(binom.ppf(1.0 - tail, n, q)) + 1
    return {
        "q": q,
        "value": float(np.quantile(x, q)),
        "low": float(x[low - 1]) if low >= 1 else None,
        "high": float(x[high - 1]) if high <= n else None,
    }


def clopper_pearson(hits: int, n: int, confidence: float) -> tuple[float, float]:
    """Exact interval of a probability: so many hits or more, or so few, have half the rest at its ends."""
    from scipy.special import betaincinv

    tail = 0.5 * (1.0 - confidence)
    low = 0.0 if hits == 0 else float(betaincinv(hits, n - hits + 1, tail))
    high = 1.0 if hits == n else float(betaincinv(hits + 1, n - hits, 1.0 - tail))
    return low, high


def exceedance(values: Array, output: Output, failed: int, confidence: float) -> dict[str, Any] | None:
    """Probability of lying beyond the limit, with its exact interval over the cases that are done, and over all.

    A failed case may lie on either side: the true share of all cases lies between `least`, which counts none of them as
    beyond, and `most`, which counts all; `low_of_all` and `high_of_all` are the outer ends of those two's intervals.
    """
    if output.limit is None:
        return None
    beyond = values > output.limit if output.beyond == "above" else values < output.limit
    hits, n = int(beyond.sum()), len(values)
    low, high = clopper_pearson(hits, n, confidence)
    return {
        "limit": output.limit,
        "beyond": output.beyond,
        "hits": hits,
        "cases": n,
        "failed": failed,
        "probability": hits / n,
        "least": hits / (n + failed),
        "most": (hits + failed) / (n + failed),
        "low": low,
        "high": high,
        "low_of_all": clopper_pearson(hits, n + failed, confidence)[0],
        "high_of_all": clopper_pearson(hits + failed, n + failed, confidence)[1],
    }


def share(values: Array, output: Output, failed: int) -> dict[str, Any] | None:
    """How many cases of a plan that draws nothing lie beyond the limit; `failed` ones may lie on either side."""
    if output.limit is None or not len(values):
        return None
    beyond = values > output.limit if output.beyond == "above" else values < output.limit
    return {
        "limit": output.limit,
        "beyond": output.beyond,
        "hits": int(beyond.sum()),
        "cases": len(values),
        "failed": failed,
    }


def _worst(output: Output, y: Array, done: Conducted) -> dict[str, Any] | None:
    if not np.isfinite(y).any():
        return None
    k = int(np.nanargmax(output.worst_sign * y))
    return {"point": k, "case": done.keys[k], "value": float(y[k]), "axes": done.points.row(k)}


def _ends(study: Study, done: Conducted, y: Array) -> list[dict[str, Any]]:
    """Mean of the output at the ends of each axis: over its lowest and its highest fifth, or its outermost levels."""
    good = np.isfinite(y)
    found = []
    for axis in study.axes:
        column = done.points.columns[axis.name]
        if column.dtype == object:
            means = {
                w: float(y[good & (column == w)].mean()) for w in dict.fromkeys(column) if (good & (column == w)).any()
            }
            if len(means) > 1:
                low, high = min(means, key=means.__getitem__), max(means, key=means.__getitem__)
                found.append(
                    {"axis": axis.name, "low": means[low], "high": means[high], "at_low": low, "at_high": high}
                )
            continue
        x = column.astype(float)
        if not good.any() or np.ptp(x[good]) == 0.0:
            continue
        a, b = np.quantile(x[good], [ENDS, 1.0 - ENDS])
        below, above = good & (x <= a), good & (x >= b)
        found.append(
            {
                "axis": axis.name,
                "low": float(y[below].mean()),
                "high": float(y[above].mean()),
                "at_low": float(x[below].mean()),
                "at_high": float(x[above].mean()),
            }
        )
    return found


def _ranks(study: Study, done: Conducted, y: Array) -> list[dict[str, Any]]:
    numeric = [a.name for a in study.axes if done.points.columns[a.name].dtype != object]
    if isinstance(study.plan, (plans.Morris, plans.SobolIndices)) or not numeric:
        return []
    found = sensitivity.rank_correlations([done.points.columns[n] for n in numeric], y, study.confidence)
    return [{"axis": name, **row} for name, row in zip(numeric, found, strict=False)]


def _sobol(study: Study, y: Array) -> list[dict[str, Any]]:
    if not isinstance(study.plan, plans.SobolIndices):
        return []
    return sensitivity.sobol_indices(y, len(study.axes), study.confidence, study.plan.seed)


def _morris(study: Study, done: Conducted, y: Array) -> list[dict[str, Any]]:
    if not isinstance(study.plan, plans.Morris) or done.points.unit is None:
        return []
    return sensitivity.morris_effects(done.points.unit, y, study.plan.levels, study.confidence, study.plan.seed)


def _named(study: Study, rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    return [{"axis": axis.name, **row} for axis, row in zip(study.axes, rows, strict=False)]


def _flags(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Share of the finished cases with each domain flag, in the run and at the peak of the leading load."""
    done = [row for row in rows if row.status == "done"]
    run, peak = (Counter(f for row in done for f in getattr(row, name)) for name in ("domain_flags", "peak_flags"))
    return [
        {"flag": flag, "cases": count, "share": count / len(done), "share_at_peak": peak[flag] / len(done)}
        for flag, count in sorted(run.items(), key=lambda item: (-item[1], item[0]))
    ]


def _failures(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Sentences of failed cases, the most frequent first, each with the first point that has it."""
    found: dict[tuple[str, str], list[int]] = {}
    for k, row in enumerate(rows):
        if row.status == "failed":
            found.setdefault((row.failure, row.sentence), []).append(k)
    return [
        {"failure": failure, "sentence": sentence, "cases": len(at), "points": at[:20]}
        for (failure, sentence), at in sorted(found.items(), key=lambda item: -len(item[1]))
    ]
