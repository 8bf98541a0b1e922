"""How well recordings are met before and after, in the measures that a test engineer knows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rollover.diagnosis.fit import Fitted, Judge
from rollover.diagnosis.holdout import Held
from rollover.diagnosis.verdict import Score
from rollover.rating import Iso18571, iso18571

FORCES = ("ground/force_normal", "rops/force", "striker/acceleration_z", "chassis/acceleration_z")


def scored(judge: Judge, fitted: Fitted, held: Held, hold_out: Sequence[str]) -> dict[str, Score]:
    """Scores of the training recordings (as fitted) and of the held-out ones (as predicted)."""
    every = range(len(judge.evidence))
    kept = [r for r in every if judge.evidence[r].name in hold_out] or list(every)
    train = [r for r in every if judge.evidence[r].name not in hold_out]
    left = sum(fitted.blocks[r].normal()[2] for r in train)
    count = sum(fitted.blocks[r].residual.size for r in train)
    return {
        "training": _score(judge, fitted, train, float(np.sqrt(left / max(count, 1)))),
        "held_out": _score(judge, fitted, kept, float(np.sqrt(held.left[kept].sum() / held.count[kept].sum()))),
    }


def _score(judge: Judge, fitted: Fitted, rows: Sequence[int], nrmse: float) -> Score:
    ratings, peaks = [], []
    for r in rows:
        e, block = judge.evidence[r], fitted.blocks[r]
        changes = judge.changes(fitted.candidates, fitted.x)
        predicted = e.simulator.predict(changes, block.shift)
        if predicted is None:
            continue
        for signal in e.signals:
            time, y = e.recording.time[signal.rows], predicted[signal.channel][signal.rows]
            rating = iso18571(time, signal.values, y)
            if isinstance(rating, Iso18571):
                ratings.append(rating.overall)
        force = next((s for name in FORCES for s in e.signals if s.channel == name), None)
        if force is not None:
            measured, simulated = _peak(force.values), _peak(predicted[force.channel][force.rows])
            peaks.append(abs(simulated - measured) / max(measured, 1e-12))
    return Score(
        nrmse=nrmse,
        iso18571=float(np.mean(ratings)) if ratings else None,
        peak_force_error=float(np.mean(peaks)) if peaks else None,
    )


def _peak(values: np.ndarray) -> float:
    """Largest magnitude, of a running median of three: one outlier is no peak."""
    v = np.abs(values)
    return float(np.max(np.median(np.stack([v[:-2], v[1:-1], v[2:]]), axis=0))) if v.size > 2 else float(v.max())
