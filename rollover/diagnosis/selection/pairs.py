"""Two effects at once, where one after the other led to something else."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from rollover.diagnosis.fit.finite_differences import Point
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted, first_effect_last
from rollover.diagnosis.fit.local_search import completed_shifts, representative_recordings, without_effect
from rollover.diagnosis.fit.parameterisation import Candidate
from rollover.diagnosis.fit.step import Inquiry, Step
from rollover.diagnosis.fit.tasks import Task
from rollover.diagnosis.fit.threshold_scan import has_threshold, threshold_ranges, threshold_starts
from rollover.diagnosis.inference.lack_of_fit import Mismatch, is_enough, mismatch_of
from rollover.diagnosis.selection.forward_step import step, with_noise_of_fit
from rollover.diagnosis.selection.restarts import continued_from, with_secondary_parameters
from rollover.diagnosis.selection.score_test import ScoreTest
from rollover.diagnosis.selection.screening import is_far, score_candidates
from rollover.diagnosis.selection.simplification import (
    followed,
    in_usual_form,
    is_over_flexible,
    mirror_images,
    simpler,
)
from rollover.diagnosis.settings import SETTINGS
from rollover.effects import EFFECTS

TUNING = SETTINGS.selection.pairs

Start = tuple[tuple[Candidate, ...], tuple[float, ...]]  # two effects beside a base, and where their fit begins


def best_subsets(
    inquiry: Inquiry, taken: Sequence[Step], scored: ScoreTest, current: Fitted, *, is_whole: bool = False
) -> tuple[list[Step], Mismatch] | None:
    """The best pair of effects, as steps, and what it leaves, see `best_pair`; None if `current` stays.

    A pair is given for it that is better, or, where it is whole, that leaves what chance leaves too, and no more than
    an effect that is not needed takes. Where a pair leaves nearly noise, and more than quiet stretches tell of, it is
    under the noise that all of it tells of.
    """
    problem, held = inquiry.problem, inquiry.problem.dataset
    pair = best_pair(inquiry, taken, scored)
    if pair is None:
        return None
    found, mismatch = followed(inquiry, pair)
    if not is_enough(problem, found.fitted, mismatch) and any(c.is_oscillatory for c in found.fitted.candidates):
        # what its shape shows now did not show beside another one
        oscillatory = (
            found.fitted
            if found.fitted.candidates[-1].is_oscillatory
            else problem.again(first_effect_last(found.fitted))
        )
        other = with_first_replaced(inquiry, oscillatory)
        if other is not None and other.fitted.chi2 < found.fitted.chi2:
            found, mismatch = followed(inquiry, other)
    if is_whole and costs(problem, found.fitted, current) > SETTINGS.selection.ensemble_validation.least_gain:
        return None  # noise that such a pair tells of would hold the third effect
    if not is_enough(problem, found.fitted, mismatch) and with_noise_of_fit(problem, found.fitted, inquiry.phases):
        found = found.again(problem)
        mismatch = mismatch_of(problem.dataset, found.fitted.blocks, inquiry.phases)
    if not (
        mismatch.p_value > SETTINGS.inference.lack_of_fit.p_value
        if is_whole
        else is_better(found.fitted, mismatch, current)
    ):
        problem.with_noise_model(held)
        return None
    return [replace(taken[0], fitted=found.base), found], mismatch


def costs(problem: Problem, fewer: Fitted, more: Fitted) -> float:
    """What a fit of fewer effects leaves more than one of more, over what that leaves per sample."""
    chi2 = problem.again(more).chi2
    return (fewer.chi2 - chi2) / max(1.0, chi2 / sum(b.residual.size for b in more.blocks))


def is_better(other: Fitted, mismatch: Mismatch, current: Fitted, *, scattered: bool = False) -> bool:
    """Whether an explanation is to be taken instead of another: it leaves far less, or less and no more than chance.

    Far less of what is beyond the noise, or of all where runs are `scattered`, so that nobody knows what chance leaves.
    Instead of any curve, which will be refused, as much more will do.
    """
    if mismatch.p_value > SETTINGS.inference.lack_of_fit.p_value:
        return other.chi2 < current.chi2
    if scattered:
        return other.chi2 < TUNING.better_share * current.chi2
    chance = sum(b.residual.size for b in other.blocks)
    part = 1.0 / TUNING.better_share if is_over_flexible(current.effects) else TUNING.better_share
    return other.chi2 - chance < part * (current.chi2 - chance)


def with_first_exchanged(
    inquiry: Inquiry, taken: Sequence[Step], current: Fitted
) -> tuple[list[Step], Mismatch] | None:
    """Two steps with the first effect given for another beside the second, and what they leave; None if not better."""
    other = with_first_replaced(inquiry, taken[-1].fitted)
    if other is None or other.fitted.chi2 >= taken[-1].fitted.chi2:
        return None
    found, mismatch = followed(inquiry, other)
    return ([taken[-1], found], mismatch) if is_better(found.fitted, mismatch, current, scattered=True) else None


def with_first_replaced(inquiry: Inquiry, current: Fitted) -> Step | None:
    """The first effect of an explanation taken out and looked for anew beside the rest: it comes back, or a better."""
    problem = inquiry.problem
    rest = without_effect(problem, current, current.first)
    if rest is None:
        return None
    scored = score_candidates(
        problem, rest, inquiry.free(rest), inquiry.groups, parallel_map=inquiry.executor.parallel_map
    )
    found = step(inquiry, rest, scored)
    held = problem.again(first_effect_last(current))
    if (
        found is None or found.fitted.chi2 > held.chi2 + SETTINGS.selection.ensemble_validation.least_gain
    ):  # on the way back nothing came as far
        rivals = () if found is None else found.rivals
        beside = tuple(f for f in rivals if f.candidates[-1].key != held.candidates[-1].key)
        back = Step(base=problem.again(rest), fitted=held, p_value=scored.p_value(), rivals=(held, *beside))
        return simpler(inquiry, back) or back
    return found


def best_pair(inquiry: Inquiry, taken: Sequence[Step], scored: ScoreTest) -> Step | None:
    """The best pair of the first step's rivals, of what led later, and of what gains most, as a step of its second.

    Of two effects neither need come first alone: a third may be like both, and the second may leave much alone. Short
    fits tell which pairs are worth whole ones; the best takes the shapes that pay if it comes near what others leave.
    """
    problem, first = inquiry.problem, taken[0]
    lead = min(first.rivals, key=lambda f: f.chi2)
    few, shifts = representative_recordings(lead), tuple(b.shift for b in lead.blocks)
    at, fixed_shifts = tuple(shifts[r] for r in few), is_far(problem, first.base)
    # slopes tell what two do together where these are not far off
    partners = _partners(inquiry, first, taken, scored, TUNING.scored if fixed_shifts else 0)
    two = itertools.combinations(partners, 2)
    base = first.base
    short: list[Start] = [((*base.candidates, a, b), (*base.x, *x, *y)) for (a, x), (b, y) in two if _may_explain(a, b)]
    short += (
        _with_thresholds_scanned(inquiry, partners, few, shifts, (base.candidates, base.x))
        if fixed_shifts
        else _pairs_by_slopes(inquiry, base, scored)
    )
    inquiry.say(f"{len(short)} pairs of effects")
    for rounds, most in TUNING.short_fits:
        tasks = [
            Task(candidates=both, start=x, shifts=at, only=tuple(few), rounds=rounds, fixed_shifts=fixed_shifts)
            for both, x in short
        ]
        met = sorted((f for f in inquiry.fits(tasks) if f is not None), key=lambda f: f.chi2)[:most]
        short = [(f.candidates, f.x) for f in met]
    if not met or _explains_little(problem.again(lead), met[0], few):
        return None
    tasks = [Task(candidates=f.candidates, start=f.x, shifts=completed_shifts(shifts, f, few)) for f in met]
    fits = [f for f in inquiry.fits(tasks) if f is not None]
    if not fits:
        return None
    best = min([*fits, *_with_secondary_fitted(inquiry, fits), *_traced(inquiry, fits)], key=lambda f: f.chi2)
    best = min([best, *_mirrored(inquiry, best)], key=lambda f: f.chi2)
    if best.chi2 < SETTINGS.fit.local_search.abandon_above * taken[-1].fitted.chi2:
        ways = (best, problem.again(first_effect_last(best)))
        tasks = [Task(candidates=p.candidates[:-1], start=p.x[: -len(p.own)], shifts=shifts) for p in ways]
        for pair, alone in zip(ways, inquiry.fits(tasks), strict=True):
            if alone is not None:
                best = min(best, *with_secondary_parameters(inquiry, alone, [pair]), key=lambda f: f.chi2)
    alone = problem.fit(best.candidates[:-1], best.x[: -len(best.own)], shifts=[b.shift for b in best.blocks])
    return None if alone is None else Step(base=alone, fitted=best, p_value=first.p_value, rivals=(best,))


def _may_explain(one: Candidate, other: Candidate) -> bool:
    """Whether two may be named together: they are not one effect twice, nor any curve."""
    return one.key != other.key and not is_over_flexible((one, other))


def _pairs_by_slopes(inquiry: Inquiry, base: Fitted, scored: ScoreTest) -> list[Start]:
    """Pairs of candidates that gain most together by their slopes, in their usual shapes, from where these lead."""
    usual = {c.key: c for c in inquiry.candidates}
    begun = [(usual[key], x, usual[other], y) for (key, x), (other, y) in scored.both]
    return [((*base.candidates, a, b), (*base.x, *x, *y)) for a, x, b, y in begun if _may_explain(a, b)]


def _with_thresholds_scanned(
    inquiry: Inquiry,
    partners: Sequence[tuple[Candidate, tuple[float, ...]]],
    few: Sequence[int],
    shifts: Sequence[float],
    base: Point = ((), ()),
) -> list[Start]:
    """Pairs of an effect that led and one with a threshold, begun where that leaves least beside it.

    Alone, for all that is missing, it may have ended elsewhere, or nowhere.
    """
    able = [c for c, _ in partners if has_threshold(c) and not c.has_secondary]
    ways = [(a, x, c) for a, x in partners[: TUNING.leading] for c in able if c.key != a.key]
    starts_of = partial(threshold_starts, few=tuple(few), shifts=tuple(shifts), base=base)
    each = zip(ways, inquiry.parallel_map(starts_of, ways), strict=True)
    return [((*base[0], a, c), x) for (a, _, c), x in each if x is not None]


def _explains_little(lead: Fitted, pair: Fitted, few: Sequence[int]) -> bool:
    """Whether a pair fitted to few recordings takes next to nothing of what its lead alone leaves beyond the noise.

    Where that is little itself none does for sure: the place of a threshold decides, and is looked for later.
    """
    alone, size = sum(lead.blocks[r].total for r in few), sum(lead.blocks[r].residual.size for r in few)
    return (
        alone > SETTINGS.selection.forward_step.nearly_noise** 2 * size
        and alone - pair.total < TUNING.least_share * (alone - size)
    )


def _with_secondary_fitted(inquiry: Inquiry, pairs: Sequence[Fitted]) -> list[Fitted]:
    """Pairs of which one effect rings, with its shape fitted too.

    With a wrong share of the nose all that stands beside it is met as badly, and the wrong one may lead.
    """
    able = [
        f if f.candidates[-1].is_oscillatory else inquiry.problem.again(first_effect_last(f))
        for f in pairs
        if _is_oscillatory(f)
    ]
    lead = min(pairs, key=lambda f: f.chi2)
    near = [f for f in able if f.chi2 < TUNING.same_misfit * lead.chi2 and f.candidates[-1].secondary]
    leaves = tuple(b.total for b in lead.blocks)
    made = inquiry.fits([replace(continued_from(f, "secondary"), leaves=leaves) for f in near])
    return [f for f in made if f is not None]


def _traced(inquiry: Inquiry, pairs: Sequence[Fitted]) -> list[Fitted]:
    """Pairs near the best of which one effect has a threshold, as a layer its depth, scanned over all of its range.

    None where the best leaves no more than noise.
    """
    ranked = sorted(pairs, key=lambda f: f.chi2)
    if (
        mismatch_of(inquiry.problem.dataset, ranked[0].blocks, inquiry.phases).p_value
        > SETTINGS.inference.lack_of_fit.p_value
    ):
        return []
    near = (f for f in ranked if f.chi2 < TUNING.placed_misfit * ranked[0].chi2)
    ways = (way for f in near for way in (f, inquiry.problem.again(first_effect_last(f))))
    able = itertools.islice(
        (way for way in ways if threshold_ranges(way) and not way.candidates[-1].is_oscillatory), TUNING.placed
    )
    tasks = [replace(continued_from(f, "trace"), stretch=s) for f in able for s in threshold_ranges(f)]
    return [f for f in inquiry.fits(tasks) if f is not None]


def _mirrored(inquiry: Inquiry, pair: Fitted) -> list[Fitted]:
    """A pair with what mirrors one of its effects in the place of that, and the other as it usually is.

    That may have been bent to a stiffness of all the ground, as a rate by where it sets in.
    """
    usual, found = {c.key: c for c in inquiry.candidates}, []
    for way in (pair, first_effect_last(pair)):
        if not EFFECTS[way.candidates[-1].id].mirrors:
            continue
        other = way.candidates[0]
        (other, _), x = in_usual_form(way, usual, (0,) if usual[other.key].search.keys() <= other.search.keys() else ())
        found += mirror_images(inquiry, way, (other,), x[: len(other.search)])
    return found


def _is_oscillatory(pair: Fitted) -> bool:
    return any(c.is_oscillatory for c in pair.candidates)


def _partners(
    inquiry: Inquiry, first: Step, taken: Sequence[Step], scored: ScoreTest, count: int
) -> list[tuple[Candidate, tuple[float, ...]]]:
    """Who may be one of two, and where its fit begins; what was bent to lead alone also in its usual shape.

    Those that led, and of the others the first `count` by their score.
    """
    leading = sorted((inquiry.problem.again(f) for f in first.rivals), key=lambda f: f.chi2)[: TUNING.leading]
    later = [f for s in taken[1:] for f in sorted(s.rivals, key=lambda f: f.chi2)[: TUNING.following]]
    found: dict[tuple[str, bool], tuple[Candidate, tuple[float, ...]]] = {}
    for f in (*leading, *later):
        last = f.candidates[-1]
        found.setdefault((last.key, last.has_secondary), (last, f.own))
    known, varied = {key for key, _ in found}, {key for key, has_secondary in found if has_secondary}
    ranked = sorted(first.screened, key=lambda s: -scored.scores.get(s.candidate.key, 0.0))
    for k, s in enumerate(ranked):
        if s.candidate.key in varied or (k < count and s.candidate.key not in known):
            found.setdefault((s.candidate.key, s.candidate.has_secondary), (s.candidate, s.starts[0]))
    return list(found.values())
