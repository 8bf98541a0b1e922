"""What a recording says about its sensors before any model is asked."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from rollover.attitude import continuous
from rollover.channels import describe
from rollover.noise import NoiseFloor
from rollover.prechecks.finding import Finding, Trace, trace
from rollover.prechecks.kinematic import disagreements
from rollover.prechecks.leaps import leaps
from rollover.prechecks.levels import free_fall, rest
from rollover.prechecks.samples import clipping, gaps, spikes, stuck
from rollover.recording import Recording

__all__ = ["Finding", "noise_floors", "prechecks"]

GRAVITY = 9.81  # m/s2


def noise_floors(recording: Recording) -> dict[str, NoiseFloor]:
    """Noise floor of each channel that is long enough to have one."""
    return {name: t.floor for name, t in _traces(recording).items()}


def prechecks(
    recording: Recording, *, mass: float | None = None, gravity: float = GRAVITY, seed: int = 0
) -> tuple[Finding, ...]:
    """All findings, in the order of their start; a clean recording has one in fewer than 5 of 100 cases.

    `mass` (kg) of the striker tells what its load cell should carry at rest; else that of the recording's condition
    `vehicle.mass`, if any. A simulated recording has no sensors, and nothing is found.
    """
    if recording.source == "simulation":
        return ()
    traces = _traces(recording)
    stated = recording.conditions.get("vehicle.mass")
    mass = float(stated) if mass is None and isinstance(stated, (int, float)) else mass
    found = [*free_fall(traces, gravity), *rest(traces, mass, gravity), *disagreements(traces, seed=seed)]
    for name, t in traces.items():
        unit = describe(name).unit
        found += [
            *clipping(t, unit),
            *stuck(t, unit),
            *gaps(t),
            *spikes(t, unit),
            *leaps(t, unit, recording.cfc.get(name)),
        ]
    found += _stated(recording, traces)
    return tuple(sorted(found, key=lambda f: (f.start, f.channel, f.check)))


def _traces(recording: Recording) -> dict[str, Trace]:
    recording = continuous(recording)
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
                sentence=f"noise of {t.floor.sigma:.3g} {unit} where {stated:.3g} is stated",
            )
