"""95 % intervals of fitted parameters: the curvature of the misfit, and what a small error of the model would do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.fit.ensemble_mean import (
    ensemble_mean_gradient,
    ensemble_mean_misfit,
    ensemble_mean_step,
    projected_gradient,
)
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted, ResidualBlock, at_an_end, time_shift_step
from rollover.diagnosis.fit.local_search import linearised
from rollover.diagnosis.fit.parameterisation import Candidate, physical, with_slices
from rollover.diagnosis.inference.local_quadratic import local_quadratic_extents, student_widening
from rollover.diagnosis.result import Interval
from rollover.diagnosis.settings import SETTINGS
from rollover.effects import EFFECTS, possible, units_of

Array = NDArray[np.float64]
TUNING = SETTINGS.inference.intervals
ROUNDS = SETTINGS.fit.finite_differences.shift_rounds
TWO_SIDED = SETTINGS.inference.local_quadratic.normal_quantile
GENTLE = SETTINGS.fit.linearisation.weak_prior
EVENLY = 12.0**-0.5  # standard deviation of what is spread evenly from 0 to 1
BOTH = (-1.0, 1.0)

Sides = Mapping[int, Sequence[float]]  # coordinates, and of each -1.0 for down, 1.0 for up


def ensemble_variance(dataset: Sequence[Dataset], blocks: Sequence[ResidualBlock], inverse: Array) -> Array:
    """Variances (p,) of parameters fitted to one run each, by what neighbours of the run scatter by.

    sum_r var_k(A^-1 J_r'd_rk) (1 + 1/k) (t/1.96)^2: what was measured is one run more, the model the mean of k.
    """
    found, free = np.zeros(inverse.shape[0]), 0
    for e, block in zip(dataset, blocks, strict=True):
        k = len(e.perturbed)
        if k < 2:
            continue
        free += k - 1
        each = np.array([inverse @ projected_gradient(block, e, perturbed_run) for perturbed_run in e.perturbed])
        found += (1.0 + 1.0 / k) * np.var(each, axis=0, ddof=1)
    return np.asarray(found * student_widening(free)) if free else found


def between_recording_variance(dataset: Sequence[Dataset], blocks: Sequence[ResidualBlock], inverse: Array) -> Array:
    """Variances (p,) by how far apart recordings pull parameters: what all models of the noise leave out shows there.

    (t/1.96)^2 R/(R - 1) A^-1 [sum_r (g_r - g)(g_r - g)'] A^-1, g_r recording r's part of A dx of (D8), g their mean.
    """
    number = len(blocks)
    if number < TUNING.least_recordings:
        return np.zeros(inverse.shape[0])
    pulls = np.array([ensemble_mean_gradient(e, block) for e, block in zip(dataset, blocks, strict=True)])
    moved = (pulls - pulls.mean(axis=0)) @ inverse
    return np.asarray(student_widening(number - 1) * number / (number - 1) * np.sum(moved**2, axis=0))


def secondary_variance(problem: Problem, fitted: Fitted, inverse: Array) -> Array:
    """Variances (p,) of what shapes of the last effect that are not fitted would move: each evenly over its range."""
    found = np.zeros(len(fitted.x))
    last, at = fitted.candidates[-1], list(fitted.x)
    secondary = list(last.secondary)
    if any(getattr(EFFECTS[last.id](), name, 0.0) is None for name in secondary):
        return found  # as the scenario has it
    begun = last.with_secondary(())[0] if secondary else ()
    whole = (*fitted.candidates[:-1], last.whole())
    for k in range(len(secondary)):
        pull = np.zeros(len(fitted.x))
        low, high = (min(max(begun[k] + s * EVENLY, 0.0), 1.0) for s in (-1.0, 1.0))
        steps = [(whole, [*at, *begun[:k], v, *begun[k + 1 :]]) for v in (low, high)]
        for r, block in enumerate(fitted.blocks):
            d = problem.moved(r, steps[0], steps[1], block.shift)
            if d is not None:
                d = block.counted(d)
                pull += block.J.T @ d - (block.J.T @ block.slope) * float(block.slope @ d) / block.weight
        found += (EVENLY / (high - low) * (inverse @ pull)) ** 2
    return found


def with_secondary(problem: Problem, fitted: Fitted) -> tuple[Fitted, Array, list[int]]:
    """The fit with the shapes of its effects that were not fitted, the prior of each coordinate, where the fitted are.

    Such a shape is where it is usual, spread evenly over its range as far as the recordings do not tell; one that is
    usually not there is left out, and where a look costs a run all are: see `secondary_variance`.
    """
    candidates, x, primary, prior = [], list[float](), list[int](), list[float]()
    for c, columns in with_slices(fitted.candidates):
        own = fitted.x[columns]
        primary += range(len(x), len(x) + len(own))
        usual = {name: getattr(EFFECTS[c.id](), name) for name in c.secondary}
        estimated = all(
            v is not None and c.secondary[name].low <= v <= c.secondary[name].high for name, v in usual.items()
        )
        whole = c.with_secondary(own)[0] if estimated and usual else own
        prior += [GENTLE] * len(own) + [EVENLY**-2] * (len(whole) - len(own))
        x += whole
        candidates.append(c.whole() if estimated else c)
    if len(x) > len(primary) and not problem.effort.is_ensemble:
        found = linearised(problem, candidates, x, [b.shift for b in fitted.blocks])
        if found is not None:
            return found, np.array(prior), primary
    # of a parameter of a narrow effect recordings may tell nothing at all: it lies evenly in its range
    own_prior = [EVENLY**-2 if c.is_local else GENTLE for c in fitted.candidates for _ in c.search]
    return fitted, np.array(own_prior), list(range(len(fitted.x)))


def profile_extents(
    problem: Problem, fitted: Fitted, own: Array, dispersion: float, sides: Sides | None = None
) -> Array:
    """How much further than by its slopes a misfit stays low, factors (p, 2) of `own` deviations down and up, >= 1.

    `TWO_SIDED` deviations off, the other parameters going along, it should have risen by `TWO_SIDED`^2 phi. Jumps and
    chance make slopes too steep: where it has clearly not, one goes on until it has, and back on a parabola. Of runs
    that scatter it is the misfit of their mean, which is rough by itself. With `sides` these alone are looked at.
    """
    found, due = np.ones((own.size, 2)), TWO_SIDED**2 * dispersion
    enough = max(TUNING.least_rise * due, TUNING.model_error_rise if any(e.perturbed for e in problem.dataset) else 0.0)
    if sides is not None and not any(sides.values()):
        return found
    start = _misfit(problem, fitted, np.zeros(len(fitted.x)))
    if start is None:
        return found
    rippled = _rippled(fitted) if not problem.effort.is_ensemble else set()
    for k, way in enumerate(_ways(fitted, own)):
        for side, sign in enumerate(BOTH):
            if sides is not None and sign not in sides.get(k, ()):
                continue
            far = 1.0
            while far < TUNING.widen_most:
                x = np.array(fitted.x) + sign * far * way
                there = _misfit(problem, fitted, sign * far * way) if np.all((x >= 0.0) & (x <= 1.0)) else None
                if there is None:
                    break
                if there - start > enough:
                    far *= float(np.sqrt(due / (there - start)))
                    break
                far *= TUNING.widen_factor
            if k in rippled:
                far = max(far, _over_local_minima(problem, fitted, sign * way, k, start + due))
                far = _along_ridge(problem, fitted, k, sign * TWO_SIDED * own[k], (start, due), far)
            found[k, side] = far if far > TUNING.widen_above else 1.0
    return found


def _ways(fitted: Fitted, own: Array) -> list[Array]:
    """For each coordinate how far (p,) all go where it goes `TWO_SIDED` of its `own` deviations, the others along."""
    inverse = np.linalg.inv(sum((b.normal()[0] for b in fitted.blocks), GENTLE * np.eye(len(fitted.x))))
    return [TWO_SIDED * own[k] * inverse[:, k] / inverse[k, k] for k in range(own.size)]


def _rippled(fitted: Fitted) -> set[int]:
    """Coordinates of effects in another form than their usual one: local minima of a threshold may make up for it."""
    secondary = (own for c, own in with_slices(fitted.candidates) if c.has_secondary)
    return {k for own in secondary for k in range(own.start, own.stop)}


def _over_local_minima(problem: Problem, fitted: Fitted, way: Array, k: int, most: float) -> float:
    """The furthest factor on the k-th coordinate's `way` (p,) with no more than `most` left, at least 1.

    It ends at the end of its range, and what goes along at the ends of theirs.
    """
    reached, begun = 1.0, np.array(fitted.x)
    end = ((1.0 if way[k] > 0.0 else 0.0) - begun[k]) / way[k]
    for far in sorted(
        {*(f for f in TUNING.scan_factors if f < end), min(max(end, TUNING.scan_factors[0]), TUNING.scan_factors[-1])}
    ):
        there = _misfit(problem, fitted, np.clip(begun + far * way, 0.0, 1.0) - begun)
        if there is not None and there <= most:
            reached = far
    return reached


def _along_ridge(
    problem: Problem, fitted: Fitted, k: int, way: float, rise: tuple[float, float], begun: float
) -> float:
    """The factor on the `way` of coordinate k at which the misfit has risen by what is due, all others fitted anew.

    `rise` is what is left at the fit and what is due. A straight way leaves a crooked valley early: from `begun` on it
    is followed as far as it is that low.
    """
    (start, due), far = rise, begun
    x, shifts = [v for j, v in enumerate(fitted.x) if j != k], [b.shift for b in fitted.blocks]
    if any(len(c.search) == 1 for c, columns in with_slices(fitted.candidates) if columns.start <= k < columns.stop):
        return far
    inside, beyond = (far, due), far
    for _ in range(TUNING.ridge_steps):
        beyond = beyond * TUNING.ridge_factor
        at = fitted.x[k] + beyond * way
        if not 0.0 < at < 1.0:
            break
        found = problem.fit(held_at(fitted, k, at), x, rounds=TUNING.held_rounds, shifts=shifts, width=1)
        if found is None:
            break
        if found.chi2 - start > due:
            low = min(max(inside[1], 0.0), due)
            share = (np.sqrt(due) - np.sqrt(low)) / max(np.sqrt(found.chi2 - start) - np.sqrt(low), 1e-9)
            return float(inside[0] + share * (beyond - inside[0])) if low < due else inside[0]
        inside, x, shifts = (beyond, found.chi2 - start), list(found.x), [b.shift for b in found.blocks]
    return inside[0]


def held_at(fitted: Fitted, k: int, at: float) -> list[Candidate]:
    """The effects of a fit with its k-th coordinate held at a place."""
    c, columns = next(
        (c, columns) for c, columns in with_slices(fitted.candidates) if columns.start <= k < columns.stop
    )
    name = list(c.search)[k - columns.start]
    rest = {n: s for n, s in c.search.items() if n != name}
    held = replace(c, search=rest, fixed={**c.fixed, name: physical(at, c.search[name])})
    return [held if one is c else one for one in fitted.candidates]


def _within_range(problem: Problem, fitted: Fitted, wide: Array, dispersion: float) -> Array:
    """Deviations (p, 2) down and up, with those that lead out of the range ended where too much is left before that.

    What pulls no further once it holds has no slope there, and is something all the same: with next to none of it much
    more is left. The way to the end of the range is halved again and again, all others fitted anew.
    """
    found, due = wide.copy(), TWO_SIDED**2 * dispersion
    shifts = [b.shift for b in fitted.blocks]

    def is_met(k: int, at: float) -> bool:
        others = [v for j, v in enumerate(fitted.x) if j != k]
        there = problem.fit(held_at(fitted, k, at), others, rounds=TUNING.held_rounds, shifts=shifts, width=1)
        return there is None or there.chi2 - fitted.chi2 < due

    for k, x in enumerate(fitted.x):
        for side, end in enumerate((0.0, 1.0)):
            if abs(end - x) >= TWO_SIDED * wide[k, side] or is_met(k, end):
                continue
            inside, beyond = x, end
            for _ in range(TUNING.halvings):
                middle = 0.5 * (inside + beyond)
                inside, beyond = (middle, beyond) if is_met(k, middle) else (inside, middle)
            found[k, side] = abs(beyond - x) / TWO_SIDED
    return found


def quadratic_extents(problem: Problem, fitted: Fitted, own: Array, dispersion: float) -> Array:
    """How far (p, 2) the mean of runs beside the fit may be what was measured, see `local_quadratic_extents`.

    In units of `own` deviations down and up, NaN where runs do not tell. It has in it what scatter and disagreement do.
    """
    found = np.full((own.size, 2), np.nan)
    for k, way in enumerate(_ways(fitted, own)):

        def runs(steps: Sequence[float], way: Array = way) -> list[Sequence[ResidualBlock] | None]:
            points = [np.array(fitted.x) + t * way for t in steps]
            inside = [bool(np.all((x >= 0.0) & (x <= 1.0))) for x in points]
            problem.made_ahead(
                (r, fitted.candidates, [float(v) for v in x])
                for x, there in zip(points, inside, strict=True)
                for r in range(len(fitted.blocks) if there else 0)
            )
            met = [
                _clocked(problem, fitted, t * way) if there else None for t, there in zip(steps, inside, strict=True)
            ]
            return [None if f is None else f.blocks for f in met]

        slopes = [b.unweighted_J @ way for b in fitted.blocks]
        estimated = local_quadratic_extents(runs, slopes, TWO_SIDED**2 * dispersion)
        if estimated is not None:
            found[k] = estimated
    return found


def _misfit(problem: Problem, fitted: Fitted, way: Array) -> float | None:
    """What is left some way (p,) from a fit, of runs that scatter by their mean; None where it cannot be simulated."""
    moved = _clocked(problem, fitted, way)
    if moved is None:
        return None
    return ensemble_mean_misfit(problem, moved)[0] if any(e.perturbed for e in problem.dataset) else moved.chi2


def _clocked(problem: Problem, fitted: Fitted, way: Array) -> Fitted | None:
    """A fit moved some way (p,), clocks gone along, without slopes; None where it cannot be simulated."""
    x = [float(v) for v in np.array(fitted.x) + way]
    problem.made_ahead((r, fitted.candidates, x) for r in range(len(fitted.blocks)))
    found = [
        problem.clocked(r, fitted.candidates, x, there.shift + time_shift_step(there, way), ROUNDS)
        for r, there in enumerate(fitted.blocks)
    ]
    blocks = [b for b in found if b is not None]
    if len(blocks) < len(found):
        return None
    return replace(fitted, x=tuple(x), blocks=tuple(blocks))


def _noise(problem: Problem, fitted: Fitted, prior: Array) -> Array:
    """Covariance (p, p) of J'w that comes of the noise alone, and `prior`: a weighed sample's noise is below 1."""
    found = np.diag(prior)
    for e, block in zip(problem.dataset, fitted.blocks, strict=True):
        J = block.J - np.outer(block.slope, block.slope @ block.J) / block.weight
        J = J * block.counted(np.sqrt(e.due))[:, None]
        found = found + J.T @ J
    return np.asarray(found)


def intervals(
    problem: Problem, fitted: Fitted, sides: Sides | None = None, coarse: Fitted | None = None
) -> list[dict[str, Interval]]:
    """For each effect, its parameters with 95 % intervals.

    cov = phi A^-1, phi the misfit left per sample (at least 1); beside it, in quadrature, what a gain error of the
    model of `model_error` in any one channel would do, A^-1 J'(error): integrators differ, noise or not. Where runs
    that nobody could tell apart scatter and samples are weighed by that, cov = phi A^-1 N A^-1 with N the covariance
    that the noise alone gives J'w; beside it stand `ensemble_variance` and `secondary_variance`. Elsewhere unfitted
    secondary parameters are in A (`with_secondary`); an end of a range is read off where samples pile up. How far the
    misfit stays low is found by `quadratic_extents` where runs scatter, else by `profile_extents`; with `sides` by the
    latter alone, others as wide as slopes say. `coarse` is the fit that `refined_by_ensemble_mean` moved to this one.
    """
    estimated, coarse = fitted, coarse or fitted
    fitted, prior, primary = with_secondary(problem, fitted)
    p = len(fitted.x)
    A = sum((b.normal()[0] for b in fitted.blocks), np.zeros((p, p))) + np.diag(prior)
    inverse: Array = np.asarray(np.linalg.inv(A), dtype=np.float64)
    count = sum(b.residual.size for b in fitted.blocks)
    dispersion = max(1.0, fitted.chi2 / count) * problem.samples_per_error
    strayed = any(e.perturbed for e in problem.dataset)
    noise = inverse @ _noise(problem, fitted, prior) @ inverse if strayed else inverse
    sd = np.sqrt(np.maximum(dispersion * np.diag(noise), 0.0))
    moved = np.zeros(p)
    channels = {s.channel for e in problem.dataset for s in e.signals}
    for channel in channels:
        pull = np.zeros(p)
        for r, block in enumerate(fitted.blocks):
            for signal, part in problem.dataset[r].spans():
                if signal.channel == channel:
                    y = block.counted(problem.measured[r] - block.unweighted_residual)[part]
                    pull += block.J[part].T @ (SETTINGS.data.dataset.model_error * y)
        moved += (inverse @ pull) ** 2
    # a fit that ended before it was at rest is off by what the next step would have been
    rest = inverse @ sum((b.normal()[1] for b in fitted.blocks), np.zeros(p))
    if strayed:
        held = secondary_variance(problem, fitted, inverse)
        moved += ensemble_variance(problem.dataset, fitted.blocks, inverse) + held
        rest = ensemble_mean_step(problem.dataset, fitted.blocks)
    moved += rest**2
    moved[primary] += ((np.array(estimated.x) - np.array(coarse.x)) / (SETTINGS.fit.ensemble_mean.finer_parts - 1)) ** 2
    variance = sd**2 + moved
    if strayed:
        variance = np.maximum(variance, between_recording_variance(problem.dataset, fitted.blocks, inverse))
    sd = np.sqrt(variance)[primary]
    own = np.sqrt(dispersion * np.diag(inverse))[primary]
    extents = np.full((own.size, 2), np.nan)
    if strayed and sides is None:
        extents = quadratic_extents(problem, problem.again(coarse), own, dispersion)
        sides = {k: BOTH for k in range(own.size) if np.isnan(extents[k, 0])}  # for means of seven runs
    far = profile_extents(problem, coarse, own, dispersion, sides)
    wide = np.fmax(np.sqrt(sd[:, None] ** 2 + own[:, None] ** 2 * (far**2 - 1.0)), own[:, None] * extents)
    if not problem.effort.is_ensemble:
        wide = _within_range(problem, estimated, wide, dispersion)
    found, at = [], 0
    for c in estimated.candidates:
        kind: Any = EFFECTS[c.id]
        units = units_of(kind, c.channel)
        values: dict[str, Interval] = {}
        for name, search in c.search.items():
            x = estimated.x[at]
            values[name] = Interval(
                value=physical(x, search),
                low=possible(kind, name, physical(max(x - TWO_SIDED * wide[at, 0], -TUNING.outside_range), search)),
                high=possible(
                    kind, name, physical(min(x + TWO_SIDED * wide[at, 1], 1.0 + TUNING.outside_range), search)
                ),
                unit=units.get(name, ""),
                at_bound=at_an_end(x),
                as_simulated=physical(coarse.x[at], search) if coarse.x[at] != x else None,
            )
            at += 1
        if c.id == "sensor-clipping":
            end = full_scale_of(problem.dataset, c.channel)
            values = {name: with_full_scale(one, end) for name, one in values.items()}
        values |= {n: Interval(value=v, low=v, high=v, unit=units.get(n, "")) for n, v in c.variant.items()}
        found.append(values)
    return found


def full_scale_of(dataset: Sequence[Dataset], channel: str | None) -> float | None:
    """Size of the largest value of a channel if it is met again and again, to the last digit: the end of a range."""
    return max((s.end for e in dataset for s in e.signals if s.channel == channel), default=0.0) or None


def with_full_scale(fitted: Interval, end: float | None) -> Interval:
    """The limit that the recordings themselves show, beside one fitted to it: noise that is cut off bends the fit."""
    if end is None or abs(end - fitted.value) > TUNING.near_end * end:
        return fitted
    return replace(fitted, value=end, low=(1.0 - TUNING.end_error) * end, high=(1.0 + TUNING.end_error) * end)
