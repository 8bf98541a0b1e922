"""Forward selection: one effect after another, each beside those before it, as long as they gain more than chance.

Where much is missing on the way back, as of ground that springs, selection begins with loading alone: no effect of the
loading meets a recording well, and one that meets neither may lead. Up to the deepest point the way back is out of
sight, and what acts only there is no reason for what is seen before it. What bounces comes down again at other times
with another spring, and fits to several such impacts end at the wrong ones: the first rise comes before them, and
before what holds the face as it lifts off comes what it springs back by.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeGuard

import numpy as np

from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.data.phases import PEAK, Phases
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted
from rollover.diagnosis.fit.local_search import with_time_shift_search
from rollover.diagnosis.fit.step import Inquiry, Step
from rollover.diagnosis.fit.tasks import Task
from rollover.diagnosis.fit.time_shift import estimate_time_shifts, is_explained_by_clocks
from rollover.diagnosis.inference.lack_of_fit import Mismatch, is_enough, is_tolerated, mismatch_of
from rollover.diagnosis.noise.ensemble import has_diverged
from rollover.diagnosis.noise.truncation import up_to
from rollover.diagnosis.selection.ensemble_validation import (
    ensemble_validated,
    restarted_base,
    with_full_weights,
    without_unsupported_rivals,
)
from rollover.diagnosis.selection.explanation import with_conditions_refitted
from rollover.diagnosis.selection.forward_step import largest_change, size_of_effect, step, with_noise_of_fit
from rollover.diagnosis.selection.pairs import best_subsets, is_better, with_first_exchanged
from rollover.diagnosis.selection.score_test import ScoreTest
from rollover.diagnosis.selection.screening import rescored, score_candidates
from rollover.diagnosis.selection.simplification import followed, is_over_flexible
from rollover.diagnosis.settings import SETTINGS

TUNING = SETTINGS.selection.stepwise
TRUNCATED = SETTINGS.selection.truncated_start
# of the time to the deepest point: before it, as the ground springs back, and before what bounces comes down again
TRUNCATIONS = (1.0 - SETTINGS.data.phases.around_peak, *TRUNCATED.later_truncations)


@dataclass(frozen=True, kw_only=True)
class Taken:
    """The base, the steps taken beside it, the fit with all of them (the base itself if none), and what it leaves.

    `first` is the first step, taken or not; `at_first` what all candidates scored beside the base, `scored` beside the
    last fit; `refuted` whether the best candidate's gain did not outlast the scatter of its own runs; `paired` whether
    all were tried two by two.
    """

    base: Fitted
    steps: tuple[Step, ...]
    fitted: Fitted
    before: Mismatch
    after: Mismatch
    first: Step | None
    at_first: ScoreTest
    scored: ScoreTest
    refuted: bool = False
    paired: bool = False

    @property
    def count(self) -> int:
        """Number of samples."""
        return sum(b.residual.size for b in self.base.blocks)


def forward_selection(inquiry: Inquiry, base: Fitted, begun: Sequence[Step] = (), *, pairs: bool = True) -> Taken:
    """Up to three effects, one after another beside the base; it goes on from the steps `begun`, if any.

    Two that leave more than noise are given for the best of all `pairs`, if these are to be tried.
    """
    problem, candidates, groups, phases = inquiry.problem, inquiry.candidates, inquiry.groups, inquiry.phases
    parallel_map = inquiry.executor.parallel_map
    count = sum(b.residual.size for b in base.blocks)
    base, before = _begun(inquiry, base)
    inquiry.say(f"looking at {len(candidates)} candidates, which of them could matter")
    scored = first_scored = score_candidates(problem, base, candidates, groups, parallel_map=parallel_map)

    def beside(fitted: Fitted, mismatch: Mismatch) -> ScoreTest:
        known = base if is_enough(problem, fitted, mismatch) else None
        return rescored(problem, fitted, known, inquiry.free(fitted), groups, first_scored, parallel_map)

    current, mismatch = base, before
    taken = list(begun)
    first = taken[0] if taken else None
    if taken:
        current = taken[-1].fitted
        mismatch = mismatch_of(problem.dataset, current.blocks, phases)
        scored = beside(current, mismatch)
    refuted = paired = False
    for _ in range(SETTINGS.selection.flexibility.most_effects - len(begun)):
        if _is_explained(inquiry, taken, current, mismatch, scored):
            break
        tried = step(inquiry, current, scored)
        first = first or tried
        if not is_beyond_chance(tried, problem, phases):
            break
        found = validated_step(inquiry, tried, scored)
        if found is None and not taken:
            found = with_other_weighting(inquiry, current)
            first = found or first
        if found is None:
            refuted = not taken
            break
        found, mismatch = with_conditions_refitted(problem, *followed(inquiry, found), phases)
        taken.append(found)
        current = found.fitted
        if not problem.heavy_tailed:
            current = with_full_weights(problem, current)
            mismatch = mismatch_of(problem.dataset, current.blocks, phases)
        if len(taken) == 2 and not is_enough(problem, current, mismatch):
            paired = pairs and not problem.effort.is_ensemble
            is_near = current.chi2 - count < TUNING.hopeless_share * (base.chi2 - count)
            other = _other_two(inquiry, taken, current, first_scored if paired else None, is_near=is_near)
            if other is not None:
                (taken, mismatch), current = other, other[0][-1].fitted
        if _is_lost(problem, base, taken, current):
            break
        scored = beside(current, mismatch)
    if not problem.heavy_tailed:
        problem.heavy_tailed, current = True, problem.again(current)
        mismatch = mismatch_of(problem.dataset, current.blocks, phases)
    return Taken(
        base=base,
        steps=tuple(taken),
        fitted=current,
        before=before,
        after=mismatch,
        first=first,
        at_first=first_scored,
        scored=scored,
        refuted=refuted,
        paired=paired,
    )


def _begun(inquiry: Inquiry, base: Fitted) -> tuple[Fitted, Mismatch]:
    """The base with its clocks where they fit, its noise and weights, and what it leaves."""
    problem, phases = inquiry.problem, inquiry.phases
    clocked = restarted_base if problem.effort.is_ensemble else with_time_shift_search
    base = clocked(problem, base)  # what a clock leaves is no noise,
    if with_noise_of_fit(problem, base, phases):
        base = problem.again(base)
    base = clocked(problem, base)  # and no effect's gain
    before = mismatch_of(problem.dataset, base.blocks, phases)
    return with_full_weights(problem, base), before


def _is_explained(
    inquiry: Inquiry, taken: Sequence[Step], current: Fitted, mismatch: Mismatch, scored: ScoreTest
) -> bool:
    """Whether nothing more is asked for: what is left is tolerated, is noise, or is the clocks' alone."""
    problem = inquiry.problem
    if is_tolerated(problem, current):
        return True
    if scored.p_value() > TUNING.admitting_p_value and is_enough(problem, current, mismatch):
        return True
    is_first = not taken and not problem.effort.is_ensemble
    return is_first and is_explained_by_clocks(problem, current, inquiry.executor.parallel_map)


def _other_two(
    inquiry: Inquiry, taken: Sequence[Step], current: Fitted, at_first: ScoreTest | None, *, is_near: bool
) -> tuple[list[Step], Mismatch] | None:
    """Another two effects: the best of all pairs by their scores `at_first`, or, if `is_near`, the first one exchanged.

    Of two that are strong the first may have been taken for something else.
    """
    if at_first is not None:
        return best_subsets(inquiry, taken, at_first, current)
    return with_first_exchanged(inquiry, taken, current) if inquiry.problem.effort.is_ensemble and is_near else None


def _is_lost(problem: Problem, base: Fitted, taken: Sequence[Step], current: Fitted) -> bool:
    """Whether no further effect would make an explanation of what was taken."""
    if len(taken) > 1 and (is_hopeless(problem, base, current) or is_third_unlikely(problem, taken[-1], current)):
        return True
    return is_over_flexible(current.effects)


def is_hopeless(problem: Problem, base: Fitted, current: Fitted) -> bool:
    """Whether two effects leave far more than noise, and no small part of what there was beyond it."""
    count, hardly_any = sum(b.residual.size for b in current.blocks), TUNING.little_noise[problem.effort.is_ensemble]
    return current.chi2 > TUNING.hopeless**2 * count and current.chi2 - count > hardly_any * (base.chi2 - count)


def is_third_unlikely(problem: Problem, last: Step, current: Fitted) -> bool:
    """Whether a third effect, of drops, would have to take far more than the second did for nothing to be left."""
    beyond = current.chi2 - sum(b.residual.size for b in current.blocks)
    return not problem.effort.is_ensemble and beyond > TUNING.no_third_above * max(last.base.chi2 - current.chi2, 0.0)


def is_beyond_chance(found: Step | None, problem: Problem, phases: Phases) -> TypeGuard[Step]:
    """Whether a step gains more than the best of all candidates does by chance, and moves something by it.

    An effect that moves things itself is none to be left out because others can be bent to nearly all of it, nor is a
    part of what is not negligible as a whole. Where runs scatter, slopes say less than the fits do: what is missing for
    sure is looked for though the best slopes could be chance.
    """
    if found is None or found.p_value > (
        TUNING.admitting_p_value_runs if problem.effort.is_ensemble else TUNING.admitting_p_value
    ):
        return False
    if found.p_value > TUNING.admitting_p_value and not leaves_mismatch(found.base, problem, phases):
        return False
    moved = largest_change(problem, found.base, found.fitted)
    if (
        moved >= SETTINGS.inference.adequacy.negligible
        or moved < TUNING.negligible_share * SETTINGS.inference.adequacy.negligible
        or problem.effort.is_ensemble
    ):
        return moved >= SETTINGS.inference.adequacy.negligible
    if found.base.effects and size_of_effect(problem, found.fitted) >= SETTINGS.inference.adequacy.negligible:
        return True
    return leaves_mismatch(found.base, problem, phases)


def leaves_mismatch(fitted: Fitted, problem: Problem, phases: Phases) -> bool:
    """Whether a fit surely leaves something that matters."""
    return not is_enough(problem, fitted, mismatch_of(problem.dataset, fitted.blocks, phases))


def validated_step(inquiry: Inquiry, found: Step, scored: ScoreTest) -> Step | None:
    """A step as it is to be taken; None where runs scatter and its gain does not outlast that."""
    problem = inquiry.problem
    spoken = (
        SETTINGS.selection.ensemble_validation.own_p_value
        if found.p_value <= TUNING.admitting_p_value
        else TUNING.admitting_p_value_runs
    )  # what admitted the step speaks for its best
    return (
        ensemble_validated(problem, without_unsupported_rivals(found, scored, spoken), inquiry.groups)
        if problem.effort.is_ensemble
        else found
    )


def with_other_weighting(inquiry: Inquiry, current: Fitted) -> Step | None:
    """A step with diverged recordings in full where they were weighted down, or weighted down; None if none.

    Chance could have sent several there, but so could what is missing; and where they went there may hide what shows
    before. If nothing lasts they are counted as they were.
    """
    problem = inquiry.problem
    before = problem.heavy_tailed
    if before and sum(has_diverged(b.heavy_tail) for b in current.blocks) < TUNING.most_diverged:
        return None
    problem.heavy_tailed = not before
    base = problem.again(current)
    scored = score_candidates(problem, base, inquiry.candidates, inquiry.groups)
    tried = step(inquiry, base, scored)
    found = validated_step(inquiry, tried, scored) if is_beyond_chance(tried, problem, inquiry.phases) else None
    if found is None:
        problem.heavy_tailed = before
    return found


def loading_first(inquiry: Inquiry, found: Taken) -> Taken:
    """What was found, or a better one begun with what explains the way down alone; only where much is left."""
    problem, base = inquiry.problem, found.base
    if problem.effort.is_ensemble or found.fitted.chi2 < SETTINGS.selection.stepwise.hopeless**2 * found.count:
        return found
    if rebound_residual(inquiry, base) < TRUNCATED.least_share * (found.fitted.chi2 - found.count):
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
        own = float(e.recording.time[int(np.argmax(depth >= TRUNCATED.deepest * depth.max()))])
        rest = TRUNCATED.rest * max(peaks[0] / (1.0 - SETTINGS.data.phases.around_peak), own)
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
    return up_to(e, end * peaks[0] / (1.0 - SETTINGS.data.phases.around_peak), TRUNCATED.filter_ahead)


def _extended_to_end(inquiry: Inquiry, base: Fitted, steps: Sequence[Step]) -> list[Step]:
    """The steps with their best and nearest rivals fitted over the whole way, each beside the one before."""
    made: list[Step] = []
    beside = base
    for s in steps:
        near = [s.fitted, *sorted((f for f in s.rivals if f is not s.fitted), key=lambda f: f.chi2)[: TRUNCATED.rivals]]
        tasks = [Task(candidates=f.candidates, start=f.x, shifts=tuple(b.shift for b in f.blocks)) for f in near]
        best, *rivals = inquiry.fits(tasks)
        if best is None:
            return []
        others = tuple(f for f in rivals if f is not None)
        made.append(replace(s, base=beside, fitted=best, rivals=(best, *others)))
        beside = best
    return made
