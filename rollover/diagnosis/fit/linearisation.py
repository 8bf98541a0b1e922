"""Recordings linearised at a point: what is left there, and where least squares would go from it.

For recording r with whitened residual w, J = dy/dx of the effects' coordinates and s = dy/dtau of its time shift,

    minimise sum_r |w_r - J_r dx - s_r dtau_r|^2 + ((tau_r + dtau_r)/sd)^2                                    (D1)

tau_r is eliminated, which leaves for each recording a small A_r, b_r, c_r: enough to refit without any recording and
to predict that one, so that holding out costs no simulation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.fit.parameterisation import Candidate
from rollover.diagnosis.noise.ensemble import HeavyTail
from rollover.diagnosis.settings import SETTINGS

Array = NDArray[np.float64]
TUNING = SETTINGS.fit.linearisation


@dataclass(frozen=True, kw_only=True)
class ResidualBlock:
    """One recording at the fitted point: residual (n,), Jacobian (n, p), slope of the shift (n,), shift, its prior.

    `heavy_tail` is what samples count where the run went another course than the recording; None where it did not.
    Residual, Jacobian and slope have it in them already. `expected` is the sum of squares that noise and scatter alone
    leave, where that is not one for each sample; `masked` says that another course would have counted for less.
    """

    residual: Array
    J: Array
    slope: Array
    shift: float
    prior: float
    heavy_tail: HeavyTail | None = None
    expected: float | None = None
    masked: bool = False

    @property
    def size(self) -> float:
        """Sum of squares that noise and scatter alone leave."""
        return float(self.residual.size) if self.expected is None else self.expected

    def counted(self, values: Array) -> Array:
        """Other whitened samples (n,), or columns of them, for what they count here."""
        return values if self.heavy_tail is None else np.asarray((values.T * self.heavy_tail.samples).T)

    @property
    def unweighted_residual(self) -> Array:
        """Residual of samples that count in full."""
        return self.residual if self.heavy_tail is None else self.residual / self.heavy_tail.samples

    @property
    def residual_for_squares(self) -> Array:
        """Residual whose squares add up to what is left."""
        if self.heavy_tail is None:
            return self.residual
        return np.where(self.heavy_tail.late, np.sqrt(self.heavy_tail.share) * self.unweighted_residual, self.residual)

    @property
    def unweighted_J(self) -> Array:
        """J of samples that count in full."""
        return self.J if self.heavy_tail is None else self.J / self.heavy_tail.samples[:, None]

    @property
    def unweighted_slope(self) -> Array:
        """Slope of the shift of samples that count in full."""
        return self.slope if self.heavy_tail is None else self.slope / self.heavy_tail.samples

    @cached_property
    def squares(self) -> float:
        """Sum of squares of what is left, another course for what it counts (D9)."""
        return float(self.residual @ self.residual) + (0.0 if self.heavy_tail is None else self.heavy_tail.more)

    @cached_property
    def weight(self) -> float:
        """s's + 1/sd^2."""
        return float(self.slope @ self.slope) + self.prior**-2

    @property
    def total(self) -> float:
        """(D1) where it stands."""
        return self.squares + (self.shift / self.prior) ** 2

    def normal(self) -> tuple[Array, Array, float]:
        """A (p, p), b (p,), c: |..|^2 of (D1) with tau eliminated is c - 2 b'dx + dx'A dx."""
        return self._normal

    @cached_property
    def _normal(self) -> tuple[Array, Array, float]:
        g = float(self.slope @ self.residual) - self.shift * self.prior**-2
        h = self.J.T @ self.slope
        A = self.J.T @ self.J - np.outer(h, h) / self.weight
        b = self.J.T @ self.residual - h * g / self.weight
        c = self.total - g * g / self.weight
        return A, b, c


@dataclass(frozen=True, kw_only=True)
class Fitted:
    """Effects fitted to recordings: coordinates x (p,), linearised residuals there, and their sum of squares `chi2`.

    `cross_validated` is what runs leave of each recording where the fit to all other conditions would be, if they were
    made.
    """

    candidates: tuple[Candidate, ...]
    x: tuple[float, ...]
    blocks: tuple[ResidualBlock, ...]
    cross_validated: tuple[float, ...] | None = None

    @property
    def effects(self) -> tuple[Candidate, ...]:
        """Candidates that explain something: all but a baseline, which is fitted beside them and stands first."""
        return tuple(c for c in self.candidates if not c.is_baseline)

    @property
    def first(self) -> int:
        """Index of the first effect among the candidates."""
        return len(self.candidates) - len(self.effects)

    @property
    def own(self) -> tuple[float, ...]:
        """Coordinates of the last effect."""
        return self.x[len(self.x) - len(self.candidates[-1].search) :]

    @property
    def total(self) -> float:
        """Sum over the recordings of (D1) where they stand: what a fit without slopes leaves."""
        return total_of(self.blocks)

    @property
    def chi2(self) -> float:
        """Sum over the recordings of (D1) at its minimum, squares over the noise: by noise alone about one a sample."""
        return sum(b.normal()[2] for b in self.blocks)

    @property
    def label(self) -> str:
        """Keys of the effects."""
        return " + ".join(c.key for c in self.effects) or "the scenario as it is"


def total_of(blocks: Sequence[ResidualBlock]) -> float:
    """Sum of (D1) over recordings where they stand."""
    return sum(b.total for b in blocks)


def first_effect_last(fitted: Fitted) -> Fitted:
    """The same fit with its first effect last; a baseline stays where it is."""
    k = fitted.first
    held, first = (sum(len(c.search) for c in cs) for cs in (fitted.candidates[:k], fitted.candidates[k : k + 1]))
    order = np.concatenate([np.arange(held), held + np.roll(np.arange(len(fitted.x) - held), -first)])
    return Fitted(
        candidates=(*fitted.candidates[:k], *fitted.candidates[k + 1 :], fitted.candidates[k]),
        x=tuple(fitted.x[k] for k in order),
        blocks=tuple(replace(b, J=b.J[:, order]) for b in fitted.blocks),
    )


def time_shift_step(block: ResidualBlock, dx: Array) -> float:
    """Change of the time shift that goes with dx; it stays within `widest_shift` of its prior."""
    g = float(block.slope @ (block.residual - block.J @ dx)) - block.shift * block.prior**-2
    most = TUNING.widest_shift * block.prior
    return min(max(block.shift + g / block.weight, -most), most) - block.shift


def at_an_end(x: float) -> bool:
    """Whether a coordinate ended at an end of its range."""
    return not 1e-6 < x < 1.0 - 1e-6


def bounded_step(A: Array, b: Array, x: Array, damping: float) -> Array:
    """Step that solves (A + damping diag A) dx = b, coordinates that would leave the unit box held at its border."""
    p = x.size
    free = np.ones(p, dtype=bool)
    dx = np.zeros(p)
    for _ in range(p + 1):
        if not free.any():
            break
        M = A[np.ix_(free, free)].copy()
        M[np.diag_indices_from(M)] *= 1.0 + damping
        M[np.diag_indices_from(M)] += TUNING.weak_prior
        target = b[free] - A[np.ix_(free, ~free)] @ dx[~free]
        dx[free] = np.linalg.solve(M, target)
        out = free & ((x + dx < 0.0) | (x + dx > 1.0))
        if not out.any():
            break
        dx[out] = np.clip(x[out] + dx[out], 0.0, 1.0) - x[out]
        free &= ~out
    return dx


def without_shift_direction(vectors: Array, block: ResidualBlock) -> Array:
    """Vectors (n, m) without what the recording's time shift explains, given its prior."""
    s = block.slope
    shrink = (1.0 - np.sqrt(block.prior**-2 / block.weight)) / max(float(s @ s), 1e-300)
    return np.asarray(vectors - shrink * np.outer(s, s @ vectors))


def is_at_bound(fitted: Fitted) -> bool:
    """Whether a number of the last effect stands at an end of its range."""
    return any(at_an_end(v) for v in fitted.own)
