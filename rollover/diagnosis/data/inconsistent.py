"""Recordings that contradict what they state, or each other: units, signs, and the speed of a drop.

Unit and sign errors: of what was measured, m, and what the simulation says, s, at the time shift at which the two are
most alike,

    a = m's / s's        r = m's / (|m| |s|)

a is the factor between them, r how alike they are. No effect turns a channel round or makes 9.81 times as much of it in
one recording: where |r| is near 1 and a, over what it is in the other recordings, is what the other sign or another
unit makes, that is what happened. Such a channel tells nothing of what is missing, and what it misses would drown the
rest: it is left aside, which is said. Where perturbed runs are no more alike, none can tell. What all
recordings of a channel are too large by is its gain or scale, which is fitted; only if nothing is found beside that is
it left aside too.

A drop that was not made at the speed that its sidecar states: with the speed v that is stated, and a how many times
what is simulated the ground gives way (`slips`),

    ln a = b0 + b1 ln v + d        b0, b1 by the other recordings        (M1)

What all recordings lack, or read too large, lies on that line. One that is off it was dropped faster or more slowly
than it states, or met what the others do not. In the first case another speed is all that it takes: each drop
is met best at some speed, what is missing makes of these a line as well, and at its own it misses the simulation by
little more than the others do at theirs. Which is wrong, the drop or what is stated, nobody can tell: such a
recording is left aside, which is said.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import ClassVar

import numpy as np

from rollover.diagnosis.data.dataset import Dataset, Signal
from rollover.diagnosis.settings import SETTINGS
from rollover.effects import spoken
from rollover.effects.sensor import is_length
from rollover.spec.channels import UNITS, describe

TUNING = SETTINGS.data.inconsistent
# times its prior, where a time shift is looked for
SHIFTS = np.linspace(-TUNING.shift_width, TUNING.shift_width, TUNING.shift_steps)
SPEED, DEPTH = "initiation.speed", "ground/sinkage"
WRONG_SPEED = SETTINGS.inference.wrong_condition


@dataclass(frozen=True, kw_only=True, eq=False)
class Aside(ABC):
    """What is excluded since it contradicts what it states: a channel, or all of a recording as a channel shows."""

    dataset: Dataset
    signal: Signal

    summary: ClassVar[str]

    @abstractmethod
    def message(self) -> str:
        """The sentence on it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Inconsistency(Aside):
    """A channel of a recording that reads `factor` times what is simulated, as `cause` would have it."""

    factor: float
    cause: str

    summary = "Channels stand in another unit than is stated, or with the opposite sign."

    def message(self) -> str:
        """The sentence on it."""
        return (
            f"{self.dataset.name}: {self.signal.channel} reads {spoken(self.factor)} times what is simulated, as if "
            f"{self.cause}; it was excluded."
        )


def find_inconsistencies(every: Sequence[Dataset]) -> tuple[list[Inconsistency], list[Inconsistency]]:
    """Unit and sign errors that only some recordings of a channel have, and those that all of them share."""
    met: dict[str, list[tuple[Dataset, Signal, float]]] = {}
    for e in every:
        made = e.simulator.predict({}, 0.0) or {}
        for s in e.signals:
            factor = relative_scale(e, s, made[s.channel]) if s.channel in made else None
            if factor is not None:
                met.setdefault(s.channel, []).append((e, s, factor))
    found = []
    for each in met.values():
        beside = _usual_factor(each[0][1].channel, float(np.median([abs(factor) for *_, factor in each])))
        found += [
            inconsistency
            for one in each
            if (inconsistency := _inconsistency(*one, beside)) is not None and not _is_chance(inconsistency)
        ]
    shared = [inconsistency for inconsistency in found if _is_shared(inconsistency, found, every)]
    return [inconsistency for inconsistency in found if inconsistency not in shared], shared


def _is_chance(inconsistency: Inconsistency) -> bool:
    """Whether perturbed runs correlate less in its channel than a unit error would have to.

    Of an overturn straight backward, which way the vehicle falls at its end.
    """
    simulator, channel, rows = inconsistency.dataset.simulator, inconsistency.signal.channel, inconsistency.signal.rows
    perturbed = simulator.perturbed()
    made = simulator.predict({}, 0.0)
    if made is None or not perturbed:
        return False
    apart = float(np.median([np.sum(d[channel][rows] ** 2) for d in perturbed]))
    return apart > (1.0 - TUNING.least_correlation**2) * float(np.sum(made[channel][rows] ** 2))


def without_inconsistent(every: Sequence[Dataset], inconsistencies: Sequence[Inconsistency]) -> list[Dataset]:
    """The dataset without channels that are misread by an error of unit or sign, nor recordings of nothing else."""
    aside = {(inconsistency.dataset.name, inconsistency.signal.channel) for inconsistency in inconsistencies}
    remaining = [replace(e, signals=tuple(s for s in e.signals if (e.name, s.channel) not in aside)) for e in every]
    return [e for e in remaining if e.signals] if aside else list(every)


def inconsistency_sentences(found: Sequence[Aside]) -> str:
    """Sentences behind a verdict on channels that were excluded; empty where none was."""
    return "".join(f" {inconsistency.message()}" for inconsistency in found)


def relative_scale(e: Dataset, s: Signal, made: np.ndarray) -> float | None:
    """How many times what is simulated a signal reads, where the two are alike; None if nowhere."""
    time, m, best = e.recording.time[s.rows], s.values, (0.0, 0.0)
    size = float(np.linalg.norm(m))
    for shift in SHIFTS * e.shift_prior:
        p = np.interp(time - shift, time, made[s.rows])
        power = float(p @ p)
        if size > 0.0 and power > 0.0:
            best = max(best, (abs(float(m @ p)) / (size * power**0.5), float(m @ p) / power))
    return best[1] if best[0] > TUNING.least_correlation else None


def _usual_factor(channel: str, usual: float) -> float:
    """Median factor of a channel's recordings that no unit error makes: missing physics does.

    Where it is near no unit error's, all of it.
    """
    known = (1.0, *(abs(cause) for cause, _ in _usual_unit_errors(describe(channel).unit)))
    near = min(known, key=lambda one: _log_distance(usual, one))
    return usual / near if _log_distance(usual, near) < TUNING.common_factor_tolerance else usual


def _inconsistency(e: Dataset, s: Signal, factor: float, beside: float) -> Inconsistency | None:
    near = min(_usual_unit_errors(describe(s.channel).unit), key=lambda cause: _log_distance(factor / beside, cause[0]))
    if _log_distance(factor / beside, near[0]) > TUNING.factor_tolerance:
        return None
    return Inconsistency(dataset=e, signal=s, factor=factor, cause=near[1])


def _is_shared(inconsistency: Inconsistency, found: Sequence[Inconsistency], every: Sequence[Dataset]) -> bool:
    """Whether all recordings of its channel are off by one factor, and that may be a gain: no scale is negative."""
    channel = inconsistency.signal.channel
    heard = sum(s.channel == channel for e in every for s in e.signals)
    alike = sum((f.signal.channel, f.cause) == (channel, inconsistency.cause) for f in found)
    return alike == heard and (inconsistency.factor > 0.0 or not is_length(channel))


def _log_distance(factor: float, other: float) -> float:
    """How far a factor is from another, of its logarithm; infinite for one of the other sign."""
    return abs(math.log(factor / other)) if factor * other > 0.0 else math.inf


@cache
def _usual_unit_errors(unit: str) -> tuple[tuple[float, str], ...]:
    """(factor, cause) of each error that a channel of this unit may have, the usual units first."""
    return tuple(_each(unit))


def _each(unit: str) -> Iterator[tuple[float, str]]:
    yield -1.0, "its sign were the opposite one"
    sizes: dict[float, str] = {}
    for name, size in UNITS.get(unit, {}).items():
        sizes.setdefault(size, name)
    for size, name in sizes.items():
        if max(size, 1.0 / size) < TUNING.least_unit_factor:
            continue
        for sign, turned in ((1.0, ""), (-1.0, ", and its sign the opposite one")):
            yield sign / size, f"it were in {name} and not in the unit stated{turned}"
            yield sign * size, f"it had been converted from {name} once too often{turned}"


@dataclass(frozen=True, kw_only=True, eq=False)
class WrongCondition(Aside):
    """A recording that was made at another `speed` (m/s) than it states, as its sinkage, `signal`, shows first."""

    speed: float

    summary = "What is stated of a recording is not what was tested."

    def message(self) -> str:
        """The sentence on it."""
        stated = spoken(_speed(self.dataset))
        return (
            f"{self.dataset.name}: beside the others it is a drop at about {self.speed:.2g} m/s, not at the stated "
            f"{stated} m/s; it was excluded."
        )


def wrong_conditions(every: Sequence[Dataset]) -> list[WrongCondition]:
    """The one recording, if any, that contradicts the speed that it states and all others."""
    known = [e for e in every if _speed(e) > 0.0 and np.isfinite(e.simulator.contact)]
    if not WRONG_SPEED.least_recordings <= len(known) == len(every):
        return []
    factors = [(e, s, a) for e in known for s in e.signals if s.channel == DEPTH and (a := _factor(e, s)) > 0.0]
    if len(factors) < WRONG_SPEED.least_recordings:
        return []
    x, y = np.log([_speed(e) for e, *_ in factors]), np.log([a for *_, a in factors])
    off = [_deviation(r, x, y) for r in range(x.size)]
    r = int(np.argmax([abs(d) / error for d, error in off]))
    d, error = off[r]
    if abs(d) < max(WRONG_SPEED.least_deviation, WRONG_SPEED.least_errors * error):
        return []
    e, signal, _ = factors[r]
    best = [_best_speed(other) for other, *_ in factors]
    more, _ = _deviation(r, x, np.array([log_ for log_, _ in best]))
    _, left = best[r]
    stated = _misfit_power(e, _speed(e))
    alike = left < WRONG_SPEED.most_power * max(power for k, (_, power) in enumerate(best) if k != r)
    if (
        more * d < 0.0
        or abs(more) < WRONG_SPEED.least_speed_change
        or not alike
        or left > stated / WRONG_SPEED.least_fall
    ):
        return []
    return [WrongCondition(dataset=e, signal=signal, speed=_speed(e) * math.exp(more))]


def _best_speed(e: Dataset) -> tuple[float, float]:
    """Logarithm of the speed, over the stated one, at which a recording is met best, and what is left there."""
    from scipy.optimize import minimize_scalar

    def left(log_: float) -> float:
        return _misfit_power(e, _speed(e) * math.exp(log_))

    about = min(np.linspace(-WRONG_SPEED.most_speed_change, WRONG_SPEED.most_speed_change, 9), key=left)
    beside = about + WRONG_SPEED.most_speed_change / 4.0 * np.array([-1.0, 1.0])
    found = minimize_scalar(left, bounds=beside, method="bounded", options={"xatol": 3e-3})
    return float(found.x), float(found.fun)


def _misfit_power(e: Dataset, speed: float) -> float:
    """Power over the noise that a recording misses the simulation at a speed (m/s) by, at its best time shift."""
    from scipy.optimize import minimize_scalar

    def left(shift: float) -> float:
        made = e.simulator.predict({SPEED: speed}, float(shift))
        if made is None:
            return math.inf
        misfit = np.concatenate([s.values - made[s.channel][s.rows] for s in e.signals])
        return float(np.mean(e.whitened(misfit) ** 2)) + (shift / e.shift_prior) ** 2 / misfit.size

    wide = SETTINGS.fit.time_shift.search_width * e.shift_prior
    return float(minimize_scalar(left, bounds=(-wide, wide), method="bounded", options={"maxiter": 12}).fun)


def _deviation(r: int, x: np.ndarray, y: np.ndarray) -> tuple[float, float]:
    """d of (M1) of recording r, and its standard error by how far the others lie off their line."""
    rest = np.arange(x.size) != r
    if np.ptp(x[rest]) == 0.0:
        return 0.0, math.inf
    A = np.column_stack([np.ones(x.size), x])
    line, *_ = np.linalg.lstsq(A[rest], y[rest], rcond=None)
    residual = y[rest] - A[rest] @ line
    scatter = max(WRONG_SPEED.least_scatter, math.sqrt(float(residual @ residual) / (residual.size - 2)))
    wide = float(A[r] @ np.linalg.solve(A[rest].T @ A[rest], A[r]))
    return float(y[r] - A[r] @ line), scatter * math.sqrt(1.0 + wide)


def _factor(e: Dataset, s: Signal) -> float:
    """How many times what is simulated a signal reads; 0 where the two are not alike."""
    made = (e.simulator.predict({}, 0.0) or {}).get(s.channel)
    return 0.0 if made is None else relative_scale(e, s, made) or 0.0


def _speed(e: Dataset) -> float:
    stated = e.recording.conditions.get(SPEED)
    return float(stated) if isinstance(stated, (int, float)) else 0.0
