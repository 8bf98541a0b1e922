"""Predictions of recordings at any point: simulated once, cached, and made ahead in parallel."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.fit.finite_differences import (
    Point,
    beside,
    clock_aligned_difference,
    needs_wider_step,
    stencil,
    time_derivative,
)
from rollover.diagnosis.fit.parameterisation import Candidate, Key, key_at, with_slices
from rollover.diagnosis.forward.full_run import full_runs, made_ahead, perturbations_of
from rollover.diagnosis.settings import SETTINGS
from rollover.system.processes import Children

Array = NDArray[np.float64]
NONE = np.zeros(0, dtype=np.int64)
MEMORY = SETTINGS.fit.notebook


class Simulations:
    """Datasets with a cache of simulations: the same values are never simulated twice."""

    def __init__(self, dataset: Sequence[Dataset]) -> None:
        self.dataset = tuple(dataset)
        self.effort = max(
            (e.simulator.effort for e in self.dataset), key=lambda e: e.is_ensemble, default=SETTINGS.forward.drops
        )
        self.simulations = 0
        self._fixed_shifts = False
        self._raw, self._known = Memory(), Memory()
        self._discontinuities: dict[Key, NDArray[np.int64]] = {}

    def with_noise_model(self, dataset: Sequence[Dataset]) -> None:
        """Take the same recordings under another noise model: nothing is simulated again."""
        self.dataset = tuple(dataset)
        self._known = Memory()

    @property
    def is_helped(self) -> bool:
        """Whether there are children to make full runs."""
        return self._children is not None

    @property
    def _children(self) -> Children | None:
        runs = full_runs(self.dataset[0].simulator) if self.dataset else None
        return None if runs is None else runs.children

    def made_ahead(self, wanted: Iterable[tuple[int, Sequence[Candidate], Sequence[float]]]) -> None:
        """Make full runs of (recording, candidates, x) side by side where there are children to do it."""
        made_ahead(self._children, ((self.dataset[r].simulator, self.changes(c, x)) for r, c, x in wanted))

    def simulate_ensembles(self, changes: Mapping[str, object], parts: int = 1) -> None:
        """Make what all recordings' runs with `changes` and their neighbours' are, as `perturbed` asks for them."""
        made_ahead(self._children, perturbations_of([e.simulator for e in self.dataset], changes, parts))

    def simulate_neighbourhood(
        self,
        use: Sequence[int],
        candidates: Sequence[Candidate],
        x: Sequence[float],
        shifts: Sequence[float],
        fd_step: float,
        first: int = 0,
    ) -> None:
        """Make those of a place and of all that slopes ask for, from a `fd_step` beside it and coordinate `first` on.

        Where runs scatter one step after another is too narrow to tell: all of one width are made before the next.
        """
        self.made_ahead(beside(use, candidates, x, fd_step, first))
        if self._fixed_shifts or not self.is_helped:
            return
        at, width, todo = (candidates, x), fd_step, []
        for r, shift in zip(use, shifts, strict=True):
            off = self._off(r, at, shift)
            todo += [(r, k, off) for k in range(first, len(x)) if off is not None]
        while todo:
            todo = [
                (r, k, o) for r, k, o in todo if needs_wider_step(self.dataset[r], o, at, k, width, self.effort.wide)
            ]
            width *= 2.0
            self.made_ahead((r, candidates, there) for r, k, _ in todo for there in stencil(at, k, width))

    def _off(self, r: int, at: Point, shift: float) -> Callable[[Point], Array | None] | None:
        """What the prediction of recording r differs by from a point to another, as clocks would have it."""
        raw = self.raw(r, *at, shift)
        if raw is None:
            return None
        slope = self.clock_slope(r, *at, shift, raw)
        return lambda end: self.moved(r, at, end, shift, slope)

    def predicted(self, r: int, candidates: Sequence[Candidate], x: Sequence[float], shift: float) -> Array | None:
        """Stacked prediction of recording r; None where the simulation fails or a value is out of bounds."""
        key = key_at(r, candidates, x, shift)
        return self._whitened(key, self._raw_at(key, candidates, x, shift))

    def raw(self, r: int, candidates: Sequence[Candidate], x: Sequence[float], shift: float) -> Array | None:
        """The same in SI, before the noise comes in."""
        return self._raw_at(key_at(r, candidates, x, shift), candidates, x, shift)

    def _whitened(self, key: Key, raw: Array | None) -> Array | None:
        """A prediction of a key, `raw` in SI, whitened."""
        if key not in self._known:
            self._known[key] = None if raw is None else self.dataset[key[0]].whitened(raw)
        return self._known[key]

    def _raw_at(self, key: Key, candidates: Sequence[Candidate], x: Sequence[float], shift: float) -> Array | None:
        """What `raw` is where that has this key."""
        if key not in self._raw:
            self._raw[key] = self._simulated(key, candidates, x, shift)
        return self._raw[key]

    def _simulated(self, key: Key, candidates: Sequence[Candidate], x: Sequence[float], shift: float) -> Array | None:
        self.simulations += 1
        r = key[0]
        found = self._made(r, candidates, x, shift)
        if found is None:
            return None
        y, predicted = found
        if not self.effort.is_timed:
            return y
        discontinuities = self.dataset[r].discontinuities(y, predicted)
        if discontinuities.size:
            self._discontinuities[key] = discontinuities
        return self.dataset[r].masked(y, discontinuities)

    def predicted_with_jumps(
        self, r: int, candidates: Sequence[Candidate], x: Sequence[float], shift: float
    ) -> Array | None:
        """Stacked prediction of recording r, SI, with its jumps as they are; not remembered. None if it fails."""
        found = self._made(r, candidates, x, shift)
        return None if found is None else found[0]

    def _made(
        self, r: int, candidates: Sequence[Candidate], x: Sequence[float], shift: float
    ) -> tuple[Array, dict[str, Array]] | None:
        """What recording r is predicted to be, stacked (SI) and by channel; None if that fails."""
        try:
            found = self.dataset[r].simulator.predict(self.changes(candidates, x), shift)
        except ValueError:
            return None
        if found is None:
            return None
        y = self.dataset[r].raw(found)
        return (y, found) if np.isfinite(y).all() else None

    @staticmethod
    def changes(candidates: Sequence[Candidate], x: Sequence[float]) -> dict[str, object]:
        """Values to exchange in the scenario."""
        found: dict[str, object] = {}
        ids = [c.id for c in candidates]
        for k, (c, own) in enumerate(with_slices(candidates)):
            found |= c.changes(x[own], 1 + ids[:k].count(c.id))
        return found

    def clock_slope(
        self, r: int, candidates: Sequence[Candidate], x: Sequence[float], shift: float, raw: Array
    ) -> Array:
        """dy/dtau (n,) of recording r, SI, `raw` y there."""
        changes, later = self.changes(candidates, x), self.effort.later
        return time_derivative(self.dataset[r], changes, shift, raw, later, both=self.effort.is_ensemble)

    def moved(self, r: int, before: Point, after: Point, shift: float, slope: Array | None = None) -> Array | None:
        """How the prediction of recording r differs between two points, whitened; nothing where either jumps.

        A jump that moves past a sample is no slope, and what is masked there follows the measurement. With `slope`,
        dy/dtau (n,) before, SI, the two are compared as a clock would have them, see `clock_aligned_difference`.
        """
        keys = key_at(r, *before, shift), key_at(r, *after, shift)
        first, last = (self._raw_at(key, *point, shift) for key, point in zip(keys, (before, after), strict=True))
        if first is None or last is None:
            return None
        if slope is not None:
            last = clock_aligned_difference(
                self.dataset[r], first, last, slope, lambda d: self.predicted_with_jumps(r, *after, shift + d)
            )
        d = last - first
        for key in keys:
            if key in self._discontinuities:
                d[self._discontinuities[key]] = 0.0
        e = self.dataset[r]
        discontinuities = self._discontinuities.get(keys[0], NONE)
        return e.marginalised_beside(discontinuities)(e.worth(discontinuities) * e.whitened(d))


class Memory:
    """Arrays by key, of at most so many bytes: beyond that the older half of them is let go of, never the newest."""

    def __init__(self, most: int = MEMORY.most_bytes) -> None:
        self._most, self._bytes = most, 0
        self._arrays: dict[Hashable, Array | None] = {}

    def __len__(self) -> int:
        return len(self._arrays)

    def __contains__(self, key: Hashable) -> bool:
        return key in self._arrays

    def __getitem__(self, key: Hashable) -> Array | None:
        return self._arrays[key]

    def __setitem__(self, key: Hashable, array: Array | None) -> None:
        self._arrays[key] = array
        self._bytes += _size(array)
        if self._bytes > self._most:
            for old in list(self._arrays)[: len(self._arrays) // 2]:
                self._bytes -= _size(self._arrays.pop(old))


def _size(array: Array | None) -> int:
    return 0 if array is None else array.nbytes
