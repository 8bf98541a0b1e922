"""What the instruments of a rig show of concealed drops: solved, read, filtered, limited; noise comes later."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rollover.proof.background import Background
from rollover.proof.campaign import Campaign, Shot
from rollover.proof.instruments import PAD, Fault, Instruments, channel_filter
from rollover.proof.library import Change
from rollover.proof.reference_solver import Descent, descend
from rollover.proof.rig import Rig

Array = NDArray[np.float64]
REBOUND = {"recovery": 0.1, "damping_ratio": 0.1}  # what the scenario knows where the ground is said to spring back


@dataclass(frozen=True, kw_only=True)
class Reading:
    """One drop as its instruments show it without noise; stamps in the recorder's time."""

    times: Array
    values: dict[str, Array]


def span(shot: Shot) -> tuple[float, float]:
    """From when to when a drop has to be solved, s."""
    return shot.start - 3.0 * PAD, shot.end + 3.0 * PAD


def rig_of(held: Campaign, shot: Shot, changes: Sequence[Change]) -> Rig:
    """The rig of one drop with these changes."""
    rig = Rig(speed=shot.speed, stiffness=shot.scatter)
    if held.rebounds:
        rig = replace(rig, recovery=REBOUND["recovery"], unloading_ratio=REBOUND["damping_ratio"])
    for change in changes:
        rig = replace(rig, **change.rig)
        rig = replace(rig, **{name: getattr(rig, name) * factor for name, factor in change.factors.items()})
        if change.speed_power:
            rig = replace(rig, stiffness=rig.stiffness * (shot.speed / 2.0) ** change.speed_power)
    return rig


def instruments_of(changes: Sequence[Change], around: Background | None = None) -> Instruments:
    """The instruments with these changes."""
    faults: dict[str, Fault] = {}
    for change in changes:
        if change.fault:
            faults[change.channel] = replace(faults.get(change.channel, Fault()), **change.fault)
    return Instruments(faults=faults, frame=around.frame if around is not None else None)


def measured(
    held: Campaign,
    changes: Sequence[Change],
    solved: Sequence[Descent] | None = None,
    around: Background | None = None,
) -> list[Reading]:
    """Every drop without noise, but behind its filters and with what range and resolution do to it."""
    instruments = instruments_of(changes, around)
    found = []
    for i, shot in enumerate(held.shots):
        if solved is not None:
            drop = solved[i]
        else:
            rig = rig_of(held, shot, changes)
            drop = descend(rig if around is None else around.about(rig, i), *span(shot))
        stamps = stamps_of(shot, i)
        values = {}
        for channel in held.channels:
            if channel in held.cfc:
                step, pad = 1.0 / shot.rate, int(PAD * shot.rate)
                wide = stamps[0] - shot.late + step * np.arange(-pad, stamps.size + pad)
                values[channel] = channel_filter(instruments.read(drop, wide, channel), step, held.cfc[channel])[
                    pad : pad + stamps.size
                ]
            else:
                values[channel] = instruments.read(drop, stamps - shot.late, channel)
            silent = np.random.default_rng(i)  # where contacts are loose
            values[channel] = instruments.limited(values[channel], stamps, channel, silent)
            for name, start, end in shot.gaps:
                if name == channel:
                    values[channel] = np.where((stamps >= start) & (stamps < end), np.nan, values[channel])
        found.append(Reading(times=stamps, values=values))
    return found


def stamps_of(shot: Shot, index: int) -> Array:
    """Time stamps of a recording, s, in the recorder's time."""
    count = int((shot.end - shot.start) * shot.rate) + 1
    t = shot.start + shot.late + np.arange(count) / shot.rate
    if shot.uneven:
        jitter = np.random.default_rng([index, count, int(1e6 * shot.speed)])
        t = t + jitter.uniform(-shot.uneven, shot.uneven, count) / shot.rate
    return np.asarray(np.round(t, 9))


def spread_of(made: Sequence[Reading], channel: str) -> float:
    """Range of a channel over all recordings."""
    low = min(float(np.nanmin(m.values[channel])) for m in made)
    return max(float(np.nanmax(m.values[channel])) for m in made) - low
