"""Two effects at once, where one after the other led to something else."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

from rollover.diagnosis.blocks import turned
from rollover.diagnosis.candidates import Candidate
from rollover.diagnosis.crew import Job
from rollover.diagnosis.explain import Step
from rollover.diagnosis.gate import Gate
from rollover.diagnosis.inquiry import Inquiry
from rollover.diagnosis.otherwise import shaped_too
from rollover.diagnosis.refine import BEHIND, few_of, shifts_told
from rollover.diagnosis.screening import is_far

LEADING, FOLLOWING = 4, 2  # of the first effects, and of later ones each, that are tried two by two
SCORED = 10  # so many more, by what they scored at first
ROUNDS = 8  # of a short fit to few recordings
WHOLE = 6  # of these that are fitted to all


def best_pair(inquiry: Inquiry, first: Step, taken: Sequence[Step], looked: Gate) -> Step | None:
    """The best pair of the first step's rivals, of what led later, and of what scored most, as a step of its second.

    Of two effects neither need come first alone: a third may be like both, and the second may leave much alone. Short
    fits tell which pairs are worth whole ones; the best takes the shapes that pay if it comes near what others leave.
    """
    judge = inquiry.judge
    partners = _partners(inquiry, first, taken, looked)
    lead = min(first.rivals, key=lambda f: f.left)
    few, shifts = few_of(lead), tuple(b.shift for b in lead.blocks)
    at, pinned = tuple(shifts[r] for r in few), is_far(judge, first.base)
    pairs = list(itertools.combinations(partners, 2))
    inquiry.say(f"{len(pairs)} pairs of effects")
    jobs = [
        Job(candidates=(a, b), start=(*x, *y), shifts=at, only=tuple(few), rounds=ROUNDS, pinned=pinned)
        for (a, x), (b, y) in pairs
    ]
    short = sorted((f for f in inquiry.fits(jobs) if f is not None), key=lambda f: f.left)
    jobs = [Job(candidates=f.candidates, start=f.x, shifts=shifts_told(shifts, f, few), width=1) for f in short[:WHOLE]]
    fits = [f for f in inquiry.fits(jobs) if f is not None]
    if not fits:
        return None
    best = min(fits, key=lambda f: f.left)
    if best.left < BEHIND * (taken[-1] if taken else first).fitted.left:
        ways = (best, judge.again(turned(best)))
        jobs = [Job(candidates=p.candidates[:-1], start=p.x[: -len(p.own)], shifts=shifts) for p in ways]
        for pair, alone in zip(ways, inquiry.fits(jobs), strict=True):
            if alone is not None:
                best = min(best, *shaped_too(inquiry, alone, [pair]), key=lambda f: f.left)
    alone = judge.fit(best.candidates[:-1], best.x[: -len(best.own)], shifts=[b.shift for b in best.blocks])
    return None if alone is None else Step(base=alone, fitted=best, p_value=first.p_value, rivals=(best,))


def _partners(
    inquiry: Inquiry, first: Step, taken: Sequence[Step], looked: Gate
) -> list[tuple[Candidate, tuple[float, ...]]]:
    """Who may be one of two, and where its fit begins."""
    leading = sorted((inquiry.judge.again(f) for f in first.rivals), key=lambda f: f.left)[:LEADING]
    later = [f for s in taken[1:] for f in sorted(s.rivals, key=lambda f: f.left)[:FOLLOWING]]
    found: dict[str, tuple[Candidate, tuple[float, ...]]] = {}
    for f in (*leading, *later):
        found.setdefault(f.candidates[-1].key, (f.candidates[-1], f.own))
    for s in sorted(first.screened, key=lambda s: -looked.scores.get(s.candidate.key, 0.0))[:SCORED]:
        found.setdefault(s.candidate.key, (s.candidate, s.starts[0]))
    return list(found.values())
