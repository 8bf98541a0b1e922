"""Runs driven by prescribed signals against closed forms; the work of each in the ledger; nothing where it is null."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from rollover.dynamics.assembly import tables_of
from rollover.dynamics.bodies import bodies_of
from rollover.dynamics.prescribed import lines, spline, steered_kinetic, value_at, with_inputs
from rollover.dynamics.result import Run
from rollover.dynamics.simulate import run
from rollover.kernels.forces import generalised_forces, read_poses
from rollover.kernels.inputs import try_turning
from rollover.kernels.steering import steer
from rollover.kernels.tables import INPUT, OMEGA, P_INERTIA, VEL, W_AXIS, X, handle
from rollover.scenario import Scenario
from rollover.spec.frames import from_angles, matrices, rotation_vector
from rollover.spec.initiation import Release, Standing
from tests.physics.scenes import block, shipped
from tests.physics.test_tipping import HP, A, H, L, S, rigid_tractor
from tests.physics.test_wheels import MASS, ROLLING, done, driving

Array = NDArray[np.float64]
CLOSED = 5e-3  # of the energy released, at every time: what the project asks of every ledger


def driven(scenario: Scenario, *inputs: dict[str, Any], **changes: Any) -> Run:
    """A run with inputs, done, its ledger closed."""
    given = [{"name": f"input_{k}", **one} for k, one in enumerate(inputs)]
    return done(run(scenario.replaced({**changes, "inputs": given})))


def floating(duration: float = 1.0) -> Scenario:
    """A block of 500 kg far above the ground, without weight."""
    return block(Release(height=500.0), duration=duration).replaced({"gravity": 0.0})


TABLE = {"time": [0.1, 0.3, 0.6], "value": [0.0, 1000.0, 400.0]}
IMPULSE = 0.5 * 1000.0 * 0.2 + 700.0 * 0.3 + 400.0 * 0.4  # N s until 1 s: lines between, the last value held


def test_a_mass_gains_the_impulse_of_a_force_history() -> None:
    """v = integral F/m, and the work in the ledger is m v^2/2."""
    result = driven(floating(), {"kind": "force", "direction": [3.0, 0.0, 4.0], "force": TABLE})
    rec = result.recording
    assert rec["chassis/velocity_x"][-1] == pytest.approx(0.6 * IMPULSE / 500.0, rel=1e-4)
    assert rec["chassis/velocity_z"][-1] == pytest.approx(0.8 * IMPULSE / 500.0, rel=1e-4)
    assert result.ledger["input"] == pytest.approx(-0.5 * IMPULSE**2 / 500.0, rel=1e-4)
    np.testing.assert_allclose(rec["input/input_0/force"], np.interp(rec.time, TABLE["time"], TABLE["value"]))


def test_an_offset_shifts_a_signal_and_a_factor_scales_it() -> None:
    late = {**TABLE, "offset": 0.25, "factor": -2.0}
    rec = driven(floating(), {"kind": "force", "direction": [1.0, 0.0, 0.0], "force": late}).recording
    impulse = -2.0 * (IMPULSE - 400.0 * 0.25)
    assert rec["chassis/velocity_x"][-1] == pytest.approx(impulse / 500.0, rel=1e-4)


def test_a_force_in_body_axes_turns_with_the_body() -> None:
    """Off its centre along y by b it turns the body about z: I w' = -b F; its work is what the body then has."""
    force = {"kind": "force", "direction": [1.0, 0.0, 0.0], "point": [0.0, 0.3, 0.2], "force": 200.0}
    inertia = 500.0 * (1.0**2 + 0.6**2) / 12.0
    for axes in ("body", "world"):
        result = driven(floating(), {**force, "axes": axes})
        rec, turned = result.recording, -0.3 * 200.0 / inertia
        if axes == "body":
            assert rec["chassis/angular_velocity_z"][-1] == pytest.approx(turned, rel=1e-4)
            # the force has turned with it: v' = F/m (cos psi, sin psi), psi = turned t^2/2
            time = np.linspace(0.0, 1.0, 20001)
            assert rec["chassis/velocity_y"][-1] == pytest.approx(
                np.trapezoid(np.sin(0.5 * turned * time**2), time) * 200.0 / 500.0, rel=1e-3
            )
        else:
            assert abs(rec["chassis/velocity_y"][-1]) < 1e-9
        kinetic = rec["energy/kinetic"][-1]
        assert result.ledger["input"] == pytest.approx(-kinetic, rel=1e-4)


def test_a_null_signal_changes_no_bit() -> None:
    base = shipped("side_overturn").replaced({"simulation.duration": 1.2})
    nulls = [
        {"name": "tow", "kind": "force", "direction": [1.0, 2.0, 0.0], "force": {"time": [0.0, 1.0], "value": [0, 0]}},
        {"name": "quake", "kind": "shake", "direction": [0.0, 1.0, 0.0], "displacement": 0.0},
        {"name": "shock", "kind": "shake", "direction": [0.0, 1.0, 0.0], "acceleration": 0.0},
    ]
    without, with_ = run(base).recording, run(base.replaced({"inputs": nulls})).recording
    assert float(without["ground/force_normal"].max()) > 0.0
    for name in without.channels:
        np.testing.assert_array_equal(without[name], with_[name], err_msg=name)


def test_a_constant_steering_signal_is_the_angle_itself() -> None:
    fixed = run(driving({"initiation.steer_deg": 10.0})).recording
    signal = {"kind": "steering", "angle_deg": {"time": [0.0, 0.4, 0.8], "value": [10.0, 10.0, 10.0]}}
    given = driven(driving({}), signal).recording
    for name in fixed.channels:
        np.testing.assert_array_equal(fixed[name], given[name], err_msg=name)


# ---------------------------------------------------------------- motion of the ground

FREQUENCY, DECAY = 2.0, 0.25  # Hz of the shaking, damping ratio of the sprung mass
STIFFNESS, SPRUNG = 4.0e5, 3000.0


def sprung() -> Scenario:
    """A mass on four vertical springs and dashpots: a tractor without a pivot whose tyres are linear."""
    damping = 2.0 * DECAY * math.sqrt(STIFFNESS * SPRUNG) / 4.0
    base = rigid_tractor(swing_deg=None, stiffness=STIFFNESS / 4.0, step=5e-4)
    middle = {"vehicle.whole.centre_of_mass": [0.5 * L, 0.0, H], "vehicle.wheels.*.tyre.vertical_damping": damping}
    return base.replaced({**middle, "simulation.duration": 6.0, "initiation": Standing()})


@pytest.mark.parametrize("told", ["displacement", "acceleration"])
def test_transmissibility_of_a_sprung_mass(told: str) -> None:
    """|Z/Z0|^2 = (1 + (2 d r)^2)/((1 - r^2)^2 + (2 d r)^2), of absolute motion; r^2 instead above, of the relative."""
    w = 2.0 * math.pi * FREQUENCY
    r = w / math.sqrt(STIFFNESS / SPRUNG)
    time = np.arange(0.0, 6.5, 0.02)
    grown = 0.004 * np.minimum(time / 2.0, 1.0)
    values = grown * np.sin(w * time) * (1.0 if told == "displacement" else -(w**2))
    signal = {"time": time.tolist(), "value": values.tolist()}
    rec = driven(sprung(), {"kind": "shake", "direction": [0.0, 0.0, 2.0], told: signal}).recording
    late = rec.time > 5.0
    below = (1.0 - r**2) ** 2 + (2.0 * DECAY * r) ** 2
    relative = np.ptp(rec["chassis/position_z"][late]) / 2.0
    # two percent: the motion of the start, exp(-d w_n 3 s) of it is left, and lines between 25 samples a turn
    assert relative == pytest.approx(0.004 * r**2 / math.sqrt(below), rel=0.02)
    absolute = np.ptp(rec["chassis/acceleration_z"][late]) / 2.0
    assert absolute == pytest.approx(0.004 * w**2 * math.sqrt((1.0 + (2.0 * DECAY * r) ** 2) / below), rel=0.02)
    assert rec["energy/input"][-1] < -0.8 * 0.5 * SPRUNG * (0.004 * w) ** 2, "the ground does work"


def test_nothing_rests_for_good_before_the_shaking_is_over() -> None:
    late = {"time": [1.0, 1.1, 1.2], "value": [0.0, 0.01, 0.0]}
    shaken = driven(
        sprung().replaced({"simulation.stop_at_rest": True}),
        {"kind": "shake", "direction": [0.0, 0.0, 1.0], "displacement": late},
    )
    assert shaken.stop_time > 1.2
    assert np.ptp(shaken.recording["chassis/position_z"]) > 1e-3


def test_a_spline_starts_and_ends_at_rest_and_is_smooth() -> None:
    time = np.arange(0.0, 1.0001, 0.05)
    pieces = spline(time, 1.0 - np.cos(2.0 * np.pi * time))
    for t in (-1.0, 0.0, 0.33, 1.0, 2.0):
        inside = min(max(t, 0.0), 1.0)
        assert value_at(pieces, t) == pytest.approx(1.0 - math.cos(2.0 * math.pi * inside), abs=2e-5)
    h = np.diff(time)
    ends = 2.0 * pieces[:-1, 3] + 6.0 * h * pieces[:-1, 4]
    np.testing.assert_allclose(ends[:-1], 2.0 * pieces[1:-1, 3], atol=1e-9)
    assert pieces[0, 2] == pytest.approx(0.0, abs=1e-12)
    assert value_at(lines(np.array([0.0, 1.0]), np.array([1.0, 3.0])), 0.25) == pytest.approx(1.5)


# ---------------------------------------------------------------- a tilt table by its recorded angle


def ramp(to_deg: float, first: float = 0.0) -> dict[str, Any]:
    return {
        "kind": "table-angle",
        "angle_deg": {"time": [0.0, 0.5, 9.5, 10.0], "value": [first, first + 0.25, to_deg - 0.25, to_deg]},
    }


def test_it_tips_at_the_angle_of_the_closed_form() -> None:
    """tan b1 = s (1 - a/L)/(h - h_p a/L): the uphill rear wheel lifts at the instant at which the table is there."""
    expected = math.degrees(math.atan(S * (1 - A / L) / (H - HP * A / L)))
    flat = {f"vehicle.wheels.{e}_{s}.tyre.crown": 2e-5 for e in ("rear", "front") for s in ("left", "right")}
    base = rigid_tractor(swing_deg=12.0, step=1e-3).replaced({**flat, "initiation": {"kind": "tilt-table"}})
    result = driven(base, ramp(46.0, 40.0), **{"simulation.duration": 10.0})
    rec = result.recording
    angle = np.degrees(rec["input/input_0/angle"])
    lifted = int(np.argmax(rec["wheel/rear_right/force_normal"] <= 0.0))
    assert lifted > 0
    assert angle[lifted] == pytest.approx(expected, rel=0.01)
    late = 0.01 * expected / (5.5 / 9.0)  # s: those 1 % of the angle over its rate, deg/s
    assert rec.time[lifted] == pytest.approx(np.interp(expected, angle[:9500], rec.time[:9500]), abs=late)
    assert result.tests[0]["first_lift_off_deg"] == pytest.approx(expected, rel=0.01)


def test_turning_axes_add_what_a_free_body_does_not_feel() -> None:
    """A body that no force acts on goes straight and turns freely in the world: told in turning axes it does not.

    Both motions are worked out apart; what the kernel adds has to be m a, and J o' + o x J o, of the told one.
    """
    scenario = floating()
    bodies = bodies_of(scenario.vehicle, scenario.ground.elements, {})
    t = tables_of(scenario, bodies)
    m, J = t.mass[0, 0], t.mass[3:6, 3:6]

    def angle(s: float) -> float:
        """Of the axes about their x, rad."""
        return 0.3 + 0.8 * s + 0.5 * s**2

    pivot = np.array([0.0, 0.7, -0.4])
    start, speed, o0 = np.array([0.5, 1.0, 2.0]), np.array([1.0, -2.0, 0.7]), np.array([0.9, -1.1, 1.7])
    R0 = from_angles(0.4, -0.2, 1.1)

    def free(_: float, y: Array) -> Array:
        R, o = y[:9].reshape(3, 3), y[9:]
        skew = np.array([[0, -o[2], o[1]], [o[2], 0, -o[0]], [-o[1], o[0], 0]])
        return np.concatenate([(R @ skew).ravel(), np.linalg.solve(J, -np.cross(o, J @ o))])

    world = solve_ivp(free, (0.0, 1.0), [*R0.ravel(), *o0], rtol=1e-12, atol=1e-12, dense_output=True).sol

    def told(s: float) -> tuple[Array, Array, Array]:
        """Place against the axes, attitude against them, angular velocity against them in body axes."""
        T = from_angles(angle(s), 0.0, 0.0)
        R = T.T @ world(s)[:9].reshape(3, 3)
        rate = (angle(s + 1e-6) - angle(s - 1e-6)) / 2e-6
        return T.T @ (start + speed * s - pivot) + pivot, R, world(s)[9:] - R.T @ np.array([rate, 0.0, 0.0])

    d, s = 1e-3, 0.4
    (x0, _, o_before), (x1, R, o), (x2, _, o_after) = told(s - d), told(s), told(s + d)
    q, qd = np.concatenate([x1, rotation_vector(R)]), np.concatenate([(x2 - x0) / (2 * d), o])
    read_poses(t.pose, q, qd)
    np.testing.assert_allclose(t.pose[0, [X, VEL, OMEGA]], [x1[0], qd[0], o[0]])
    Q = np.zeros(6)
    try_turning(handle(t), np.array([0.0, *pivot[1:], 0.0, 0.0, 0.0]), 0.8 + s, 1.0, Q)
    np.testing.assert_allclose(Q[:3], m * (x2 - 2 * x1 + x0) / d**2, rtol=1e-4, atol=1e-2)
    np.testing.assert_allclose(Q[3:], J @ (o_after - o_before) / (2 * d) + np.cross(o, J @ o), rtol=1e-4, atol=1e-2)
    assert matrices(q[None, 3:])[0] == pytest.approx(R)


# ---------------------------------------------------------------- steering, engine, brakes


def test_a_steering_history_turns_the_tractor_as_its_angle_does() -> None:
    """Slowly, v/R = v tan(angle)/L at each instant: 12 degrees to the left, then to the right."""
    history = {"time": [0.5, 1.5, 3.0, 5.0], "value": [0.0, 12.0, 12.0, -12.0]}
    result = driven(driving({}, duration=6.0), {"kind": "steering", "angle_deg": history})
    rec = result.recording
    for first, last, deg in ((1.8, 3.0, 12.0), (5.2, 6.0, -12.0)):
        part = (rec.time > first) & (rec.time < last)
        speed = rec["chassis/velocity_x"][part] / np.cos(rec["chassis/yaw"][part])
        turned = rec["chassis/angular_velocity_z"][part].mean()
        assert turned == pytest.approx(speed.mean() * math.tan(math.radians(deg)) / L, rel=0.1)
    assert abs(result.ledger["input"]) > 0.0


def test_steering_keeps_momentum_and_books_its_energy() -> None:
    """Against L = I (s + omega . e) e and T = sum of the whole mass matrix, before and after the axles have turned."""
    signal = {"name": "steer", "kind": "steering", "angle_deg": {"time": [0.0, 1.0], "value": [0.0, 30.0]}}
    scenario = driving({"inputs": [signal]})
    bodies = bodies_of(scenario.vehicle, scenario.ground.elements, {})
    t = with_inputs(scenario, bodies, tables_of(scenario, bodies))
    kernels, n, axle = handle(t), len(t.spin_mass), 6 * [b.name for b in bodies].index("front_axle")
    q, qd = np.zeros(n), np.random.default_rng(1).normal(size=n)
    q[2 : len(t.mass) : 6] = 50.0  # no tyre touches
    t.clock[1] = 0.9
    generalised_forces(kernels, q, qd, np.zeros(n))
    spun, front = n - 4, [w for w in range(4) if t.wheel_i[w] == axle // 6]

    def told() -> tuple[float, Array, Array]:
        M = t.spin_mass.copy()
        M[: len(t.mass), : len(t.mass)] += t.mass
        e = t.wheel_f[front, W_AXIS : W_AXIS + 3]
        return (
            0.5 * float(qd @ M @ qd),
            t.spin_f[front, P_INERTIA] * (qd[spun:][front] + e @ qd[axle + 3 : axle + 6]),
            e,
        )

    before, momentum, _ = told()
    s = qd[None, spun:].copy()
    steer(kernels, qd)
    after, kept, new = told()
    turned = math.radians(27.0)
    np.testing.assert_allclose(new, [[-math.sin(turned), math.cos(turned), 0.0]] * 2)
    np.testing.assert_allclose(kept, momentum, rtol=1e-12)
    assert abs(after - before) > 0.01
    assert t.work[INPUT] == pytest.approx(before - after, abs=1e-8)  # rounding of 3 kJ
    # what a row of an earlier instant held is told from the axles as they are now
    whole = np.concatenate([qd[:spun], s[0]])
    M = t.spin_mass.copy()
    M[: len(t.mass), : len(t.mass)] += t.mass
    missing = steered_kinetic(t, np.zeros((1, 1)), qd[None, :spun].reshape(1, -1, 6), s)
    assert 0.5 * whole @ M @ whole + missing[0] == pytest.approx(before, rel=1e-12)
    # wheels that roll forward, turned to the left, lean their carrier to the right: -dL/dt = I s rate x, for e = y
    t.wheel_f[front, W_AXIS : W_AXIS + 3] = 0.0, 1.0, 0.0
    qd[:] = 0.0
    qd[spun:] = 20.0
    generalised_forces(kernels, q, qd, np.zeros(n))
    moment = float(t.spin_f[front, P_INERTIA].sum()) * 20.0 * math.radians(30.0)
    np.testing.assert_allclose(t.input_q[0, axle : axle + 6], [0.0, 0.0, 0.0, moment, 0.0, 0.0], atol=1e-9)


def test_the_work_of_steering_fast_wheels_is_booked() -> None:
    """Turned in the air at a constant rate, a spinning wheel's axle lifts its carrier: the ledger knows by what."""
    history = {"kind": "steering", "angle_deg": {"time": [0.02, 0.12], "value": [0.0, 40.0]}}
    result = driven(driving({"initiation.speed": 15.0, "vehicle.wheels.*.inertia": 8.0}, duration=0.3), history)
    rec = result.recording
    during = (rec.time > 0.05) & (rec.time < 0.12)
    # 8 kg m2 at 33 rad/s, turned by 7 rad/s: 1.9 kN m on the axle of each front wheel
    assert np.abs(rec["axle/front/angle"][during]).max() > 1e-3
    assert np.abs(rec["energy/residual"]).max() < 1e-3 * result.released


def test_a_torque_history_drives_and_brakes() -> None:
    """v = integral of T/r over m and what the wheels' inertia adds; the brakes' limit takes it back."""
    time, value = [0.2, 0.6, 1.0, 1.4], [0.0, 3000.0, 3000.0, 0.0]
    push = {"kind": "drive-torque", "torque": {"time": time, "value": value}}
    pushed = driven(driving({}, duration=2.0), push, **{"initiation.drive": {}})
    gained = float(np.ptp(pushed.recording["chassis/velocity_x"][[0, -1]]))
    assert gained == pytest.approx(np.trapezoid(value, time) / 0.70 / (MASS + ROLLING), rel=0.02)
    hold = {"kind": "brake-torque", "torque": {"time": time, "value": [0.5 * v for v in value]}}
    held = driven(driving({"initiation.speed": 6.0}, duration=2.0), hold, **{"initiation.brake": {"axle": "rear"}})
    lost = float(np.ptp(held.recording["chassis/velocity_x"][[0, -1]]))
    assert lost == pytest.approx(np.trapezoid(value, time) / 0.70 / (MASS + ROLLING), rel=0.02)
    assert held.ledger["drive"] > 0.0
