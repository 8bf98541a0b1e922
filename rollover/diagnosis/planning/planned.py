"""A test that is planned, as a diagnosis would see its recording: stamps, noise, discrepancy, errors of instruments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.data.dataset import Dataset, Signal, condition_name, with_uncertain_conditions
from rollover.diagnosis.forward.averaging import simulated
from rollover.diagnosis.forward.forward_model import set_up
from rollover.diagnosis.settings import SETTINGS
from rollover.recording import Recording
from rollover.recording.record import StandardUncertainty
from rollover.scenario import Scenario

Array = NDArray[np.float64]
TUNING = SETTINGS.planning


@dataclass(frozen=True, kw_only=True)
class Instruments:
    """What records a test: channel -> 1 sigma of its noise (SI), sampling `rate` (Hz), errors beside the noise.

    `tolerance` is the share of a channel's range that models miss, `gain` 1 sigma of each channel's gain, `uncertain`
    1 sigma of values of the scenario that are not known exactly, by path.
    """

    noise: Mapping[str, float]
    rate: float = TUNING.rate
    tolerance: float = 0.0
    gain: float = TUNING.gain
    uncertain: Mapping[str, StandardUncertainty] = field(default_factory=dict)


def planned(scenario: Scenario, conditions: Mapping[str, Any], instruments: Instruments) -> Dataset | None:
    """A recording of the scenario as it is under `conditions`; None where nothing can be simulated of it.

    Raises `InputError` for a condition that the scenario does not know.
    """
    name = condition_name(conditions) or "as it is"
    stub = Recording(title=name, time=np.zeros(1), channels={}, conditions=conditions)
    own = set_up(scenario, stub)
    start = -getattr(own.initiation, "lead_time", 0.0)
    count = int((own.simulation.duration - start) * instruments.rate) + 1
    recording = replace(
        stub,
        time=start + np.arange(count) / instruments.rate,
        channels={channel: np.zeros(count) for channel in instruments.noise},
        noise=instruments.noise,
        uncertainty=instruments.uncertain,
    )
    thin, simulator, averaged = simulated(scenario, recording)
    made = simulator.predict({}, 0.0)
    if made is None:
        return None
    signals = tuple(
        _signal(channel, thin, made[channel], instruments.tolerance)
        for channel in instruments.noise
        if channel in made and np.all(np.isfinite(made[channel])) and np.ptp(made[channel]) > 0.0
    )
    if not signals:
        return None
    step = 1.0 / instruments.rate
    e = Dataset(
        name=name,
        recording=thin,
        simulator=simulator,
        signals=signals,
        shift_prior=SETTINGS.data.dataset.shift_prior + 0.5 * step,
        condition=name,
        averaged=averaged,
    )
    return _gained(with_uncertain_conditions(e, own), instruments.gain)


def _signal(channel: str, recording: Recording, values: Array, tolerance: float) -> Signal:
    """A channel with its noise, coloured by what models miss for some time in one direction."""
    noise, span = recording.noise[channel], float(np.ptp(values))
    miss, floor = tolerance * span, SETTINGS.data.dataset.model_error * span
    white = float(np.hypot(noise, floor))
    ar: tuple[float, ...] = ()
    if miss > 0.0:
        time = recording.time
        memory = TUNING.memory * float(time[-1] - time[0]) / float(np.median(np.diff(time)))  # in samples
        ar = autoregressive(white, miss, memory, min(TUNING.order, time.size // 4))
    return Signal(
        channel=channel,
        rows=np.arange(values.size),
        values=values,
        sigma=float(np.hypot(white, miss)),
        noise=noise,
        ar=ar,
        span=span,
    )


def autoregressive(white: float, miss: float, memory: float, order: int) -> tuple[float, ...]:
    """Autoregression of white noise beside an error that is remembered for `memory` samples, by Yule and Walker."""
    from scipy.linalg import solve_toeplitz

    covariance = miss**2 * np.exp(-np.arange(order + 1) / memory)
    covariance[0] += white**2
    return tuple(float(a) for a in solve_toeplitz(covariance[:-1], covariance[1:]))


def _gained(e: Dataset, gain: float) -> Dataset:
    """The same with an error of each channel's gain among what is uncertain."""
    if gain <= 0.0:
        return e
    columns = [] if e.nuisance is None else list(e.nuisance.T)
    for s, part in e.spans():
        column = np.zeros(e.count)
        column[part] = gain * s.values
        columns.append(column)
    # a sample moved to the measured one as far as its neighbours go is no multiple of a gain; beside a discrepancy that
    # noise remembers, samples after a jump are wide anyway
    is_white = not any(s.ar for s in e.signals)
    return replace(e, nuisance=np.stack(columns, axis=1), without_discontinuities=is_white)


def showing(e: Dataset, raw: Array) -> Dataset:
    """The recording with other values, stacked (n,), SI."""
    return replace(e, signals=tuple(replace(s, values=raw[part]) for s, part in e.spans()))


def only(e: Dataset, channels: Sequence[str]) -> Dataset:
    """The recording of some of its channels alone."""
    retained = [s.channel in channels for s in e.signals]
    rows = np.concatenate([np.full(s.rows.size, k) for s, k in zip(e.signals, retained, strict=True)])
    nuisance = None if e.nuisance is None else e.nuisance[rows]
    signals = tuple(s for s, k in zip(e.signals, retained, strict=True) if k)
    return replace(e, signals=signals, nuisance=nuisance)
