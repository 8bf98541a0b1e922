"""Some cases of a study once more by Exudyn: what the compiled loop made of the responses, beside the reference."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rollover.studies.design import Points
from rollover.studies.runner import Builder, Conducted, Show, Way, evaluate
from rollover.studies.study import Study
from rollover.studies.summary import values_of

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

    The runs by Exudyn are kept like all cases. A difference is relative to Exudyn's value, 0 where both are equal;
    cases of which only one integrator has a value are counted as `ended_otherwise`.
    """
    some = Points(columns={name: column[list(at)] for name, column in done.points.columns.items()})
    again = evaluate(Builder(study, integrator=REFERENCE), folder, way, some, show)
    before = [done.rows[k] for k in at]
    outputs, every = [], []
    for output in study.outputs:
        apart = _apart(values_of(output, before), values_of(output, again))
        told = [(size, at[i]) for i, size in enumerate(apart) if math.isfinite(size)]
        every += [size for size, _ in told]
        largest, point = max(told, default=(None, None))
        median = float(np.median([size for size, _ in told])) if told else None
        outputs.append(
            {"name": output.name, "cases": len(told), "largest": largest, "median": median, "at_point": point}
        )
    return {
        "integrator": REFERENCE,
        "cases": len(at),
        "points": list(at),
        "largest": max(every, default=None),
        "median": float(np.median(every)) if every else None,
        "ended_otherwise": sum(a.status != b.status for a, b in zip(before, again, strict=True)),
        "outputs": outputs,
    }


def sentence(check: dict[str, Any] | None) -> str:
    """The check in words; nothing where there was none."""
    if check is None:
        return ""
    n = check["cases"]
    what = f"{n} case{'s' if n > 1 else ''} run again by Exudyn"
    if check["largest"] is None:
        found = f"{what}: no response to compare"
    else:
        found = (
            f"{what}: responses differ by {_percent(check['median'])} (median), {_percent(check['largest'])} at most"
        )
    if other := check["ended_otherwise"]:
        found += f"; {other} of them ended otherwise, done by the one and failed by the other"
    return found


def _percent(share: float) -> str:
    return f"{100.0 * share:.2g} %"


def _apart(a: Any, b: Any) -> Sequence[float]:
    """|a - b|/|b|, 0 where equal, infinite where only b is 0, NaN where one is none."""
    with np.errstate(divide="ignore", invalid="ignore"):
        apart = np.abs(a - b) / np.abs(b)
    return [0.0 if x == y else float(d) for x, y, d in zip(a, b, apart, strict=True)]
