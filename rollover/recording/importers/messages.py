"""Messages to columns: `topic.field`, `topic.effort.0` of an array, `topic.header.stamp`; each value by its message."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.recording.importers import stamps
from rollover.recording.importers.sidecar import DATE_TIME, Described
from rollover.recording.importers.signals import Signal, left_out
from rollover.system.budget import Budget
from rollover.system.errors import InputError

_LONGEST = 256  # entries of an array that become columns unasked: joints and wheels are fewer, scans and images more
_COUNTED = 1000  # values after which their sum is looked at
_TURNS = 1000  # of publishers of a topic that are kept in mind
_IN_LIST = 40  # bytes that a value takes: a Python number, its place in two lists
_NAMES = ("name", "names", "joint_names")  # whose entries say of which part the entries of the arrays beside are
_SECONDS, _NANOSECONDS = ("sec", "secs"), ("nanosec", "nanosecs", "nsec", "nsecs")


class _NoNumber(str):
    """Why a field is no number."""


_NO_DATA = _NoNumber("no data, by its covariance of -1")


@dataclass(frozen=True)
class _Instant:
    """A stamp in a message, ns."""

    nanoseconds: int


@dataclass
class _Column:
    """Values of one field: at which messages of its topic, and the texts among them."""

    at: list[int] = field(default_factory=list)
    values: list[float] = field(default_factory=list)
    texts: Counter[str] = field(default_factory=Counter)
    reason: str | None = None  # why it is no number, as long as it never was one


class Messages:
    """Collects the fields that are to be read, and the names of all others."""

    def __init__(self, path: Path, profile: Described | None) -> None:
        columns = {} if profile is None else profile.columns
        self._path, self._profile = path, profile
        self._wanted = set(columns)
        self._on_the_way = {name[:at] for name in columns for at, char in enumerate(name) if char == "."}
        self._times = [name for name, column in columns.items() if column.channel == "time"]
        self._columns: dict[str, _Column] = {}
        self._instants: dict[str, list[Any]] = {}  # of each field that a profile takes for time, one a message
        self._logged: dict[str, list[int]] = {}
        self._stamps_in: dict[str, str] = {}  # topic -> the first of its fields that is a stamp
        self._topic_of: dict[str, str] = {}
        self._owners: dict[str, str] = {}  # entry of an array -> what the names beside it say that it is of
        self._reordered: dict[str, str] = {}  # the same -> what it is of later on
        self._sources: dict[str, list[tuple[int, str]]] = {}  # topic -> whose its messages are, in the order of turns
        self._count = 0
        self._claimed = Budget(path)

    def add(self, topic: str, logged: int, message: Any, source: int = 0) -> None:
        """A message, when it was logged, ns, and which of the topic's channels it came by. Raises `InputError`."""
        turns = self._sources.setdefault(topic, [])
        turn = source, _frame(message)
        if turn not in turns[-1:] and len(turns) < _TURNS:
            turns.append(turn)
        number = len(self._logged.setdefault(topic, []))
        self._logged[topic].append(logged)
        for name in self._times:
            if name.startswith(f"{topic}."):
                self._instants.setdefault(name, []).append(None)
                self._topic_of[name] = topic
        for name, value in self._leaves(topic, message):
            if isinstance(value, _Instant):
                self._stamps_in.setdefault(topic, name)
            if name in self._instants:
                self._instants[name][-1] = value
                continue
            self._topic_of.setdefault(name, topic)
            column = self._columns.setdefault(name, _Column())
            if not self._keep(column, name, value, number):
                continue
            self._count += 1
            if self._count % _COUNTED == 0:
                self._claimed.claim(_COUNTED * _IN_LIST, name)

    def signals(self) -> dict[str, Signal]:
        """Columns by name. Raises `InputError` where a message lacks the stamp that a profile goes by."""
        clocks: dict[str, str] = {}
        for name in self._instants:
            first = clocks.setdefault(self._topic_of[name], name)
            if first != name and self._profile is not None:
                raise self._profile.refuse(name, f"a second column of time for the same messages, first {first!r}; one")
        found = {name: self._clock(name, values) for name, values in self._instants.items()}
        ticks: dict[str, tuple[NDArray[np.float64], int]] = {}
        for name, column in self._columns.items():
            topic = self._topic_of[name]
            if column.reason:
                found[name] = left_out(column.reason)
                continue
            if not column.at:
                found[name] = Signal(values=np.empty(0))
                continue
            if name in self._reordered:
                both = f"{self._owners[name]!r}, then of {self._reordered[name]!r}"
                what = f"its array changes its order, got first the entry of {both}"
                cure = f"{name.rpartition('.')[0]}.{self._owners[name]}: by its name"
                found[name] = Signal(values=np.empty(0), unreadable=f"{what}; {cure}")
                continue
            turns = self._sources[topic]
            if len(turns) > len(set(turns)):  # a recorder that began anew takes one turn after the other
                who = _said_of(turns)
                found[name] = Signal(values=np.empty(0), unreadable=f"its topic has messages of {who}, got {topic}")
                continue
            values = np.array(column.values, dtype=np.float64)
            if np.isnan(values).all():
                found[name] = left_out("all gaps")
                continue
            each = ", ".join(f"{n} {text!r}" for text, n in column.texts.most_common(6))
            total = column.texts.total()
            notes = (f"{total} of {values.size} values are text, left as gaps: {each}",) if total else ()
            if topic in clocks:  # one value a message, as its stamps
                full = np.full(len(self._logged[topic]), np.nan)
                full[column.at] = values
                found[name] = Signal(values=full, clock=clocks[topic], notes=notes)
                continue
            if topic not in ticks:
                ticks[topic] = stamps.seconds_from_first(np.array(self._logged[topic], dtype=np.int64), 1)
            time, began = ticks[topic]
            time = time if len(column.at) == time.size else time[column.at]
            other = self._stamps_in.get(topic, "")
            found[name] = Signal(values=values, time=time, began=began, clock=other, notes=notes)
        return found

    def _keep(self, column: _Column, name: str, value: Any, number: int) -> bool:
        """Put a value into its column, if that is to be read, and keep in mind why it is no number."""
        is_text = isinstance(value, str)
        reason = value if isinstance(value, _NoNumber) else "text" if is_text else "no value" if value is None else ""
        column.reason = reason if column.reason is None else column.reason and reason
        if name not in self._wanted:
            return False
        if is_text:
            column.texts[value[:40]] += 1
        column.at.append(number)
        column.values.append(float("nan") if reason or isinstance(value, _Instant) else float(value))
        return True

    def _clock(self, name: str, values: list[Any]) -> Signal:
        """A column of time out of stamps, of dates as text, or of numbers in the unit that the profile says."""
        missing = next((k for k, value in enumerate(values) if value is None), None)
        if missing is not None:
            message = f"message {missing} of {self._topic_of[name]} has none; a stamp in every message"
            raise self._refuse(name, message)
        if all(isinstance(value, _Instant) for value in values):
            counts = [value.nanoseconds for value in values]
        elif self._is_count(name) and all(isinstance(v, str) and re.fullmatch(r"-?\d+", v) for v in values):
            return Signal(values=np.array([int(v) for v in values]))  # JSON has no whole numbers of 64 bits
        elif all(isinstance(value, str) for value in values):
            try:
                counts = [stamps.instant(value) for value in values]
            except ValueError as e:
                raise self._refuse(name, str(e)) from None
        elif any(isinstance(value, (str, _Instant)) for value in values):
            raise self._refuse(name, "numbers beside text; one kind of stamp")
        else:
            return Signal(values=np.array(values))
        seconds, began = stamps.seconds_from_first(np.array(counts, dtype=np.int64), 1)
        if began < stamps.CALENDAR * stamps.NANO:  # a simulator's clock has its own zero
            return Signal(values=seconds + began / stamps.NANO, unit="s")
        return Signal(values=seconds, unit="s", began=began)

    def _is_count(self, name: str) -> bool:
        """Whether a profile says in which unit a column of time counts."""
        return self._profile is not None and self._profile.columns[name].unit not in (None, DATE_TIME)

    def _refuse(self, name: str, message: str) -> InputError:
        assert self._profile is not None
        return self._profile.refuse(name, message)

    def _leaves(self, name: str, value: Any) -> Iterator[tuple[str, Any]]:
        """Numbers, stamps and texts of a message by dotted name; what cannot be a column as its reason."""
        if isinstance(value, (bool, np.bool_)):
            yield name, _NoNumber("true or false")
        elif isinstance(value, (bytes, bytearray)):
            yield name, _NoNumber("bytes")
        elif value is None or isinstance(value, (str, int, float)):
            yield name, value
        elif isinstance(value, np.number):
            yield name, value.item()
        elif isinstance(value, (list, tuple, np.ndarray)):
            yield from self._entries(name, value)
        else:
            parts = value if isinstance(value, Mapping) else _parts(value)
            if (instant := _instant(parts)) is not None:
                yield name, instant
                return
            owners: Sequence[str] = next((parts[key] for key in _NAMES if _are_names(parts.get(key))), ())
            for key, part in parts.items():
                inner = f"{name}.{key}"
                if _is_without_data(parts.get(f"{key}_covariance")):
                    yield from ((leaf, _NO_DATA) for leaf, _ in self._leaves(inner, part))
                elif owners and key not in _NAMES and _is_array(part) and len(part) == len(owners):
                    yield from self._owned(inner, part, owners)
                else:
                    yield from self._leaves(inner, part)

    def _owned(self, name: str, values: Any, owners: Sequence[str]) -> Iterator[tuple[str, Any]]:
        """Entries of an array whose order is that of names: by the name where a profile asks for it, else by place."""
        for k, (value, owner) in enumerate(zip(values, owners, strict=True)):
            if f"{name}.{owner}" in self._wanted:
                yield from self._leaves(f"{name}.{owner}", value)
                continue
            inner = f"{name}.{k}"
            if self._owners.setdefault(inner, owner) != owner:
                self._reordered.setdefault(inner, owner)
            yield from self._leaves(inner, value)

    def _entries(self, name: str, values: Any) -> Iterator[tuple[str, Any]]:
        if len(values) > _LONGEST and name not in self._on_the_way:
            yield name, _NoNumber(f"an array of {len(values)}, whose entries a profile may name: {name}.0")
            return
        for k, value in enumerate(values):
            inner = f"{name}.{k}"
            if len(values) <= _LONGEST or inner in self._wanted or inner in self._on_the_way:
                yield from self._leaves(inner, value)


def _frame(message: Any) -> str:
    """In whose axes a message is: `header.frame_id`, which tells sensors apart that publish to one topic."""
    header = (message if isinstance(message, Mapping) else _parts(message)).get("header", {})
    frame = (header if isinstance(header, Mapping) else _parts(header)).get("frame_id", "")
    return frame if isinstance(frame, str) else ""


def _said_of(turns: Sequence[tuple[int, str]]) -> str:
    """Publishers or frames that take turns, in words."""
    frames = sorted({frame for _, frame in turns})
    if len(frames) > 1:
        return f"{len(frames)} frames in turn ({', '.join(map(repr, frames[:4]))})"
    return f"{len(set(turns))} publishers at the same time"


def _is_without_data(covariance: Any) -> bool:
    """Whether a covariance says by -1 that nothing was measured, as the comments of sensor_msgs/Imu have it."""
    return (
        _is_array(covariance) and len(covariance) > 0 and not isinstance(covariance[0], str) and covariance[0] == -1.0
    )


def _is_array(value: Any) -> bool:
    return isinstance(value, (list, tuple, np.ndarray)) and len(value) <= _LONGEST


def _are_names(value: Any) -> bool:
    """Whether these are texts that differ, one for each entry of the arrays beside them."""
    return _is_array(value) and all(isinstance(v, str) for v in value) and 0 < len(set(value)) == len(value)


def _parts(value: Any) -> dict[str, Any]:
    if not is_dataclass(value):
        return {}
    return {f.name: getattr(value, f.name) for f in fields(value) if f.name != "__msgtype__"}


def _instant(parts: Mapping[str, Any]) -> _Instant | None:
    """A stamp of seconds and nanoseconds, as ROS 1, ROS 2 and their bridges to JSON spell it."""
    whole = next((parts[key] for key in _SECONDS if key in parts), None)
    rest = next((parts[key] for key in _NANOSECONDS if key in parts), None)
    is_stamp = len(parts) == 2 and all(isinstance(v, int) and not isinstance(v, bool) for v in (whole, rest))
    return _Instant(whole * stamps.NANO + rest) if is_stamp else None  # type: ignore[operator]
