"""Fits begun otherwise than from a first look: behind cliffs, with another shape of an effect, with other clocks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from rollover.diagnosis.blocks import Block
from rollover.diagnosis.candidates import Candidate
from rollover.diagnosis.crew import Job
from rollover.diagnosis.detect import mismatch_of
from rollover.diagnosis.fit import Fitted
from rollover.diagnosis.gate import Gate
from rollover.diagnosis.holdout import held_out
from rollover.diagnosis.inquiry import Inquiry
from rollover.diagnosis.refine import WORTH

RUGGED = 2.0  # misfit over the noise that the best leaves, from which on there may be something behind a cliff
LEADS = 1.5  # times what the best leaves, up to which it is looked for
MOSTLY = 0.25  # of what the middle recording is left with by the best, below which an effect is the better one there
PROMISED = 0.5  # of the best score: what has it, and gains less than half of its own, may have another shape
TIED = 1.2  # times what the best leaves, up to which time shifts are tried out
BY_CHANCE = 0.01  # p-value of what is left, above which no other form of an effect is looked for
SHAPED = 4.0  # times what the best leaves, up to which an effect's shape is fitted too


def begun_otherwise(
    inquiry: Inquiry, base: Fitted, fits: Sequence[Fitted], looked: Gate, shifts: Sequence[float]
) -> list[Fitted]:
    """The fits, best first, with those that another beginning or another shape makes of what did not come far."""
    count = sum(b.residual.size for b in base.blocks)
    if fits[0].left > RUGGED**2 * count:
        return _but_for_some(inquiry, base, _combed(inquiry, fits, shifts), looked, shifts)
    return _as_promised(inquiry, base, fits, looked, shifts)


def _as_promised(
    inquiry: Inquiry, base: Fitted, fits: Sequence[Fitted], looked: Gate, shifts: Sequence[float]
) -> list[Fitted]:
    """The fits, best first, with those whose slopes lead and whose usual shape does not bear them out."""
    gains = {f.candidates[-1].key: base.left - f.left for f in one_each(fits)}
    places = []
    for c in (c for c in inquiry.free(base) if c.shapes):
        score = looked.scores.get(c.key, 0.0)
        if score > max(PROMISED * looked.score, WORTH) and gains.get(c.key, 0.0) < PROMISED * score:
            places.append((c, (*base.x, *looked.starts.get(c.key, c.starts())[0])))
    return _with_shapes(inquiry, base, fits, places, shifts)


def _combed(inquiry: Inquiry, fits: Sequence[Fitted], shifts: Sequence[float]) -> list[Fitted]:
    """The fits, best first, the best of two parameters begun anew along the second if it leads or nearly so."""
    able = [f for f in fits if len(f.candidates[-1].search) == 2 and f.left < LEADS * fits[0].left][:1]
    jobs = [Job(how="comb", candidates=f.candidates, start=f.x, shifts=tuple(shifts)) for f in able]
    tried = zip(inquiry.fits(jobs), able, strict=True)
    better = [new if new is not None and new.left < old.left else old for new, old in tried]
    return sorted([*better, *(f for f in fits if not any(f is one for one in able))], key=lambda f: f.left)


def _but_for_some(
    inquiry: Inquiry, base: Fitted, fits: Sequence[Fitted], looked: Gate, shifts: Sequence[float]
) -> list[Fitted]:
    """The fits, best first, with those whose shape may be wrong for a few recordings alone, fitted together with it.

    Such a one meets most recordings far better than the best does, by the middle one, and leaves a few altogether: a
    face that is held lets go or does not.
    """
    usual, places = _middle(fits[0].blocks), []
    for c in (c for c in inquiry.free(base) if c.shapes):
        met = []
        for start in (*looked.starts.get(c.key, ()), *c.starts()):
            x = (*base.x, *start)
            blocks = [inquiry.judge.block(r, (*base.candidates, c), x, s, 0.0) for r, s in enumerate(shifts)]
            if all(b is not None for b in blocks):
                met.append((_middle([b for b in blocks if b is not None]), x))
        if met and min(met)[0] < MOSTLY * usual:
            places.append((c, min(met)[1]))
    return _with_shapes(inquiry, base, fits, places, shifts)


def _with_shapes(
    inquiry: Inquiry,
    base: Fitted,
    fits: Sequence[Fitted],
    places: Sequence[tuple[Candidate, tuple[float, ...]]],
    shifts: Sequence[float],
) -> list[Fitted]:
    """The fits, best first, with those of candidates fitted together with their shapes from places beside the base."""
    jobs = [Job(how="scan", candidates=(*base.candidates, c), start=x, shifts=tuple(shifts)) for c, x in places]
    return sorted([*fits, *(f for f in inquiry.fits(jobs) if f is not None)], key=lambda f: f.left)


def _middle(blocks: Sequence[Block]) -> float:
    """What the middle one of several recordings leaves per sample."""
    return float(np.median([b.normal()[2] / b.residual.size for b in blocks]))


def shaped_too(inquiry: Inquiry, fits: Sequence[Fitted]) -> list[Fitted]:
    """The fits with shapes fitted too where that pays, best first; other forms if the best leaves more than chance."""
    lead = min(fits, key=lambda f: f.left)
    best, size = lead.left, sum(b.residual.size for b in fits[0].blocks)
    held = [held_out(f, inquiry.groups).total ** 2 for f in fits]
    is_whole = mismatch_of(inquiry.judge.evidence, lead.blocks, inquiry.phases).p_value > BY_CHANCE
    able = [
        f
        for f, ahead in zip(fits, held, strict=True)
        if (f.candidates[-1].shapes or (f.candidates[-1].forms() and not is_whole))
        and (f.left < SHAPED * best or ahead < SHAPED * min(held))
    ]
    found = list(fits)
    jobs = [from_there(f, "shape" if is_whole else "form") for f in able]
    for old, new in zip(able, inquiry.fits(jobs), strict=True):
        if new is not None and new.left < old.left - WORTH * max(1.0, best / size):
            found[found.index(old)] = new
    return sorted(found, key=lambda f: f.left)


def timed_too(inquiry: Inquiry, fits: Sequence[Fitted]) -> list[Fitted]:
    """The fits, the near ones with their time shifts tried out, best first."""
    least = min(f.left for f in fits)
    near = [f for f in fits if f.left < TIED * least]
    timed = inquiry.fits([from_there(f, "time") for f in near])
    others = [f for f in fits if f.left >= TIED * least]
    return sorted([new or old for new, old in zip(timed, near, strict=True)] + others, key=lambda f: f.left)


def from_there(f: Fitted, how: Literal["polish", "shape", "form", "time"]) -> Job:
    """What is made of a fit where it stands."""
    return Job(how=how, candidates=f.candidates, start=f.x, shifts=tuple(b.shift for b in f.blocks))


def one_each(fits: Sequence[Fitted]) -> list[Fitted]:
    """The best fit of each candidate."""
    best: dict[str, Fitted] = {}
    for f in sorted(fits, key=lambda f: f.left):
        best.setdefault(f.candidates[-1].key, f)
    return list(best.values())
