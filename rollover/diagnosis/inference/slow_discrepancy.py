"""An effect beside a discrepancy that changes slowly: what it does quicker shows however large that is, (D28).

The covariance of a signal is S = N + g K g: N the autoregressive noise of its quiet stretches, g = s R after the first
contact and 0 before, K_ij = exp(-|t_i - t_j|/t_c), the Ornstein-Uhlenbeck process of the discrepancy's scale and
correlation time. N^-1 and K^-1 are banded, so that by the Woodbury identity

    S^-1 = N^-1 - N^-1 E (K^-1/g^2 + E'N^-1 E)^-1 E'N^-1,   E the samples after the contact,

costs as many operations as there are samples (Rue and Held, Gaussian Markov Random Fields, 2005, ch. 2).
"""

from __future__ import annotations

from collections.abc import Sequence

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
    gains = [gain(problem, base, f) for f in able]
    draws = problem.recordings_per_draw
    p = [candidates * float(chi2.sf(max(q, 0.0) / draws, len(f.own))) for q, f in zip(gains, able, strict=True)]
    best = int(np.argmax(gains))
    is_shown = able[best].candidates[-1].kind == "sensor" and p[best] < SETTINGS.inference.lack_of_fit.p_value
    return able[best] if is_shown else None


def gain(problem: Problem, base: Fitted, fitted: Fitted) -> float:
    """Squares m'S^-1 m that a fit leaves less than a base, over all recordings, each at its own clock.

    Time shifts, uncertain conditions and zeros are marginalised.
    """
    left = [[_left(problem, r, f, b.shift) for r, b in enumerate(f.blocks)] for f in (base, fitted)]
    return float(sum(before - after for before, after in zip(*left, strict=True)))


def _left(problem: Problem, r: int, fitted: Fitted, shift: float) -> float:
    e, raw = problem.dataset[r], problem.raw(r, fitted.candidates, fitted.x, shift)
    if raw is None:
        return np.inf
    later = problem.clock_slope(r, fitted.candidates, fitted.x, shift, raw) * e.shift_prior
    G = gram(e, np.stack([e.values - raw, later, *_uncertain(e)], axis=1), e.simulator.contact + shift)
    # the shift's prior is about zero: (tau + dtau)^2/sd^2
    held, target = G[1:, 1:] + np.eye(G.shape[0] - 1), G[1:, 0].copy()
    at = shift / e.shift_prior
    target[0] -= at
    return float(G[0, 0] + at**2 - target @ np.linalg.solve(held, target))


def _uncertain(e: Dataset) -> list[Array]:
    """One standard deviation of each uncertain condition and zero, SI, stacked."""
    columns = [] if e.nuisance is None else list(e.nuisance.T)
    for s, part in e.spans():
        if s.zero_error > 0.0:
            columns.append(np.zeros(e.count))
            columns[-1][part] = s.zero_error
    return columns


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

    time, level = e.recording.time[s.rows], s.heteroscedasticity * np.ones(s.rows.size)
    noise, ar = s.quiet
    noise = float(np.hypot(noise, e.model_error * s.span))
    c = grown(ar) * np.array([1.0, *(-a for a in ar)])  # of unit innovations, where a sample has the stated noise
    scaled = X / (noise * level)[:, None]
    white = sum(ck * _delayed(scaled, k) for k, ck in enumerate(c))
    G = white.T @ white
    late = time >= contact
    g, t_c = e.discrepancy.get(s.channel, 0.0) * s.span, e.memory[s.channel]
    n = int(late.sum())
    if g <= 0.0 or n < 2:
        return np.asarray(G)
    # N^-1 X, and the bands of E'N^-1 E: those of C'C, C the filter
    back = sum(ck * _advanced(white, k) for k, ck in enumerate(c)) / (noise * level)[:, None]
    width = max(len(ar), 1)
    bands = np.zeros((width + 1, n))
    own = 1.0 / (noise * level)
    size = own.size
    for lag in range(len(ar) + 1):
        # (C'C)_i,i+lag = sum_j c_j c_j-lag over rows i+j within the signal
        i = np.arange(size - lag)
        total = sum(c[j] * c[j - lag] * (i + j < size) for j in range(lag, len(c)))
        value = np.zeros(size)
        value[lag:] = total * own[: size - lag] * own[lag:]
        bands[width - lag] += value[late]
    _add_precision(bands, width, time[late], g, t_c)
    there = back[late]
    return np.asarray(G - there.T @ solveh_banded(bands, there))


def _add_precision(bands: Array, width: int, time: Array, g: float, t_c: float) -> None:
    """K^-1/g^2 of the Ornstein-Uhlenbeck process at rising times: tridiagonal, into upper bands."""
    rho = np.exp(-np.diff(time) / t_c)
    free = 1.0 / (1.0 - rho**2)
    bands[width, 1:] += free / g**2
    bands[width, :-1] += rho**2 * free / g**2
    bands[width, 0] += 1.0 / g**2
    bands[width - 1, 1:] -= rho * free / g**2


def _delayed(X: Array, k: int) -> Array:
    """Rows k later, zeros before: x_i-k."""
    return X if k == 0 else np.concatenate([np.zeros((k, X.shape[1])), X[:-k]])


def _advanced(X: Array, k: int) -> Array:
    """Rows k earlier, zeros after: x_i+k."""
    return X if k == 0 else np.concatenate([X[k:], np.zeros((k, X.shape[1]))])


def _is_known(e: Dataset, s: Signal) -> bool:
    """Whether scale and correlation time of a signal's discrepancy are known."""
    return s.channel in e.discrepancy and s.channel in e.memory
