"""Attributes of netCDF and the CF conventions: packed numbers, fill values, valid ranges, units of time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.recording.importers import stamps
from rollover.recording.importers.columns import number, text

Attributes = Mapping[str, Any]
_SPELT = {  # as the conventions have it, from any letters and underscores: Scale_Factor, FillValue, NODATA
    **{key.replace("_", "").lower(): key for key in ("scale_factor", "add_offset", "_FillValue", "missing_value")},
    **{key.replace("_", ""): key for key in ("valid_range", "valid_min", "valid_max")},
    **dict.fromkeys(("nodata", "nodatavalue", "novalue", "nullvalue", "badvalue", "invalidvalue"), "missing_value"),
}
_OTHER_SCALES = ("scale", "scaling", "gain", "slope", "factor", "calibration", "sensitivity", "offset", "intercept")
_NEUTRAL = {"offset": 0.0, "intercept": 0.0}  # of the others it is 1
_CALENDARS = ("", "standard", "gregorian", "proleptic_gregorian")


def spelt(attributes: Attributes) -> dict[str, Any]:
    """Attributes by the names that the conventions give them; one that is spelt so already stands."""
    by = {_SPELT.get(key.replace("_", "").lower(), key): value for key, value in attributes.items()}
    return {**by, **{key: attributes[key] for key in _SPELT.values() if key in attributes}}


def unit_of(attributes: Attributes, at: int = 0, count: int = 1) -> str:
    """Unit of column `at` of `count` from `unit` or `units`, in letters of any size. Raises ``ValueError`` for two."""
    found = set()
    for key, value in attributes.items():
        if key.lower() in ("unit", "units"):
            each = isinstance(value, np.ndarray) and value.size == count > 1
            found.add(text(value.ravel()[at] if each else value))
    found.discard("")
    if len(found) > 1:
        raise ValueError(f"two units, got {' and '.join(map(repr, sorted(found)))}; one")
    return found.pop() if found else ""


def decoded(raw: NDArray[Any], attributes: Attributes, fill: Any = None) -> tuple[NDArray[Any], list[str]]:
    """Numbers that the packed ones stand for, gaps as NaN, and what is to be said of them.

    `fill` is what the file's own layer keeps where nothing was written. Raises ``ValueError`` for attributes that
    are no numbers. Whole numbers without scale or gap stay whole.
    """
    attributes = spelt(attributes)
    given = {key: attributes[key] for key in attributes if not _is_text_of_no_number(key, attributes[key])}
    raw, signed = _signed(raw, text(attributes.get("_Unsigned", "")).lower())
    gaps: dict[str, NDArray[np.bool_]] = {}
    for key, value in (("_FillValue", given.get("_FillValue")), ("missing_value", given.get("missing_value"))):
        if value is not None:
            gaps[key] = np.isin(raw, _of_type(value, raw, signed))
    if fill is not None and "_FillValue" not in gaps:
        gaps["fill value"] = np.isin(raw, _of_type(fill, raw, signed))
    scale, offset = _one(attributes, "scale_factor", 1.0), _one(attributes, "add_offset", 0.0)
    physical = raw if scale == 1.0 and offset == 0.0 else raw.astype(np.float64) * scale + offset
    for key, is_outside in _bounds(given, signed):
        packed = np.asarray(attributes[key]).dtype.kind != "f" or raw.dtype.kind == "f" or physical is raw
        bound = _as_packed(attributes[key], raw, signed) if packed else np.asarray(attributes[key]).ravel()
        gaps[key] = is_outside(raw if packed else physical, bound)
    notes = []
    if (missing := np.logical_or.reduce(list(gaps.values()))).any() if gaps else False:
        physical = np.where(missing, np.nan, physical.astype(np.float64))
        each = ", ".join(f"{int(mask.sum())} {key}" for key, mask in gaps.items() if mask.any())
        notes.append(f"{int(missing.sum())} of {raw.size} values are gaps: {each}")
    return physical, notes


def unknown_scale(attributes: Attributes, dtype: np.dtype[Any]) -> str:
    """Why packed numbers cannot be read beside a scale that belongs to no convention; nothing where they can."""
    said = other_scales(attributes) if dtype.kind in "iu" else ""
    if not said:
        return ""
    return f"whole numbers beside {said}, which no convention defines; `scale`, `offset` of a profile say it"


def other_scales(attributes: Attributes) -> str:
    """Attributes that look like a scale but belong to no convention, in words; nothing beside one that does."""
    if {"scale_factor", "add_offset"} & spelt(attributes).keys():
        return ""
    found = {key: number(attributes[key]) for key in attributes if key.lower() in _OTHER_SCALES}
    return ", ".join(f"{k} {v:g}" for k, v in found.items() if v is not None and v != _NEUTRAL.get(k.lower(), 1.0))


def time_of(values: NDArray[Any], attributes: Attributes) -> tuple[NDArray[np.float64], int] | None:
    """Seconds since the first stamp, and that one in ns since 1970, of a CF coordinate of time; else None.

    Raises ``ValueError`` for a calendar or unit that is not of one length.
    """
    unit = stamps.since(unit_of(attributes))
    if unit is None:
        return None
    calendar = text(attributes.get("calendar", "")).lower()
    if calendar not in _CALENDARS:
        raise ValueError(f"calendar {calendar!r}, in which days of our own are missing; standard is allowed")
    step, zero = unit
    seconds, first = stamps.seconds_from_first(values, step)
    return seconds, zero + first


def _bounds(given: Attributes, signed: bool) -> Any:
    if "valid_range" in given and np.asarray(given["valid_range"]).size == 2:
        yield "valid_range", lambda v, b: (v < b[0]) | (v > b[1])
        return
    if "valid_min" in given:
        yield "valid_min", lambda v, b: v < b[0]
    if "valid_max" in given:
        yield "valid_max", lambda v, b: v > b[0]


def _signed(raw: NDArray[Any], unsigned: str) -> tuple[NDArray[Any], bool]:
    """The numbers with the sign that `_Unsigned` gives them, and whether that changed."""
    other = {("i", "true"): "u", ("u", "false"): "i"}.get((raw.dtype.kind, unsigned))
    if other is None:
        return raw, False
    return raw.view(np.dtype(f"{raw.dtype.byteorder}{other}{raw.dtype.itemsize}")), True


def _as_packed(value: Any, raw: NDArray[Any], signed: bool) -> NDArray[Any]:
    """Attribute values with the sign and the precision of the packed numbers."""
    numbers = np.asarray(value)
    numbers = np.array([number(v) for v in numbers.ravel()]) if numbers.dtype.kind in "OSU" else numbers.ravel()
    if raw.dtype.kind == "f":
        return numbers.astype(raw.dtype)
    if signed and numbers.dtype.kind in "iu" and numbers.dtype.itemsize == raw.dtype.itemsize:
        return numbers.astype(numbers.dtype.newbyteorder("=")).view(raw.dtype.newbyteorder("="))
    return numbers


def _of_type(value: Any, raw: NDArray[Any], signed: bool) -> NDArray[Any]:
    """Attribute values that the packed type can hold; none equals any other."""
    numbers = _as_packed(value, raw, signed)
    if raw.dtype.kind == "f":
        return numbers
    limits = np.iinfo(raw.dtype)
    whole = [int(v) for v in numbers if np.isfinite(v) and float(v) == int(v)]
    return np.array([v for v in whole if limits.min <= v <= limits.max], dtype=raw.dtype)


def _one(attributes: Attributes, key: str, neutral: float) -> float:
    if key not in attributes:
        return neutral
    found = number(attributes[key])
    if found is None or not np.isfinite(found):
        raise ValueError(f"attribute {key}: not one number, got {attributes[key]!r}")
    return found


def _is_text_of_no_number(key: str, value: Any) -> bool:
    return np.asarray(value).dtype.kind in "OSU" and number(value) is None
