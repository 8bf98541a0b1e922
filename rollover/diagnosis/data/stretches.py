"""Where a model's discrepancy acts: after the first contact of a drop; of a full run before and after its first impact.

Two models of what turns over agree until something hits, and part there: what one misses is another number on each
side.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.data.dataset import Dataset, Signal
from rollover.diagnosis.forward.interface import first_impact_of
from rollover.diagnosis.settings import SETTINGS

LEAST = SETTINGS.noise.truncation.least_samples
BEFORE = "before the first impact"


def stretches(e: Dataset, s: Signal) -> list[tuple[str, NDArray[np.bool_]]]:
    """Key (see `Signal.key`) and samples (n,) of a signal, of each stretch in which a discrepancy is one."""
    time, impact = e.recording.time[s.rows], first_impact_of(e.simulator)
    if not np.isfinite(impact):
        each = [(s.channel, time >= e.simulator.contact)]
    else:
        each = [(before(s.channel), time < impact), (s.channel, time >= impact)]
    return [(key, inside) for key, inside in each if inside.any()]


def before(channel: str) -> str:
    """Key of what is missed of a channel before the first impact."""
    return f"{channel} {BEFORE}"


def channel_of(key: str) -> str:
    """Channel of a key."""
    return key.removesuffix(f" {BEFORE}")


def parted(e: Dataset) -> Dataset:
    """The dataset with two signals for each channel, before the first impact and after it, each held against its own.

    As it is where the discrepancy is not known by these stretches, or one of them is too short.
    """
    if not any(before(s.channel) in e.discrepancy for s in e.signals):
        return e
    found: list[Signal] = []
    for s in e.signals:
        each = dict(stretches(e, s))
        if before(s.channel) not in each or min(int(v.sum()) for v in each.values()) < LEAST:
            found.append(s)
            continue
        found += [replace(s.cut(inside), phase=BEFORE if key != s.channel else "") for key, inside in each.items()]
    return replace(e, signals=tuple(found))


def onset(e: Dataset) -> float:
    """When the scenario as it is first hits the ground with more than its wheels, s; a drop touches it; else inf."""
    impact = first_impact_of(e.simulator)
    return impact if np.isfinite(impact) else e.simulator.contact
