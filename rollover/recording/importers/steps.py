"""Stamps of samples at even steps, from the attributes that loggers and LabVIEW write beside them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.recording.importers import stamps
from rollover.recording.importers.columns import number, text
from rollover.spec import units
from rollover.spec.channels import UNITS

_STEPS: tuple[str, ...] = (
    "dt",
    "wf_increment",
    "delta_t",
    "time_step",
    "sample_interval",
    "sampling_interval",
    "sample_period",
)
_STEPS += ("sampling_period",)
_RATES = ("sample_rate", "sampling_rate", "samplerate", "fs", "sample_frequency", "sampling_frequency")
_STARTS = ("t0", "wf_start_offset", "wf_start_time")
_THINNED = ("decimat", "downsampl", "subsampl", "undersampl", "everynth")
HERTZ = {"Hz": 1.0, "kHz": 1e3, "MHz": 1e6, "1/s": 1.0, "S/s": 1.0, "kS/s": 1e3}
_SAME = 1e-6  # relative: what a rate of six digits differs from its step


def even_stamps(around: Iterable[Mapping[str, Any]], count: int) -> tuple[NDArray[np.float64] | None, int | None]:
    """Stamps of `count` samples in s, and the instant in ns since 1970 that they count from, where one is said.

    `around` are the attributes of the array, of its group, and so on outward: the innermost that says a thing holds.
    Raises ``ValueError`` where they contradict each other.
    """
    levels = [{key.lower(): value for key, value in level.items()} for level in around]
    step = next((found for level in levels if (found := _step(level)) is not None), None)
    if step is None:
        return None, None
    if _step(levels[0]) is None and (thinned := _thinned(levels[0])):
        raise ValueError(
            f"{thinned} beside a step of time that is its group's: of which samples is not said; a column of time"
        )
    offset, began = 0.0, None
    for key in _STARTS:
        value = next((level[key] for level in levels if key in level), None)
        if value is None:
            continue
        start = number(value)
        if start is None:
            began = stamps.instant(text(value))
        elif abs(start) > stamps.CALENDAR:
            began = stamps.seconds_from_first(np.array([start]), stamps.NANO)[1]
        else:
            offset += start
    return np.asarray(offset + step * np.arange(count), dtype=np.float64), began


def _thinned(level: Mapping[str, Any]) -> str:
    """What says that only every so many samples of its group's are there, in words; nothing where all are."""
    found = {k: number(v) for k, v in level.items() if any(word in re.sub("[^a-z]", "", k) for word in _THINNED)}
    return ", ".join(f"{k} {v:g}" for k, v in found.items() if v is not None and v not in (0.0, 1.0))


def _in_unit(level: Mapping[str, Any], key: str, known: Mapping[str, float]) -> float | None:
    """A number in SI by the unit beside it, such as `dt_unit`. Raises ``ValueError`` for a unit of another kind."""
    value = number(level[key])
    unit = next((text(level[k]) for k in (f"{key}_unit", f"{key}_units", f"{key}unit") if k in level), "")
    unit = unit or (text(level.get("time_units", level.get("time_unit", ""))) if known is UNITS["s"] else "")
    if value is None or not unit or " since " in unit:
        return value
    times = units.find(unit, known, {})
    if times is None:
        raise ValueError(f"attribute {key}: a unit that is none of it, got {unit!r}; {', '.join(known)}")
    return value * times


def _step(level: Mapping[str, Any]) -> float | None:
    steps = {key: _in_unit(level, key, UNITS["s"]) for key in _STEPS if key in level}
    rates = {key: _in_unit(level, key, HERTZ) for key in _RATES if key in level}
    steps |= {key: 1.0 / rate for key, rate in rates.items() if rate}
    wrong = next((key for key, step in steps.items() if step is None or not 0.0 < step < np.inf), None)
    if wrong is not None:
        raise ValueError(f"attribute {wrong}: no step of time, got {level[wrong]!r}; a number above 0")
    found = [step for step in steps.values() if step is not None]
    if found and max(found) > min(found) * (1.0 + _SAME):
        raise ValueError(f"two steps of time, got {', '.join(f'{k} {s:g} s' for k, s in steps.items())}; one")
    return found[0] if found else None
