"""An effect beside a discrepancy that changes slowly: what it does quicker shows however large that is, (D28).

The covariance of a signal is S = N + g K g: N the autoregressive noise of its quiet stretches, g = s R after the first
contact and 0 before, K_ij = exp(-|t_i - t_j|/t_c), the Ornstein-Uhlenbeck process of the discrepancy's scale and
correlation time. N^-1 and K^-1 are banded, so that by the Woodbury identity

    S^-1 = N^-1 - N^-1 E (K^-1/g^2 + E'N^-1 E)^-1 E'N^-1,   E the samples after the contact,

costs as many operations as there are samples (Rue and Held, Gaussian Markov Random Fields, 2005, ch. 2).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.data.dataset import Dataset, Signal
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted, is_at_bound
from rollover.diagnosis.settings import SETTINGS
from rollover.recording.noise_floor import grown

Array = NDArray[np.float64]


def shown_beside(problem: Problem, base: Fitted, fits: Sequence[Fitted], candidates: int) -> Fitted | None:
    """The fit that gains most by generalised least squares, if a sensor's does and it is no chance; None otherwise.

    What a model misses goes through the equation of motion: it is as quick as a contact is, and in all channels. A
    physical effect that resembles it gains as much by it as by itself; what is of one channel's instrument does not.
    One draw of the discrepancy for all recordings, as in (D21): a gain of Q in squares by k numbers has the p-value of
    Q/draws in chi-square of k degrees, times the number of `candidates` (Bonferroni).
    """
    from scipy.stats import chi2

    if problem.effort.is_ensemble or not any(_is_known(e, s) for e in problem.dataset for s in e.signals):
        return None
    able = [f for f in fits if not is_at_bound(f)]
    if not able:
        return None
    left = [left_by(problem, f) for f in able]
    best = int(np.argmin(left))
    if able[best].candidates[-1].kind != "sensor":
        return None
    gain = max(left_by(problem, base) - left[best], 0.0)
    p_value = candidates * float(chi2.sf(gain / problem.recordings_per_draw, len(able[best].own)))
    return able[best] if p_value < SETTINGS.inference.lack_of_fit.p_value else None


def left_by(problem: Problem, fitted: Fitted) -> float:
    """Squares m'S^-1 m that a fit leaves of all recordings, each at its own clock.

    Time shifts, uncertain conditions and zeros are marginalised.
    """
    return float(sum(_left(problem, r, fitted, b.shift) for r, b in enumerate(fitted.blocks)))


def _left(problem: Problem, r: int, fitted: Fitted, shift: float) -> float:
    e, raw = problem.dataset[r], problem.raw(r, fitted.candidates, fitted.x, shift)
    if raw is None:
        return np.inf
    later = problem.clock_slope(r, fitted.candidates, fitted.x, shift, raw) * e.shift_prior
    G = gram(e, np.stack([e.values - raw, later, *e.uncertain_columns], axis=1), e.simulator.contact + shift)
    # the shift's prior is about zero: (tau + dtau)^2/sd^2
    held, target = G[1:, 1:] + np.eye(G.shape[0] - 1), G[1:, 0].copy()
    at = shift / e.shift_prior
    target[0] -= at
    return float(G[0, 0] + at**2 - target @ np.linalg.solve(held, target))


def gram(e: Dataset, columns: Array, contact: float) -> Array:
    """X'S^-1 X of columns X (n, m), SI, stacked, with the first contact at a time of the recording, s.

    Of signals whose discrepancy has a known correlation time: what noise hides has none.
    """
    found = np.zeros((columns.shape[1], columns.shape[1]))
    for s, part in e.spans():
        if _is_known(e, s):
            found += _gram_of(e, s, columns[part], contact)
    return found


def _gram_of(e: Dataset, s: Signal, X: Array, contact: float) -> Array:
    from scipy.linalg import solveh_banded

    time = e.recording.time[s.rows]
    noise, ar = s.quiet
    W = innovations(s, float(np.hypot(noise, e.model_error * s.span)))
    N = (W.T @ W).tocsr()  # N^-1
    back = N @ X
    G = X.T @ back
    late = time >= contact
    g, t_c = e.discrepancy[s.channel] * s.span, e.memory[s.channel]
    if g <= 0.0 or np.count_nonzero(late) < 2:
        return np.asarray(G)
    bands = _precision(time[late], g, t_c, max(len(ar), 1))
    inside = N[late][:, late]
    for lag in range(len(ar) + 1):
        bands[-1 - lag, lag:] += inside.diagonal(lag)
    return np.asarray(G - back[late].T @ solveh_banded(bands, back[late]))


def innovations(s: Signal, sigma: float) -> Any:
    """Sparse filter (n, n) of a signal to innovations of variance 1, where a sample has the noise sigma (SI)."""
    from scipy.sparse import diags_array

    ar, n = s.quiet[1], s.rows.size
    c = grown(ar) * np.array([1.0, *(-a for a in ar)])
    own = 1.0 / (sigma * s.heteroscedasticity * np.ones(n))
    return diags_array(c, offsets=-np.arange(c.size), shape=(n, n)) @ diags_array(own)


def _precision(time: Array, g: float, t_c: float, width: int) -> Array:
    """K^-1/g^2 of the Ornstein-Uhlenbeck process at rising times (n,): tridiagonal, as upper bands (width + 1, n)."""
    rho = np.exp(-np.diff(time) / t_c)
    free = 1.0 / (1.0 - rho**2)
    bands = np.zeros((width + 1, time.size))
    bands[-1, 1:] += free
    bands[-1, :-1] += rho**2 * free
    bands[-1, 0] += 1.0
    bands[-2, 1:] -= rho * free
    return bands / g**2


def _is_known(e: Dataset, s: Signal) -> bool:
    """Whether scale and correlation time of a signal's discrepancy are known."""
    return s.channel in e.discrepancy and s.channel in e.memory
