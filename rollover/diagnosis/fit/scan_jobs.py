"""Who looks at each of several things: this process in turn, or whoever is handed in, as `Crew.looks`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol, TypeVar

from rollover.diagnosis.fit.levenberg_marquardt import Judge

T = TypeVar("T")
R = TypeVar("R")


class Looks(Protocol):
    """What looks at each of several things."""

    def __call__(self, judge: Judge, look: Callable[[Judge, T], R], things: Sequence[T], /) -> list[R]:
        """What a look at each tells, in their order."""


def at_each(judge: Judge, look: Callable[[Judge, T], R], things: Sequence[T]) -> list[R]:
    """What a look at each thing tells, one after another."""
    return [look(judge, thing) for thing in things]
