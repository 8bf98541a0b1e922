"""What stands beside a table of numbers: the sidecar of a recording, and the profile of a foreign file."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from ground.quantity import Quantity, parameters
from rollover.recording import Clock, Sensor, StandardUncertainty
from rollover.recording.importers.conditions import ByFile, ConditionsFrom, read_by_file
from rollover.recording.record import CFC
from rollover.recording.text_rows import WHITESPACE
from rollover.spec import document
from rollover.spec.channels import describe, factor
from rollover.spec.document import Node
from rollover.system.boundary import worded
from rollover.system.errors import Fault, InputError

MOST_BYTES = 1 << 18  # of a sidecar: what is longer is no sidecar, and would take long to be refused
DATE_TIME = "date-time"  # as a unit: the cells of a column of time are dates, times of day or both
T = TypeVar("T")
_DEEP = re.compile(rb"(?:[\[{]\s*){60}")  # the parser needs seconds to give up on brackets in brackets


@parameters
class Column:
    """What one column of a file is: its number times `scale` plus `offset` is the channel's value in `unit`."""

    channel: Annotated[str, "see `rollover list channels`"]
    unit: Annotated[str | None, "of the column; a profile may leave it to a file that says so itself"] = None
    noise: Annotated[float | None, Quantity("", "1 sigma, in the unit", least=0)] = None
    cfc: Annotated[CFC | None, "filter class already applied"] = None
    sensor: Annotated[Sensor | None, "where it was measured"] = None
    scale: Annotated[float, Quantity("1", "factor on the file's numbers")] = 1.0
    offset: Annotated[float, Quantity("", "added after the factor, in the unit")] = 0.0
    rest: Annotated[tuple[str, ...], "of a time: columns with the rest of the stamp, a time of day or a fraction"] = ()
    rest_unit: Annotated[Literal["s", "ms", "us", "ns"] | None, "of the last of them, if it is a fraction"] = None

    @property
    def is_stamp(self) -> bool:
        """Whether this is a time that has to be put together: a date-time, or whole seconds and a fraction."""
        return self.unit == DATE_TIME or bool(self.rest)

    def validate(self) -> None:
        """Refuse what is no channel, a unit of another dimension, and an instrument without a place."""
        if self.is_stamp and self.channel != "time":
            what = "rest" if self.rest else "unit"
            raise ValueError(f"{what}: of channel time alone, got channel {self.channel}; leave it out")
        if self.rest_unit and not self.rest:
            raise ValueError("rest_unit: without rest; the column of the fraction is needed, rest: [NAME]")
        if self.rest and self.unit not in (DATE_TIME, "s"):
            raise ValueError(f"unit: not of a stamp in several columns, got {self.unit!r}; {DATE_TIME} or s")
        if self.rest and self.unit == "s" and (len(self.rest) > 1 or self.rest_unit is None):
            raise ValueError("rest_unit: missing; whole seconds and one column with the fraction in s, ms, us or ns")
        try:
            describe(self.channel)
        except ValueError as e:
            raise ValueError(f"channel: {e}") from None
        if self.unit not in (None, DATE_TIME):
            try:
                factor(self.unit, self.channel)
            except ValueError as e:
                raise ValueError(f"unit: {e}") from None
        if self.channel.startswith("sensor/") and self.sensor is None:
            raise ValueError(
                f"sensor: missing for {self.channel}; a mapping (body, position, orientation_deg, gravity)"
            )


@parameters
class Csv:
    """How a CSV file is written."""

    delimiter: Annotated[str, "one character, or whitespace: any number of blanks and tabs"] = ","
    decimal: Literal[".", ","] = "."
    encoding: Annotated[str, "such as utf-8, cp1252, iso-8859-1, utf-16"] = "utf-8"
    names_row: Annotated[
        int | None,
        "which row holds the names, blank lines and comments do not count; 0: none does, columns are 1, 2, ...; "
        "of a workbook the number of its row; "
        "left out: the first, or none if that holds nothing but numbers",
    ] = None
    units_row: Annotated[int | None, "which row holds the units, below the names"] = None
    data_row: Annotated[int | None, "which row is the first of numbers; else the one after names and units"] = None
    comment: Annotated[str, "what a comment line begins with"] = "#"
    gaps: Annotated[tuple[str, ...], "cells that hold no value, such as 'OVER' or '-9999', beside empty ones"] = ()

    def validate(self) -> None:
        """Refuse rows out of order, a delimiter of several characters and an encoding that Python does not know."""
        import codecs

        one = len(self.delimiter) == 1 and self.delimiter.isascii() and self.delimiter != self.decimal
        if not one and self.delimiter != WHITESPACE:
            message = f"got {self.delimiter!r}; one character, not the decimal mark, or {WHITESPACE}"
            raise ValueError(f"delimiter: {message}")
        try:
            codecs.lookup(self.encoding)
        except (LookupError, ValueError):  # the second of a name with a null character
            raise ValueError(f"encoding: unknown, got {self.encoding!r}; such as utf-8, cp1252, utf-16") from None
        names = 1 if self.names_row is None else self.names_row
        if names < 0:
            raise ValueError(f"names_row: got {names}; 1 or more, or 0 where no row holds names")
        if self.units_row is not None and self.units_row <= names:
            raise ValueError(f"units_row: not below the names, got {self.units_row}; after row {names}")
        if self.data_row is not None and self.data_row <= (self.units_row or names):
            raise ValueError(f"data_row: not below names and units, got {self.data_row}; a later row")


@parameters
class Sidecar:
    """`NAME.yaml` of a recording."""

    format: Literal["rollover-recording/1"]
    title: str = ""
    source: Annotated[str, "who measured it, licence, citation"] = ""
    conditions: Annotated[Mapping[str, Any], "scenario path -> value this was run with"] = field(default_factory=dict)
    uncertainty: Annotated[Mapping[str, Any], "scenario path -> 1 sigma, a list's of each number"] = field(
        default_factory=dict
    )
    clock: Clock = field(default_factory=Clock)
    notes: tuple[str, ...] = ()
    channels: Annotated[Mapping[str, Any], "column -> what it is"]

    def validate(self) -> None:
        """Refuse an uncertainty that is none."""
        uncertainties_of(self.uncertainty)


@parameters
class Profile:
    """What a foreign file's columns are; one profile serves all files that an instrument writes."""

    format: Literal["rollover-profile/1"]
    title: str = ""
    source: Annotated[str, "who measured it, licence, citation"] = ""
    conditions: Annotated[Mapping[str, Any], "scenario path -> value this was run with"] = field(default_factory=dict)
    conditions_from: Annotated[ConditionsFrom | None, "of each file its own, by its name or a table"] = None
    uncertainty: Annotated[Mapping[str, Any], "scenario path -> 1 sigma, a list's of each number"] = field(
        default_factory=dict
    )
    clock: Clock = field(default_factory=Clock)
    notes: tuple[str, ...] = ()
    csv: Csv = field(default_factory=Csv)
    rate: Annotated[float | None, Quantity("Hz", "where the file has no time column", above=0)] = None
    start: Annotated[float, Quantity("s", "time of the first sample, with `rate`")] = 0.0
    channels: Annotated[Mapping[str, Any], "column -> what it is"]

    def validate(self) -> None:
        """Refuse an uncertainty that is none."""
        uncertainties_of(self.uncertainty)


def schema(kind: type[Sidecar] | type[Profile], title: str) -> dict[str, Any]:
    """JSON Schema of a recording's sidecar or of a profile."""
    return document.schema(kind, title, entries={"channels": Column})


def uncertainties_of(uncertainty: Mapping[str, Any]) -> dict[str, StandardUncertainty]:
    """Standard deviation by scenario path. Raises ``ValueError`` for what is none."""
    found: dict[str, StandardUncertainty] = {}
    for path, given in uncertainty.items():
        numbers = tuple(given) if isinstance(given, (list, tuple)) else (given,)
        for value in numbers:
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 < value < math.inf:
                message = f"not one standard deviation, got {value!r}; a number above 0, or a list of such, is allowed"
                raise ValueError(f"uncertainty.{path}: {message}")
        found[path] = numbers if isinstance(given, (list, tuple)) else given
    return found


@dataclass(frozen=True, kw_only=True)
class Described:
    """A sidecar or profile with its columns, and the lines on which they stand, for messages."""

    file: str
    about: Sidecar | Profile
    columns: Mapping[str, Column]
    lines: Mapping[str, int | None]
    by_file: ByFile | None = None
    stated: frozenset[str] = frozenset()  # which of its keys the file itself gives
    scaled: frozenset[str] = frozenset()  # columns of which it says the scale or the offset, be they 1 and 0

    def of(self, path: Path) -> Described:
        """This with the conditions of one file. Raises `InputError` where it has none of its own but should."""
        if self.by_file is None:
            return self
        conditions = {**self.about.conditions, **self.by_file.of(path)}
        return replace(self, about=replace(self.about, conditions=conditions), by_file=None)

    def refuse(self, column: str, message: str) -> InputError:
        """A fault at a column's description."""
        return InputError(
            Fault(file=self.file, line=self.lines.get(column), path=f"channels.{column}", message=message)
        )


def read_described(path: Path, kind: type[Sidecar] | type[Profile]) -> Described:
    """Read a sidecar or a profile. Raises `InputError` with all faults, each with its line."""
    try:
        size = path.stat().st_size
    except (OSError, RuntimeError) as e:
        raise InputError(
            Fault(file=str(path), message=f"cannot be read: {worded(e)}; a file that may be read is needed")
        ) from None
    _check_text(path, size, path.read_bytes() if 0 < size <= MOST_BYTES else b"")
    return _described(path, document.read(path), kind)


def described_inside(path: Path, text: str) -> Described:
    """What a file says by the sidecar that it holds itself. Raises `InputError` with all faults, each with its line."""
    _check_text(path, len(text.encode()), text.encode())
    start = document.Place(file=document.shown(path), line=1, folder=path.parent)
    return _described(path, document.parse(text, start), Sidecar)


def _check_text(path: Path, size: int, data: bytes) -> None:
    """Refuse what is no sidecar by its length, or would take long to be refused. Raises `InputError`."""
    if size > MOST_BYTES:
        raise InputError(Fault(file=str(path), message=f"too long, got {size} bytes; at most {MOST_BYTES} are allowed"))
    if deep := _DEEP.search(data):
        line = data[: deep.start()].count(b"\n") + 1
        raise InputError(Fault(file=str(path), line=line, message="nested too deeply; a few levels are needed"))


def _described(path: Path, root: Node, kind: type[Sidecar] | type[Profile]) -> Described:
    if not isinstance(root.value, Mapping):
        raise root.place.fault("", f"not a mapping, got {root.in_short}; format, channels are needed")
    faults: list[Fault] = []
    about = _checked(root, kind, "", faults)
    for path_, child in _conditions(root):
        if isinstance(child.value, Mapping):
            faults += child.place.fault(f"conditions.{path_}", "not a value, got a mapping; write a.b: 1").faults
    columns: dict[str, Column] = {}
    lines: dict[str, int | None] = {}
    scaled: set[str] = set()
    first: dict[str, str] = {}
    entries = root.value.get("channels")
    for name, node in entries.value.items() if entries and isinstance(entries.value, Mapping) else ():
        column = _checked(node, Column, f"channels.{name}", faults)
        if column is None:
            continue
        columns[name], lines[name] = column, node.key.line
        if isinstance(node.value, Mapping) and {"scale", "offset"} & node.value.keys():
            scaled.add(name)
        if column.channel in first and kind is Sidecar:  # a profile's columns may be stretches of one channel
            what = f"second column of {column.channel}, first {first[column.channel]!r}; one column a channel"
            faults += node.key.fault(f"channels.{name}", what).faults
        first.setdefault(column.channel, name)
        if kind is Sidecar and column.is_stamp:
            what = "date-times and stamps in several columns are read with a profile, not a sidecar; seconds here"
            faults += node.key.fault(f"channels.{name}", f"unit: {what}").faults
        if kind is Sidecar and column.unit is None:
            faults += node.key.fault(f"channels.{name}", "unit: missing; the column's unit is needed").faults
    if faults:
        raise InputError(*faults)
    assert about is not None
    if not columns:
        raise root.place.fault("channels", "empty; at least time and one channel are needed")
    wanted = about.conditions_from if isinstance(about, Profile) else None
    by_file = None
    if wanted is not None and isinstance(about, Profile):
        by_file = read_by_file(wanted, root, path, about.csv.decimal)
    return Described(
        file=str(path),
        about=about,
        columns=columns,
        lines=lines,
        by_file=by_file,
        stated=frozenset(root.value),
        scaled=frozenset(scaled),
    )


def _checked(node: Node, kind: type[T], path: str, faults: list[Fault]) -> T | None:
    try:
        found: T = document.check(node, kind)
    except InputError as e:
        faults += [replace(f, path=".".join(p for p in (path, f.path) if p)) for f in e.faults]
        return None
    return found


def _conditions(root: Node) -> list[tuple[str, Node]]:
    below = root.value.get("conditions") if isinstance(root.value, Mapping) else None
    return list(below.value.items()) if below and isinstance(below.value, Mapping) else []
