"""Tosses of an acrylic cube onto a table, tracked by cameras (ContactNets)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.faults import Fault, InputError
from rollover.frames import angles
from rollover.importers.importer import Collection, check_claim, reading
from rollover.recording import Recording

Array = NDArray[np.float64]
RATE, GRAVITY = 148.0, 9.81  # Hz, m/s2
CLEAR, LEAST_FLIGHT = 0.002, 5  # m under the lowest corner; rows before it touches
MASS, INERTIA, EDGE = 0.37, 8.1e-4, 0.1048  # kg, kg m2 about each axis, m
COLUMNS = ("x", "y", "z", "qw", "qx", "qy", "qz", "vx", "vy", "vz", "wx", "wy", "wz")
_NOTES = (
    f"a cube of {MASS} kg, edge {EDGE} m, inertia {INERTIA} kg m2 about each axis; the table is at z = 0",
    "velocities are filtered differences of the tracked poses, not measured by themselves; the start in the"
    " conditions is that of a flight fitted to the poses before the first contact",
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
        conditions=_start(rows[:, :3], Rotation.from_quat(scalar_first[:, [1, 2, 3, 0]]), rows[0, 7:]),
        source=CUBE_TOSSES.source,
        time=np.arange(len(rows)) / RATE,
        channels=channels,
        notes=_NOTES,
    )


def _start(centre: Array, turn: Any, rates: Array) -> dict[str, Any]:
    """Where and how fast the cube is at its first row: a flight without forces but gravity, fitted to the rows of it.

    Of a cube the turn is constant too. With fewer than five rows before it touches the recorded rates stand.
    """
    corners = 0.5 * EDGE * np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1)
    lowest = centre[:, 2] + (turn.as_matrix()[:, 2] @ corners).min(axis=1)
    flight = int(np.argmax(lowest < CLEAR)) if np.any(lowest < CLEAR) else len(centre)
    place, velocity, spin, first = centre[0], rates[:3], rates[3:], turn[0]
    if flight >= LEAST_FLIGHT:
        t = np.arange(flight) / RATE
        A = np.stack([np.ones_like(t), t], axis=1)
        fallen = centre[:flight] + 0.5 * GRAVITY * t[:, None] ** 2 * [0.0, 0.0, 1.0]
        place, velocity = np.linalg.lstsq(A, fallen, rcond=None)[0]
        turned, along = np.linalg.lstsq(A, (turn[:flight] * turn[0].inv()).as_rotvec(), rcond=None)[0]
        first = type(turn).from_rotvec(turned) * turn[0]
        spin = first.inv().apply(along)
    x, y, z, w = first.as_quat()
    return {
        "initiation.position": place.tolist(),
        "initiation.velocity": velocity.tolist(),
        "initiation.quaternion": [float(w), float(x), float(y), float(z)],
        "initiation.angular_velocity": spin.tolist(),
        "vehicle.whole.mass": MASS,
    }


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
