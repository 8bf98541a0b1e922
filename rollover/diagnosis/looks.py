"""Looks at all candidates: where each costs a run on few recordings first, and by known runs where they will do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rollover.diagnosis.candidates import Candidate
from rollover.diagnosis.explain import Groups
from rollover.diagnosis.fit import Fitted, Judge
from rollover.diagnosis.gate import Gate, gate, p_value
from rollover.diagnosis.lasting import SPOKEN, unbent
from rollover.diagnosis.screening import spread

HINTED = 0.2  # p-value beyond which what candidates move elsewhere tells that none is looked for here


def look(
    judge: Judge,
    base: Fitted,
    candidates: Sequence[Candidate],
    groups: Groups,
    beside: Fitted | None = None,
    few: Sequence[int] = (),
) -> Gate:
    """A gate by all recordings; where each look costs a run, of few and then of the best candidates by some more.

    The null stays that of the best of all candidates: what was passed over could only have raised the maximum. Clocks
    are then taken where they say, or nearly so: far off they have eaten what is missing. `beside` as in `gate`, in
    `few` recordings that are given with it.
    """
    effort = judge.effort
    if not effort.thrifty:
        return gate(judge, base, candidates)
    if judge.per_error == 1.0:  # beside a tolerance it cannot be told what a clock has eaten
        base = unbent(judge, base)
    few, more = few or spread(base, groups, effort.few), spread(base, groups, effort.looked_at)
    first, last = _narrowed(judge, base, candidates, few, more, beside)
    if judge.straying:
        return last
    # in full, what one of them lacks hides what the others have
    scores = {key: max(score, first.scores.get(key, 0.0)) for key, score in last.scores.items()}
    moving = [c for c in candidates if c.kind != "sensor"]
    judge.straying = True  # a part that gives way shows in how it does, not in where all else goes then
    forgiven = _narrowed(judge, judge.again(base), moving, few, more, beside)[-1]
    judge.straying = False
    able = [c.key for c in forgiven.ranked(moving) if p_value(forgiven.scores.get(c.key, 0.0), forgiven.null) < SPOKEN]
    scores = {key: max(score, forgiven.scores.get(key, 0.0)) for key, score in scores.items()}
    return replace(last, scores=scores, leading=tuple(able[: effort.leaders]))


def _narrowed(
    judge: Judge,
    base: Fitted,
    candidates: Sequence[Candidate],
    few: Sequence[int],
    more: Sequence[int],
    beside: Fitted | None,
) -> tuple[Gate, Gate]:
    """A gate by few recordings, and one by more of what moves the vehicle best there and of all sensors."""
    effort = judge.effort
    first = gate(judge, base, candidates, few, beside)
    if len(more) <= len(few):
        return first, first
    moving = sorted((c for c in candidates if c.kind != "sensor"), key=lambda c: -first.scores.get(c.key, 0.0))
    able = [*moving[: effort.shortlist], *(c for c in candidates if c.kind == "sensor")]
    second = gate(judge, base, able, more, beside)
    return first, replace(
        second,
        scores={**dict.fromkeys(first.scores, 0.0), **second.scores},
        null=np.maximum(first.null, second.null),
        detectable={**first.detectable, **second.detectable},
        starts={**first.starts, **second.starts},
        only=first.only,
    )


def look_again(
    judge: Judge, current: Fitted, base: Fitted | None, candidates: Sequence[Candidate], groups: Groups, first: Gate
) -> Gate:
    """A look beside an explanation; where looks cost runs, by what candidates move beside the `base`, if that is given.

    Those runs are known from the `first` look. Only if the best of their directions tells something are others made.
    """
    if base is not None and judge.effort.thrifty:
        hinted = look(judge, current, candidates, groups, base, first.only)
        if hinted.p_value() > HINTED:
            return hinted
    return look(judge, current, candidates, groups)
