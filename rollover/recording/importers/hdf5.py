"""HDF5, netCDF 4 and MATLAB 7.3: columns by their path, `path[1]` of a matrix, `table.field` of records."""

from __future__ import annotations

from pathlib import Path

from rollover.recording import Recording
from rollover.recording.importers.apart import apart
from rollover.recording.importers.arrays import signals_of
from rollover.recording.importers.hdf5_contents import contents
from rollover.recording.importers.hdf5_guard import stands_alone
from rollover.recording.importers.importer import Importer, check_library, library, reading, starts_with
from rollover.recording.importers.sidecar import Described
from rollover.recording.importers.signals import Signal, assemble

_MATLAB_7_3 = (b"MATLAB 7.3", b"\x89HDF\r\n\x1a\n")


def _read(path: Path, profile: Described | None) -> Recording:
    check_library("h5py", "hdf5", path)
    return assemble(path, apart(_signals, path, profile, what="HDF5", modules=("h5py",)), profile)


def _signals(path: Path, profile: Described | None) -> dict[str, Signal]:
    h5py = library("h5py", "hdf5", path)
    with reading(path, "HDF5"), h5py.File(path, "r") as file:
        stands_alone(file, path)
        found = contents(h5py, file, () if profile is None else tuple(profile.columns))
        return signals_of(path, found, profile)


HDF5 = Importer(
    name="hdf5",
    meaning="HDF5, netCDF 4, and MATLAB 7.3",
    sniff=lambda path: starts_with(path, *_MATLAB_7_3),
    read=_read,
)
