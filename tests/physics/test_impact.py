"""Momentum exchange at restitution 0: an oblique hit of several points against a rigid-body calculation."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from ground.kernel import BODY, MASS_B, NORMAL, OWNER_R
from rollover.dynamics.assembly import tables_of
from rollover.dynamics.bodies import bodies_of
from rollover.kernels.forces import generalised_forces
from rollover.kernels.step import end_of_step, start_step
from rollover.kernels.tables import ACTIVE, COLLISION, R_IMPULSE, Tables, handle
from rollover.scenario import Scenario
from rollover.spec.frames import from_angles, rotation_vector
from rollover.spec.initiation import Drop
from tests.physics.scenes import block, shipped

Array = NDArray[np.float64]


def hit(scenario: Scenario, R: Array, v: Array, omega: Array, depth: float = 1e-9) -> tuple[Tables, Array, Array]:
    """Put the vehicle with attitude R and velocities just into the ground, end one step; tables, v before, v after."""
    bodies = bodies_of(scenario.vehicle, scenario.ground.elements)
    t = tables_of(scenario, bodies)
    lowest = min(float((points.position @ R.T)[:, 2].min()) for body in bodies for _, points in body.surfaces)
    q, qd = np.zeros(6 * len(bodies)), np.zeros(6 * len(bodies))
    first = bodies[0].centre
    for b, body in enumerate(bodies):
        q[6 * b : 6 * b + 3] = R @ body.centre + [0, 0, -lowest - depth]
        q[6 * b + 3 : 6 * b + 6] = rotation_vector(R)
        spin = R @ omega
        qd[6 * b : 6 * b + 3] = v + np.cross(spin, R @ (body.centre - first))
        qd[6 * b + 3 : 6 * b + 6] = omega
    before, Q = qd.copy(), np.zeros_like(qd)
    kernels = handle(t)
    generalised_forces(kernels, q, qd, Q)
    start_step(kernels)
    end_of_step(kernels, q, qd, np.zeros_like(qd), 1e-4, Q, False)
    return t, before, qd


def rows(t: Tables, R: Array) -> tuple[Array, Array]:
    """Jacobian rows dz/dt of the contacts by the textbook, v + w x r, and their masses."""
    J, masses = [], []
    for slot in t.active[: t.counts[ACTIVE]]:
        m = t.memory[slot]
        n, r, body = m[NORMAL : NORMAL + 3], m[OWNER_R : OWNER_R + 3], t.state[slot, BODY]
        row = np.zeros(len(t.mass))
        row[6 * body : 6 * body + 3] = -n
        row[6 * body + 3 : 6 * body + 6] = -np.cross(R @ r, n) @ R
        J.append(row)
        masses.append(m[MASS_B])
    return np.array(J), np.array(masses)


@settings(max_examples=25, deadline=None)
@given(
    roll=st.floats(-0.3, 0.3),
    pitch=st.floats(-0.3, 0.3),
    vx=st.floats(-3, 3),
    vz=st.floats(-6, -1),
    wx=st.floats(-2, 2),
    wy=st.floats(-2, 2),
    fraction=st.sampled_from([0.05, 0.1, 0.33, 4.0]),
)
def test_an_oblique_hit_is_the_plastic_rigid_body_impact(
    roll: float, pitch: float, vx: float, vz: float, wx: float, wy: float, fraction: float
) -> None:
    """M (v+ - v-) = -sum J' p with p_i = m_i J_i v+ (masses at rest before, no separation), lost = T- - T+."""
    R = from_angles(roll, pitch, 0.4)
    scenario = block(Drop(speed=1.0), fraction=fraction)
    t, before, after = hit(scenario, R, np.array([vx, 0.5, vz]), np.array([wx, wy, 0.3]), depth=0.02)
    J, masses = rows(t, R)
    assert len(J) > 1
    impulse = masses * (J @ after)
    assert np.all(impulse >= -1e-9)
    assert t.mass @ (after - before) == pytest.approx(-J.T @ impulse, abs=1e-8)
    kinetic = 0.5 * before @ t.mass @ before, 0.5 * after @ t.mass @ after + 0.5 * masses @ (J @ after) ** 2
    assert t.work[COLLISION] == pytest.approx(kinetic[0] - kinetic[1], rel=1e-9, abs=1e-9)
    assert kinetic[1] <= kinetic[0]
    assert t.resultant[0, R_IMPULSE + 2] == pytest.approx(impulse.sum(), rel=1e-9, abs=1e-12)
    # the soil never is more than its fraction of the body, in whatever direction it moves
    if masses.sum() > 0.0:
        added = np.einsum("i,ij,ik->jk", masses, J, J)
        assert np.linalg.eigvals(np.linalg.solve(t.mass, added)).real.max() <= fraction * (1 + 1e-6)


def test_flat_hit_divides_the_mass_among_elements() -> None:
    """A block of 500 kg flat on 240 elements: 50 kg of soil altogether, 1/11 of the kinetic energy lost."""
    t, before, after = hit(block(Drop(speed=1.0)), np.eye(3), np.array([0.0, 0.0, -3.0]), np.zeros(3))
    _, masses = rows(t, np.eye(3))
    assert len(masses) > 100
    # an element's owner is one of its points, so that a symmetric face is felt a trifle off its middle
    assert masses.sum() == pytest.approx(50.0, rel=2e-3)
    assert after[2] == pytest.approx(before[2] / 1.1, rel=2e-3)
    assert t.work[COLLISION] == pytest.approx(0.5 * 500 * 9 / 11, rel=2e-3)


def test_distant_corners_do_not_share_what_they_do_not_feel() -> None:
    """Two points of percussion: of a bar of length l hit at both ends, either end feels m/4 of it.

    1/m_eff = 1/m + (l/2)^2/(m l^2/12) = 4/m, correlation (1/m - 3/m)/(4/m) = -1/2: masses f m/4 / (1 + 1/2) each.
    """
    scenario = block(Drop(speed=1.0), size=(3.0, 0.01, 0.01), spacing=0.1)
    t, _, _ = hit(scenario, from_angles(0.0, 1e-9, 0.0), np.array([0.0, 0.0, -3.0]), np.zeros(3), depth=1e-10)
    J, masses = rows(t, np.eye(3))
    added = np.einsum("i,ij,ik->jk", masses, J, J)
    assert np.linalg.eigvals(np.linalg.solve(t.mass, added)).real.max() <= 0.1 * (1 + 1e-6)


def test_joints_take_their_part() -> None:
    """With the front axle hit, chassis and axle keep the pivot's velocity in common, and momentum is exact."""
    scenario = shipped("side_overturn")
    R = from_angles(np.pi / 2, 0.0, 0.0)
    t, before, after = hit(scenario, R, np.array([0.0, 0.0, -4.0]), np.zeros(3), depth=0.01)
    J, masses = rows(t, R)
    assert masses.sum() > 1.0
    axle, chassis = 1, 0
    a, b = t.joint_f[0, :3], t.joint_f[0, 3:]

    def pivot(qd: Array, body: int, r: Array) -> Array:
        return qd[6 * body : 6 * body + 3] + R @ np.cross(qd[6 * body + 3 : 6 * body + 6], r)

    assert pivot(after, chassis, a) == pytest.approx(pivot(after, axle, b), abs=1e-9)
    moved = t.mass @ (after - before)
    total = sum(moved[6 * body : 6 * body + 3] for body in range(3))
    assert total == pytest.approx([0.0, 0.0, (masses * (J @ after)).sum()], abs=1e-6)


def test_effective_mass_at_the_upper_corner() -> None:
    """1/m_eff = n'[1/M + (r x)' J^-1 (r x)]n: 445 kg at the ROPS corner of a 3 t utility tractor taken as rigid."""
    mass, inertia = 3000.0, np.diag([1300.0, 3000.0, 3300.0])
    roll = np.radians(98.2)
    n_world = np.array([0.0, 0.0, 1.0])
    n = from_angles(roll, 0.0, 0.0).T @ n_world
    r = np.array([0.0 - 0.9, -0.6, 2.5 - 0.82])  # corner over the rear axle, on the side that lands
    arm = np.cross(r, n)
    textbook = 1.0 / (1.0 / mass + arm @ np.linalg.solve(inertia, arm))
    scenario = block(Drop(speed=1.0))
    bodies = bodies_of(scenario.vehicle, scenario.ground.elements)
    t = tables_of(scenario, bodies)
    whole = np.diag([mass] * 3 + [1300.0, 3000.0, 3300.0])
    t = t._replace(mass=whole, inverse=np.linalg.inv(whole))
    from rollover.kernels.impact import mobility
    from rollover.kernels.tables import ROT
    from rollover.kernels.vectors import depth_row

    t.pose[0, ROT : ROT + 9] = from_angles(roll, 0.0, 0.0).ravel()
    J = np.zeros(6)
    depth_row(t.pose[0], r, n_world, J)
    assert 1.0 / (J @ mobility(handle(t)) @ J) == pytest.approx(textbook, rel=1e-12)
