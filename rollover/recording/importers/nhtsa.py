"""Tests of NHTSA's vehicle database as EV5 ASCII X-Y: NAME.EV5, and a file NAME.NNN of time and value for each curve.

NAME.EV5 has sections (`----- INSTRUMENTATION -----`) of lines with fields between bars; a folder or a zip alike.
"""

from __future__ import annotations

import re
import zipfile
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import NoReturn

import numpy as np

from rollover.recording import Recording
from rollover.recording.importers.data_status import judged
from rollover.recording.importers.importer import Importer
from rollover.recording.importers.mme_archive import content, names_in
from rollover.recording.importers.polarity import sign
from rollover.recording.importers.sidecar import Described
from rollover.recording.importers.signals import Signal, assemble, left_out
from rollover.spec.channels import factor
from rollover.system.errors import Fault, InputError

FIELDS = (
    *("VEHNO", "CURNO", "SENTYP", "SENLOC", "SENATT", "AXIS", "XUNITS", "YUNITS", "PREFIL", "INSMAN"),
    *("CALDAT", "INSRAT", "CHLMAX", "INIVEL", "NFP", "NLP", "DELT", "DASTAT", "CHSTAT", "INSCOM"),
)
UNITS = {"NWT": "N", "NWM": "N m", "DPS": "deg/s", "SEC": "s"}  # codes of the database that are no spelling of a unit
CENTRE = "VECG"  # attachment of a sensor: the vehicle's centre of gravity
_QUANTITIES = {"AC": "chassis/acceleration", "AV": "chassis/angular_velocity"}
_CURVE = re.compile(r"(?P<test>[A-Za-z]\d{5})\.(?P<number>\d{3})")
_SECTION = re.compile(r"-{3,}\s*(\w+)\s*-{3,}")


@dataclass(frozen=True, kw_only=True)
class _Test:
    """A test's files: where they lie, its description, if any, and its curves by number."""

    place: Path
    name: str
    about: str
    curves: dict[int, str]


def _sniff(path: Path) -> bool:
    if path.is_file() and path.suffix.lower() == ".ev5":
        return True
    if path.is_dir():
        return any(p.suffix.lower() == ".ev5" or _CURVE.fullmatch(p.name) for p in path.iterdir())
    if path.suffix.lower() != ".zip" or not path.is_file():
        return False
    try:
        with zipfile.ZipFile(path) as archive:
            return any(name.lower().endswith(".ev5") for name in archive.namelist())
    except (OSError, zipfile.BadZipFile, NotImplementedError):
        return False


def tests(path: Path) -> list[str]:
    """Names of the tests in a folder or zip. Raises `InputError`."""
    return [test.name for test in _tests(path)]


def read_test(path: Path, profile: Described | None, name: str) -> Recording:
    """One test by its name. Raises `InputError`."""
    return _recording(path, profile, next(test for test in _tests(path) if test.name == name))


def _read(path: Path, profile: Described | None) -> Recording:
    return _recording(path, profile, _tests(path)[0])


def _tests(path: Path) -> list[_Test]:
    one = path.is_file() and path.suffix.lower() == ".ev5"
    place = path.parent if one else path
    names = names_in(place)
    stems: dict[str, _Test] = {}
    for name in sorted(names):
        inside = PurePosixPath(name)
        match = _CURVE.fullmatch(inside.name)
        is_about = inside.suffix.lower() == ".ev5"
        if (one and name != path.name and not (match and match["test"].lower() == path.stem.lower())) or not (
            match or is_about
        ):
            continue
        stem = (match["test"] if match else inside.stem).lower()
        test = stems.setdefault(str(inside.parent / stem), _Test(place=place, name=stem, about="", curves={}))
        if match:
            test.curves[int(match["number"])] = name
        else:
            stems[str(inside.parent / stem)] = _Test(place=place, name=stem, about=name, curves=test.curves)
    return list(stems.values())


def _recording(path: Path, profile: Described | None, test: _Test) -> Recording:
    if not test.curves:
        _refuse(path, f"no curves, got no {test.name}.001 beside {test.about}")
    about = _sections(test) if test.about else {}
    rows = {row["CURNO"]: row for row in _instruments(path, about)}
    listed = {int(number): row for number, row in rows.items()}
    signals: dict[str, Signal] = {}
    for number in sorted({*listed, *test.curves}):
        row = listed.get(number, {})
        name = f"{number:03d}"
        if number not in test.curves:
            signals[name] = left_out(f"listed in {PurePosixPath(test.about).name}, and no file")
            continue
        try:
            time, values = _curve(test.place, test.curves[number])
            time *= factor(UNITS.get(row.get("XUNITS", ""), row.get("XUNITS", "")) or "s", "time")
        except ValueError as e:
            needed = name in profile.columns if profile else bool(_channel(row))
            if needed and isinstance(e, InputError):
                raise
            signals[name] = left_out(e.faults[0].message if isinstance(e, InputError) else f"X is no time: {e}")
            continue
        unit = UNITS.get(row.get("YUNITS", ""), row.get("YUNITS", ""))
        lost, status = judged(row.get("DASTAT", ""))
        signals[name] = Signal(
            values=values, time=time, unit=unit, channel=_channel(row), unreadable=lost, notes=status
        )
    found = assemble(path, signals, profile)
    notes = list(found.notes)
    if listed:
        notes.append(f"instruments: {'; '.join(_spoken(n, row) for n, row in listed.items())}")
    extra = [f"{n:03d}" for n in sorted(set(test.curves) - set(listed))] if test.about else []
    if extra:
        notes.append(f"files that {PurePosixPath(test.about).name} does not list: {', '.join(extra)}")
    turned = [c for c in found.channels if profile is None and sign(c) < 0.0]
    if turned:
        notes.append(f"turned from SAE J211 axes to ISO 8855: {', '.join(turned)}")
    fields = about.get("TEST", [[]])[0]
    title = fields[1] if profile is None and len(fields) > 1 and fields[1] else found.title
    table = {c: -v if c in turned else v for c, v in found.channels.items()}
    source = found.source or (fields[4] if len(fields) > 4 else "")
    return replace(found, title=title, source=source, channels=table, notes=tuple(notes))


def _channel(row: dict[str, str]) -> str:
    """Channel of an instrument at the vehicle's centre of gravity, along its own axes; or nothing."""
    axis = re.fullmatch(r"([XYZ])L", row.get("AXIS", ""))
    quantity = _QUANTITIES.get(row.get("SENTYP", ""))
    return f"{quantity}_{axis[1].lower()}" if quantity and axis and row.get("SENATT") == CENTRE else ""


def _spoken(number: int, row: dict[str, str]) -> str:
    said = " ".join(row[field] for field in ("SENTYP", "SENLOC", "SENATT", "AXIS", "YUNITS", "INSCOM") if row[field])
    return f"{number:03d} {said}"


def _sections(test: _Test) -> dict[str, list[list[str]]]:
    """Lines of each section, parted into fields."""
    found: dict[str, list[list[str]]] = {}
    section = ""
    for line in content(test.place, test.about).decode("cp1252", errors="replace").splitlines():
        match = _SECTION.fullmatch(line.strip())
        if match:
            section = match[1].upper()
        elif "|" in line:
            found.setdefault(section, []).append([cell.strip() for cell in line.split("|")])
    return found


def _instruments(path: Path, about: dict[str, list[list[str]]]) -> list[dict[str, str]]:
    rows = []
    for cells in about.get("INSTRUMENTATION", []):
        row = dict(zip(FIELDS, cells, strict=False))
        if len(cells) < len(FIELDS) or not row["CURNO"].isdigit():
            _refuse(
                path, f"INSTRUMENTATION: got {len(cells)} fields in {'|'.join(cells)[:40]!r}; {len(FIELDS)} are needed"
            )
        rows.append({key: value.upper() if key != "INSCOM" else value for key, value in row.items()})
    return rows


def _curve(place: Path, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Time and values of a curve, (n,) each. Raises `InputError` with the line."""
    rows: list[tuple[float, float]] = []
    for number, line in enumerate(content(place, name).decode("latin-1").splitlines(), start=1):
        cells = line.replace(",", " ").split()
        if not cells:
            continue
        try:
            time, value = map(float, cells)
        except ValueError:
            _refuse(place, f"{name}: line {number}: not two numbers, got {line[:40]!r}; a time and a value")
        rows.append((time, value))
    if not rows:
        _refuse(place, f"{name}: empty, got no samples")
    table = np.array(rows)
    return table[:, 0].copy(), table[:, 1].copy()


def _refuse(path: Path, message: str) -> NoReturn:
    raise InputError(Fault(file=str(path), message=message)) from None


NHTSA = Importer(
    name="nhtsa",
    meaning="NHTSA EV5 ASCII X-Y: folder or zip",
    sniff=_sniff,
    read=_read,
    tests=tests,
    read_test=read_test,
)
