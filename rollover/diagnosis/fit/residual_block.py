"""Residual blocks of recordings: whitened residual, Jacobian by differences, slope of the time shift at a point."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable, Sequence

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.fit.cache import NONE, Simulations
from rollover.diagnosis.fit.finite_differences import Point, adaptive_difference, moved_to, ridge_at, step_reduced
from rollover.diagnosis.fit.linearisation import ResidualBlock
from rollover.diagnosis.fit.parameterisation import Candidate, key_at
from rollover.diagnosis.noise.ensemble import heavy_tail
from rollover.diagnosis.settings import SETTINGS

Array = NDArray[np.float64]
TUNING = SETTINGS.fit.levenberg_marquardt
KEPT = SETTINGS.fit.notebook.most_linearised


class Blocks(Simulations):
    """Recordings linearised at points; what was worked out at one of the last places is not worked out again."""

    def __init__(self, dataset: Sequence[Dataset]) -> None:
        super().__init__(dataset)
        self.measured = [e.measured() for e in self.dataset]
        self.heavy_tailed = True  # whether a recording may have taken another course than its run
        self._blocks: OrderedDict[Hashable, ResidualBlock | None] = OrderedDict()

    def with_noise_model(self, dataset: Sequence[Dataset]) -> None:
        """Take the same recordings with another noise: nothing is simulated again, fits must be made anew."""
        super().with_noise_model(dataset)
        self.measured = [e.measured() for e in self.dataset]
        self._blocks.clear()

    def block(
        self,
        r: int,
        candidates: Sequence[Candidate],
        x: Sequence[float],
        shift: float,
        fd_step: float,
        known: Array | None = None,
        *,
        clock: bool = True,
    ) -> ResidualBlock | None:
        """Recording r linearised at x by differences over `fd_step`: no Jacobian for 0, no time slope without `clock`.

        `known` (n, k) are the first k columns of the Jacobian where those of an earlier place will do.
        """
        if known is not None or not fd_step or self.effort.is_ensemble:  # of runs the medoid may be another one
            return self._block(r, candidates, x, shift, fd_step, known, clock)
        held = self.heavy_tailed, self._fixed_shifts
        at = (r, tuple([c.token for c in candidates]), tuple(x), shift, fd_step, clock, held)
        if at in self._blocks:
            self._blocks.move_to_end(at)
            return self._blocks[at]
        found = self._blocks[at] = self._block(r, candidates, x, shift, fd_step, known, clock)
        if len(self._blocks) > KEPT:
            self._blocks.popitem(last=False)
        return found

    def _block(
        self,
        r: int,
        candidates: Sequence[Candidate],
        x: Sequence[float],
        shift: float,
        fd_step: float,
        known: Array | None,
        clock: bool,
    ) -> ResidualBlock | None:
        key = key_at(r, candidates, x, shift)
        raw = self._raw_at(key, candidates, x, shift)
        y = self._whitened(key, raw)
        if raw is None or y is None:
            return None
        e, discontinuities = self.dataset[r], self._discontinuities.get(key, NONE)
        J = np.zeros((y.size, len(x)))
        if known is not None:
            J[:, : known.shape[1]] = known
        clock = clock and self.effort.is_timed and not (self._fixed_shifts and e.recording.clock.zero != "unknown")
        slope = np.zeros_like(raw)
        if clock:
            slope = self.clock_slope(r, candidates, x, shift, raw)

        worth = e.worth(discontinuities)
        marginalised = e.marginalised_beside(discontinuities)
        residual = marginalised(worth * (self.measured[r] - y))
        far = max(1.0, float(np.sqrt(np.mean(residual * residual)))) if 0.0 < fd_step <= self.effort.fine else np.inf
        far = far if far < TUNING.local_slopes_below else np.inf  # a wide step bridges local minima

        def off(end: Point) -> Array | None:
            return self.moved(r, (candidates, x), end, shift, None if self._fixed_shifts else slope)

        def off_by(k: int) -> Callable[[float], Array | None]:
            at = (candidates, x)
            return lambda step: self.moved(r, at, (candidates, moved_to(at, k, x[k] + step)), shift)

        for k in range(0 if known is None else known.shape[1], len(x) if fd_step else 0):
            if self.effort.wide:
                widest = 0.0 if self._fixed_shifts else self.effort.wide  # a first fit is short
                column = adaptive_difference(e, off, (candidates, x), k, fd_step, widest)
                if column is None:
                    return None
                ridge = ridge_at((candidates, x), k)
                J[:, k] = column if ridge is None else column - ridge[1] * J[:, ridge[0]]
                continue
            column = step_reduced(off_by(k), fd_step if x[k] < 0.5 else -fd_step, far)
            if column is None:
                return None
            J[:, k] = column
        slope[discontinuities] = 0.0
        slope = marginalised(worth * e.whitened(slope)) if clock else slope
        counts = heavy_tail(e, residual) if self.heavy_tailed else None
        if counts is not None:
            residual, J, slope = counts.samples * residual, counts.samples[:, None] * J, counts.samples * slope
        return ResidualBlock(
            residual=residual, J=J, slope=slope, shift=shift, prior=e.shift_prior, heavy_tail=counts,
            expected=e.expected,
            masked=self.heavy_tailed,
        )  # fmt: skip
