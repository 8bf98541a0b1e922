"""What a recording says about its sensors before any model is asked."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from rollover.recording import Recording
from rollover.recording.attitude import continuous, means_over_wraps, on_other_branch
from rollover.recording.checks.angles import is_of_means, wraps
from rollover.recording.checks.finding import Finding, Trace, instant, trace, when
from rollover.recording.checks.frozen import frozen
from rollover.recording.checks.jumps import jumps
from rollover.recording.checks.kinematic import disagreements
from rollover.recording.checks.levels import free_fall, rest
from rollover.recording.checks.offsets import VEHICLE, polarity, zero_offsets
from rollover.recording.checks.rails import rails, shared
from rollover.recording.checks.samples import clipping, gaps, spikes, stuck
from rollover.recording.checks.scales import scales
from rollover.recording.checks.timebase import MOVING, lost, stamps
from rollover.recording.noise_floor import NoiseFloor
from rollover.recording.time_stamps import from_first, is_far
from rollover.spec.channels import describe

__all__ = ["Finding", "instant", "noise_floors", "prechecks", "shared_rails", "when"]

GRAVITY = 9.81  # m/s2
INTEGRALS = ("double-integral", "lag", "clock-drift")  # checks of one channel against the integral of another


def noise_floors(recording: Recording) -> dict[str, NoiseFloor]:
    """Noise floor of each channel that is long enough to have one."""
    return {name: t.floor for name, t in _traces(continuous(_from_first(recording))).items()}


def prechecks(
    recording: Recording, *, mass: float | None = None, gravity: float = GRAVITY, seed: int = 0
) -> tuple[Finding, ...]:
    """All findings, in the order of their start; a clean recording has one in fewer than 5 of 100 cases.

    `mass` (kg) of the striker tells what its load cell should carry at rest; else that of the recording's condition
    `vehicle.mass`, if any. A simulated recording has no sensors, and nothing is found.
    """
    if recording.source == "simulation":
        return ()
    stamped = list(stamps(recording))
    first = float(recording.time[0]) if is_far(recording.time) else 0.0
    recording = _from_first(recording)
    traces, as_read = _traces(continuous(recording)), _traces(recording)
    stated = recording.conditions.get("vehicle.mass")
    mass = float(stated) if mass is None and isinstance(stated, (int, float)) else mass
    found = [*free_fall(traces, gravity), *rest(traces, mass, gravity), *disagreements(traces, seed=seed)]
    found += zero_offsets(traces, mass, gravity, {f.channel for f in found if f.check == "free-fall"})
    proper = {name for name, sensor in recording.sensors.items() if sensor.gravity == "proper"}
    found += scales(traces, recording.conditions, mass, gravity, proper)
    is_vehicle = any(name.startswith(VEHICLE) for name in traces)
    over, turned = means_over_wraps(recording), on_other_branch(recording)
    none = np.zeros(recording.time.size, dtype=bool)
    for name, t in traces.items():
        unit = describe(name).unit
        read = as_read.get(name, t)
        at = np.searchsorted(recording.time, read.time)  # rows of its samples, without its gaps
        means = over.get(name, none)[at]
        flat = list(clipping(t, unit))
        found += [
            *(wraps(read, means, turned[at]) if name in as_read else ()),
            *flat,
            *rails(t, unit, {f.value for f in flat}),
            *polarity(t, unit),
            *lost(t, unit),
            *stuck(t, unit),
            *frozen(t, unit),
            *(g for g in gaps(t) if not is_of_means(g, read, means)),
            *spikes(t, unit, among_contacts=is_vehicle and not name.endswith(MOVING)),
            *jumps(t, unit, recording.cfc.get(name)),
        ]
    found += _stated(recording, traces)
    late = {f.channel for f in found if f.check == "gap"}
    # what comes after lost samples disagrees with the integral for that alone
    found = [f for f in found if not (f.check in INTEGRALS and f.channel in late)]
    found = [replace(f, start=f.start + first, end=f.end + first) for f in found] + stamped
    return tuple(sorted(found, key=lambda f: (f.start, f.channel, f.check)))


def shared_rails(recordings: Mapping[str, Recording]) -> list[tuple[str, Finding]]:
    """(recording, finding) where a channel's peak is the same to the last digit in several measured recordings."""
    measured = {name: r for name, r in recordings.items() if r.source != "simulation"}
    return list(shared({name: _traces(r) for name, r in measured.items()}))


def _from_first(recording: Recording) -> Recording:
    """Stamps far from zero, such as the hours of a day, counted from the first: they say nothing, and cost digits."""
    return replace(recording, time=from_first(recording.time)) if is_far(recording.time) else recording


def _traces(recording: Recording) -> dict[str, Trace]:
    found = {name: trace(recording, name) for name in recording.channels}
    return {name: t for name, t in found.items() if t is not None}


def _stated(recording: Recording, traces: Mapping[str, Trace]) -> Iterator[Finding]:
    """Noise that the sidecar states against what is there, where enough of the record is quiet to say so."""
    for name, stated in recording.noise.items():
        t = traces.get(name)
        if t is None or t.floor.effective(t.values.size) < 200.0 or stated <= 0.0:
            continue
        ratio = t.floor.sigma / stated
        if ratio > 2.0:
            unit = describe(name).unit
            yield Finding(
                check="stated-noise",
                channel=name,
                start=float(t.time[0]),
                end=float(t.time[-1]),
                value=t.floor.sigma,
                unit=unit,
                error=None,
                sentence=f"noise of {t.floor.sigma:.3g} {unit} where {stated:.3g} is stated: "
                "electrical noise, aliasing or quantisation",
            )
