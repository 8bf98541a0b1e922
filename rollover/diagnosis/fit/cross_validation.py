"""Judging on recordings that were not fitted: leave one condition out, by the linear models at the fitted point.

With sum_s A_s dx = sum_s b_s over the training recordings s, recording r is left with c_r - 2 b_r'dx + dx'A_r dx: only
its own time shift is fitted to it. Where what hits what, and when, hangs on a parameter, slopes hold only near the fit,
and far from it they foretell a misfit that no run has: full runs are made there instead (`cross_validated`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.fit.finite_differences import Point
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted, time_shift_step
from rollover.diagnosis.fit.tasks import ParallelMap, serial_map
from rollover.diagnosis.settings import SETTINGS

Groups = Sequence[Sequence[int]]  # recordings that are held out together

Array = NDArray[np.float64]
TUNING = SETTINGS.fit.cross_validation


@dataclass(frozen=True, kw_only=True)
class HeldOutMisfit:
    """Held-out misfit: `chi2` (k,) sum of squares over the noise of each recording, `count` (k,) that noise leaves."""

    chi2: Array
    count: Array

    @property
    def nrmse(self) -> Array:
        """Root mean square over the noise, (k,): 1 is the noise itself."""
        return np.asarray(np.sqrt(self.chi2 / self.count))

    @property
    def total(self) -> float:
        """Root mean square over the noise of all together."""
        return float(np.sqrt(self.chi2.sum() / self.count.sum()))


def held_out(fitted: Fitted, groups: Sequence[Sequence[int]]) -> HeldOutMisfit:
    """Predict each group of recordings by a fit to all the others; one group alone, or what is in none, by its own."""
    count = np.array([b.size for b in fitted.blocks], dtype=float)
    if fitted.cross_validated is not None:
        return HeldOutMisfit(chi2=np.array(fitted.cross_validated), count=count)
    normals = [b.normal() for b in fitted.blocks]
    chi2 = np.array([max(c, 0.0) for _, _, c in normals])
    for group in groups:
        dx = _leave_out_step(fitted, group)
        dx = np.clip(np.array(fitted.x) + dx, -0.25, 1.25) - np.array(fitted.x)
        for r in group:
            A, b, c = normals[r]
            chi2[r] = max(c - 2.0 * float(b @ dx) + float(dx @ A @ dx), 0.0)
    return HeldOutMisfit(chi2=chi2, count=count)


def cross_validated(problem: Problem, fitted: Fitted, groups: Sequence[Sequence[int]]) -> Fitted:
    """A fit with the runs made that tell what it foretells of each group; as it was where one fails."""
    if not fitted.x:
        return fitted
    chi2: list[float] = [b.normal()[2] for b in fitted.blocks]
    points = {
        r: np.clip(np.array(fitted.x) + _leave_out_step(fitted, group), 0.0, 1.0) for group in groups for r in group
    }
    problem.made_ahead((r, fitted.candidates, [float(v) for v in x]) for r, x in points.items())
    for r, x in points.items():
        old = fitted.blocks[r]
        shift = old.shift + time_shift_step(old, x - np.array(fitted.x))
        there = problem.clocked(r, fitted.candidates, [float(v) for v in x], shift, problem.effort.clocked)
        if there is None:
            return fitted
        chi2[r] = there.normal()[2]
    return replace(fitted, cross_validated=tuple(chi2))


def cross_validated_by_refits(
    problem: Problem,
    fitted: Fitted,
    groups: Sequence[Sequence[int]],
    without: float = np.inf,
    parallel_map: ParallelMap[Problem] = serial_map,
) -> Fitted:
    """A fit with what it foretells by fits to the other groups, where slopes foretell far worse than it meets them.

    And where they foretell no better than `without` the effect. As it was where one fails, and where a single group is
    all there is.
    """
    count = sum(b.size for b in fitted.blocks)
    doubted = min(TUNING.nonlinear_above * float(np.sqrt(fitted.chi2 / count)), without)
    if not fitted.x or len(groups) < 2 or held_out(fitted, groups).total < doubted:
        return fitted
    shifts = [b.shift for b in fitted.blocks]
    chi2 = [b.normal()[2] for b in fitted.blocks]
    refit = partial(_held_out_refit, at=(fitted.candidates, fitted.x), shifts=shifts)
    for group, found in zip(groups, parallel_map(problem, refit, groups), strict=True):
        if found is None:
            return fitted
        for r, there in zip(group, found, strict=True):
            chi2[r] = there
    return replace(fitted, cross_validated=tuple(chi2))


def _held_out_refit(
    problem: Problem, group: Sequence[int], *, at: Point, shifts: Sequence[float]
) -> list[float] | None:
    """What a fit to all other recordings, begun at a point, leaves of each of a group; None where one fails."""
    (candidates, x), rest = at, [r for r in range(len(shifts)) if r not in group]
    other = problem.fit(candidates, x, only=rest, shifts=[shifts[r] for r in rest], width=1)
    if other is None:
        return None
    found = [problem.clocked(r, other.candidates, other.x, shifts[r], TUNING.shift_rounds) for r in group]
    chi2 = [there.normal()[2] for there in found if there is not None]
    return chi2 if len(chi2) == len(found) else None


def _leave_out_step(fitted: Fitted, group: Sequence[int]) -> Array:
    """Step (p,) from a fit to where it would be without a group of recordings; of one group alone, by its own."""
    normals, p = [b.normal() for b in fitted.blocks], len(fitted.x)
    rest = [r for r in range(len(normals)) if r not in group] or list(group)
    A, b = sum((normals[r][0] for r in rest), np.zeros((p, p))), sum((normals[r][1] for r in rest), np.zeros(p))
    return np.asarray(np.linalg.solve(A + SETTINGS.fit.linearisation.weak_prior * np.eye(p), b)) if p else b


def held_out_disadvantage(
    rival: Fitted, best: Fitted, groups: Sequence[Sequence[int]], shared: float = 1.0
) -> tuple[float, float]:
    """How much worse a rival predicts held-out recordings, as two scores; both above 2 exclude it.

    First: the excess of its squares over that of the best, in standard errors of the noise: for predictions that differ
    by D (in noise units) the excess has sd 2 |D| phi, phi the best's own misfit per sample (at least 1). Second: the
    mean over conditions of ln(E_rival/E_best) in its paired standard errors. `shared` samples have one error in common.
    """
    a, b = held_out(rival, groups), held_out(best, groups)
    dispersion = max(1.0, float(np.sqrt(b.chi2.sum() / b.count.sum())))
    apart = np.zeros(len(best.blocks))
    for r, (x, y) in enumerate(zip(rival.blocks, best.blocks, strict=True)):
        d = y.counted(x.unweighted_residual - y.unweighted_residual)
        apart[r] = float(d @ d) - float(y.slope @ d) ** 2 / y.weight
    distance = float(apart.sum())
    excess = float(a.chi2.sum() - b.chi2.sum())
    if excess <= 0.0:
        return 0.0, 0.0
    first = excess / (2.0 * np.sqrt(max(distance, 1e-12) * shared) * dispersion)
    # conditions under which the two say the same decide nothing
    telling = [list(g) for g in groups if apart[list(g)].sum() > 9.0 * dispersion**2]
    logs = np.array([0.5 * np.log(a.chi2[g].sum() / b.chi2[g].sum()) for g in telling])
    if dispersion < TUNING.noise_alone or logs.size < 2:
        return float(first), float(first)
    error = float(np.std(logs, ddof=1) / np.sqrt(logs.size))
    return float(first), float(np.mean(logs) / max(error, 1e-12))
