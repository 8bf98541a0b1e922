"""MATLAB files up to version 7: vectors by name, those inside structures as `structure.field`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rollover.importers.importer import Importer, check_claim, reading, starts_with
from rollover.importers.sidecar import Described
from rollover.importers.signals import Signal, assemble
from rollover.recording import Recording


def _read(path: Path, profile: Described | None) -> Recording:
    from scipy.io import loadmat, whosmat

    with reading(path, "MATLAB 5"):
        for _, shape, _ in whosmat(str(path)):
            check_claim(path, int(np.prod([int(n) for n in shape], dtype=object)))
        found = loadmat(str(path), simplify_cells=True)
    return assemble(path, {name: Signal(values=values) for name, values in _vectors("", found)}, profile)


def _vectors(above: str, table: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    for name, value in table.items():
        if isinstance(value, Mapping):
            yield from _vectors(f"{above}{name}.", value)
        elif isinstance(value, np.ndarray) and value.ndim == 1 and value.dtype.kind in "fiu" and name[:2] != "__":
            yield above + name, value.astype(np.float64)


MAT = Importer(
    name="mat",
    meaning="MATLAB, version 5 to 7",
    sniff=lambda path: starts_with(path, b"MATLAB 5.0", b"MATLAB 7.0"),
    read=_read,
)
