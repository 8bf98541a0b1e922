"""What references have in common, so that other recordings of their rig have it as well: (D26), (D27)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.data.stretches import onset, stretches
from rollover.diagnosis.fit.levenberg_marquardt import Fitted, Problem
from rollover.diagnosis.settings import SETTINGS

Array = NDArray[np.float64]
TUNING = SETTINGS.inference.discrepancy


@dataclass(frozen=True, kw_only=True)
class Course:
    """A channel of a reference: times since the onset (n,), s, what the scenario misses and what it predicts, SI."""

    since: Array
    left: Array
    predicted: Array

    def at(self, since: Array, values: Array) -> Array:
        """Values of it at other times (m,), NaN where it has none."""
        return np.interp(since, self.since, values, left=np.nan, right=np.nan)

    def likeness(self, since: Array, predicted: Array) -> float:
        """Cosine of its predicted course and another's, (n,) at times since the onset: -1 where it is turned round."""
        own = self.at(since, self.predicted)
        known = np.isfinite(own)
        size = float(np.linalg.norm(own[known]) * np.linalg.norm(predicted[known]))
        return float(own[known] @ predicted[known]) / size if size > 0.0 else 0.0


@dataclass(frozen=True, kw_only=True)
class Taught:
    """Courses of the references by channel, and how much of their mean another repeats, by the key of a stretch."""

    courses: Mapping[str, Sequence[Course]]
    repeated: Mapping[str, float]

    @property
    def count(self) -> int:
        """References."""
        return max(map(len, self.courses.values()))

    def without(self, e: Dataset) -> Dataset:
        """A recording without what it repeats of the references."""
        predicted = e.simulator.predict({}, 0.0)
        if predicted is None or not np.isfinite(start := onset(e)):
            return e
        signals = []
        for s in e.signals:
            since, values = e.recording.time[s.rows] - start, s.values.copy()
            mean = mean_course(self.courses.get(s.channel, ()), since, predicted[s.channel][s.rows])
            for key, inside in stretches(e, s):
                values[inside] -= self.repeated.get(key, 0.0) * mean[inside]
            signals.append(replace(s, values=values))
        return replace(e, signals=tuple(signals))


def mean_course(courses: Sequence[Course], since: Array, predicted: Array) -> Array:
    """What is missed at times since the onset by others' courses, those of a like prediction counting most, (D26)."""
    above, below = np.zeros(since.size), np.zeros(since.size)
    for one in courses:
        alike, left = one.likeness(since, predicted), one.at(since, one.left)
        known = np.isfinite(left)
        above[known] += alike * left[known]
        below[known] += alike**2
    return np.divide(above, below, out=np.zeros(since.size), where=below > 0.0)


def taught_by(problem: Problem, base: Fitted) -> tuple[Taught, Problem] | None:
    """What references teach, and these without what each repeats of the others; None where they repeat nothing."""
    if len(problem.dataset) < TUNING.least_references:
        return None
    courses: list[dict[str, Course]] = []
    for e, block, left in zip(problem.dataset, base.blocks, problem.residuals(base), strict=True):
        own = {}
        if np.isfinite(start := onset(e)):
            for s, part in e.spans():
                since = e.recording.time[s.rows] - start - block.shift
                own[s.channel] = Course(since=since, left=left[part], predicted=s.values - left[part])
        courses.append(own)
    by_others: list[dict[str, Array]] = []
    for r, own in enumerate(courses):
        others = [o for k, o in enumerate(courses) if k != r]
        by_others.append(
            {c: mean_course([o[c] for o in others if c in o], v.since, v.predicted) for c, v in own.items()}
        )
    both: dict[str, list[tuple[float, float]]] = {}
    for e, own, means in zip(problem.dataset, courses, by_others, strict=True):
        for s in e.signals:
            for key, inside in stretches(e, s) if s.channel in own else ():
                left, mean = own[s.channel].left[inside], means[s.channel][inside]
                both.setdefault(key, []).append((float(left @ mean) / s.span**2, float(mean @ mean) / s.span**2))
    repeated = {}
    for key, each in both.items():
        along, power = (sum(v) for v in zip(*each, strict=True))
        repeated[key] = min(max(along / power, 0.0), 1.0) if power > 0.0 else 0.0
    if not any(repeated.values()):
        return None
    rest = []
    for e, means in zip(problem.dataset, by_others, strict=True):
        signals = []
        for s in e.signals:
            values = s.values.copy()
            for key, inside in stretches(e, s) if s.channel in means else ():
                values[inside] -= repeated[key] * means[s.channel][inside]
            signals.append(replace(s, values=values))
        rest.append(replace(e, signals=tuple(signals)))
    names = dict.fromkeys(c for own in courses for c in own)
    every = {c: [own[c] for own in courses if c in own] for c in names}
    left_over = Problem(rest)
    left_over.shifts = list(problem.shifts)
    return Taught(courses=every, repeated=repeated), left_over
