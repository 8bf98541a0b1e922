"""HDF5 and MATLAB 7.3: vectors by their path, units from the attributes `unit` or `units`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from rollover.importers.hdf5_guard import stands_alone
from rollover.importers.importer import Importer, check_claim, library, reading, starts_with
from rollover.importers.sidecar import Described
from rollover.importers.signals import Signal, assemble
from rollover.recording import Recording

_MATLAB_7_3 = (b"MATLAB 7.3", b"\x89HDF\r\n\x1a\n")


def _read(path: Path, profile: Described | None) -> Recording:
    h5py = library("h5py", "hdf5", path)
    found: dict[str, Any] = {}
    signals: dict[str, Signal] = {}

    def keep(name: str, thing: Any) -> None:
        is_vector = isinstance(thing, h5py.Dataset) and thing.dtype.kind in "fiu" and 1 <= thing.ndim <= 2
        if is_vector and thing.size == max(thing.shape):  # MATLAB has no vectors, only matrices of one row
            found[name] = thing

    with reading(path, "HDF5"), h5py.File(path, "r") as file:
        stands_alone(file, path)
        file.visititems(keep)
        for name, dataset in found.items():
            if profile is not None and name not in profile.columns:
                signals[name] = Signal(values=np.empty(0))
                continue
            check_claim(path, int(dataset.size))
            unit = dataset.attrs.get("unit", dataset.attrs.get("units", ""))
            unit = unit.decode() if isinstance(unit, bytes) else str(unit)
            signals[name] = Signal(values=np.asarray(dataset[()], dtype=np.float64).ravel(), unit=unit)
    return assemble(path, signals, profile)


HDF5 = Importer(
    name="hdf5", meaning="HDF5, and MATLAB 7.3", sniff=lambda path: starts_with(path, *_MATLAB_7_3), read=_read
)
