"""Arrays of numpy's `.npz` files: what each header claims is summed up before any array is made."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from rollover.system.budget import Budget


@contextmanager
def arrays_of(path: Path) -> Iterator[Any]:
    """The open file, whose arrays are read by name. Raises `InputError` for claims, numpy's errors for the rest."""
    claimed = Budget(path)
    with zipfile.ZipFile(path) as archive:
        for info in archive.infolist():
            claimed.claim(info.file_size, info.filename)
            if info.filename.endswith(".npy"):
                with archive.open(info) as part:
                    claimed.claim(max(0, _claim(part) - info.file_size), info.filename)
    with np.load(path, allow_pickle=False) as found:
        yield found


def _claim(part: Any) -> int:
    """Bytes of an array by its header."""
    version = np.lib.format.read_magic(part)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, dtype = read(part)
    if version not in ((1, 0), (2, 0)) or min(shape, default=0) < 0:
        raise ValueError(f"an array of version {version} and shape {shape}; versions 1.0 and 2.0 are read")
    return int(np.prod(shape, dtype=object)) * max(8, int(dtype.itemsize))
