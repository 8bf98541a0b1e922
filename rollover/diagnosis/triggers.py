"""Recordings whose clock has no zero: what they show first is taken for the first contact.

A drop falls, and then something happens. Where nobody says when t = 0 was, the sample at which a channel first leaves
what it read until then is when. A time shift that is fitted goes no further than a trigger's usual delay; this one goes
as far as the stamps do.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from rollover.diagnosis.evidence import ALONE, Evidence, evidence_of
from rollover.diagnosis.simulator import simulator_of
from rollover.recording import Clock, Recording
from rollover.scenario import Scenario
from rollover.vehicle import Striker

CLEAR, IN_A_ROW = 8.0, 4  # times its noise, and samples in a row, by which a channel shows that something is met
QUIET, DRIFT = 8, 4.0  # samples before, at least, and by how much of its noise a channel may drift in them
REACH = 3.0 * ALONE  # s, within which a time shift is fitted


def from_first_contact(
    scenario: Scenario, recordings: Sequence[tuple[str, Recording]]
) -> tuple[list[tuple[str, Recording]], list[str]]:
    """The recordings, drops that nobody timed with the zero that their first contact tells, and a line for each moved.

    Those are the ones whose zero is unknown or may be off by more than where one is unknown. A contact within reach of
    a time shift is left to that.
    """
    found, notes = [], []
    for name, recording in recordings:
        late = _late(name, recording, scenario) if _is_loose(recording, scenario) else None
        if late is not None:
            recording = replace(recording, clock=Clock(zero="unknown"))
            if abs(late) > REACH:
                recording = replace(recording, time=recording.time - late)
                notes.append(
                    f"{name}: its clock has no zero; what it shows first, at {late:.4g} s, is its first contact"
                )
        found.append((name, recording))
    return found, notes


def first_shown(e: Evidence) -> Iterator[float]:
    """How late (s) the first contact would be if it were what a channel shows first, of each that is quiet before."""
    for s in e.signals:
        off = np.abs(s.values - np.median(s.values[:QUIET])) > CLEAR * s.sigma
        row = np.flatnonzero(np.convolve(off, np.ones(IN_A_ROW), "valid") == IN_A_ROW)
        if row.size and np.isfinite(e.simulator.contact) and _is_quiet(s.values[: row[0]] / s.sigma):
            yield float(e.recording.time[s.rows][row[0]] - e.simulator.contact)


def _is_quiet(z: np.ndarray) -> bool:
    """Whether what comes before a contact, in units of the noise, stays what it is: a blow that has begun does not."""
    fall = z[: -(z.size // 4) or None]
    return fall.size >= QUIET and abs(float(np.polyfit(np.linspace(0.0, 1.0, fall.size), fall, 1)[0])) < DRIFT


def _is_loose(recording: Recording, scenario: Scenario) -> bool:
    clock = recording.clock
    return isinstance(scenario.vehicle, Striker) and (clock.zero == "unknown" or (clock.within or 0.0) > ALONE)


def _late(name: str, recording: Recording, scenario: Scenario) -> float | None:
    """How late (s) a recording is by the channels that show a contact; None where none does."""
    evidence = evidence_of(name, recording, simulator_of(scenario, recording))
    found = [] if evidence is None else list(first_shown(evidence))
    return float(np.median(found)) if found else None
