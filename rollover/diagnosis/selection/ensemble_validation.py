"""What is believed of an effect where runs scatter: a base as well off as its rivals, and gains that outlast chance."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.fit.cross_validation import Groups, held_out
from rollover.diagnosis.fit.ensemble_mean import ensemble_mean_misfit, fitted_to_ensemble_mean
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted
from rollover.diagnosis.fit.parameterisation import Candidate, physical, same_family
from rollover.diagnosis.fit.step import Step
from rollover.diagnosis.inference.intervals import intervals
from rollover.diagnosis.noise.ensemble import has_diverged, p_value_of_divergence
from rollover.diagnosis.result import Interval
from rollover.diagnosis.selection.score_test import ScoreTest, p_value
from rollover.diagnosis.selection.screening import initial_time_shifts
from rollover.diagnosis.settings import SETTINGS
from rollover.effects import EFFECTS

Array = NDArray[np.float64]
TUNING = SETTINGS.selection.ensemble_validation


def restarted_base(problem: Problem, base: Fitted) -> Fitted:
    """A base from the time shifts that its rivals begin with, if that leaves less: where runs scatter it hangs on them.

    Else what a better clock gains would be every rival's.
    """
    again = problem.fit(base.candidates, base.x, shifts=initial_time_shifts(problem, base))
    return min((f for f in (base, again) if f is not None), key=lambda f: sum(b.total for b in f.blocks))


def with_full_weights(problem: Problem, fitted: Fitted) -> Fitted:
    """A fit with all samples counted in full if more recordings took another trajectory than chance sends there.

    What so many do together is missing from the simulation, and where they went tells what.
    """
    problem.heavy_tailed = True
    found = problem.again(fitted)
    if (
        p_value_of_divergence(sum(has_diverged(b.heavy_tail) for b in found.blocks), len(found.blocks))
        > SETTINGS.noise.ensemble.divergence_p_value
    ):
        return found
    problem.heavy_tailed = False
    return problem.again(fitted)


def counted_in_full(problem: Problem, base: Fitted) -> Fitted:
    """A base as an explanation is held against it: in full where its recordings diverged by more than chance.

    Those were weighted down for want of an explanation alone; so they leave no more than the best there is.
    """
    found = with_full_weights(problem, base)
    problem.heavy_tailed = True
    return found


def without_unsupported_rivals(found: Step, scored: ScoreTest, spoken: float = TUNING.own_p_value) -> Step:
    """A step without rivals that nothing spoke for when looked at, by a p-value: their runs met them by chance.

    What speaks for one that acts somewhere speaks for its family; for a strong one its runs did.
    """
    last = [f.candidates[-1] for f in found.rivals]
    spoken_for = [
        c for c in last if c.key in scored.far or p_value(scored.scores.get(c.key, 0.0), scored.null) < spoken
    ]
    retained = [*spoken_for, *same_family(last, spoken_for)]
    return replace(found, rivals=tuple(f for f in found.rivals if f.candidates[-1] in retained))


def ensemble_validated(problem: Problem, found: Step, groups: Groups) -> Step | None:
    """The best of a step's rivals by the mean of its runs, if that gains and has a strength; None if none does.

    Rivals whose mean gains much less are none.
    """
    held = problem.dataset
    start = ensemble_mean_misfit(problem, found.base)
    gains = {
        id(f): max(a - b for a, b in zip(start, ensemble_mean_misfit(problem, f), strict=True)) for f in found.rivals
    }  # what shows before the impact need not outweigh what chance does after it
    best = max(gains.values(), default=0.0)
    near = [f for f in found.rivals if gains[id(f)] > TUNING.rival_share * best]
    for rival in sorted(near, key=lambda f: -gains[id(f)]):
        if gains[id(rival)] < TUNING.least_gain:
            return None
        one = refined_under_scatter(problem, replace(found, fitted=rival, rivals=tuple(near)))
        ahead = replace(one, rivals=()).cross_validated(problem, groups)
        gains_on = (is_validated(ahead, groups) and is_shared(ahead, groups)) or is_validated(
            judged_before_impact(problem, one), groups
        )
        if gains_on and is_significant_as_held(problem, one.fitted):
            return one
        problem.with_noise_model(held)
    return None


def judged_before_impact(problem: Problem, found: Step) -> Step:
    """A step by its gain on samples before any run diverges."""

    def cut(f: Fitted) -> Fitted:
        blocks = [
            replace(b, residual=b.residual[k], J=b.J[k], slope=b.slope[k], heavy_tail=None, expected=None)
            for b, k in zip(f.blocks, (e.early for e in problem.dataset), strict=True)
        ]
        return replace(f, blocks=tuple(blocks), cross_validated=None)

    return replace(found, base=cut(found.base), fitted=cut(found.fitted), rivals=())


def is_significant_as_held(problem: Problem, fitted: Fitted) -> bool:
    """`is_there` with diverged recordings weighted down if the effect will be held so, though it was found in full.

    What one recording on another trajectory asks for is not what the others do.
    """
    if problem.heavy_tailed:
        return is_there(problem, fitted)
    with problem.held(heavy_tailed=True):
        return is_there(problem, with_full_weights(problem, fitted))


def is_there(problem: Problem, fitted: Fitted) -> bool:
    """Whether the strength of the last effect differs significantly from its null value: its interval keeps away."""
    last = fitted.candidates[-1]
    nulls = _nulls(last)
    if not nulls:
        return True
    by_slopes = intervals(problem, fitted, {})[-1]
    if not _is_apart(by_slopes, nulls, 1.0):
        return False  # runs only widen it
    first, values = len(fitted.x) - len(last.search), last.values(fitted.x[-len(last.search) :])
    sides = {first + k: (-1.0 if values[n] > nulls[n] else 1.0,) for k, n in enumerate(last.search) if n in nulls}
    return _is_apart(by_slopes, nulls, TUNING.sure_width) or _is_apart(
        intervals(problem, fitted, sides)[-1], nulls, 1.0
    )


def significant_by_wald(problem: Problem, fitted: Fitted) -> set[int]:
    """Places of the effects that no run is needed to tell that something would be missing without: by slopes alone."""
    each = zip(map(_nulls, fitted.candidates), intervals(problem, fitted, {}), strict=True)
    return {k for k, (nulls, by_slopes) in enumerate(each) if _is_apart(by_slopes, nulls, TUNING.retained_width)}


def _nulls(c: Candidate) -> dict[str, float]:
    """Values of an effect's parameters that change nothing, of those that have a number for it."""
    nulls: dict[str, Any] = dict(EFFECTS[c.id].null)
    for (name, search), at in zip(c.search.items(), c.null or (None,) * len(c.search), strict=True):
        nulls[name] = nulls.get(name) if at is None else physical(at, search)
    return {name: float(nulls[name]) for name in c.search if isinstance(nulls.get(name), (int, float))}


def _is_apart(found: Mapping[str, Interval], nulls: Mapping[str, float], times: float) -> bool:
    """Whether the null of a number lies outside its interval, made wider about its value."""
    known = [(found[n].value, found[n].low, found[n].high, null) for n, null in nulls.items()]
    return any(null < v - times * (v - low) or null > v + times * (high - v) for v, low, high, null in known)


def is_validated(found: Step, groups: Groups) -> bool:
    """Whether an effect predicts what was held out better by more than chance, under the scatter of its own runs."""
    return bool(_gains(found, groups).sum() > TUNING.least_gain)


def is_shared(found: Step, groups: Groups) -> bool:
    """Whether recordings gain without the one that gains most: what is one's alone may be the course that its run took.

    Of a single recording nobody can tell.
    """
    gains = _gains(found, groups)
    return gains.size == 1 or bool(gains.sum() - gains.max() > TUNING.shared_gain)


def _gains(found: Step, groups: Groups) -> Array:
    """What each recording gains (k,) where it is held out, over what is left per sample."""
    with_, without_ = held_out(found.fitted, groups), held_out(found.base, groups)
    return np.asarray((without_.chi2 - with_.chi2) / max(1.0, float(with_.chi2.sum() / with_.count.sum())))


def refined_under_scatter(problem: Problem, step: Step) -> Step:
    """A step moved to where its fit meets the mean of its own runs best (D8), beside a base under that scatter.

    Its rivals are not put under it: that costs runs, see `Step.again`.
    """
    return replace(step.moved_to(fitted_to_ensemble_mean(problem, step.fitted)), base=problem.again(step.base))
