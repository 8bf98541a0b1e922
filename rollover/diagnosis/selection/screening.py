"""Candidates screened on a few recordings at a few points each: which are worth a fit, and where it may begin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from rollover.diagnosis.fit.finite_differences import Point
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted, ResidualBlock, without_shift_direction
from rollover.diagnosis.fit.parameterisation import Candidate, same_family
from rollover.diagnosis.fit.step import Inquiry, Screened
from rollover.diagnosis.fit.tasks import ParallelMap, serial_map
from rollover.diagnosis.fit.time_shift import shifts_from_contact
from rollover.diagnosis.selection.score_test import ScoreTest
from rollover.diagnosis.settings import SETTINGS
from rollover.diagnosis.settings.forward import Effort

TUNING = SETTINGS.selection.screening


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
    """Beyond the first that are `taken`, those akin to one of the `leaders` that move the vehicle."""
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
