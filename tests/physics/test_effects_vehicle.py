"""Effects on vehicles: masses that move, rotors, torques, mounts; closed forms, and the ledger over a rollover."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from rollover.dynamics.assembly import tables_of
from rollover.dynamics.bodies import bodies_of
from rollover.dynamics.result import Run
from rollover.dynamics.simulate import run
from rollover.kernels.forces import generalised_forces
from rollover.kernels.tables import handle
from rollover.scenario import Scenario
from rollover.spec.initiation import Drop
from tests.physics.scenes import block, shipped

g = 9.81


def tilted(angle: float, duration: float, step: float = 1e-3) -> Scenario:
    """A block put down flat on a slope that rises towards y, with friction enough to stay where it is."""
    degrees = math.degrees(angle)
    scenario = block(Drop(speed=0.01, roll_deg=degrees), mu=2.0, duration=duration, step=step, spacing=0.1)
    return scenario.replaced({"ground.surface": {"kind": "slope", "angle_deg": degrees}})


def across(result: Run, name: str) -> tuple[Any, Any]:
    """Time and way (m) of a mass along the chassis' y, from where it started."""
    from scipy.spatial.transform import Rotation

    chassis, load = result.motion["chassis"], result.motion[name]
    turn = Rotation.from_quat(chassis.quaternion).as_matrix()
    way = np.einsum("nji,nj->ni", turn, load.origin - chassis.origin)[:, 1]
    return result.frame_time, way - way[0]


def closes(result: Run) -> None:
    assert result.status == "done", result.sentence
    assert np.abs(result.recording["energy/residual"]).max() < 1e-3 * result.released


def test_slosh_swings_with_the_frequency_of_its_pendulum() -> None:
    """On a slope u'' + 2 z w u' + w^2 u = -g sin(angle), w^2 = g/L: from rest about u_s = -L sin(angle)."""
    angle, length, damping = 0.1, 0.4, 0.05
    changes = {"mass": 60.0, "length": length, "damping": damping}
    result = run(tilted(angle, 2.5).replaced({f"effects.tank-slosh.{k}": v for k, v in changes.items()}))
    closes(result)
    t, u = across(result, "tank-slosh")
    w = math.sqrt(g / length)
    fast = w * math.sqrt(1 - damping**2)
    fade = np.exp(-damping * w * t)
    exact = -length * math.sin(angle) * (1 - fade * (np.cos(fast * t) + damping * w / fast * np.sin(fast * t)))
    assert np.abs(u - exact).max() < 0.03 * np.abs(exact).max()
    zero = np.diff(np.sign(np.gradient(u, t))) != 0
    turns = t[1:][zero & (t[1:] > 0.2)]
    assert np.diff(turns).mean() == pytest.approx(math.pi / fast, rel=0.02)


def test_a_load_slides_down_and_meets_its_wall() -> None:
    """u'' = -g (sin a - mu cos a) while it slides; it stays if mu > tan a, and ends at the wall."""
    angle, mu, travel = 0.3, 0.2, 0.15
    changes = {"mass": 60.0, "friction": mu, "travel": travel}
    slides = run(tilted(angle, 0.8, 2e-4).replaced({f"effects.payload-shift.{k}": v for k, v in changes.items()}))
    t, u = across(slides, "payload-shift")
    exact = -0.5 * g * (math.sin(angle) - mu * math.cos(angle)) * t**2
    on = exact > -0.8 * travel
    assert on.sum() > 10
    assert np.abs(u - exact)[on].max() < 0.05 * travel
    assert u[-1] == pytest.approx(-travel, rel=0.02)
    assert u.min() > -1.1 * travel
    closes(slides)
    stays = run(tilted(0.1, 0.8).replaced({f"effects.payload-shift.{k}": v for k, v in changes.items()}))
    assert np.abs(across(stays, "payload-shift")[1]).max() < 0.005 * 0.8  # creeps below v_c


def test_moving_masses_are_part_of_the_whole() -> None:
    scenario = shipped("side_overturn")
    whole = bodies_of(scenario.vehicle, scenario.ground.elements)
    changed = scenario.replaced({"effects.tank-slosh.mass": 80.0, "effects.payload-shift.mass": 50.0})
    parts = bodies_of(scenario.vehicle, scenario.ground.elements, changed.effects)
    assert len(parts) == len(whole) + 2

    def moments(bodies: Any) -> tuple[float, Any, Any]:
        mass = sum(b.inertia.mass for b in bodies)
        centre = sum(b.inertia.mass * b.centre for b in bodies) / mass
        J = sum(
            b.tensor + b.inertia.mass * (b.centre @ b.centre * np.eye(3) - np.outer(b.centre, b.centre)) for b in bodies
        )
        return mass, centre, J

    for one, two in zip(moments(whole), moments(parts), strict=True):
        assert two == pytest.approx(one, rel=1e-12, abs=1e-9)


def test_a_rotor_turns_its_moment_aside() -> None:
    """M = -omega x H in body axes, without work."""
    changes = {"effects.gyroscopic-rotor.angular_momentum": 300.0, "effects.gyroscopic-rotor.axis": [0.0, 3.0, 4.0]}
    scenario = block(Drop(speed=1.0, lead_time=0.5)).replaced(changes)
    t = tables_of(scenario, bodies_of(scenario.vehicle, scenario.ground.elements))
    omega = np.array([1.0, -2.0, 0.5])
    q, Q = np.array([0.0, 0.0, 5.0, 0.3, 0.2, 0.1]), np.zeros(6)
    generalised_forces(handle(t), q, np.array([0.0, 0.0, 0.0, *omega]), Q)
    assert Q[3:] == pytest.approx(-np.cross(omega, 300.0 * np.array([0.0, 0.6, 0.8])))
    assert Q[3:] @ omega == pytest.approx(0.0, abs=1e-12)


def test_a_torque_on_held_wheels_pitches_the_chassis() -> None:
    """In free fall pitch = -T t^2/(2 J_yy), nose up."""
    T, lead = 40.0, 0.4
    scenario = block(Drop(speed=5.0, lead_time=lead), duration=0.005).replaced({"effects.drive-torque.torque": T})
    result = run(scenario)
    fall = result.recording.time < -0.01
    since = result.recording.time[fall] + lead
    J = scenario.vehicle.whole.inertia[1]  # type: ignore[union-attr]
    assert result.recording["chassis/pitch"][fall] == pytest.approx(-0.5 * T / J * since**2, rel=1e-3, abs=1e-6)
    assert result.recording["energy/effects"][fall][-1] == pytest.approx(-0.5 * T**2 / J * since[-1] ** 2, rel=1e-3)


def test_play_lets_the_frame_move_before_its_mounts_bear() -> None:
    base = shipped("rops_drop").replaced({"simulation.duration": 0.15})
    plain, loose = run(base), run(base.replaced({"effects.mount-play.gap": 0.01}))
    closes(loose)
    grown = loose.recording["rops/deflection"].max() - plain.recording["rops/deflection"].max()
    assert 0.005 < grown < 0.03
    names = [n for n in loose.recording.channels if n.startswith("rops/mount/") and n.endswith("_z")]
    small = loose.recording["rops/deflection"] < 0.005
    assert small.sum() > 3
    # within the play there is a dashpot and no spring
    rate = np.abs(np.gradient(loose.recording["rops/deflection"], loose.recording.time))[small].max()
    damping = max(m.damping[2] for m in base.vehicle.rops.mounts)  # type: ignore[union-attr]
    assert max(np.abs(loose.recording[n][small]).max() for n in names) < 4.0 * damping * max(rate, 0.1)


def test_mounts_take_stiffness_and_yield_together() -> None:
    base = shipped("side_overturn")
    mounts = base.vehicle.rops.mounts  # type: ignore[union-attr]
    soft = base.replaced(
        {"effects.rops-elasticity.stiffness": 2e5, "effects.rops-plasticity.yield_force": 9e3}
    ).applied()
    changed = soft.vehicle.rops.mounts  # type: ignore[union-attr]
    assert sum(m.stiffness[1] for m in changed) == pytest.approx(2e5)
    assert sum(m.yield_force[1] for m in changed) == pytest.approx(9e3)
    ratio = changed[0].stiffness[1] / mounts[0].stiffness[1]
    assert changed[0].stiffness == pytest.approx([ratio * k for k in mounts[0].stiffness])
    assert [m.yield_force[0] for m in changed] == [m.yield_force[0] for m in mounts]


def test_wrong_numbers_reach_the_vehicle() -> None:
    base = shipped("side_overturn")
    changes = {
        "effects.mass.added": 100.0,
        "effects.centre-of-mass.height": 0.1,
        "effects.centre-of-mass.lateral": -0.02,
        "effects.inertia.scale": 1.2,
        "effects.slope.angle": 0.05,
        "effects.tyre-damping.damping": 999.0,
        "effects.tyre-lateral-stiffness.stiffness": 8e4,
        "effects.axle-stop.angle": 0.15,
        "effects.axle-stop.stiffness": 5e4,
        "effects.ground-friction.coefficient": 0.33,
    }
    a, b = base.vehicle, base.replaced(changes).applied()
    whole = b.vehicle.whole  # type: ignore[union-attr]
    assert whole.mass == a.whole.mass + 100.0  # type: ignore[union-attr]
    x, y, z = a.whole.centre_of_mass  # type: ignore[union-attr]
    assert whole.centre_of_mass == pytest.approx((x, y - 0.02, z + 0.1))
    assert whole.inertia == pytest.approx([1.2 * j for j in a.whole.inertia])  # type: ignore[union-attr]
    assert b.ground.friction.coefficient == 0.33
    assert math.radians(b.ground.surface.angle_deg) == pytest.approx(0.05)  # type: ignore[union-attr]
    assert {w.tyre.vertical_damping for w in b.vehicle.wheels} == {999.0}  # type: ignore[union-attr]
    assert {w.tyre.lateral_stiffness for w in b.vehicle.wheels} == {8e4}  # type: ignore[union-attr]
    axle = b.vehicle.front_axle  # type: ignore[union-attr]
    assert (axle.swing, axle.stop_stiffness) == pytest.approx((0.15, 5e4))


@pytest.mark.parametrize(
    "effect", ["tank-slosh.mass", "payload-shift.mass", "gyroscopic-rotor.angular_momentum", "air-drag.area"]
)
def test_the_ledger_closes_over_a_rollover(effect: str) -> None:
    value = {"tank-slosh.mass": 120.0, "payload-shift.mass": 120.0, "air-drag.area": 3.0}.get(effect, 345.0)
    scenario = shipped("side_overturn").replaced({f"effects.{effect}": value, "simulation.duration": 2.0})
    result = run(scenario)
    closes(result)
