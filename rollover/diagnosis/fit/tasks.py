"""Fits as tasks, and maps over things: what is worked off in this process, or by an `Executor` with children."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.fit.finite_differences import beside
from rollover.diagnosis.fit.parameterisation import Candidate

Progress = Callable[[str], None]
How = Literal["fit", "polish", "secondary", "time", "trace"]
Stretch = tuple[int, float, float]  # a coordinate of a fit, and from where to where it is tried

P = TypeVar("P")
Q = TypeVar("Q")
T = TypeVar("T")
R = TypeVar("R")


class ParallelMap(Protocol[P]):
    """A map over items by a function that is given the problem too."""

    def __call__(self, problem: P, function: Callable[[P, T], R], items: Sequence[T], /) -> list[R]:
        """`function(problem, item)` of each, in their order."""


def serial_map(problem: Q, function: Callable[[Q, T], R], items: Sequence[T]) -> list[R]:
    """`function(problem, item)` of each, one after another."""
    return [function(problem, item) for item in items]


@dataclass(frozen=True, kw_only=True)
class Task:
    """A fit to be made: `only` some recordings, from time `shifts` (s) of these; see `Problem.fit`.

    One of few `rounds` ends without slopes.
    "polish" follows a curved ridge from a start, "secondary" fits the secondary parameters of the last effect too or
    takes a `variant` of it, "time" scans the time shifts, "trace" begins anew where it sets in, over a `stretch`. What
    comes nowhere near what the best fit `leaves` of each recording is not gone on with. `reused` as in `Problem.fit`.
    """

    how: How = "fit"
    candidates: tuple[Candidate, ...]
    start: tuple[float, ...]
    shifts: tuple[float, ...]
    only: tuple[int, ...] | None = None
    rounds: int | None = None  # as many as a whole fit may take
    width: int = 0
    fixed_shifts: bool = False
    variant: Candidate | None = None
    stretch: Stretch | None = None
    leaves: tuple[float, ...] | None = None
    reused: tuple[NDArray[np.float64], ...] | None = None

    def key(self, about: str) -> str:
        """Hash of what is fitted and from where, with `about` for all else that it depends on."""
        every = (*self.candidates, *(() if self.variant is None else (self.variant,)))
        names = [(c.key, sorted(c.search.items()), sorted(c.variant.items())) for c in every]
        ways = self.how, self.only, self.rounds, self.width, self.fixed_shifts, self.stretch, self.leaves
        shared = hashlib.sha256(repr((about, names, self.start, self.shifts, ways)).encode())
        for J in self.reused or ():
            shared.update(J.tobytes())
        return shared.hexdigest()

    @property
    def recordings(self) -> tuple[int, ...]:
        """Places of the recordings."""
        return tuple(range(len(self.shifts))) if self.only is None else self.only

    def beginning(self, fd_steps: Sequence[float]) -> Iterator[tuple[int, Sequence[Candidate], Sequence[float]]]:
        """(recording, candidates, x) of the runs that a fit begins with."""
        first = self.reused[0].shape[1] if self.reused else 0
        return beside(self.recordings, self.candidates, self.start, fd_steps[min(self.width, len(fd_steps) - 1)], first)
