"""Fits begun otherwise than from a first look: behind cliffs, with another shape of an effect, with other clocks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from rollover.diagnosis.fit.cross_validation import held_out
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted, ResidualBlock
from rollover.diagnosis.fit.local_search import (
    chi2_at,
    frequency_scan,
    grid_scan,
    representative_recordings,
    separate_minima,
    smallest_misfit,
    starts_along_secondary,
)
from rollover.diagnosis.fit.model_variants import enough, is_noise
from rollover.diagnosis.fit.parameterisation import Candidate
from rollover.diagnosis.fit.step import Inquiry
from rollover.diagnosis.fit.tasks import How, Task
from rollover.diagnosis.fit.threshold_scan import is_clock, threshold_ranges
from rollover.diagnosis.inference.lack_of_fit import mismatch_of
from rollover.diagnosis.selection.score_test import ScoreTest
from rollover.diagnosis.settings import SETTINGS

TUNING = SETTINGS.selection.restarts
FOLLOWED: tuple[How, ...] = ("polish", "time")  # how what rings is gone on with


def from_other_starts(
    inquiry: Inquiry, base: Fitted, fits: Sequence[Fitted], scored: ScoreTest, shifts: Sequence[float]
) -> list[Fitted]:
    """The fits, best first; those that gained little are begun again from other starts and with other shapes."""
    count = sum(b.residual.size for b in base.blocks)
    if fits[0].chi2 > TUNING.rugged_above**2 * count:
        return _refit_on_few(inquiry, base, _damping_frequency_scan(inquiry, fits, scored, shifts), scored, shifts)
    return _recheck_promising(inquiry, base, fits, scored, shifts)


def _recheck_promising(
    inquiry: Inquiry, base: Fitted, fits: Sequence[Fitted], scored: ScoreTest, shifts: Sequence[float]
) -> list[Fitted]:
    """The fits, best first, with those whose slopes lead and whose usual shape does not bear them out."""
    gains = {f.candidates[-1].key: base.chi2 - f.chi2 for f in best_of_each(fits)}
    points = []
    for c in (c for c in inquiry.free(base) if c.secondary):
        score = scored.scores.get(c.key, 0.0)
        if (
            score > max(TUNING.promised_share * scored.score, SETTINGS.fit.model_variants.least_gain)
            and gains.get(c.key, 0.0) < TUNING.promised_share * score
        ):
            points.append((c, (*base.x, *scored.starts.get(c.key, c.starts())[0])))
    return _with_secondary_starts(inquiry, base, fits, points, shifts)


def _damping_frequency_scan(
    inquiry: Inquiry, fits: Sequence[Fitted], scored: ScoreTest, shifts: Sequence[float]
) -> list[Fitted]:
    """The fits, best first, the best that rings begun anew along its damping and its frequency.

    It leads by what it leaves, or by its score: its frequency may have been found beside a wrong damping.
    """
    near = [f for f in fits if f.chi2 < TUNING.leading_misfit * fits[0].chi2 or f.candidates[-1].key == scored.best]
    old = next((f for f in near if f.candidates[-1].is_oscillatory and len(f.own) == 2), None)
    if old is None:
        return list(fits)
    few = representative_recordings(old)
    begun = [
        (old.candidates, x)
        for x in separate_minima(_ranked_points(inquiry, old.candidates, grid_scan(old), shifts, few))
    ]
    begun += _by_frequency(inquiry, old, shifts, few)
    made = inquiry.fits([Task(candidates=c, start=x, shifts=tuple(shifts), width=1) for c, x in begun])
    new = _fewest_parameters([f for f in made if f is not None] or [old], sum(b.residual.size for b in old.blocks))
    for how in FOLLOWED:
        new = inquiry.fits([continued_from(new, how)])[0] or new
    better = new if new.chi2 < old.chi2 else old
    return sorted([better, *(f for f in fits if f is not old)], key=lambda f: f.chi2)


def _by_frequency(
    inquiry: Inquiry, old: Fitted, shifts: Sequence[float], few: Sequence[int]
) -> list[tuple[tuple[Candidate, ...], tuple[float, ...]]]:
    """Where what rings last in a fit leaves least at all frequencies and shapes: first of the recording met worst."""
    *beside, last = old.candidates
    at = old.x[: len(old.x) - len(old.own)]
    whole, points = frequency_scan(last, old.own)
    candidates, worst = (*beside, whole), max(few, key=lambda r: old.blocks[r].total)
    heard = _ranked_points(inquiry, candidates, [(*at, *own) for own in points], shifts, (worst,))[
        : TUNING.most_oscillations
    ]
    plain = [
        whole.plain(x[len(at) :])
        for x in separate_minima(_ranked_points(inquiry, candidates, [x for _, x in heard], shifts, few))
    ]
    return [((*beside, c), (*at, *own)) for c, own in plain]


def _ranked_points(
    inquiry: Inquiry,
    candidates: Sequence[Candidate],
    points: Sequence[tuple[float, ...]],
    shifts: Sequence[float],
    few: Sequence[int],
) -> list[tuple[float, tuple[float, ...]]]:
    """What is left of `few` recordings at those of some places that can be simulated, with these, the least first."""
    misfit_of_few = partial(_misfit_of_few, candidates=tuple(candidates), shifts=tuple(shifts), few=tuple(few))
    met = zip(inquiry.parallel_map(misfit_of_few, points), points, strict=True)
    return sorted((there, x) for there, x in met if there is not None)


def _misfit_of_few(
    problem: Problem,
    x: tuple[float, ...],
    *,
    candidates: Sequence[Candidate],
    shifts: Sequence[float],
    few: Sequence[int],
) -> float | None:
    """What is left of `few` recordings at x; None if a run fails."""
    return chi2_at(problem, candidates, x, shifts, few)


def _refit_on_few(
    inquiry: Inquiry, base: Fitted, fits: Sequence[Fitted], scored: ScoreTest, shifts: Sequence[float]
) -> list[Fitted]:
    """The fits, best first, with those whose shape may be wrong for a few recordings alone, fitted together with it.

    Such a one meets most recordings far better than the best does, by the middle one, and leaves a few altogether: a
    face that is held lets go or does not.
    """
    able = [c for c in inquiry.free(base) if c.secondary]
    begun = [tuple((*base.x, *start) for start in (*scored.starts.get(c.key, ()), *c.starts())) for c in able]
    most = TUNING.better_share * _middle(fits[0].blocks)
    best_middle = partial(_best_middle, beside=base.candidates, shifts=tuple(shifts), most=most)
    met = zip(able, inquiry.parallel_map(best_middle, list(zip(able, begun, strict=True))), strict=True)
    points = [(c, x) for c, x in met if x is not None]
    return _with_secondary_starts(inquiry, base, fits, points, shifts)


def _with_secondary_starts(
    inquiry: Inquiry,
    base: Fitted,
    fits: Sequence[Fitted],
    points: Sequence[tuple[Candidate, tuple[float, ...]]],
    shifts: Sequence[float],
) -> list[Fitted]:
    """The fits, best first, with those of candidates fitted together with their shapes from places beside the base.

    They are begun where least is left all along each parameter of the shape. One that comes nowhere near what the best
    fit leaves is not gone on with.
    """
    sets = [((*base.candidates, c.whole()), starts_along_secondary(c, x)) for c, x in points]
    parts = [(candidates, tuple(every[k :: TUNING.parts])) for candidates, every in sets for k in range(TUNING.parts)]
    met = inquiry.parallel_map(partial(smallest_misfit, shifts=tuple(shifts)), parts)
    tasks = []
    for k, (candidates, _) in enumerate(sets):
        least = min((one for one in met[k * TUNING.parts : (k + 1) * TUNING.parts] if one is not None), default=None)
        if least is not None:
            tasks.append(Task(candidates=candidates, start=least[1], shifts=tuple(shifts), width=1))
    begun = [f for f in inquiry.fits(tasks) if f is not None]
    near = [f for f in begun if f.chi2 <= SETTINGS.fit.local_search.abandon_above * fits[0].chi2]
    followed = zip(inquiry.fits([continued_from(f, "polish") for f in near]), near, strict=True)
    others = [f for f in begun if not any(f is one for one in near)]
    return sorted([*fits, *others, *(new or old for new, old in followed)], key=lambda f: f.chi2)


def _best_middle(
    problem: Problem,
    begun: tuple[Candidate, tuple[tuple[float, ...], ...]],
    *,
    beside: tuple[Candidate, ...],
    shifts: tuple[float, ...],
    most: float,
) -> tuple[float, ...] | None:
    """Where a candidate leaves least of the middle recording of those places; None if nowhere less than `most`."""
    c, points = begun
    met = [(chi2, x) for x in points if (chi2 := _middle_at(problem, (*beside, c), x, shifts, most)) is not None]
    return min(met)[1] if met else None


def _middle_at(
    problem: Problem, candidates: Sequence[Candidate], x: tuple[float, ...], shifts: Sequence[float], most: float
) -> float | None:
    """What the middle recording leaves per sample at x; None from `most` on, or where one cannot be simulated."""
    chi2: list[float] = []
    for r, shift in enumerate(shifts):
        block = problem.block(r, candidates, x, shift, 0.0)
        if block is None:
            return None
        chi2.append(_per_sample(block))
        # with so many beyond twice the most the middle one, or the mean of two, is beyond it
        if 2 * sum(v >= 2.0 * most for v in chi2) >= len(shifts):
            return None
    middle = float(np.median(chi2))
    return middle if middle < most else None


def _middle(blocks: Sequence[ResidualBlock]) -> float:
    """What the middle one of several recordings leaves per sample."""
    return float(np.median([_per_sample(b) for b in blocks]))


def _per_sample(block: ResidualBlock) -> float:
    """What is left of a recording per sample."""
    return block.normal()[2] / block.residual.size


def with_secondary_parameters(inquiry: Inquiry, base: Fitted, fits: Sequence[Fitted]) -> list[Fitted]:
    """The fits with shapes fitted too where that pays, best first; other forms if the best leaves more than chance.

    Of an effect that takes next to nothing from what the base leaves no shape or form will take it all.
    """
    lead = min(fits, key=lambda f: f.chi2)
    best, size = lead.chi2, sum(b.residual.size for b in fits[0].blocks)
    held = [held_out(f, inquiry.groups).total ** 2 for f in fits]
    is_whole = mismatch_of(inquiry.problem.dataset, lead.blocks, inquiry.phases).p_value > TUNING.chance_p_value
    ways: list[tuple[int, Task]] = []
    for k, (f, ahead) in enumerate(zip(fits, held, strict=True)):
        is_near = f.chi2 < TUNING.shaped_misfit * best or ahead < TUNING.shaped_misfit * min(held)
        if not is_near or base.chi2 - f.chi2 < TUNING.least_share * (base.chi2 - size):
            continue
        tasks = [continued_from(f, "secondary")] if f.candidates[-1].secondary else []
        tasks += (
            []
            if is_whole
            else [replace(continued_from(f, "secondary"), variant=c) for c in f.candidates[-1].variants()]
        )
        ways += [(k, replace(task, leaves=tuple(b.total for b in lead.blocks))) for task in tasks]
    made: dict[int, list[Fitted]] = {}
    for (k, _), new in zip(ways, _polished(inquiry, inquiry.fits([task for _, task in ways]), best), strict=True):
        if new is not None:
            made.setdefault(k, []).append(new)
    found = list(fits)
    for k, several in made.items():
        new = _fewest_parameters(several, size)
        if new.chi2 < fits[k].chi2 - enough(best, size):
            found[k] = new
    return sorted(found, key=lambda f: f.chi2)


def _polished(inquiry: Inquiry, fits: Sequence[Fitted | None], best: float) -> list[Fitted | None]:
    """Fits, those in another form that come near the best of all and leave more than noise followed on."""
    least = min([best, *(f.chi2 for f in fits if f is not None)])
    near = [
        f
        for f in fits
        if f is not None and f.candidates[-1].variant and f.chi2 < TUNING.leading_misfit * least and not is_noise(f)
    ]
    followed = inquiry.fits([continued_from(f, "polish") for f in near])
    better = {id(old): new for old, new in zip(near, followed, strict=True)}
    return [better.get(id(f)) or f for f in fits]


def _fewest_parameters(fits: Sequence[Fitted], size: int) -> Fitted:
    """Of an effect in several forms the one that asks for least, of those that meet all as well."""
    least = min(f.chi2 for f in fits)
    near = [f for f in fits if f.chi2 < least + enough(least, size)]
    return min(near, key=lambda f: (len(f.x), bool(f.candidates[-1].variant), f.chi2))


def with_time_shifts(inquiry: Inquiry, base: Fitted, fits: Sequence[Fitted]) -> list[Fitted]:
    """The fits, the near ones with their time shifts tried out, and clocks all along their range, best first.

    Beside what is hardly met at all everything is near: an effect must gain a share of what the best does.
    """
    least = min(f.chi2 for f in fits)
    near = [
        f
        for f in fits
        if f.chi2 < TUNING.tied_misfit * least and base.chi2 - f.chi2 >= TUNING.least_share * (base.chi2 - least)
    ]
    others = [f for f in fits if not any(f is one for one in near)]
    traced = [with_thresholds_traced(inquiry, f) if is_clock(f) else f for f in near]
    timed = [new or f for new, f in zip(inquiry.fits([continued_from(f, "time") for f in traced]), traced, strict=True)]
    return sorted(with_common_time_shifts(inquiry, timed) + others, key=lambda f: f.chi2)


def with_known_minima(inquiry: Inquiry, base: Fitted, fits: Sequence[Fitted]) -> list[Fitted]:
    """The fits, begun again where those under another noise ended if that leaves less; never worse.

    Which of several minima a search comes to hangs on the noise, which of two is the better one does not. What was not
    fitted here is fitted too if it leaves about as little as the best.
    """
    found, size = {f.candidates[-1].key: f for f in fits}, sum(b.residual.size for b in base.blocks)
    free = {c.key for c in inquiry.free(base)}
    known = [f for f in inquiry.known if f.candidates[:-1] == base.candidates and f.candidates[-1].key in free]
    ended = [f for f in inquiry.fits([continued_from(f, "fit") for f in known]) if f is not None]
    least = min(f.chi2 for f in (*fits, *ended))
    for new in ended:
        old = found.get(new.candidates[-1].key)
        most = TUNING.leading_misfit * least if old is None else old.chi2 - enough(old.chi2, size)
        if new.chi2 < most:
            found[new.candidates[-1].key] = new
    return sorted(found.values(), key=lambda f: f.chi2)


def with_common_time_shifts(inquiry: Inquiry, fits: Sequence[Fitted]) -> list[Fitted]:
    """The fits; some recordings at the time shifts of the one that leaves least, where that is better; never worse.

    Edges leave a shift in the first dip of many, and a recording's clock is the same whatever is missing.
    """
    if len(fits) < 2:
        return list(fits)
    lead = min(fits, key=lambda f: f.chi2)
    shifts = [_shifts_beside(inquiry.problem, f, lead) for f in fits]
    tasks = {k: replace(continued_from(fits[k], "time"), shifts=s) for k, s in enumerate(shifts) if s is not None}
    found = dict(zip(tasks, inquiry.fits(list(tasks.values())), strict=True))
    return [min((f, found.get(k) or f), key=lambda one: one.chi2) for k, f in enumerate(fits)]


def _shifts_beside(problem: Problem, fitted: Fitted, lead: Fitted) -> tuple[float, ...] | None:
    """Time shifts (s) of all recordings, those of `lead` where they leave less; None if they do nowhere."""
    shifts = [b.shift for b in fitted.blocks]
    for r, (own, other) in enumerate(zip(fitted.blocks, lead.blocks, strict=True)):
        if abs(other.shift - own.shift) > TUNING.same_shift:
            there = problem.block(r, fitted.candidates, fitted.x, other.shift, 0.0, clock=False)
            if there is not None and there.total < own.total - SETTINGS.fit.local_search.least_gain:
                shifts[r] = other.shift
    return tuple(shifts) if any(s != b.shift for s, b in zip(shifts, fitted.blocks, strict=True)) else None


def with_thresholds_traced(inquiry: Inquiry, fitted: Fitted) -> Fitted:
    """The fit, or a better one begun where a threshold of its last effect lies elsewhere."""
    begun = inquiry.fits([replace(continued_from(fitted, "trace"), stretch=s) for s in threshold_ranges(fitted)])
    return min([fitted, *(f for f in begun if f is not None)], key=lambda f: f.chi2)


def continued_from(f: Fitted, how: How) -> Task:
    """What is made of a fit where it stands."""
    return Task(how=how, candidates=f.candidates, start=f.x, shifts=tuple(b.shift for b in f.blocks))


def best_of_each(fits: Sequence[Fitted]) -> list[Fitted]:
    """The best fit of each candidate."""
    best: dict[str, Fitted] = {}
    for f in sorted(fits, key=lambda f: f.chi2):
        best.setdefault(f.candidates[-1].key, f)
    return list(best.values())
