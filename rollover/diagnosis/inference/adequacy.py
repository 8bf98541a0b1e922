"""Whether what a fit leaves is worth a word."""

from __future__ import annotations

import numpy as np

from rollover.diagnosis.fit.levenberg_marquardt import Fitted, Problem
from rollover.diagnosis.inference.lack_of_fit import Mismatch
from rollover.diagnosis.settings import SETTINGS

TUNING = SETTINGS.inference.adequacy


def is_enough(problem: Problem, fitted: Fitted, left: Mismatch) -> bool:
    """Whether what a fit leaves is no more than chance, or not worth a word."""
    return left.p_value > SETTINGS.inference.lack_of_fit.p_value or not matters(problem, fitted, left)


def matters(problem: Problem, base: Fitted, before: Mismatch) -> bool:
    """Whether the structure of the misfit is worth a word: beyond a share of a channel's range."""
    most = 0.0
    for r, e in enumerate(problem.dataset[: len(base.blocks)]):
        for signal, part in e.spans():
            cells = [c for c in before.cells if c.recording == r and part.start <= c.rows[0] < part.stop]
            chance = sum(c.rows.size if e.model_error_dominates(signal) else c.expected for c in cells)
            power = (sum(c.structured for c in cells) - chance) / max(sum(c.rows.size for c in cells), 1)
            most = max(most, float(np.sqrt(max(power, 0.0))) * signal.sigma / signal.span)
    return most > TUNING.negligible


def is_tolerated(problem: Problem, fitted: Fitted) -> bool:
    """Whether what is left is no more than a scatter between runs, or a tolerance that was asked for, leaves by chance.

    One error of unit size for each of k signals: a mean square of 1 with a standard deviation of sqrt(2/k).
    """
    rough = [e.model_error_dominates(s) for e in problem.dataset for s in e.signals]
    most = 1.0 + 2.0 * np.sqrt(2.0 / len(rough))
    return all(rough) and bool(fitted.left < most * sum(b.residual.size for b in fitted.blocks))
