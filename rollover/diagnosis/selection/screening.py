"""Which candidates are worth a fit, and where it may begin: scores of all, then few recordings at a few points each.

Where runs are costly the score test is made on few recordings first, and by cached runs where they suffice.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import zip_longest

import numpy as np

from rollover.diagnosis.fit.cross_validation import Groups
from rollover.diagnosis.fit.finite_differences import Point
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted, ResidualBlock, without_shift_direction
from rollover.diagnosis.fit.local_search import chi2_at
from rollover.diagnosis.fit.parameterisation import Candidate, same_family
from rollover.diagnosis.fit.step import Inquiry, Screened
from rollover.diagnosis.fit.tasks import ParallelMap, serial_map
from rollover.diagnosis.fit.time_shift import shifts_from_contact, with_shifts_near_prior
from rollover.diagnosis.selection.score_test import ScoreTest, p_value, score_test
from rollover.diagnosis.settings import SETTINGS
from rollover.diagnosis.settings.forward import Effort

TUNING = SETTINGS.selection.screening
SCAN = SETTINGS.selection.scan


def representative_few(
    base: Fitted, groups: Sequence[Sequence[int]], few: int = SETTINGS.forward.drops.few
) -> list[int]:
    """Few recordings that stand for all: of the conditions that are met worst, best, and in the middle."""
    misfits = [b.normal()[2] / b.residual.size for b in base.blocks]
    members = [max(g, key=lambda r: misfits[r]) for g in groups if g]
    members.sort(key=lambda r: misfits[r])
    if len(members) <= few:
        return sorted(set(members)) if len(groups) > 1 else list(range(len(base.blocks)))[:few]
    return sorted({members[round(k * (len(members) - 1) / (few - 1))] for k in range(few)})


def is_far(problem: Problem, base: Fitted) -> bool:
    """Whether a base is so far off that its time shifts tell of what is missing; beside a tolerance that is soon."""
    far = TUNING.fixed_shifts if problem.samples_per_error == 1.0 else 1.0
    return base.chi2 > far**2 * sum(b.residual.size for b in base.blocks)


def initial_time_shifts(problem: Problem, base: Fitted, parallel_map: ParallelMap[Problem] = serial_map) -> list[float]:
    """Time shifts (s) to begin with: where the base is off its own are bent by what is missing, the contact's hardly.

    Where samples are weighed by what neighbours scatter by, how far off it is cannot be told from what is left.
    """
    count = sum(b.residual.size for b in base.blocks)
    if problem.effort.is_ensemble or problem.samples_per_error > 1.0:
        contact_shifts: list[float | None] = [None] * len(base.blocks)
        if not problem.effort.is_ensemble and not is_far(problem, base):
            return [b.shift for b in base.blocks]
    elif base.chi2 < TUNING.biased_shifts**2 * count:
        return [b.shift for b in base.blocks]
    else:
        contact_shifts = shifts_from_contact(problem, base.candidates, base.x, parallel_map)
    return [
        at if at is not None else b.shift if e.recording.clock.zero == "unknown" else 0.0
        for at, b, e in zip(contact_shifts, base.blocks, problem.dataset, strict=True)
    ]


def screen(
    inquiry: Inquiry,
    base: Fitted,
    candidates: Sequence[Candidate],
    few: Sequence[int],
    shifts: Sequence[float],
    scored: ScoreTest,
) -> list[Screened]:
    """Screen each candidate at some points beside the base, on a few recordings, from time `shifts` (s) of all.

    Not far from an explanation the points to which `scored` leads are enough.
    """
    problem = inquiry.problem
    beside = [problem.block(r, base.candidates, base.x, shifts[r], 0.0) for r in few]
    blocks = tuple(b for b in beside if b is not None)
    if len(blocks) < len(few):
        return []
    near = not is_far(problem, base) and not problem.effort.is_ensemble

    def points(c: Candidate) -> tuple[tuple[float, ...], ...]:
        ways = () if problem.effort.is_ensemble and not c.is_placed else scored.starts.get(c.key, ())
        is_led = (near or c.is_placed) and ways and not c.is_discontinuous
        return tuple(ways if is_led else (*ways, *c.starts()))

    problem.made_ahead((r, (*base.candidates, c), (*base.x, *x)) for c in candidates for x in points(c) for r in few)
    items = [_Screening(candidate=c, points=points(c), far=scored.far.get(c.key, ())) for c in candidates]
    screening = partial(
        _screened, base=(base.candidates, base.x), few=tuple(few), shifts=tuple(shifts[r] for r in few), blocks=blocks
    )
    return [s for s in inquiry.parallel_map(screening, items) if s is not None]


@dataclass(frozen=True, kw_only=True)
class _Screening:
    """A candidate, the points at which it is screened, and where it may begin in any case."""

    candidate: Candidate
    points: tuple[tuple[float, ...], ...]
    far: tuple[tuple[float, ...], ...]


def _screened(
    problem: Problem,
    item: _Screening,
    *,
    base: Point,
    few: tuple[int, ...],
    shifts: tuple[float, ...],
    blocks: tuple[ResidualBlock, ...],
) -> Screened | None:
    """One candidate looked at beside a base, which few recordings meet by these blocks; None if nothing can be made."""
    c, potential = item.candidate, 0.0
    looked_at: list[tuple[bool, float, tuple[float, ...]]] = []
    for start in item.points:
        chi2, along, size, count = 0.0, 0.0, 0.0, 0
        for r, shift, block in zip(few, shifts, blocks, strict=True):
            there = problem.block(r, (*base[0], c), (*base[1], *start), shift, 0.0)
            if there is None:
                break
            count += 1
            chi2 += there.normal()[2]
            way = block.counted(block.unweighted_residual - there.unweighted_residual)
            free = without_shift_direction(np.column_stack([way, block.residual]), block)
            along += float(free[:, 0] @ free[:, 1])
            size += float(free[:, 0] @ free[:, 0])
        if count < len(blocks):
            continue
        is_still = size <= TUNING.no_change
        if not is_still:
            potential = max(potential, along * along / size)
        looked_at.append((is_still, chi2, start))
    if not looked_at:
        return None
    # a fit finds no way from where nothing moves, however little less is left there than where too much does
    met = [(chi2, start) for _, chi2, start in sorted(looked_at)]
    starts = tuple(dict.fromkeys((*item.far, *_begun_at(c, met))))
    return Screened(candidate=c, starts=starts, chi2=met[0][0], potential=potential)


def of_same_family(ranked: Sequence[Candidate], taken: int, leaders: int) -> list[Candidate]:
    """Beyond the first that are `taken`, those of the family of one of the `leaders` that move the vehicle."""
    return same_family(ranked[taken:], [c for c in ranked if c.kind != "sensor"][:leaders])


def _begun_at(c: Candidate, met: Sequence[tuple[float, tuple[float, ...]]]) -> tuple[tuple[float, ...], ...]:
    """Where fits begin: the best starts; of few and far ones the first, or the best and beside what changes nothing."""
    if c.null is None:
        return _apart(met)
    null = [n + SETTINGS.fit.parameterisation.zero_step for n in c.null if n is not None]
    if len(null) < len(c.null):
        return tuple(start for _, start in met[: SETTINGS.selection.score_test.ways])
    return (tuple(null), met[0][1])


def _apart(met: Sequence[tuple[float, tuple[float, ...]]]) -> tuple[tuple[float, ...], ...]:
    """The best start, and of two parameters the best one that is not beside it."""
    best = met[0][1]
    if len(best) < 2:
        return (best,)
    other = [s for _, s in met if max(abs(a - b) for a, b in zip(s, best, strict=True)) > TUNING.start_distance]
    return (best, *other[:1])


def promising(
    candidates: Sequence[Candidate], scored: ScoreTest, effort: Effort = SETTINGS.forward.drops
) -> list[Candidate]:
    """Those that scored best, and of two parameters all: beside their thresholds a score tells little.

    Where each costs runs, of these only the family of what leads, and a few that move the vehicle in any case.
    """
    ranked = scored.ranked(candidates)
    if effort.scored is not None:
        moving = [c for c in ranked if c.kind != "sensor"][: effort.promising]
        related = of_same_family(ranked, effort.scored, effort.leaders)
        return list({c.key: c for c in (*ranked[: effort.scored], *moving, *related)}.values())
    return [c for k, c in enumerate(ranked) if k < TUNING.scored or len(c.search) > 1]


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
    samples count in full what comes near is estimated best, with diverged ones weighted down what is far off.
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
        best = sorted((least, key, x) for key, (least, x) in met.items() if least < SCAN.clear_share * usual)
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
        if hinted.p_value() > SCAN.hint_p_value:
            return hinted
    return score_candidates(problem, current, candidates, groups, parallel_map=parallel_map)
