"""Samples that were lost, as of a contact that opens: recordings show them by themselves, no candidate makes up for it.

Where the signal is small they hide in the noise, and where runs scatter they count for little. But a channel that has
noise is not nothing to the last digit again and again, and behind its filter none jumps from one sample to the next.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rollover.diagnosis.data.phases import placed
from rollover.diagnosis.result import Place
from rollover.diagnosis.settings import SETTINGS
from rollover.recording import Recording
from rollover.recording.checks.finding import trace
from rollover.recording.checks.leaps import leaping
from rollover.recording.checks.samples import stuck

TUNING = SETTINGS.inference.lost_samples


def lost(
    names: Sequence[str], recordings: Sequence[Recording], phases: Sequence[Sequence[tuple[float, str]]]
) -> tuple[Place, ...]:
    """Where channels break off: read exactly nothing for several samples, or jump as their filters let none, again."""
    found: dict[str, list[tuple[int, float, float]]] = {}
    for r, recording in enumerate(recordings):
        for channel in recording.channels:
            found.setdefault(channel, []).extend((r, *where) for where in _breaks(recording, channel))
    often = {channel: breaks for channel, breaks in found.items() if len(breaks) >= TUNING.least_breaks}
    return placed(names, phases, ((c, *where, "time") for c, breaks in often.items() for where in breaks))


def _breaks(recording: Recording, channel: str) -> Iterator[tuple[float, float]]:
    """(start, end), s, of each run of exact zeros, and of each jump."""
    channel_trace = trace(recording, channel)
    if channel_trace is None:
        return
    yield from ((f.start, f.end) for f in stuck(channel_trace, "") if f.value == 0.0)
    yield from (
        (float(channel_trace.time[k - 1]), float(channel_trace.time[k]))
        for k in leaping(channel_trace, recording.cfc.get(channel))
    )


def loss_sentence(places: Sequence[Place]) -> str:
    """The sentence on what recordings lost."""
    channels = dict.fromkeys(p.channel for p in places)
    said = " and ".join(f"{c} breaks off in {sum(p.channel == c for p in places)} places" for c in channels)
    return (
        f"{said}: it reads exactly 0, or jumps as its filter allows none. A contact opens, or samples were lost, "
        "which no candidate can explain."
    )
