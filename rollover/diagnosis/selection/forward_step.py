"""One step of the selection: which effect, beside those held already, best predicts what was not fitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.data.phases import Phases
from rollover.diagnosis.fit.cross_validation import Groups, cross_validated_by_refits, held_out, held_out_disadvantage
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted, ResidualBlock, is_at_bound
from rollover.diagnosis.fit.local_search import completed_shifts
from rollover.diagnosis.fit.step import Inquiry, Screened, Step
from rollover.diagnosis.fit.tasks import Task
from rollover.diagnosis.inference.lack_of_fit import mismatch_of
from rollover.diagnosis.noise import autoregression
from rollover.diagnosis.selection.restarts import (
    best_of_each,
    continued_from,
    from_other_starts,
    with_known_minima,
    with_secondary_parameters,
    with_time_shifts,
)
from rollover.diagnosis.selection.score_test import ScoreTest, p_value
from rollover.diagnosis.selection.screening import (
    initial_time_shifts,
    is_far,
    of_same_family,
    promising,
    representative_few,
    screen,
)
from rollover.diagnosis.settings import SETTINGS
from rollover.diagnosis.settings.forward import Effort
from rollover.effects import EFFECTS

Array = NDArray[np.float64]
TUNING = SETTINGS.selection.forward_step


def step(inquiry: Inquiry, base: Fitted, scored: ScoreTest) -> Step | None:
    """Fit the promising candidates beside the base and rank them by what they predict of held-out conditions.

    `scored` is what all of them scored beside the base. Where the best leaves nearly noise, that noise is weighed by
    what it leaves; the step is then under that noise. None if nothing could be fitted.
    """
    problem, groups, candidates = inquiry.problem, inquiry.groups, inquiry.free(base)
    inquiry.say(f"looking at {len(candidates)} candidates beside {base.label}")
    # of recordings that went another way together, two may be those that no explanation brings back
    several = problem.effort.few if problem.heavy_tailed else problem.effort.looked_at
    few, shifts = (
        representative_few(base, groups, several),
        initial_time_shifts(problem, base, inquiry.executor.parallel_map),
    )
    who, start = problem.beginning(base)
    early = replace(inquiry, problem=who)
    screened = screen(early, start, promising(candidates, scored, problem.effort), few, shifts, scored)
    count = sum(b.residual.size for b in base.blocks)
    screened, begun_with = _first_fits(early, start, screened, few, shifts, scored)
    reused = reusable_slopes(problem, base)
    tasks = [
        Task(candidates=f.candidates, start=f.x, shifts=completed_shifts(shifts, f, few), width=1, reused=reused)
        for f in begun_with
    ]
    fits = [f for f in inquiry.fits(tasks) if f is not None]
    if not fits:
        return None
    if base.candidates and not problem.effort.is_ensemble:
        fits += _restarted_from_base(inquiry, base, fits, scored)
    fits.sort(key=lambda f: f.chi2)
    if not problem.effort.is_ensemble:
        fits = from_other_starts(inquiry, base, fits, scored, shifts)
    # where a threshold makes the way crooked, the nearer ones are followed to the end; of what explains the best alone
    able = [f for f in fits if len(f.candidates[-1].search) > 1 and f.chi2 < TUNING.polished_misfit * fits[0].chi2]
    alone = [f for f in able[:1] if f is fits[0] and not base.effects]
    near = (
        able[: problem.effort.polishes]
        if fits[0].chi2 > SETTINGS.fit.levenberg_marquardt.noise_left**2 * count
        else alone
    )
    if near and problem.effort.polishes:
        polished = inquiry.fits([continued_from(f, "polish") for f in near])
        others = [f for f in fits if not any(f is one for one in near)]
        fits = others + [new or old for new, old in zip(polished, near, strict=True)]
    fits = (
        best_of_each(fits)
        if problem.effort.is_ensemble
        else with_secondary_parameters(inquiry, base, best_of_each(fits))
    )
    if not problem.effort.is_ensemble:
        fits = with_known_minima(inquiry, base, with_time_shifts(inquiry, base, fits))
    if with_noise_of_fit(problem, fits[0], inquiry.phases):
        base, fits = problem.again(base), [problem.again(f) for f in fits]
    if not problem.effort.is_ensemble:
        fits = _refitted_where_slopes_mislead(inquiry, fits)
    fits.sort(key=lambda f: held_out(f, groups).chi2.sum())
    fits = simplest(fits, groups, problem.samples_per_error)
    p = by_chance(base, fits, scored, problem.samples_per_error)
    return Step(base=base, fitted=fits[0], p_value=p, rivals=tuple(fits), screened=tuple(screened))


def by_chance(base: Fitted, fits: Sequence[Fitted], scored: ScoreTest, shared: float) -> float:
    """p-value of what the best of all fits gains, where `shared` samples have one error."""
    least = min(f.chi2 for f in fits)
    # what even the best leaves is no chance of the noise's size
    dispersion = max(1.0, least / sum(b.residual.size for b in base.blocks))
    score = scored.score
    if shared > 1.0:
        # beside a tolerance what is missing is large, and a fit finds more of it than its slope where it is not
        dispersion, score = dispersion * shared, max(score, base.chi2 - least)
    return p_value(score / dispersion, scored.null)


def reusable_slopes(problem: Problem, base: Fitted, few: Sequence[int] | None = None) -> tuple[Array, ...] | None:
    """Slopes (n, k) that a base has of each recording, or of `few`, for fits beside it; None where they cost no run."""
    if not problem.effort.is_ensemble or not base.candidates:
        return None
    return tuple(base.blocks[r].unweighted_J for r in (range(len(base.blocks)) if few is None else few))


def _refitted_where_slopes_mislead(inquiry: Inquiry, fits: Sequence[Fitted]) -> list[Fitted]:
    """The fits, with what the one that leaves least foretells by fits, where by its slopes another foretells better."""
    groups = inquiry.groups
    lead, ahead = min(fits, key=lambda f: f.chi2), min(fits, key=lambda f: held_out(f, groups).chi2.sum())
    if lead is ahead:
        return list(fits)
    new = cross_validated_by_refits(
        inquiry.problem, lead, groups, held_out(ahead, groups).total, inquiry.executor.parallel_map
    )
    return [new if f is lead else f for f in fits]


def _restarted_from_base(inquiry: Inquiry, base: Fitted, fits: Sequence[Fitted], scored: ScoreTest) -> list[Fitted]:
    """Fits anew, from the base itself, of candidates that were led astray: beside them more is left than without.

    Those that soon gain a part of what the best does are gone on with.
    """
    tasks, least, shifts = [], min(f.chi2 for f in fits), tuple(b.shift for b in base.blocks)
    for f in fits:
        if f.chi2 > base.chi2:
            begin = scored.starts.get(f.candidates[-1].key, (f.own,))[0]
            tasks.append(
                Task(candidates=f.candidates, start=(*base.x, *begin), shifts=shifts, rounds=TUNING.short_rounds)
            )
    short = [f for f in inquiry.fits(tasks) if f is not None]
    able = [f for f in short if base.chi2 - f.total > TUNING.short_share * (base.chi2 - least)]
    ended = [f for f in inquiry.fits([continued_from(f, "fit") for f in able]) if f is not None]
    return ended + [inquiry.problem.again(f) for f in short if not any(f is one for one in able)]


def with_noise_of_fit(problem: Problem, fitted: Fitted, phases: Phases) -> bool:
    """Weigh the recordings by all that a fit leaves, if that is noise: as little as seen, or more without structure."""
    chi2, count = fitted.chi2, sum(b.residual.size for b in fitted.blocks)
    if chi2 > TUNING.like_noise**2 * count:
        return False
    before = problem.dataset
    problem.with_noise_model(autoregression.with_noise_of_residuals(before, problem.residuals(fitted)))
    if chi2 < TUNING.nearly_noise**2 * count:
        return True
    if (
        mismatch_of(problem.dataset, problem.again(fitted).blocks, phases).p_value
        > SETTINGS.inference.lack_of_fit.p_value
    ):
        return True
    problem.with_noise_model(before)
    return False


def _first_fits(
    inquiry: Inquiry,
    base: Fitted,
    screened: Sequence[Screened],
    few: Sequence[int],
    shifts: Sequence[float],
    scored: ScoreTest,
) -> tuple[list[Screened], list[Fitted]]:
    """Short fits to few recordings: the ones worth a full fit, best first, and what each leaves."""
    problem = inquiry.problem
    chosen = {s.candidate.key: s for s in _chosen(screened, problem.effort, scored)}
    nrmse_by_key: dict[str, float] = {}
    inquiry.say(f"first fits of {len(chosen)} candidates to {len(few)} recordings")
    at = tuple(shifts[r] for r in few)
    fixed_shifts = problem.effort.is_ensemble or is_far(problem, base)
    tasks = [
        Task(
            candidates=(*base.candidates, s.candidate), start=(*x, *start), shifts=at, only=tuple(few),
            rounds=problem.effort.short, fixed_shifts=fixed_shifts, reused=reusable_slopes(problem, base, few),
        )
        for s in chosen.values()
        for start in s.starts
        for x in (base.x, *_elsewhere_of(base))
    ]  # fmt: skip
    far = [] if problem.heavy_tailed else [task for task in tasks if task.candidates[-1].key in scored.far]
    fits = [f for f in inquiry.fits([task for task in tasks if task not in far]) if f is not None]
    fits += _robust_short_fits(inquiry, far, few)
    for one in fits:
        key, size = one.candidates[-1].key, sum(b.residual.size for b in one.blocks)
        nrmse_by_key[key] = min(nrmse_by_key.get(key, np.inf), float(np.sqrt(one.chi2 / size)))
    fits.sort(key=lambda f: f.chi2)
    worth = [
        f for k, f in enumerate(fits) if k < problem.effort.leaders or f.chi2 < TUNING.followed_misfit * fits[0].chi2
    ]
    if problem.effort.is_ensemble and fits:
        worth = best_of_each(worth) + _other_minimum(worth)
        before = [problem.block(r, base.candidates, base.x, shifts[r], 0.0) for r in few]  # clocks where they are held
        as_it_is = sum(b.total for b in before if b is not None)
        # and what leads by its score: the gain of one that others are measured by may be chance of its runs
        worth = [
            f
            for f in worth
            if as_it_is - f.chi2 >= TUNING.rival_share * (as_it_is - fits[0].chi2)
            or f.candidates[-1].key == scored.best
        ]
    worth = worth[: problem.effort.most_leaders]
    # a first fit may lead astray what scored most
    if all(f.candidates[-1].key != scored.best for f in worth):
        worth += [f for f in fits if f.candidates[-1].key == scored.best][:1]
    return [replace(s, nrmse=nrmse_by_key.get(s.candidate.key, 0.0)) for s in screened], worth


def _elsewhere_of(base: Fitted) -> list[tuple[float, ...]]:
    """Coordinates of a base whose baseline, if it has one, stands where that may be without what is missing.

    Fitted alone it was bent to what is missing, and from there no way may lead back.
    """
    held, effects = (sum(len(c.search) for c in part) for part in (base.candidates[: base.first], base.effects))
    return [(*at, *base.x[len(base.x) - effects :]) for c in base.candidates[: base.first] for at in c.points if held]


def _robust_short_fits(inquiry: Inquiry, tasks: Sequence[Task], few: Sequence[int]) -> list[Fitted]:
    """Fits to few recordings with diverged ones weighted down, as they stand in full.

    Where runs part ways what is left in full jumps from place to place, and a fit ends at the first dip.
    """
    problem, found = inquiry.problem, []
    with problem.held(heavy_tailed=True):
        fits = [f for f in inquiry.fits(tasks) if f is not None]
    with problem.held(fixed_shifts=True):  # as other first fits are
        for f in fits:
            blocks = [problem.block(r, f.candidates, f.x, b.shift, 0.0) for r, b in zip(few, f.blocks, strict=True)]
            found.append(replace(f, blocks=tuple(b for b in blocks if b is not None)))
    return [f for f in found if len(f.blocks) == len(few)]


def _chosen(screened: Sequence[Screened], effort: Effort, scored: ScoreTest) -> list[Screened]:
    """Those worth a first fit: that start well, and that have most to gain.

    Of runs that scatter those whose score is a small part of the best one's are not; what a sensor makes of them costs
    none: as many more. A part that gives way looks like several sensors at the end of their ranges, and scores less
    than each: the two are compared with their own kind. With a leader comes its family.
    """
    by_start = sorted(screened, key=lambda s: s.chi2)[: effort.promising // 2]
    if not effort.is_ensemble:
        return [*by_start, *sorted(screened, key=lambda s: -s.potential)[: effort.promising]]
    by_key = {s.candidate.key: s for s in screened}
    ranked = [by_key[c.key] for c in scored.ranked([s.candidate for s in screened])]
    moving = [s for s in ranked if s.candidate.kind != "sensor"]
    of_sensors = [s for s in ranked if s.candidate.kind == "sensor"]
    related = of_same_family([s.candidate for s in moving], effort.promising, effort.leaders)

    def score(s: Screened) -> float:
        return scored.scores.get(s.candidate.key, 0.0)

    able = []
    for own in (moving, of_sensors):
        least = TUNING.least_score * max(map(score, own), default=0.0)
        begun_well = [s for s in by_start if s in own]
        able += [
            s for s in (*begun_well, *own[: effort.promising]) if score(s) >= least or s.candidate.key in scored.leading
        ]
    return [*able, *(s for s in moving if s.candidate in related)]


def _other_minimum(fits: Sequence[Fitted]) -> list[Fitted]:
    """Of the candidate that leads, best first, the best fit that came to another place."""
    lead = fits[0]
    same = [f for f in fits[1:] if f.candidates[-1].key == lead.candidates[-1].key]
    return [
        f
        for f in same
        if max(abs(a - b) for a, b in zip(f.x, lead.x, strict=True)) > 0.5 * SETTINGS.selection.screening.start_distance
    ][:1]


def largest_change(problem: Problem, base: Fitted, fitted: Fitted) -> float:
    """How far the added effect moves any channel of any recording, largest root mean square over the range.

    Within half a step of a channel's digits nothing counts as moved.
    """
    return _run_distance(problem, base.blocks, fitted.blocks)


def size_of_effect(problem: Problem, fitted: Fitted) -> float:
    """How far the last effect moves any channel beside the others as they stand; 0 where these cannot be simulated.

    What the others cannot be bent to of it is less: all that ground of another stiffness leaves of a rate, a tenth.
    """
    last = fitted.candidates[-1]
    rest, x = fitted.candidates[:-1], fitted.x[: len(fitted.x) - len(last.search)]
    alone = [problem.block(r, rest, x, b.shift, 0.0) for r, b in enumerate(fitted.blocks)]
    return 0.0 if None in alone else _run_distance(problem, [b for b in alone if b is not None], fitted.blocks)


def _run_distance(problem: Problem, some: Sequence[ResidualBlock], others: Sequence[ResidualBlock]) -> float:
    """How far two lots of runs are apart in any channel of any recording, see `largest_change`."""
    most = 0.0
    for r, (a, b) in enumerate(zip(some, others, strict=True)):
        for signal, part in problem.dataset[r].spans():
            d = (a.unweighted_residual - b.unweighted_residual)[part]
            size = float(np.sqrt(np.mean(d * d))) * signal.sigma
            if size > 0.5 * signal.step:
                most = max(most, size / signal.span)
    return most


def simplest(fits: Sequence[Fitted], groups: Groups, shared: float) -> list[Fitted]:
    """Fits, best first, led by the one with the fewest numbers of those that are hardly worse than the best.

    Hardly worse: within a standard error, or within what jumps make the misfit rough by. Of those that are one and the
    same to these recordings the one leads that asks for the more usual strength. `shared` samples have one error.
    """
    least = held_out(fits[0], groups).chi2.sum()
    near = [
        f
        for f in fits
        if held_out_disadvantage(f, fits[0], groups, shared)[0] < TUNING.simpler_errors
        or held_out(f, groups).chi2.sum() < (1.0 + TUNING.arithmetic_share) * least
    ]
    first = min(near, key=lambda f: len(f.x))
    twins = [f for f in near if len(f.x) == len(first.x) and abs(f.chi2 - first.chi2) < TUNING.same_misfit]
    first = min(twins, key=lambda f: f.candidates[-1].strength(f.own))
    return [first, *(f for f in fits if f is not first)]


def confusion_set(step_: Step, groups: Groups, shared: float = 1.0, *, is_refuted: bool = False) -> list[Fitted]:
    """Rivals that predict held-out recordings as well as the best does, the best first.

    And those of no more numbers that meet all recordings as well as it does: what hangs on a single one is hard to
    predict without it, and not wrong for that. None that becomes the best itself at the end of its range, as a layer
    whose top is the ground's. Where what the best leaves refutes its form (`is_refuted`), which of its family has the
    right one is not decided by who leaves least: those that explain nearly all that it does are rivals too.
    """
    best, base = step_.fitted, step_.base
    found = [best]
    for rival in step_.rivals:
        explains = base.chi2 - rival.chi2 > 0.5 * (base.chi2 - best.chi2)
        as_well = len(rival.x) <= len(best.x) and rival.chi2 < best.chi2 + TUNING.excluded_errors**2
        becomes_best = (
            len(rival.x) > len(best.x) and rival.chi2 > best.chi2 - TUNING.excluded_errors**2 and is_at_bound(rival)
        )
        if rival is best:
            continue
        if is_refuted and is_same_family(rival, best) and explains_nearly_all(step_, rival, groups):
            found.append(rival)
            continue
        if becomes_best or not explains:
            continue
        if as_well or min(held_out_disadvantage(rival, best, groups, shared)) < TUNING.excluded_errors:
            found.append(rival)
    return found


def is_same_family(rival: Fitted, best: Fitted) -> bool:
    """Whether two fits' effects are of one family, and the one does not become the other at an end of its range."""
    return rival.candidates[-1].family == best.candidates[-1].family and not becomes(rival, best)


def becomes(rival: Fitted, best: Fitted) -> bool:
    """Whether a fit stands at an end of its effect's range, where it is declared to become the best one's."""
    return is_at_bound(rival) and best.candidates[-1].id in EFFECTS[rival.candidates[-1].id].becomes


def held_out_gain(step_: Step, fitted: Fitted, groups: Groups) -> float:
    """Sum of squares that a fit takes from what the base leaves of conditions held out."""
    return float(held_out(step_.base, groups).chi2.sum() - held_out(fitted, groups).chi2.sum())


def explains_nearly_all(step_: Step, rival: Fitted, groups: Groups) -> bool:
    """Whether a rival gains nearly all of what the best does on conditions held out."""
    most = held_out_gain(step_, step_.fitted, groups)
    return held_out_gain(step_, rival, groups) >= SETTINGS.report.grades.nearly_all * most
