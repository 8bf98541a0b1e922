"""Faults that recordings show by themselves, without a model: coarse digits, lost samples, flat tops.

They are named where simulation and recordings do not differ by more than noise and scatter. Digits: a channel recorded
in steps of more than its noise. Losses: a channel that has noise is not exactly 0 again and again, and behind its
filter none jumps from one sample to the next. Flat tops: a channel that ends at one value in several recordings is cut
off there; recordings of different tests do not end at the same digit unless something ends there.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.data.inconsistent import Aside
from rollover.diagnosis.data.phases import Phases, phases_of, placed, whole
from rollover.diagnosis.result import Interval, Location, Named, Verdict, chance
from rollover.diagnosis.settings import SETTINGS
from rollover.effects import EFFECTS, MOST, spoken, units_of
from rollover.recording import Recording
from rollover.recording.checks.finding import Finding, trace
from rollover.recording.checks.jumps import jumping
from rollover.recording.checks.samples import clipping, stuck
from rollover.spec.channels import describe

ID = "sensor-clipping"
Array = NDArray[np.float64]
FlatTops = dict[str, list[tuple[int, Finding]]]  # by channel: (recording, flat top)
COARSE = SETTINGS.inference.coarse_sampling
LOST = SETTINGS.inference.lost_samples
CLIPPING = SETTINGS.inference.clipping


@dataclass(frozen=True, kw_only=True)
class RecordingFault:
    """A verdict on what recordings show by themselves: where, by which effects if any, in one sentence."""

    verdict: Verdict
    effects: tuple[Named, ...]
    locations: tuple[Location, ...]
    sentence: str
    p_value: float

    def is_covered_by(self, channels: Iterable[str | None]) -> bool:
        """Whether all of some channels are among those that it shows."""
        return {p.channel for p in self.locations}.issuperset(channels)


def intrinsic_faults(
    dataset: Sequence[Dataset], recordings: Mapping[str, Recording], phases: Phases, p_value: float
) -> RecordingFault | None:
    """What recordings show by themselves, that differ from their simulation with `p_value`; None if they are sound."""
    names = [e.name for e in dataset]
    if locations := coarse(dataset, phases):  # in coarse steps any top is flat
        return _unexplained(locations, digit_sentence(locations, dataset), len(dataset), p_value)
    whole = [recordings[name] for name in names]
    effects, locations = clipped_channels(names, whole, phases)
    if effects:
        said = agreement_but_for(effects, len(dataset), p_value)
        least = min(p_value, *(e.p_value for e in effects))
        return RecordingFault(verdict="sensor", effects=effects, locations=locations, sentence=said, p_value=least)
    return truncation_fault(dataset, recordings, phases, p_value)


def truncation_fault(
    dataset: Sequence[Dataset], recordings: Mapping[str, Recording], phases: Phases, p_value: float
) -> RecordingFault | None:
    """Where recordings break off again and again; None if they do not."""
    names = [e.name for e in dataset]
    locations = lost(names, [recordings[name] for name in names], phases)
    return _unexplained(locations, loss_sentence(locations), len(dataset), p_value) if locations else None


def misread(inconsistencies: Sequence[Aside], recordings: int, p_value: float) -> RecordingFault | None:
    """What was left aside as no recording of what it states, where all else agrees; None if nothing was."""
    share = 1.0 / max(len(inconsistencies), 1)
    locations = tuple(
        whole(inconsistency.dataset, inconsistency.signal, phases_of(inconsistency.dataset), share)
        for inconsistency in inconsistencies
    )
    said = " ".join(dict.fromkeys(inconsistency.summary for inconsistency in inconsistencies))
    return _unexplained(locations, said, recordings, p_value) if inconsistencies else None


def agreement_but_for(effects: Sequence[Named], recordings: int, p_value: float) -> str:
    """The sentence on recordings that agree with the simulation but for what they show by themselves."""
    return _otherwise(" ".join(e.statement for e in effects), recordings, _within(p_value))


def _unexplained(locations: tuple[Location, ...], said: str, recordings: int, p_value: float) -> RecordingFault:
    agree = _within(p_value) if p_value > SETTINGS.inference.lack_of_fit.p_value else "hardly differ"
    said = _otherwise(said, recordings, agree)
    return RecordingFault(verdict="unexplained", effects=(), locations=locations, sentence=said, p_value=0.0)


def _otherwise(said: str, recordings: int, agree: str) -> str:
    return f"{said} Otherwise simulation and {recordings} recordings {agree}."


def _within(p_value: float) -> str:
    return f"agree within the noise ({chance(p_value)})"


def coarse(dataset: Sequence[Dataset], phases: Sequence[Sequence[tuple[float, str]]]) -> tuple[Location, ...]:
    """Where channels are recorded in steps of more than `least_step` of their range and more than their noise."""
    values: dict[str, list[Array]] = {}
    for s in (s for e in dataset for s in e.signals):
        values.setdefault(s.channel, []).append(s.values)
    least = {channel: COARSE.least_step * float(np.ptp(np.concatenate(v))) for channel, v in values.items()}
    coarse_signals = [(r, e, s) for r, e in enumerate(dataset) for s in e.signals if s.step > least[s.channel]]
    return tuple(whole(e, s, phases[r], 1.0 / len(coarse_signals)) for r, e, s in coarse_signals)


def digit_sentence(locations: Sequence[Location], dataset: Sequence[Dataset]) -> str:
    """The sentence on what digits make of recordings."""
    steps = {s.channel: s.step for e in dataset for s in e.signals if s.channel in {p.channel for p in locations}}
    said = " and ".join(f"{c} in steps of {spoken(step)} {describe(c).unit}" for c, step in steps.items())
    return (
        f"Recorded is {said}, far more than the noise: what was measured and what was recorded differ by half of that, "
        "which no candidate can explain."
    )


def lost(
    names: Sequence[str], recordings: Sequence[Recording], phases: Sequence[Sequence[tuple[float, str]]]
) -> tuple[Location, ...]:
    """Where channels break off: read exactly nothing for several samples, or jump as their filters let none, again."""
    found: dict[str, list[tuple[int, float, float]]] = {}
    for r, recording in enumerate(recordings):
        for channel in recording.channels:
            found.setdefault(channel, []).extend((r, *where) for where in _breaks(recording, channel))
    often = {channel: breaks for channel, breaks in found.items() if len(breaks) >= LOST.least_breaks}
    return placed(names, phases, ((c, *where, "time") for c, breaks in often.items() for where in breaks))


def _breaks(recording: Recording, channel: str) -> Iterator[tuple[float, float]]:
    """(start, end), s, of each run of exact zeros, and of each jump."""
    channel_trace = trace(recording, channel)
    if channel_trace is None:
        return
    yield from ((f.start, f.end) for f in stuck(channel_trace, "") if f.value == 0.0)
    yield from (
        (float(channel_trace.time[k - 1]), float(channel_trace.time[k]))
        for k in jumping(channel_trace, recording.cfc.get(channel))
    )


def loss_sentence(locations: Sequence[Location]) -> str:
    """The sentence on what recordings lost."""
    channels = dict.fromkeys(p.channel for p in locations)
    said = " and ".join(f"{c} breaks off in {sum(p.channel == c for p in locations)} places" for c in channels)
    return (
        f"{said}: it reads exactly 0, or jumps as its filter allows none. A contact opens, or samples were lost, "
        "which no candidate can explain."
    )


def clipped_channels(
    names: Sequence[str], recordings: Sequence[Recording], phases: Sequence[Sequence[tuple[float, str]]]
) -> tuple[tuple[Named, ...], tuple[Location, ...]]:
    """Channels that end at one value in two recordings or more, that most show first, and where they do."""
    found = {channel: tops for channel, tops in _tops(recordings).items() if len({r for r, _ in tops}) > 1}
    channels = sorted(found, key=lambda channel: -len(found[channel]))[:MOST]
    locations = placed(names, phases, ((c, r, top.start, top.end, c) for c in channels for r, top in found[c]))
    return tuple(_named(channel, found[channel]) for channel in channels), locations


def _tops(recordings: Sequence[Recording]) -> FlatTops:
    """(recording, flat top) of each channel whose flat tops all lie at one size, which no value exceeds."""
    every: FlatTops = {}
    for r, recording in enumerate(recordings):
        for channel in recording.channels:
            channel_trace = trace(recording, channel)
            every.setdefault(channel, []).extend(
                (r, f) for f in (clipping(channel_trace, "") if channel_trace is not None else ())
            )
    most = {c: max(float(np.nanmax(np.abs(r[c]))) for r in recordings if c in r.channels) for c in every}
    return {
        channel: tops
        for channel, tops in every.items()
        if tops and all(most[channel] - abs(f.value) <= CLIPPING.same_limit * most[channel] for _, f in tops)
    }


def _named(channel: str, tops: Sequence[tuple[int, Finding]]) -> Named:
    kind: Any = EFFECTS[ID]
    limit = abs(tops[0][1].value)
    unit = units_of(kind, channel)["limit"]
    return Named(
        id=ID,
        kind=kind.kind,
        statement=kind(channel=channel, limit=limit).statement(),
        parameters={
            "limit": Interval(
                value=limit,
                low=(1.0 - SETTINGS.inference.intervals.end_error) * limit,
                high=(1.0 + SETTINGS.inference.intervals.end_error) * limit,
                unit=unit,
            ),
        },
        settings={"channel": channel, "limit": limit},
        channel=channel,
        p_value=CLIPPING.flat_top_chance ** len({r for r, _ in tops}),
        indistinguishable_from=(),
        discriminating_test=next(iter(kind.rivals.values())),
    )
