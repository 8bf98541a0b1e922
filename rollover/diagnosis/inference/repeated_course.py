"""Whether what a fit leaves takes the same course in each drop: then something does it that no background is."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.data.phases import PEAK, phases_of
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted
from rollover.diagnosis.inference.discrepancy import correlation_times
from rollover.diagnosis.settings import SETTINGS

Array = NDArray[np.float64]
TUNING = SETTINGS.inference.discrepancy


class Course(NamedTuple):
    """What is left of a channel after first contact: times since that (n,), s, it and its noise in shares of range."""

    since: Array
    left: Array
    noise: float

    def at(self, since: Array) -> Array:
        """The sample next to each time (m,), NaN beyond the last; not between two, which would lessen the noise."""
        after = np.clip(np.searchsorted(self.since, since), 0, self.since.size - 1)
        before = np.maximum(after - 1, 0)
        nearest = np.where(since - self.since[before] < self.since[after] - since, before, after)
        return np.where(since <= self.since[-1], self.left[nearest], np.nan)


def quick_channels(problem: Problem, fitted: Fitted) -> set[str]:
    """Channels in which what is left changes sooner than a discrepancy does, which lasts about a phase."""
    deepest = [at for e in problem.dataset for at, name in phases_of(e) if name == PEAK]
    if not deepest:
        return set()
    least = TUNING.shortest * float(np.median(deepest))
    return {channel for channel, lasts in correlation_times(problem, fitted).items() if lasts < least}


def predicted_by_others(
    problem: Problem, fitted: Fitted, groups: Sequence[Sequence[int]], channels: Collection[str]
) -> tuple[Array, Array]:
    """Squares that the mean course of other conditions takes of what is left of each recording, and those left, (n,).

    Of some channels, in squares of `Signal.sigma`, without what noise leaves of either.
    """
    courses = _courses(problem, fitted)
    gained, due = np.zeros(len(courses)), np.zeros(len(courses))
    for group in groups:
        rest = [courses[k] for k in range(len(courses)) if k not in group]
        for r in group:
            for s in problem.dataset[r].signals:
                if s.channel not in channels:
                    continue
                own = courses[r].get(s.channel)
                others = [o[s.channel] for o in rest if s.channel in o]
                if own is None or not others:
                    continue
                there = np.array([o.at(own.since) for o in others])
                known = np.isfinite(there)
                count = np.maximum(known.sum(axis=0), 1)
                mean = np.nansum(there, axis=0) / count
                chance = np.sum(known * np.array([[o.noise**2] for o in others]), axis=0) / count**2
                unit = (s.span / s.sigma) ** 2
                gained[r] += unit * float(np.sum(own.left**2 - (own.left - mean) ** 2 + chance))
                due[r] += unit * float(np.sum(own.left**2 - own.noise**2))
    return gained, due


def _courses(problem: Problem, fitted: Fitted) -> list[Mapping[str, Course]]:
    """Courses by channel of each recording."""
    found: list[Mapping[str, Course]] = []
    for e, block, residual in zip(problem.dataset, fitted.blocks, problem.residuals(fitted), strict=True):
        own = {}
        for s, part in e.spans():
            since = e.recording.time[s.rows] - e.simulator.contact - block.shift
            after = since >= 0.0
            if after.any():
                own[s.channel] = Course(since[after], residual[part][after] / s.span, s.noise / s.span)
        found.append(own)
    return found
