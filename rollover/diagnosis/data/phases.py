"""Phases of a test: of a drop free fall, first contact, loading, peak, unloading, rest; else those of its run."""

from __future__ import annotations

import bisect
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.data.dataset import Dataset, Signal
from rollover.diagnosis.result import Location
from rollover.diagnosis.settings import SETTINGS

Phases = Sequence[Sequence[tuple[float, str]]]  # of each recording: when each phase begins, and its name

Array = NDArray[np.float64]
TUNING = SETTINGS.data.phases
PEAK = "peak"  # the phase about the deepest point


def phases_of(dataset: Dataset) -> tuple[tuple[float, str], ...]:
    """(start s, name) of each phase that a recording went through."""
    run = dataset.simulator.marks()
    if not run:
        return drop_phases(dataset)
    first, last = float(dataset.recording.time[0]), float(dataset.recording.time[-1])
    marks = [m for m in run if m[0] < last]
    marks = [m for k, m in enumerate(marks) if k + 1 == len(marks) or marks[k + 1][0] > first]
    return tuple((max(at, first) if k else first, name) for k, (at, name) in enumerate(marks)) or ((first, "approach"),)


def drop_phases(dataset: Dataset) -> tuple[tuple[float, str], ...]:
    """(start s, name) of each phase of a drop: by the measured sinkage where there is any, else by the simulated."""
    recording = dataset.recording
    depth = recording.channels.get("ground/sinkage")
    if depth is None and "striker/position_z" in recording.channels:
        depth = -recording.channels["striker/position_z"]
    if depth is None:
        depth = dataset.simulator.state(0.0).get("ground/sinkage", np.full(recording.time.size, np.nan))
    known = np.isfinite(depth)
    time, z = recording.time[known], depth[known]
    start = float(recording.time[0])
    if time.size < 5:
        return ((start, "approach"),)
    smooth = np.convolve(z, np.ones(3) / 3.0, mode="valid")
    deepest = float(time[1 + int(np.argmax(smooth))])
    marks = [
        (start, "free-fall"),
        (0.0, "first-contact"),
        (TUNING.first_contact, "loading"),
        ((1.0 - TUNING.around_peak) * deepest, PEAK),
        ((1.0 + TUNING.around_peak) * deepest, "unloading"),
        (deepest + TUNING.settling, "rest"),
    ]
    marks = [m for k, m in enumerate(marks) if k == 0 or m[0] > marks[k - 1][0]]
    return tuple(m for k, m in enumerate(marks) if k + 1 == len(marks) or marks[k + 1][0] > start)


def phase_at(phases: Sequence[tuple[float, str]], at: float) -> str:
    """Name of the phase at a time (s); the first before all begin."""
    return phases[max(bisect.bisect_right([start for start, _ in phases], at) - 1, 0)][1]


def placed(
    names: Sequence[str],
    phases: Sequence[Sequence[tuple[float, str]]],
    found: Iterable[tuple[str, int, float, float, str]],
) -> tuple[Location, ...]:
    """Places of equal share, of (channel, which recording, start s, end s, what it depends on)."""
    every = list(found)
    return tuple(
        Location(
            recording=names[r],
            channel=channel,
            phase=phase_at(phases[r], start),
            start=start,
            end=end,
            share=1.0 / len(every),
            depends_on=on,
        )
        for channel, r, start, end, on in every
    )


def whole(e: Dataset, s: Signal, phases: Sequence[tuple[float, str]], share: float) -> Location:
    """The whole of a signal as a place, with the phase in which it reaches furthest."""
    times = e.recording.time[s.rows]
    peak = float(times[int(np.abs(s.values - s.values[0]).argmax())])
    return Location(
        recording=e.name,
        channel=s.channel,
        phase=phase_at(phases, peak),
        start=float(times[0]),
        end=float(times[-1]),
        share=share,
        depends_on="value",
    )
