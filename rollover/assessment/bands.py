"""Curves of an ensemble: mean and standard deviation of a load at each instant over starts nobody could tell apart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rollover.assessment.loads import load_channels, magnitude
from rollover.dynamics.result import Run

Array = NDArray[np.float64]
LOADS = ("device/force", "rops/force", "ground/force_normal")  # those that a load is asked of


@dataclass(frozen=True, kw_only=True)
class History:
    """Magnitudes (n,) of loads over time (n,), s, filtered as their peaks are; by channel, SI."""

    time: Array
    loads: Mapping[str, Array]


@dataclass(frozen=True, kw_only=True)
class Band:
    """One load over `starts` starts: mean (n,) and standard deviation (n,) at each instant `time` (n,), s; SI.

    NaN where not all of them were still running.
    """

    channel: str
    cfc: int
    starts: int
    time: Array
    mean: Array
    deviation: Array


def history(run: Run) -> History:
    """The loads of a run that an ensemble is drawn of."""
    cfc = run.scenario.loads.cfc
    loads = {name: magnitude(run.recording, parts, cfc) for name, parts, _ in load_channels(run.recording)}
    return History(time=run.recording.time, loads={name: v for name, v in loads.items() if name in LOADS and v.any()})


def bands(run: Run, others: Sequence[History]) -> tuple[Band, ...]:
    """Bands over a run and `others`, at the stamps of the run; none without others."""
    first, found = history(run), []
    for channel in first.loads:
        values = np.array(
            [
                np.interp(first.time, h.time, h.loads[channel], left=np.nan, right=np.nan)
                if channel in h.loads
                else np.zeros(first.time.size)  # it was never touched in that start
                for h in (first, *others)
            ]
        )
        if others:
            found.append(
                Band(
                    channel=channel,
                    cfc=run.scenario.loads.cfc,
                    starts=len(values),
                    time=first.time,
                    mean=values.mean(axis=0),
                    deviation=values.std(axis=0, ddof=1),
                )
            )
    return tuple(found)
