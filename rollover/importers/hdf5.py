"""HDF5, netCDF 4 and MATLAB 7.3: columns by their path, `path[1]` of a matrix, `table.field` of records."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from rollover.importers import cf
from rollover.importers.columns import channel_of, is_wanted, matrix, no_numbers
from rollover.importers.hdf5_contents import Array, contents
from rollover.importers.importer import Importer, check_claim, library, reading, starts_with
from rollover.importers.sidecar import Described
from rollover.importers.signals import Signal, assemble, left_out
from rollover.importers.steps import even_stamps
from rollover.recording import Recording

_MATLAB_7_3 = (b"MATLAB 7.3", b"\x89HDF\r\n\x1a\n")


def _read(path: Path, profile: Described | None) -> Recording:
    h5py = library("h5py", "hdf5", path)
    signals: dict[str, Signal] = {}
    with reading(path, "HDF5"), h5py.File(path, "r") as file:
        for name, thing in contents(h5py, file, () if profile is None else tuple(profile.columns)).items():
            if isinstance(thing, str):
                signals[name] = left_out(thing)
                continue
            reason = thing.reason or no_numbers(thing.dtype)
            columns = {} if reason else matrix(name, thing.shape, along=_axis_of_time(thing))
            if reason or not columns or 0 in thing.shape:
                signals[name] = left_out(reason or ("empty" if 0 in thing.shape else f"an array {thing.shape}"))
                continue
            for at, (column, index) in enumerate(columns.items()):
                channel = channel_of(column)
                if is_wanted(profile, column, channel=channel):
                    check_claim(path, int(np.prod(thing.shape, dtype=object)))
                    signals[column] = _signal(thing, index, at, len(columns), profile, column)
                signals[column] = replace(signals.get(column, Signal(values=np.empty(0))), channel=channel)
    return assemble(path, signals, profile)


def _axis_of_time(thing: Array) -> int | None:
    """The axis along which samples run, where a coordinate of time or MATLAB's order of storage says so."""
    of_time = [axis for axis, scale in thing.scales.items() if _stamps_of(scale) is not None]
    if of_time:
        return of_time[0]
    long = [axis for axis, length in enumerate(thing.shape) if length != 1]
    equal = len(long) == 2 and thing.shape[long[0]] == thing.shape[long[1]]
    return long[1] if equal and "MATLAB_class" in thing.attributes else None


def _stamps_of(scale: Any) -> tuple[np.ndarray[Any, Any], int | None] | None:
    """Stamps of a dimension's coordinate in s, and the instant that they count from, if it is one of time."""
    attributes = {key: scale.attrs[key] for key in scale.attrs if key not in ("REFERENCE_LIST", "DIMENSION_LIST")}
    if scale.dtype.kind not in "fiu" or scale.ndim != 1:
        return None
    if (since := cf.time_of(scale[()], attributes)) is not None:
        return since
    unit = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}.get(cf.unit_of(attributes))
    return None if unit is None else (cf.decoded(scale[()], attributes)[0] * unit, None)


def _signal(thing: Array, index: Any, at: int, count: int, profile: Described | None, name: str) -> Signal:
    try:
        given = None if profile is None else profile.columns.get(name)
        states_scale = given is not None and (given.scale != 1.0 or given.offset != 0.0)
        unknown = "" if states_scale else cf.unknown_scale(thing.attributes, thing.dtype)
        values, notes = cf.decoded(np.asarray(thing.load(index)), thing.attributes, thing.fill)
        unit = cf.unit_of(thing.attributes, at, count)
        since = cf.time_of(values, thing.attributes)
        if since is not None:
            return Signal(values=since[0], unit="s", began=since[1])
        if not (given.channel if given is not None else channel_of(name)) == "time":
            values = values.astype(np.float64)
        scale = next((s for a, s in thing.scales.items() if index[a] == slice(None)), None)
        time, began = (None if scale is None else _stamps_of(scale)) or even_stamps(thing.around, values.size)
    except ValueError as e:
        return Signal(values=np.empty(0), unreadable=str(e))
    return Signal(values=values, unit=unit, time=time, began=began, unreadable=unknown, notes=tuple(notes))


HDF5 = Importer(
    name="hdf5",
    meaning="HDF5, netCDF 4, and MATLAB 7.3",
    sniff=lambda path: starts_with(path, *_MATLAB_7_3),
    read=_read,
)
