"""What a recorder makes of single samples: the steps of its digits, and spikes, which no model is asked about."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.settings import SETTINGS
from rollover.recording import Recording
from rollover.recording.checks.finding import trace
from rollover.recording.checks.samples import spikes

Array = NDArray[np.float64]
TUNING = SETTINGS.data.quantisation


def resolution(values: Array) -> float:
    """Step (SI) between the levels of a digitised channel (n,); 0 where it takes any value, or each but once."""
    finite = values[np.isfinite(values)]
    levels = np.unique(finite)
    if not TUNING.least_levels <= levels.size < TUNING.most_levels * finite.size:
        return 0.0
    apart = np.diff(levels)
    step = float(np.min(apart[apart > 1e-9 * (levels[-1] - levels[0])], initial=np.inf))
    many = apart / step
    return step if np.all(np.abs(many - np.round(many)) < TUNING.whole_step_tolerance) else 0.0


def pile(values: Array) -> float:
    """Size of the largest value (n,) if it is met again and again, to the last digit; 0 if not."""
    sizes = np.abs(values[np.isfinite(values)])
    most = float(np.max(sizes, initial=0.0))
    return (
        most
        if most > 0.0 and np.count_nonzero(sizes >= most * (1.0 - TUNING.equal_within)) >= TUNING.least_at_end
        else 0.0
    )


def with_quantisation(dataset: Sequence[Dataset], recordings: Sequence[Recording]) -> list[Dataset]:
    """The dataset with what rounding to the steps of its channels, as recorded, makes neighbouring samples share.

    Noise makes the error of each sample its own, and part of the noise: with s of it before a step d, Widrow's theorem
    leaves exp(-2 pi^2 s^2/d^2) of half a step in common. s is the least that any recording of a channel shows: beside
    the edge of a step a digit flips to and fro, and looks like noise of its size. Where values pile up at the end of a
    range is kept too: samples that are averaged no longer show it.
    """
    steps = [
        {s.channel: resolution(r.channels[s.channel]) for s in e.signals}
        for e, r in zip(dataset, recordings, strict=True)
    ]
    least: dict[str, float] = {}
    for e, step in zip(dataset, steps, strict=True):
        for s in e.signals:
            if step[s.channel] > 0.0:
                own = max(s.noise**2 * e.averaged - step[s.channel] ** 2 / 12.0, 0.0)
                least[s.channel] = min(own, least.get(s.channel, np.inf))
    found = []
    for e, r, step in zip(dataset, recordings, steps, strict=True):
        signals = []
        for s in e.signals:
            d = step[s.channel]
            share = np.exp(-2.0 * np.pi**2 * least[s.channel] / d**2) if d > 0.0 else 0.0
            error, end = (0.5 * d * share if share > TUNING.least_common_error else 0.0), pile(r.channels[s.channel])
            signals.append(replace(s, step=2.0 * error, scatter=error, sigma=float(np.hypot(s.sigma, error)), end=end))
        found.append(replace(e, signals=tuple(signals)))
    return found


def without_spikes(recording: Recording, before: float = np.inf) -> tuple[Recording, list[str]]:
    """The recording without single samples that its neighbours contradict, and a line for each channel that had any.

    Only those `before` a time (s): after an impact one contact follows another, and some last no longer than a sample.
    """
    channels, lines = dict(recording.channels), []
    for name in recording.channels:
        channel_trace = trace(recording, name)
        found = [] if channel_trace is None else [f for f in spikes(channel_trace, "") if f.start < before]
        if found:
            gone = np.isin(recording.time, [f.start for f in found])
            channels[name] = np.where(gone, np.nan, recording.channels[name])
            count = int(gone.sum())
            lines.append(f"{name}: {'one spike was' if count == 1 else f'{count} spikes were'} excluded")
    return (replace(recording, channels=channels), lines) if lines else (recording, [])
