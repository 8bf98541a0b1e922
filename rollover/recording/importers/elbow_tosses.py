"""Tosses of two links on a hinge onto a table, tracked by cameras: the hinge is on no list of effects.

As published: one tensor for each toss, 0.pt and so on: attitude and place of the first link, angle of the hinge, and
filtered differences of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rollover.recording import Clock, Recording
from rollover.recording.importers.importer import Collection
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

Array = NDArray[np.float64]
WIDTH = 15  # qw qx qy qz, x y z, angle; wx wy wz (body), vx vy vz, rate of the angle
MASS, INERTIA = 0.37, 6.167e-4  # kg, kg m2 about each axis: of one link
LENGTH, SIDE = 0.1, 0.05  # m, of a link: a box along x
HINGE = np.array([-0.035, 0.06, 0.0])  # m, in the axes of the first link; it turns about y
SECOND = np.array([0.035, 0.0, 0.0])  # m, centre of the second link from there, in its own axes
NEAR, SHARP = 0.03, 2  # m over the table in which a corner turns; rows before it does, in which it is slowed already
WITHIN = 3e-4  # s: the first row is the start
VELOCITY, SPIN = 0.001, 0.5  # m/s, rad/s: 1 sigma; links on a hinge do not turn as one body
BOX = 0.5 * np.array([LENGTH, SIDE, SIDE])[:, None] * np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1)


def _read(path: Path, select: Sequence[str]) -> Iterator[tuple[str, Recording]]:
    for name, file in toss_files(path, "elbow", select):
        yield name, _toss(file, name, read_toss(file, WIDTH, "a toss of the elbow"))


def _toss(file: Path, name: str, rows: Array) -> Recording:
    q = without_jumps(file, rows[:, :4])
    first, angle = rows[:, 4:7], rows[:, 7]
    centre, lowest = _both(first, q, angle)
    rate = (centre[1] - centre[0]) * RATE
    start = start_of(centre, q, np.concatenate([rate, rows[0, 8:11]]), _flight(lowest))
    kept = rows_kept(start, len(rows))
    notes = [
        f"two links of {MASS} kg, each a box of {LENGTH} x {SIDE} x {SIDE} m with {INERTIA} kg m2 about each axis; the"
        " second turns about y of the first, about a point 35 mm behind and 60 mm to the left of its centre",
        "the place is that of the centre of mass of both links, worked out from the first one's and the hinge's angle;"
        " the attitude is the first link's; the hinge is on no list of effects: a scenario of one rigid body lacks it",
        "velocities are left out: filtered differences of the tracked poses, not measured by themselves",
        start.note,
        f"in flight the links turn against each other: {SPIN} rad/s of the angular velocity are in doubt",
    ]
    notes += cut_off(len(rows), kept)
    channels = pose_channels(centre[:kept], q[:kept])
    channels["rops/hinge/elbow/angle_y"] = angle[:kept].copy()
    return Recording(
        title=f"Two links on a hinge, {name}",
        conditions={**start.conditions(), "vehicle.whole.mass": 2.0 * MASS},
        uncertainty={"initiation.velocity": (VELOCITY,) * 3, "initiation.angular_velocity": (SPIN,) * 3},
        source=ELBOW_TOSSES.source,
        time=np.arange(kept) / RATE,
        channels=channels,
        clock=Clock(zero="known", within=WITHIN),
        notes=tuple(notes),
    )


def _flight(lowest: Array) -> int:
    """Rows before the first contact: tracked corners turn a centimetre above the table that they come to rest on."""
    turns = np.flatnonzero((lowest[1:-1] < NEAR) & (lowest[1:-1] < lowest[:-2]) & (lowest[1:-1] < lowest[2:])) + 1
    return min(rows_of_flight(lowest), int(turns[0]) - SHARP if turns.size else len(lowest))


def _both(centre: Array, q: Array, angle: Array) -> tuple[Array, Array]:
    """Centre of mass of both links, (n, 3), and height of their lowest corner, (n,)."""
    from scipy.spatial.transform import Rotation

    R = Rotation.from_quat(q[:, [1, 2, 3, 0]]).as_matrix()
    turn = Rotation.from_rotvec(angle[:, None] * [0.0, 1.0, 0.0]).as_matrix()
    second = HINGE[:, None] + turn @ (SECOND[:, None] + BOX)
    both = np.concatenate([np.broadcast_to(BOX, second.shape), second], axis=2)
    lowest = centre[:, 2] + (R[:, 2:3] @ both)[:, 0].min(axis=1)
    return np.asarray(centre + 0.5 * (R @ (HINGE + turn @ SECOND)[:, :, None])[:, :, 0]), np.asarray(lowest)


ELBOW_TOSSES = Collection(
    name="elbow-tosses",
    meaning="tosses of two links on a hinge onto a table, tracked poses, 148 Hz: 0.pt, 1.pt and so on",
    citation="Bianchini, Halm, Posa: Simultaneous learning of contact and continuous dynamics, CoRL 2023",
    licence="BSD-3-Clause",
    where="github.com/DAIRLab/dair_pll, branch ebianchi/downstream",
    read=_read,
)
