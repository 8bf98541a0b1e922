"""The way down first: what acts only behind the deepest point is no reason for what is seen before it.

Where much is missing on the way back, as of ground that springs, no effect of the way down meets a recording well, and
one that meets neither may lead. Up to the deepest point it is out of sight.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from rollover.diagnosis.clocks import align
from rollover.diagnosis.crew import Job
from rollover.diagnosis.evidence import Evidence
from rollover.diagnosis.explain import NEARLY_NOISE, Step
from rollover.diagnosis.fit import Fitted, Judge
from rollover.diagnosis.inquiry import Inquiry
from rollover.diagnosis.one_by_one import HOPELESS, Taken, is_better, one_by_one

FEWEST = 8  # samples of a signal on the way down
RIVALS = 5  # that are held against the best over the whole way
NEARLY_DOWN = "peak"  # phase that begins a little before the deepest point


def down_first(inquiry: Inquiry, found: Taken) -> Taken:
    """What was found, or a better one begun with what explains the way down alone; only where much is left."""
    judge, base = inquiry.judge, found.base
    if judge.effort.thrifty or found.fitted.left < HOPELESS**2 * found.count:
        return found
    some = [_cut(e, phases) for e, phases in zip(judge.evidence, inquiry.phases, strict=True)]
    early = Judge([e for e in some if e is not None])
    if len(early.evidence) < len(some):
        return found
    inquiry.say("the way down first")
    align(early)
    bare = early.fit((), ())
    above = one_by_one(replace(inquiry, judge=early), bare) if bare is not None else None
    judge.simulations += early.simulations
    if above is None or not above.steps or above.fitted.left > NEARLY_NOISE**2 * above.count:
        return found
    begun, held = _over_all(inquiry, base, above.steps), judge.evidence
    other = one_by_one(inquiry, base, begun) if begun else None
    if other is not None and is_better(other.fitted, other.left, found.fitted):
        return other
    judge.weigh(held)
    return found


def _cut(e: Evidence, phases: Sequence[tuple[float, str]]) -> Evidence | None:
    """What was recorded before the deepest point was near; None where a signal has too little of it."""
    ends = [start for start, name in phases if name == NEARLY_DOWN]
    if not ends:
        return None
    kept = [e.recording.time[s.rows] < ends[0] for s in e.signals]
    if any(inside.sum() < FEWEST for inside in kept):
        return None
    return e.cut(kept)


def _over_all(inquiry: Inquiry, base: Fitted, steps: Sequence[Step]) -> list[Step]:
    """The steps with their best and nearest rivals fitted over the whole way, each beside the one before."""
    made: list[Step] = []
    beside = base
    for s in steps:
        near = [s.fitted, *sorted((f for f in s.rivals if f is not s.fitted), key=lambda f: f.left)[:RIVALS]]
        jobs = [Job(candidates=f.candidates, start=f.x, shifts=tuple(b.shift for b in f.blocks)) for f in near]
        best, *rivals = inquiry.fits(jobs)
        if best is None:
            return []
        others = tuple(f for f in rivals if f is not None)
        made.append(replace(s, base=beside, fitted=best, rivals=(best, *others)))
        beside = best
    return made
