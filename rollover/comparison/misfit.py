"""A measured recording against a run: residual by channel and phase over the noise, ratings, the clock apart.

Nothing is shifted in time: `Misfit.clock` says by how much the recording's clock would have to be set to agree best
and what that would gain, and leaves it there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.comparison import alignment
from rollover.comparison.alignment import Signal
from rollover.comparison.clock_offset import Clock, clock
from rollover.comparison.instruments import at_sensors
from rollover.comparison.rating import NotRateable, Peak, Rating, rate
from rollover.dynamics.result import Run
from rollover.recording import Recording, attitude
from rollover.recording.filters import least_rate
from rollover.recording.noise_floor import LENGTH, noise_floor
from rollover.recording.time_stamps import Zero
from rollover.scenario import Scenario
from rollover.spec.vehicle import Striker, Vehicle, chassis_of

Array = NDArray[np.float64]

NOISE_SAMPLES = 100_000  # the first of a channel, by which its noise is estimated
CONTACT_SHARE, CONTACT_SIGMAS, CONTACT_ROWS = 0.02, 5.0, 3  # of the peak, of the noise, in a row: contact
OUTSIDE = 0.01  # of a recording's samples: more beyond the simulation are worth a note
LEAD = 0.01  # s before first contact that are rated with what follows
CONTACT_CHANNELS = ("ground/force_normal", "rops/force", "striker/acceleration_z")


@dataclass(frozen=True, kw_only=True)
class Cell:
    """One channel in one phase. `share` of the recording's squared residual over noise; `bias` mean residual, SI."""

    phase: str
    start: float
    end: float
    samples: int
    bias: float
    share: float
    rating: Rating | NotRateable


@dataclass(frozen=True, kw_only=True)
class ChannelMisfit:
    """One channel over the whole overlap. `time`, `measured`, `simulated` (n,) at the recording's stamps, filtered.

    `noise` is 1 sigma after the filter, None where it could not be found out; `rating` is over the event, from first
    contact to rest.
    """

    channel: str
    unit: str
    cfc: int | None
    rate: float
    noise: float | None
    time: Array
    measured: Array
    simulated: Array
    rating: Rating | NotRateable
    cells: tuple[Cell, ...]

    @property
    def residual(self) -> Array:
        """Measured less simulated, (n,)."""
        return self.measured - self.simulated


@dataclass(frozen=True, kw_only=True)
class Misfit:
    """One recording against one run. `contact_*` s of first contact; `skipped` channel -> why it was left out.

    `zero` is what the recording's clock had been set by before, None where it stands as stated.
    """

    recording: str
    title: str
    channels: tuple[ChannelMisfit, ...]
    phases: tuple[tuple[float, str], ...]
    contact_measured: float | None
    contact_simulated: float | None
    clock: Clock | None
    energy_measured: float | None
    energy_simulated: float | None
    skipped: Mapping[str, str]
    notes: tuple[str, ...]
    zero: Zero | None = None


def misfit(
    run: Run,
    recording: Recording,
    *,
    name: str = "",
    cfc: int | None = None,
    at_least: bool = False,
    noise: Callable[[Recording, str], float | None] | None = None,
    channels: Sequence[str] | None = None,
) -> Misfit:
    """Compare a recording with a run, channel by channel.

    `cfc` is the filter class for both sides; where a side is too slow for it, the channel is compared unfiltered and
    a note says so, or, with `at_least`, ``ValueError`` is raised. `noise(recording, channel)` gives 1 sigma of the
    recorded samples where the recording states none.
    """
    simulated = as_measured(run.scenario, run.recording, recording)
    said = len(recording.notes)
    recording = attitude.beside(recording, simulated)
    start, end = float(simulated.time[0]), float(simulated.time[-1])
    phases = phases_of(run)
    first = next((at for at, phase in phases if phase in ("loading", "impact")), None)
    seen = contact(recording, noise)
    if first is not None and seen is not None:
        # before contact means before it on both sides
        phases = _earlier(phases, min(first, seen))
    found: list[ChannelMisfit] = []
    signals: list[tuple[Signal, float]] = []
    skipped: dict[str, str] = {}
    notes: list[str] = list(recording.notes[said:])
    for channel in recording.channels if channels is None else channels:
        if channel not in simulated.channels:
            skipped[channel] = "not simulated in this scenario"
            continue
        try:
            signal, note = _ready(recording, channel, cfc, at_least, start, end, _rate(simulated))
        except _TooSlowError as reason:
            raise ValueError(str(reason)) from None
        except ValueError as reason:
            skipped[channel] = str(reason).removeprefix(f"{channel}: ")
            continue
        notes += [note] if note else []
        sigma = sigma_of(recording, channel, noise)
        after = None if sigma is None else sigma * signal.quieter
        if signals and np.array_equal(signals[-1][0].time, signal.time):  # one clock: its stamps are kept once
            signal = replace(signal, time=signals[-1][0].time, stretch=signals[-1][0].stretch)
        values = alignment.simulated_at(signal, simulated)
        found.append(_channel(signal, values, after, phases, first))
        signals.append((signal, after if after else _scale(signal.values)))
    outside = np.count_nonzero((recording.time < start) | (recording.time > end))
    if outside > OUTSIDE * recording.time.size:
        notes.append(
            f"the simulation covers {start:g} to {end:g} s of the recording's "
            f"{recording.time[0]:g} to {recording.time[-1]:g} s; the rest was not compared"
        )
    total = sum(float(np.sum((c.residual / s) ** 2)) for c, (_, s) in zip(found, signals, strict=True))
    return Misfit(
        recording=name or recording.title,
        title=recording.title,
        channels=tuple(_shared(c, s, total) for c, (_, s) in zip(found, signals, strict=True)),
        phases=phases,
        contact_measured=seen,
        contact_simulated=first,
        clock=clock([s for s in signals if not attitude.is_locked(s[0].channel, recording, simulated)], simulated),
        energy_measured=_absorbed(recording, start, end),
        energy_simulated=_absorbed(simulated, float(recording.time[0]), float(recording.time[-1])),
        skipped=skipped,
        notes=tuple(dict.fromkeys(notes)),
    )


def phases_of(run: Run) -> tuple[tuple[float, str], ...]:
    """Start and name of each phase; what hits a drop rig's ground has loading and unloading apart."""
    turn = min((e.time for e in run.events if e.kind == "unloading"), default=None)
    if not isinstance(run.scenario.vehicle, Striker):
        return run.phases
    marks = [(at, "loading" if name == "impact" else name) for at, name in run.phases]
    if turn is not None:
        marks.append((turn, "unloading"))
    return tuple(sorted(marks))


def contact(recording: Recording, noise: Callable[[Recording, str], float | None] | None = None) -> float | None:
    """When a recording first shows contact, s, or None if it never does or begins with it.

    A force, or the change of an acceleration from how it begins, is above 5 sigma of its noise and above 2 percent
    of its peak for three samples.
    """
    for channel in CONTACT_CHANNELS:
        if channel not in recording.channels:
            continue
        known = np.isfinite(recording[channel])
        time, values = recording.time[known], recording[channel][known]
        if time.size < 4 * CONTACT_ROWS:
            continue
        away = np.abs(values - np.median(values[: max(CONTACT_ROWS, np.count_nonzero(time < time[0] + LEAD))]))
        sigma = sigma_of(recording, channel, noise) or 0.0
        touched = away > max(CONTACT_SIGMAS * sigma, CONTACT_SHARE * float(np.max(away)))
        runs = np.convolve(touched.astype(int), np.ones(CONTACT_ROWS, dtype=int), mode="valid") == CONTACT_ROWS
        if runs.any() and not runs[0]:
            return float(time[int(np.argmax(runs))])
    return None


def sigma_of(
    recording: Recording, channel: str, noise: Callable[[Recording, str], float | None] | None = None
) -> float | None:
    """1 sigma of a channel's samples as recorded: what the recording states, else what `noise` finds."""
    if channel in recording.noise:
        return recording.noise[channel]
    return noise(recording, channel) if noise is not None else None


def estimated_noise(recording: Recording, channel: str) -> float | None:
    """1 sigma from the quiet stretches of the recording itself; None from too few samples or without any noise."""
    values = recording[channel][np.isfinite(recording[channel])][:NOISE_SAMPLES]
    return (noise_floor(values).sigma or None) if values.size >= LENGTH else None


def as_measured(scenario: Scenario, simulated: Recording, recording: Recording) -> Recording:
    """A simulation at the places and in the axes of a recording's instruments; as it is where none are stated."""
    simulated = attitude.as_recorded(simulated, recording)
    if not recording.sensors:
        return simulated
    vehicle = scenario.vehicle
    centre, pivot = (0.0, 0.0, 0.0), None
    if isinstance(vehicle, Vehicle):
        centre = chassis_of(vehicle).centre_of_mass
        pivot = vehicle.front_axle.pivot if vehicle.front_axle is not None else None
    return at_sensors(simulated, recording, centre_of_mass=centre, pivot=pivot, gravity=scenario.gravity)


class _TooSlowError(ValueError):
    """A class was asked for that a side is too slow for."""


def _ready(
    recording: Recording, channel: str, cfc: int | None, at_least: bool, start: float, end: float, rate: float
) -> tuple[Signal, str]:
    try:
        return alignment.ready(recording, channel, cfc=cfc, start=start, end=end, simulated_rate=rate), ""
    except ValueError as reason:
        if cfc is None or "CFC" not in str(reason):
            raise
        if at_least:
            raise _TooSlowError(str(reason)) from None
        plain = alignment.ready(recording, channel, cfc=None, start=start, end=end, simulated_rate=rate)
        return plain, f"{reason}: compared without it"


def _rate(recording: Recording) -> float:
    return 1.0 / float(np.median(np.diff(recording.time))) if recording.time.size > 1 else 0.0


def _scale(values: Array) -> float:
    """Stands in for an unknown noise where channels are put together: a hundredth of the range."""
    return 0.01 * float(np.ptp(values)) or 1.0


def _channel(
    signal: Signal, simulated: Array, noise: float | None, phases: tuple[tuple[float, str], ...], first: float | None
) -> ChannelMisfit:
    ends = [*(at for at, _ in phases[1:]), np.inf]
    cells = []
    for k, ((at, phase), to) in enumerate(zip(phases, ends, strict=True)):
        here = (signal.time < to) & ((signal.time >= at) | (k == 0))
        if not here.any():
            continue
        time = signal.time[here]
        cells.append(
            Cell(
                phase=phase,
                start=float(time[0]),
                end=float(time[-1]),
                samples=int(here.sum()),
                bias=float(np.mean(signal.values[here] - simulated[here])),
                share=0.0,
                rating=_rated(signal, simulated, here, noise),
            )
        )
    rest = next((at for at, phase in phases if phase == "rest"), np.inf)
    event = (signal.time >= (-np.inf if first is None else first - LEAD)) & (signal.time <= rest)
    return ChannelMisfit(
        channel=signal.channel,
        unit=signal.unit,
        cfc=signal.cfc,
        rate=signal.rate,
        noise=noise,
        time=signal.time,
        measured=signal.values,
        simulated=simulated,
        rating=_rated(signal, simulated, event, noise),
        cells=tuple(cells),
    )


def _rated(signal: Signal, simulated: Array, here: NDArray[np.bool_], noise: float | None) -> Rating | NotRateable:
    """Rate a part; a row of NaN stands where a gap is, so that nothing is bridged over it."""
    time, measured, values = signal.time[here], signal.values[here], simulated[here]
    breaks = np.flatnonzero(np.diff(signal.stretch[here])) + 1
    time = np.insert(time, breaks, 0.5 * (time[breaks - 1] + time[breaks])) if breaks.size else time
    measured, values = (np.insert(v, breaks, np.nan) for v in (measured, values))
    return rate(time, measured, values, noise=noise, least_rate=least_rate(signal.cfc) if signal.cfc else 0.0)


def _shared(c: ChannelMisfit, sigma: float, total: float) -> ChannelMisfit:
    cells = []
    for cell in c.cells:
        here = (c.time >= cell.start) & (c.time <= cell.end)
        share = float(np.sum((c.residual[here] / sigma) ** 2)) / total if total > 0.0 else 0.0
        cells.append(Cell(**{**cell.__dict__, "share": share}))
    return ChannelMisfit(**{**c.__dict__, "cells": tuple(cells)})


def _earlier(phases: tuple[tuple[float, str], ...], first: float) -> tuple[tuple[float, str], ...]:
    moved = [(min(at, first) if phase in ("loading", "impact") else at, phase) for at, phase in phases]
    return tuple(sorted(moved, key=lambda mark: mark[0]))


def _absorbed(recording: Recording, start: float, end: float) -> float | None:
    """Work that the ground took, J: the integral of the normal force over the sinkage, where both are known."""
    names = ("ground/force_normal", "ground/sinkage")
    if any(name not in recording.channels for name in names):
        return None
    force, sinkage = (recording[name] for name in names)
    known = np.isfinite(force) & np.isfinite(sinkage) & (recording.time >= start) & (recording.time <= end)
    if known.sum() < 2:
        return None
    f, z = force[known], sinkage[known]
    return float(np.sum(0.5 * (f[1:] + f[:-1]) * np.diff(z)))


def summary(found: Any) -> Any:
    """What a comparison or a rating says, as bare values for a file; without the arrays."""
    if isinstance(found, Zero):
        return found.answer
    if isinstance(found, NotRateable):
        return {"not_rateable": found.reason}
    if is_dataclass(found):
        values = {f.name: getattr(found, f.name) for f in fields(found)}
        about = {name: summary(value) for name, value in values.items() if not isinstance(value, np.ndarray)}
        return {**about, "time_error": found.time_error} if isinstance(found, Peak) else about
    if isinstance(found, (tuple, list)):
        return [summary(item) for item in found]
    if isinstance(found, Mapping):
        return {key: summary(item) for key, item in found.items()}
    return found
