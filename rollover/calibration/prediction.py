"""How far the fitted values leave a simulated curve open: their covariance carried to it by secants of one sigma."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from rollover.calibration.calibrate import Calibration, Estimate
from rollover.scenario import Scenario
from rollover.system.numbers import Z95

Array = NDArray[np.float64]
K = TypeVar("K", bound=Hashable)


def prediction_error(found: Calibration, curves: Callable[[Scenario], Mapping[K, Array]]) -> dict[K, Array]:
    """One sigma (n,) of each curve of the calibrated scenario, by what the fitted values leave open.

    sqrt(d' C d) sample by sample, C (p, p) the correlation of the estimates and d_i what one sigma of value i adds to
    the curve, by a secant that long: first order in the values (GUM 2008, 5.2, recalled). A value goes to the side of
    its range that has more room, and no further than its end. `curves` gives curves (n,) of a scenario by any key; one
    that some scenario does not have, or with another number of samples, is left out.
    """
    at = found.calibrated
    base = dict(curves(at))
    moved: list[dict[K, Array]] = []
    for e in found.estimates:
        step = _step(e)
        other = curves(at.replaced({e.path: e.value + step})) if step else base
        share = _sigma(e) / step if step else 0.0
        moved.append({k: share * (other[k] - base[k]) for k in base if k in other and other[k].shape == base[k].shape})
    there = [k for k in base if all(k in one for one in moved)]
    errors = {}
    for k in there if moved else []:
        d = np.stack([one[k] for one in moved])
        errors[k] = np.sqrt(np.maximum(np.einsum("in,ij,jn->n", d, found.correlation, d), 0.0))
    return errors


def _sigma(e: Estimate) -> float:
    return (e.high - e.low) / (2.0 * Z95)


def _step(e: Estimate) -> float:
    """By how much a value is changed: one sigma towards the farther end of its range."""
    low, high = e.bounds
    up, down = high - e.value, e.value - low
    return min(_sigma(e), up) if up >= down else -min(_sigma(e), down)
