"""Score test of all candidates: where runs are dear on few recordings first, and by cached runs where they suffice."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import zip_longest

import numpy as np

from rollover.diagnosis.fit.cross_validation import Groups
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted
from rollover.diagnosis.fit.local_search import chi2_at
from rollover.diagnosis.fit.parameterisation import Candidate
from rollover.diagnosis.fit.tasks import ParallelMap, serial_map
from rollover.diagnosis.fit.time_shift import with_shifts_near_prior
from rollover.diagnosis.selection.score_test import ScoreTest, p_value, score_test
from rollover.diagnosis.selection.screening import initial_time_shifts, representative_few
from rollover.diagnosis.settings import SETTINGS

TUNING = SETTINGS.selection.scan


def score_candidates(
    problem: Problem,
    base: Fitted,
    candidates: Sequence[Candidate],
    groups: Groups,
    beside: Fitted | None = None,
    few: Sequence[int] = (),
    parallel_map: ParallelMap[Problem] = serial_map,
) -> ScoreTest:
    """A gate by all recordings; where each look costs a run, of few and then of the best candidates by some more.

    The null stays that of the best of all candidates: what was passed over could only have raised the maximum. Clocks
    are then taken where they say, or nearly so: far off they have eaten what is missing. `beside` as in `score_test`,
    in `few` recordings that are given with it; then only what is known already is looked at, and nothing strong is
    tried. Of recordings that go on for long after an impact the beginning is looked at.
    `parallel_map` works off what costs no full run.
    """
    effort = problem.effort
    if not effort.is_ensemble:
        return score_test(problem, base, candidates, parallel_map=parallel_map)
    problem, base = problem.beginning(base)
    if problem.samples_per_error == 1.0:  # beside a tolerance it cannot be told what a clock has eaten
        base = with_shifts_near_prior(problem, base)
    few, more = few or representative_few(base, groups, effort.few), representative_few(base, groups, effort.looked_at)
    first, last = _step_reduced(problem, base, candidates, few, more, beside)
    if problem.heavy_tailed:
        return last
    # in full, what one of them lacks hides what the others have
    scores = {key: max(score, first.scores.get(key, 0.0)) for key, score in last.scores.items()}
    moving = [c for c in candidates if c.kind != "sensor"]
    with problem.held(heavy_tailed=True):  # a part that gives way shows in how it does, not in where all else goes then
        masked = _step_reduced(problem, problem.recounted(base), moving, few, more, beside)[-1]
    able = [
        c.key
        for c in masked.ranked(moving)
        if p_value(masked.scores.get(c.key, 0.0), masked.null) < SETTINGS.selection.ensemble_validation.own_p_value
    ]
    scores = {key: max(score, masked.scores.get(key, 0.0)) for key, score in scores.items()}
    far = strong_starts(problem, base, moving, few) if beside is None else {}
    leading = [key for both in zip_longest(far, able[: effort.leaders]) for key in both if key is not None]
    return replace(last, scores=scores, leading=tuple(dict.fromkeys(leading)), far=far)


def strong_starts(
    problem: Problem, base: Fitted, candidates: Sequence[Candidate], few: Sequence[int]
) -> dict[str, tuple[tuple[float, ...], ...]]:
    """Where those candidates act that leave least of `few` recordings where they act strongly, by key, the best first.

    What so strong an effect does is no multiple of what a little of it does: a vehicle rolls on, or no more. Where all
    samples count in full what comes near is told best, with other courses forgiven what is still far off.
    """
    shifts = initial_time_shifts(problem, base)

    def left(way: Sequence[Candidate], x: Sequence[float], use: Sequence[int]) -> float:
        found = chi2_at(problem, (*base.candidates, *way), (*base.x, *x), shifts, use)
        return np.inf if found is None else found

    worst = max(few, key=lambda r: left((), (), [r]))
    every = [(c, x) for c in candidates for x in c.strong()]
    problem.made_ahead((worst, (*base.candidates, c), (*base.x, *x)) for c, x in every)

    def hopeful() -> list[bool]:
        usual = left((), (), [worst])
        return [left((c,), x, [worst]) < usual for c, x in every]

    def ranked() -> list[tuple[str, tuple[float, ...]]]:
        usual, met = left((), (), few), dict[str, tuple[float, tuple[float, ...]]]()
        for c, x in able:
            met[c.key] = min(met.get(c.key, (np.inf, ())), (left((c,), x, few), x))
        best = sorted((least, key, x) for key, (least, x) in met.items() if least < TUNING.clear_share * usual)
        return [(key, x) for _, key, x in best[: problem.effort.leaders]]

    with problem.held(heavy_tailed=True):
        either = hopeful()
    # what leaves more of the worst than there was makes up for that in no other
    able = [one for one, *is_able in zip(every, hopeful(), either, strict=True) if any(is_able)]
    problem.made_ahead((r, (*base.candidates, c), (*base.x, *x)) for c, x in able for r in few)
    with problem.held(heavy_tailed=True):
        masked = ranked()
    found: dict[str, tuple[tuple[float, ...], ...]] = {}
    for key, x in (one for both in zip_longest(ranked(), masked) for one in both if one is not None):
        found[key] = tuple(dict.fromkeys((*found.get(key, ()), x)))
    return found


def _step_reduced(
    problem: Problem,
    base: Fitted,
    candidates: Sequence[Candidate],
    few: Sequence[int],
    more: Sequence[int],
    beside: Fitted | None,
) -> tuple[ScoreTest, ScoreTest]:
    """A gate by few recordings, and one by more: of what moves the vehicle best there, where it did, and of sensors."""
    effort = problem.effort
    first = score_test(problem, base, candidates, few, beside)
    if len(more) <= len(few):
        return first, first
    moving = sorted((c for c in candidates if c.kind != "sensor"), key=lambda c: -first.scores.get(c.key, 0.0))
    closer = [replace(c, points=first.points.get(c.key, ())) for c in moving[: effort.shortlist]]
    second = score_test(problem, base, [*closer, *(c for c in candidates if c.kind == "sensor")], more, beside)
    return first, replace(
        second,
        scores={**dict.fromkeys(first.scores, 0.0), **second.scores},
        null=np.maximum(first.null, second.null),
        detectable={**first.detectable, **second.detectable},
        starts={
            key: tuple(dict.fromkeys((*second.starts.get(key, ()), *first.starts.get(key, ()))))
            for key in {**first.starts, **second.starts}
        },
        only=first.only,
    )


def rescored(
    problem: Problem,
    current: Fitted,
    base: Fitted | None,
    candidates: Sequence[Candidate],
    groups: Groups,
    first: ScoreTest,
    parallel_map: ParallelMap[Problem] = serial_map,
) -> ScoreTest:
    """A look beside an explanation; where looks cost runs, by what candidates move beside the `base`, if that is given.

    Those runs are known from the `first` look. Only if the best of their directions tells something are others made.
    """
    if base is not None and problem.effort.is_ensemble:
        hinted = score_candidates(problem, current, candidates, groups, base, first.only)
        if hinted.p_value() > TUNING.hint_p_value:
            return hinted
    return score_candidates(problem, current, candidates, groups, parallel_map=parallel_map)
