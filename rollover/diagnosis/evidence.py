"""What one recording is worth: its channels over their noise, whitened, and the phases of the test it went through."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.nuisance import NOTHING, Eased, doubts, eased
from rollover.diagnosis.simulator import Simulator
from rollover.filters import least_rate
from rollover.noise import LENGTH, NoiseFloor, noise_floor
from rollover.recording import Recording
from rollover.scenario import Scenario

Array = NDArray[np.float64]

MODEL_ERROR = 5e-4  # of a channel's range: what integrators differ by is no mismatch
ALONE = 0.02  # s, prior of the time shift of a recording whose clock has no zero
MOST_ROWS = 700  # of a recording that are looked at
CLEARLY = 0.75  # of the misfit's noise: below, the channel's own noise is believed
LONGEST = 0.98  # of the memory from one sample to the next
MANY = 10  # quiet windows from which on a memory of two samples is told
CORNER = 2.0775  # corner frequency over the filter class, forward and backward, Hz
SHIFT = 1e-3  # s, prior of the time shift of a recording whose zero is known


@dataclass(frozen=True, kw_only=True)
class Signal:
    """One channel of a recording: where it has values, its noise (SI), colour, and range."""

    channel: str
    rows: NDArray[np.int64]
    values: Array
    sigma: float
    noise: float
    ar: tuple[float, ...]
    span: float


@dataclass(frozen=True, kw_only=True)
class Evidence:
    """One recording made ready: signals, their simulator, and the prior of its time shift (s)."""

    name: str
    recording: Recording
    simulator: Simulator
    signals: tuple[Signal, ...]
    shift_prior: float
    condition: str
    eased: Eased = NOTHING

    @property
    def count(self) -> int:
        """Number of samples of all signals."""
        return sum(s.rows.size for s in self.signals)

    def stacked(self, predicted: Mapping[str, Array]) -> Array:
        """Predicted channels at the samples, in units of the noise and whitened, one signal after another."""
        return np.concatenate([self._whitened(s, predicted[s.channel][s.rows]) for s in self.signals])

    def measured(self) -> Array:
        """The same of the measurement."""
        return np.concatenate([self._whitened(s, s.values) for s in self.signals])

    def spans(self) -> list[tuple[Signal, slice]]:
        """Each signal with its place in the stack."""
        found, at = [], 0
        for s in self.signals:
            found.append((s, slice(at, at + s.rows.size)))
            at += s.rows.size
        return found

    @staticmethod
    def _whitened(signal: Signal, values: Array) -> Array:
        x = values / signal.sigma
        if not signal.ar:
            return x
        y = x.copy()
        for k, a in enumerate(signal.ar, start=1):
            y[k:] -= a * x[:-k]
        y[: len(signal.ar)] = 0.0  # no past to whiten with
        return y * _gain(signal.ar)


def doubted(e: Evidence, scenario: Scenario) -> Evidence:
    """The evidence with what its conditions leave uncertain profiled out; `scenario` is under them."""
    base = e.simulator.predict({}, 0.0)
    columns = []
    for changes in doubts(scenario, e.recording.uncertainty, e.name):
        moved = e.simulator.predict(changes, 0.0)
        if base is not None and moved is not None:
            columns.append(e.stacked(moved) - e.stacked(base))
    return replace(e, eased=eased(np.stack(columns, axis=1))) if columns else e


def _gain(ar: tuple[float, ...]) -> float:
    """1/sd of the innovations of an autoregression of variance 1."""
    from scipy.signal import lfilter

    impulse = np.zeros(4000)
    impulse[0] = 1.0
    return float(np.sqrt(np.sum(lfilter([1.0], [1.0, *(-a for a in ar)], impulse) ** 2)))


def binned(recording: Recording) -> Recording:
    """The recording at no more than `MOST_ROWS` rows: means of neighbouring samples, none across a gap.

    What is averaged keeps its information while noise falls with the root of the number; a rate that a filter class
    needs is kept.
    """
    n = recording.time.size
    step = float(np.median(np.diff(recording.time))) if n > 1 else 1.0
    most = int(n // MOST_ROWS)
    for cfc in recording.cfc.values():
        most = min(most, int(1.0 / (step * 1.05 * least_rate(cfc))))
    if most < 2:
        return recording
    parts = np.arange(0, n - most + 1, most)
    time = np.add.reduceat(recording.time[: parts[-1] + most], parts) / most
    spread = recording.time[parts + most - 1] - recording.time[parts]
    whole = spread < 1.5 * (most - 1) * step
    channels = {}
    for channel, values in recording.channels.items():
        mean = np.add.reduceat(values[: parts[-1] + most], parts) / most  # NaN where any is
        channels[channel] = mean[whole]
    noise = {channel: sigma / np.sqrt(most) for channel, sigma in recording.noise.items()}
    return replace(recording, time=time[whole], channels=channels, noise=noise)


def evidence_of(name: str, recording: Recording, simulator: Simulator) -> Evidence | None:
    """Make a recording ready; None if it shares no channel with the simulation.

    Noise is estimated from each channel itself; where it is too short for that, the noise that the recording states.
    """
    predicted = simulator.predict({}, 0.0)
    if predicted is None:
        return None
    signals = []
    leaps = _near_leaps(recording, predicted)
    for channel, values in recording.channels.items():
        rows = np.flatnonzero(np.isfinite(values) & ~leaps)[:: _oversampling(recording, channel)]
        if channel not in predicted or rows.size < 8 or not np.all(np.isfinite(predicted[channel][rows])):
            continue
        y = values[rows]
        span = float(max(np.ptp(predicted[channel][rows]), np.ptp(y)))
        if span <= 0.0:
            continue
        noise, ar = _noise(y - predicted[channel][rows], y, recording.noise.get(channel))
        sigma = float(np.hypot(noise, MODEL_ERROR * span))
        if noise < sigma * 0.7:
            ar = ()  # the model's error is not coloured as the noise is
        signals.append(Signal(channel=channel, rows=rows, values=y, sigma=sigma, noise=noise, ar=ar, span=span))
    if not signals:
        return None
    loose = recording.clock.zero == "unknown"
    step = float(np.median(np.diff(recording.time))) if recording.time.size > 1 else 0.0
    prior = ALONE if loose else SHIFT + 0.5 * step
    return Evidence(
        name=name,
        recording=recording,
        simulator=simulator,
        signals=tuple(signals),
        shift_prior=recording.clock.within or prior,
        condition=condition_of(recording.conditions),
    )


def _oversampling(recording: Recording, channel: str) -> int:
    """Of how many samples behind a channel filter one is new: those of twice its corner frequency tell all."""
    if channel not in recording.cfc or recording.time.size < 2:
        return 1
    rate = 1.0 / float(np.median(np.diff(recording.time)))
    return max(1, int(rate / (2.0 * CORNER * recording.cfc[channel])))


def _near_leaps(recording: Recording, predicted: Mapping[str, Array]) -> NDArray[np.bool_]:
    """Samples so near the first contact that the clock decides on which side of the leap of force they lie, (n,)."""
    near = np.zeros(recording.time.size, dtype=bool)
    sinkage = predicted.get("ground/sinkage")
    if sinkage is None or not (sinkage > 0.0).any() or recording.time.size < 3:
        return near
    first = int(np.argmax(sinkage > 0.0))
    near[max(first - 1, 0) : first + 1] = True
    return near


def _noise(residual: Array, values: Array, stated: float | None) -> tuple[float, tuple[float, ...]]:
    """Noise (1 sigma) and its colour, from the misfit; from the channel itself where that shows clearly less."""
    if values.size < LENGTH:
        return (stated if stated is not None else _by_differences(residual)), ()
    best, other = (_floor(v) for v in (residual, values))
    if other.sigma < CLEARLY * best.sigma:
        best = other
    return best.sigma, best.ar


def _floor(values: Array) -> NoiseFloor:
    """Noise floor with as short a memory as the samples can tell: longer ones are made of chance."""
    one = noise_floor(values, order=1)
    return noise_floor(values, order=2) if one.windows >= MANY else one


def _by_differences(values: Array) -> float:
    """Noise of a short series from its second differences: sd = 1.4826 median|d2|/sqrt(6)."""
    if values.size < 5:
        return 0.0
    d = np.diff(values, 2)
    return float(1.4826 * np.median(np.abs(d - np.median(d))) / np.sqrt(6.0))


def recoloured(e: Evidence, predicted: Mapping[str, Array]) -> Evidence:
    """The evidence with the noise's memory from all of a misfit that is nearly noise, where it is longer than thought.

    Quiet stretches are too short to show slow noise. What of the misfit is none adds to the memory: it is then judged
    too mildly, never too sharply.
    """
    signals = []
    for s in e.signals:
        left = s.values - predicted[s.channel][s.rows]
        left = left - left.mean()
        power = float(left @ left)
        memory = float(left[1:] @ left[:-1]) / power if power > 0.0 else 0.0
        known = s.ar[0] / (1.0 - s.ar[1]) if len(s.ar) > 1 else sum(s.ar)
        if memory > known + 1.0 / np.sqrt(left.size) and memory < LONGEST:
            noise = max(s.noise, float(np.std(left)))
            s = replace(s, ar=(memory,), noise=noise, sigma=max(s.sigma, noise))
        signals.append(s)
    return replace(e, signals=tuple(signals))


def condition_of(conditions: Mapping[str, Any]) -> str:
    """Name of the condition that a recording was run under: recordings alike share it."""
    return ", ".join(
        f"{path}={value:g}" if isinstance(value, float) else f"{path}={value}"
        for path, value in sorted(conditions.items())
    )


def left_out(evidence: Sequence[Evidence]) -> list[list[int]]:
    """What is left out in turn: one condition after another, or one recording after another if all share one."""
    groups = groups_of(evidence)
    return groups if len(groups) > 1 else [[k] for k in range(len(evidence))]


def groups_of(evidence: Sequence[Evidence]) -> list[list[int]]:
    """Places of the recordings that share a condition, one list for each condition."""
    found: dict[str, list[int]] = {}
    for k, e in enumerate(evidence):
        found.setdefault(e.condition or e.name, []).append(k)
    return list(found.values())
