"""Tosses of an acrylic cube onto a table, tracked by cameras (ContactNets).

As published: one tensor for each toss, 0.pt and so on, lengths in half edges of the cube. All tosses in one
`cube_tosses.npz`, in metres, are read as well.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fnmatch import fnmatch
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rollover.recording import Clock, Recording
from rollover.recording.importers.importer import Collection, reading
from rollover.recording.importers.npz import arrays_of
from rollover.recording.importers.tosses import (
    RATE,
    cut_off,
    pose_channels,
    read_toss,
    rows_kept,
    rows_of_flight,
    start_of,
    toss_files,
    without_jumps,
)
from rollover.system.errors import Fault, InputError

Array = NDArray[np.float64]
MASS, INERTIA, EDGE = 0.37, 8.1e-4, 0.1048  # kg, kg m2 about each axis, m
COLUMNS = ("x", "y", "z", "qw", "qx", "qy", "qz", "vx", "vy", "vz", "wx", "wy", "wz")
WIDTH = len(COLUMNS) + 6  # of a tensor: the controls behind are all zero
METRES = np.array([0.5 * EDGE] * 3 + [1.0] * 4 + [0.5 * EDGE] * 3 + [1.0] * 3)  # of a tensor's columns
LOWEST = 0.005  # m by which the table may lie off the zero of the poses
ALONG = ("chassis/position_x", "chassis/position_y")
MOVED = 0.3  # of the longer way along the table, that the cube must move along an axis
RESTS, AT_REST = 5, 0.0005  # rows, m by which their lowest corner may move
VELOCITY, SPIN = 0.001, 0.007  # m/s, rad/s: 1 sigma of a start that is fitted to a flight of usual length
WITHIN = 3e-4  # s: the first row is the start
CORNERS = 0.5 * EDGE * np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1)


def _read(path: Path, select: Sequence[str]) -> Iterator[tuple[str, Recording]]:
    one = path / "cube_tosses.npz" if path.is_dir() else path
    if one.suffix == ".npz" and one.is_file():
        yield from _repackaged(one, select)
        return
    for name, file in toss_files(path, "toss", select):
        rows = read_toss(file, WIDTH, "a toss of the cube")
        yield name, _toss(file, name, rows[:, : len(COLUMNS)] * METRES)


def _repackaged(file: Path, select: Sequence[str]) -> Iterator[tuple[str, Recording]]:
    with reading(file, "cube tosses"), arrays_of(file) as found:
        data, length = np.asarray(found["data"]), np.asarray(found["length"])
        if tuple(map(str, found["columns"])) != COLUMNS or data.ndim != 2 or int(length.sum()) != len(data):
            message = "not the cube tosses, got other columns or rows; data, length and columns are needed"
            raise InputError(Fault(file=str(file), message=message))
    at = 0
    for i, rows in enumerate(int(n) for n in length):
        name = f"toss{i:03d}"
        if any(fnmatch(name, pattern) for pattern in select):
            yield name, _toss(file, name, data[at : at + rows].astype(np.float64))
        at += rows


def _toss(file: Path, name: str, rows: Array) -> Recording:
    from scipy.spatial.transform import Rotation

    q = without_jumps(file, rows[:, 3:7])
    matrices = Rotation.from_quat(q[:, [1, 2, 3, 0]]).as_matrix()
    lowest = rows[:, 2] + (matrices[:, 2] @ CORNERS).min(axis=1)
    start = start_of(rows[:, :3], q, rows[0, 7:13], rows_of_flight(lowest))
    table = _table(lowest)
    centre = rows[:, :3] - [0.0, 0.0, table or 0.0]
    kept = rows_kept(start, len(rows))
    conditions = {**start.conditions(), "vehicle.whole.mass": MASS}
    conditions["initiation.position"][2] -= table or 0.0
    notes = [
        f"a cube of {MASS} kg, edge {EDGE} m, inertia {INERTIA} kg m2 about each axis; the table is at z = 0",
        "the table is where the cube comes to rest, "
        + (
            f"{1e3 * table:+.1f} mm from the zero of the poses" if table is not None else "which it does not: as stated"
        ),
        "velocities are left out: filtered differences of the tracked poses, not measured by themselves; roll, pitch"
        " and yaw too, they are the quaternion once more and jump",
        start.note,
    ]
    notes += cut_off(len(rows), kept)
    channels = pose_channels(centre[:kept], q[:kept])
    return Recording(
        title=f"Cube {name}",
        conditions=conditions,
        uncertainty={"initiation.velocity": (VELOCITY,) * 3, "initiation.angular_velocity": (SPIN,) * 3},
        source=CUBE_TOSSES.source,
        time=np.arange(kept) / RATE,
        channels=channels,
        clock=Clock(zero="known", within=WITHIN),
        notes=tuple(notes),
    )


def _table(lowest: Array) -> float | None:
    """Height of the table over the zero of the poses, m: that of the lowest corner at rest; None if there is none."""
    last = lowest[-RESTS:]
    found = float(np.median(last))
    return found if np.ptp(last) < AT_REST and abs(found) < LOWEST else None


def _along(toss: Recording) -> list[str]:
    """Places along the table, where friction acts, on axes along which the cube moves.

    Hard ground turns and lifts a cube otherwise than a table that gives way. An axis along which the cube moves little
    tells of nothing that a share of its own range could be allowed for.
    """
    way = {c: float(np.ptp(toss[c])) for c in ALONG}
    return [c for c in ALONG if way[c] > MOVED * max(way.values())] or list(ALONG)


CUBE_TOSSES = Collection(
    name="cube-tosses",
    meaning="tosses of an acrylic cube onto a table, tracked poses, 148 Hz: 0.pt, 1.pt and so on",
    citation="Pfrommer, Halm, Posa: ContactNets, CoRL 2020",
    licence="BSD-3-Clause",
    where="github.com/DAIRLab/contact-nets, data/tosses_processed",
    read=_read,
    channels=_along,
)
