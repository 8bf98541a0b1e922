"""What a calibration minimises: residuals over noise of several recordings, each with its own small clock offset."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.comparison import alignment
from rollover.comparison.alignment import Signal
from rollover.comparison.misfit import as_measured, sigma_of
from rollover.comparison.onset import timed
from rollover.recording import Recording, attitude
from rollover.recording.time_stamps import Zero
from rollover.scenario import Scenario
from rollover.spec.document import exchanged, paths
from rollover.system.errors import Fault, InputError

Array = NDArray[np.float64]
Simulate = Callable[[Scenario], Recording]
Noise = Callable[[Recording, str], float | None]

STEP = 2e-3  # relative, of differences: the objective is rough below, as contact falls between two steps or not
DEFAULT_SPAN = 3.0  # bounds, where none are given: a third and three times the scenario's value
CLOCK_SIGMA = 1e-3  # s, prior of each recording's clock offset
CLOCK_TURNS = 4


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """A value of the scenario that is fitted, between bounds; `u` from 0 to 1 stands for it inside.

    Positive bounds that differ by more than half are spaced logarithmically: factors then count, not differences.
    """

    path: str
    start: float
    low: float
    high: float
    unit: str = ""

    @property
    def logarithmic(self) -> bool:
        """Whether `u` is proportional to the logarithm."""
        return self.low > 0.0 and self.high > 1.5 * self.low

    def value(self, u: float) -> float:
        """Value at `u`."""
        if u <= 0.0 or u >= 1.0:
            return self.low if u <= 0.0 else self.high
        if self.logarithmic:
            return float(self.low * (self.high / self.low) ** u)
        return float(self.low + u * (self.high - self.low))

    def place(self, value: float) -> float:
        """`u` of a value."""
        if self.logarithmic:
            return math.log(value / self.low) / math.log(self.high / self.low)
        return (value - self.low) / (self.high - self.low)

    def change(self, d: float) -> float:
        """A change of `u` in `change_unit`."""
        return 100.0 * d * float(np.log(self.high / self.low)) if self.logarithmic else d * (self.high - self.low)

    @property
    def change_unit(self) -> str:
        """Percent where the parameter is spaced logarithmically, else its own unit."""
        return "%" if self.logarithmic else self.unit or "units"

    @property
    def step(self) -> float:
        """Of differences, in `u`."""
        if self.logarithmic:
            return min(STEP / math.log(self.high / self.low), 0.02)
        size = max(abs(self.low), abs(self.high))
        return min(max(STEP * size / (self.high - self.low), STEP), 0.02)


def parameter(scenario: Scenario, text: str) -> Parameter:
    """Parameter from ``PATH``, ``PATH=LOW:HIGH``; both bounds are tried on the scenario. Raises `InputError`."""
    path, equals, span = (part.strip() for part in text.partition("="))
    leaf = next((leaf for leaf in paths(scenario) if leaf.path == path), None)
    start = leaf.value if leaf is not None and not isinstance(leaf.value, bool) else None
    if leaf is not None and not isinstance(start, (int, float)):
        raise _fault(path, f"cannot be fitted, got {leaf.value!r}; one number is needed")
    if equals:
        low, high = _span(path, span)
    elif start:
        low, high = sorted((float(start) / DEFAULT_SPAN, float(start) * DEFAULT_SPAN))
    else:
        scenario.replaced({path: 1.0}, origin="--fit")  # an unknown path has a better message than missing bounds
        raise _fault(path, f"has no value to begin from, got {start!r}; --fit {path}=LOW:HIGH is needed")
    for bound in (low, high):
        try:
            scenario.replaced({path: bound}, origin="--fit")
        except InputError as e:
            if equals or leaf is None:
                raise
            raise _fault(path, f"{e.faults[0].message}; --fit {path}=LOW:HIGH sets other bounds") from None
    if start is None or not low <= start <= high:
        start = math.sqrt(low * high) if low > 0.0 else 0.5 * (low + high)
    return Parameter(path=path, start=float(start), low=low, high=high, unit=leaf.unit if leaf is not None else "")


@dataclass(frozen=True, kw_only=True)
class Case:
    """A recording, the scenario under its conditions, and its channels made ready; `sigmas` 1 sigma of each.

    `reference` is the attitude of the scenario as it is, beside whose branch those of all others are put.
    `zero` is what its clock was set by, None where it stands as stated; `clock_sigma` s its own prior, None for that of
    the objective.
    """

    name: str
    scenario: Scenario
    recording: Recording
    signals: tuple[Signal, ...]
    sigmas: tuple[float, ...]
    skipped: Mapping[str, str] = field(default_factory=dict)
    reference: Recording | None = None
    zero: Zero | None = None
    clock_sigma: float | None = None

    def seen(self, scenario: Scenario, simulated: Recording) -> Recording:
        """A simulation as the recording's instruments would have read it, on the branch that its attitude is on."""
        return attitude.beside(as_measured(scenario, simulated, self.recording), self.reference)


def case(
    scenario: Scenario,
    recording: Recording,
    simulate: Simulate,
    *,
    name: str,
    noise: Noise,
    channels: Sequence[str] | None = None,
) -> Case:
    """Put a scenario under a recording's conditions and make the recording's channels ready for it.

    A filter that the recording went through is applied to the simulation; nothing else is filtered, so that noise
    stays white. A clock in doubt is set to where `onset.timed` finds its zero. Raises `InputError` for a condition that
    the scenario lacks and a clock that nothing tells the zero of, ``ValueError`` if nothing is left.
    """
    under = scenario.replaced(recording.conditions, origin=f"{name}: conditions")
    at = timed(name, recording, under, simulate)
    recording = at.recording
    simulated = as_measured(under, simulate(under), recording)
    recording = attitude.beside(recording, simulated)
    start, end = float(simulated.time[0]), float(simulated.time[-1])
    rows = 1.0 / float(np.median(np.diff(simulated.time)))
    signals, sigmas, skipped = [], [], {}
    for channel in recording.channels if channels is None else channels:
        if channel not in simulated.channels or channel not in recording.channels:
            skipped[channel] = "not simulated" if channel in recording.channels else "not recorded"
            continue
        try:
            signal = alignment.ready(recording, channel, cfc=None, start=start, end=end, simulated_rate=rows)
        except ValueError as reason:
            skipped[channel] = str(reason).removeprefix(f"{channel}: ")
            continue
        sigma = sigma_of(recording, channel, noise)
        if sigma is None or not sigma > 0.0:
            skipped[channel] = f"its noise is not known, got {sigma!r}; state it as `noise:` in the recording"
            continue
        signals.append(signal)
        sigmas.append(sigma)
    if not signals:
        why = "; ".join(f"{channel}: {reason}" for channel, reason in skipped.items())
        raise ValueError(f"{name}: no channel can be compared, got {why}; at least one is needed")
    return Case(
        name=name,
        scenario=under,
        recording=recording,
        signals=tuple(signals),
        sigmas=tuple(sigmas),
        skipped=skipped,
        reference=attitude.reference_of(simulated) if attitude.has_attitude(recording) else None,
        zero=at.zero,
        clock_sigma=recording.clock.within,
    )


@dataclass(frozen=True, kw_only=True)
class Objective:
    """Residuals over noise as a function of `u` (p,).

    The noise of a sample is the channel's and, beside a jump of the simulation, what interpolation leaves in doubt.
    Each case's clock offset has a Gaussian prior of `clock_sigma` s, together with the uncertainty of a zero that was
    found, or that of the width that was stated, and is profiled out: at every `u` it stands at its best, unless all are
    `held`. `correlation` gives, for each case and channel, how many samples are worth one (>= 1); `weights` (n,) hold
    down outliers, None for all alike. `softening` multiplies every sigma but that of the clocks, so that a start far
    away is first led by what is large.
    """

    cases: tuple[Case, ...]
    parameters: tuple[Parameter, ...]
    simulate: Simulate
    clock_sigma: float = CLOCK_SIGMA
    held: bool = False
    softening: float = 1.0
    correlation: tuple[tuple[float, ...], ...] = ()
    weights: Array | None = None

    def values(self, u: Array) -> dict[str, float]:
        """Path -> value."""
        return {p.path: p.value(float(x)) for p, x in zip(self.parameters, u, strict=True)}

    def residuals(self, u: Array) -> Array:
        """All residuals over noise (n,), one after another; the clocks' priors are the last of each case."""
        found = np.concatenate([part for k in range(len(self.cases)) for part in self.parts(k, u)[0]])
        return found if self.weights is None else found * self.weights

    def parts(self, k: int, u: Array) -> tuple[list[Array], float]:
        """Residuals over noise of case `k`, channel by channel and then the clock's prior; its clock offset, s."""
        at, width = self._by_clock(k, u), self.width(self.cases[k])
        if self.held or width <= 0.0:
            return at(0.0), 0.0
        return _profiled(at, width)

    def squares(self, u: Array, clocks: Sequence[float]) -> float:
        """Sum of squared `residuals` with each clock at its best by its slope about `clocks` (s), one for each case."""
        found, first = 0.0, 0
        for k, (case, late) in enumerate(zip(self.cases, clocks, strict=True)):
            at, width = self._by_clock(k, u), self.width(case)
            is_held = self.held or width <= 0.0
            r = np.concatenate(at(0.0 if is_held else late))
            w = 1.0 if self.weights is None else self.weights[first : first + r.size]
            first, r = first + r.size, w * r
            found += float(r @ r)
            if not is_held:
                h = 0.05 * width
                s = w * (np.concatenate(at(late + h)) - np.concatenate(at(late - h))) / (2.0 * h)
                found -= float(s @ r) ** 2 / float(s @ s)
        return found

    def _by_clock(self, k: int, u: Array) -> Callable[[float], list[Array]]:
        """The residuals of case `k` as a function of its clock offset, s."""
        case = self.cases[k]
        under = exchanged(case.scenario, self.values(u))
        simulated = case.seen(under, self.simulate(under))
        smooth = [alignment.smooth(signal, simulated) for signal in case.signals]
        worth = self.correlation[k] if self.correlation else (1.0,) * len(case.signals)
        interpolation_errors = [alignment.interpolation_error(v) for v in smooth]
        width = self.width(case)

        def at(late: float) -> list[Array]:
            found = []
            for s, v, d, sigma, tau in zip(case.signals, smooth, interpolation_errors, case.sigmas, worth, strict=True):
                # a sample beside a jump says as little as the time of the jump is known
                size = np.hypot(sigma, alignment.at_stamps(s, simulated.time, d, late=late))
                away = s.values - alignment.at_stamps(s, simulated.time, v, late=late)
                found.append(away / (size * math.sqrt(tau) * self.softening))
            return [*found, np.array([late / width if width > 0.0 else 0.0])]

        return at

    def width(self, case: Case) -> float:
        """1 sigma of the prior of a case's clock offset, s."""
        if case.clock_sigma is None:
            return self.clock_sigma
        # the zero that was found is that of one channel's onset: what recorders add comes on top
        return case.clock_sigma if case.zero is None else math.hypot(self.clock_sigma, case.clock_sigma)

    def clock_error(self, k: int, u: Array) -> float:
        """1 sigma (s) of the clock offset of case `k` beside the values at `u`: of prior and residuals together."""
        width = self.width(self.cases[k])
        if self.held or width <= 0.0:
            return 0.0
        late, at, h = self.parts(k, u)[1], self._by_clock(k, u), 0.05 * width
        slope = [(b - a) / (2.0 * h) for a, b in zip(at(late - h), at(late + h), strict=True)]
        return float(_squared(slope) ** -0.5)

    def clocks(self, u: Array) -> dict[str, float]:
        """Clock offset of each case at its best, s."""
        return {case.name: self.parts(k, u)[1] for k, case in enumerate(self.cases)}

    def jacobian(self, u: Array, *, central: bool = False, only: Sequence[int] | None = None) -> Array:
        """Derivatives (n, p) of the residuals by differences of `Parameter.step`, inwards at a bound.

        `only` names the columns that are wanted.
        """
        at = np.empty(0) if central else self.residuals(u)
        columns = []
        for i in range(len(self.parameters)) if only is None else only:
            p = self.parameters[i]
            up, down = u.copy(), u.copy()
            up[i] = min(u[i] + p.step, 1.0)
            down[i] = max(u[i] - p.step, 0.0)
            if central:
                columns.append((self.residuals(up) - self.residuals(down)) / (up[i] - down[i]))
                continue
            to = up if u[i] + p.step <= 1.0 else down
            columns.append((self.residuals(to) - at) / (to[i] - u[i]))
        return np.column_stack(columns)

    def correlated(self, u: Array) -> Objective:
        """The same with each channel's residuals at `u` examined for how many samples are worth one."""
        plain = replace(self, correlation=(), weights=None)
        worth = tuple(tuple(correlation_time(r) for r in plain.parts(k, u)[0][:-1]) for k in range(len(self.cases)))
        return replace(self, correlation=worth, weights=None)

    def shape(self) -> list[tuple[int, ...]]:
        """Number of residuals of each channel of each case, without the clock's prior."""
        return [tuple(s.time.size for s in case.signals) for case in self.cases]

    def __len__(self) -> int:
        return len(self.parameters)


def correlation_time(residual: Array) -> float:
    """Samples that are worth one independent one: 1 + 2 sum of the autocorrelation while it is significant.

    The sum ends at the first lag within two standard errors (2/sqrt(n)) of zero; white noise gives 1.
    """
    n = residual.size
    r = residual - residual.mean()
    power = float(r @ r)
    if n < 8 or power == 0.0:
        return 1.0
    from scipy.fft import irfft, next_fast_len, rfft

    size = next_fast_len(2 * n)
    rho = irfft(np.abs(rfft(r, size)) ** 2, size)[: n // 2] / power
    small = np.flatnonzero(rho[1:] < 2.0 / math.sqrt(n))
    last = int(small[0]) if small.size else rho.size - 1
    return float(min(1.0 + 2.0 * np.sum(rho[1 : last + 1]), n / 4.0))


def _profiled(at: Callable[[float], list[Array]], sigma: float) -> tuple[list[Array], float]:
    """Gauss-Newton over one clock offset, which a step must improve; at most five sigma."""
    late, now = 0.0, at(0.0)
    cost = _squared(now)
    h = 0.05 * sigma
    for _ in range(CLOCK_TURNS):
        slope = [(b - a) / (2.0 * h) for a, b in zip(at(late - h), at(late + h), strict=True)]
        bend = sum(float(s @ s) for s in slope)
        move = -sum(float(s @ r) for s, r in zip(slope, now, strict=True)) / bend
        done = True
        for share in (1.0, 0.5, 0.25, 0.1):
            to = min(max(late + share * move, -5.0 * sigma), 5.0 * sigma)
            new = at(to)
            if (less := _squared(new)) < cost:
                done = cost - less < 1e-9 * cost
                late, now, cost = to, new, less
                break
        if done:
            break
    return now, late


def _squared(parts: list[Array]) -> float:
    return sum(float(p @ p) for p in parts)


def _span(path: str, text: str) -> tuple[float, float]:
    low, colon, high = text.partition(":")
    try:
        bounds = float(low), float(high)
    except ValueError:
        bounds = (math.nan, math.nan)
    if not colon or not (math.isfinite(bounds[0]) and bounds[0] < bounds[1] and math.isfinite(bounds[1])):
        raise _fault(path, f"not bounds, got {text!r}; LOW:HIGH with LOW < HIGH is needed")
    return bounds


def _fault(path: str, message: str) -> InputError:
    return InputError(Fault(file="--fit", path=path, message=message))


def check_free(parameters: Sequence[Parameter], recordings: Mapping[str, Mapping[str, Any]]) -> None:
    """Refuse to fit what a recording states as its condition. Raises `InputError`."""
    faults = [
        Fault(
            file="--fit", path=p.path, message=f"stated as a condition of {name}, got {conditions[p.path]!r}; another"
        )
        for p in parameters
        for name, conditions in recordings.items()
        if p.path in conditions
    ]
    if faults:
        raise InputError(*faults)
