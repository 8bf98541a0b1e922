"""Files in the very shapes in which the owners of public sets publish them, with made-up numbers."""

from __future__ import annotations

import os
import pickle
import struct
import zipfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rollover.recording import Recording
from rollover.recording.importers import COLLECTIONS
from rollover.system.errors import InputError

DATA = os.environ.get("ROLLOVER_DATA", "")
SYSTEM = {
    "protocol_version": 1001,
    "little_endian": True,
    "type_sizes": {"short": 2, "int": 4, "long": 4},
}
BLUEDROP = (
    "2g_accel",
    "18g_accel",
    "50g_accel",
    "pore_pressure",
    "200g_accel",
    "55g_x_tilt",
    "55g_y_tilt",
    "250g_accel",
)


def text(value: str) -> bytes:
    """BINUNICODE."""
    data = value.encode()
    return b"X" + struct.pack("<I", len(data)) + data


def number(value: int) -> bytes:
    """BININT."""
    return b"J" + struct.pack("<i", value)


def tensor_pickle(
    shape: Sequence[int],
    *,
    key: str = "0",
    count: int | None = None,
    strides: Sequence[int] | None = None,
    storage: str = "DoubleStorage",
    call: str = "torch._utils\n_rebuild_tensor_v2",
    old: bool = False,
) -> bytes:
    """What `torch.save` pickles of a tensor, its numbers left out."""
    count = int(np.prod(shape)) if count is None else count
    strides = [int(np.prod(shape[k + 1 :])) for k in range(len(shape))] if strides is None else strides
    persistent = text("storage") + b"ctorch\n" + storage.encode() + b"\n" + text(key) + text("cpu") + number(count)
    sizes = b"(" + b"".join(map(number, shape)) + b"t(" + b"".join(map(number, strides)) + b"t"
    hooks = b"ccollections\nOrderedDict\n)R"
    return (
        b"\x80\x02c" + call.encode() + b"\n((" + persistent + (b"N" if old else b"") + b"tQ" + number(0) + sizes
        + b"\x89" + hooks + b"tR."
    )  # fmt: skip


def write_new_pt(path: Path, rows: np.ndarray, pickled: bytes | None = None, *, compressed: bool = False) -> None:
    """As PyTorch from 1.6 on: a zip with a pickle and the numbers, stored."""
    how = zipfile.ZIP_DEFLATED if compressed else zipfile.ZIP_STORED
    with zipfile.ZipFile(path, "w", how) as archive:
        archive.writestr("archive/data.pkl", tensor_pickle(rows.shape) if pickled is None else pickled)
        archive.writestr("archive/data/0", rows.astype("<f8").tobytes())
        archive.writestr("archive/version", "3\n")


def write_old_pt(path: Path, rows: np.ndarray, pickled: bytes | None = None, *, count: int | None = None) -> None:
    """As PyTorch before 1.6: pickles one after another, then the numbers."""
    head = pickle.dumps(0x1950A86A20F9469CFC6C, 2) + pickle.dumps(1001, 2) + pickle.dumps(SYSTEM, 2)
    body = tensor_pickle(rows.shape, key="60429056", old=True) if pickled is None else pickled
    keys = pickle.dumps(["60429056"], 2)
    many = struct.pack("<q", rows.size if count is None else count)
    path.write_bytes(head + body + keys + many + rows.astype("<f8").tobytes())


def cube_rows(table: float = -0.0015) -> np.ndarray:
    """A cube that flies flat, turning about z, lands and lies: (n, 13), metres, as in `cube_tosses.COLUMNS`."""
    t = np.arange(40) / 148.0
    z = np.maximum(0.13 - 0.5 * t - 0.5 * 9.81 * t**2, 0.0524 + table)
    half = 0.5 * 2.0 * t
    rows = np.zeros((len(t), 13))
    rows[:, 0], rows[:, 1], rows[:, 2] = 0.2 - 1.0 * t, 0.1 + 0.4 * t, z
    rows[:, 3], rows[:, 6] = np.cos(half), np.sin(half)
    rows[:, 7:10], rows[:, 12] = (-9.0, 9.0, 9.0), 2.0  # recorded rates that are wrong
    return rows


def as_tensor(rows: np.ndarray) -> np.ndarray:
    """The cube in its published units: lengths in half edges, with six columns of controls behind, (1, n, 19)."""
    scaled = rows.copy()
    scaled[:, [0, 1, 2, 7, 8, 9]] /= 0.0524
    return np.concatenate([scaled, np.zeros((len(rows), 6))], axis=1)[None]


def write_book(path: Path, sheets: Mapping[str, Sequence[Sequence[Any]]]) -> None:
    """An .xlsx, whatever it is called."""
    import openpyxl

    book = openpyxl.Workbook()
    book.remove(book.active)
    for title, rows in sheets.items():
        sheet = book.create_sheet(title)
        for row in rows:
            sheet.append(list(row))
    with path.open("wb") as file:
        book.save(file)


def ball_rows(drops: Mapping[int, Sequence[float]]) -> list[list[Any]]:
    """Sheet of a ball: heights of each drop at 15 Hz, and a speed that is wrong."""
    rows: list[list[Any]] = [["Drop #", "Time (s)", "Height (m)", "Velocity (m/s)"]]
    for drop, heights in drops.items():
        rows += [[drop, k / 15.0, h, -99.0] for k, h in enumerate(heights)]
    return rows


def drop_log(offset: float = 0.0) -> tuple[np.ndarray, Mapping[str, tuple[float, float]]]:
    """g (and psi) of each sensor of a log, (n, 8), and its factors: hangs, sinks at 4.2 m/s, stops in 0.2 s, rests.

    A knock on the deck, larger and shorter than the stop, comes first.
    """
    t = np.arange(24000) / 2000.0
    axial = np.ones(t.size)
    axial[3000:3020] = 30.0
    fall = (t > 6.0) & (t < 8.0)
    axial[fall] = 1.0 - 4.2 / (2.0 * 9.80665)  # to 4.2 m/s within two seconds
    sink = (t >= 8.0) & (t < 10.0)
    axial[sink] = 1.0
    stop = (t >= 10.0) & (t < 10.2)
    axial[stop] = 1.0 + 0.5 * np.pi * 4.2 / 0.2 / 9.80665 * np.sin(np.pi * (t[stop] - 10.0) / 0.2)
    noise = np.random.default_rng(7).normal(0.0, 0.002, t.size)
    g = np.stack([np.clip(axial, -2.0, 2.0), axial, axial, 0.5 * t, axial, 0.01 + 0 * t, 0.02 + 0 * t, axial], axis=1)
    g[:, [0, 1, 2, 4, 7]] += noise[:, None] + offset
    factors = {name: (100.0 * (k + 1), 150000.0 / (k + 1)) for k, name in enumerate(BLUEDROP)}
    return g, factors


def write_log(path: Path, g: np.ndarray, factors: Mapping[str, tuple[float, float]], *, first: int = 7725569) -> None:
    """The logger's bytes: a count, a constant and eight sensors, three bytes each, big-endian."""
    raw = np.stack([g[:, k] * scale - offset for k, (offset, scale) in enumerate(factors.values())], axis=1)
    count = (first + np.arange(len(g)) + (1 << 23)) % (1 << 24) - (1 << 23)
    whole = np.concatenate([count[:, None], np.full((len(g), 1), -4194304), np.rint(raw).astype(np.int64)], axis=1)
    path.write_bytes(whole.astype(">i4").view(np.uint8).reshape(-1, 4)[:, 1:].tobytes())


def published(name: str) -> Path:
    """A folder of the owners' files, or a skip that says what is missing."""
    path = Path(DATA, "published", name)
    if not DATA or not path.is_dir():
        pytest.skip(f"needs the published files {name!r}: set ROLLOVER_DATA to the folder that holds published/")
    return path


def read(name: str, folder: Path, *select: str) -> dict[str, Recording]:
    """Recordings of a set by name."""
    return dict(COLLECTIONS[name].read(folder, select or ("*",)))


def refused(what: Callable[[], object]) -> str:
    """The one line with which something is refused."""
    with pytest.raises(InputError) as caught:
        what()
    assert len(caught.value.faults) == 1
    return caught.value.faults[0].message  # without the path, which holds the name of the test
