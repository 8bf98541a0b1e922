"""Conditions of each file that a profile serves: out of its name by a pattern, or from a row of a table."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, cast

from ground.quantity import parameters
from rollover.spec import document
from rollover.system.errors import Fault, InputError, hint

MOST_PARTS = 32  # of a pattern: with a name of 255 characters at most some million comparisons
MOST_BYTES = 1 << 24  # of a table
FILE = "file"  # column of a table that names the recording
_NUMBER = re.compile(r"[-+]?(\d+(\.\d*)?|\.\d+)([eE][-+]?\d+)?", re.ASCII)
_PART = re.compile(r"\{([^{}]*)\}|\*")
_PATH = re.compile(r"[A-Za-z][\w.-]*", re.ASCII)


@parameters
class ConditionsFrom:
    """Where the conditions of each file stand that a profile serves; one of the two."""

    name: Annotated[
        str | None,
        "pattern of whole file names, such as drop_{initiation.speed}_*.csv: {PATH} is a value, * any text",
    ] = None
    table: Annotated[
        str | None, "CSV file beside the profile: a column `file`, every other one is headed by a scenario path"
    ] = None

    def validate(self) -> None:
        """Refuse both and none, and a pattern whose values have no ends."""
        if (self.name is None) == (self.table is None):
            raise ValueError("got both or none; one of name and table is needed")
        if self.name is not None:
            try:
                parts_of(self.name)
            except ValueError as e:
                raise ValueError(f"name: {e}") from None


@dataclass(frozen=True, kw_only=True)
class ByFile:
    """`ConditionsFrom` of a profile, read and checked; `places` says by scenario path where it stands, for messages."""

    file: str
    decimal: str
    pattern: str = ""
    table: str = ""
    rows: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    places: Mapping[str, Fault]

    def of(self, path: Path) -> dict[str, Any]:
        """Conditions of one recording. Raises `InputError` where its name does not fit, or no row is its own."""
        if self.table:
            row = self.rows.get(path.name)
            if row is None:
                what = f"no row for this file in {self.table}, got {path.name!r}; {hint(path.name, self.rows)}"
                raise InputError(Fault(file=str(path), message=what))
            return dict(row)
        found = matched(parts_of(self.pattern), path.name, self.decimal)
        if len(found) == 1:
            return {name: value_of(text, self.decimal) for name, text in found[0].items()}
        where = f"the name {'fits' if found else 'does not fit'} conditions_from.name of {self.file}"
        if not found:
            what = f"{where}, got {path.name!r} for {self.pattern!r}; another pattern, or a table of conditions"
        else:
            ways = " or ".join(", ".join(f"{k} = {v}" for k, v in way.items()) for way in found)
            what = f"{where} in two ways, got {ways} by {self.pattern!r}; write out more of the name in the pattern"
        raise InputError(Fault(file=str(path), message=what))


def read_by_file(given: ConditionsFrom, root: document.Node, profile: Path, decimal: str) -> ByFile:
    """Check the paths of a pattern, or read a table, of the profile with this tree. Raises `InputError` with lines."""
    node = cast("Mapping[str, document.Node]", root.value)["conditions_from"]
    below = cast("Mapping[str, document.Node]", node.value)
    stated = root.plain.get("conditions") or {}
    if given.name is not None:
        place = below["name"].place
        at = Fault(file=place.file, line=place.line, path="conditions_from.name", message="")
        places = {part[1:]: at for part in parts_of(given.name) if part[0] == "{"}
        for path in places:
            _check_not_stated(path, stated, at)
        return ByFile(file=place.file, decimal=decimal, pattern=given.name, places=places)
    assert given.table is not None
    place = below["table"].place
    table = profile.parent / given.table
    if not table.is_file():
        message = f"no such file, got {given.table!r}; a CSV file beside this one is needed"
        raise place.fault("conditions_from.table", message)
    rows, places = _table(table, stated)
    return ByFile(file=place.file, decimal=decimal, table=str(table), rows=rows, places=places)


def parts_of(pattern: str) -> list[str]:
    """Text, `{PATH` for a value and `*` for any text, in turn. Raises ``ValueError`` for what has no one meaning."""
    parts: list[str] = []
    at = 0
    for found in _PART.finditer(pattern):
        parts += [t for t in (pattern[at : found.start()],) if t]
        parts.append("*" if found[0] == "*" else "{" + found[1])
        at = found.end()
    parts += [t for t in (pattern[at:],) if t]
    paths = [p[1:] for p in parts if p[0] == "{"]
    for part in parts:
        if part[0] not in "{*" and re.search(r"[{}/\\]", part):
            raise ValueError(f"got {part!r}; {{PATH}} for a value, * for any text, no folders")
    for wrong in (p for p in parts if p[0] == "{" and not _PATH.fullmatch(p[1:])):
        raise ValueError(f"not a scenario path, got {wrong + '}'!r}; such as {{initiation.speed}}")
    if not paths:
        raise ValueError(f"no value in it, got {pattern!r}; such as drop_{{initiation.speed}}_*.csv")
    if len(set(paths)) < len(paths):
        raise ValueError(f"a path given twice, got {pattern!r}; once is allowed")
    if any(a[0] in "{*" and b[0] in "{*" for a, b in pairwise(parts)):
        raise ValueError(f"nothing tells where a value ends, got {pattern!r}; text between two of {{PATH}} and *")
    if len(parts) > MOST_PARTS:
        raise ValueError(f"too long, got {len(parts)} parts; at most {MOST_PARTS}")
    return parts


def matched(parts: list[str], name: str, decimal: str = ".") -> list[dict[str, str]]:
    """Values by path for a file name: those ways to read it by which most values are numbers; none, one, or two.

    Each place of the name is looked at once for each part (dynamic programming): at most parts x characters^2 steps.
    """
    # ways[k]: how the parts from here on read name[k:]: how many values are numbers, and the values
    ways: list[list[tuple[int, tuple[str, ...]]]] = [[] for _ in range(len(name))] + [[(0, ())]]
    for part in reversed(parts):
        before: list[list[tuple[int, tuple[str, ...]]]] = []
        for k in range(len(name) + 1):
            if part[0] not in "{*":
                before.append(ways[k + len(part)] if name.startswith(part, k) else [])
                continue
            found: dict[tuple[str, ...], int] = {}
            for end in range(k + (part != "*"), len(name) + 1):
                for count, values in ways[end]:
                    text = name[k:end]
                    here = (text, *values) if part != "*" else values
                    found[here] = count + (part != "*" and is_number(text, decimal))
            most = max(found.values(), default=0)
            before.append([(n, v) for v, n in found.items() if n == most][:2])
        ways = before
    paths = [part[1:] for part in parts if part[0] == "{"]
    return [dict(zip(paths, values, strict=True)) for _, values in ways[0]]


def is_number(text: str, decimal: str = ".") -> bool:
    """Whether a text is a number, written with this decimal mark."""
    return bool(_NUMBER.fullmatch(text.replace(decimal, ".") if decimal != "." else text))


def value_of(text: str, decimal: str = ".") -> Any:
    """A number, true or false, a list in brackets, or the text itself."""
    if is_number(text, decimal):
        return int(text) if text.isdecimal() else float(text.replace(decimal, "."))
    if text.lower() in ("true", "false"):
        return text.lower() == "true"
    if text.startswith("["):
        try:
            return json.loads(text)
        except ValueError:
            return text
    return text


def _check_not_stated(path: str, stated: Mapping[str, Any], place: Fault) -> None:
    """Refuse what the profile states for all files."""
    if path in stated:
        raise InputError(replace(place, message=f"{path} is stated in conditions as well; one of them"))


def _table(path: Path, stated: Mapping[str, Any]) -> tuple[dict[str, dict[str, Any]], dict[str, Fault]]:
    """Conditions by file name, and where each scenario path stands. Raises `InputError` with the line."""

    def at(line: int | None, what: str, column: str = "") -> InputError:
        return InputError(Fault(file=str(path), line=line, path=column, message=what))

    if path.stat().st_size > MOST_BYTES:
        raise at(None, f"too long, got {path.stat().st_size} bytes; at most {MOST_BYTES}")
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise at(None, "not UTF-8 text; save the table as CSV in UTF-8") from None
    head = text.partition("\n")[0]
    mark = next((m for m in ",;\t" if FILE in (c.strip().strip('"') for c in head.split(m))), None)
    if mark is None:
        raise at(1, f"no column {FILE!r}, got {head[:60]!r}; it names the recordings, other columns are scenario paths")
    decimal = "." if mark == "," else ","
    reader = csv.reader(text.splitlines(), delimiter=mark)
    names = [cell.strip() for cell in next(reader)]
    if len(set(names)) < len(names):
        raise at(1, f"a column twice, got {', '.join(names)}; once each")
    places = {name: Fault(file=str(path), line=1, message="") for name in names if name != FILE}
    for name, place in places.items():
        _check_not_stated(name, stated, place)
    if len(names) < 2:
        raise at(1, f"nothing but {FILE!r}; a column with a scenario path is needed")
    rows: dict[str, dict[str, Any]] = {}
    for cells in reader:
        cells = [cell.strip() for cell in cells]
        if not any(cells):
            continue
        line = reader.line_num
        if len(cells) != len(names):
            raise at(line, f"got {len(cells)} cells for {len(names)} columns; one each")
        row = dict(zip(names, cells, strict=True))
        for name, cell in row.items():
            if not cell:
                raise at(line, "an empty cell; a value in each", name)
        file = row.pop(FILE)
        if file in rows:
            raise at(line, f"a second row for {file!r}; one each", FILE)
        rows[file] = {name: value_of(cell, decimal if is_number(cell, decimal) else ".") for name, cell in row.items()}
    return rows, places
