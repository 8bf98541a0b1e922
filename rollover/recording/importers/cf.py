"""Attributes of netCDF and the CF conventions: packed numbers, fill values, valid ranges, units of time."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
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
_PACKED = ("scale_factor", "add_offset")
_MARKS = ("_FillValue", "missing_value", "valid_range", "valid_min", "valid_max")  # of what is no measured value
_OTHER_SCALES: tuple[str, ...] = ("scale", "scaling", "gain", "slope", "factor", "calib", "sensitiv", "multipl")
_OTHER_SCALES += ("offset", "intercept", "coef", "polynom", "percount", "perbit", "perlsb", "lsb", "countsper")
_OTHER_SCALES += ("conversion", "divisor", "bias", "tare", "physicalm", "digitalm", "adcm")
_NEUTRAL_AT_NOUGHT = "offset|intercept|bias|tare"
_TERM = re.compile("[a-dk]_?[0-9]", re.IGNORECASE)  # a0, C1: of a polynomial
_NO_SCALES: tuple[str, ...] = ("time", "start", "utc", "wf", "sampl", "decimat", "compress", "shuffle", "crest")
_NO_SCALES += (
    "date",
    "year",
    "serial",
    "number",
    "length",
    "size",
    "type",
    "status",
    "calid",
    "calibid",
    "calibrationid",
    "axis",
    "source",
)
_BESIDE = ("resolution", "exponent")  # may be told for information only
_OF_TIME: tuple[str, ...] = (
    "dt",
    "delta",
    "step",
    "interval",
    "period",
    "rate",
    "fs",
    "freq",
    "tzero",
    "duration",
    "clock",
    "trigger",
)
_OF_TIME += (
    "index",
    "channel",
    "count",
    "id",
    "min",
    "max",
    "mean",
    "average",
    "rms",
    "std",
    "version",
    "cfc",
    "filter",
)
_UNITS: tuple[str, ...] = ("unitstring", "unitsstring", "unitname", "unitlabel", "unitsymbol", "unitdescription")
_UNITS += ("niunitdescription", "engineeringunit", "engineeringunits", "engunit", "engunits", "eu", "uom", "einheit")
_UNITS += ("physicalunit", "physicalunits", "measurementunit", "channelunit", "dataunit", "yunit", "yunits")
_UNITS += ("yunitlabel", "unitofmeasure", "unitofmeasurement", "quantityunit")
_MOST_COEFFICIENTS = 32  # more are a table, and no scale
_CALENDARS = ("", "standard", "gregorian", "proleptic_gregorian")


def spelt(attributes: Attributes) -> dict[str, Any]:
    """Attributes by the names that the conventions give them; one that is spelt so already stands."""
    by = {_SPELT.get(key.replace("_", "").lower(), key): value for key, value in attributes.items()}
    return {**by, **{key: attributes[key] for key in _SPELT.values() if key in attributes}}


def unit_of(attributes: Attributes, at: int = 0, count: int = 1) -> str:
    """Unit of column `at` of `count` from `unit` or `units`, else from what other writers call it, in letters of any
    size. Raises ``ValueError`` for two.
    """
    for keys in (("unit", "units"), _UNITS):
        found = set()
        for key, value in attributes.items():
            if _letters(key) in keys:
                found.add(text(value.ravel()[at] if _is_each(value, count) else value))
        found.discard("")
        if len(found) > 1:
            raise ValueError(f"two units, got {' and '.join(map(repr, sorted(found)))}; one")
        if found:
            return found.pop()
    return ""


def of_field(attributes: Attributes, name: str, at: int, count: int) -> dict[str, Any]:
    """What attributes of a table of records say of field `at` of `count`: one entry of a list for each, `NAME_units`
    for it alone, and what marks a gap in any of them.
    """
    found = {}
    for key, value in attributes.items():
        if _is_each(value, count):
            found[key] = value.ravel()[at]
        elif own := _named_for(name, key):
            found[own] = value
        elif count == 1 or _SPELT.get(_letters(key)) in _MARKS[:2]:
            found[key] = value
    return found


def of_which_field(attributes: Attributes, names: Sequence[str]) -> str:
    """Why numbers of a record cannot be read beside one scale or range for all its fields; nothing where they can."""
    count = len(names)
    rest = {k: v for k, v in attributes.items() if not _is_each(v, count) and not any(_named_for(n, k) for n in names)}
    one = rest if count > 1 else {}
    scale = stated_scale(one)
    ranges = [key for key in one if _SPELT.get(_letters(key)) in _MARKS[2:]]
    said = ", ".join([scale] * bool(scale) + ranges)
    return f"records of {count} fields beside {said}, of which is not said; `scale`, `offset` of a profile say it" * (
        said != ""
    )


def _named_for(field: str, key: str) -> str:
    """What `F_units` or `units_F` says of the field F; nothing of another key."""
    match = re.fullmatch(rf"{re.escape(field)}[_. ](.+)|(.+)[_. ]{re.escape(field)}", key)
    return (match[1] or match[2]) if match else ""


def _letters(key: str) -> str:
    return re.sub(r"[^a-z]", "", key.lower())


def _is_each(value: Any, count: int) -> bool:
    """Whether an attribute has one entry for each of `count` columns."""
    return isinstance(value, np.ndarray) and value.size == count > 1


def decoded(
    raw: NDArray[Any], attributes: Attributes, fill: Any = None, place: tuple[int, int] = (0, 1)
) -> tuple[NDArray[Any], list[str]]:
    """Numbers that the packed ones stand for, gaps as NaN, and what is to be said of them.

    `fill` is what the file's own layer keeps where nothing was written; `place` is the number of a column of a matrix
    and how many there are, each of which may have a scale. Raises ``ValueError`` for attributes that are no numbers.
    Whole numbers without scale or gap stay whole.
    """
    attributes, notes = _marks(spelt(attributes))
    given = attributes
    raw, signed = _signed(raw, text(attributes.get("_Unsigned", "")).lower())
    gaps: dict[str, NDArray[np.bool_]] = {}
    for key, value in (("_FillValue", given.get("_FillValue")), ("missing_value", given.get("missing_value"))):
        if value is not None:
            gaps[key] = np.isin(raw, _of_type(value, raw, signed))
    if fill is not None and "_FillValue" not in gaps:
        gaps["fill value"] = np.isin(raw, _of_type(fill, raw, signed))
    if "flag_values" in given and "flag_meanings" in given and raw.dtype.kind in "iu":
        gaps["flag_values"] = np.isin(raw, _of_type(given["flag_values"], raw, signed))
    scale, offset = (_one(attributes, key, neutral, place) for key, neutral in zip(_PACKED, (1.0, 0.0), strict=True))
    if scale == 0.0:
        raise ValueError("attribute scale_factor: got 0; any other number")
    physical = raw if scale == 1.0 and offset == 0.0 else raw.astype(np.float64) * scale + offset
    for key, is_outside in _bounds(given, signed):
        packed = np.asarray(attributes[key]).dtype.kind != "f" or raw.dtype.kind == "f" or physical is raw
        bound = _as_packed(attributes[key], raw, signed) if packed else np.asarray(attributes[key]).ravel()
        gaps[key] = is_outside(raw if packed else physical, bound)
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
    return undefined(said)


def undefined(said: str, by: str = "no convention defines") -> str:
    """Why counts cannot be read beside a scale, in words, that nothing defines."""
    return f"whole numbers beside {said}, which {by}; `scale`, `offset` of a profile say it"


def not_applied(said: str) -> str:
    """What is to be said of numbers beside what looks like a scale, in words."""
    return f"{said} stands beside its numbers, and is not applied; `scale` of a profile does"


def stated_scale(attributes: Attributes) -> str:
    """A scale that attributes state, by the convention or not, in words; nothing where they state none."""
    packed = {key: number(value) for key, value in spelt(attributes).items() if key in _PACKED}
    said = ", ".join(f"{k} {v:g}" for k, v in packed.items() if v is not None and v != float(k == _PACKED[0]))
    return said or other_scales(attributes)


def other_scales(attributes: Attributes) -> str:
    """Attributes that look like a scale but belong to no convention, in words; nothing beside one that does."""
    if set(_PACKED) & spelt(attributes).keys():
        return ""
    found = {}
    for key, value in attributes.items():
        name = _letters(key)
        is_scale = any(word in name for word in _OTHER_SCALES) and not any(word in name for word in _NO_SCALES)
        is_scale = is_scale or _TERM.fullmatch(key) is not None
        if is_scale and (numbers := _all_numbers(value)) is not None and numbers.size <= _MOST_COEFFICIENTS:
            found[key] = numbers
    neutral = {key: float(not re.search(_NEUTRAL_AT_NOUGHT, key, re.IGNORECASE)) for key in found}
    return ", ".join(
        f"{key} {' '.join(f'{v:g}' for v in numbers)}"
        for key, numbers in found.items()
        if (numbers != neutral[key]).any()
    )


def beside(attributes: Attributes, dtype: np.dtype[Any]) -> str:
    """Attributes that may or may not be a scale, in words: beside whole numbers all whose meaning is not known."""
    found = {key: number(attributes[key]) for key in attributes if _letters(key) in _BESIDE}
    if dtype.kind in "iu":
        known = (*_NO_SCALES, *_OF_TIME)
        strange = [k for k in attributes if k.replace("_", "").lower() not in _SPELT]
        found |= {k: number(attributes[k]) for k in strange if not any(word in _letters(k) for word in known)}
    said = [f"{k} {v:g}" for k, v in found.items() if v is not None and v != 1.0]
    return ", ".join(said + [f"{k} {text(v)!r}" for k, v in attributes.items() if "prefix" in _letters(k) and text(v)])


def with_gaps(values: NDArray[np.float64], attributes: Attributes) -> tuple[NDArray[np.float64], list[str]]:
    """Numbers with NaN where attributes mark a gap, and their count. Raises ``ValueError`` for marks that are none."""
    return decoded(values, {key: value for key, value in spelt(attributes).items() if key in _MARKS})


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


def _one(attributes: Attributes, key: str, neutral: float, place: tuple[int, int]) -> float:
    if key not in attributes:
        return neutral
    value = attributes[key]
    found = number(value.ravel()[place[0]] if _is_each(value, place[1]) else value)
    if found is None or not np.isfinite(found):
        raise ValueError(f"attribute {key}: not one number, got {attributes[key]!r}")
    return found


def _marks(attributes: dict[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """Attributes with those of gaps as numbers, also where they are written as text, and what is none of them."""
    found, notes = dict(attributes), []
    for key in (key for key in (*_MARKS, "flag_values") if key in attributes):
        if np.asarray(attributes[key]).dtype.kind in "OSU":
            if (numbers := _all_numbers(attributes[key])) is not None:
                found[key] = numbers
            else:
                notes.append(f"{key} {text(found.pop(key))!r} is no number, and marks no gap")
    return found, notes


def _all_numbers(value: Any) -> NDArray[np.float64] | None:
    """One number or several of an attribute, of text `2, 5` too; None where it is anything else."""
    if isinstance(value, (bool, np.bool_)):
        return None
    array = np.asarray(value)
    if array.dtype.kind in "iuf":
        return array.astype(np.float64).ravel()
    words = re.split(r"[,;\s]+", text(value)) if array.size == 1 else [text(each) for each in array.ravel()]
    found = [number(word) if word else None for word in words]
    return None if None in found or not found else np.array(found, dtype=np.float64)
