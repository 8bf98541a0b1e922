"""Recordings whose clock is in doubt: their zero is found (`rollover.comparison.onset`) before anything is compared.

A time shift that is fitted goes no further than a trigger's usual delay; a zero that is found goes as far as the stamps
do. What a zero that is found leaves is no more than that delay, so that the shift is fitted from there on.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from rollover.comparison.onset import CLEAR, IN_A_ROW, QUIET, UnknownOnsetError, is_apart, is_quiet, timed
from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.forward.forward_model import set_up
from rollover.diagnosis.settings import SETTINGS
from rollover.dynamics.drop_test import unfit
from rollover.recording import Clock, Recording
from rollover.recording.time_stamps import Zero
from rollover.scenario import Scenario
from rollover.system.errors import Fault, InputError

TUNING = SETTINGS.data.onset


def zeros_from_contact(
    scenario: Scenario, recordings: Sequence[tuple[str, Recording]]
) -> tuple[list[tuple[str, Recording]], list[str]]:
    """The recordings, those whose clock is in doubt with the zero that they show, and a line for each of these.

    Raises `InputError`, see `with_clock_zeros`.
    """
    found, zeros = with_clock_zeros(scenario, recordings)
    return found, [f"{name}: {zero.sentence}" for name, zero in zeros.items()]


def with_clock_zeros(
    scenario: Scenario, recordings: Sequence[tuple[str, Recording]]
) -> tuple[list[tuple[str, Recording]], dict[str, Zero]]:
    """The recordings, those whose clock is in doubt with the zero that they show, and these zeros by name.

    In doubt is a zero that is unknown, may be off by more than where one is unknown, or shares no time with the
    scenario. Raises `InputError` for all of the latter that tell of no zero.
    """
    found: list[tuple[str, Recording]] = []
    zeros: dict[str, Zero] = {}
    faults: list[Fault] = []
    for name, recording in recordings:
        try:
            moved, zero = _moved(scenario, name, recording)
        except InputError as e:
            faults += e.faults
            continue
        found.append((name, moved))
        zeros |= {} if zero is None else {name: zero}
    if faults:
        raise InputError(*faults)
    return found, zeros


def clock_notes(
    scenario: Scenario, recordings: Sequence[tuple[str, Recording]], zeros: Mapping[str, Zero]
) -> Iterator[str]:
    """A line on each clock that was set, and on each that is said to be right, is clearly off, and was left so.

    What a diagnosis names may look like a clock, so that one which is stated is not set against its statement.
    """
    for name, recording in recordings:
        if name in zeros:
            yield f"{name}: {zeros[name].sentence}"
        elif recording.clock == Clock() and (zero := _wrong_zero(scenario, name, recording)) is not None:
            yield (
                f"{name}: {zero.sentence}; left as it is stated to be: `clock: {{zero: unknown}}` in its sidecar or "
                "profile sets it there"
            )


def _wrong_zero(scenario: Scenario, name: str, recording: Recording) -> Zero | None:
    """The zero of a clock that is said to be right and is not; None where it is, or where to look takes a full run."""
    under = set_up(scenario, recording)
    return None if unfit(under) else timed(name, recording, under).zero


def _moved(scenario: Scenario, name: str, recording: Recording) -> tuple[Recording, Zero | None]:
    under, clock = set_up(scenario, recording), recording.clock
    apart = is_apart(recording, under)
    if not (apart or clock.zero == "unknown" or (clock.within or 0.0) > SETTINGS.data.dataset.loose_shift_prior):
        return recording, None
    try:
        at = timed(name, recording, under, trusting=True)
    except UnknownOnsetError:
        if apart:
            raise
        return recording, None  # the shift that is fitted may tell
    if at.zero is None:
        return recording, None
    loose = Clock(zero="unknown")
    if abs(at.zero.late) < TUNING.same_zero * at.zero.sigma:
        return (recording if clock == loose else replace(recording, clock=loose)), None
    return replace(at.recording, clock=loose), at.zero


def onset_delay(e: Dataset) -> Iterator[float]:
    """How late (s) the first contact would be if it were what a channel shows first, of each that is quiet before."""
    for s in e.signals:
        off = np.abs(s.values - np.median(s.values[:QUIET])) > CLEAR * s.sigma
        row = np.flatnonzero(np.convolve(off, np.ones(IN_A_ROW), "valid") == IN_A_ROW)
        if row.size and np.isfinite(e.simulator.contact) and is_quiet(s.values[: row[0]] / s.sigma):
            yield float(e.recording.time[s.rows][row[0]] - e.simulator.contact)
