"""Whether the failed cases of a study lie at random: along each axis, by rank tests."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

LEVEL = 0.05  # of all tests of a study together; each has this over their number (Bonferroni)
TESTS = 2  # of a numeric axis: by place, and by distance from its middle


def along_axes(columns: Mapping[str, NDArray[Any]], failed: NDArray[np.bool_]) -> list[dict[str, Any]]:
    """The failed cases against the others along each axis, `columns` (n,) by name; empty without cases of both kinds.

    Numbers by the Mann-Whitney test, once of the values (`more`: high or low) and once of their distances from the
    median of all (`more`: ends or middle), of which the smaller p counts twice; two words by Fisher's exact
    test, more by chi-squared.
    `differs` holds where p is below 5 % over the number of axes.
    """
    if not failed.any() or failed.all():
        return []
    varied = {name: column for name, column in columns.items() if len(set(column.tolist())) > 1}
    found = [
        {"axis": name, **(_words(column, failed) if column.dtype == object else _numbers(column.astype(float), failed))}
        for name, column in varied.items()
    ]
    return [{**row, "differs": row["p"] < LEVEL / len(varied)} for row in found]


def _numbers(x: NDArray[np.float64], failed: NDArray[np.bool_]) -> dict[str, Any]:
    from scipy.stats import mannwhitneyu

    found: list[tuple[float, str]] = []
    for values, names in ((x, ("low", "high")), (np.abs(x - np.median(x)), ("middle", "ends"))):
        if np.ptp(values) > 0.0:
            test = mannwhitneyu(values[failed], values[~failed])
            # U counts the pairs in which the failed one is the larger
            above = test.statistic > 0.5 * failed.sum() * (~failed).sum()
            found.append((float(test.pvalue), names[int(above)]))
    p, more = min(found)
    return {
        "test": "Mann-Whitney",
        "p": min(1.0, TESTS * p),
        "more": more,
        "failed": [float(x[failed].min()), float(x[failed].max())],
        "done": [float(x[~failed].min()), float(x[~failed].max())],
    }


def _words(column: NDArray[Any], failed: NDArray[np.bool_]) -> dict[str, Any]:
    from scipy.stats import chi2_contingency, fisher_exact

    words = list(dict.fromkeys(column.tolist()))
    table = np.array([[int((failed & (column == w)).sum()), int((~failed & (column == w)).sum())] for w in words])
    exact = len(words) == 2
    p = fisher_exact(table).pvalue if exact else chi2_contingency(table).pvalue
    return {
        "test": "Fisher's exact" if exact else "chi-squared",
        "p": float(p),
        "more": words[int(np.argmax(table[:, 0] / table.sum(axis=1)))],
        "failed": sorted({str(w) for w in column[failed]}),
        "done": sorted({str(w) for w in column[~failed]}),
    }


def sentence(rows: Sequence[Mapping[str, Any]]) -> str:
    """Along which axes the failed cases are not at random, in words; empty where no test says so."""
    sentences = [f"{_share(row)} (p = {row['p']:.2g}, {row['test']})" for row in rows if row["differs"]]
    if not sentences:
        return ""
    where = "; ".join(sentences)
    return f"Failures are not at random: they are more frequent {where}; the cases that are done are a selection"


def _share(row: Mapping[str, Any]) -> str:
    where = {"low": "at low", "high": "at high", "ends": "at both ends of", "middle": "in the middle of"}
    if row["test"] != "Mann-Whitney":
        return f"at {row['axis']} {row['more']}"
    low, high = row["failed"]
    return f"{where[row['more']]} {row['axis']} ({low:.4g} to {high:.4g})"
