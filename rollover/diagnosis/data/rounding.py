"""Conditions are no surer than the digits in which they are written."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from rollover.diagnosis.settings import SETTINGS
from rollover.recording import Recording

MEASURED = ("initiation.speed", "vehicle.mass")  # what is read off an instrument
TUNING = SETTINGS.data.rounding


def with_rounding_uncertainty(
    recordings: Sequence[tuple[str, Recording]],
) -> tuple[list[tuple[str, Recording]], list[str]]:
    """The recordings with the rounding of what was measured as its uncertainty, and a line for each such condition.

    1 sigma is 10^-d/sqrt(12), d the most decimals in which any recording states that condition: 1.9 beside 2.19 is
    1.90. Left as they are: what a sidecar gives an uncertainty, and what may as well be nominal, see `most_rounding`.
    """
    known: dict[str, float] = {}
    for path in MEASURED:
        open_ = [r.conditions[path] for _, r in recordings if path in r.conditions and path not in r.uncertainty]
        values = [float(v) for v in open_ if isinstance(v, (int, float))]
        sigma = 10.0 ** -max(map(decimals, values), default=TUNING.most_decimals) / math.sqrt(12.0)
        shares = [sigma / abs(v) if v else math.inf for v in values]
        if values and max(shares) <= TUNING.most_rounding and max(shares) > TUNING.least_rounding:
            known[path] = sigma
    digits = [
        (name, replace(r, uncertainty={**{p: s for p, s in known.items() if p in r.conditions}, **r.uncertainty}))
        for name, r in recordings
    ]
    return digits, [
        f"{path} is taken as rounded, +-{s:.2g}: state it as `uncertainty` in the sidecar" for path, s in known.items()
    ]


def decimals(value: float) -> int:
    """Digits behind the point of a number as it is written: 2 of 1.25, none of 130.0."""
    text = f"{value:.{TUNING.most_decimals}g}"
    if "e" in text:
        return TUNING.most_decimals if abs(value) < 1.0 else 0
    return len(text.partition(".")[2])
