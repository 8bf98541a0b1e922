"""The way down first: what acts only behind the deepest point is no reason for what is seen before it.

Where much is missing on the way back, as of ground that springs, no effect of the way down meets a recording well, and
one that meets neither may lead. Up to the deepest point it is out of sight. What bounces comes down again at other
times with another spring, and fits to several such impacts end at the wrong ones: the first rise comes before them, and
before what holds the face as it lifts off comes what it springs back by.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.data.phases import PEAK
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted
from rollover.diagnosis.fit.step import Inquiry, Step
from rollover.diagnosis.fit.tasks import Task
from rollover.diagnosis.fit.time_shift import estimate_time_shifts
from rollover.diagnosis.noise.truncation import up_to
from rollover.diagnosis.selection.pairs import is_better
from rollover.diagnosis.selection.stepwise import Taken, forward_selection
from rollover.diagnosis.settings import SETTINGS

TUNING = SETTINGS.selection.truncated_start
# of the time to the deepest point: before it, as the ground springs back, and before what bounces comes down again
TRUNCATIONS = (1.0 - SETTINGS.data.phases.around_peak, *TUNING.later_truncations)


def loading_first(inquiry: Inquiry, found: Taken) -> Taken:
    """What was found, or a better one begun with what explains the way down alone; only where much is left."""
    problem, base = inquiry.problem, found.base
    if problem.effort.is_ensemble or found.fitted.chi2 < SETTINGS.selection.stepwise.hopeless**2 * found.count:
        return found
    if rebound_residual(inquiry, base) < TUNING.least_share * (found.fitted.chi2 - found.count):
        return found  # it came to rest as the simulation does, wherever that was
    steps: Sequence[Step] = ()
    for end in TRUNCATIONS:
        above = _until(inquiry, end, steps)
        if (
            above is None
            or not above.steps
            or above.fitted.chi2 > SETTINGS.selection.forward_step.nearly_noise**2 * above.count
        ):
            break
        steps = above.steps
    begun, held = _extended_to_end(inquiry, base, steps), problem.dataset
    if not begun:
        return found
    other = forward_selection(inquiry, base, begun)
    if is_better(other.fitted, other.after, found.fitted):
        return other
    problem.with_noise_model(held)
    return found


def rebound_residual(inquiry: Inquiry, base: Fitted) -> float:
    """What a fit leaves beyond the noise where both it and the recordings are past the deepest point, about its mean.

    Ground that holds what fell into it leaves an offset there, whatever is missing on the way down. Infinite where
    nothing was recorded there.
    """
    found, count = 0.0, 0
    for e, block, phases in zip(inquiry.problem.dataset, base.blocks, inquiry.phases, strict=True):
        depth = e.simulator.state(block.shift).get("ground/sinkage")
        peaks = [start for start, name in phases if name == PEAK]
        if depth is None or not peaks:
            return np.inf
        own = float(e.recording.time[int(np.argmax(depth >= TUNING.deepest * depth.max()))])
        rest = TUNING.rest * max(peaks[0] / (1.0 - SETTINGS.data.phases.around_peak), own)
        for signal, part in e.spans():
            late = block.unweighted_residual[part][e.recording.time[signal.rows] > rest]
            if late.size:
                found, count = found + float(np.sum((late - late.mean()) ** 2)) - late.size, count + late.size
    return found if count else np.inf


def _until(inquiry: Inquiry, end: float, steps: Sequence[Step]) -> Taken | None:
    """What explains recordings up to an end, of the time to the deepest point, going on from steps; None if nothing."""
    some = [_cut(e, phases, end) for e, phases in zip(inquiry.problem.dataset, inquiry.phases, strict=True)]
    early = Problem([e for e in some if e is not None])
    if len(early.dataset) < len(some):
        return None
    inquiry.say(f"up to {end:g} of the way down first")
    estimate_time_shifts(early)
    no_jacobian, above = early.fit((), ()), replace(inquiry, problem=early)
    found = (
        forward_selection(above, no_jacobian, _extended_to_end(above, no_jacobian, steps), pairs=False)
        if no_jacobian is not None
        else None
    )
    inquiry.problem.simulations += early.simulations
    return found


def _cut(e: Dataset, phases: Sequence[tuple[float, str]], end: float) -> Dataset | None:
    """What was recorded before an end; None where a signal has too little of it."""
    peaks = [start for start, name in phases if name == PEAK]
    if not peaks:
        return None
    return up_to(e, end * peaks[0] / (1.0 - SETTINGS.data.phases.around_peak), TUNING.filter_ahead)


def _extended_to_end(inquiry: Inquiry, base: Fitted, steps: Sequence[Step]) -> list[Step]:
    """The steps with their best and nearest rivals fitted over the whole way, each beside the one before."""
    made: list[Step] = []
    beside = base
    for s in steps:
        near = [s.fitted, *sorted((f for f in s.rivals if f is not s.fitted), key=lambda f: f.chi2)[: TUNING.rivals]]
        tasks = [Task(candidates=f.candidates, start=f.x, shifts=tuple(b.shift for b in f.blocks)) for f in near]
        best, *rivals = inquiry.fits(tasks)
        if best is None:
            return []
        others = tuple(f for f in rivals if f is not None)
        made.append(replace(s, base=beside, fitted=best, rivals=(best, *others)))
        beside = best
    return made
