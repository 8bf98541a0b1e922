"""Rotations and axes: ISO 8855, x forward, y left, z up; yaw about z, then pitch about y, then roll about x.

Frames are letters: W world, V vehicle; R_WV takes vector components from V to W.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]

LOCKED = 1e-6  # cosine of a pitch at which rounding (1e-16) leaves roll and yaw no better than 1e-10
NEXT = 0.5  # rad between neighbours: those of a sample that turn by more do not say where the wrap was
OFF = 0.25  # rad, 1/25 of a turn: a mean of up to 25 samples of which one lies beyond the wrap is off by so much
SAME = 1e-9  # rad, and rad2 of what is squared: differences that rounding makes


def from_angles(roll: float, pitch: float, yaw: float) -> Array:
    """R_WV of ISO 8855 angles (rad), (3, 3): turn by yaw about z, then pitch about y, then roll about x."""
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def from_quaternion(wxyz: tuple[float, float, float, float]) -> Array:
    """R_WV of a quaternion w, x, y, z (scalar first, body to world), (3, 3); its length does not matter."""
    w, x, y, z = wxyz
    return np.asarray(Rotation.from_quat([x, y, z, w]).as_matrix())


def rotation_vector(R: Array) -> Array:
    """Rotation vector of a matrix, (3,), rad, shorter than pi."""
    axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    sine, cosine = 0.5 * math.sqrt(float(axis @ axis)), 0.5 * (float(np.trace(R)) - 1.0)
    if sine > 1e-7:
        return np.asarray(axis * (0.5 * math.atan2(sine, cosine) / sine))
    return np.asarray(Rotation.from_matrix(R).as_rotvec())  # no turn, or half a turn


def matrices(vectors: Array) -> Array:
    """Matrices of rotation vectors (n, 3) -> (n, 3, 3)."""
    return np.asarray(Rotation.from_rotvec(vectors).as_matrix())


def quaternions(vectors: Array) -> Array:
    """Quaternions xyzw of rotation vectors (n, 3) -> (n, 4), without jumps of sign along n."""
    q = np.asarray(Rotation.from_rotvec(vectors).as_quat())
    flips = np.cumprod(np.where(np.sum(q[1:] * q[:-1], axis=1) < 0.0, -1.0, 1.0))
    q[1:] *= flips[:, None]
    return q


def from_quaternions(quaternions: Array) -> Array:
    """Matrices of quaternions xyzw (n, 4) -> (n, 3, 3)."""
    return np.asarray(Rotation.from_quat(quaternions).as_matrix())


def angles(vectors: Array) -> tuple[Array, Array, Array]:
    """Roll, pitch, yaw (n,) of rotation vectors (n, 3), on one branch along n: pitch goes on beyond a right angle."""
    R = matrices(vectors)
    roll = np.arctan2(R[:, 2, 1], R[:, 2, 2])
    pitch = -np.arcsin(np.clip(R[:, 2, 0], -1.0, 1.0))
    yaw = np.arctan2(R[:, 1, 0], R[:, 0, 0])
    for k in np.flatnonzero(np.hypot(R[:, 0, 0], R[:, 1, 0]) < LOCKED):
        # only the sum or the difference of roll and yaw is one turn: roll stays as it was
        roll[k] = roll[k - 1] if k else 0.0
        sine, cosine = math.sin(roll[k]), math.cos(roll[k])
        yaw[k] = math.atan2(sine * R[k, 0, 2] - cosine * R[k, 0, 1], cosine * R[k, 1, 1] - sine * R[k, 1, 2])
    for angle in (roll, yaw):
        if angle.size and angle[0] < -math.pi + SAME:
            angle[0] = math.pi  # the sign of half a turn is rounding's
    found = one_branch(np.column_stack([roll, pitch, yaw]))
    return found[:, 0].copy(), found[:, 1].copy(), found[:, 2].copy()


def wrapped(angle: Array) -> Array:
    """Angles (rad) less whole turns, within half a turn to either side."""
    return np.asarray(angle - 2.0 * math.pi * np.round(angle / (2.0 * math.pi)))


def other_branch(rpy: Array) -> Array:
    """The same attitudes by the other roll, pitch, yaw (n, 3): roll + 180, 180 - pitch, yaw + 180 degrees."""
    return np.asarray(np.array([math.pi, math.pi, math.pi]) + rpy * np.array([1.0, -1.0, 1.0]))


def unwrapped(angle: Array) -> Array:
    """Angles (n,) without jumps of whole turns along n; gaps (NaN) are passed over."""
    known = np.isfinite(angle)
    found = angle.copy()
    found[known] = np.unwrap(angle[known])
    return found


def across_wraps(angle: Array) -> NDArray[np.bool_]:
    """Which angles (n,) are means over a wrap, as of a logger that averages: between its ends, on neither side; masks.

    The mean of +179 and -179 degrees is 0: one sample, or two side by side, that lie between neighbours of either end
    of the range, which are next to each other on the circle. Where its value was cannot be told from it, and its steps
    of half a turn lose the branch. Alone it is one where it lies off its neighbours by more than `OFF` and by more than
    thrice what these differ, two where all three steps are larger than a quarter of a turn.
    """
    found = np.zeros(angle.size, dtype=bool)
    known = np.flatnonzero(np.isfinite(angle))
    values = angle[known]
    for count in (1, 2):
        steps = np.diff(values)
        before, after = values[: -count - 1], values[count + 1 :]
        apart = after - before
        arc = np.abs(wrapped(apart))
        rows = (arc < NEXT) & (np.abs(apart) > math.pi)
        turned = np.abs(wrapped(np.concatenate([[np.nan], steps, [np.nan]])))
        around = np.column_stack([turned[: before.size], turned[turned.size - before.size :]])
        rows &= np.any(around < NEXT, axis=1) & ~np.any(around > NEXT, axis=1)  # what turns fast anyway is not told
        inside = np.column_stack([values[k : values.size - count - 1 + k] for k in range(1, count + 1)])
        low, high = np.minimum(before, after)[:, None], np.maximum(before, after)[:, None]
        rows &= np.all((low < inside) & (inside < high), axis=1)
        if count == 1:
            off = np.minimum(np.abs(wrapped(inside[:, 0] - before)), np.abs(wrapped(inside[:, 0] - after)))
            rows &= off > np.maximum(OFF, 3.0 * arc)
        else:
            each = np.column_stack([steps[k : steps.size - count + k] for k in range(count + 1)])
            rows &= np.all(each * np.sign(apart)[:, None] > 0.5 * math.pi, axis=1)
        for row in np.flatnonzero(rows):
            found[known[row + 1 : row + 1 + count]] = True
    return found


def one_branch(rpy: Array) -> Array:
    """Roll, pitch, yaw (n, 3) along n without jumps from branch to branch, of two or all three; NaN what is not known.

    Each row is given by the branch nearest to the row before, the first as it is.
    """
    several = np.flatnonzero(np.isfinite(rpy).sum(axis=1) >= 2)
    a, b = rpy[several[:-1]], rpy[several[1:]]
    steps, others = wrapped(b - a), wrapped(other_branch(b) - a)
    both = np.isfinite(steps).sum(axis=1) >= 2
    # both branches mirror alike, so that which of them is nearer is known without the row before being put right
    crossed = both & (np.nansum(others**2, axis=1) < np.nansum(steps**2, axis=1) - SAME)
    turned = np.zeros(rpy.shape[0], dtype=np.int64)
    turned[several[1:]] = crossed
    turned = np.cumsum(turned) % 2
    found = np.where(turned[:, None] == 1, other_branch(rpy), rpy)
    return np.column_stack([unwrapped(found[:, k]) for k in range(3)])
