"""One effect beside an estimated discrepancy: more of them would be bent to what no model has."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rollover.diagnosis.fit.cross_validation import Groups, held_out
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted, is_at_bound, without_shift_direction
from rollover.diagnosis.fit.local_search import with_time_shift_search
from rollover.diagnosis.fit.step import Inquiry, Step
from rollover.diagnosis.grades import jackknifed, share_beyond, share_of, shares
from rollover.diagnosis.inference.lack_of_fit import is_tolerated, mismatch_of
from rollover.diagnosis.inference.repeated_course import predicted_by_others, quick_channels
from rollover.diagnosis.inference.residual_law import fitted_law
from rollover.diagnosis.inference.slow_discrepancy import shown_beside
from rollover.diagnosis.probabilities import credible, log_evidence
from rollover.diagnosis.result import Share, Verdict
from rollover.diagnosis.selection.ensemble_validation import restarted_base
from rollover.diagnosis.selection.explanation import Explanation, kind_of, with_conditions_refitted
from rollover.diagnosis.selection.forward_step import (
    becomes,
    by_chance,
    confusion_set,
    explains_nearly_all,
    held_out_gain,
    is_same_family,
    step,
)
from rollover.diagnosis.selection.screening import score_candidates
from rollover.diagnosis.settings import SETTINGS
from rollover.scenario import Scenario

TUNING = SETTINGS.report.grades


def fit_single_effect(inquiry: Inquiry, base: Fitted) -> Explanation:
    """The best single effect beside a discrepancy, if any can be fitted.

    It is looked for though the discrepancy may be enough: that was estimated from what an effect leaves as well.
    """
    problem, groups, phases = inquiry.problem, inquiry.groups, inquiry.phases
    clocked = restarted_base if problem.effort.is_ensemble else with_time_shift_search
    base = clocked(problem, base)
    before = mismatch_of(problem.dataset, base.blocks, phases)
    scored = score_candidates(problem, base, inquiry.candidates, groups, parallel_map=inquiry.executor.parallel_map)
    first = step(inquiry, base, scored)
    if first is None:
        return Explanation(
            base=base, fitted=base, parts=(), scored=scored, detectable=scored.detectable, before=before, after=before
        )
    first, left = with_conditions_refitted(
        problem, first, mismatch_of(problem.dataset, first.fitted.blocks, phases), phases
    )
    if problem.samples_per_error > 1.0:
        # a rig repeats its discrepancy: it is one draw for all recordings, however many there are, (D21)
        first = replace(first, p_value=by_chance(first.base, first.rivals, scored, problem.samples_per_draw))
    first = first.again(problem).cross_validated(problem, groups, inquiry.executor.parallel_map)
    leader = best_predictor(problem, first, groups)
    if leader is not first.fitted:
        first = replace(first, fitted=leader).cross_validated(problem, groups, inquiry.executor.parallel_map)
        left = mismatch_of(problem.dataset, first.fitted.blocks, phases)
    return Explanation(
        base=first.base,
        fitted=first.fitted,
        parts=(first,),
        scored=scored,
        detectable=scored.detectable,
        before=before,
        after=left,
        first=first,
    )


def best_predictor(problem: Problem, one: Step, groups: Groups) -> Fitted:
    """The fit that leads a step: the most probable by (D24) of those that no other surely predicts more than.

    Conditions held out tell first. Between what predicts them as well, the squares of all samples would prefer what
    bends to the one channel that the discrepancy touches least; what is left of each channel counts alike. What leaves
    more than the discrepancy is refuted by it, where another leaves no more.
    """
    able = [one.fitted, *(f for f in one.rivals if not is_at_bound(f) and f is not one.fitted)]
    ahead = min(able, key=lambda f: held_out(f, groups).chi2.sum())
    level = [f for f in able if f is ahead or not is_behind(problem, one, f, ahead, groups)]
    return max(level, key=lambda f: (is_tolerated(problem, f), log_evidence(problem, f)))


def is_behind(problem: Problem, one: Step, rival: Fitted, ahead: Fitted, groups: Groups) -> bool:
    """Whether a fit surely predicts more of conditions held out than a rival does."""
    more = share_beyond(problem, one.base, rival, ahead, groups)
    return more is not None and more.low > 0.0


def verdict_on_single_effect(
    problem: Problem, found: Explanation, groups: Groups, *, is_taught: bool = False
) -> tuple[Explanation, Verdict]:
    """The verdict on what one effect explains beside a discrepancy.

    An effect predicts recordings that were held out, a discrepancy does not carry over to them but for what is common
    to all. So it is named where it predicts half of what the scenario misses there, surely some of it, and leaves no
    more than the discrepancy; or surely more than a discrepancy lends itself to, and its family is not to be mistaken.
    Otherwise nothing is said to be there where the scenario alone leaves no more than the discrepancy, unless a part
    of that is surely predicted: something is there then that no name fits.

    How large a discrepancy is that references taught is known without the effect: what predicts more than nothing does,
    by more than that lends itself to, and is surely shown by the recordings (D29), is named however much is left.
    """
    nothing: Verdict = "no-mismatch" if is_tolerated(problem, found.base) else "unexplained"
    if not found.parts:
        return found.refused(), nothing
    whole, _ = shares(problem, found, groups)
    is_by_chance = found.parts[0].p_value > SETTINGS.inference.lack_of_fit.p_value
    # what lends itself to a discrepancy that drops repeat does not predict half of it from drop to drop
    if is_by_chance and (whole is None or whole.low < TUNING.half_share):
        return shown_quickly(problem, found, groups) or (found.refused(), nothing)
    if whole is not None and whole.low > 0.0:
        nothing = "unexplained"
    families = {f.candidates[-1].family for f in confusion_set(found.parts[0], groups, problem.samples_per_error)}
    is_enough = (
        whole is not None
        and whole.share >= TUNING.half_share
        and whole.low > 0.0
        and is_tolerated(problem, found.fitted)
    )
    is_sure = (
        whole is not None and whole.share >= TUNING.half_share and whole.low > TUNING.sure_share and len(families) == 1
    )
    is_shown = is_taught and whole is not None and whole.share > 0.0
    if is_enough or is_sure or (is_shown and times_shown(found.base, found.fitted, groups).low > 0.0):
        return found, kind_of(found.fitted.candidates[-1])
    return shown_quickly(problem, found, groups) or (found.refused(), nothing)


def shown_quickly(problem: Problem, found: Explanation, groups: Groups) -> tuple[Explanation, Verdict] | None:
    """What shows by being quicker than the discrepancy, (D28), if it predicts half of what it leaves, and surely some.

    It leaves no more than the discrepancy.
    """
    one = found.parts[0]
    fitted = shown_beside(problem, one.base, (one.fitted, *one.rivals), len(found.scored.scores))
    share = None if fitted is None else share_of(problem, one.base, fitted, groups)
    if fitted is None or share is None or not is_tolerated(problem, fitted):
        return None
    if share.low <= 0.0 or share.share < TUNING.sure_share:
        return None
    shown = replace(found, fitted=fitted, parts=(replace(one, fitted=fitted),))
    return shown, kind_of(fitted.candidates[-1])


def times_shown(base: Fitted, fitted: Fitted, groups: Groups) -> Share:
    """How many times recordings show what a fit adds to a base, its interval by how often each group does, (D29).

    With w what the base leaves and D what the fit changes of it, time shifts aside, sum(D'w)/sum(D'D), which is 1 where
    a fit is at rest: twice as many standard errors from none as what D predicts of w is, 2 D'w - D'D.
    """
    shown, due = [], []
    for before, after in zip(base.blocks, fitted.blocks, strict=True):
        w = after.counted(before.unweighted_residual)
        D = w - after.counted(after.unweighted_residual)
        w, D = without_shift_direction(np.stack([w, D], axis=1), after).T
        shown.append(float(D @ w))
        due.append(float(D @ D))
    if sum(due) <= 0.0:
        return Share(share=0.0, low=-np.inf, high=1.0)
    numbers = len(fitted.x) - len(base.x)
    return jackknifed(np.array(shown), np.array(due), groups, numbers)


def alike_beside(problem: Problem, one: Step, groups: Groups) -> list[Fitted]:
    """The best and what cannot be told from it beside a discrepancy that was estimated.

    That was estimated from what the best leaves, whose form need not be the right one: a rival that explains nearly all
    that the best does is not excluded where it leaves no more than the discrepancy, or is of the same family. Nor is
    one of those that hold the right one with 95 % by what they leave, (D24), if it explains half as much, or is of the
    same family, unless the best surely predicts more. What becomes the best at an end of its range, as a layer a
    stiffness, is no rival.
    """
    near = confusion_set(one, groups, problem.samples_per_error, is_refuted=True)
    best, most = one.fitted, held_out_gain(one, one.fitted, groups)
    probable = credible(problem, one.rivals)
    for rival in one.rivals:
        if becomes(rival, best) or any(rival is f for f in near):
            continue
        explains_half = held_out_gain(one, rival, groups) > TUNING.half_share * most
        is_probable = any(rival is f for f in probable) and (is_same_family(rival, best) or explains_half)
        is_probable = is_probable and not is_behind(problem, one, rival, best, groups)
        if is_probable or (is_tolerated(problem, rival) and explains_nearly_all(one, rival, groups)):
            near.append(rival)
    return near


def follows_a_law(problem: Problem, base: Fitted, scenarios: Sequence[Scenario], groups: Groups) -> bool:
    """Whether a law without a name surely predicts half of what a base misses of recordings that were held out.

    That is what an effect is asked for; `scenarios` are those of the recordings' conditions.
    """
    fitted = fitted_law(problem, base, scenarios, problem.dataset, groups)
    share = None if fitted is None else share_of(problem, base, fitted, groups)
    return share is not None and share.low >= TUNING.half_share


def repeats_its_course(problem: Problem, base: Fitted, groups: Groups) -> bool:
    """Whether other conditions' mean course surely predicts half of what a base misses, and quicker than a background.

    That is what an effect is asked for: a ringing is the same in all drops. Where a background is smooth and alike in
    all drops nothing tells it from an effect of its size that no table holds.
    """
    quick = quick_channels(problem, base)
    gained, due = predicted_by_others(problem, base, groups, quick)
    return bool(due.sum() > 0.0) and jackknifed(gained, due, groups).low >= TUNING.half_share
