"""Who looks at each of several things: this process in turn, or whoever is handed in, as `Crew.looks`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol, TypeVar

from rollover.diagnosis.fit.levenberg_marquardt import Problem

T = TypeVar("T")
R = TypeVar("R")


class ParallelMap(Protocol):
    """What looks at each of several things."""

    def __call__(self, problem: Problem, look: Callable[[Problem, T], R], things: Sequence[T], /) -> list[R]:
        """What a look at each tells, in their order."""


def serial_map(problem: Problem, look: Callable[[Problem, T], R], things: Sequence[T]) -> list[R]:
    """What a look at each thing tells, one after another."""
    return [look(problem, thing) for thing in things]
