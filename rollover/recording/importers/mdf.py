"""MDF 3 and 4 of vehicle loggers: channels by name, `F (group 1)` where groups share it, each group with its clock."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from rollover.recording import Recording
from rollover.recording.importers.apart import apart
from rollover.recording.importers.columns import is_wanted, matrix, no_numbers, unique
from rollover.recording.importers.importer import Importer, check_library, library, reading, starts_with
from rollover.recording.importers.mdf_conversions import converted
from rollover.recording.importers.sidecar import Described
from rollover.recording.importers.signals import Signal, assemble, left_out
from rollover.spec.channels import factor
from rollover.system.boundary import worded
from rollover.system.budget import Budget

_RUNS_OVER = {2: "angle", 3: "distance", 4: "an index"}  # what a group's master may be instead of time

_ALL_INVALID = 1  # flag of a channel of MDF 4, beside or instead of a bit for each sample


def _read(path: Path, profile: Described | None) -> Recording:
    check_library("asammdf", "mdf", path)
    return assemble(path, apart(_all, path, profile, what="MDF", modules=("asammdf",)), profile)


def _all(path: Path, profile: Described | None) -> dict[str, Signal]:
    asammdf = library("asammdf", "mdf", path)
    signals: dict[str, Signal] = {}
    with reading(path, "MDF"), asammdf.MDF(str(path)) as file:
        claimed = Budget(path)
        for group in file.groups:
            claimed.claim(_claim(group), _title(group))
        places = [
            (g, c, str(channel.name))
            for g, group in enumerate(file.groups)
            for c, channel in enumerate(group.channels)
            if file.masters_db.get(g) != c
        ]
        titles = [_title(file.groups[g]) for g in range(len(file.groups))]
        groups = [t if t and titles.count(t) == 1 else str(g) for g, t in enumerate(titles)]
        names = unique([name for _, _, name in places], [groups[g] for g, _, _ in places])
        columns = {} if profile is None else profile.columns
        clocks = {
            g: n for (g, _, _), n in zip(places, names, strict=True) if n in columns and columns[n].channel == "time"
        }
        for (g, c, base), name in zip(places, names, strict=True):
            if not is_wanted(profile, name, channel=base, shared=base) and not _is_part(profile, name):
                signals[name] = Signal(values=np.empty(0), channel=base, shared=base)
                continue
            for column, signal in _signals(file, g, c, name).items():
                about = base if column == name else ""
                signals[column] = replace(signal, channel=about, shared=about, clock=clocks.get(g, ""))
    return signals


def _claim(group: Any) -> int:
    """Bytes of a group: its records as they are, and each channel and its stamps as numbers."""
    about = group.channel_group
    record = int(getattr(about, "samples_byte_nr", 0)) + int(getattr(about, "invalidation_bytes_nr", 0))
    return int(about.cycles_nr) * (record + 8 * len(group.channels))


def _is_part(profile: Described | None, name: str) -> bool:
    return profile is not None and any(column.startswith(f"{name}[") for column in profile.columns)


def _title(group: Any) -> str:
    return str(getattr(group.channel_group, "acq_name", "") or "").strip()


def _signals(file: Any, group: int, index: int, name: str) -> dict[str, Signal]:
    channel = file.groups[group].channels[index]
    if not file.groups[group].channel_group.cycles_nr:
        return {name: left_out("empty")}
    got = file.get(group=group, index=index, raw=True, ignore_invalidation_bits=True)
    raw = np.asarray(got.samples)
    if raw.dtype.names is not None and raw[raw.dtype.names[0]].ndim > 1:  # an array with its axes
        raw = raw[raw.dtype.names[0]]
    if reason := no_numbers(raw.dtype):
        return {name: left_out("a structure, each of its parts by its own name" if reason == "records" else reason)}
    columns = matrix(name, raw.shape, along=0)
    if not columns:
        return {name: left_out(f"an array {raw.shape}")}
    time, over = _time(file, group, np.asarray(got.timestamps, dtype=np.float64))
    if over:
        return {name: Signal(values=np.empty(0), unreadable=f"its group runs over {over}, not over time")}
    invalid = got.invalidation_bits
    found = {}
    for column, at in columns.items():
        try:
            found[column] = _signal(raw[at], None if invalid is None else np.asarray(invalid), channel, file.version)
        except ValueError as e:
            found[column] = left_out(str(e)) if str(e) in _TEXT else Signal(values=np.empty(0), unreadable=str(e))
        except (KeyError, AttributeError, TypeError) as e:  # of a conversion block that lacks what its type needs
            found[column] = Signal(values=np.empty(0), unreadable=f"its conversion cannot be applied: {worded(e)}")
        found[column] = replace(found[column], time=time)
    return found


_TEXT = ("numbers made of text", "text", "text of bits")


def _signal(raw: Any, invalid: Any, channel: Any, version: str) -> Signal:
    if version >= "4" and int(getattr(channel, "flags", 0) or 0) & _ALL_INVALID:
        return left_out("all invalid")
    physical = converted(raw, channel.conversion, version)
    values, notes = physical.values, []
    if physical.texts:
        each = ", ".join(f"{count} {text!r}" for text, count in physical.texts.most_common(6))
        if physical.texts.total() == values.size:
            return left_out(f"text: {each}")
        notes.append(f"{physical.texts.total()} of {values.size} values are text, left as gaps: {each}")
    if invalid is not None and invalid.any():
        if invalid.all():
            return left_out("all invalid")
        values = np.where(invalid, np.nan, values)
        notes.append(f"{int(invalid.sum())} of {values.size} values are invalid, left as gaps")
    if len(physical.units) > 1:
        each = " and ".join(sorted(physical.units))
        raise ValueError(f"parts of its conversion are in different units, got {each}; one")
    unit = str(channel.unit or "").strip() or next(iter(physical.units), "")
    return Signal(values=values, unit=unit, notes=tuple(notes))


def _time(file: Any, group: int, stamps: Any) -> tuple[Any, str]:
    """Stamps of a group in s, None where it has no master; and what it runs over where that is not time."""
    at = file.masters_db.get(group)
    if at is None:
        return None, ""  # asammdf counts samples there
    master = file.groups[group].channels[at]
    unit = str(master.unit or "").strip() or "s"
    over = _RUNS_OVER.get(int(getattr(master, "sync_type", 0) or 0), "")
    try:
        return stamps * factor(unit, "time"), over  # seconds by the format, and some write others
    except ValueError:
        return stamps, over or f"a time in {unit!r}"


MDF = Importer(
    name="mdf",
    meaning="MDF 3 and 4 of vehicle loggers",
    sniff=lambda path: starts_with(path, b"MDF     ", b"UnFinMF "),
    read=_read,
)
