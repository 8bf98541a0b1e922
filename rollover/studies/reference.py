"""Some cases of a study once more by Exudyn: what the compiled loop made of the responses, beside the reference."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rollover.studies.design import Points
from rollover.studies.runner import START, Builder, Conducted, Show, Way, evaluate
from rollover.studies.study import Output, Study
from rollover.studies.summary import values_of
from rollover.system.numbers import percent

# of a response: a hundredth of a load changes no answer. What is smooth differs by less than 1e-6: what is above is
# chance, or one of the two is wrong
LARGE = 0.01
STARTS = 5  # a case and four that nobody could tell from it
# Exudyn's is one more draw beside them: |x - mean| < t s sqrt(1 + 1/5) but for one in 1000, Student's t of 4 degrees
WITHIN = 8.610302 * math.sqrt(1.0 + 1.0 / STARTS)
SHARE = 0.01  # of the cases that the loop made: it costs 3 to 6 % more, for Exudyn takes 2.7 to 5.6 times as long
REFERENCE = "exudyn"


def chosen(study: Study, done: Conducted) -> list[int]:
    """Points whose cases are run again: a hundredth, at least one, of those that the loop made; by the study's seed."""
    first: dict[str, int] = {}
    for k, (key, row) in enumerate(zip(done.keys, done.rows, strict=True)):
        if row.provenance.get("integrator") == "compiled":
            first.setdefault(key, k)
    every = list(first.values())
    if not every:
        return []
    random = np.random.default_rng(getattr(study.plan, "seed", 0))
    count = max(1, round(SHARE * len(every)))
    return sorted(every[int(k)] for k in random.choice(len(every), count, replace=False))


def checked(
    study: Study, folder: Path, way: Way, done: Conducted, at: Sequence[int], show: Show | None = None
) -> dict[str, Any]:
    """Differences of the responses between both integrators at some points, one at least.

    The runs by Exudyn are kept like all cases. A difference is relative to Exudyn's value, or to the loop's where that
    is 0; cases of which only one integrator has a value are counted as `ended_otherwise`. What differs by more than 1 %
    is held against perturbed starts of its case, see `_beside_perturbed_starts`.
    """
    some = Points(columns={name: column[list(at)] for name, column in done.points.columns.items()})
    again = evaluate(Builder(study, integrator=REFERENCE), folder, way, some, show)
    before = [done.rows[k] for k in at]
    outputs, every, large = [], [], []
    for output in study.outputs:
        values = values_of(output, again)
        apart = _apart(values_of(output, before), values)
        finite = [(size, i) for i, size in enumerate(apart) if math.isfinite(size)]
        every += [size for size, _ in finite]
        largest, i = max(finite, default=(None, None))
        median = float(np.median([size for size, _ in finite])) if finite else None
        point = None if i is None else at[i]
        outputs.append(
            {"name": output.name, "cases": len(finite), "largest": largest, "median": median, "at_point": point}
        )
        large += [_Large(output=output, point=at[i], apart=a, value=float(values[i])) for a, i in finite if a > LARGE]
    return {
        "integrator": REFERENCE,
        "cases": len(at),
        "points": list(at),
        "largest": max(every, default=None),
        "median": float(np.median(every)) if every else None,
        "ended_otherwise": sum(a.status != b.status for a, b in zip(before, again, strict=True)),
        "outputs": outputs,
        "perturbed": _beside_perturbed_starts(study, folder, way, done, large, show) if large else None,
    }


@dataclass(frozen=True, kw_only=True)
class _Large:
    """A response of a point that is far `apart` from Exudyn's `value`."""

    output: Output
    point: int
    apart: float
    value: float


def _beside_perturbed_starts(
    study: Study, folder: Path, way: Way, done: Conducted, large: Sequence[_Large], show: Show | None
) -> dict[str, Any]:
    """What differs much, beside what the loop makes of starts that nobody could tell apart, kept like all cases.

    `responses` names each, the largest difference first: Exudyn's `value`, the loop's mean and scatter (standard
    deviation, share of the mean) over `starts` that were done, and whether Exudyn's lies `within` that; None where too
    few were done to tell.
    """
    at = list(dict.fromkeys(one.point for one in large))
    each = {name: np.repeat(column[at], STARTS) for name, column in done.points.columns.items()}
    rows = evaluate(
        Builder(study), folder, way, Points(columns={**each, START: np.tile(np.arange(STARTS), len(at))}), show
    )
    by_point = {point: rows[STARTS * k : STARTS * (k + 1)] for k, point in enumerate(at)}
    responses = []
    for one in sorted(large, key=lambda one: -one.apart):
        drawn = values_of(one.output, by_point[one.point])
        drawn = drawn[np.isfinite(drawn)]
        mean = float(drawn.mean()) if drawn.size else None
        is_known = drawn.size == STARTS and mean is not None
        scatter = float(drawn.std(ddof=1)) if is_known else 0.0
        responses.append(
            {
                "name": one.output.name,
                "point": one.point,
                "difference": one.apart,
                "value": one.value,
                "mean": mean,
                "scatter": scatter / abs(mean) if is_known and mean else None,
                "starts": int(drawn.size),
                "within": bool(abs(one.value - mean) <= WITHIN * scatter) if is_known and mean is not None else None,
            }
        )
    return {"starts": STARTS, "cases": len(at), "above": LARGE, "responses": responses}


def sentence(check: dict[str, Any] | None) -> str:
    """The check in words; nothing where there was none."""
    if check is None:
        return ""
    n = check["cases"]
    what = f"{n} case{'s' if n > 1 else ''} run again by Exudyn"
    if check["largest"] is None:
        found = f"{what}: no response to compare"
    else:
        found = f"{what}: responses differ by {percent(check['median'])} (median), {percent(check['largest'])} at most"
    if (beside := check.get("perturbed")) is not None:
        found += f"; {_scattered(beside)}"
    if other := check["ended_otherwise"]:
        found += f"; {other} of them ended otherwise, done by the one and failed by the other"
    return found


def _scattered(beside: dict[str, Any]) -> str:
    """The largest difference beside the scatter of neighbouring starts, and what lies beyond that."""
    every = beside["responses"]
    first = every[0]
    where = f"{first['name']} of point {first['point']}"
    if first["within"] is None:
        found = f"the largest, {where}, cannot be held against its neighbouring starts: {first['starts']} were done"
    elif first["scatter"] is None:
        found = f"the largest, {where}, is 0 in all neighbouring starts"
    else:
        found = f"the largest, {where}, scatters by {percent(first['scatter'])} between neighbouring starts"
    beyond = [one for one in every if one["within"] is False]
    if not beyond:
        return found
    names = ", ".join(f"{one['name']} of point {one['point']}" for one in beyond)
    return f"{found}; beyond what these scatter by: {names}"


def _apart(a: Any, b: Any) -> Sequence[float]:
    """|a - b|/|b|, or over |a| where b is 0; 0 where equal, NaN where one is none."""
    with np.errstate(divide="ignore", invalid="ignore"):
        apart = np.abs(a - b) / np.where(b == 0.0, np.abs(a), np.abs(b))
    return [0.0 if x == y else float(d) for x, y, d in zip(a, b, apart, strict=True)]
