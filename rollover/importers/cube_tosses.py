"""Tosses of an acrylic cube onto a table, tracked by cameras (ContactNets)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fnmatch import fnmatch
from pathlib import Path

import numpy as np

from rollover.faults import Fault, InputError
from rollover.frames import angles
from rollover.importers.importer import Collection, check_claim, reading
from rollover.recording import Recording

RATE = 148.0  # Hz
MASS, INERTIA, EDGE = 0.37, 8.1e-4, 0.1048  # kg, kg m2 about each axis, m
COLUMNS = ("x", "y", "z", "qw", "qx", "qy", "qz", "vx", "vy", "vz", "wx", "wy", "wz")
_NOTES = (
    f"a cube of {MASS} kg, edge {EDGE} m, inertia {INERTIA} kg m2 about each axis; the table is at z = 0",
    "velocities are filtered differences of the tracked poses, not measured by themselves",
)


def _read(path: Path, select: Sequence[str]) -> Iterator[tuple[str, Recording]]:
    file = path / "cube_tosses.npz" if path.is_dir() else path
    with reading(file, "cube tosses"), np.load(file, allow_pickle=False) as found:
        data, length = np.asarray(found["data"]), np.asarray(found["length"])
        if tuple(map(str, found["columns"])) != COLUMNS or data.ndim != 2 or int(length.sum()) != len(data):
            message = "not the cube tosses, got other columns or rows; data, length and columns are needed"
            raise InputError(Fault(file=str(file), message=message))
        check_claim(file, data.size)
    at = 0
    for i, rows in enumerate(int(n) for n in length):
        name = f"toss{i:03d}"
        if any(fnmatch(name, pattern) for pattern in select):
            yield name, _toss(name, data[at : at + rows].astype(np.float64))
        at += rows


def _toss(name: str, rows: np.ndarray) -> Recording:
    scalar_first = _without_jumps(rows[:, 3:7])
    from scipy.spatial.transform import Rotation

    vectors = Rotation.from_quat(scalar_first[:, [1, 2, 3, 0]]).as_rotvec()
    roll, pitch, yaw = angles(vectors)
    channels = {f"chassis/position_{axis}": rows[:, k].copy() for k, axis in enumerate("xyz")}
    channels |= {f"chassis/quaternion_{axis}": scalar_first[:, k].copy() for k, axis in enumerate("wxyz")}
    channels |= {"chassis/roll": roll, "chassis/pitch": pitch, "chassis/yaw": yaw}
    channels |= {f"chassis/velocity_{axis}": rows[:, 7 + k].copy() for k, axis in enumerate("xyz")}
    channels |= {f"chassis/angular_velocity_{axis}": rows[:, 10 + k].copy() for k, axis in enumerate("xyz")}
    return Recording(
        title=f"Cube {name}",
        source=CUBE_TOSSES.source,
        time=np.arange(len(rows)) / RATE,
        channels=channels,
        notes=_NOTES,
    )


def _without_jumps(q: np.ndarray) -> np.ndarray:
    """Unit quaternions (n, 4) whose sign does not jump along n."""
    q = q / np.linalg.norm(q, axis=1)[:, None]
    flips = np.cumprod(np.where(np.sum(q[1:] * q[:-1], axis=1) < 0.0, -1.0, 1.0))
    q[1:] *= flips[:, None]
    return q


CUBE_TOSSES = Collection(
    name="cube-tosses",
    meaning="300 tosses of an acrylic cube onto a table, tracked poses, 148 Hz",
    citation="Pfrommer, Halm, Posa: ContactNets, CoRL 2020",
    licence="BSD-3-Clause",
    where="github.com/DAIRLab/contact-nets",
    read=_read,
)
