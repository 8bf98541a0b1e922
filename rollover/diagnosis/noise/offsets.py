"""Zeros of channels that were set anew for each recording: what they read before the first contact tells them.

Until then nothing is missing yet, and what is predicted of some channels does not change: no force, free fall. With d
what recording r misses there on the average, and e the standard error of that,

    sum ((d - mean d)/e)^2                    beyond chi-square: not one zero for all                          (Z1)

each is brought back to none unless it wanders there, and is known to e from there on. What all have in common, and
zeros that differ so much have not by chance, is left to be found as an offset of the sensor.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.data.dataset import Dataset, Signal
from rollover.diagnosis.noise.autoregression import low_frequency_level
from rollover.diagnosis.noise.drift import leading_cosines
from rollover.diagnosis.settings import SETTINGS
from rollover.effects import spoken
from rollover.spec.channels import describe

Array = NDArray[np.float64]
TUNING = SETTINGS.noise.offsets


@dataclass(frozen=True, kw_only=True)
class Zero:
    """Recording `r` reads `off` (SI) in the k-th signal before anything is hit, with a standard error."""

    r: int
    k: int
    off: float
    error: float
    slow: float = 0.0  # sum of squares of its first cosines beyond the mean, over what noise lets expect of each


def with_offsets_removed(
    dataset: Sequence[Dataset], residuals: Sequence[Array], shifts: Sequence[float]
) -> list[Dataset]:
    """The dataset without channel offsets that differ; `residuals` (stacked, SI) at time `shifts` (s)."""
    by: dict[str, list[Zero]] = {}
    for r, (e, residual, shift) in enumerate(zip(dataset, residuals, shifts, strict=True)):
        for k, (s, part) in enumerate(e.spans()):
            before = _before(e, s, shift)
            if (
                before is not None
                and float(np.ptp((s.values - residual[part])[before])) < TUNING.flat_prediction * s.sigma
            ):
                error = low_frequency_level(s.noise, s.ar) / np.sqrt(before.stop)
                early = residual[part][before]
                slow = (
                    float(np.sum(leading_cosines(s, early, 1 + TUNING.wave_terms)[1:] ** 2)) if error > 0.0 else np.inf
                )
                zero = Zero(r=r, k=k, off=float(early.mean()), error=float(error), slow=slow)
                by.setdefault(s.channel, []).append(zero)
    able = [
        offsets
        for offsets in by.values()
        if len(offsets) >= TUNING.least_recordings and all(z.error > 0.0 for z in offsets)
    ]
    found = [list(e.signals) for e in dataset]
    if _differ(able) and _are_stationary(able):
        for z, off in ((z, off) for offsets in able for z, off in zip(offsets, _own(offsets), strict=True)):
            s = found[z.r][z.k]
            found[z.r][z.k] = replace(s, values=s.values - off, zero=off, zero_error=z.error)
    return [replace(e, signals=tuple(s)) for e, s in zip(dataset, found, strict=True)]


def zero_notes(dataset: Sequence[Dataset]) -> list[str]:
    """A line for each channel whose zeros were set and do differ."""
    by: dict[str, list[Signal]] = {}
    for s in (s for e in dataset for s in e.signals if s.zero_error > 0.0):
        by.setdefault(s.channel, []).append(s)
    spread = {channel: float(np.std([s.zero for s in each])) for channel, each in by.items()}
    return [
        f"{channel}: its zero differs from recording to recording, by {spoken(spread[channel])} "
        f"{describe(channel).unit} (1 sigma); each was set by what it reads before the first contact"
        for channel, each in by.items()
        if spread[channel] > TUNING.reported_ratio * float(np.mean([s.zero_error for s in each]))
    ]


def _are_stationary(every: Sequence[Sequence[Zero]]) -> bool:
    """Whether zeros stand still: what wanders before the first contact, as noise of 1/f, has none."""
    from scipy.special import chdtrc

    slow = [z.slow for offsets in every for z in offsets]
    return float(chdtrc(TUNING.wave_terms * len(slow), sum(slow))) > TUNING.slow_p_value


def _differ(every: Sequence[Sequence[Zero]]) -> bool:
    """Whether (Z1) of all channels together is beyond chance: who sets one zero anew sets all."""
    from scipy.special import chdtrc

    squares = sum(float(np.sum((apart / error) ** 2)) for apart, error in map(_deviation_from_mean, every))
    return bool(every) and float(chdtrc(sum(len(offsets) - 1 for offsets in every), squares)) < TUNING.differ_p_value


def _own(offsets: Sequence[Zero]) -> list[float]:
    """What is taken off each: all of it, but for what they share beyond what such zeros share by chance."""
    from scipy.stats import t

    off, n = np.array([z.off for z in offsets]), len(offsets)
    chance = 2.0 * float(t.sf(abs(off.mean()) * np.sqrt(n) / max(float(off.std(ddof=1)), 1e-300), n - 1))
    return [float(v) for v in (_deviation_from_mean(offsets)[0] if chance < TUNING.shared_p_value else off)]


def _deviation_from_mean(offsets: Sequence[Zero]) -> tuple[Array, Array]:
    """How far each lies off the mean of all, and its standard error, SI."""
    off, error = np.array([z.off for z in offsets]), np.array([z.error for z in offsets])
    return off - np.average(off, weights=error**-2.0), error


def _before(e: Dataset, s: Signal, shift: float) -> slice | None:
    """Samples of a signal that lie well before the first contact; None of too few."""
    time, contact = e.recording.time[s.rows], e.simulator.contact + shift
    if not np.isfinite(contact) or e.simulator.effort.is_ensemble:
        return None
    n = int(np.searchsorted(time, time[0] + TUNING.early_share * (contact - time[0])))
    return slice(n) if n >= TUNING.least_samples else None
