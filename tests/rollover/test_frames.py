"""ISO 8855 angles, rotation vectors and quaternions agree with each other."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rollover.spec.frames import angles, from_angles, matrices, quaternions, rotation_vector

ANGLE = st.floats(-3.1, 3.1)


@given(roll=ANGLE, pitch=st.floats(-1.5, 1.5), yaw=ANGLE)
def test_round_trip(roll: float, pitch: float, yaw: float) -> None:
    R = from_angles(roll, pitch, yaw)
    assert pytest.approx(np.eye(3), abs=1e-12) == R @ R.T
    assert np.linalg.det(R) == pytest.approx(1.0)
    vector = rotation_vector(R)
    assert matrices(vector[None])[0] == pytest.approx(R, abs=1e-9)
    assert np.ravel(angles(vector[None])) == pytest.approx([roll, pitch, yaw], abs=1e-7)


def test_signs_are_those_of_the_standard() -> None:
    """Roll > 0 lowers the right side, pitch > 0 the nose, yaw > 0 turns to the left."""
    assert (from_angles(0.1, 0, 0) @ [0, -1, 0])[2] < 0
    assert (from_angles(0, 0.1, 0) @ [1, 0, 0])[2] < 0
    assert (from_angles(0, 0, 0.1) @ [1, 0, 0])[1] > 0


def test_full_turns_do_not_jump() -> None:
    roll = np.linspace(0.0, 4 * math.pi, 400)
    vectors = np.array([rotation_vector(from_angles(r, 0.0, 0.0)) for r in roll])
    assert angles(vectors)[0] == pytest.approx(roll, abs=1e-7)
    assert np.abs(np.diff(quaternions(vectors), axis=0)).max() < 0.1
