"""Where an effect sets in: thresholds tried along their range, for what recordings ask for there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rollover.diagnosis.fit.finite_differences import Point
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted, without_shift_direction
from rollover.diagnosis.fit.local_search import blocks_at, chi2_at, representative_recordings
from rollover.diagnosis.fit.parameterisation import Candidate, followed, strength_parameter
from rollover.diagnosis.fit.tasks import Stretch
from rollover.diagnosis.settings import SETTINGS
from rollover.effects import EFFECTS

TUNING = SETTINGS.fit.threshold_scan
# places of a threshold, over its whole range and about a fit
AFAR = (np.arange(TUNING.wide_count) + 0.5) / TUNING.wide_count
NEAR = TUNING.near_step * np.arange(-TUNING.near_count, TUNING.near_count + 1)
CLOCKS = ("sensor-clock-offset", "sensor-clock-drift")


def threshold_ranges(fitted: Fitted) -> list[Stretch]:
    """Where each threshold of the last effect may be tried: below where it was fitted, and above.

    That is each other parameter than the one that says how strong the effect is (`strength_parameter`); of a clock,
    which moves edges past samples, that one; of what rings its shape alone.
    """
    last, at = fitted.candidates[-1], len(fitted.x) - len(fitted.own)
    strength = strength_parameter(last.id, last.search)[0]
    if last.is_oscillatory:
        names = [name for name in last.search if name in EFFECTS[last.id].secondary]
    else:
        names = [name for name in last.search if (name == strength) == is_clock(fitted)]
    points = [at + list(last.search).index(name) for name in names]
    return [s for k in points for s in ((k, 0.0, fitted.x[k]), (k, fitted.x[k], 1.0))]


def is_clock(fitted: Fitted) -> bool:
    """Whether the last effect is the clock of a channel."""
    return fitted.candidates[-1].id in CLOCKS


def has_threshold(c: Candidate) -> bool:
    """Whether one parameter of an effect says how strong it is and another where it sets in, of those it is fitted by.

    Neither of what rings has a null.
    """
    null = EFFECTS[c.id].null
    is_strength_known = null.get(strength_parameter(c.id, c.search)[0]) is not None
    return is_strength_known and any(null.get(name) is None for name in c.search)


def threshold_starts(
    problem: Problem,
    pair: tuple[Candidate, tuple[float, ...], Candidate],
    *,
    few: Sequence[int],
    shifts: Sequence[float],
    base: Point = ((), ()),
) -> tuple[float, ...] | None:
    """Where a fit of two effects beside a base may begin: the first as it is, the second where least of few is left.

    The second has a threshold, and is as strong at each place as these ask for there. None where it helps nowhere.
    """
    first, second = (*base[0], pair[0]), pair[2]
    x = (*base[1], *pair[1])
    blocks = blocks_at(problem, first, x, shifts, few)
    if blocks is None:
        return None
    alone = Fitted(candidates=first, x=x, blocks=tuple(blocks))
    best, least = None, alone.total
    for point in second.scan_points():
        there = _matched_strength(problem, alone, second, (*x, *point), few)
        chi2 = None if there is None else chi2_at(problem, (*first, second), there, shifts, few)
        if chi2 is not None and chi2 < least:
            best, least = there, chi2
    return best


def with_threshold_traced(problem: Problem, fitted: Fitted, stretch: Stretch) -> Fitted:
    """The fit begun anew where its last effect acts elsewhere, as strongly as recordings ask for there; never worse.

    A threshold that moves past a sample leaves a misfit of many small minima: it is tried all along its stretch, and
    finely beside the fit, on few recordings. What rings keeps its frequency meanwhile.
    """
    if fitted.candidates[-1].is_oscillatory:
        return _along_frequency_ridge(problem, fitted, stretch)
    last, shifts = fitted.candidates[-1], [b.shift for b in fitted.blocks]
    k, at = stretch[0], len(fitted.x) - len(fitted.own)
    few = range(len(shifts)) if is_clock(fitted) else representative_recordings(fitted)  # each has its own edges
    blocks = blocks_at(problem, fitted.candidates[:-1], fitted.x[:at], shifts, few)
    best = fitted
    if blocks is None:
        return best
    alone = Fitted(candidates=fitted.candidates[:-1], x=fitted.x[:at], blocks=tuple(blocks))
    met = []
    for v in _scan_points(fitted, stretch):
        there = (*fitted.x[:k], float(v), *fitted.x[k + 1 :])
        x = there if is_clock(fitted) else _matched_strength(problem, alone, last, there, few)
        chi2 = None if x is None else chi2_at(problem, fitted.candidates, x, shifts, few)
        if x is not None and chi2 is not None:
            met.append((chi2, x))
    for x in _best_start(problem, fitted, _local_minima(met)[: TUNING.minima], few):
        again = problem.fit(fitted.candidates, x, shifts=shifts, width=1)
        best = again if again is not None and again.chi2 < best.chi2 else best
    return best


def _best_start(
    problem: Problem, fitted: Fitted, points: Sequence[tuple[float, ...]], few: Sequence[int]
) -> list[tuple[float, ...]]:
    """Of several places those from which a short fit to `few` recordings comes to less than one from where a fit is."""
    at = [fitted.blocks[r].shift for r in few]
    short = [
        problem.fit(fitted.candidates, x, rounds=TUNING.short_rounds, only=few, shifts=at, width=1, no_jacobian=True)
        for x in (fitted.x, *points)
    ]
    own = np.inf if short[0] is None else short[0].total
    return [one.x for one in short[1:] if one is not None and one.total < own]


def _along_frequency_ridge(problem: Problem, fitted: Fitted, stretch: Stretch) -> Fitted:
    """An oscillatory effect refitted from other secondary parameters, along its frequency's ridge; never worse."""
    shifts, at = [b.shift for b in fitted.blocks], len(fitted.x) - len(fitted.own)
    variant, own = fitted.candidates[-1].reshaped(fitted.own)
    candidates, x = (*fitted.candidates[:-1], variant), (*fitted.x[:at], *own)
    there = [(*x[: stretch[0]], v, *x[stretch[0] + 1 :]) for v in _scan_points(fitted, stretch)]
    few = representative_recordings(fitted)
    met = [(chi2, y) for y in there if (chi2 := chi2_at(problem, candidates, y, shifts, few)) is not None]
    best = fitted
    for y in _local_minima(met)[: TUNING.minima]:
        new = problem.fit(candidates, y, shifts=shifts, width=1)
        if new is not None:
            plain = (*new.x[:at], *variant.plain(new.own)[1])
            again = problem.fit(fitted.candidates, plain, shifts=[b.shift for b in new.blocks], width=2)
            best = again if again is not None and again.chi2 < best.chi2 else best
    return best


def _scan_points(fitted: Fitted, stretch: Stretch) -> list[float]:
    """Where on its stretch a coordinate is tried."""
    k, low, high = stretch
    return sorted(float(v) for v in (*AFAR, *(fitted.x[k] + NEAR)) if low <= v <= high and 0.0 < v < 1.0)


def _matched_strength(
    problem: Problem, alone: Fitted, last: Candidate, x: tuple[float, ...], few: Sequence[int]
) -> tuple[float, ...] | None:
    """Coordinates x with the last effect as strong as recordings ask for beside the fit without it; None if none.

    `alone` is that fit, of these `few`.
    """
    along, size = 0.0, 0.0
    for r, b in zip(few, alone.blocks, strict=True):
        way = problem.moved(r, (alone.candidates, alone.x), ((*alone.candidates, last), x), b.shift)
        if way is not None:
            d = without_shift_direction(way[:, None], b)[:, 0]
            along, size = along + float(d @ b.residual), size + float(d @ d)
    start = followed(last, x[len(alone.x) :], along / size) if size > 0.0 else None
    return None if start is None else (*alone.x, *start)


def _local_minima(met: Sequence[tuple[float, tuple[float, ...]]]) -> list[tuple[float, ...]]:
    """Places of a row, each with what it leaves, beside which none leaves less; the one that leaves least first."""
    inside = [(np.inf, ()), *met, (np.inf, ())]
    low = [b for a, b, c in zip(inside, inside[1:], inside[2:], strict=False) if b[0] <= min(a[0], c[0])]
    return [x for _, x in sorted(low)]
