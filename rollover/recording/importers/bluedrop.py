"""Logs of a BlueDrop penetrometer: ten numbers of three bytes a row, and the factors that make g and kPa of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rollover.recording.importers.workbook import Row, read_workbook
from rollover.system.boundary import worded
from rollover.system.errors import Fault, InputError

Array = NDArray[np.float64]
RATE = 2000.0  # Hz
WIDTH, BYTES = 10, 3  # numbers of a row, bytes of a number: big-endian, signed
TURN = 1 << 24  # the count of the rows begins anew
PSI = 6.894757  # kPa
# columns of a row behind its count and a constant, by their names in the workbook, and in `COLUMNS`
SENSORS = {
    "2g_accel": "a2g",
    "18g_accel": "a18g",
    "50g_accel": "a50g",
    "pore_pressure": "pore_kPa",
    "200g_accel": "a200g",
    "55g_x_tilt": "tx",
    "55g_y_tilt": "ty",
    "250g_accel": "a250g",
}
COLUMNS = ("t_s", "a2g", "a18g", "a50g", "a200g", "tx", "ty", "a250g", "pore_kPa")
AXIAL = ("a18g", "a50g", "a200g", "a250g")  # the ranges that must agree; the finest is clipped too soon
FACTORS = "BlueDrop_Calibration_Factors.xlsx"
AGREED = 1.0  # g by which ranges may differ: the instrument's own do by 0.3 g, another's by 3 g and more

Factors = Mapping[str, tuple[float, float]]


def read_log(path: Path) -> tuple[dict[str, Array], str]:
    """Columns of a log by `COLUMNS`, each (n,), and how they were converted. Raises `InputError`.

    A log does not say which instrument wrote it: the sheet of factors is the one by which its ranges agree.
    """
    numbers = _numbers(path)
    book = _book(path)
    tried = sorted((_apart(numbers, factors), name, factors) for name, factors in _sheets(book))
    if not tried:
        message = f"no calibration factors, got no sheet with {', '.join(SENSORS)}; their offsets and scales are needed"
        raise InputError(Fault(file=str(book), message=message))
    apart, name, factors = tried[0]
    if apart > AGREED:
        message = (
            f"no sheet of {book.name} fits, got ranges {apart:.2f} g apart by the best, {name}; at most {AGREED:g} g"
        )
        raise InputError(Fault(file=str(path), message=message))
    found = {"t_s": _times(path, numbers)}
    for k, (sensor, column) in enumerate(SENSORS.items(), start=2):
        offset, scale = factors[sensor]
        found[column] = (numbers[:, k] + offset) / scale * (PSI if column == "pore_kPa" else 1.0)
    next_best = f", by the next one {tried[1][0]:.2f} g" if len(tried) > 1 else ""
    return found, f"factors of {name}: by them the ranges agree within {apart:.2f} g{next_best}"


def _numbers(path: Path) -> Array:
    """All numbers, (n, 10)."""
    try:
        data = np.frombuffer(path.read_bytes(), dtype=np.uint8)
    except OSError as e:
        raise InputError(
            Fault(file=str(path), message=f"cannot be read: {worded(e)}; a file that may be read is needed")
        ) from None
    if data.size == 0 or data.size % (WIDTH * BYTES):
        message = f"not a log of the penetrometer, got {data.size} bytes; a multiple of {WIDTH * BYTES}"
        raise InputError(Fault(file=str(path), message=message))
    b = data.reshape(-1, WIDTH, BYTES).astype(np.int32)
    whole = (b[..., 0] << 16) | (b[..., 1] << 8) | b[..., 2]
    return np.where(whole >= TURN // 2, whole - TURN, whole).astype(np.float64)


def _times(path: Path, numbers: Array) -> Array:
    """Stamps (n,) from the count of the rows: lost ones leave a gap. Raises `InputError` if it runs backwards."""
    steps = np.mod(np.diff(numbers[:, 0]), TURN)
    wrong = np.flatnonzero((steps == 0) | (steps > TURN // 2))
    if wrong.size or np.any(numbers[:, 1] != numbers[0, 1]):
        row = int(wrong[0]) + 1 if wrong.size else int(np.argmax(numbers[:, 1] != numbers[0, 1]))
        message = f"not a log of the penetrometer: row {row} is out of order; a count that rises and a constant"
        raise InputError(Fault(file=str(path), message=message))
    return np.asarray(np.concatenate([[0.0], np.cumsum(steps)]) / RATE)


def _book(path: Path) -> Path:
    """The workbook of factors: beside the log, or one folder up, as in the repository."""
    for folder in (path.parent, path.resolve().parent.parent):
        if (folder / FACTORS).is_file():
            return folder / FACTORS
    message = f"no calibration factors, got no {FACTORS} beside it or one folder up; it is in the same repository"
    raise InputError(Fault(file=str(path), message=message))


def _sheets(book: Path) -> Iterator[tuple[str, Factors]]:
    """Each pair of columns of each sheet that has an offset and a scale for every sensor."""
    for sheet, rows in read_workbook(book).items():
        heading = rows[0] if rows else ()
        for k in range(1, len(heading) - 1, 2):
            factors = {str(row[0]): (row[k], row[k + 1]) for row in rows[1:] if len(row) > k + 1}
            if set(SENSORS) <= set(factors) and all(_is_factor(factors[name]) for name in SENSORS):
                label = str(heading[k]).removesuffix("_offset")
                yield (
                    f"{sheet}, {label}",
                    {name: (float(a), float(b)) for name, (a, b) in factors.items() if name in SENSORS},
                )


def _is_factor(pair: Row) -> bool:
    return all(isinstance(x, (int, float)) and not isinstance(x, bool) for x in pair) and pair[1] != 0


def _apart(numbers: Array, factors: Factors) -> float:
    """How far the ranges lie apart, g, in the middle of the log."""
    middle = [
        float(np.median((numbers[:, k] + factors[sensor][0]) / factors[sensor][1]))
        for k, (sensor, column) in enumerate(SENSORS.items(), start=2)
        if column in AXIAL
    ]
    return max(middle) - min(middle)
