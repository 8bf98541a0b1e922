"""How well recordings are met before and after, in the measures that a test engineer knows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rollover.comparison.rating import Iso18571, iso18571
from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.fit.cross_validation import HeldOutMisfit, held_out
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted, time_shift_step
from rollover.diagnosis.fit.time_shift import estimate_time_shifts
from rollover.diagnosis.result import Score
from rollover.diagnosis.settings import SETTINGS

TUNING = SETTINGS.inference.scores
FORCES = ("ground/force_normal", "rops/force", "striker/acceleration_z", "chassis/acceleration_z")


@dataclass(frozen=True, kw_only=True)
class Judged:
    """How well an explanation meets recordings: scores by "training" and "held_out", what is held out, and of each."""

    scores: Mapping[str, Score]
    held: HeldOutMisfit
    by_recording: tuple[tuple[str, float], ...]


def judged(problem: Problem, fitted: Fitted, validation: Sequence[Dataset], groups: Sequence[Sequence[int]]) -> Judged:
    """Scores of an explanation on recordings held out, or without such by leaving conditions out in turn."""
    every = range(len(problem.dataset))
    chi2 = sum(b.normal()[2] for b in fitted.blocks)
    train = _score(
        [_rated(problem, fitted, r) for r in every], float(np.sqrt(chi2 / sum(b.size for b in fitted.blocks)))
    )
    held = held_out(fitted, groups)
    rows = [(e.name, float(v)) for e, v in zip(problem.dataset, held.nrmse, strict=True)]
    if not validation:
        scores = {"training": train, "held_out": replace(train, nrmse=held.total)}
        return Judged(scores=scores, held=held, by_recording=tuple(rows))
    other = Problem(validation)
    estimate_time_shifts(other)
    apart = predicted(other, fitted)
    if apart is None:
        return Judged(scores={"training": train}, held=held, by_recording=tuple(rows))
    held = held_out(apart, [])
    rows += [(e.name, float(v)) for e, v in zip(validation, held.nrmse, strict=True)]
    score = _score([_rated(other, apart, r) for r in range(len(validation))], held.total)
    return Judged(scores={"training": train, "held_out": score}, held=held, by_recording=tuple(rows))


def misfit_before_impact(dataset: Sequence[Dataset], fitted: Fitted) -> float | None:
    """Misfit over the noise of all samples before the first impact, where no run scatters; None where none does after.

    None of few too; those at a start, which have no past to be whitened with, are none. Samples beyond an impact count
    for less the more runs scatter there, and less is left of what they miss, too.
    """
    if all(e.expected is None for e in dataset):
        return None
    early = np.concatenate([b.unweighted_residual[e.early] for e, b in zip(dataset, fitted.blocks, strict=True)])
    telling = early[early != 0.0]
    return float(np.sqrt(np.mean(telling**2))) if telling.size >= TUNING.least_samples else None


def predicted(problem: Problem, fitted: Fitted, rounds: int = 5) -> Fitted | None:
    """An explanation carried over to other recordings: only their own time shifts are fitted."""
    blocks = []
    for r in range(len(problem.dataset)):
        at, best = problem.shifts[r], None
        for _ in range(rounds):
            block = problem.block(r, fitted.candidates, fitted.x, at, 0.0)
            if block is None:
                return None
            if best is None or block.total < best.total:
                best = block
            at = best.shift + (0.5 if best is not block else 1.0) * time_shift_step(best, np.zeros(len(fitted.x)))
        assert best is not None
        blocks.append(best)
    return Fitted(candidates=fitted.candidates, x=fitted.x, blocks=tuple(blocks))


def _rated(problem: Problem, fitted: Fitted, r: int) -> tuple[list[float], list[float]]:
    """ISO ratings of one recording's channels, and the error of its peak force, where they can be had."""
    e, block = problem.dataset[r], fitted.blocks[r]
    predicted = e.simulator.predict(problem.changes(fitted.candidates, fitted.x), block.shift)
    if predicted is None:
        return [], []
    ratings, peaks = [], []
    for signal in e.signals:
        time, y = e.recording.time[signal.rows], predicted[signal.channel][signal.rows]
        rating = iso18571(time, signal.values, y, most=TUNING.rating_samples)
        if isinstance(rating, Iso18571):
            ratings.append(rating.overall)
    force = next((s for name in FORCES for s in e.signals if s.channel == name), None)
    if force is not None:
        measured, simulated = _peak(force.values), _peak(predicted[force.channel][force.rows])
        peaks.append(abs(simulated - measured) / max(measured, 1e-12))
    return ratings, peaks


def _score(rated: Sequence[tuple[list[float], list[float]]], nrmse: float) -> Score:
    ratings, peaks = [v for one, _ in rated for v in one], [v for _, one in rated for v in one]
    return Score(
        nrmse=nrmse,
        iso18571=float(np.mean(ratings)) if ratings else None,
        peak_force_error=float(np.mean(peaks)) if peaks else None,
    )


def _peak(values: np.ndarray) -> float:
    """Largest magnitude, of a running median of three: one outlier is no peak."""
    v = np.abs(values)
    return float(np.max(np.median(np.stack([v[:-2], v[1:-1], v[2:]]), axis=0))) if v.size > 2 else float(v.max())
