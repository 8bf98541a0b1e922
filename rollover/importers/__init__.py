"""Recordings from files: our own format, those of instruments and viewers, and published sets of recordings."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from pathlib import Path

from rollover.faults import Fault, InputError, absent, hint
from rollover.importers import iso_mme, plain
from rollover.importers.cone_drops import CONE_DROPS
from rollover.importers.csv_profile import CSV
from rollover.importers.cube_tosses import CUBE_TOSSES
from rollover.importers.elbow_tosses import ELBOW_TOSSES
from rollover.importers.falling_balls import FALLING_BALLS
from rollover.importers.hdf5 import HDF5
from rollover.importers.ide import IDE
from rollover.importers.impack import IMPACK
from rollover.importers.importer import Collection, Importer, with_channels
from rollover.importers.mat import MAT
from rollover.importers.mcap import MCAP
from rollover.importers.mdf import MDF
from rollover.importers.sidecar import Described, Profile, read_described
from rollover.importers.soil_penetrometer import SOIL_PENETROMETER
from rollover.importers.tdms import TDMS
from rollover.recording import Recording

__all__ = ["COLLECTIONS", "Collection", "Importer", "importers", "read_profile", "read_recording", "recordings_at"]
__all__ += ["with_channels", "write_recording"]

NOT_RECORDINGS = (".yaml", ".yml", ".json", ".md", ".txt")

PLAIN = Importer(name="plain", meaning="CSV or Parquet with a sidecar", sniff=plain.sniff, read=plain.read)
_OWN = {i.name: i for i in (PLAIN, iso_mme.ISO_MME, MAT, TDMS, MDF, HDF5, MCAP, IDE, CSV)}
_SETS = (CUBE_TOSSES, ELBOW_TOSSES, FALLING_BALLS, SOIL_PENETROMETER, CONE_DROPS, IMPACK)
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


def read_recording(path: str | Path, *, profile: str | Path | Described | None = None, kind: str = "") -> Recording:
    """Recording from any file that an importer knows, or a run's folder; SI. Raises `InputError`.

    `profile` says what the columns of a foreign file are; `kind` names the importer instead of finding it.
    """
    path = Path(path)
    try:
        if (path / "channels.parquet").is_file():
            path = path / "channels.parquet"
        exists = path.exists()
    except (OSError, RuntimeError) as e:  # a link that leads to itself
        raise InputError(Fault(file=str(path), message=f"cannot be read: {getattr(e, 'strerror', e)}")) from None
    if not exists:
        what = "cannot be read: a link that leads nowhere" if path.is_symlink() else absent(path)
        raise InputError(Fault(file=str(path), message=what))
    given = profile if isinstance(profile, Described) or profile is None else read_profile(profile)
    return _importer(path, given, kind).read(path, given)


def write_recording(recording: Recording, path: str | Path, *, force: bool = False) -> None:
    """Write `NAME.csv` or `NAME.parquet` with its sidecar, or an ISO-MME test (`NAME.mme.zip`, or a folder `NAME.mme`).

    Whole or not at all, over nothing without `force`. Raises `InputError`.
    """
    path = Path(path)
    is_mme = path.name.endswith((".mme.zip", ".mme"))
    (iso_mme.write if is_mme else plain.write)(recording, path, force=force)


def recordings_at(path: Path) -> list[Path]:
    """A recording's own path, or those of all in a folder that is none itself. Raises `InputError`."""
    if not path.is_dir() or (path / "channels.parquet").is_file() or any(i.sniff(path) for i in importers().values()):
        return [path]
    files = [p for p in sorted(path.iterdir()) if p.is_file() and p.suffix not in NOT_RECORDINGS]
    if not files:
        raise InputError(Fault(file=str(path), message="no recordings in this folder; tables such as NAME.csv are"))
    return files


def read_profile(path: str | Path) -> Described:
    """What the columns of a foreign file are, from a `rollover-profile/1` file. Raises `InputError`."""
    return read_described(Path(path), Profile)


def _importer(path: Path, given: Described | None, kind: str) -> Importer:
    table = importers()
    if kind:
        if kind not in table:
            raise InputError(Fault(file=str(path), message=f"no such importer, got {kind!r}; {hint(kind, table)}"))
        return table[kind]
    for importer in table.values():
        if importer.sniff(path) and not (importer is PLAIN and given is not None):
            return importer
    if path.is_dir():
        raise InputError(
            Fault(
                file=str(path),
                message="a folder, and neither a run, an ISO-MME test nor a ROS bag; its files one by one",
            )
        )
    message = f"no importer knows this file; {', '.join(table)} are known, --profile says what its columns are"
    raise InputError(Fault(file=str(path), message=message))
