"""Time stamps from their first one on, and where on them a scenario begins.

No computing beyond needs to know at which hour of which clock they began. A double holds about 16 digits: seconds of an
epoch (1.7e9) come in steps of 2.4e-7 s. Stamps that are a regular grid within that rounding are that grid.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ROUNDINGS = 2.0  # steps of a double that two stamps may be off by: half a one each, and as much for how they were made
DIGITS = 15  # that a double surely holds
Method = Literal["onset", "alignment", "deceleration"]


@dataclass(frozen=True, kw_only=True)
class Zero:
    """The scenario's t = 0 on a recording's clock: `late` s, with 1 sigma.

    `by` is what told it; `why` it was looked for: stated as unknown, stated with a width, found to be off, or beyond
    all that the scenario lasts.
    """

    late: float
    sigma: float
    by: Method
    why: Literal["unknown", "within", "off", "apart"]
    channels: tuple[str, ...]

    @property
    def answer(self) -> dict[str, Any]:
        """For a file: the numbers, and the sentence."""
        return {**asdict(self), "channels": list(self.channels), "sentence": self.sentence}

    @property
    def sentence(self) -> str:
        """What was found, in words; to a tenth of the standard deviation."""
        why = {
            "unknown": "has no zero",
            "within": "may be off",
            "off": "is off, which is not stated",
            "apart": "shares no time with the scenario",
        }[self.why]
        by = {
            "onset": "by the onset of contact in",
            "alignment": "by least-squares alignment of",
            "deceleration": "by where the fall ends in",
        }[self.by]
        return (
            f"its clock {why}; the scenario's zero lies at {in_digits(self.late, self.sigma)} s, 1 sigma "
            f"{1e3 * self.sigma:.2g} ms, {by} {', '.join(self.channels)}"
        )


def from_first(time: Array) -> Array:
    """Stamps (n,) less the first one, s; on their grid where they are one within their own rounding."""
    since: Array = np.asarray(time - time[0], dtype=np.float64)
    if time.size < 3:
        return since
    off = ROUNDINGS * float(np.spacing(np.max(np.abs(time))))
    count = _counted(since, off)
    if np.any(np.diff(count) < 1.0):
        return since
    low, high = float(np.max((since - off)[1:] / count[1:])), float(np.min((since + off)[1:] / count[1:]))
    return np.asarray(count * _roundest(low, high)) if low <= high else since


def is_far(time: Array) -> bool:
    """Whether zero lies further from all stamps than they last: no trigger stands there."""
    return bool(max(time[0], -time[-1]) > time[-1] - time[0])


def in_digits(value: float, sigma: float) -> str:
    """A value to a tenth of its standard deviation."""
    return f"{value:.{max(0, 1 - math.floor(math.log10(sigma))) if sigma > 0.0 else 9}f}"


def rounding(time: Array) -> float:
    """How far a stamp may be off by the rounding of a double alone, 1 sigma of a uniform distribution, s."""
    return float(np.spacing(np.max(np.abs(time))) / np.sqrt(12.0))


def _counted(since: Array, off: float) -> Array:
    """How many steps each stamp lies behind the first one, the step being estimated from ever more of them."""
    step, reach = float(np.median(np.diff(since))), 1
    while True:
        # as many steps as `off` in the last ones lets count surely
        reach = max(2 * reach, int(0.25 * reach * step / off)) if off > 0.0 else since.size
        within = np.flatnonzero(since < (reach + 0.5) * step)
        last = int(within[-1])
        count = max(float(np.rint(since[last] / step)), 1.0)
        step = float(since[last] / count) if last else step
        if last == since.size - 1:
            return np.rint(since / step)


def _roundest(low: float, high: float) -> float:
    """Of the steps within two bounds (s) that of a whole rate, else that of the fewest digits: loggers have such."""
    rate = np.rint(2.0 / (low + high))
    if rate >= 1.0 and low <= 1.0 / rate <= high:
        return float(1.0 / rate)
    middle = 0.5 * (low + high)
    for digits in range(DIGITS):
        step = float(f"{middle:.{digits}e}")
        if low <= step <= high:
            return step
    return middle
