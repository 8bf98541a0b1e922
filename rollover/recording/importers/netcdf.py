"""Classic netCDF (3): variables by name, with the scales, fill values and coordinates of the CF conventions."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from rollover.recording import Recording
from rollover.recording.importers.apart import apart
from rollover.recording.importers.arrays import Array, signals_of
from rollover.recording.importers.importer import Importer, reading, starts_with
from rollover.recording.importers.sidecar import Described
from rollover.recording.importers.signals import Signal, assemble

NEVER_WRITTEN = {  # what the format's library fills with where no `_FillValue` is stated; bytes have none
    "i2": -32767,
    "i4": -2147483647,
    "f4": np.float32(9.969209968386869e36),
    "f8": 9.969209968386869e36,
}


def _read(path: Path, profile: Described | None) -> Recording:
    return assemble(path, apart(_signals, path, profile, what="netCDF", modules=("scipy.io",)), profile)


def _signals(path: Path, profile: Described | None) -> dict[str, Signal]:
    from scipy.io import netcdf_file

    with reading(path, "netCDF"), netcdf_file(str(path), "r", mmap=False, maskandscale=False) as file:
        found: dict[str, Array | str] = {
            name: _array(file, name) if variable.shape else "a single number"
            for name, variable in file.variables.items()
        }
        return signals_of(path, found, profile)


def _array(file: Any, name: str) -> Array:
    variable = file.variables[name]
    attributes = dict(variable._attributes)  # scipy has no public word for them
    around = (attributes, dict(file._attributes))
    coordinates = {axis: key for axis, key in enumerate(variable.dimensions) if key in file.variables and key != name}
    return Array(
        shape=tuple(variable.shape),
        dtype=variable.data.dtype,
        load=variable.data.__getitem__,
        attributes=attributes,
        around=around,
        scales={axis: _array(file, key) for axis, key in coordinates.items()},
        fill=NEVER_WRITTEN.get(variable.data.dtype.str[1:]),
    )


NETCDF = Importer(
    name="netcdf",
    meaning="netCDF 3 (netCDF 4 is HDF5)",
    sniff=lambda path: starts_with(path, b"CDF\x01", b"CDF\x02"),
    read=_read,
)
