"""Recordings from files: our own format, those of instruments and viewers, and published sets of recordings."""

from __future__ import annotations

import fnmatch
import functools
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from rollover.recording import Recording
from rollover.recording.importers import iso_mme, mat, plain, xlsx
from rollover.recording.importers.cone_drops import CONE_DROPS
from rollover.recording.importers.csv_profile import CSV
from rollover.recording.importers.cube_tosses import CUBE_TOSSES
from rollover.recording.importers.dts import DTS
from rollover.recording.importers.elbow_tosses import ELBOW_TOSSES
from rollover.recording.importers.falling_balls import FALLING_BALLS
from rollover.recording.importers.hdf5 import HDF5
from rollover.recording.importers.ide import IDE
from rollover.recording.importers.impack import IMPACK
from rollover.recording.importers.importer import Collection, Importer, with_channels
from rollover.recording.importers.lvm import LVM
from rollover.recording.importers.mcap import MCAP
from rollover.recording.importers.mdf import MDF
from rollover.recording.importers.netcdf import NETCDF
from rollover.recording.importers.nhtsa import NHTSA
from rollover.recording.importers.sidecar import Described, Profile, read_described
from rollover.recording.importers.soil_penetrometer import SOIL_PENETROMETER
from rollover.recording.importers.tdms import TDMS
from rollover.system.boundary import worded
from rollover.system.errors import THERE, Fault, InputError, absent, cured, hint

__all__ = ["COLLECTIONS", "Collection", "Importer", "importers", "read_profile", "read_recording", "recordings_at"]
__all__ += ["name_of", "names_of_tests", "read_named", "with_channels", "write_recording"]

NOT_RECORDINGS = (".yaml", ".yml", ".json", ".md", ".txt")
ENDINGS = (  # what a name loses: in Messung_3.0.csv only the last of two, in drop.001 none
    *(".mme.zip", ".mme", ".csv", ".parquet", ".txt", ".asc", ".dat", ".tsv", ".lvm", ".log", ".yaml", ".yml"),
    *(".mat", ".xlsx", ".tdms", ".mdf", ".mf4", ".h5", ".hdf5", ".nc", ".mcap", ".bag", ".db3", ".ide"),
    *(".zip", ".tar", ".tar.gz", ".tar.bz2", ".tar.xz", ".tgz"),
)

PLAIN = Importer(name="plain", meaning="CSV or Parquet with a sidecar", sniff=plain.sniff, read=plain.read)
_BINARY = (mat.MAT, xlsx.XLSX, TDMS, MDF, HDF5, NETCDF, MCAP, IDE)
_FORMATS = (PLAIN, NHTSA, iso_mme.ISO_MME, *_BINARY, LVM, DTS, CSV)
_OWN = {i.name: i for i in _FORMATS}
_SETS = (CUBE_TOSSES, ELBOW_TOSSES, FALLING_BALLS, SOIL_PENETROMETER, CONE_DROPS, IMPACK)
_WRITERS = {".mme.zip": iso_mme.write, ".mme": iso_mme.write, ".mat": mat.write, ".xlsx": xlsx.write}
COLLECTIONS: dict[str, Collection] = {c.name: c for c in _SETS}
ENTRY_POINTS = "rollover.importers"


@functools.cache  # what is installed does not change while we run
def importers() -> Mapping[str, Importer]:
    """Importers by name: our own, and those that installed packages offer. Raises ``ValueError`` for a name twice."""
    from importlib.metadata import entry_points

    found = dict(_OWN)
    for point in entry_points(group=ENTRY_POINTS):
        importer: Importer = point.load()
        if importer.name in found:
            raise ValueError(f"importer {importer.name!r}: a second one, from {point.value}; another name is needed")
        found[importer.name] = importer
    return found


def read_recording(
    path: str | Path, *, profile: str | Path | Described | None = None, kind: str = "", test: str = ""
) -> Recording:
    """Recording from any file that an importer knows, or a run's folder; SI. Raises `InputError`.

    `profile` says what the columns of a foreign file are; `kind` names the importer instead of finding it; `test` one
    of several in the file, which is refused without.
    """
    path = _there(path)
    given = profile if isinstance(profile, Described) or profile is None else read_profile(profile)
    given = given and given.of(path)
    importer = _importer(path, given, kind)
    tests = importer.tests(path) if importer.tests else ()
    if test and test not in tests:
        raise InputError(Fault(file=str(path), message=f"no such test, got {test!r}; {hint(test, tests)}"))
    if test and importer.read_test:
        return importer.read_test(path, given, test)
    if len(tests) > 1:
        cure = f"rollover import {path.name} makes a recording of each, --select NAME of one"
        raise InputError(Fault(file=str(path), message=f"{len(tests)} tests, got {', '.join(tests)}; {cure}"))
    return importer.read(path, given)


def names_of_tests(path: str | Path, kind: str) -> list[str]:
    """Names of the tests in a file that holds several; else nothing. Raises `InputError`."""
    path = _there(path)
    importer = importers().get(kind) or next((i for i in importers().values() if i.sniff(path)), None)
    tests = importer.tests(path) if importer and importer.tests else ()
    return list(tests) if len(tests) > 1 else []


def _there(path: str | Path) -> Path:
    """A path that leads somewhere; of a run's folder, that of its channels. Raises `InputError`."""
    path = Path(path)
    try:
        if (path / "channels.parquet").is_file():
            path = path / "channels.parquet"
        exists = path.exists()
    except (OSError, RuntimeError) as e:  # a link that leads to itself
        raise InputError(
            Fault(file=str(path), message=f"cannot be read: {worded(e)}; a file that may be read is needed")
        ) from None
    if not exists:
        what = "cannot be read: a link that leads nowhere" if path.is_symlink() else absent(path)
        raise InputError(cured(Fault(file=str(path), message=what), THERE))
    return path


def write_recording(recording: Recording, path: str | Path, *, force: bool = False, with_units: bool = False) -> None:
    """Write `NAME.csv` or `NAME.parquet` with its sidecar, an ISO-MME test (`NAME.mme.zip`, or a folder `NAME.mme`), a
    MATLAB file (`NAME.mat`) or a workbook (`NAME.xlsx`).

    Whole or not at all, over nothing without `force`. Names of columns have the unit behind them `with_units`, those
    of a workbook always, those of MATLAB never. Raises `InputError`.
    """
    path = Path(path)
    own = next((write for ending, write in _WRITERS.items() if path.name.endswith(ending)), None)
    if own is not None:
        own(recording, path, force=force)
    else:
        plain.write(recording, path, force=force, with_units=with_units)


def recordings_at(path: Path, profile: Described | None = None) -> list[Path]:
    """A recording's own path, or those of all in a folder that is none itself. Raises `InputError`.

    With a profile any file may be one, but for those that no instrument writes, hidden ones and its own table.
    """
    if not path.is_dir() or (path / "channels.parquet").is_file() or _is_known(path):
        return [path]
    other = NOT_RECORDINGS if profile is None else (".yaml", ".yml", ".json", ".md")
    table = Path(profile.by_file.table) if profile is not None and profile.by_file is not None else None
    found = [
        p
        for p in sorted(path.iterdir())
        if not p.name.startswith(".")
        and (p.suffix.lower() not in other if p.is_file() else p.is_dir() and _is_known(p))
        and not (table is not None and table.is_file() and p.samefile(table))
    ]
    if not found:
        raise InputError(Fault(file=str(path), message="no recordings in this folder; tables such as NAME.csv are"))
    return found


def name_of(path: Path) -> str:
    """What a recording is called: its file's name without the ending of a known format."""
    name = path.resolve().name if path.name in ("", "..") else path.name
    if path.is_dir() and not name.lower().endswith(".mme"):
        return name
    ending = max((e for e in ENDINGS if name.lower().endswith(e) and len(name) > len(e)), key=len, default="")
    return name[: len(name) - len(ending)]


def read_named(
    paths: Sequence[str | Path],
    profile: str | Path | Described | None = None,
    kind: str = "",
    select: Sequence[str] | None = None,
) -> dict[str, tuple[Path, Recording]]:
    """Path and recording by name, of files, of all in folders and of all tests in archives.

    All are read with the profile, if one is given; `select` has patterns of names, None where a user has no such
    choice. Raises `InputError` for all faults at once, and for two recordings of one name.
    """
    given = profile if isinstance(profile, Described) or profile is None else read_profile(profile)
    found: dict[str, tuple[Path, Recording]] = {}
    first: dict[str, Path] = {}
    faults: list[Fault] = []
    for text in paths:
        try:
            named = [named for file in recordings_at(Path(text), given) for named in _named(file, kind)]
        except InputError as e:
            faults += e.faults
            continue
        for name, file, test in named:
            if name in first:
                message = f"a second recording by this name, got {name!r}, first {first[name]}"
                message += "; two recordings share a name"
                faults.append(Fault(file=str(file), message=message))
                continue
            first[name] = file
            if select and not any(fnmatch.fnmatch(name, pattern) for pattern in select):
                continue
            try:
                found[name] = (file, read_recording(file, profile=given, kind=kind, test=test))
            except InputError as e:
                is_alone = all(other == file for _, other, _ in named)
                faults += e.faults if is_alone else [_or_left_out(f, file, select is not None) for f in e.faults]
    if faults:
        raise InputError(*faults)
    if not found:
        names = ", ".join(list(first)[:24])
        raise InputError(
            Fault(file="--select", message=f"nothing fits, got {' '.join(select or ())}; there are {names}")
        )
    return found


def _or_left_out(fault: Fault, file: Path, is_selected: bool) -> Fault:
    """A fault of one file among others, which may be no recording at all, with what takes these alone."""
    how = "--select with the names of the others" if is_selected else "name the others one by one"
    return replace(fault, message=f"{fault.message}; or leave {file.name} out: {how}")


def _named(file: Path, kind: str) -> list[tuple[str, Path, str]]:
    """Name, file and test of each recording in a file; most hold one, without a name of its own."""
    tests = names_of_tests(file, kind)
    return [(test, file, test) for test in tests] or [(name_of(file), file, "")]


def read_profile(path: str | Path) -> Described:
    """What the columns of a foreign file are, from a `rollover-profile/1` file. Raises `InputError`."""
    return read_described(Path(path), Profile)


def _is_known(path: Path) -> bool:
    return any(i.sniff(path) for i in importers().values())


def _importer(path: Path, given: Described | None, kind: str) -> Importer:
    table = importers()
    if kind:
        if kind not in table:
            raise InputError(Fault(file=str(path), message=f"no such importer, got {kind!r}; {hint(kind, table)}"))
        return table[kind]
    for importer in table.values():
        if importer.sniff(path) and not (importer is PLAIN and given is not None):
            return importer
    if given is not None and path.is_file():
        return CSV  # whatever its name ends in: the profile says how to read it
    if path.is_dir():
        raise InputError(
            Fault(
                file=str(path),
                message="a folder, and neither a run, an ISO-MME test nor a ROS bag; its files one by one",
            )
        )
    if given is not None:
        return CSV
    message = f"no importer knows this file; {', '.join(table)} are known, --profile says what its columns are"
    message += f"; published sets are imported --as one of {', '.join(COLLECTIONS)}"
    raise InputError(Fault(file=str(path), message=message))
