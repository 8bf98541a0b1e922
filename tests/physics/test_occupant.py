"""An occupant of three bodies: joints, belt and contacts by hand; a chain's periods; sag, belt and ledger in runs."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from ground.array import Elements
from ground.hard import Hard
from rollover.assessment.ledger import closure
from rollover.dynamics import simulate
from rollover.dynamics.assembly import tables_of
from rollover.dynamics.bodies import Body, bodies_of
from rollover.dynamics.setup import set_up
from rollover.kernels import links as k
from rollover.kernels.forces import read_poses
from rollover.kernels.generalised_alpha import turn
from rollover.kernels.tables import OCCUPANT, Tables, handle
from rollover.scenario import Ground, Scenario, Simulation, load
from rollover.spec.document import to_mapping
from rollover.spec.inertia import MassProperties
from rollover.spec.initiation import Drop, Release
from rollover.spec.occupant import SHARES, THIGH, BodyJoint, LapBelt, Occupant
from rollover.spec.shapes import Box
from rollover.spec.vehicle import Vehicle, laden, seated_still
from rollover.system.errors import InputError

SEAT = (3.0, 0.0, 1.0)
LOOSE = BodyJoint(stiffness=(0.0,) * 3, damping=(0.0,) * 3, low_deg=(-90.0,) * 3, high_deg=(90.0,) * 3)


def tower(occupant: Occupant, *, gravity: float = 9.81, roll_deg: float = 0.0, duration: float = 0.5) -> Scenario:
    """A block of 1000 t, 2.4 m high, on hard ground, upright or upside down, with a seat at its side."""
    size, mass = (4.0, 2.0, 2.4), 1.0e6
    a, b, c = size
    return Scenario(
        title="tower",
        vehicle=Vehicle(
            name="tower",
            whole=MassProperties(
                mass=mass,
                centre_of_mass=(0.0, 0.0, 1.2),
                inertia=(mass * (b * b + c * c) / 12, mass * (a * a + c * c) / 12, mass * (a * a + b * b) / 12),
            ),
            outline=(Box(name="block", low=(-2.0, -1.0, 0.0), high=(2.0, 1.0, 2.4)),),
            contact_spacing=0.4,
            occupant=occupant,
        ),
        ground=Ground(elements=Elements(length=12.0, width=8.0, spacing=(0.5, 0.5)), law=Hard(stiffness=1e7)),
        initiation=Release(height=1.0) if gravity == 0.0 else Drop(speed=1e-6, roll_deg=roll_deg),
        simulation=Simulation(duration=duration, step=1e-3, output_step=1e-3),
        gravity=gravity,
    )


def laid_out(scenario: Scenario) -> tuple[tuple[Body, ...], Tables, np.ndarray]:
    """Bodies, tables and coordinates (6 nb,) of the design position."""
    bodies = bodies_of(scenario.vehicle, scenario.ground.elements)
    q = np.concatenate([[*body.centre, 0.0, 0.0, 0.0] for body in bodies])
    return bodies, tables_of(scenario, bodies), q


def tried(t: Tables, q: np.ndarray, qd: np.ndarray | None = None) -> tuple[float, np.ndarray]:
    """Energy that the links hold, and their generalised forces (6 nb,)."""
    Q = np.zeros_like(q)
    read_poses(t.pose, q, np.zeros_like(q) if qd is None else qd)
    k.try_links(handle(t), Q)
    return float(t.link_memory[:, k.HELD_NOW].sum()), Q


def slope_of(t: Tables, pose: np.ndarray) -> np.ndarray:
    """Slope (6 nb,) of the energy that the links hold, by central differences of 1e-6 m and rad about body axes."""
    slope = np.zeros_like(pose)
    for i in range(pose.size):
        energy = []
        for way in (1e-6, -1e-6):
            stepped, step = pose.copy(), np.zeros(6)
            step[i % 6] = way
            b = 6 * (i // 6)
            stepped[b : b + 3] += step[:3]
            turn(stepped[b + 3 : b + 6], step[3], step[4], step[5])  # about body axes, as torques are
            energy.append(tried(t, stepped)[0])
        slope[i] = (energy[0] - energy[1]) / 2e-6
    return slope


def test_forces_are_the_slope_of_what_the_links_hold() -> None:
    """Joints, stops, straps and touches on seat and frame together, at poses by chance; friction off."""
    scenario = load("side_overturn_driver").replaced({"vehicle.occupant.friction": 0.0})
    bodies, t, q = laid_out(scenario)
    chance, kinds = np.random.default_rng(4), set()
    free = [b for b, body in enumerate(bodies) if body.name.startswith(("occupant", "rops"))]
    for _ in range(8):
        pose = q.copy()
        for b in free:
            pose[6 * b : 6 * b + 3] += chance.normal(0.0, 0.06, 3)
            pose[6 * b + 3 : 6 * b + 6] = chance.normal(0.0, 0.5, 3)
        _, Q = tried(t, pose)
        kinds |= set(t.link_i[t.link_memory[:, k.HELD_NOW] > 0.0, 0].tolist())
        slope = slope_of(t, pose)
        # rounding of the energies over the way of the difference
        assert np.abs(Q + slope).max() < 1e-8 * np.abs(Q).max() + 1e-4
    assert kinds == {k.JOINT, k.STRAP, k.BLOCK, k.BAR}


def test_a_strap_pulls_beyond_its_slack_and_never_pushes() -> None:
    occupant = Occupant(seat=SEAT, belt=LapBelt(stiffness=8e4, slack=0.02), cushion_stiffness=1e-6)
    bodies, t, q = laid_out(tower(occupant, gravity=0.0))
    pelvis = 6 * [b.name for b in bodies].index("occupant_pelvis")
    (_, anchor, hip), (_, _, _) = occupant.straps
    for way in (-0.05, 0.01, 0.05):
        along = (np.array(hip) - np.array(anchor)) / math.dist(hip, anchor)
        lifted = q.copy()
        lifted[pelvis : pelvis + 3] += way * along  # straight out for the left strap
        tried(t, lifted)
        left = t.link_memory[t.link_i[:, 0] == k.STRAP, k.L_FORCE][0]
        assert left == pytest.approx(8e4 * max(way - 0.02, 0.0), abs=1e-6)


def test_a_stop_adds_to_the_spring_beyond_its_angle() -> None:
    """Torso bent forward by 70 deg against 60: M = 500 x 1.2217 + 2000 x 0.1745; sideways within its range by 500."""
    bodies, t, q = laid_out(tower(Occupant(seat=SEAT), gravity=0.0))
    names = [b.name for b in bodies]
    torso, lumbar = names.index("occupant_torso"), Occupant(seat=SEAT).joints[0][3]
    for axis, degrees, expected in ((1, 70.0, 500 * 1.221730 + 2000 * 0.174533), (0, -20.0, -500 * 0.349066)):
        bent, angle = q.copy(), math.radians(degrees)
        bent[6 * torso + 3 + axis] = angle
        arm = bodies[torso].centre - np.array(lumbar)
        R = np.eye(3)
        i, j = (axis + 1) % 3, (axis + 2) % 3
        R[i, i] = R[j, j] = math.cos(angle)
        R[j, i], R[i, j] = math.sin(angle), -math.sin(angle)
        bent[6 * torso : 6 * torso + 3] += R @ arm - arm
        tried(t, bent)
        moment = t.link_memory[t.link_i[:, 0] == k.JOINT, k.L_MOMENT : k.L_MOMENT + 3][0]
        assert moment[axis] == pytest.approx(-expected, rel=1e-5)
        assert np.abs(np.delete(moment, axis)).max() < 1e-6


def test_newtons_matrix_is_the_slope_of_the_forces() -> None:
    """Joints at rest, and straps and hips a little strained: K = -dQ/dq but for the turning of what is loaded already.

    Those terms are the loads over the lengths that they act on, here 1 N over 0.1 m of 1e4 N/m and more.
    """
    occupant = Occupant(seat=SEAT, belt=LapBelt(slack=0.0))
    bodies, t, q = laid_out(tower(occupant, gravity=0.0))
    pelvis = 6 * [b.name for b in bodies].index("occupant_pelvis")
    q[pelvis : pelvis + 3] += [3e-5, 2e-6, -1e-5]
    _, Q = tried(t, q)
    K, slope, chance = np.zeros((q.size, q.size)), np.zeros((q.size, q.size)), 1e-7
    k.stiffen_links(handle(t), 1.0, 0.0, K)
    for i in range(q.size):
        stepped = q.copy()
        stepped[i] += chance
        slope[:, i] = -(tried(t, stepped)[1] - Q) / chance
    assert {k.JOINT, k.STRAP, k.BLOCK} == set(t.link_i[t.link_memory[:, k.HELD_NOW] > 0.0, 0].tolist())
    assert np.abs(K - slope).max() < 1e-4 * np.abs(K).max()


def test_what_is_held_is_booked_once() -> None:
    """Two steps: the ledger has what is held at their end, the recording the straps' forces there."""
    bodies, t, q = laid_out(tower(Occupant(seat=SEAT, belt=LapBelt(slack=0.0)), gravity=0.0))
    pelvis = 6 * [b.name for b in bodies].index("occupant_pelvis")
    for rise in (0.02, 0.03):
        lifted = q.copy()
        lifted[pelvis + 2] += rise
        held, _ = tried(t, lifted)
        k.finish_links(handle(t), 1e-3)
        assert t.work[OCCUPANT] == pytest.approx(held, rel=1e-12)
    straps = t.link_memory[t.link_i[:, 0] == k.STRAP, k.L_FORCE]
    assert t.link_out[9:11] == pytest.approx(straps, rel=1e-12)
    assert straps.min() > 1000.0


def modes(occupant: Occupant) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rates (2,) of the free chain sideways, their turns (4, 2), and ways along y of the parts for turns (3, 4).

    Turns are small: a_1, a_2, a_3 of the parts about x, and b of the pelvis about z, whose centre of mass stands THIGH
    ahead of the joints' line. No gravity: y_2 = y_1 - l_1 a_1 - THIGH b - l_2 a_2, y_3 likewise, with sum(m y) = 0.
    M = diag(I) + Y' diag(m) Y, K of two springs between neighbours; M w^2 a = K a; two motions are free.
    """
    bodies = list(occupant.parts.values())
    z, m = np.array([b.centre_of_mass[2] for b in bodies]), np.array([b.mass for b in bodies])
    lumbar, neck = (j[3][2] for j in occupant.joints)
    ways = np.zeros((3, 4))
    ways[1] = [-(lumbar - z[0]), -(z[1] - lumbar), 0.0, -THIGH]
    ways[2] = ways[1] + [0.0, -(neck - z[1]), -(z[2] - neck), 0.0]
    ways -= m @ ways / m.sum()
    M = np.diag([*(b.inertia[0] for b in bodies), bodies[0].inertia[2]]) + ways.T @ (m[:, None] * ways)
    low, high = (j[4].stiffness[0] for j in occupant.joints)
    K = np.zeros((4, 4))
    K[:3, :3] = [[low, -low, 0.0], [-low, low + high, -high], [0.0, -high, high]]
    squares, shapes = np.linalg.eig(np.linalg.solve(M, K))
    order = np.argsort(squares.real)[2:]
    return np.sqrt(squares.real[order]), shapes.real[:, order], ways


@pytest.mark.parametrize("integrator", ["exudyn", "compiled"])
@pytest.mark.parametrize("mode", [0, 1])
def test_a_free_chain_swings_with_its_own_periods(mode: int, integrator: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Set going along one mode, a(t) = v sin(w t)/w over two periods; the scheme lags by (w h)^2/12 of 4 pi, 0.16 %."""
    springs = [replace(LOOSE, stiffness=(about, about, 0.0)) for about in (500.0, 40.0)]
    occupant = Occupant(
        seat=SEAT,
        lumbar=springs[0],
        neck=springs[1],
        joint_stiffness=1e8,  # as good as a pin
        cushion_stiffness=1e-6,  # nothing holds it
        contact_stiffness=1e-6,
    )
    rates, shapes, ways = modes(occupant)
    w, shape = rates[mode], 0.01 * shapes[:, mode]
    scenario = tower(occupant, gravity=0.0, duration=round(4.0 * math.pi / w, 3))
    scenario = scenario.replaced({"simulation.integrator": integrator})
    rig = set_up(scenario)
    qd = rig.start.qd.copy()
    parts = [b for b, body in enumerate(rig.bodies) if body.name.startswith("occupant")]
    for i, b in enumerate(parts):
        qd[6 * b + 1], qd[6 * b + 3] = ways[i] @ shape, shape[i]
    qd[6 * parts[0] + 5] = shape[3]
    monkeypatch.setattr(simulate, "set_up", lambda _: replace(rig, start=replace(rig.start, qd=qd)))
    done = simulate.run(scenario)
    assert done.status == "done", done.sentence
    time = done.recording.time
    q = done.pose["occupant_torso"].quaternion
    angle = 2.0 * np.arctan2(q[:, 0], q[:, 3])
    assert np.abs(angle - shape[1] * np.sin(w * time) / w).max() < 0.003 * abs(shape[1]) / w


@pytest.fixture(scope="module")
def sat() -> simulate.Run:
    return simulate.run(tower(Occupant(seat=SEAT, belt=LapBelt()), duration=1.0).of_many())


def test_who_sits_is_carried_by_the_cushion(sat: simulate.Run) -> None:
    """m g on the pelvis from the start, over two swings of the cushion; what is above each joint through it."""
    weight, late = 75.0 * 9.81, sat.recording.time > 1.0 - 2.0 * 2.0 * math.pi * math.sqrt(75.0 / 4.0e4)
    mean = {name: float(values[late].mean()) for name, values in sat.recording.channels.items()}
    assert sat.recording["occupant/pelvis/contact_force"][0] == pytest.approx(weight, rel=1e-6)
    assert mean["occupant/pelvis/contact_force"] == pytest.approx(weight, rel=5e-3)
    assert mean["occupant/lumbar/force"] == pytest.approx((SHARES[1] + SHARES[2]) * weight, rel=5e-3)
    assert mean["occupant/neck/force"] == pytest.approx(SHARES[2] * weight, rel=5e-3)
    assert mean["occupant/belt/left/force"] == mean["occupant/belt/right/force"] == 0.0
    assert abs(mean["occupant/head/acceleration_z"]) < 0.05


def hung(belt: LapBelt | None, duration: float) -> simulate.Run:
    done = simulate.run(tower(Occupant(seat=SEAT, belt=belt), roll_deg=180.0, duration=duration).of_many())
    assert done.status == "done", done.sentence
    return done


def test_upside_down_the_belt_holds_who_wears_one() -> None:
    """The straps carry the weight together, alike; the head stays off the ground."""
    held = hung(LapBelt(), 0.9)
    left, right = (held.recording[f"occupant/belt/{side}/force"] for side in ("left", "right"))
    assert left == pytest.approx(right, rel=1e-9, abs=1e-6)
    assert (left + right)[held.recording.time > 0.4].mean() > 0.9 * 75.0 * 9.81
    assert held.recording["occupant/head/ground_force"].max() == 0.0


def test_without_a_belt_the_head_falls_on_the_ground() -> None:
    """Seat 1.4 m above the ground, head 0.899 m below it: after sqrt(2 x 0.501 m/g), then harder than its weight."""
    fallen = hung(None, 0.45)
    struck = fallen.recording.time[np.argmax(fallen.recording["occupant/head/ground_force"] > 0.0)]
    assert struck == pytest.approx(math.sqrt(2.0 * (2.4 - 1.0 - 0.86 * 0.9 - 0.125) / 9.81), abs=0.02)
    assert fallen.recording["occupant/head/ground_force"].max() > 10.0 * SHARES[2] * 75.0 * 9.81


@pytest.mark.parametrize("belt", [{"slack": 0.01}, None])
def test_the_ledger_closes_with_an_occupant(belt: object) -> None:
    scenario = load("side_overturn_driver").replaced({"vehicle.occupant.belt": belt, "simulation.duration": 2.5})
    done = simulate.run(scenario.of_many())
    assert done.status == "done", done.sentence
    assert closure(done).largest < 0.005
    assert done.ledger["occupant"] > 50.0
    assert np.abs(done.recording["occupant/head/acceleration_y"]).max() > 9.81  # thrown harder than it weighs


# ---------------------------------------------------------------- in files


def test_nobody_changes_nothing() -> None:
    scenario = load("side_overturn")
    assert "occupant" not in to_mapping(scenario.vehicle, hashed=True)
    assert len(tables_of(scenario, bodies_of(scenario.vehicle, scenario.ground.elements)).link_i) == 0


def test_the_occupant_counts_in_the_laden_mass() -> None:
    vehicle = load("side_overturn_driver").vehicle
    assert isinstance(vehicle, Vehicle)
    assert laden(vehicle).mass == pytest.approx(3075.0)
    assert laden(seated_still(vehicle)) == laden(vehicle)
    assert sum(SHARES) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("seat", "said"),
    [
        ([0.42, 0.0, 1.60], "the head stands 54 mm in crossbar"),
        ([1.60, 0.0, 1.10], "in bonnet"),
    ],
)
def test_a_seat_inside_the_vehicle_is_refused(seat: list[float], said: str) -> None:
    scenario = load("side_overturn_driver")
    over = {f"vehicle.rops.members.crossbar.{end}.0": 0.42 for end in ("start", "end")}
    with pytest.raises(InputError) as refused:
        scenario.replaced({**over, "vehicle.occupant.seat": seat})
    assert "vehicle.occupant.seat: the " in str(refused.value)
    assert said in str(refused.value)
