"""What a step leads to where its fit is followed to the end, and whether an effect of fewer numbers ends there too."""

from __future__ import annotations

from dataclasses import replace

from rollover.diagnosis.crew import Job
from rollover.diagnosis.detect import Mismatch, mismatch_of
from rollover.diagnosis.explain import NEARLY_NOISE, Step, is_at_an_end
from rollover.diagnosis.fit import Judge
from rollover.diagnosis.inquiry import Inquiry
from rollover.diagnosis.otherwise import traced_too
from rollover.diagnosis.refine import ended, polish, timed

MANY = 0.05  # p-value of what as many effects as may be leave, below which they are no explanation
BESIDE = 3  # rivals of a step that are begun anew beside a better fit of what came before
SIMPLER = 4  # rivals of fewer numbers that are begun anew beside a fit at an end of its range
TELLS = 10.8  # chi-square of one number, p = 0.001


def followed(inquiry: Inquiry, found: Step) -> tuple[Step, Mismatch]:
    """A step and what it leaves; where that is little more than noise, its fit followed to the end; never worse.

    Beside a kink, or a sample that a clock carries over a leap, or in the valley that two effects share, a fit may end
    too early. One effect's is followed only if what it leaves is in doubt, or if it is met better with its threshold
    elsewhere.
    """
    judge, phases, old = inquiry.judge, inquiry.phases, found.fitted
    left = mismatch_of(judge.evidence, old.blocks, phases)
    is_near = old.left < NEARLY_NOISE**2 * sum(b.residual.size for b in old.blocks)
    if judge.effort.thrifty or not is_near:
        return found, left
    new = traced_too(inquiry, old)
    if new.left < old.left or len(old.candidates) > 1 or left.p_value < MANY:
        new = timed(judge, polish(judge, new))
    new = ended(judge, new)
    if new.left < old.left:
        found = _with_rivals(judge, found.moved_to(new))
        left = mismatch_of(judge.evidence, new.blocks, phases)
    simple = _simpler(inquiry, found)
    return (found, left) if simple is None else (simple, mismatch_of(judge.evidence, simple.fitted.blocks, phases))


def _simpler(inquiry: Inquiry, found: Step) -> Step | None:
    """A step by an effect of fewer numbers where one of its own tells nothing, at an end of its range; else None.

    A layer from the surface on is a stiffness. What has fewer numbers is begun beside what stands beside it.
    """
    best, shared = found.fitted, len(found.base.x)
    if not is_at_an_end(best):
        return None
    shifts, able = tuple(b.shift for b in best.blocks), sorted(found.rivals, key=lambda f: f.left)
    able = [f for f in able if len(f.x) < len(best.x) and f.left < found.base.left][:SIMPLER]
    jobs = [Job(candidates=f.candidates, start=(*best.x[:shared], *f.own), shifts=shifts, width=1) for f in able]
    one = min((f for f in inquiry.fits(jobs) if f is not None), key=lambda f: f.left, default=None)
    phi = max(1.0, best.left / sum(b.residual.size for b in best.blocks))
    if one is None or one.left > best.left + phi * TELLS:
        return None
    others = tuple(f for f in found.rivals if f is not best and f.candidates[-1].key != one.candidates[-1].key)
    return replace(found, fitted=one, rivals=(one, *others))


def _with_rivals(judge: Judge, found: Step) -> Step:
    """A step with its nearest rivals begun anew beside what they share with its best, which was followed alone."""
    best, shared = found.fitted, len(found.base.x)
    if shared == 0:
        return found
    shifts, near = [b.shift for b in best.blocks], sorted(found.rivals, key=lambda f: f.left)[:BESIDE]
    rivals = []
    for f in found.rivals:
        begun = f is not best and any(f is one for one in near)
        again = judge.fit(f.candidates, (*best.x[:shared], *f.x[shared:]), shifts=shifts, width=1) if begun else None
        rivals.append(again if again is not None and again.left < f.left else f)
    return replace(found, rivals=tuple(rivals))
