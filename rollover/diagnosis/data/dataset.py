"""What one recording is worth: its channels over their noise, whitened, and the phases of the test it went through."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.data.condition_uncertainty import Marginalised, marginalised, nuisance_parameters
from rollover.diagnosis.data.whitening import Noise, Whitening
from rollover.diagnosis.forward.discontinuities import (
    DISCONTINUITY_IN,
    SHOWS,
    masked,
    near_discontinuity,
    weights_after_discontinuities,
)
from rollover.diagnosis.forward.interface import Simulator
from rollover.diagnosis.settings import SETTINGS
from rollover.recording import Recording
from rollover.recording.noise_floor import LENGTH, USUAL, NoiseFloor, grown, noise_floor
from rollover.scenario import Scenario

Array = NDArray[np.float64]

TUNING = SETTINGS.data.dataset
EMPTY: Mapping[str, Array] = MappingProxyType({})


@dataclass(frozen=True, kw_only=True)
class Signal:
    """One channel of a recording: where it has values, its noise (SI), autocorrelation, and range."""

    channel: str
    rows: NDArray[np.int64]
    values: Array
    sigma: float
    noise: float
    ar: tuple[float, ...]
    span: float
    scatter: float = 0.0  # between runs of one condition, SI
    step: float = 0.0  # of its digits, where noise does not hide it, SI
    end: float = 0.0  # of its range, where values pile up, SI; 0: none is seen
    zero: float = 0.0  # that was taken off its values, SI
    zero_error: float = 0.0  # standard error of that; 0: none was
    weight: Array | None = None  # (n,), below 1 where the model itself is not sure
    level: Array | None = None  # (n,), noise over `noise` where it grows with the value
    at_rest: tuple[float, tuple[float, ...]] | None = None  # noise and autocorrelation of quiet stretches
    phase: str = ""  # the part of its channel that it is, see `data.stretches`

    @property
    def key(self) -> str:
        """What its discrepancy is known by."""
        return f"{self.channel} {self.phase}".rstrip()

    def cut(self, inside: NDArray[np.bool_]) -> Signal:
        """The samples that are `inside` (n,)."""
        weight, level = (None if v is None else v[inside] for v in (self.weight, self.level))
        return replace(self, rows=self.rows[inside], values=self.values[inside], weight=weight, level=level)

    @property
    def quiet(self) -> tuple[float, tuple[float, ...]]:
        """Noise and autocorrelation of its quiet stretches; those that are held before these are estimated."""
        return self.at_rest or (self.noise, self.ar)

    @property
    def heteroscedasticity(self) -> Array | float:
        """Noise over `noise`, (n,); 1 where it is the same throughout."""
        return 1.0 if self.level is None else self.level

    @property
    def spread(self) -> Noise:
        """What its samples are whitened by; the noise alone grows with the value, not what a model may be off by."""
        rest = max(self.sigma**2 - self.noise**2, 0.0)
        sd = None if self.level is None else np.sqrt((self.noise * self.level) ** 2 + rest)
        return Noise(count=self.rows.size, sigma=self.sigma, ar=self.ar, sd=sd, weight=self.weight)


@dataclass(frozen=True, kw_only=True)
class _Inside:
    """Samples (n,) of a stack: the first and the last of the signal of each, and the least jump from each."""

    first: NDArray[np.int64]
    last: NDArray[np.int64]
    least: Array


@dataclass(frozen=True, kw_only=True)
class Dataset:
    """One recording made ready: signals, their simulator, and the prior of its time shift (s)."""

    name: str
    recording: Recording
    simulator: Simulator
    signals: tuple[Signal, ...]
    shift_prior: float
    condition: str
    perturbed: tuple[Array, ...] = ()  # stacked, SI: what runs that nobody could tell apart differ by
    model_error: float = TUNING.model_error  # of a channel's range
    discrepancy: Mapping[str, float] = field(default_factory=dict)  # by `Signal.key` or channel, a share of its range
    memory: Mapping[str, float] = field(default_factory=dict)  # by the same, correlation time of that where known, s
    taught_by: int = 0  # references whose common course was taken off its values
    averaged: int = 1  # samples in one
    first_impact: float = np.inf  # s, after which a run may take another course
    doubtful: tuple[Mapping[str, Any], ...] = ()  # values exchanged for 1 sigma of each uncertain condition
    nuisance: Array | None = None  # what that does to the stack, SI, (n, q)
    without_discontinuities: bool = False  # samples about a jump count nothing, instead of being moved

    def cut(self, inside: Sequence[NDArray[np.bool_]]) -> Dataset:
        """The samples of each signal that are `inside` (n,) of it."""
        rows = np.concatenate(list(inside))
        return replace(
            self,
            signals=tuple(s.cut(those) for s, those in zip(self.signals, inside, strict=True)),
            perturbed=tuple(d[rows] for d in self.perturbed),
            nuisance=None if self.nuisance is None else self.nuisance[rows],
        )

    @cached_property
    def marginalised(self) -> Marginalised:
        """What takes the uncertain conditions, and zeros, out of a whitened misfit."""
        return marginalised(self.uncertain)

    def marginalised_beside(self, discontinuities: NDArray[np.int64]) -> Marginalised:
        """The same beside `discontinuities`: samples that count nothing tell nothing of what is uncertain either."""
        asked = self.without_discontinuities and discontinuities.size
        return marginalised(self.worth(discontinuities)[:, None] * self.uncertain) if asked else self.marginalised

    @cached_property
    def uncertain(self) -> Array:
        """What one standard deviation of each uncertain condition, then of each zero, does whitened, (n, q)."""
        columns = [self.whitened(column) for column in self.uncertain_columns]
        return np.stack(columns, axis=1) if columns else np.zeros((self.count, 0))

    @property
    def uncertain_columns(self) -> list[Array]:
        """The same in SI, (n,) each."""
        zeros, rows = [(s.zero_error, part) for s, part in self.spans() if s.zero_error > 0.0], np.arange(self.count)
        offsets = [np.where((rows >= part.start) & (rows < part.stop), error, 0.0) for error, part in zeros]
        return [*([] if self.nuisance is None else self.nuisance.T), *offsets]

    @cached_property
    def expected(self) -> float | None:
        """Sum of squares that noise and scatter alone leave of the weighed samples; None where none is weighed."""
        return None if all(s.weight is None for s in self.signals) else self.by_chance(np.s_[:])

    def by_chance(self, rows: slice | NDArray[np.bool_]) -> float:
        """Sum of squares that noise and scatter alone leave of some samples."""
        scatter = [float(np.sum(self.whitened(perturbed_run)[rows] ** 2)) for perturbed_run in self.perturbed]
        return float(np.sum(self.due[rows])) + (float(np.mean(scatter)) if scatter else 0.0)

    @cached_property
    def due(self) -> Array:
        """Squares (n,) that noise alone leaves of the weighed samples: 1 where they count in full."""
        return np.concatenate([np.ones(s.rows.size) if s.weight is None else s.weight**2 for s in self.signals])

    @cached_property
    def early(self) -> NDArray[np.bool_]:
        """Samples (n,) before the impact: what is left there is no matter of the course that a run took."""
        return np.concatenate([self.recording.time[s.rows] < self.first_impact for s in self.signals])

    def model_error_dominates(self, s: Signal) -> bool:
        """Whether a scatter between runs, or a tolerance that was asked for, has a large part in the error.

        Such an error is one for the whole signal, not one for each sample: within its size it is nothing.
        """
        known = s.scatter > 0.0 or self.model_error_of(s) > TUNING.model_error
        return (
            known and float(np.hypot(s.scatter, self.model_error_of(s) * s.span)) > TUNING.other_error_share * s.noise
        )

    def model_error_of(self, s: Signal) -> float:
        """What the model may miss a signal by, as a share of its range: integrators' error and the discrepancy."""
        if not self.discrepancy:
            return self.model_error
        own = self.discrepancy.get(s.key, self.discrepancy.get(s.channel, 0.0))
        beside = max(own, TUNING.hidden_discrepancy * s.noise / s.span)
        return float(np.hypot(self.model_error, beside))

    def shared(self, s: Signal) -> float:
        """Samples that share one error of the model: those of two correlation times, or of the whole signal, (D19)."""
        time, known = self.recording.time[s.rows], self.memory.get(s.key, self.memory.get(s.channel))
        if known is None:
            return float(time.size)
        return float(min(max(2.0 * known / float(np.median(np.diff(time))), 1.0), time.size))

    @property
    def count(self) -> int:
        """Number of samples of all signals."""
        return sum(s.rows.size for s in self.signals)

    def stacked(self, predicted: Mapping[str, Array]) -> Array:
        """Predicted channels at the samples, in units of the noise and whitened, one signal after another."""
        return self.whitened(self.raw(predicted))

    def raw(self, predicted: Mapping[str, Array]) -> Array:
        """Predicted channels at the samples, one signal after another, SI."""
        return np.concatenate([predicted[s.channel][s.rows] for s in self.signals])

    def whitened(self, raw: Array) -> Array:
        """Stacked samples in units of the noise and whitened."""
        return self._whitening(raw)

    @cached_property
    def _whitening(self) -> Whitening:
        return Whitening([s.spread for s in self.signals])

    def measured(self) -> Array:
        """The same of the measurement."""
        return self.whitened(self.values)

    def discontinuities(self, raw: Array, predicted: Mapping[str, Array] = EMPTY) -> NDArray[np.int64]:
        """Samples (stacked) about which a prediction jumps, and means within which it is `predicted` to."""
        own = self._inside
        found: NDArray[np.bool_] = near_discontinuity(raw, own.least, own.first, own.last)
        for s, part in self.spans():
            size = predicted.get(DISCONTINUITY_IN + s.channel)
            if size is not None:
                found[part] |= (
                    size[s.rows]
                    > (SHOWS if self.averaged > 1 else SETTINGS.forward.discontinuities.deciding_jump) * s.sigma
                )
        return np.flatnonzero(found)

    @cached_property
    def _inside(self) -> _Inside:
        """Where the signals of the stack begin and end, and what is a jump in each."""
        spans = self.spans()
        first = np.concatenate([np.full(p.stop - p.start, p.start) for _, p in spans])
        last = np.concatenate([np.full(p.stop - p.start, p.stop - 1) for _, p in spans])
        sigma = np.concatenate([np.full(p.stop - p.start, s.sigma if s.rows.size >= 5 else np.inf) for s, p in spans])
        least = np.where(np.arange(first.size) + 2 <= last, SHOWS * sigma, np.inf)
        return _Inside(first=first, last=last, least=least)

    def masked(self, raw: Array, discontinuities: NDArray[np.int64]) -> Array:
        """Predicted samples (stacked, SI) about a jump, moved towards the measured ones within their neighbours.

        On which side of a jump a sample lies is decided by clocks, not by physics.
        """
        if not discontinuities.size:
            return raw
        moved: Array = masked(raw, discontinuities, self.values, self._inside.first, self._inside.last)
        return moved

    def worth(self, discontinuities: NDArray[np.int64]) -> Array:
        """Weights (n,) of whitened samples: those whose past was masked are as wide as the noise itself."""
        found: Array = (
            weights_after_discontinuities(discontinuities, *self._memories)
            if discontinuities.size
            else np.ones(self.count)
        )
        if self.without_discontinuities:
            found[discontinuities] = 0.0
        return found

    @cached_property
    def _memories(self) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
        """Of the signal of each sample (n,): the last one, how many its noise remembers, and what that makes of one."""
        sizes = [s.rows.size for s in self.signals]
        orders = np.repeat([len(s.ar) for s in self.signals], sizes)
        return self._inside.last, orders, np.repeat([1.0 / grown(s.ar) for s in self.signals], sizes)

    def spans(self) -> list[tuple[Signal, slice]]:
        """Each signal with its place in the stack."""
        return self._spans

    @cached_property
    def _spans(self) -> list[tuple[Signal, slice]]:
        found, at = [], 0
        for s in self.signals:
            found.append((s, slice(at, at + s.rows.size)))
            at += s.rows.size
        return found

    @cached_property
    def times(self) -> tuple[Array, ...]:
        """Stamps (n,) of the samples of each signal, s."""
        return tuple(self.recording.time[s.rows] for s in self.signals)

    @cached_property
    def values(self) -> Array:
        """The measured samples, one signal after another, SI."""
        return np.concatenate([s.values for s in self.signals])


def with_uncertain_conditions(e: Dataset, scenario: Scenario) -> Dataset:
    """The dataset with what its conditions leave uncertain; `scenario` is under them. Raises `InputError`."""
    return with_uncertain_conditions_at(
        replace(e, doubtful=tuple(nuisance_parameters(scenario, e.recording.uncertainty, e.name))), {}
    )


def with_uncertain_conditions_at(e: Dataset, beside: Mapping[str, Any], shift: float = 0.0) -> Dataset:
    """The same with that as it is beside values that are exchanged: there an error of a condition does something else.

    `shift` is the recording's time shift there, s.
    """
    base = e.simulator.predict(beside, shift)
    moved = [e.simulator.predict({**beside, **one}, shift) for one in e.doubtful]
    columns = [e.raw(m) - e.raw(base) for m in moved if m is not None and base is not None]
    return replace(e, nuisance=np.stack(columns, axis=1)) if columns else e


def dataset_of(name: str, recording: Recording, simulator: Simulator, averaged: int = 1) -> Dataset | None:
    """Make a recording ready; None if it shares no channel with the simulation. Channels that never move are left out.

    Noise is estimated from each channel itself; where it is too short for that, the noise that the recording states.
    """
    predicted = simulator.predict({}, 0.0)
    if predicted is None:
        return None
    signals = []
    for channel, values in recording.channels.items():
        rows = np.flatnonzero(np.isfinite(values))[:: _oversampling(recording, channel)]
        if channel not in predicted or rows.size < 8 or not np.all(np.isfinite(predicted[channel][rows])):
            continue
        y = values[rows]
        if np.ptp(y) == 0.0:
            continue  # an instrument that was not plugged in, or stuck
        span = float(max(np.ptp(predicted[channel][rows]), np.ptp(y)))
        if span <= 0.0:
            continue
        noise, ar = _noise(y - predicted[channel][rows], y, recording.noise.get(channel))
        sigma = float(np.hypot(noise, TUNING.model_error * span))
        if noise < sigma * 0.7:
            ar = ()  # the model's error is not coloured as the noise is
        signals.append(Signal(channel=channel, rows=rows, values=y, sigma=sigma, noise=noise, ar=ar, span=span))
    if not signals:
        return None
    loose = recording.clock.zero == "unknown"
    step = float(np.median(np.diff(recording.time))) if recording.time.size > 1 else 0.0
    return Dataset(
        name=name,
        recording=recording,
        simulator=simulator,
        signals=tuple(signals),
        shift_prior=recording.clock.within or (TUNING.loose_shift_prior if loose else TUNING.shift_prior + 0.5 * step),
        condition=condition_name(recording.conditions),
        averaged=averaged,
    )


def _oversampling(recording: Recording, channel: str) -> int:
    """Of how many samples behind a channel filter one is new: those of twice its corner frequency tell all."""
    if channel not in recording.cfc or recording.time.size < 2:
        return 1
    rate = 1.0 / float(np.median(np.diff(recording.time)))
    return max(1, int(rate / (2.0 * TUNING.corner_per_class * recording.cfc[channel])))


def _noise(residual: Array, values: Array, stated: float | None) -> tuple[float, tuple[float, ...]]:
    """Noise (1 sigma) and autocorrelation, from the misfit; from the channel itself where that shows clearly less."""
    if values.size < LENGTH:
        return (stated if stated is not None else noise_from_differences(residual)), ()
    best, other = (_floor(v) for v in (residual, values))
    if other.sigma < TUNING.own_noise_below * best.sigma:
        best = other
    return best.sigma, best.ar


def _floor(values: Array) -> NoiseFloor:
    """Noise floor with as short a memory as the samples can tell: longer ones are made of chance."""
    one = noise_floor(values, order=1, strides=(1,))
    return noise_floor(values, order=2, strides=(1,)) if one.windows >= TUNING.memory_windows else one


def noise_from_differences(values: Array) -> float:
    """Noise of a short series from its second differences: sd = 1.4826 median|d2|/sqrt(6)."""
    if values.size < 5:
        return 0.0
    d = np.diff(values, 2)
    return float(USUAL * np.median(np.abs(d - np.median(d))) / np.sqrt(6.0))


def condition_name(conditions: Mapping[str, Any]) -> str:
    """Name of the condition that a recording was run under: recordings alike share it."""
    return ", ".join(
        f"{path}={value:g}" if isinstance(value, float) else f"{path}={value}"
        for path, value in sorted(conditions.items())
    )


def left_out(dataset: Sequence[Dataset]) -> list[list[int]]:
    """What is left out in turn: one condition after another, or one recording after another if all share one."""
    groups = condition_groups(dataset)
    return groups if len(groups) > 1 else [[k] for k in range(len(dataset))]


def condition_groups(dataset: Sequence[Dataset]) -> list[list[int]]:
    """Places of the recordings that share a condition, one list for each condition."""
    found: dict[str, list[int]] = {}
    for k, e in enumerate(dataset):
        found.setdefault(e.condition or e.name, []).append(k)
    return list(found.values())
