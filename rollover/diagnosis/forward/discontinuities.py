"""Compiled: jumps of a prediction from one sample to the next, and what is forgiven about them.

On which side of a jump a sample lies is decided by clocks, not by physics.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ground.compiled import compiled, leaf
from rollover.diagnosis.settings import SETTINGS

DISCONTINUITY_IN = (
    "leap in "  # before the name of a channel: how far it jumps about each sample, or within each mean, SI
)
TUNING = SETTINGS.forward.discontinuities
# compiled functions read globals
DISCONTINUITY = TUNING.sample_ratio
WITHIN = TUNING.mean_ratio
SHOWS = TUNING.visible_step  # times the noise, from which on a step may be a jump
LARGE = TUNING.large_jump  # times the noise: a jump whose instant is not believed to the sample
BESIDE = TUNING.samples_to_side  # samples to either side, between whose values one about a jump may be


@compiled
def near_discontinuity(y: Any, least: Any, first: Any, last: Any) -> Any:
    """Whether a stack y (n,) jumps about each sample, over two samples by more than `least` (n,) from the first.

    `first` and `last` (n,) are the ends of the signal of each sample.
    """
    found = np.zeros(y.size, dtype=np.bool_)
    for i in range(y.size - 2):
        discontinuity = abs(y[i + 2] - y[i])
        if discontinuity > least[i]:
            before = abs(y[i] - y[i - 1]) if i > first[i] else 0.0
            after = abs(y[i + 3] - y[i + 2]) if i + 2 < last[i] else 0.0
            if discontinuity > DISCONTINUITY * max(before, after):
                # when a body lifts off again hangs on little
                more = 2 if discontinuity > LARGE / SHOWS * least[i] else 0
                found[max(i - more, first[i]) : min(i + 2 + more, last[i]) + 1] = True
    return found


@compiled
def largest_jumps_nearby(times: Any, jumps: Any, sizes: Any, columns: Any) -> Any:
    """How far some `columns` (c,) jump between each of `times` (n,) and those beside it, the most, (c, n).

    They do at instants (j,) by `sizes` (j, k).
    """
    found = np.zeros((columns.size, times.size))
    for j in range(jumps.size):
        after = np.searchsorted(times, jumps[j])
        for i in range(max(after - 1, 0), min(after + 1, times.size)):
            for c in range(columns.size):
                found[c, i] = max(found[c, i], abs(sizes[j, columns[c]]))
    return found


@leaf
def within_means(values: Any, mean: Any, sizes: Any) -> None:
    """How far values (n,) jump within or beside each mean, into sizes (m,); `mean` (n,) is that of each value."""
    sizes[:] = 0.0
    last = values.size - 1
    for k in range(last):
        step = abs(values[k + 1] - values[k])
        before = abs(values[k] - values[k - 1]) if k > 0 else 0.0
        after = abs(values[k + 2] - values[k + 1]) if k + 1 < last else 0.0
        if step > WITHIN * max(before, after):
            sizes[mean[k]] = max(sizes[mean[k]], step)
            sizes[mean[k + 1]] = max(sizes[mean[k + 1]], step)


@compiled
def weights_after_discontinuities(discontinuities: Any, last: Any, orders: Any, gains: Any) -> Any:
    """Weights (n,) of whitened samples: those after jumps, as many as the noise remembers, have `gains`, all others 1.

    A jump itself counts in full. `last`, `orders` (how many) and `gains` (n,) are those of the signal of each sample.
    """
    found = np.ones(last.size)
    for i in discontinuities:
        found[i + 1 : min(i + orders[i], last[i]) + 1] = gains[i]
    for i in discontinuities:
        found[i] = 1.0
    return found


@compiled
def masked(y: Any, discontinuities: Any, measured: Any, first: Any, last: Any) -> Any:
    """A stack y (n,) whose samples about `discontinuities` are moved towards the measured within their neighbours."""
    found = y.copy()
    for i in discontinuities:
        near = y[max(i - BESIDE, first[i]) : min(i + BESIDE, last[i]) + 1]
        found[i] = min(max(measured[i], near.min()), near.max())
    return found
