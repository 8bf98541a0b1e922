"""Where the zero of a recording's clock lies on a scenario's time, from the onset of contact.

A striker falls, and then something happens: the sample at which a channel first leaves what it read until then tells
when, whatever the ground is like. About it the zero is found from each channel by

    y(t) = level + amount c(t - zero) + jump H(t - zero),                                           (O1)

c being what the scenario predicts to change from its contact on, without what it jumps by then; level and amounts are
free, the jump within what moves along with a striker, so that a ground of another stiffness moves no clock. The
likelihood over the zero, times its prior, gives its mean and standard deviation: noise over slope, or the time between
two samples where all is over within one.

What shows no onset (a vehicle on its wheels, a position) is laid over the simulation:
`rollover.comparison.registration`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from rollover.comparison.misfit import as_measured, estimated_noise, sigma_of
from rollover.comparison.registration import Part, behind, laid_over, parts
from rollover.dynamics.drop_test import BESIDE, DropFailedError, DropModel, landing_speed, simulate_drop, unfit
from rollover.recording import Clock, Recording
from rollover.recording.noise_floor import LENGTH, noise_floor
from rollover.recording.time_stamps import Method, Zero, from_first, rounding
from rollover.scenario import Scenario
from rollover.spec.channels import describe
from rollover.spec.initiation import Drop, Release
from rollover.spec.vehicle import Striker
from rollover.system.errors import Fault, InputError

Array = NDArray[np.float64]
Simulate = Callable[[Scenario], Recording]
Found = tuple[float, float, Method, tuple[str, ...]]

DEPTH = "ground/sinkage"  # that no soil is too soft for
KNOWN = 1e-3  # s, 1 sigma of a zero that is said to be known
SURE = 5.0  # sigmas, beyond which a zero is not where it is said to be
BETTER = 4.0  # times less misfit there: half the distance, as that of an error of the model is
CLEAR, IN_A_ROW, QUIET = 8.0, 4, 8  # times the noise, samples in a row, and samples before, that make an onset
FEW = 4  # samples before that will do where what they read is what a fall reads
DRIFT = 4.0  # noises, that a channel may drift before
FALLING = 0.5  # of g, within which an accelerometer reads that it falls
JUMPS = 0.5  # of the jump at a contact, 1 sigma: the mass that moves along is known no better
AFTER_ONSET, LEAST = 8e-3, 4  # s after an onset, and samples, that tell when it was
MODEL = 2e-4  # of a channel's range: what integrators differ by
PLACES = 601  # zeros that are tried at once
AT_ONCE = 1_000_000  # samples times zeros, 8 MB an array
FINE = 2.5e-4  # s, between rows of a fall that onsets are looked up in


class UnknownOnsetError(InputError):
    """A clock without a zero that nothing in the recording tells."""


@dataclass(frozen=True, kw_only=True)
class Timed:
    """A recording on the scenario's time, and the zero that was found; None: as it was stated."""

    recording: Recording
    zero: Zero | None = None


def timed(
    name: str, recording: Recording, scenario: Scenario, simulate: Simulate | None = None, *, trusting: bool = False
) -> Timed:
    """A recording on the time of a scenario, which is under its conditions.

    Its clock is in doubt where it says so (no zero, or a width beyond `KNOWN`), where it shares no time with the
    scenario, and, unless `trusting`, where a drop's contact is clearly elsewhere: t = 0 is there by definition. Raises
    `InputError` for a clock that nothing tells the zero of.
    """
    simulate = simulate or simulated
    apart = is_apart(recording, scenario)
    why = _why_uncertain(recording.clock, apart)
    if why is None and (trusting or not isinstance(scenario.initiation, Drop)):
        return Timed(recording=recording)
    if why is None and not isinstance(scenario.vehicle, Striker):
        return Timed(recording=recording)
    since = float(recording.time[0])
    bare = replace(recording, time=from_first(recording.time))
    width = None if apart else recording.clock.within
    prior = None if width is None else (-since, width)
    found: Found | None = by_onset(bare, scenario, simulate, prior)
    is_lost = why is not None and width is None
    if found is None and is_lost:
        found = by_alignment(bare, scenario, simulate)
    if found is None:
        if is_lost:
            raise UnknownOnsetError(Fault(file=name, path="clock", message=_nothing_tells(recording, *_span(scenario))))
        return Timed(recording=recording)
    at, sigma, by, channels = found
    sigma = float(np.hypot(sigma, rounding(recording.time)))
    zero = Zero(late=since + at, sigma=sigma, by=by, why=why or "off", channels=channels)
    moved = replace(bare, time=bare.time - at, clock=Clock(within=sigma))
    if why is None and not _is_off(recording, moved, scenario, simulate, zero):
        return Timed(recording=recording)
    return Timed(recording=moved, zero=zero)


def simulated(scenario: Scenario) -> Recording:
    """Channels of a scenario by the quickest simulation of its kind."""
    if not unfit(scenario):
        return simulate_drop(scenario)
    from rollover.dynamics.simulate import run  # with the solver, which a drop does without

    return run(scenario).recording


def _why_uncertain(clock: Clock, apart: bool) -> Literal["unknown", "within", "apart"] | None:
    if clock.zero == "unknown":
        return "unknown"
    if apart:
        return "apart"
    return "within" if clock.within is not None and clock.within > KNOWN else None


def is_apart(recording: Recording, scenario: Scenario) -> bool:
    """Whether the stamps of a recording and the time that a scenario lasts have nothing in common.

    A striker's fall before is the scenario's too: what ends no longer before it than it lasts is one.
    """
    start, end = _span(scenario)
    fall = recording.time[-1] - recording.time[0] if isinstance(scenario.vehicle, Striker) else 0.0
    return bool(recording.time[-1] < start - fall or recording.time[0] > end)


def _span(scenario: Scenario) -> tuple[float, float]:
    return -getattr(scenario.initiation, "lead_time", 0.0), scenario.simulation.duration


def _nothing_tells(recording: Recording, start: float, end: float) -> str:
    stamps = f"{recording.time[0]:.10g} to {recording.time[-1]:.10g} s"
    return (
        f"its time zero cannot be determined, got stamps from {stamps} for a scenario from {start:g} to {end:g} s, no "
        "onset of contact, and no place where it is like the simulation; stamps that begin with the scenario are needed"
    )


def by_onset(
    recording: Recording, scenario: Scenario, simulate: Simulate, prior: tuple[float, float] | None = None
) -> Found | None:
    """The zero (s, of the recording's stamps), 1 sigma, and the channels that show it by their onset; None if none.

    `prior` is mean and 1 sigma, s; None: it may be anywhere. Raises `InputError`.
    """
    if not isinstance(scenario.vehicle, Striker):
        return None
    run = _fall(scenario, recording, simulate)
    contact = None if run is None else _contact(scenario)
    if run is None or contact is None:
        return None
    seen = {}
    for channel in recording.channels:
        if channel in run.channels and (onset := _first_shown(recording, channel, run, contact)) is not None:
            seen[channel] = onset
    if not seen:
        return None
    # of two that disagree the earlier one: an instrument is late, never early
    about = sorted(onset for onset, _ in seen.values())[(len(seen) - 1) // 2]
    notes = []
    for channel, (at, since) in seen.items():
        if abs(at - about) <= AFTER_ONSET + LEAST * _step(recording, channel):
            notes.append((channel, _refined(recording, channel, run, contact, at, since)))
    weight = np.array([s**-2 for _, (_, s) in notes])
    each = np.array([m for _, (m, _) in notes])
    mean = float(weight @ each / weight.sum())
    # channels that differ by more than they should widen it (Birge's ratio)
    apart = float(weight @ (each - mean) ** 2 / max(len(notes) - 1, 1))
    sigma = float(np.sqrt(max(apart, 1.0) / weight.sum()))
    if prior is not None:
        both = sigma**-2 + prior[1] ** -2
        mean, sigma = float((mean * sigma**-2 + prior[0] * prior[1] ** -2) / both), float(both**-0.5)
    return mean, sigma, "onset", tuple(c for c, _ in notes)


def by_alignment(recording: Recording, scenario: Scenario, simulate: Simulate) -> Found | None:
    """The zero (s), 1 sigma, and the channels that lie over the simulation best there; None if they do nowhere."""
    run = _fall(scenario, recording, simulate)
    run = as_measured(scenario, simulate(scenario), recording) if run is None else run
    found = laid_over(recording, run)
    return None if found is None else (*found[:2], "alignment", found[2])


def _is_off(recording: Recording, moved: Recording, scenario: Scenario, simulate: Simulate, zero: Zero) -> bool:
    """Whether a zero that nobody doubts is off: far from where it should be, and every channel says so."""
    step = _step(recording, zero.channels[0])
    if abs(zero.late) <= SURE * float(np.hypot(KNOWN + 0.5 * step, zero.sigma)):
        return False
    run = _fall(scenario, recording, simulate)
    if run is None:
        return False
    pairs = list(zip(parts(recording, run), parts(moved, run), strict=True))
    if _is_better(pairs, -math.inf, math.inf):
        return True
    # what a scenario lacks may be as much all along; not so before and about its contact, of which depth tells alone
    contact = _contact(scenario)
    if contact is None or DEPTH not in zero.channels:
        return False
    begun = contact + zero.late
    return _is_better(pairs, min(contact, begun), begun + AFTER_ONSET, by=DEPTH)


def _is_better(pairs: list[tuple[Part, Part]], start: float, end: float, *, by: str = "") -> bool:
    """Whether every channel lies nearer to the simulation when moved, and one of them, or all together, by far.

    Of the stamps as they are those from `start` to `end`, s.
    """
    rows = [(a.time >= start) & (a.time <= end) for a, _ in pairs]
    if not pairs or min(int(r.sum()) for r in rows) < LEAST:
        return False
    here = [float(np.mean(a.off(0.0)[r] ** 2)) for (a, _), r in zip(pairs, rows, strict=True)]
    there = [float(np.mean(b.off(0.0)[r] ** 2)) for (_, b), r in zip(pairs, rows, strict=True)]
    chance = [1.0 + 2.0 * math.sqrt(2.0 / int(r.sum())) for r in rows]  # what shows nothing goes either way
    better = all(b < a * c for a, b, c in zip(here, there, chance, strict=True))
    far = [by in ("", a.channel) for a, _ in pairs]
    return better and float(np.dot(there, far)) * BETTER < float(np.dot(here, far))


def _fall(scenario: Scenario, recording: Recording, simulate: Simulate) -> Recording | None:
    """What a striker's channels do from long before its contact on, as measured; None for what is none, or fails."""
    if not isinstance(scenario.vehicle, Striker):
        return None
    if unfit(scenario):
        return as_measured(scenario, simulate(scenario), recording)
    length = float(recording.time[-1] - recording.time[0])
    start, end = _span(scenario)
    contact, step = _contact(scenario) or 0.0, max(FINE, length / 20_000.0)
    first, last = (math.ceil((at - contact) / step) for at in (min(start, 0.0) - length, max(end, length)))
    times: Array = contact + step * np.arange(first, last + 1, dtype=np.float64)
    if 0 <= -first <= times.size:  # else it comes after all of them
        times = np.asarray(np.insert(times, -first, contact - BESIDE), dtype=np.float64)  # channels jump there
    try:
        return as_measured(scenario, DropModel(scenario=scenario).run(times), recording)
    except DropFailedError:
        return None


def _contact(scenario: Scenario) -> float | None:
    """When a striker touches the ground, if nothing but gravity acts before, s."""
    start = scenario.initiation
    if isinstance(start, Drop):
        return 0.0
    if not isinstance(start, Release):
        return None
    return (landing_speed(start, scenario.gravity) - start.speed) / scenario.gravity


def _step(recording: Recording, channel: str) -> float:
    time, _ = recording.samples(channel)
    return float(np.median(np.diff(time))) if time.size > 1 else 0.0


def _noise(recording: Recording, channel: str, span: float) -> float:
    return float(np.hypot(sigma_of(recording, channel, estimated_noise) or 0.0, MODEL * span))


def _first_shown(recording: Recording, channel: str, run: Recording, contact: float) -> tuple[float, float] | None:
    """The zero (s) by where a channel first leaves what it read while it fell, and since when it fell; None: never."""
    time, values = recording.samples(channel)
    made = behind(run, channel, recording.cfc.get(channel))
    before = made[run.time < contact]
    if time.size < FEW + IN_A_ROW or before.size < 2 or np.ptp(values) == 0.0:
        return None
    sigma = _noise(recording, channel, float(np.ptp(values)))
    if float(np.ptp(before)) > CLEAR * sigma:
        return None  # it moves before
    begin = 0
    if describe(channel).unit == "m/s2":  # it may have hung before it fell
        falls = np.abs(values - before[0]) < FALLING * 9.81
        row = np.flatnonzero(np.convolve(falls, np.ones(FEW), "valid") == FEW)
        if not row.size:
            return None
        begin = int(row[0])
    time, values = time[begin:], values[begin:]
    off = np.abs(values - np.median(values[:FEW])) > CLEAR * sigma
    row = np.flatnonzero(np.convolve(off, np.ones(IN_A_ROW), "valid") == IN_A_ROW)
    if not row.size or not is_quiet(values[: row[0]] / sigma, FEW):
        return None
    return float(time[row[0]]) - contact, float(time[0])


def is_quiet(z: Array, least: int = QUIET) -> bool:
    """Whether what comes before a contact, in units of the noise, stays as it is: an impact that has begun does not."""
    fall = z[: -(z.size // 4) or None]
    return fall.size >= least and abs(float(np.polyfit(np.linspace(0.0, 1.0, fall.size), fall, 1)[0])) < DRIFT


def _refined(
    recording: Recording, channel: str, run: Recording, contact: float, about: float, since: float
) -> tuple[float, float]:
    """Mean and standard deviation (s) of the zero by (O1) in one channel, about where it first shows it."""
    time, values = recording.samples(channel)
    made = behind(run, channel, recording.cfc.get(channel))
    level = float(made[run.time < contact][-1])
    step = _step(recording, channel)
    sigma = _noise(recording, channel, float(np.ptp(values)))
    onset = about + contact
    late = time[time >= onset]
    until = max(onset + AFTER_ONSET, float(late[min(LEAST - 1, late.size - 1)]) + 1e-9)
    back = AFTER_ONSET + LEAST * step
    use = (time >= max(since, onset - 4.0 * back)) & (time <= until)
    t, y = time[use], values[use] / sigma
    known = values[: 4 * LENGTH]
    worth = 1.0 / noise_floor(known, order=1, strides=(1,)).independence if known.size >= LENGTH else 1.0

    jump = (float(made[run.time >= contact][0]) - level) / sigma if channel not in recording.cfc else 0.0
    y = y - y.mean()

    def left(zeros: Array) -> Array:
        since_zero = t - zeros[:, None]
        late = jump * (since_zero >= contact).astype(np.float64)
        c = (np.interp(since_zero, run.time, made) - level) / sigma - late
        return _left(y, c, late)

    low, high = about - back, about + step
    mean, sd = about, step
    for _ in range(3):
        places = np.linspace(low, high, PLACES)
        cost = np.concatenate([left(some) for some in np.array_split(places, 1 + PLACES * t.size // AT_ONCE)])
        wide = max(float(cost.min()) / max(t.size - 3, 1) / worth, 1.0 / worth)
        p = np.exp(-0.5 * (cost - cost.min()) / wide)
        mean = float(p @ places / p.sum())
        sd = float(np.sqrt(p @ (places - mean) ** 2 / p.sum()))
        low, high = mean - 6.0 * sd, mean + 6.0 * sd
    return mean, max(sd, 1e-9)


def _left(y: Array, c: Array, jump: Array) -> Array:
    """What the best amounts of `c`, `jump` (m, n) leave of values (n,) without a mean, and what the jump's prior asks.

    Squares over the noise (m,); the amount of `c` is none below zero, that of the jump 1 within `JUMPS`.
    """
    c, jump = c - c.mean(axis=1, keepdims=True), jump - jump.mean(axis=1, keepdims=True)
    over = y - jump

    def dot(a: Array, b: Array) -> Array:
        return np.asarray(np.einsum("ij,ij->i", a, b))

    cc, cj, jj = dot(c, c), dot(c, jump), dot(jump, jump) + JUMPS**-2
    cy, jy = dot(c, over), dot(jump, over)
    least = dot(over, over) - jy**2 / jj
    free, along = cc - cj**2 / jj, np.maximum(cy - cj * jy / jj, 0.0)
    shows = (free > 1e-12 * cc) & (cc > 0.0)
    return np.asarray(least - np.where(shows, along**2 / np.where(shows, free, 1.0), 0.0))
