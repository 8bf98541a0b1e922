"""Recordings whose clock is in doubt: their zero is found, see `rollover.onset`, before anything is compared.

A time shift that is fitted goes no further than a trigger's usual delay; a zero that is found goes as far as the stamps
do. What a zero that is found leaves is no more than that delay, so that the shift is fitted from there on.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from rollover.diagnosis.evidence import ALONE, Evidence
from rollover.diagnosis.simulator import set_up
from rollover.faults import InputError
from rollover.onset import CLEAR, IN_A_ROW, QUIET, UntoldError, is_apart, is_quiet, timed
from rollover.recording import Clock, Recording
from rollover.scenario import Scenario

SAME = 0.01  # sigmas: a zero that is where it is stated to be


def from_first_contact(
    scenario: Scenario, recordings: Sequence[tuple[str, Recording]]
) -> tuple[list[tuple[str, Recording]], list[str]]:
    """The recordings, those whose clock is in doubt with the zero that they show, and a line for each of these.

    In doubt is a zero that is unknown, may be off by more than where one is unknown, or shares no time with the
    scenario. Raises `InputError` for all of the latter that tell of no zero.
    """
    found, notes, faults = [], [], []
    for name, recording in recordings:
        try:
            moved, note = _moved(scenario, name, recording)
        except InputError as e:
            faults += e.faults
            continue
        found.append((name, moved))
        notes += note
    if faults:
        raise InputError(*faults)
    return found, notes


def _moved(scenario: Scenario, name: str, recording: Recording) -> tuple[Recording, list[str]]:
    under, clock = set_up(scenario, recording), recording.clock
    apart = is_apart(recording, under)
    if not (apart or clock.zero == "unknown" or (clock.within or 0.0) > ALONE):
        return recording, []
    try:
        at = timed(name, recording, under, trusting=True)
    except UntoldError:
        if apart:
            raise
        return recording, []  # the shift that is fitted may tell
    if at.zero is None:
        return recording, []
    loose = replace(at.recording, clock=Clock(zero="unknown"))
    if abs(at.zero.late) < SAME * at.zero.sigma:
        return (recording if clock == loose.clock else replace(recording, clock=loose.clock)), []
    return loose, [f"{name}: {at.zero.sentence}"]


def first_shown(e: Evidence) -> Iterator[float]:
    """How late (s) the first contact would be if it were what a channel shows first, of each that is quiet before."""
    for s in e.signals:
        off = np.abs(s.values - np.median(s.values[:QUIET])) > CLEAR * s.sigma
        row = np.flatnonzero(np.convolve(off, np.ones(IN_A_ROW), "valid") == IN_A_ROW)
        if row.size and np.isfinite(e.simulator.contact) and is_quiet(s.values[: row[0]] / s.sigma):
            yield float(e.recording.time[s.rows][row[0]] - e.simulator.contact)
