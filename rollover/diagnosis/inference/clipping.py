"""Flat tops: a channel that ends at one value in several recordings is cut off there.

Where runs scatter after an impact the samples beyond it count for little, and it is the impact that exceeds a range.
What recordings show by themselves is named for that where nothing else is: `rollover.recording.checks` finds a top that
is flat to the last digit, and recordings of different tests do not end at the same digit unless something ends there.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from rollover.diagnosis.data.phases import placed
from rollover.diagnosis.result import Interval, Named, Place
from rollover.diagnosis.settings import SETTINGS
from rollover.effects import EFFECTS, MOST, units_of
from rollover.recording import Recording
from rollover.recording.checks.finding import Finding, trace
from rollover.recording.checks.samples import clipping

ID = "sensor-clipping"
TUNING = SETTINGS.inference.clipping

Found = dict[str, list[tuple[int, Finding]]]


def clipped_channels(
    names: Sequence[str], recordings: Sequence[Recording], phases: Sequence[Sequence[tuple[float, str]]]
) -> tuple[tuple[Named, ...], tuple[Place, ...]]:
    """Channels that end at one value in two recordings or more, that most show first, and where they do."""
    found = {channel: tops for channel, tops in _tops(recordings).items() if len({r for r, _ in tops}) > 1}
    channels = sorted(found, key=lambda channel: -len(found[channel]))[:MOST]
    places = placed(names, phases, ((c, r, top.start, top.end, c) for c in channels for r, top in found[c]))
    return tuple(_named(channel, found[channel]) for channel in channels), places


def _tops(recordings: Sequence[Recording]) -> Found:
    """(recording, flat top) of each channel whose flat tops all lie at one size, which no value exceeds."""
    every: Found = {}
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
        if tops and all(most[channel] - abs(f.value) <= TUNING.same_limit * most[channel] for _, f in tops)
    }


def _named(channel: str, tops: Sequence[tuple[int, Finding]]) -> Named:
    kind: Any = EFFECTS[ID]
    limit = abs(tops[0][1].value)
    unit = units_of(kind, channel)["limit"]
    return Named(
        id=ID,
        kind=kind.kind,
        statement=kind(channel=channel, limit=limit).says(),
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
        p_value=TUNING.flat_top_chance ** len({r for r, _ in tops}),
        indistinguishable_from=(),
        discriminating_test=next(iter(kind.rivals.values())),
    )
