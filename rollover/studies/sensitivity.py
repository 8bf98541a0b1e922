"""Sensitivity of an output to the axes: Sobol and Morris indices with intervals. The only SALib home."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
TAIL = 0.01  # Morris' lowest and highest level are these quantiles: a normal has no value at 0 and 1
RESAMPLES = 1000  # of the bootstrap behind an interval


def sobol_sample(d: int, count: int, seed: int) -> Array:
    """Saltelli's points (count (d + 2), d) in [0, 1]: first and total indices, no second ones."""
    from SALib.sample import sobol

    return np.asarray(sobol.sample(_problem(d), count, calc_second_order=False, scramble=True, seed=seed))


def morris_sample(d: int, count: int, levels: int, seed: int) -> Array:
    """Trajectories (count (d + 1), d), from the 1st to the 99th percentile."""
    from SALib.sample import morris

    u = np.asarray(morris.sample(_problem(d), count, num_levels=levels, seed=seed))
    return TAIL + (1.0 - 2.0 * TAIL) * u


def sobol_indices(y: Array, d: int, confidence: float, seed: int) -> list[dict[str, Any]]:
    """First and total index of each axis with half-widths of their bootstrap intervals, from (n (d + 2),) values.

    A base point with a value missing (NaN) is left out with all that belongs to it; `base` says how many are left.
    """
    from SALib.analyze import sobol

    blocks = y.reshape(-1, d + 2)
    whole = blocks[np.isfinite(blocks).all(axis=1)]
    if len(whole) < 2 or np.ptp(whole) == 0.0:
        return []
    found = sobol.analyze(
        _problem(d), whole.ravel(), calc_second_order=False, num_resamples=RESAMPLES, conf_level=confidence, seed=seed
    )
    return [
        {
            "first": float(found["S1"][j]),
            "first_half_width": float(found["S1_conf"][j]),
            "total": float(found["ST"][j]),
            "total_half_width": float(found["ST_conf"][j]),
            "base": len(whole),
        }
        for j in range(d)
    ]


def morris_effects(u: Array, y: Array, levels: int, confidence: float, seed: int) -> list[dict[str, Any]]:
    """Mean, mean magnitude (with half-width) and spread of the elementary effects of each axis.

    In units of the output per whole range of u; trajectories with a value missing (NaN) are left out.
    """
    from SALib.analyze import morris

    d = u.shape[1]
    blocks = y.reshape(-1, d + 1)
    keep = np.isfinite(blocks).all(axis=1)
    if keep.sum() < 2:
        return []
    x = ((u - TAIL) / (1.0 - 2.0 * TAIL)).reshape(-1, d + 1, d)[keep].reshape(-1, d)
    found = morris.analyze(
        _problem(d),
        x,
        blocks[keep].ravel(),
        num_resamples=RESAMPLES,
        conf_level=confidence,
        num_levels=levels,
        seed=seed,
    )
    return [
        {
            "mean": float(found["mu"][j]),
            "magnitude": float(found["mu_star"][j]),
            "magnitude_half_width": float(found["mu_star_conf"][j]),
            "spread": float(found["sigma"][j]),
            "trajectories": int(keep.sum()),
        }
        for j in range(d)
    ]


def rank_correlations(columns: list[Array], y: Array, confidence: float) -> list[dict[str, Any]]:
    """Spearman's correlation of each axis with the output, interval by Fisher's z with sd sqrt((1 + r^2/2)/(n - 3)).

    Bonett and Wright 2000 for the variance (recalled, high confidence). Nothing for fewer than ten values.
    """
    from scipy.special import ndtri
    from scipy.stats import rankdata

    good = np.isfinite(y)
    n = int(good.sum())
    if n < 10:
        return []
    ranks = rankdata(y[good])
    found = []
    for column in columns:
        mine = rankdata(column[good])
        flat = np.ptp(mine) == 0.0 or np.ptp(ranks) == 0.0
        r = 0.0 if flat else float(np.corrcoef(mine, ranks)[0, 1])
        z = np.arctanh(np.clip(r, -1.0 + 1e-12, 1.0 - 1e-12))
        half = float(ndtri(0.5 + 0.5 * confidence)) * np.sqrt((1.0 + 0.5 * r * r) / (n - 3))
        found.append({"correlation": r, "low": float(np.tanh(z - half)), "high": float(np.tanh(z + half)), "cases": n})
    return found


def _problem(d: int) -> dict[str, Any]:
    return {"num_vars": d, "names": [f"x{j}" for j in range(d)], "bounds": [[0.0, 1.0]] * d}
