"""Draws of the numbers of what is named, under the likelihood by which they were fitted.

    p(x) ~ exp(-sum_r Q_r(x)/(2 phi)),  Q_r = min over tau of (D1) along the slope s_r of the fit,

with phi what is left per sample, at least 1, as in `intervals`, and x even over the ranges of the search. What a small
error of the model or of its steps would do stands in the intervals alone.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rollover.calibration.posterior import sampled
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted
from rollover.diagnosis.fit.parameterisation import with_slices
from rollover.diagnosis.result import Draws
from rollover.diagnosis.settings import SETTINGS
from rollover.effects import EFFECTS, units_of

Array = NDArray[np.float64]
GENTLE = SETTINGS.fit.linearisation.weak_prior


def drawn(problem: Problem, fitted: Fitted, count: int, seed: int = 0) -> Draws:
    """`count` draws of all numbers of a fit that are fitted."""
    p, blocks = len(fitted.x), fitted.blocks
    dispersion = max(1.0, fitted.chi2 / sum(b.residual.size for b in blocks)) * problem.samples_per_error
    A = sum((b.normal()[0] for b in blocks), np.zeros((p, p))) + GENTLE * np.eye(p)

    def log_density(x: Array) -> float:
        prefix, chi2 = [float(v) for v in x], 0.0
        for r, there in enumerate(blocks):
            found = problem.block(r, fitted.candidates, prefix, there.shift, 0.0, clock=False)
            if found is None:
                return -np.inf
            g = float(there.slope @ found.residual) - found.shift * there.prior**-2
            chi2 += found.total - g * g / there.weight
        return -0.5 * chi2 / dispersion

    covariance: Array = np.asarray(dispersion * np.linalg.inv(A), dtype=np.float64)
    made = sampled(log_density, np.array(fitted.x), covariance, draws=count, seed=seed)
    names: list[str] = []
    units: list[str] = []
    marked: list[float] = []
    each = list(with_slices(fitted.candidates))
    for c, own in each:
        prefix = ".".join([c.id, *([c.channel] if c.channel else [])])
        names += [f"{prefix}.{name}" for name in c.search]
        units += [units_of(EFFECTS[c.id], c.channel).get(name, "") for name in c.search]
        marked += c.values(fitted.x[own]).values()
    values = np.array([[v for c, own in each for v in c.values(x[own]).values()] for x in made.draws])
    return Draws(names=tuple(names), units=tuple(units), values=values, fitted=tuple(marked), convergence=made)
