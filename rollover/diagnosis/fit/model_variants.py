"""An effect's shape and its other forms: fits of what is usually held, and of another law in its place."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted
from rollover.diagnosis.fit.local_search import completed_shifts, polish, ranked_by_misfit, representative_recordings
from rollover.diagnosis.fit.parameterisation import Candidate, coordinate
from rollover.diagnosis.settings import SETTINGS

TUNING = SETTINGS.fit.model_variants
# of a coordinate: where a threshold of another form may lie
BESIDE_VARIANT = np.linspace(TUNING.threshold_low, TUNING.threshold_high, TUNING.threshold_count)


def with_fitted_secondary(problem: Problem, f: Fitted, leaves: Sequence[float]) -> Fitted | None:
    """The fit with the shape of its last effect, begun where short fits from some places leave least; None if none.

    None too where these come nowhere near what another explanation `leaves` of each recording; so in another form. On
    the way the usual shape may be met better than before: what is abrupt is a cliff that a smooth one leads around. It
    is returned where the other does not pay.
    """
    if not f.candidates[-1].secondary:
        return None
    last, at = f.candidates[-1], len(f.x) - len(f.candidates[-1].search)
    along = replace(last.whole(), along=tuple(last.secondary))
    points = [(*f.x[:at], *start) for start in last.with_secondary(f.x[at:])]
    found = _best_from(problem, f, along, points, leaves)
    if found is None:
        return None
    if found.chi2 > f.chi2:  # the few led to where the others are not met: all of them, from where the fit stands
        onward = problem.fit((*f.candidates[:-1], along), points[0], shifts=[b.shift for b in f.blocks])
        found = min((one for one in (found, onward) if one is not None), key=lambda one: one.chi2)
    if found.chi2 > _extent_of_all(f, leaves):
        return None
    found = found if is_noise(found) or found.chi2 > TUNING.no_ridge_above * sum(leaves) else polish(problem, found)
    (whole, x), shifts = found.candidates[-1].plain(found.own), [b.shift for b in found.blocks]
    variant = problem.fit((*f.candidates[:-1], whole), (*found.x[:at], *x), shifts=shifts, width=2)
    own = dict(zip(found.candidates[-1].search, found.own, strict=True))
    usual = problem.fit(f.candidates, (*found.x[:at], *(own[name] for name in last.search)), shifts=shifts, width=2)
    if variant is None or usual is None:
        return variant or usual
    return (
        usual
        if usual.chi2 < variant.chi2 + enough(variant.chi2, sum(b.residual.size for b in variant.blocks))
        else variant
    )


def as_variant(problem: Problem, f: Fitted, last: Candidate, leaves: Sequence[float]) -> Fitted | None:
    """The fit with its last effect in another form, begun where it leaves least.

    A threshold lies elsewhere in another form; what is fitted instead of another number is looked for over its range.
    """
    known, at, shifts = f.candidates[-1].values(f.own), len(f.x) - len(f.own), [b.shift for b in f.blocks]
    axes: list[list[float]] = []
    for name, search in last.search.items():
        there = coordinate(known[name], search) if name in known else None
        several = [there + float(d) for d in BESIDE_VARIANT] if there is not None and not axes else [there]
        axes.append(
            list(TUNING.new_points) if there is None else [v for v in several if v is not None and 0.0 < v < 1.0]
        )
    points = [(*f.x[:at], *own) for own in itertools.product(*axes)]
    met = ranked_by_misfit(problem, (*f.candidates[:-1], last), points, shifts, representative_recordings(f))
    found = _best_from(problem, f, last, met[: 2 * SETTINGS.fit.local_search.starts], leaves)
    return found if found is not None and found.chi2 < _extent_of_all(f, leaves) else None


def enough(chi2: float, size: int) -> float:
    """The gain that pays for a shape where so much is left of so many samples."""
    return TUNING.least_gain * max(1.0, chi2 / size)


def is_noise(fitted: Fitted) -> bool:
    """Whether a fit needs no further search."""
    return fitted.chi2 < SETTINGS.fit.levenberg_marquardt.noise_left**2 * sum(b.residual.size for b in fitted.blocks)


def _best_from(
    problem: Problem, f: Fitted, last: Candidate, points: Sequence[tuple[float, ...]], leaves: Sequence[float]
) -> Fitted | None:
    """The best fit with another last effect from some places.

    Short fits to the recordings that are met worst, best and in the middle tell where to begin, and a few rounds of
    all which of these lead to one place; None if none can be made, or where much more than noise is left and none soon
    takes a part of that: a shape that is the right one does. What then comes nowhere near what another explanation
    `leaves` is returned as it stands.
    """
    candidates, few = (*f.candidates[:-1], last), representative_recordings(f)
    at = [f.blocks[r].shift for r in few]
    short = [
        problem.fit(candidates, x, rounds=TUNING.short_rounds, shifts=at, only=few, no_jacobian=True) for x in points
    ]
    # fitted alone these soon leave less than beside all others
    own = sum(f.blocks[r].total for r in few)
    most = min(
        TUNING.followed_misfit * own,
        largest_useful_misfit(
            [leaves[r] for r in few], sum(f.blocks[r].residual.size for r in few), TUNING.short_excess
        ),
    )
    if sum(leaves) > TUNING.much_left**2 * sum(b.residual.size for b in f.blocks):
        most = min(most, TUNING.secondary_misfit * own)
    begun: list[Fitted] = []
    for one in sorted((one for one in short if one is not None and one.total < most), key=lambda one: one.total):
        if begun and one.total > TUNING.followed_misfit * begun[0].total:
            break
        if len(begun) < SETTINGS.fit.local_search.starts and not any(_is_same_minimum(one, other) for other in begun):
            begun.append(one)
    begun = [one for k, one in enumerate(begun) if not any(_is_same_ridge(one, other) for other in begun[:k])]
    held = [b.shift for b in f.blocks]
    again = [
        problem.fit(
            candidates, one.x, shifts=completed_shifts(held, one, few), rounds=TUNING.meeting_rounds, no_jacobian=True
        )
        for one in begun
    ]
    best: Fitted | None = None
    done: list[Fitted] = []
    most = _extent_of_all(f, leaves)
    for one in sorted((one for one in again if one is not None), key=lambda one: one.total):
        if one.total > most:
            return best or one
        if any(_is_same_minimum(one, other, TUNING.meeting_distance) for other in done) or (
            best and one.total > TUNING.followed_misfit * best.chi2
        ):
            continue
        done.append(one)
        ended = problem.fit(candidates, one.x, shifts=[b.shift for b in one.blocks])
        best = min((f for f in (best, ended) if f is not None), key=lambda f: f.chi2, default=None)
        if best is not None and is_noise(best):
            break
    return best


def largest_useful_misfit(leaves: Sequence[float], size: int, part: float) -> float:
    """What a fit on its way may leave that is to meet as well as another, which `leaves` so much of each recording.

    As far again from the noise as that is, or `part` of the samples.
    """
    chi2 = sum(leaves)
    return chi2 + max((SETTINGS.fit.local_search.abandon_above - 1.0) * (chi2 - size), part * size)


def _extent_of_all(f: Fitted, leaves: Sequence[float]) -> float:
    """The same of a fit to all recordings that was gone on with."""
    return largest_useful_misfit(leaves, sum(b.residual.size for b in f.blocks), TUNING.followed_excess)


def _is_same_ridge(one: Fitted, other: Fitted) -> bool:
    """Whether two short fits are on their way to one place, and as far."""
    return (
        _is_same_minimum(one, other, TUNING.meeting_distance)
        and abs(one.total - other.total) < TUNING.same_misfit * other.total
    )


def _is_same_minimum(one: Fitted, other: Fitted, within: float = TUNING.same_point) -> bool:
    """Whether two fits ended in one place."""
    return max(abs(a - b) for a, b in zip(one.x, other.x, strict=True)) < within
