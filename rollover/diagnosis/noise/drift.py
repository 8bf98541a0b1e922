"""Misfits that are slow before anything is hit: the recorder's noise, not what a simulation lacks.

Quiet windows are too short to tell a noise of 1/f. It is told from missing physics by three marks: it is there in the
approach, where nothing is missing yet; it is no stronger after the contact; and it differs from recording to recording.
With c the first cosines of a stretch of a misfit, over what the quiet noise lets expect of each,

    sum c^2 of the approach           beyond chi-square: slower than what is quiet                             (A1)
    mean c^2 after over that before   within F: no more of it where physics acts                               (A2)
    mean of c over its error          within t, for each of all that comes after: nothing recordings share     (A3)

(A3) is asked of c as it was read as well: one offset is as many times unlike noises as these are unlike.

An offset that all recordings have moves the first cosine, the mean, by the same: in (A1) and (A2) that is taken out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.data.dataset import Dataset, Signal
from rollover.diagnosis.settings import SETTINGS

Array = NDArray[np.float64]
TUNING = SETTINGS.noise.drift


def is_recorder_noise(signals: Sequence[tuple[Dataset, Signal, Array]]) -> bool:
    """Whether slow misfits (n,) of a channel, one of each recording, are its recorder's noise; not if none can tell."""
    contacts = [int(np.searchsorted(e.recording.time[s.rows], e.simulator.contact)) for e, s, _ in signals]
    if len(signals) < TUNING.least_recordings or any(
        n < TUNING.least_samples or w.size < 2 * n for n, (_, _, w) in zip(contacts, signals, strict=True)
    ):
        return False
    if any(s.quiet[0] <= 0.0 for _, s, _ in signals):
        return False  # next to no noise at all everything is slow and loud
    before = np.array(
        [leading_cosines(s, w[:n], TUNING.drift_terms) for n, (_, s, w) in zip(contacts, signals, strict=True)]
    )
    if not is_slow(before):
        return False
    after = [
        leading_cosines(s, part, TUNING.drift_terms)
        for n, (_, s, w) in zip(contacts, signals, strict=True)
        for part in _windows(w[n:], n)
    ]
    if is_louder(before, np.array(after)):
        return False
    whole = [leading_cosines(s, w[n:], TUNING.contact_terms) for n, (_, s, w) in zip(contacts, signals, strict=True)]
    plain = [
        cosines(w.size - n, TUNING.contact_terms) @ w[n:] / math.sqrt(w.size - n)
        for n, (*_, w) in zip(contacts, signals, strict=True)
    ]
    # over the noise of each, or as it was read: the same offset is not as many times two noises
    return not (is_shared(np.array(whole)) or is_shared(np.array(plain)))


def _windows(values: Array, n: int) -> Array:
    """Values in rows of n; what is left over at the end is left aside."""
    many = values.size // n
    return values[: many * n].reshape(many, n)


def leading_cosines(s: Signal, misfit: Array, terms: int) -> Array:
    """The first cosines of a stretch of a misfit, (terms,), over what the noise of quiet stretches lets expect of each.

    Of a memory a a direction d has the variance d' C d, C of a^|i - j|: sum_i d_i (2 y_i - d_i), y_i = d_i + a y_(i-1)
    """
    from scipy.signal import lfilter

    ways = cosines(misfit.size, terms)
    noise, ar = s.quiet
    past = lfilter([1.0], [1.0, -min(max(sum(ar), 0.0), TUNING.largest_memory)], ways, axis=1)
    power = np.sum(ways * (2.0 * past - ways), axis=1)
    return np.asarray(ways @ misfit / (noise * np.sqrt(np.maximum(power, 1e-12))))


def cosines(n: int, terms: int) -> Array:
    """The first cosines over n samples, (terms, n), orthonormal."""
    found = np.cos(np.pi * np.outer(np.arange(terms), np.arange(n) + 0.5) / n) * math.sqrt(2.0 / n)
    found[0] /= math.sqrt(2.0)
    return np.asarray(found)


def is_slow(before: Array) -> bool:
    """(A1): whether approaches (recordings, cosines) are slower than what is quiet."""
    from scipy.special import chdtrc

    c = _beside_an_offset(before)
    total, freedom = float(np.sum(c * c)), c.size - 1
    return total > TUNING.least_ratio * freedom and float(chdtrc(freedom, total)) < TUNING.slow_p_value


def is_louder(before: Array, after: Array) -> bool:
    """(A2): whether what is slow is clearly more after the contact; of so many numbers as carry it."""
    from scipy.special import fdtrc

    first, then = _beside_an_offset(before) ** 2, _beside_an_offset(after) ** 2
    powers = np.concatenate([first, then]).mean(axis=0)
    carry = float(powers.sum() ** 2 / np.sum(powers**2))
    ratio = float(then.mean() / first.mean())
    return float(fdtrc(carry * len(then), carry * len(first), ratio)) < TUNING.louder_p_value


def _beside_an_offset(c: Array) -> Array:
    """Cosines (m, k) without what all have of the first."""
    return np.asarray(c - np.eye(1, c.shape[1]) * c[:, 0].mean())


def is_shared(whole: Array) -> bool:
    """(A3): whether a cosine of what comes after the contact differs from nothing in all recordings together."""
    from scipy.special import fdtrc

    t = whole.mean(axis=0) ** 2 * len(whole) / np.maximum(whole.var(axis=0, ddof=1), 1e-300)
    return bool(whole.shape[1] * float(fdtrc(1, len(whole) - 1, t.max())) < TUNING.shared_p_value)
