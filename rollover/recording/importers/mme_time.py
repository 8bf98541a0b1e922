"""Stamps of an ISO-MME channel at even steps: its sampling interval, in s by the standard, against all else it says."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

INTERVAL = "sampling interval"
FIRST = "time of first sample"
MOST = 1.0  # s: SAE J211 asks for 600 Hz at least (CFC 60), static tests are read at 10 Hz
PER_CLASS = 0.1  # samples a second and Hz of filter class, of which SAE J211 asks for 10
LASTS = 10.0  # s: what is filtered by a class is an impact, of 0.3 s in a crash and 5 s in a rollover
THOUSANDS = (1e3, 1e6)  # ms or us for s: two channels of as many samples cannot both last so long
SAME = 1e-3  # relative, of what is written with four digits
CURE = "seconds are needed, as ISO/TS 13499 has them"


def most_step(cfc: int | None) -> float:
    """Longest sampling interval (s) that is one, of a channel of a filter class or of none."""
    return MOST if cfc is None else min(MOST, 1.0 / (PER_CLASS * cfc))


def even_stamps(head: Mapping[str, str], cfc: int | None, count: int) -> NDArray[np.float64]:
    """Stamps of `count` samples (count,), s. Raises ``ValueError`` for an interval that is none or cannot be right."""
    got = head.get(INTERVAL, "nothing")
    try:
        step, start = float(got), float(_stated(head, FIRST) or 0.0)
    except ValueError:
        raise ValueError(f"got {got!r}; a time in s, or an explicit reference channel") from None
    if not (np.isfinite(start) and 0.0 < step < np.inf):
        raise ValueError(f"got {step!r}; a time greater than 0 s")
    if why := _implausible(step, cfc, count):
        raise ValueError(f"got {got}, by which {count} samples last {step * count:g} s at {1.0 / step:.4g} Hz: {why}")
    for key in head:
        if key.startswith(INTERVAL) and key != INTERVAL and _stated(head, key).lower() not in ("", "s", "sec"):
            raise ValueError(f"got {got}, with {key!r} {head[key]!r}; {CURE}")
        rate = _number(head, key) if re.match(r"sampling (rate|frequency)", key) else None
        if rate is not None and abs(rate * step - 1.0) > SAME:
            raise ValueError(f"got {got}, with {key!r} {head[key]!r}, which is not 1 over it; {CURE}")
    return np.asarray(start + step * np.arange(count))


def _implausible(step: float, cfc: int | None, count: int) -> str:
    most = most_step(cfc)
    if step <= most or (step <= MOST and step * count <= LASTS):
        return ""
    of = f"SAE J211 asks for {10 * cfc} Hz of CFC {cfc}" if cfc and most < MOST else f"{MOST:g} s at most is read"
    return f"{of}; {CURE}, not ms or us"


def contradiction(channels: Iterable[tuple[str, Mapping[str, str], int]]) -> tuple[str, str] | None:
    """Two files (name, head, number of samples) of which one takes ms or us for s: as many samples, each a step of
    which one is a thousand or a million times the other; None if none do.
    """
    seen: dict[int, list[tuple[str, float]]] = {}
    for file, head, count in channels:
        step = _number(head, INTERVAL)
        if head.get("reference channel", "implicit").lower() == "explicit" or not step:
            continue
        for other, before in seen.setdefault(count, []):
            ratio = max(step, before) / min(step, before)
            if any(abs(ratio / times - 1.0) < SAME for times in THOUSANDS):
                return (other, file) if step > before else (file, other)
        seen[count].append((file, step))
    return None


def _stated(head: Mapping[str, str], key: str) -> str:
    value = head.get(key, "").strip()
    return "" if value.upper() == "NOVALUE" else value


def _number(head: Mapping[str, str], key: str) -> float | None:
    try:
        value = float(_stated(head, key))
    except ValueError:
        return None
    return value if 0.0 < value < np.inf else None
