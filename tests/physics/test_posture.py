"""Where bodies are and how they move for the few coordinates of a vehicle at rest: against SciPy and differences."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rollover.dynamics.posture import AXLE, PARTS, PITCH, ROLL, SLIDE, SWINGS, WITH_CHASSIS, YAW, move, put, vector_of
from rollover.kernels.dense import largest
from rollover.spec.frames import from_angles

HEADING = 0.4
NORMAL = np.array([0.1, -0.2, 0.97]) / np.linalg.norm([0.1, -0.2, 0.97])
FIRST = np.cross(NORMAL, [0.0, 1.0, 0.0]) / np.linalg.norm(np.cross(NORMAL, [0.0, 1.0, 0.0]))
PLACE = np.array([NORMAL, FIRST, np.cross(NORMAL, FIRST), [2.0, -1.0, 0.3]])
PIVOT = np.array([0.05, 0.02, 0.11])
CENTRES = np.array([[0.9, 0.0, 0.8], [1.8, 0.1, 0.5], [0.3, -0.1, 1.9]])
PART = np.array([WITH_CHASSIS, SWINGS, PARTS])
U = np.array([0.7, 0.5, -0.2, 0.15, 0.03, -0.04, 0.3, 0.01, -0.02, 0.03, 0.04, -0.05, 0.06])


def placed(u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    turns, q = np.empty((3, 3, 3)), np.empty(18)
    put(u, HEADING, PLACE, PIVOT, CENTRES, PART, turns, q)
    return turns, q


def test_bodies_are_put_where_the_coordinates_say() -> None:
    """x = base + u_0 n + u_4 e_1 + u_5 e_2 + R c; the axle turns about its pivot, a part by its own shift and tilt."""
    turns, q = placed(U)
    R = from_angles(U[ROLL], U[PITCH], HEADING + U[YAW])
    swung, tilted = R @ from_angles(U[AXLE], 0.0, 0.0), R @ from_angles(*U[PARTS + 3 :])
    origin = PLACE[3] + U[0] * PLACE[0] + U[SLIDE : SLIDE + 2] @ PLACE[1:3]
    places = (
        origin + R @ CENTRES[0],
        origin + R @ (CENTRES[1] + PIVOT) - swung @ PIVOT,
        origin + R @ (CENTRES[2] + U[PARTS : PARTS + 3]),
    )
    for b, (turn, place) in enumerate(zip((R, swung, tilted), places, strict=True)):
        np.testing.assert_allclose(turns[b], turn, atol=1e-15)
        np.testing.assert_allclose(q[6 * b : 6 * b + 3], place, atol=1e-14)
        np.testing.assert_allclose(Rotation.from_rotvec(q[6 * b + 3 : 6 * b + 6]).as_matrix(), turn, atol=1e-14)


def test_velocities_are_those_of_differences() -> None:
    """v_k = dx/du_k; the angular velocity in body axes is the skew part of R' dR/du_k. Differences are good to h^2."""
    turns, q = placed(U)
    rows, h = np.empty((U.size, 18)), 1e-5
    move(U, HEADING, PLACE, PIVOT, PART, turns, q, rows)
    for k in range(U.size):
        ahead, behind = (placed(U + sign * h * np.eye(U.size)[k]) for sign in (1.0, -1.0))
        for b in range(3):
            S = turns[b].T @ (ahead[0][b] - behind[0][b]) / (2.0 * h)
            spin = np.array([S[2, 1], S[0, 2], S[1, 0]])
            velocity = (ahead[1] - behind[1])[6 * b : 6 * b + 3] / (2.0 * h)
            np.testing.assert_allclose(rows[k, 6 * b : 6 * b + 3], velocity, atol=1e-9)
            np.testing.assert_allclose(rows[k, 6 * b + 3 : 6 * b + 6], spin, atol=1e-9)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-3, 1.0, 3.0, np.pi])
@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (0.0, -0.6, 0.8), (-0.48, 0.6, -0.64)])
def test_a_rotation_vector_is_found_for_any_turn(axis: tuple[float, ...], angle: float) -> None:
    R, v = Rotation.from_rotvec(angle * np.array(axis)).as_matrix(), np.empty(3)
    vector_of(R, v)
    assert np.linalg.norm(v) == pytest.approx(angle, abs=1e-12)
    np.testing.assert_allclose(Rotation.from_rotvec(v).as_matrix(), R, atol=1e-12)


def test_the_pace_of_all_of_bodies_and_of_no_number() -> None:
    qd = np.array([0.5, -2.0, 1.0, 30.0])
    assert (largest(qd), largest(qd[:3])) == (30.0, 2.0)
    assert (largest(qd), largest(qd[:4])) == (30.0, 30.0)
    assert np.isnan(largest(np.array([0.0, np.nan, 5.0])))
    for bad in (np.nan, np.inf, -np.inf):
        assert not np.isfinite(largest(np.array([0.0, bad, 0.0, 0.0])))
        assert not np.isfinite(largest(np.array([0.0, bad])))
