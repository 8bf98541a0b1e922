"""Nodes of a height map that stand for no height: what writers of maps put where nothing was measured."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# m: the lowest dry land lies at -430 (Dead Sea), the highest at 8849: -9999, -32768, 9999, 1e20, -3.4e38 are none
LOWEST, HIGHEST = -500.0, 9000.0


def missing(heights: Array, spacing: tuple[float, float], steepest: float) -> tuple[int, int, str] | None:
    """Row and column (from 0) of the first node of a map (nx, ny) that holds no height, and why; None if all do.

    Besides what is no number and no height of any land, values on one side of a gap that is wider than the map is
    long: one step of it would rise by more than 45 degrees over all of the map. And values that are written as nines
    (-99, 999), where the gap is wider than the range of all others and no face of `steepest` (degrees) spans it.
    """
    wrong = ~np.isfinite(heights)
    if wrong.any():
        return _at(heights, wrong, "is no number")
    wrong = (heights < LOWEST) | (heights > HIGHEST)
    if wrong.any():
        return _at(heights, wrong, f"lies beyond all land ({LOWEST:g} to {HIGHEST:g} m)")
    far, gap = _apart(heights)
    if far is None:
        return None
    widest = max((n - 1) * d for n, d in zip(heights.shape, spacing, strict=True))
    if gap > widest:
        return _at(heights, far, f"lies {gap:.4g} m off the nearest of the others, and the map is {widest:.4g} m wide")
    others = heights[~far]
    is_steep = gap > math.tan(math.radians(steepest)) * max(spacing)
    if _is_nines(heights[far]) and gap > float(np.ptp(others)) and is_steep:
        return _at(heights, far, f"lies {gap:.4g} m off the others, which differ by {float(np.ptp(others)):.4g} m")
    return None


def _apart(heights: Array) -> tuple[NDArray[np.bool_] | None, float]:
    """Nodes on one side of the widest gap between the values, and the gap: those of one value, else the fewer."""
    values = np.unique(heights)
    if values.size < 2:
        return None, 0.0
    k = int(np.argmax(np.diff(values)))
    low = heights <= values[k]
    low_is_one, high_is_one = k == 0, k == values.size - 2
    few = int(low.sum()) - int((~low).sum())
    if low_is_one == high_is_one and few == 0:
        return None, 0.0  # two halves: nothing tells which is the ground
    is_low = low_is_one if low_is_one != high_is_one else few < 0
    return (low if is_low else ~low), float(values[k + 1] - values[k])


def _is_nines(values: Array) -> bool:
    """Whether all are one value of two nines or more: -99, 999, -99.99."""
    digits = f"{abs(float(values.flat[0])):g}".replace(".", "")
    return bool(np.all(values == values.flat[0])) and len(digits) > 1 and set(digits) == {"9"}


def _at(heights: Array, wrong: NDArray[np.bool_], why: str) -> tuple[int, int, str]:
    i, j = (int(k) for k in np.argwhere(wrong)[0])
    count, others = int(wrong.sum()), heights[~wrong]
    between = f", all others between {others.min():.6g} and {others.max():.6g} m" if others.size else ""
    many = f" (one of {count} such nodes{between})" if count > 1 else f" (the only one{between})" if between else ""
    return i, j, f"{heights[i, j]:.7g}, which {why}{many}"
