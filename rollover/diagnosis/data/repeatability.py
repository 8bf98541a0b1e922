"""Scatter from one run to the next: what recordings of one condition differ by, no model can predict.

Where a condition was recorded more than once, half the variance of the difference of two recordings is what one of
them perturbed runs from their mean; what the noise of each does not explain of it is scatter. A condition recorded once
is given the median scatter of the others, as a share of the range.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.data.dataset import Dataset, condition_groups
from rollover.diagnosis.settings import SETTINGS
from rollover.recording import Recording

Array = NDArray[np.float64]
TUNING = SETTINGS.data.repeatability


def without_copies(
    recordings: Sequence[tuple[str, Recording]], kept: Collection[str] = ()
) -> tuple[list[tuple[str, Recording]], list[str]]:
    """Recordings (by name) without those that hold the very samples of an earlier one, and a line on each.

    A copy is no second test. One in `kept`, or that states other conditions, stays, and that is said.
    """
    found: list[tuple[str, Recording]] = []
    lines = []
    for name, one in recordings:
        first = next(((n, r) for n, r in found if _holds_the_same(one, r)), None)
        if first is None:
            found.append((name, one))
            continue
        as_stated = dict(first[1].conditions) == dict(one.conditions)
        if as_stated and name not in kept:
            end = "a copy, not a second test; it was excluded"
        else:
            end = "one test counts twice" if as_stated else "one of the two was not made as it states"
            found.append((name, one))
        lines.append(f"{name}: holds the very samples of {first[0]}: {end}")
    return found, lines


def _holds_the_same(one: Recording, other: Recording) -> bool:
    return (
        one.channels.keys() == other.channels.keys()
        and np.array_equal(one.time, other.time)
        and all(np.array_equal(one[c], other[c], equal_nan=True) for c in one.channels)
    )


def with_scatter(found: Sequence[Dataset]) -> list[Dataset]:
    """The dataset with the scatter of each channel, where any condition was recorded more than once."""
    apart: dict[tuple[int, str], list[float]] = {}
    for group in condition_groups(found):
        for a, b in combinations(group, 2):
            for s in found[a].signals:
                power = _difference(found[a], found[b], s.channel)
                if power is not None:
                    for r in (a, b):
                        apart.setdefault((r, s.channel), []).append(power)
    own: dict[tuple[int, str], float] = {}
    shares: dict[str, list[float]] = {}
    for group in condition_groups(found):
        # the least noise of those alike: the others' may hold what they differ by
        noise: dict[str, float] = {}
        for s in (s for r in group for s in found[r].signals):
            noise[s.channel] = min(s.noise, noise.get(s.channel, np.inf))
        here = [(r, s) for r in group for s in found[r].signals if (r, s.channel) in apart]
        for r, s in here:
            power, floor = float(np.mean(apart[r, s.channel])), noise[s.channel] ** 2
            own[r, s.channel] = float(np.sqrt(power - floor)) if power > TUNING.scatter_above**2 * floor else 0.0
            shares.setdefault(s.channel, []).append(own[r, s.channel] / s.span)
    usual = {channel: float(np.median(values)) for channel, values in shares.items()}
    return [
        replace(
            e,
            signals=tuple(
                replace(
                    s,
                    scatter=float(np.hypot(s.scatter, own.get((r, s.channel), usual.get(s.channel, 0.0) * s.span))),
                )
                for s in e.signals
            ),
        )
        for r, e in enumerate(found)
    ]


def inconsistent_repeats(found: Sequence[Dataset], share: float = TUNING.reported_difference) -> list[str]:
    """Repeats that differ by more than noise and more than a share of the range, a line for each condition, channel."""
    lines = []
    for group in condition_groups(found):
        for s in found[group[0]].signals if len(group) > 1 else ():
            most = max(
                (t.scatter / t.span for r in group for t in found[r].signals if t.channel == s.channel), default=0.0
            )
            if most > share:
                names = ", ".join(found[r].name for r in group)
                lines.append(f"{names}: one condition, yet {s.channel} differ by {100.0 * most:.1f} % of the range")
    return lines


def contradiction_clause(verdict: str, contrary: Sequence[str]) -> str:
    """What a sentence goes on with where recordings contradict each other."""
    if verdict != "cannot-tell" or not contrary:
        return ""
    return f" They contradict each other: {contrary[0]}."


def _difference(a: Dataset, b: Dataset, channel: str) -> float | None:
    """Half the mean square of what two recordings of a channel differ by, at their best time shift."""
    x, y = (next((s for s in e.signals if s.channel == channel), None) for e in (a, b))
    if x is None or y is None:
        return None
    t, u = a.recording.time[x.rows], b.recording.time[y.rows]

    def left(shift: float) -> float:
        inside = (t - shift >= u[0]) & (t - shift <= u[-1])
        if inside.sum() < max(TUNING.least_samples, 0.8 * min(t.size, u.size)):
            return np.inf
        apart = (x.values[inside] - np.interp(t[inside] - shift, u, y.values)) ** 2
        # a jump lies between two samples of each, and not at the same place
        return float(np.mean(np.sort(apart)[: apart.size - TUNING.ignored_samples]))

    wide = max(SETTINGS.fit.time_shift.search_width * float(np.hypot(a.shift_prior, b.shift_prior)), TUNING.most_late)
    shifts = np.arange(-wide, wide + TUNING.coarse_step, TUNING.coarse_step)
    for finer in TUNING.fine_steps:
        shifts = min(shifts, key=left) + finer * (np.arange(TUNING.fine_count) - TUNING.fine_count // 2)
    power = min(map(left, shifts))
    return 0.5 * power if np.isfinite(power) else None
