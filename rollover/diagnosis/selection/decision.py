"""From the scenario as it is to an explanation: effects added one by one, tried without, and the verdict they bear."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from rollover.diagnosis.data.phases import Phases
from rollover.diagnosis.fit.cross_validation import Groups, held_out
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted, at_an_end, first_effect_last
from rollover.diagnosis.fit.local_search import without_effect
from rollover.diagnosis.fit.parameterisation import is_one_sensor, with_slices
from rollover.diagnosis.fit.step import Inquiry, Step
from rollover.diagnosis.inference.lack_of_fit import Mismatch, is_enough, is_tolerated, matters, mismatch_of
from rollover.diagnosis.result import Verdict
from rollover.diagnosis.selection.ensemble_validation import counted_in_full, significant_by_wald
from rollover.diagnosis.selection.explanation import Explanation, kind_of, strongest, with_conditions_refitted
from rollover.diagnosis.selection.forward_step import largest_change
from rollover.diagnosis.selection.pairs import best_subsets, with_first_replaced
from rollover.diagnosis.selection.simplification import (
    followed,
    is_a_curve,
    is_flexible_soil,
    is_over_flexible,
    is_straight_line,
    with_mirror_rivals,
)
from rollover.diagnosis.selection.stepwise import forward_selection, loading_first
from rollover.diagnosis.settings import SETTINGS

TUNING = SETTINGS.selection.decision
MOST_EFFECTS = SETTINGS.selection.flexibility.most_effects
P_VALUE = SETTINGS.inference.lack_of_fit.p_value
FULL_P_VALUE = SETTINGS.selection.simplification.full_p_value
LEAST_GAIN = SETTINGS.selection.ensemble_validation.least_gain


def explained(inquiry: Inquiry, base: Fitted) -> Explanation:
    """Forward selection of up to three effects, each beyond chance, then each tried without and against its rivals.

    Where that ends with less than all, the way down is explained first, and effects are tried two by two.
    """
    problem, groups, phases = inquiry.problem, inquiry.groups, inquiry.phases
    found = loading_first(inquiry, forward_selection(inquiry, base))
    base, taken, mismatch, current = found.base, list(found.steps), found.after, found.fitted
    is_whole = is_enough(problem, current, mismatch)
    is_open = not (problem.effort.is_ensemble or found.paired) and (not is_whole or len(taken) == MOST_EFFECTS)
    if found.first is not None and is_open:
        # two that leave what chance leaves are preferred to three that do
        both = best_subsets(inquiry, taken or [found.first], found.at_first, current, is_whole=is_whole)
        if both is not None:
            (taken, mismatch), current = both, both[0][-1].fitted
            is_whole = is_enough(problem, current, mismatch)
    is_open = is_whole and len(taken) > 1 and may_be_named(problem, current, mismatch)
    retained = _fully_fitted_steps(inquiry, taken) if is_open else _one_each(inquiry, taken)
    parts = [s.again(problem) for s in taken] if retained is None else retained
    if is_open and retained is not None and not problem.effort.is_ensemble:
        parts = [with_mirror_rivals(inquiry, s) for s in retained]
    base = counted_in_full(problem, base) if taken and problem.effort.is_ensemble else problem.again(base)
    parts = [s.cross_validated(problem, groups, inquiry.executor.parallel_map) for s in parts]
    current = parts[-1].fitted if parts else base
    return Explanation(
        base=base,
        fitted=current,
        parts=tuple(parts),
        scored=found.at_first,
        detectable={**found.at_first.detectable, **found.scored.detectable},
        before=found.before,
        after=mismatch_of(problem.dataset, current.blocks, phases),
        first=None
        if found.first is None
        else found.first.again(problem).cross_validated(problem, groups, inquiry.executor.parallel_map),
        refuted=found.refuted,
        is_unique=retained is not None,
    )


def may_be_named(problem: Problem, fitted: Fitted, mismatch: Mismatch) -> bool:
    """Whether several effects may be named: all together leave no more than `verdict_on` asks, or one is needless."""
    if problem.effort.is_ensemble or len(fitted.effects) < MOST_EFFECTS or mismatch.p_value > FULL_P_VALUE:
        return True
    if not matters(problem, fitted, mismatch) or is_tolerated(problem, fitted):
        return True
    return len(backward_elimination(problem, problem.again(fitted)).effects) < MOST_EFFECTS


def _fully_fitted_steps(inquiry: Inquiry, taken: Sequence[Step]) -> list[Step] | None:
    """Steps of the effects that are needed, as `_retained_steps`, the last one's fit followed to its end."""
    retained = _retained_steps(inquiry, taken)
    return None if retained is None else _one_each(inquiry, [*retained[:-1], followed(inquiry, retained[-1])[0]])


def _one_each(inquiry: Inquiry, steps: Sequence[Step]) -> list[Step]:
    """Steps of all effects of the last one's fit, again, that one at last; none of none.

    What came there in the place of another is looked for once more, so that it has rivals too.
    """
    known = {s.fitted.candidates[-1].key: s.again(inquiry.problem) for s in steps}
    if not steps:
        return []
    *others, last = known[steps[-1].fitted.candidates[-1].key].fitted.effects
    found: list[Step] = []
    current = known[last.key].fitted
    for c in others:
        back = None if c.key in known else with_first_replaced(inquiry, current)
        current = first_effect_last(current)
        if back is not None and back.fitted.candidates[-1].key == c.key:
            known[c.key] = back
        elif c.key not in known:
            base, rivals = (known[last.key].base, ()) if back is None else (back.base, back.rivals)
            known[c.key] = Step(base=base, fitted=current, p_value=known[last.key].p_value, rivals=(current, *rivals))
        found.append(known[c.key])
    return [*found, known[last.key]]


def _retained_steps(inquiry: Inquiry, taken: Sequence[Step]) -> list[Step] | None:
    """Steps of the effects that are needed: each dropped if that costs no more than chance, or given to a better one.

    Beside a better one others may not be needed any more. Returned in such an order that the last one's fit is the
    whole explanation; every step's fit is. None where as many as may be are given for others again and again: that any
    which can be bent to it will do explains nothing.
    """
    problem = inquiry.problem
    last = taken[-1]
    current = backward_elimination(problem, problem.again(last.fitted), last.base)
    if (problem.effort.is_ensemble or is_over_flexible(current.effects)) and len(current.effects) == len(taken):
        return _one_each(inquiry, taken)  # the second will be refused, whichever came first
    parts: list[Step] = []
    exchanged = 0
    while len(parts) < len(current.effects):
        whole = len(parts) == len(current.effects) - 1 and not has_base_moved(last)
        whole = whole and current.effects[0].key == last.fitted.candidates[-1].key
        if whole and {c.token for c in current.candidates} == {c.token for c in last.fitted.candidates}:
            parts.append(last)  # found beside just these others
            break
        found, taken_out = with_first_replaced(inquiry, current), current.effects[0].key
        if found is None:
            return _one_each(inquiry, taken)
        current = backward_elimination(problem, found.fitted)
        if found.fitted.candidates[-1].key != taken_out and exchanged < MOST_EFFECTS:
            parts, exchanged = [], exchanged + 1  # those before were looked for beside what is no more
            if exchanged > TUNING.most_exchanges and len(current.effects) == MOST_EFFECTS:
                return None
        parts = [*parts, found] if len(current.effects) == len(found.fitted.effects) else []
    return [s.again(problem) for s in parts]


def has_base_moved(last: Step) -> bool:
    """Whether the other effects are no more what they were as the last one and its rivals were looked for beside them.

    What was bent to do the last one's work as well left little to those that have less to bend.
    """
    return [c.token for c in last.base.candidates] != [c.token for c in last.fitted.candidates[:-1]]


def backward_elimination(problem: Problem, fitted: Fitted, base: Fitted | None = None) -> Fitted:
    """The explanation without those of its effects that may be dropped for no more than chance.

    `base` is the fit beside which the last one was found. Of full runs, those that are surely there are not tried.
    """
    while len(fitted.effects) > 1:
        losses: list[tuple[float, int, Fitted | None]] = [(np.inf, -1, None)]
        significant = significant_by_wald(problem, fitted) if problem.effort.is_ensemble else set()
        for k in {*range(fitted.first, len(fitted.candidates))} - significant:
            rest = _without_kth(problem, fitted, k, base)
            losses.append((rest.chi2 - fitted.chi2 if rest is not None else np.inf, k, rest))
        loss, _, rest = min(losses, key=lambda one: one[0])
        dispersion = max(1.0, fitted.chi2 / sum(b.residual.size for b in fitted.blocks))
        if rest is None or loss / dispersion > LEAST_GAIN:
            break
        fitted = problem.again(rest) if problem.effort.is_ensemble else rest
    return fitted


def _without_kth(problem: Problem, fitted: Fitted, k: int, base: Fitted | None) -> Fitted | None:
    """The explanation without its k-th effect, fitted again unless that is the `base` of full runs: these cost much.

    Of these it ends without slopes.
    """
    others = [c.token for j, c in enumerate(fitted.candidates) if j != k]
    if problem.effort.is_ensemble and base is not None and [c.token for c in base.candidates] == others:
        return problem.again(base)
    return without_effect(problem, fitted, k, no_jacobian=problem.effort.is_ensemble)


def verdict_on(problem: Problem, found: Explanation, groups: Groups, phases: Phases) -> tuple[Explanation, Verdict]:
    """The verdict; what does not explain is not named.

    Several effects are named only if together they leave nothing but noise, or what was said to be tolerated; as many
    as may be, or two of one sensor, or of a soil that is bent, more surely so: they can be bent to more. One alone also
    where it takes nearly all.
    """
    held, is_curved = found.fitted.effects, is_a_curve(problem, found.fitted)
    if not found.is_unique or is_over_flexible(held) or (is_curved and is_straight_line(held)):
        return found.refused(), "unexplained"
    is_bending = len(found.parts) == MOST_EFFECTS or is_one_sensor(held) or is_flexible_soil(held)
    is_whole = found.after.p_value > (FULL_P_VALUE if is_bending else P_VALUE)
    if is_bending and not problem.effort.is_ensemble:
        # what is bent to a curve nearly everywhere leaves what it cannot be bent to in one place
        is_whole = is_whole and min(found.after.adjusted, default=1.0) > P_VALUE
    is_whole = is_whole or not matters(problem, found.fitted, found.after)
    start, ahead = held_out(found.base, groups).total, held_out(found.fitted, groups).total
    is_whole = (
        is_whole
        and not (ahead > SETTINGS.selection.forward_step.nearly_noise and explains_little(found, groups))
        and not is_curved
    )
    # what a tolerance allows has structure too
    is_whole = is_whole or (is_tolerated(problem, found.fitted) and ahead < TUNING.held_out_ratio)
    if found.parts and is_whole and ahead < start:
        return found, kind_of(strongest(problem, found.base, found.fitted))
    if found.first is not None and found.parts:
        one = found.first
        end = held_out(one.fitted, groups).total
        inside = not any(at_an_end(v) for v in one.fitted.x)
        after = mismatch_of(problem.dataset, one.fitted.blocks, phases)
        is_nearly_all = (
            end**2 - 1.0 < TUNING.left_structure * (start**2 - 1.0)
            and after.structure <= TUNING.left_structure * found.before.structure
        )
        if is_nearly_all and inside:
            return replace(found, parts=(one,), fitted=one.fitted, after=after), kind_of(one.fitted.candidates[-1])
    significant = found.before.p_value < P_VALUE and matters(problem, found.base, found.before)
    significant = (
        significant and not is_tolerated(problem, found.base) and not is_negligible_effect(problem, found.first, phases)
    )
    verdict: Verdict = "unexplained" if significant or found.parts else "no-mismatch"
    return found.refused(), verdict


def explains_little(found: Explanation, groups: Groups, share: float = TUNING.little_share) -> bool:
    """Whether an explanation takes less than a share of what was beyond the noise in held-out recordings."""
    start, ahead = held_out(found.base, groups).total, held_out(found.fitted, groups).total
    return start**2 - ahead**2 < share * (start**2 - 1.0)


def redundant_effects(problem: Problem, found: Explanation, ids: Collection[str]) -> set[str]:
    """Of effects that may be nothing by their intervals, those whose work the others do, in any shape of theirs.

    A shape that was not fitted widens an interval as far as slopes say. Of full runs, where a fit costs much, all are.
    """
    if problem.effort.is_ensemble:
        return set(ids)
    fitted, done = found.fitted, set()
    dispersion = problem.samples_per_error * max(1.0, fitted.chi2 / sum(b.residual.size for b in fitted.blocks))
    shifts = [b.shift for b in fitted.blocks]
    for k, c in enumerate(fitted.candidates):
        if c.id not in ids:
            continue
        others = [(o, fitted.x[own]) for j, (o, own) in enumerate(with_slices(fitted.candidates)) if j != k]
        fits = [without_effect(problem, fitted, k)]
        for j, (other, x) in enumerate(others):
            for point in other.with_secondary(x) if other.secondary else ():
                way = [*others[:j], (other.whole(), point), *others[j + 1 :]]
                fits.append(problem.fit([o for o, _ in way], [v for _, at in way for v in at], shifts=shifts))
        if min((f.chi2 for f in fits if f is not None), default=np.inf) - fitted.chi2 < LEAST_GAIN * dispersion:
            done.add(c.id)
    return done


def by_first_effect(problem: Problem, found: Explanation, refuted: Collection[str], phases: Phases) -> Explanation:
    """The explanation by its first effect alone, where that is none of those that may be `refuted`; else refused.

    Of one that was all there is, its gain is refuted with it.
    """
    one = found.first
    if one is None or one.fitted.candidates[-1].id in refuted:
        return replace(found.refused(), refuted=found.refuted or len(found.parts) == 1)
    one = one.again(problem)
    one, after = with_conditions_refitted(problem, one, mismatch_of(problem.dataset, one.fitted.blocks, phases), phases)
    return replace(found, parts=(one,), fitted=one.fitted, after=after)


def is_negligible_effect(problem: Problem, first: Step | None, phases: Phases) -> bool:
    """Whether all that separates simulation and recordings is the work of an effect that moves nothing worth a name."""
    if first is None or largest_change(problem, first.base, first.fitted) >= SETTINGS.inference.adequacy.negligible:
        return False
    return mismatch_of(problem.dataset, first.fitted.blocks, phases).p_value > P_VALUE
