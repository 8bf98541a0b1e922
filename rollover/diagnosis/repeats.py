"""Scatter from one run to the next: what recordings of one condition differ by, no model can predict.

Where a condition was recorded more than once, half the variance of the difference of two recordings is what one of
them strays from their mean; a condition recorded once is given the median scatter of the others, as a share of the
range. It is noise of the comparison, with the memory that it has.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.evidence import LONGEST, Evidence, Signal, groups_of

Array = NDArray[np.float64]
PLACES = 121  # time shifts that are tried
WIDTH = 3.0  # times its prior that a time shift may be
SHOWS = 1.2  # times the noise, from which on there is scatter
LEAST = 16  # samples in common, below which nothing is said


def with_scatter(found: Sequence[Evidence]) -> list[Evidence]:
    """Evidence whose noise is that between repeats, where there are any and it is more than that within one."""
    apart: dict[tuple[int, str], list[tuple[float, float]]] = {}
    for group in groups_of(found):
        for a, b in combinations(group, 2):
            for s in found[a].signals:
                one = _difference(found[a], found[b], s.channel)
                if one is not None:
                    for r in (a, b):
                        apart.setdefault((r, s.channel), []).append(one)
    if not apart:
        return list(found)
    spans = {(r, s.channel): s.span for r, e in enumerate(found) for s in e.signals}
    usual: dict[str, tuple[float, float]] = {}
    for channel in {channel for _, channel in apart}:
        here = [(k, v) for (r, c), v in apart.items() if c == channel for k in [spans[r, c]]]
        share = float(np.median([np.sqrt(np.mean([p for p, _ in v])) / k for k, v in here]))
        usual[channel] = share, float(np.median([m for _, v in here for _, m in v]))
    return [
        replace(e, signals=tuple(_scattered(s, apart.get((r, s.channel)), usual.get(s.channel)) for s in e.signals))
        for r, e in enumerate(found)
    ]


def _scattered(s: Signal, own: list[tuple[float, float]] | None, usual: tuple[float, float] | None) -> Signal:
    if usual is None:
        return s
    sigma, memory = usual[0] * s.span, usual[1]
    if own is not None:
        sigma, memory = float(np.sqrt(np.mean([p for p, _ in own]))), float(np.median([m for _, m in own]))
    if sigma < SHOWS * s.sigma:
        return s
    return replace(s, noise=sigma, sigma=max(sigma, s.sigma), ar=(float(np.clip(memory, 0.0, LONGEST)),))


def _difference(a: Evidence, b: Evidence, channel: str) -> tuple[float, float] | None:
    """Half the variance of what two recordings of a channel differ by, at their best time shift, and its memory."""
    x, y = (next((s for s in e.signals if s.channel == channel), None) for e in (a, b))
    if x is None or y is None:
        return None
    t, u = a.recording.time[x.rows], b.recording.time[y.rows]
    best: Array | None = None
    for shift in np.linspace(-WIDTH, WIDTH, PLACES) * np.hypot(a.shift_prior, b.shift_prior):
        inside = (t - shift >= u[0]) & (t - shift <= u[-1])
        if inside.sum() < max(LEAST, 0.8 * min(t.size, u.size)):
            continue
        d = x.values[inside] - np.interp(t[inside] - shift, u, y.values)
        if best is None or np.mean(d * d) < np.mean(best * best):
            best = d
    if best is None:
        return None
    power = float(best @ best)
    memory = float(best[1:] @ best[:-1]) / power if power > 0.0 else 0.0
    return 0.5 * power / best.size, memory
