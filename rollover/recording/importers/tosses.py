"""What tosses of tracked bodies share: their files, attitudes without jumps, and the flight that they begin with."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.recording.importers.tensors import read_tensor
from rollover.system.errors import Fault, InputError

Array = NDArray[np.float64]
RATE, GRAVITY = 148.0, 9.81  # Hz, m/s2
AFTER = 0.1  # s after the first contact: what comes later is chance
CLEAR, LEAST_FLIGHT = 0.002, 5  # m under the lowest corner; rows before it touches
UNIT = 0.01  # by which a quaternion's length may be off


def toss_files(path: Path, prefix: str, select: Sequence[str]) -> Iterator[tuple[str, Path]]:
    """Name and file of each toss that is asked for: 7.pt is PREFIX007. Raises `InputError` if there is none at all."""
    files = [path] if not path.is_dir() else [p for p in path.glob("*.pt") if p.stem.isdecimal()]
    if not files:
        raise InputError(Fault(file=str(path), message="no tosses in this folder; files such as 0.pt are needed"))
    for file in sorted(files, key=lambda p: (len(p.stem), p.stem)):
        name = f"{prefix}{int(file.stem):03d}" if file.stem.isdecimal() else file.stem
        if any(fnmatch(name, pattern) for pattern in select):
            yield name, file


def read_toss(file: Path, columns: int, what: str) -> Array:
    """Rows of a toss, (n, columns). Raises `InputError` for a tensor of another shape, and for gaps."""
    rows = read_tensor(file)
    if rows.ndim == 3 and rows.shape[0] == 1:
        rows = rows[0]
    if rows.ndim != 2 or rows.shape[1] != columns or len(rows) < 2:
        message = f"not {what}, got a shape of {list(rows.shape)}; rows of {columns} columns are needed"
        raise InputError(Fault(file=str(file), message=message))
    if not np.isfinite(rows).all():
        row = int(np.argmin(np.isfinite(rows).all(axis=1)))
        raise InputError(Fault(file=str(file), message=f"row {row}: not a finite number; every row needs all"))
    return rows


def without_jumps(file: Path, q: Array) -> Array:
    """Unit quaternions (n, 4) whose sign does not jump along n, the first with w >= 0, as a simulation begins.

    Raises `InputError` for what are none.
    """
    size = np.linalg.norm(q, axis=1)
    off = np.flatnonzero(np.abs(size - 1.0) > UNIT)
    if off.size:
        message = f"row {int(off[0])}: not a quaternion, got a length of {size[off[0]]:.4g}; 0.99 to 1.01 is allowed"
        raise InputError(Fault(file=str(file), message=message))
    q = q / (size * (-1.0 if q[0, 0] < 0.0 else 1.0))[:, None]
    q[1:] *= np.cumprod(np.where(np.sum(q[1:] * q[:-1], axis=1) < 0.0, -1.0, 1.0))[:, None]
    return q


def rows_of_flight(lowest: Array) -> int:
    """Rows before the lowest corner, (n,) over the table, is next to it; all of them if it never is."""
    near = np.flatnonzero(lowest < CLEAR)
    return int(near[0]) if near.size else len(lowest)


@dataclass(frozen=True, kw_only=True)
class Start:
    """State at the first row, and rows of the flight before the first contact."""

    position: Array  # m
    velocity: Array  # m/s
    quaternion: Array  # scalar first
    angular_velocity: Array  # rad/s, body axes
    flight: int
    is_fitted: bool  # or else as recorded

    @property
    def note(self) -> str:
        """Where the start in a recording's conditions is from."""
        if self.is_fitted:
            return "the start in the conditions is that of a flight fitted to the poses before the first contact"
        return "touches too soon for a flight to be fitted: the start in the conditions is that of the filtered rates"

    def conditions(self) -> dict[str, Any]:
        """The start of a scenario that throws."""
        return {
            "initiation.position": self.position.tolist(),
            "initiation.velocity": self.velocity.tolist(),
            "initiation.quaternion": self.quaternion.tolist(),
            "initiation.angular_velocity": self.angular_velocity.tolist(),
        }


def rows_kept(start: Start, rows: int) -> int:
    """How many rows are kept: those until `AFTER` the first contact."""
    return min(start.flight + round(AFTER * RATE) + 1, rows)


def cut_off(rows: int, kept: int) -> list[str]:
    """A note of the rows that are not kept, where there are any."""
    if kept == rows:
        return []
    return [
        f"{rows - kept} rows from {AFTER:g} s after the first contact on cut off: tumbling is chaotic, what"
        " comes later says more of the start than of the physics"
    ]


def pose_channels(centre: Array, q: Array) -> dict[str, Array]:
    """Channels of a body's centre (n, 3), m, and of its quaternion (n, 4), w first."""
    found = {f"chassis/position_{axis}": centre[:, k].copy() for k, axis in enumerate("xyz")}
    return found | {f"chassis/quaternion_{axis}": q[:, k].copy() for k, axis in enumerate("wxyz")}


def start_of(centre: Array, q: Array, rates: Array, flight: int) -> Start:
    """A flight without forces but gravity, fitted to the first `flight` rows: a parabola, and a constant turn.

    `centre` (n, 3) and `q` (n, 4) are poses, `rates` (6,) what is recorded at the first row. The turn of a body with
    the same inertia about each axis is constant. With fewer than five rows before it touches the recorded rates stand.
    """
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_quat(q[:, [1, 2, 3, 0]])
    place, velocity, spin, first = centre[0], rates[:3], rates[3:], turn[0]
    if flight >= LEAST_FLIGHT:
        t = np.arange(flight) / RATE
        A = np.stack([np.ones_like(t), t], axis=1)
        fallen = centre[:flight] + 0.5 * GRAVITY * t[:, None] ** 2 * [0.0, 0.0, 1.0]
        place, velocity = np.linalg.lstsq(A, fallen, rcond=None)[0]
        turned, along = np.linalg.lstsq(A, (turn[:flight] * turn[0].inv()).as_rotvec(), rcond=None)[0]
        first = Rotation.from_rotvec(turned) * turn[0]
        spin = first.inv().apply(along)
    begun = first.as_quat()[[3, 0, 1, 2]]
    return Start(
        position=place,
        velocity=velocity,
        quaternion=begun if begun @ q[0] > 0.0 else -begun,  # one of both that say the same: that of the first row
        angular_velocity=spin,
        flight=flight,
        is_fitted=flight >= LEAST_FLIGHT,
    )
