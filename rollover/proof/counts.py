"""Counting: shares with exact intervals, medians."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

Row = Mapping[str, Any]


def share(hits: int, of: int, level: float = 0.95) -> dict[str, Any]:
    """Share with its exact binomial (Clopper-Pearson) interval; None of none."""
    if of == 0:
        return {"hits": 0, "of": 0, "share": None, "low": None, "high": None}
    from scipy.stats import beta

    tail = 0.5 * (1.0 - level)
    low = float(beta.ppf(tail, hits, of - hits + 1)) if hits else 0.0
    high = float(beta.ppf(1.0 - tail, hits + 1, of - hits)) if hits < of else 1.0
    return {"hits": hits, "of": of, "share": hits / of, "low": low, "high": high}


def counted(rows: Iterable[Row], key: str) -> dict[str, Any]:
    """Share of the rows whose `key` is true, of those where it applies."""
    applies = [bool(row[key]) for row in rows if row[key] is not None]
    return share(sum(applies), len(applies))


def mean(values: Sequence[float]) -> float | None:
    """Mean; None of none."""
    return float(np.mean(values)) if values else None


def median(values: Sequence[float]) -> float | None:
    """Median; None of none."""
    return float(np.median(values)) if values else None


def quantile(values: Sequence[float], at: float) -> float | None:
    """Quantile; None of none."""
    return float(np.quantile(values, at)) if values else None
