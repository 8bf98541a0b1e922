"""Rotations and axes: ISO 8855, x forward, y left, z up; yaw about z, then pitch about y, then roll about x.

Frames are letters: W world, V vehicle; R_WV takes vector components from V to W.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]


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
    """Roll, pitch, yaw (n,) of rotation vectors (n, 3), roll and yaw unwrapped along n."""
    R = matrices(vectors)
    roll = np.arctan2(R[:, 2, 1], R[:, 2, 2])
    pitch = -np.arcsin(np.clip(R[:, 2, 0], -1.0, 1.0))
    yaw = np.arctan2(R[:, 1, 0], R[:, 0, 0])
    return np.unwrap(roll), pitch, np.unwrap(yaw)
