"""Least squares of effects over several recordings by simulation, the time shift of each profiled out: (D1)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.fit.linearisation import Fitted, ResidualBlock, bounded_step, time_shift_step, total_of
from rollover.diagnosis.fit.parameterisation import Candidate
from rollover.diagnosis.fit.residual_block import Blocks
from rollover.diagnosis.noise.truncation import shortly_after_impact
from rollover.diagnosis.settings import SETTINGS

Array = NDArray[np.float64]
TUNING = SETTINGS.fit.levenberg_marquardt


class Problem(Blocks):
    """Recordings held against what is simulated of them."""

    def __init__(self, dataset: Sequence[Dataset]) -> None:
        super().__init__(dataset)
        self.shifts = [0.0] * len(self.dataset)
        self._near: Problem | None = None

    def no_jacobian(self) -> Problem:
        """The same without what was simulated, to be sent to another process."""
        other = Problem(self.dataset)
        other.shifts = list(self.shifts)
        return other

    def near(self) -> Problem:
        """One that sees of the same recordings what comes `shortly_after_impact`; itself where none goes on long."""
        if not self.effort.is_ensemble:
            return self
        dataset = [shortly_after_impact(e) for e in self.dataset]
        if all(a is b for a, b in zip(dataset, self.dataset, strict=True)):
            return self
        if self._near is None or [e.count for e in self._near.dataset] != [e.count for e in dataset]:
            self._near = Problem(dataset)
        else:
            self._near.with_noise_model(dataset)
        self._near.shifts, self._near.heavy_tailed = list(self.shifts), self.heavy_tailed
        self._near._fixed_shifts = self._fixed_shifts
        return self._near

    def beginning(self, base: Fitted) -> tuple[Problem, Fitted]:
        """Who is `near`, and a base as that one sees it, by the slopes that it has."""
        near = self.near()
        if near is self:
            return self, base
        blocks = []
        for r, (b, e, cut) in enumerate(zip(base.blocks, self.dataset, near.dataset, strict=True)):
            both = zip(e.signals, cut.signals, strict=True)
            seen = np.concatenate([np.arange(s.rows.size) < short.rows.size for s, short in both])
            blocks.append(near.block(r, base.candidates, base.x, b.shift, self.effort.fine, b.unweighted_J[seen]))
        known = tuple(b for b in blocks if b is not None)
        return near, replace(base, blocks=known) if len(known) == len(blocks) else near.again(base)

    @contextmanager
    def held(self, *, heavy_tailed: bool | None = None, fixed_shifts: bool | None = None) -> Iterator[None]:
        """Within it recordings may or may not have taken another course, clocks whose zero is known stay or do not.

        Far from an explanation a shift eats what is missing.
        """
        before = self.heavy_tailed, self._fixed_shifts
        self.heavy_tailed, self._fixed_shifts = (
            b if v is None else v for v, b in zip((heavy_tailed, fixed_shifts), before, strict=True)
        )
        try:
            yield
        finally:
            self.heavy_tailed, self._fixed_shifts = before

    def again(self, fitted: Fitted) -> Fitted:
        """A fit where it stands, linearised anew under the noise as it is held now."""
        fine, shifts = self.effort.fine, [b.shift for b in fitted.blocks]
        self.simulate_neighbourhood(range(len(shifts)), fitted.candidates, fitted.x, shifts, fine)
        blocks = [self.block(r, fitted.candidates, fitted.x, b.shift, fine) for r, b in enumerate(fitted.blocks)]
        updated = [new if new is not None else old for new, old in zip(blocks, fitted.blocks, strict=True)]
        return Fitted(candidates=fitted.candidates, x=fitted.x, blocks=tuple(updated))

    def recounted(self, fitted: Fitted) -> Fitted:
        """A fit where it stands by the slopes that it has, where nothing but what samples count has changed."""
        each = enumerate(fitted.blocks)
        new = [self.block(r, fitted.candidates, fitted.x, b.shift, self.effort.fine, b.unweighted_J) for r, b in each]
        return replace(fitted, blocks=tuple(b or old for b, old in zip(new, fitted.blocks, strict=True)))

    def is_beside(self, x: Sequence[float], there: Sequence[float]) -> bool:
        """Whether a place is as near to another as the finite-difference step with which a fit ends."""
        return max((abs(a - b) for a, b in zip(x, there, strict=True)), default=0.0) < self.effort.fine

    @property
    def samples_per_error(self) -> float:
        """Samples that share one error: those of a signal where a scatter or a tolerance prevails, else 1."""
        shared = [e.shared(s) if e.model_error_dominates(s) else 0.0 for e in self.dataset for s in e.signals]
        return sum(shared) / len(shared) if all(shared) else 1.0

    @property
    def samples_per_draw(self) -> float:
        """Samples that share one error in all recordings: a rig repeats its discrepancy, (D21), (D27); runs scatter."""
        return self.samples_per_error * (self.recordings_per_draw if self.samples_per_error > 1.0 else 1.0)

    @property
    def recordings_per_draw(self) -> float:
        """Recordings that share one draw of the discrepancy: all, as a rig repeats it, fewer where references teach."""
        return 1.0 + sum(bool(e.discrepancy) for e in self.dataset[1:]) / (1.0 + self.dataset[0].taught_by)

    def residuals(self, fitted: Fitted) -> list[Array]:
        """Measured less predicted, stacked, SI, of each recording."""
        raws = [self.raw(r, fitted.candidates, fitted.x, b.shift) for r, b in enumerate(fitted.blocks)]
        return [np.zeros(e.count) if y is None else e.values - y for e, y in zip(self.dataset, raws, strict=True)]

    def clocked(
        self, r: int, candidates: Sequence[Candidate], x: Sequence[float], shift: float, rounds: int
    ) -> ResidualBlock | None:
        """Recording r at x without slopes, its time shift moved to where it is met best: no run more, of full runs."""
        found = self.block(r, candidates, x, shift, 0.0)
        for _ in range(rounds):
            if self._fixed_shifts or found is None:
                break
            new = self.block(r, candidates, x, found.shift + time_shift_step(found, np.zeros(len(x))), 0.0)
            if new is None or new.total >= found.total:
                break
            found = new
        return found

    def _trial_block(
        self, r: int, candidates: Sequence[Candidate], x: Sequence[float], shift: float
    ) -> ResidualBlock | None:
        """Recording r where a step leads: what is left there is all that is asked for, unless its clock moves on."""
        if self.effort.clocked:
            return self.clocked(r, candidates, x, shift, self.effort.clocked)
        return self.block(r, candidates, x, shift, 0.0, clock=False)

    def _backtracked_shift(
        self,
        r: int,
        candidates: Sequence[Candidate],
        x: Sequence[float],
        before: ResidualBlock,
        after: ResidualBlock | None,
    ) -> ResidualBlock | None:
        """The same with its time shift gone less far, or not at all, where edges left more after it than before."""
        if after is None or after.total <= before.total:
            return after
        later = after.shift - before.shift
        shares = TUNING.shorter_shifts if later else ()
        found = [self.block(r, candidates, x, before.shift + f * later, 0.0, clock=False) for f in shares]
        return min([after, *(b for b in found if b is not None)], key=lambda b: b.total)

    def fit(
        self,
        candidates: Sequence[Candidate],
        start: Sequence[float],
        *,
        rounds: int | None = None,
        only: Sequence[int] | None = None,
        shifts: Sequence[float] | None = None,
        width: int = 0,
        fixed_shifts: bool = False,
        no_jacobian: bool = False,
        finely: bool = False,
        reused: Sequence[Array] | None = None,
    ) -> Fitted | None:
        """Levenberg-Marquardt on (D1) from a start within the unit box; None if nothing can be simulated there.

        `fixed_shifts` as in `held`. A `no_jacobian` one ends without slopes, where only what it leaves is asked for;
        one that is made `finely` where a round gains next to nothing, others where it gains less than tells two apart.
        `reused` are the first slopes (n, k) of each recording to begin with, as a fit of fewer effects has them; it
        ends with its own.
        """
        with self.held(fixed_shifts=fixed_shifts):
            return self._fit(
                candidates,
                start,
                rounds,
                only,
                shifts,
                width,
                no_jacobian,
                TUNING.converged_gain_fine if finely else TUNING.converged_gain,
                reused,
            )

    def _fit(
        self,
        candidates: Sequence[Candidate],
        start: Sequence[float],
        rounds: int | None,
        only: Sequence[int] | None,
        shifts: Sequence[float] | None,
        width: int,
        no_jacobian: bool,
        least: float,
        reused: Sequence[Array] | None,
    ) -> Fitted | None:
        use = list(range(len(self.dataset))) if only is None else list(only)
        fd_steps = self.effort.fd_steps
        rounds, width = self.effort.rounds if rounds is None else rounds, min(width, len(fd_steps) - 1)
        x = [float(v) for v in start]
        shifts = [self.shifts[r] for r in use] if shifts is None else list(shifts)
        fixed = len(x) - len(candidates[-1].search) if candidates else 0
        known: Sequence[Array | None] = [None] * len(use) if reused is None else reused
        self.simulate_neighbourhood(
            use, candidates, x, shifts, fd_steps[width], 0 if reused is None else reused[0].shape[1]
        )
        found = [
            self.block(r, candidates, x, s, fd_steps[width], J) for r, s, J in zip(use, shifts, known, strict=True)
        ]
        if any(b is None for b in found):
            return None
        blocks: list[ResidualBlock] = [b for b in found if b is not None]
        best, damping = total_of(blocks), 1e-3
        borrowed = reused is not None  # whether slopes are those of another place
        linearised_at = x  # where all were last worked out
        for turn in range(rounds):
            A, b = np.zeros((len(x), len(x))), np.zeros(len(x))
            for block in blocks:
                Ar, br, _ = block.normal()
                A, b = A + Ar, b + br
            improved, total = False, best
            enough = max(least, TUNING.converged_gain_fine * 1e-2 * best, self.effort.least)
            if least > TUNING.converged_gain_fine and not self.effort.is_ensemble:
                enough = max(enough, TUNING.converged_share * (best - sum(k.residual.size for k in blocks)))
            due = 0.0  # gain of a step by these slopes
            for _ in range(TUNING.step_retries):
                dx = bounded_step(A, b, np.array(x), damping)
                trial = [float(v) for v in np.clip(np.array(x) + dx, 0.0, 1.0)]
                moved = np.array(trial) - np.array(x)
                due = 2.0 * float(b @ moved) - float(moved @ A @ moved)
                if width and due < max(TUNING.least_promise * least, TUNING.least_promise_far * enough):
                    break  # nothing more is to be had, by these slopes
                steps = [time_shift_step(block, moved) for block in blocks]
                self.made_ahead((r, candidates, trial) for r in use)
                after = [
                    self._trial_block(r, candidates, trial, block.shift + d)
                    for r, block, d in zip(use, blocks, steps, strict=True)
                ]
                if all(a is not None for a in after):
                    total = total_of([a for a in after if a is not None])
                    if total >= best and not self.effort.clocked:
                        each = zip(use, blocks, after, strict=True)
                        after = [self._backtracked_shift(r, candidates, trial, block, a) for r, block, a in each]
                        total = total_of([a for a in after if a is not None])
                    if total < best:
                        improved = True
                        if total > TUNING.lengthen_above**2 * sum(k.residual.size for k in blocks):
                            trial, after, total = self._extrapolated(use, candidates, x, trial, after, total)
                        break
                damping = max(30.0 * damping, 1e-2)
            gain = best - total if improved else 0.0
            if improved:
                x, best, damping = trial, total, 0.1 * damping
                shifts = [a.shift for a in after if a is not None]
            fresh = gain < enough
            if fresh:
                # what slopes of another place promise no more those of this one may
                width, damping = width if borrowed else width + 1, 1e-3
            last = width >= len(fd_steps)
            if last and not improved and len(fd_steps) == 1:
                break
            has_no_jacobian = no_jacobian and (last or turn + 1 == rounds)
            fd_step = 0.0 if has_no_jacobian else self.effort.fine if last else fd_steps[width]
            # what is held already moves little: its slopes are worked out anew only where the search narrows, or where
            # they lead astray or not far, as those of another point along a ridge do; where a run is dear a short fit
            # keeps all that predicted well, and another ends with those of a place beside it
            slow = gain < TUNING.reuse_least_share * due or gain < TUNING.reuse_least_gain * best
            anew = fresh or (slow and not self.effort.is_ensemble)
            keep = 0 if anew else len(x) if no_jacobian and self.effort.is_ensemble and not slow else fixed
            if last and self.effort.is_ensemble and linearised_at is not None and self.is_beside(x, linearised_at):
                keep = len(x)
            elif anew and not has_no_jacobian:
                linearised_at = x
            borrowed = self.effort.is_ensemble and ((borrowed and not anew) or 0 < keep == len(x))
            if not has_no_jacobian:
                self.simulate_neighbourhood(use, candidates, x, shifts, fd_step, keep)
            again = [
                self.block(
                    r, candidates, x, s, fd_step, None if not keep or has_no_jacobian else block.unweighted_J[:, :keep]
                )
                for r, s, block in zip(use, shifts, blocks, strict=True)
            ]
            if any(b is None for b in again):
                return None
            blocks = [b for b in again if b is not None]
            if has_no_jacobian:
                return Fitted(candidates=tuple(candidates), x=tuple(x), blocks=tuple(blocks))
            if last:
                break
        if width < len(fd_steps) and (borrowed or fd_steps[width] != self.effort.fine):
            self.simulate_neighbourhood(use, candidates, x, shifts, self.effort.fine)
            ended = [self.block(r, candidates, x, s, self.effort.fine) for r, s in zip(use, shifts, strict=True)]
            if all(b is not None for b in ended):
                blocks = [b for b in ended if b is not None]
        return Fitted(candidates=tuple(candidates), x=tuple(x), blocks=tuple(blocks))

    def _extrapolated(
        self,
        use: Sequence[int],
        candidates: Sequence[Candidate],
        x: Sequence[float],
        trial: list[float],
        after: list[ResidualBlock | None],
        total: float,
    ) -> tuple[list[float], list[ResidualBlock | None], float]:
        """Go on the way of a step as long as that helps: events that come too late count for more than their slope."""
        dx = np.array(trial) - np.array(x)
        for _ in range(TUNING.most_lengthenings):
            dx = TUNING.lengthen_factor * dx
            there = [float(v) for v in np.clip(np.array(x) + dx, 0.0, 1.0)]
            self.made_ahead((r, candidates, there) for r in use)
            each = zip(use, after, strict=True)
            found = [self._trial_block(r, candidates, there, b.shift) for r, b in each if b is not None]
            if there == trial or any(b is None for b in found):
                break
            chi2 = total_of([b for b in found if b is not None])
            if chi2 >= total:
                break
            trial, after, total = there, list(found), chi2
        return trial, after, total


__all__ = ["Fitted", "Problem", "ResidualBlock", "time_shift_step"]
