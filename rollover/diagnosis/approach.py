"""Misfits that are slow before anything is hit: the recorder's noise, not what a simulation lacks.

Quiet windows are too short to tell a noise of 1/f. It is told from missing physics by three marks: it is there in the
approach, where nothing is missing yet; it is no stronger after the contact; and it differs from recording to recording.
With c the first cosines of a stretch of a misfit, over what the quiet noise lets expect of each,

    sum c^2 of the approach           beyond chi-square: slower than what is quiet                             (A1)
    mean c^2 after over that before   within F: no more of it where physics acts                               (A2)
    mean of c over its error          within t, for each of all that comes after: nothing recordings share     (A3)

An offset that all recordings have moves the first cosine, the mean, by the same: in (A1) and (A2) that is taken out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.evidence import Evidence, Signal

Array = NDArray[np.float64]
TERMS = 5  # cosines of a stretch, the first of them its mean
SHARED = 8  # of all that comes after the contact
LEAST = 24  # samples of an approach
FEWEST = 3  # recordings, to tell what they share
MORE = 1.5  # times what is expected, at least
SLOW, LOUDER, ALIKE = 0.01, 0.01, 0.02  # p-values of (A1), below, of (A2) and (A3), above


@dataclass(frozen=True, kw_only=True)
class Stretches:
    """One recording's misfit in cosines over their expectation: before (k,), after (m, k), all after at once (j,)."""

    before: Array
    after: Array
    whole: Array


def is_recorders(told: Sequence[tuple[Evidence, Signal, Array]]) -> bool:
    """Whether slow misfits (n,) of a channel, one of each recording, are its recorder's noise; not if none can tell."""
    if len(told) < FEWEST:
        return False
    found = [s for one in told if (s := stretches(*one)) is not None]
    if len(found) < len(told):
        return False
    return is_slow(found) and not is_louder(found) and not is_shared(found)


def stretches(e: Evidence, s: Signal, misfit: Array) -> Stretches | None:
    """See `Stretches`; None where the approach is too short, or what comes after is shorter than it."""
    n = int(np.searchsorted(e.recording.time[s.rows], e.simulator.contact))
    many = (misfit.size - n) // n if n else 0
    if n < LEAST or many < 1:
        return None
    before, later = cosines(n, TERMS), misfit[n:]
    expected = _expected(s, before)
    every = cosines(later.size, SHARED)
    return Stretches(
        before=before @ misfit[:n] / expected,
        after=later[: many * n].reshape(many, n) @ before.T / expected,
        whole=every @ later / _expected(s, every),
    )


def cosines(n: int, terms: int) -> Array:
    """The first cosines over n samples, (terms, n), orthonormal."""
    found = np.cos(np.pi * np.outer(np.arange(terms), np.arange(n) + 0.5) / n) * math.sqrt(2.0 / n)
    found[0] /= math.sqrt(2.0)
    return np.asarray(found)


def _expected(s: Signal, along: Array) -> Array:
    """Standard deviation (k,) along directions (k, n) of the noise of quiet stretches, of one memory a.

    d' C d with C of a^|i - j|: sum_i d_i (2 y_i - d_i), y_i = d_i + a y_(i-1).
    """
    noise, ar = s.at_rest or (s.noise, s.ar)
    past = np.zeros(along.shape[0])
    power = np.zeros(along.shape[0])
    a = min(max(sum(ar), 0.0), 0.99)
    for d in along.T:
        past = d + a * past
        power += d * (2.0 * past - d)
    return np.asarray(noise * np.sqrt(np.maximum(power, 1e-12)))


def is_slow(found: Sequence[Stretches]) -> bool:
    """(A1): whether the approaches are slower than what is quiet."""
    from scipy.special import chdtrc

    c = _beside_an_offset(np.array([s.before for s in found]))
    total, freedom = float(np.sum(c * c)), c.size - 1
    return total > MORE * freedom and float(chdtrc(freedom, total)) < SLOW


def is_louder(found: Sequence[Stretches]) -> bool:
    """(A2): whether what is slow is clearly more after the contact; of so many numbers as carry it."""
    from scipy.special import fdtrc

    before = _beside_an_offset(np.array([s.before for s in found])) ** 2
    after = _beside_an_offset(np.concatenate([s.after for s in found])) ** 2
    powers = np.concatenate([before, after]).mean(axis=0)
    carry = float(powers.sum() ** 2 / np.sum(powers**2))
    ratio = float(after.mean() / before.mean())
    return float(fdtrc(carry * len(after), carry * len(before), ratio)) < LOUDER


def _beside_an_offset(c: Array) -> Array:
    """Cosines (m, k) without what all have of the first."""
    return np.asarray(c - np.eye(1, c.shape[1]) * c[:, 0].mean())


def is_shared(found: Sequence[Stretches]) -> bool:
    """(A3): whether a cosine of what comes after the contact differs from nothing in all recordings together."""
    from scipy.special import fdtrc

    c = np.array([s.whole for s in found])
    t = c.mean(axis=0) ** 2 * len(c) / np.maximum(c.var(axis=0, ddof=1), 1e-300)
    return bool(c.shape[1] * float(fdtrc(1, len(c) - 1, t.max())) < ALIKE)
