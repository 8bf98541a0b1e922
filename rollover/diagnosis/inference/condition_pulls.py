"""How far recordings pull what is stated of their conditions: what an uncertain number takes up is said."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rollover.diagnosis.data.condition_uncertainty import pulls
from rollover.diagnosis.fit.levenberg_marquardt import Fitted, Problem
from rollover.diagnosis.settings import SETTINGS

TUNING = SETTINGS.inference.condition_pulls


def mean_pulls(problem: Problem, fitted: Fitted) -> Mapping[str, float]:
    """Mean pull of each uncertain number, none of a list, over the recordings that state it, by path.

    In standard deviations of what is stated.
    """
    found: dict[str, list[float]] = {}
    for e, block in zip(problem.dataset, fitted.blocks, strict=True):
        count = 0 if e.nuisance is None else e.nuisance.shape[1]
        if not count or count != len(e.doubtful):
            continue
        z = pulls(e.uncertain, e.marginalised.undone(block.residual), problem.samples_per_error)
        for one, pull in zip(e.doubtful, z[:count], strict=True):
            for path, value in one.items():
                # numbers of a list have no path of their own, and are left out
                if isinstance(value, (int, float)):
                    found.setdefault(path, []).append(float(pull))
    return {path: float(np.mean(each)) for path, each in found.items()}


def pull_notes(problem: Problem, fitted: Fitted) -> list[str]:
    """A note on what is pulled by a standard deviation and more; none where nothing is."""
    large = {path: z for path, z in mean_pulls(problem, fitted).items() if abs(z) >= TUNING.least_pull}
    if not large:
        return []
    said = ", ".join(f"{path} by {z:+.1f}" for path, z in large.items())
    return [f"what is stated as uncertain takes up part of the mismatch: {said} of its standard deviation"]
