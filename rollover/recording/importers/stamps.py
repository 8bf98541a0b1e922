"""Instants of a calendar as seconds since the first of them, by differences of whole numbers."""

from __future__ import annotations

import re
from datetime import UTC, datetime, timedelta
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rollover.recording.importers.date_times import instant

__all__ = ["CALENDAR", "NANO", "clock_digits", "instant", "said", "seconds_from_first", "since"]

Array = NDArray[np.float64]
NANO = 1_000_000_000
CALENDAR = 10 * 365.25 * 86400.0  # s: no recorder counts ten years from its own start; such stamps count from 1970
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_STEP = {  # ns; spellings of UDUNITS, which the CF conventions refer to
    **dict.fromkeys(("days", "day", "d"), 86400 * NANO),
    **dict.fromkeys(("hours", "hour", "hrs", "hr", "h"), 3600 * NANO),
    **dict.fromkeys(("minutes", "minute", "mins", "min"), 60 * NANO),
    **dict.fromkeys(("seconds", "second", "secs", "sec", "s"), NANO),
    **dict.fromkeys(("milliseconds", "millisecond", "millisecs", "millisec", "msecs", "msec", "ms"), 10**6),
    **dict.fromkeys(("microseconds", "microsecond", "microsecs", "microsec", "us", "µs"), 10**3),
    **dict.fromkeys(("nanoseconds", "nanosecond", "nanosecs", "nanosec", "ns"), 1),
}
_SINCE = re.compile(r"\s*(\S+)\s+since\s+(.+?)\s*", re.IGNORECASE)


def since(unit: str) -> tuple[int, int] | None:
    """Step and zero, both in ns, of a CF unit of time such as `ms since 2024-05-01 10:00`; None for any other unit.

    Raises ``ValueError`` where the unit is one of time since a date that is not of one length, or the date is none.
    """
    match = _SINCE.fullmatch(unit)
    if match is None:
        return None
    step, date = match.groups()
    if step.lower() not in _STEP:
        raise ValueError(f"no unit of one length, got {unit!r}; days, hours, minutes, s, ms, us or ns since a date")
    return _STEP[step.lower()], instant(date)


def seconds_from_first(counts: ArrayLike, step: int) -> tuple[Array, int]:
    """Seconds since the first of `counts` of `step` ns each, (n,), and that first one in ns.

    Whole numbers are subtracted as such: what a float keeps of an instant is 240 ns. Raises ``ValueError``.
    """
    values = np.asarray(counts)
    if values.size == 0:
        return np.empty(0), 0
    if values.dtype.kind in "iu":
        if int(values.max()) >= 2**63:
            raise ValueError(f"beyond every calendar, got {int(values.max())}; less than 2^63 is allowed")
        whole = values.astype(np.int64)
        return (whole - whole[0]) * (step / NANO), int(whole[0]) * step
    first = float(values[0])
    if not np.isfinite(first):
        return values.astype(np.float64) * (step / NANO), 0  # refused as a stamp that is missing
    return (values.astype(np.float64) - first) * (step / NANO), round(Fraction(first) * step)


def said(began: int) -> str:
    """An instant in words, ISO 8601, UTC."""
    whole, rest = divmod(began, NANO)
    return f"{(_EPOCH + timedelta(seconds=whole)).strftime('%Y-%m-%dT%H:%M:%S')}.{rest:09d}Z"


def clock_digits(values: NDArray[Any]) -> tuple[float, float] | None:
    """Two stamps side by side that are HHMMSS: every minute of them leaps by 40 s; None if these are none."""
    if values.ndim != 1 or values.size < 3 or not 0.0 <= values[0] < values[-1] < 240_000.0:
        return None
    if np.any(values % 100.0 >= 60.0) or np.any(values % 10_000.0 >= 6_000.0):
        return None
    at = np.flatnonzero(np.diff(np.floor(values / 100.0)))
    step = float(np.median(np.diff(values)))
    jumps = np.diff(values)[at] - np.where(np.diff(np.floor(values / 10_000.0))[at] > 0.0, 4040.0, 40.0)
    is_one = bool(at.size) and bool(np.all(np.abs(jumps - step) < 0.5 * step))
    return (float(values[at[0]]), float(values[at[0] + 1])) if is_one else None
