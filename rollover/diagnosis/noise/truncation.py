"""What comes long after an impact: the end of a long recording costs most of a run.

Where it hardly counts it is left aside, and looks at many candidates do without it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.settings import SETTINGS

TUNING = SETTINGS.noise.truncation


def shortened(e: Dataset, *, alone: bool = False) -> Dataset:
    """The dataset without its end, where that counts little: long after an impact perturbed runs differ as effects do.

    As it is where samples are not weighed, and where the end counts or differs by more than chance does. Of a recording
    that is `alone` nothing after the impact is kept: whether an effect or another course of the run did it, only a
    second one could tell.
    """
    time, end = e.recording.time, e.first_impact + (0.0 if alone else TUNING.retained_after_impact)
    if not time[-1] > end + TUNING.least_cut:
        return e
    late = np.concatenate([time[s.rows] > end for s in e.signals])
    if not alone and (float(np.mean(e.due[late])) > TUNING.least_weight or _differs(e, late)):
        return e
    return up_to(e, end) or e


def shortly_after_impact(e: Dataset) -> Dataset:
    """The dataset up to `retained_after_impact` after the simulated and the recorded impact; itself if no longer.

    What happens later hangs on what happened until then. The recording's is when half of its channels have gone half of
    their range.
    """
    time = e.recording.time
    gone = [time[s.rows[np.argmax(2.0 * np.abs(s.values - s.values[0]) >= np.ptp(s.values))]] for s in e.signals]
    end = max(e.first_impact, float(np.median(gone))) + TUNING.retained_after_impact
    return (up_to(e, end) or e) if time[-1] > end + TUNING.least_cut else e


def up_to(e: Dataset, end: float, beyond: float = 0.0) -> Dataset | None:
    """What was recorded up to an end (s); None where a signal has too little of it.

    Its runs go on for `beyond` (s): a filter looks ahead.
    """
    time = e.recording.time
    retained = [time[s.rows] <= end for s in e.signals]
    if any(rows.sum() < TUNING.least_samples for rows in retained):
        return None
    n = int(np.searchsorted(time, end + beyond, side="right"))
    return replace(e.cut(retained), recording=e.recording.until(n), simulator=e.simulator.until(n))


def _differs(e: Dataset, late: NDArray[np.bool_]) -> bool:
    """Whether the scenario as it is misses an end by more than noise and scatter do."""
    predicted = e.simulator.predict({}, 0.0)
    if predicted is None:
        return False
    missed = (e.measured() - e.stacked(predicted))[late]
    return float(missed @ missed) > TUNING.least_misfit * e.by_chance(late)


def truncation_notes(every: Sequence[Dataset], found: Sequence[Dataset]) -> list[str]:
    """The ends of recordings that do not count, in sentences."""
    last_stamps = {e.name: float(e.recording.time[-1]) for e in every}
    cut = [(e.name, float(e.recording.time[-1])) for e in found if float(e.recording.time[-1]) < last_stamps[e.name]]
    return [f"{name}: what comes after {at:.2f} s is chaotic and was excluded" for name, at in cut]
