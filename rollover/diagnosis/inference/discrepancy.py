"""What a model misses beside what it lacks: scales of the discrepancy, by what explanations leave (D16) to (D19)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.data.stretches import channel_of, stretches
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted
from rollover.diagnosis.result import Scale
from rollover.diagnosis.settings import SETTINGS
from rollover.spec.channels import describe

Array = NDArray[np.float64]
TUNING = SETTINGS.inference.discrepancy
MEDIAN = float(np.sqrt(TUNING.usual_range[0] * TUNING.usual_range[1]))
# of ln s, by these quantiles of 5 and 95 %
SPREAD = float(np.log(TUNING.usual_range[1] / TUNING.usual_range[0]) / (2.0 * TUNING.normal_quantile))
# s that are tried: steps of 1.2 %, the widest that no digit of a report shows
SCALES = np.geomspace(TUNING.least_scale, TUNING.largest_scale, TUNING.scale_count)


@dataclass(frozen=True, kw_only=True)
class Discrepancy:
    """Scale (share of the range) and correlation time (s) of each channel; `by_none` is what the scenario leaves.

    By channel, of full runs by channel and side of the first impact: the keys are those of `Signal.key`.
    """

    scales: Mapping[str, float]
    times: Mapping[str, float] = field(default_factory=dict)
    by_none: Mapping[str, float] = field(default_factory=dict)
    taught_by: int = 0  # references whose common course was taken off, so that the rest is new in each recording
    is_estimated: bool = False  # by what explanations leave of the recordings themselves
    is_taught: bool = False  # by recordings in which nothing is missing

    @property
    def is_usual(self) -> bool:
        """Whether it is no larger than what models usually miss."""
        return max(self.scales.values(), default=0.0) <= TUNING.usual_most

    def at_most(self, bounds: Mapping[str, float]) -> Discrepancy:
        """The same with no scale above its channel's bound; a channel without one keeps its own."""
        return replace(self, scales={k: min(s, bounds.get(channel_of(k), s)) for k, s in self.scales.items()})

    def is_clearly_above(self, other: Discrepancy) -> bool:
        """Whether another estimate is clearly smaller in any channel."""
        return any(other.scales.get(c, s) < TUNING.refit_below * s for c, s in self.scales.items())

    def scales_by_channel(self, dataset: Sequence[Dataset]) -> dict[str, Scale]:
        """Scale of each channel in its unit, and its correlation time where it is known."""
        spans: dict[str, list[float]] = {}
        for e in dataset:
            for s in e.signals:
                spans.setdefault(s.channel, []).append(s.span)
        known = {key: c for key in self.scales if (c := channel_of(key)) in spans}
        return {
            key: Scale(
                scale=self.scales[key] * float(np.median(spans[c])),
                unit=describe(c).unit,
                correlation_time=self.times.get(key),
            )
            for key, c in known.items()
        }


def posterior(left: float, draws: float = TUNING.draws) -> tuple[float, float]:
    """Most probable s (share of a range) and log probability of a remainder of rms `left` in some draws, (D17)."""
    log_p = -draws * (np.log(SCALES) + 0.5 * (left / SCALES) ** 2) - 0.5 * (np.log(SCALES / MEDIAN) / SPREAD) ** 2
    best = int(np.argmax(log_p))
    return float(SCALES[best]), float(np.log(np.sum(np.exp(log_p - log_p[best]))) + log_p[best])


def residual_rms(problem: Problem, fitted: Fitted) -> dict[str, float]:
    """Root mean square that a fit leaves of each channel in each of its `stretches` beyond noise, over its range."""
    found: dict[str, list[float]] = {}
    for e, residual in zip(problem.dataset, problem.residuals(fitted), strict=True):
        residual = without_condition_errors(e, residual)
        for s, part in e.spans():
            for key, inside in stretches(e, s):
                power = float(np.mean(residual[part][inside] ** 2)) - s.noise**2
                found.setdefault(key, []).append(max(power, 0.0) / s.span**2)
    return {key: float(np.sqrt(np.mean(powers))) for key, powers in found.items()}


def without_condition_errors(e: Dataset, residual: Array) -> Array:
    """A misfit (n,), SI, without what uncertain conditions make of it at their most probable values."""
    if e.nuisance is None:
        return residual
    N = e.whitened(e.nuisance)
    pulls = np.linalg.solve(np.eye(N.shape[1]) + N.T @ N, N.T @ e.whitened(residual))
    return np.asarray(residual - e.nuisance @ pulls)


def estimated(problem: Problem, base: Fitted, tried: Sequence[Fitted]) -> Discrepancy:
    """The discrepancy by the remains of "nothing" and of all that was tried, each for what it is worth, (D18).

    Which explanation is right every recording tells anew; how far it misses is told by the rig, once for all of them.
    """
    models = [base, *tried]
    left = [residual_rms(problem, m) for m in models]
    scales_by_channel = [{c: posterior(v) for c, v in one.items()} for one in left]
    score = len(problem.dataset) * np.array([sum(v for _, v in one.values()) for one in scales_by_channel])
    weight = np.exp(score - score.max())
    weight /= weight.sum()
    scales = {}
    for channel in left[0]:
        power = sum(w * one[channel][0] ** 2 for w, one in zip(weight, scales_by_channel, strict=True))
        scales[channel] = float(np.sqrt(power))
    times = correlation_times(problem, models[int(np.argmax(weight))])
    return Discrepancy(scales=scales, times=times, by_none=left[0], is_estimated=True)


def learned_from_references(problem: Problem, base: Fitted) -> Discrepancy | None:
    """The discrepancy of recordings in which nothing is missing, a draw each; None if noise hides it everywhere."""
    left = residual_rms(problem, base)
    scales = {c: posterior(v, TUNING.draws * len(problem.dataset))[0] for c, v in left.items()}
    shows = any(
        scales[key] * s.span > SETTINGS.data.dataset.other_error_share * s.noise
        for e in problem.dataset
        for s in e.signals
        for key, _ in stretches(e, s)
    )
    times = correlation_times(problem, base)
    return Discrepancy(scales=scales, times=times, by_none=left, is_taught=True) if shows else None


def correlation_times(problem: Problem, fitted: Fitted) -> dict[str, float]:
    """Time (s) over which what a fit leaves of each channel is one error: by its lag of half the correlation, (D19)."""
    found: dict[str, list[float]] = {}
    for e, residual in zip(problem.dataset, problem.residuals(fitted), strict=True):
        residual = without_condition_errors(e, residual)
        for s, part in e.spans():
            step = float(np.median(np.diff(e.recording.time[s.rows])))
            for key, inside in stretches(e, s):
                v = residual[part][inside]
                power = float(np.mean(v**2)) - s.noise**2
                if v.size < 8 or power <= 0.0:
                    continue
                lags = range(1, v.size // 2)
                below = next((k for k in lags if float(np.mean(v[k:] * v[:-k])) < 0.5 * power), v.size // 2)
                found.setdefault(key, []).append(below * step / np.log(2.0))
    return {key: float(np.median(times)) for key, times in found.items()}


def with_discrepancy(every: Sequence[Dataset], found: Discrepancy) -> list[Dataset]:
    """The datasets with a discrepancy of these scales and correlation times by channel."""
    scales, times = dict(found.scales), dict(found.times)
    return [replace(e, discrepancy=scales, memory=times, taught_by=found.taught_by) for e in every]
