"""The front axle's stop as an impact: angular momentum about the pivot, restitution, the energy that it takes."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray

from rollover.dynamics.assembly import tables_of
from rollover.dynamics.bodies import bodies_of
from rollover.dynamics.simulate import run
from rollover.kernels.forces import generalised_forces
from rollover.kernels.impact import constraints
from rollover.kernels.step import end_of_step, start_step
from rollover.kernels.tables import AXLE, M_IMPULSE, Tables, handle
from rollover.scenario import Scenario
from rollover.spec.frames import from_angles, rotation_vector
from rollover.spec.inertia import MassProperties, combined
from rollover.spec.vehicle import FrontAxle, Vehicle
from tests.physics.scenes import shipped

Array = NDArray[np.float64]
CHASSIS, BEAM = 900.0, 60.0  # kg m2 about the pivot


def two_bodies(e: float, centred: bool = True) -> Scenario:
    """Chassis and axle in space on one pivot along x, centres of mass on its axis unless said otherwise."""
    high = 0.5 if centred else 0.9
    axle = FrontAxle(
        pivot=(2.0, 0.0, 0.5),
        body=MassProperties(mass=200.0, centre_of_mass=(2.0, 0.0, 0.5 if centred else 0.4), inertia=(BEAM, 40.0, 60.0)),
        swing_deg=10.0,
        stop_stiffness=1e5,
        stop="impact",
        stop_restitution=e,
    )
    chassis = MassProperties(mass=1800.0, centre_of_mass=(0.8, 0.0, high), inertia=(CHASSIS, 2000.0, 2200.0))
    vehicle = Vehicle(name="two bodies", whole=combined([chassis, axle.body]), front_axle=axle)
    side = shipped("side_overturn")
    rig = shipped("rops_drop")
    outline = rig.vehicle.outline  # type: ignore[union-attr]
    return dataclasses.replace(
        side, vehicle=dataclasses.replace(vehicle, outline=outline), initiation=rig.initiation, gravity=0.0
    )


def struck(scenario: Scenario, chassis_rate: float, axle_rate: float) -> tuple[Tables, Array, Array]:
    """The axle swings freely to 9.99 degrees, a step later it stands at 10.01: tables, velocities before and after."""
    bodies = bodies_of(scenario.vehicle, scenario.ground.elements)
    t = tables_of(scenario, bodies)
    kernels = handle(t)
    qd, Q = np.zeros(12), np.zeros(12)
    qd[3], qd[9] = chassis_rate, axle_rate
    pivot, high = np.array([2.0, 0.0, 0.5]), np.array([0.0, 0.0, 50.0])
    qd[0:3] = np.cross([chassis_rate, 0, 0], bodies[0].centre - pivot)
    for degrees in (9.99, 10.01):
        R = from_angles(np.radians(degrees), 0.0, 0.0)
        q = np.zeros(12)
        q[0:3] = bodies[0].centre + high
        q[6:9] = pivot + R @ (bodies[1].centre - pivot) + high
        q[9:12] = rotation_vector(R)
        qd[6:9] = np.cross([axle_rate, 0, 0], R @ (bodies[1].centre - pivot))
        before = qd.copy()
        generalised_forces(kernels, q, qd, Q)
        start_step(kernels)
        end_of_step(kernels, q, qd, np.zeros(12), 1e-3, Q, False)
    return t, before, qd


@pytest.mark.parametrize("e", [0.0, 0.4, 1.0])
def test_two_bodies_about_a_common_axis(e: float) -> None:
    """Centres on the axis: I_c w_c + I_a w_a is kept, the relative rate turns to -e times itself, and

    T- - T+ = (1 - e^2)/2 I_c I_a/(I_c + I_a) (w_a - w_c)^2; the impulse is (1 + e) I_c I_a/(I_c + I_a) (w_a - w_c).
    """
    w_c, w_a = 0.3, 2.1
    t, before, after = struck(two_bodies(e), w_c, w_a)
    reduced = CHASSIS * BEAM / (CHASSIS + BEAM)
    assert CHASSIS * after[3] + BEAM * after[9] == pytest.approx(CHASSIS * w_c + BEAM * w_a, rel=1e-12)
    assert after[9] - after[3] == pytest.approx(-e * (w_a - w_c), abs=1e-12)
    assert t.work[AXLE] == pytest.approx(0.5 * (1.0 - e * e) * reduced * (w_a - w_c) ** 2, rel=1e-10, abs=1e-9)
    assert t.axle_memory[M_IMPULSE] == pytest.approx((1.0 + e) * reduced * (w_a - w_c), rel=1e-12)
    assert after[[0, 1, 2, 6, 7, 8]] == pytest.approx(before[[0, 1, 2, 6, 7, 8]], abs=1e-12)


def test_off_the_axis_the_pivot_takes_its_part() -> None:
    """Whatever the geometry: momentum changes by joint reactions and a couple about the pivot alone; G v+ = G v-."""
    e = 0.3
    t, before, after = struck(two_bodies(e, centred=False), -0.2, 1.6)
    G = constraints(handle(t))
    couple = np.zeros(12)
    couple[3], couple[9] = -1.0, 1.0
    assert G @ after == pytest.approx(G @ before, abs=1e-10)
    assert couple @ after == pytest.approx(-e * (couple @ before), abs=1e-10)
    change = t.mass @ (after - before)
    basis = np.vstack([G, couple]).T
    found, *_ = np.linalg.lstsq(basis, change, rcond=None)
    assert basis @ found == pytest.approx(change, abs=1e-8)
    assert abs(found[-1]) == pytest.approx(t.axle_memory[M_IMPULSE], rel=1e-9)
    assert np.abs(change[:3]).max() > 1.0  # the pivot pushed
    lost = 0.5 * before @ t.mass @ before - 0.5 * after @ t.mass @ after
    assert t.work[AXLE] == pytest.approx(lost, rel=1e-10)


def test_an_axle_that_leaves_its_stop_is_not_struck() -> None:
    t, before, after = struck(two_bodies(0.5), 0.5, 0.1)
    assert after == pytest.approx(before, abs=0.0)
    assert t.work[AXLE] == 0.0


@pytest.mark.parametrize("e", [0.0, 0.5])
def test_in_an_overturn_it_is_booked_and_told(e: float) -> None:
    """The tractor's axle swings over to its other stop while it falls."""
    changes = {"vehicle.front_axle.stop": "impact", "vehicle.front_axle.stop_restitution": e}
    result = run(shipped("side_overturn").replaced(changes))
    assert result.status == "done"
    assert np.abs(result.recording["energy/residual"]).max() < 5e-3 * result.released
    impulse = result.recording["axle/front/impulse"]
    assert impulse[0] == 0.0  # it leans on its stop at the start
    assert np.all(np.diff(impulse) >= 0.0)
    told = [ev for ev in result.events if ev.kind == "axle-stop" and "N m s" in ev.detail]
    assert (impulse[-1] > 0.0) == bool(told)
    assert impulse[-1] > 1.0
    # struck on reaching 12 degrees, not a step later than that takes
    struck_at = np.degrees(np.abs(result.recording["axle/front/angle"][1:][np.diff(impulse) > 0.0]))
    assert np.all((struck_at >= 12.0) & (struck_at < 12.3))


def test_a_compliant_stop_has_no_impulse() -> None:
    result = run(shipped("side_overturn").replaced({"simulation.duration": 0.2}))
    assert "axle/front/impulse" not in result.recording.channels
