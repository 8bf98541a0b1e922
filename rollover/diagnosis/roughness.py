"""How far a parameter may lie where the misfit of runs is rough: a parabola through many places, not slopes at one.

Runs that scatter leave a misfit that differs from place to place by chance. The place that a fit ended at is the lowest
of all that were tried, and slopes there are those of its dip. At t = +-1, +-2, ... on either side of it, 1 the half
width of an interval by these slopes, the misfit is met by

    q(t) = a + b t + c t^2, with s the standard deviation of what that leaves                                  (R1)

over more and more places until the parabola shows over the roughness, c R^2 > `CLEAR` s. Its least is at -b/2c, told to
s times what least squares make of it, and it rises by what is due within sqrt(due/c). The fit itself tells nothing: it
was chosen for being low.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
STAGES = ((1.0, 2.0, 3.0, 4.0), (6.0, 8.0), (12.0, 16.0), (24.0, 32.0))  # places on either side, the nearest first
CLEAR = 4.0  # times the roughness, by which a parabola rises to the last place
FEWEST = 6  # places that tell one
STEEPER, LEAP = 4.0, 10.0  # times what slopes foretell, and what is due: beyond both a run took another course
BEYOND = 1.5  # below which an interval that is too narrow is chance
TWO_SIDED = 1.96

Misfits = Callable[[Sequence[float]], list[float | None]]  # what is left at places t; None where nothing can be


def over_roughness(misfits: Misfits, due: float) -> tuple[float, float]:
    """How far (t, down and up, each at least 1) a misfit stays within `due` of its least, by (R1).

    1 both where no parabola shows: how steep the misfit is there cannot be told.
    """
    met: list[tuple[float, float]] = []
    for stage in STAGES:
        places = [side * at for at in stage for side in (-1.0, 1.0)]
        met += [(at, left) for at, left in zip(places, misfits(places), strict=True) if left is not None]
        least = min((left for _, left in met), default=0.0)
        kept = [(at, left - least) for at, left in met if left - least < STEEPER * due * at**2 + LEAP * due]
        if len(kept) < FEWEST:
            continue
        t, left = np.array(kept).T
        X = np.stack([np.ones(t.size), t, t**2], axis=1)
        best = np.linalg.lstsq(X, left, rcond=None)[0]
        _, b, c = best
        rough = float(np.sqrt(np.sum((left - X @ best) ** 2) / (t.size - 3)))
        if c * stage[-1] ** 2 > CLEAR * rough:
            middle = -0.5 * b / c
            slope = np.array([0.0, -0.5 / c, 0.5 * b / c**2])  # of that in a, b, c
            told = rough * float(np.sqrt(slope @ np.linalg.inv(X.T @ X) @ slope))
            half = float(np.hypot(np.sqrt(due / c), TWO_SIDED * told))
            down, up = (far if far > BEYOND else 1.0 for far in (half - middle, half + middle))
            return down, up
    return 1.0, 1.0
