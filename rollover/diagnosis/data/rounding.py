"""Conditions are no surer than the digits in which they are written."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from rollover.recording import Recording

MEASURED = ("initiation.speed", "vehicle.mass")  # what is read off an instrument
FINE, COARSE = 3e-4, 1e-2  # of a value: a finer rounding tells nothing, behind a coarser one it may be nominal
ANY = 15  # decimals: what has as many was not rounded


def to_the_last_digit(recordings: Sequence[tuple[str, Recording]]) -> tuple[list[tuple[str, Recording]], list[str]]:
    """The recordings with the rounding of what was measured as its uncertainty, and a line for each such condition.

    1 sigma is 10^-d/sqrt(12), d the most decimals in which any recording states that condition: 1.9 beside 2.19 is
    1.90. Left as they are: what a sidecar gives an uncertainty, and what may as well be nominal, see `COARSE`.
    """
    known: dict[str, float] = {}
    for path in MEASURED:
        open_ = [r.conditions[path] for _, r in recordings if path in r.conditions and path not in r.uncertainty]
        values = [float(v) for v in open_ if isinstance(v, (int, float))]
        sigma = 10.0 ** -max(map(decimals, values), default=ANY) / math.sqrt(12.0)
        shares = [sigma / abs(v) if v else math.inf for v in values]
        if values and max(shares) <= COARSE and max(shares) > FINE:
            known[path] = sigma
    told = [
        (name, replace(r, uncertainty={**{p: s for p, s in known.items() if p in r.conditions}, **r.uncertainty}))
        for name, r in recordings
    ]
    return told, [
        f"{path} is taken as rounded, +-{s:.2g}: state it as `uncertainty` in the sidecar" for path, s in known.items()
    ]


def decimals(value: float) -> int:
    """Digits behind the point of a number as it is written: 2 of 1.25, none of 130.0."""
    text = f"{value:.{ANY}g}"
    if "e" in text:
        return ANY if abs(value) < 1.0 else 0
    return len(text.partition(".")[2])
