"""What runs with the explanation itself scatter by, and the parameters that all of these neighbours ask for together.

Scatter is looked at first where the scenario is; where an effect changes what hits the ground it is another. With
neighbours y_k = y + d_k of the run at the fitted point, each recording's mean of them perturbed runs less than any one,
and

    dx = A^-1 sum_r J_r'(w_r - mean_k d_rk)                                                                    (D8)

is the step to the least squares of the mean. A, J, w as in (D1).

An integrator's error is no chance: where it is of first order, steps of one in `finer_parts` have all of it but that
share, and move parameters by what they had made up for it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted, ResidualBlock, time_shift_step
from rollover.diagnosis.fit.local_search import linearised
from rollover.diagnosis.fit.parameterisation import Candidate
from rollover.diagnosis.noise.ensemble import heavy_tail, with_sample_weights, without_diverged
from rollover.diagnosis.settings import SETTINGS

Array = NDArray[np.float64]
TUNING = SETTINGS.fit.ensemble_mean


def fitted_to_ensemble_mean(problem: Problem, fitted: Fitted) -> Fitted:
    """A fit under the scatter of its own runs, moved to where it meets their mean best (D8).

    Slopes beside a jump mislead, and so do time shifts that a wrong start has biased: it is moved until a step would
    gain no more than chance, or little of what is left, and of all points on the way the one that meets the mean best
    is returned. As it was if nothing can be simulated there, or where runs do not scatter.
    """
    with_ensemble_scatter(problem, fitted)
    slopes = problem.again(fitted)
    points = [slopes]
    for _ in range(TUNING.most_steps):
        here = points[-1]
        if not any(e.perturbed for e in problem.dataset):
            break
        dx = ensemble_mean_step(problem.dataset, here.blocks)
        if predicted_gain(here.blocks, dx) < max(
            TUNING.least_gain, TUNING.least_gain_share * (here.chi2 - sum(b.size for b in here.blocks))
        ):
            break
        there = _line_search(problem, here, np.clip(dx, -TUNING.longest_step, TUNING.longest_step))
        if there is None:
            break
        found = _with_scatter_at(problem, slopes, *there)
        if found is None:
            break
        point, slopes = found
        points.append(point)
    best = points[0]
    if len(points) > 1:
        best = min(points, key=lambda f: ensemble_mean_misfit(problem, _reweighted_anew(problem, f))[0])
    if best.x != points[-1].x:
        with_ensemble_scatter(problem, best)
    return problem.again(best)


def _reweighted_anew(problem: Problem, fitted: Fitted) -> Fitted:
    """A fit where it stands under the noise as it is held now, without slopes: they cost runs."""
    new = [problem.block(r, fitted.candidates, fitted.x, b.shift, 0.0) for r, b in enumerate(fitted.blocks)]
    return replace(fitted, blocks=tuple(b or old for b, old in zip(new, fitted.blocks, strict=True)))


def refined_by_ensemble_mean(problem: Problem, fitted: Fitted) -> Fitted:
    """A fit moved to where the mean of its neighbours in shorter steps is met best, under their scatter.

    As it was where runs do not scatter, and as far as it came where nothing can be simulated further on.
    """
    if not any(e.perturbed for e in problem.dataset):
        return fitted
    with_ensemble_scatter(problem, fitted, TUNING.finer_parts)
    here = slopes = problem.again(fitted)
    for _ in range(TUNING.finer_steps):
        dx = np.clip(ensemble_mean_step(problem.dataset, here.blocks), -TUNING.longest_step, TUNING.longest_step)
        if predicted_gain(here.blocks, dx) < TUNING.least_gain:
            break
        there = _with_scatter_at(problem, slopes, *_moved_by(here, dx), TUNING.finer_parts)
        if there is None:
            break
        here, slopes = there
    return here


def predicted_gain(blocks: Sequence[ResidualBlock], dx: Array) -> float:
    """Gain dx'A dx of a step to a minimum, noise units."""
    return float(sum(dx @ b.normal()[0] @ dx for b in blocks))


def _line_search(problem: Problem, old: Fitted, dx: Array) -> tuple[Sequence[float], Sequence[float]] | None:
    """Coordinates and time shifts (s) of a fit moved by dx, or a share of that which leaves less; None if none does.

    The whole way unless that leaves clearly more: the mean of runs is worth more than the one that happens to be there.
    """
    met: list[tuple[float, tuple[Sequence[float], Sequence[float]]]] = []
    for shares in ((TUNING.whole_step,), TUNING.other_steps):
        begun = [_moved_by(old, share * dx) for share in shares]
        problem.made_ahead((r, old.candidates, x) for x, _ in begun for r in range(len(old.blocks)))
        for x, shifts in begun:
            chi2, moved = _misfit_and_shifts(problem, old.candidates, x, shifts)
            met.append((chi2, (x, moved)))
        if met[0][0] < old.chi2:
            return met[0][1]
    least, best = min(met, key=lambda one: one[0])
    if met[0][0] < TUNING.accepted_misfit * min(old.chi2, least):
        return met[0][1]
    return best if least < old.chi2 else None


def _with_scatter_at(
    problem: Problem, slopes: Fitted, x: Sequence[float], shifts: Sequence[float], parts: int = 1
) -> tuple[Fitted, Fitted] | None:
    """A fit as it stands at x and these time shifts (s) under the scatter of runs there, and where its slopes hold.

    Between the ends of the step over which those were estimated they are as good as its own. None if nothing can be
    simulated there.
    """
    is_beside = problem.is_beside(x, slopes.x)
    there = (
        _with_slopes_of(problem, slopes, x, shifts) if is_beside else linearised(problem, slopes.candidates, x, shifts)
    )
    if there is None:
        return None
    with_ensemble_scatter(problem, there, parts)
    slopes = problem.again(slopes if is_beside else there)
    return _with_slopes_of(problem, slopes, x, shifts) or there, slopes


def _with_slopes_of(problem: Problem, near: Fitted, x: Sequence[float], shifts: Sequence[float]) -> Fitted | None:
    """A fit as it stands at x and these time shifts (s), by the slopes of another place; None if a run fails."""
    each = enumerate(zip(near.blocks, shifts, strict=True))
    found = [problem.block(r, near.candidates, x, s, problem.effort.fine, b.unweighted_J) for r, (b, s) in each]
    blocks = tuple(b for b in found if b is not None)
    return Fitted(candidates=near.candidates, x=tuple(x), blocks=blocks) if len(blocks) == len(found) else None


def _moved_by(old: Fitted, dx: Array) -> tuple[list[float], list[float]]:
    """Coordinates and time shifts (s) of a fit moved by dx."""
    x = np.clip(np.array(old.x) + dx, 0.0, 1.0)
    return [float(v) for v in x], [b.shift + time_shift_step(b, x - np.array(old.x)) for b in old.blocks]


def _misfit_and_shifts(
    problem: Problem, candidates: Sequence[Candidate], x: Sequence[float], shifts: Sequence[float]
) -> tuple[float, Sequence[float]]:
    """What is left at a place, slopes aside, and its time shifts (s) moved to where they fit; infinite if it fails."""
    found = [problem.clocked(r, candidates, x, shift, problem.effort.clocked) for r, shift in enumerate(shifts)]
    blocks = [b for b in found if b is not None]
    if len(blocks) < len(found):
        return np.inf, shifts
    return sum(b.normal()[2] for b in blocks), [b.shift for b in blocks]


def with_ensemble_scatter(problem: Problem, fitted: Fitted, parts: int = 1) -> None:
    """Weigh the recordings by what runs at a fitted point scatter by, in `parts` of a step."""
    changes = problem.changes(fitted.candidates, fitted.x)
    problem.simulate_ensembles(changes, parts)
    dataset = []
    for e, block in zip(problem.dataset, fitted.blocks, strict=True):
        plain = replace(e, signals=tuple(replace(s, weight=None) for s in e.signals), perturbed=())
        dataset.append(with_sample_weights(plain, e.simulator.perturbed(changes, block.shift, parts)))
    problem.with_noise_model(dataset)


def ensemble_mean_misfit(problem: Problem, fitted: Fitted) -> tuple[float, float]:
    """Sum of squares that the mean of a fit's neighbours leaves, in all and before the impact alone.

    Under the noise and weights as they are held now. One run meets a recording well or badly by chance; the mean of
    seven much less so.
    """
    changes = problem.changes(fitted.candidates, fitted.x)
    problem.simulate_ensembles(changes)
    total = before = 0.0
    for e, block in zip(problem.dataset, fitted.blocks, strict=True):
        perturbed = without_diverged(e, e.simulator.perturbed(changes, block.shift), e.first_impact)
        raw = [d for d in (e.raw(perturbed_run) for perturbed_run in perturbed) if np.all(np.isfinite(d))]
        w = block.unweighted_residual
        if raw:
            w = w - e.marginalised(e.whitened(np.sum(raw, axis=0) / (1.0 + len(raw))))
        counts = heavy_tail(e, w) if problem.heavy_tailed else None
        more, w = (0.0, w) if counts is None else (counts.more, counts.samples * w)
        total += float(w @ w) + more + (block.shift / block.prior) ** 2
        before += float(w[e.early] @ w[e.early]) + (block.shift / block.prior) ** 2
    return total, before


def projected_gradient(block: ResidualBlock, e: Dataset, perturbed_run: Array) -> Array:
    """J'd of a deviation (n,), SI, with the recording's time shift taken out, (p,)."""
    d = block.counted(e.marginalised(e.whitened(perturbed_run)))
    return np.asarray(block.J.T @ d - (block.J.T @ block.slope) * float(block.slope @ d) / block.weight)


def ensemble_mean_step(dataset: Sequence[Dataset], blocks: Sequence[ResidualBlock]) -> Array:
    """(D8), (p,)."""
    p = blocks[0].J.shape[1]
    A = sum((block.normal()[0] for block in blocks), SETTINGS.fit.linearisation.weak_prior * np.eye(p))
    b = sum((ensemble_mean_gradient(e, block) for e, block in zip(dataset, blocks, strict=True)), np.zeros(p))
    return np.asarray(np.linalg.solve(A, b))


def ensemble_mean_gradient(e: Dataset, block: ResidualBlock) -> Array:
    """One recording's part of A dx of (D8), (p,)."""
    pull = block.normal()[1]
    return (
        pull - np.mean([projected_gradient(block, e, perturbed_run) for perturbed_run in e.perturbed], axis=0)
        if e.perturbed
        else pull
    )
