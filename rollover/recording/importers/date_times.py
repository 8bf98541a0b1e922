"""Time stamps as loggers write them: dates and times of day, or seconds and a fraction; in whole nanoseconds."""

from __future__ import annotations

import datetime as dt
import functools
import re
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation

import numpy as np
from numpy.typing import NDArray

SECOND = 10**9  # ns
DAY = 86_400 * SECOND
IN_NS = {"s": SECOND, "ms": 10**6, "us": 10**3, "ns": 1}
EPOCH = dt.date(1970, 1, 1).toordinal() * DAY
EXACT = 2**53  # ns: the longest time (104 days) that float64 holds to the nanosecond
FORMS = "such as 2020-11-11 13:25:02.005, 2020-11-11T13:25:02Z, 11.11.2020 13:25:02,005 or 13:25:02.005"
_DATE = re.compile(
    r"(?P<y>\d{4})(?P<_>[-/.])(?P<m>\d{1,2})(?P=_)(?P<d>\d{1,2})"
    r"|(?P<d2>\d{1,2})\.(?P<m2>\d{1,2})\.(?P<y2>\d{4}|\d{2}(?!\d))"
    r"|(?P<y3>\d{4})(?P<m3>\d{2})(?P<d3>\d{2})"
    r"|(?P<d4>\d{1,2})[- ](?P<m4>[A-Za-z]{3})[- ](?P<y4>\d{4}|\d{2}(?!\d))"
)
_CLOCK = re.compile(
    r"(?P<h>\d{1,2}):(?P<min>\d{1,2})(?::(?P<s>\d{1,2})(?:[.,](?P<f>\d+)|:(?P<ms>\d{3}))?)?(?:\s*(?P<half>[AaPp])\.?[Mm]\.?)?"
    r"|(?P<h2>\d{2})(?P<min2>\d{2})(?P<s2>\d{2})(?:[.,](?P<f2>\d+))?"
)
_FRACTION = re.compile(r"(.*:\d{2}:\d{2})[.,](\d+)(Z?)")
_ZONE = re.compile(r"\s*(?:(?P<utc>Z|UTC|GMT)|(?P<sign>[+-])(?P<h>\d{1,2})(?::?(?P<m>\d{2}))?)", re.IGNORECASE)
_MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")


class NotAStampError(ValueError):
    """A cell, or cells side by side, are no time stamp; the message says why."""


@dataclass(frozen=True, kw_only=True)
class Stamp:
    """A moment: nanoseconds of its day or since the year 1; a time of day alone has no day, a local one no zone."""

    ns: int
    dated: bool
    zoned: bool


def moment(text: str) -> Stamp:
    """Read a date with its time of day, or a time of day alone. Raises `NotAStampError`."""
    parts = _FRACTION.fullmatch(text)
    if parts is None:
        return _moment(text)
    second = _moment(parts[1] + parts[3])
    return Stamp(ns=second.ns + int(parts[2][:9].ljust(9, "0")), dated=second.dated, zoned=second.zoned)


@functools.lru_cache(maxsize=4096)  # many samples share a second
def _moment(text: str) -> Stamp:
    found = _read(text)
    if found is None:
        raise NotAStampError(f"not a date-time, got {text!r}; {FORMS}")
    return found


def instant(text: str) -> int:
    """Nanoseconds since 1970 of a date with or without time, as ISO 8601 and UDUNITS write it; UTC where none is said.

    Raises `NotAStampError`.
    """
    found = _read(text, alone=True)
    if found is None or not found.dated:
        raise NotAStampError(f"not a date, got {text!r}; such as 2024-05-01T10:00:00.5Z")
    return found.ns - EPOCH


def _read(text: str, *, alone: bool = False) -> Stamp | None:
    """A moment, None for none; with `alone` a date without a time of day is one. Raises `NotAStampError`."""
    rest = text.strip()
    day = 0
    date = _DATE.match(rest)
    if date:
        parts = {k.rstrip("234"): v for k, v in date.groupdict().items() if v is not None}
        month = parts["m"] if parts["m"].isdigit() else str(1 + _month(parts["m"], text))
        try:
            day = dt.date(_year(parts["y"]), int(month), int(parts["d"])).toordinal()
        except ValueError as e:
            raise NotAStampError(f"not a date, got {text!r}: {e}") from None
        rest = re.sub(r"^\s*[Tt_]?\s*", "", rest[date.end() :])
    elif re.match(r"\d{1,2}/\d{1,2}/\d{2,4}|\d{1,2}-\d{1,2}-\d{2,4}(?!\d)", rest):
        raise NotAStampError(f"not clear which is the day and which the month or year, got {text!r}; {FORMS}")
    clock = _CLOCK.match(rest)
    if clock is None and not (alone and date):
        return None
    rest = rest[clock.end() :] if clock else rest
    zone = _ZONE.fullmatch(rest)
    if rest.strip() and zone is None:
        return None
    ns = day * DAY + (_of_day(clock, text) if clock else 0)
    if zone and zone["sign"]:
        away = (int(zone["h"]) * 60 + int(zone["m"] or 0)) * 60 * SECOND
        ns -= away if zone["sign"] == "+" else -away
    return Stamp(ns=ns, dated=date is not None, zoned=zone is not None)


def is_moment(text: str) -> bool:
    """Whether a cell is a date, a time of day or both."""
    try:
        moment(text)
    except NotAStampError:
        return _DATE.fullmatch(text.strip()) is not None and not text.strip().isdigit()
    return not re.fullmatch(r"[\d.,]+", text.strip())  # 132502 is a number


def fraction(text: str, unit: str, decimal: str = ".") -> int:
    """Fraction of a second, in its unit, in ns. Raises `NotAStampError`."""
    try:
        ns = Decimal(text.strip().replace(decimal, ".")) * IN_NS[unit]
        whole = int(ns)
    except (InvalidOperation, ValueError, OverflowError):
        raise NotAStampError(f"not a number, got {text!r}; the fraction of a second in {unit}") from None
    if not 0 <= whole < SECOND:
        raise NotAStampError(f"not a fraction of a second, got {text!r} {unit}; from 0 to less than 1 s") from None
    return whole


def whole_seconds(text: str) -> int:
    """Whole seconds, in ns. Raises `NotAStampError`."""
    if not re.fullmatch(r"\s*[-+]?\d{1,12}(\.0*)?\s*", text):
        raise NotAStampError(f"not whole seconds, got {text!r}; the fraction stands in the other column")
    return int(text.strip().partition(".")[0]) * SECOND


def over_midnight(stamps: Sequence[Stamp]) -> list[int]:
    """Nanoseconds of times of day that run on: one that lies more than 12 h back is of the next day."""
    days, before, found = 0, None, []
    for stamp in stamps:
        if before is not None and before - stamp.ns > DAY // 2:
            days += 1
        found.append(stamp.ns + days * DAY)
        before = stamp.ns
    return found


def seconds(ns: Sequence[int]) -> NDArray[np.float64]:
    """Seconds since the first, from whole nanoseconds; the differences are exact before they are divided."""
    return np.array([n - ns[0] for n in ns], dtype=np.int64) / SECOND


def spelt(stamp: Stamp) -> str:
    """A moment as ISO 8601 writes it."""
    day, of_day = divmod(stamp.ns, DAY)
    whole, ns = divmod(of_day, SECOND)
    clock = f"{whole // 3600:02}:{whole // 60 % 60:02}:{whole % 60:02}.{ns:09}".rstrip("0").rstrip(".")
    if not stamp.dated:
        return f"{clock} (a time of day)"
    return f"{dt.date.fromordinal(day).isoformat()}T{clock}" + ("Z" if stamp.zoned else " (local time as it stands)")


def _year(digits: str) -> int:
    """A year of four digits, or of two as POSIX has it: 69 to 99 are 1969 to 1999, 00 to 68 are 2000 to 2068."""
    year = int(digits)
    return year if len(digits) == 4 else year + (1900 if year > 68 else 2000)


def _month(word: str, text: str) -> int:
    if word.lower() not in _MONTHS:
        raise NotAStampError(f"not a month, got {text!r}; {FORMS}")
    return _MONTHS.index(word.lower())


def _of_day(clock: re.Match[str], text: str) -> int:
    parts = {k.rstrip("2"): v for k, v in clock.groupdict().items() if v is not None}
    hours, minutes, whole = (int(parts.get(k) or 0) for k in ("h", "min", "s"))
    if parts.get("half"):
        if not 1 <= hours <= 12:
            raise NotAStampError(f"not a time of day, got {text!r}; {FORMS}")
        hours = hours % 12 + (12 if parts["half"].lower() == "p" else 0)
    if hours > 23 or minutes > 59 or whole > 59:
        raise NotAStampError(f"not a time of day, got {text!r}; {FORMS}")
    digits = parts.get("f") or parts.get("ms") or ""
    return ((hours * 60 + minutes) * 60 + whole) * SECOND + int(digits[:9].ljust(9, "0"))
