"""A trailer on its hitch, a wheel on its spring, a bogie on its pin: energies, static loads, periods, a quarter car."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from ground.array import Elements
from ground.hard import Hard
from rollover.assessment.ledger import closure
from rollover.dynamics import simulate
from rollover.dynamics.result import Run
from rollover.dynamics.setup import set_up
from rollover.kernels import links as k
from rollover.kernels.forces import generalised_forces
from rollover.kernels.tables import E_FORCE_NOW, handle
from rollover.scenario import Ground, Scenario, Simulation, load
from rollover.spec.bogie import Bogie
from rollover.spec.frames import from_quaternion
from rollover.spec.inertia import MassProperties
from rollover.spec.initiation import Drop
from rollover.spec.occupant import BodyJoint
from rollover.spec.shapes import Box
from rollover.spec.suspension import Suspension
from rollover.spec.trailer import Hitch, Trailer
from rollover.spec.vehicle import Tyre, Vehicle, Wheel, alone, laden
from tests.physics.test_occupant import laid_out, slope_of, tried

Array = NDArray[np.float64]
G = 9.80665


@pytest.mark.parametrize("name", ["trailer_overturn", "forwarder_overturn", "corkscrew_ramp"])
def test_forces_are_the_slope_of_what_the_links_hold(name: str) -> None:
    """Q = -dU/dq of hitches beyond and within their stops, of struts with preload and stops, at poses by chance."""
    bodies, t, q = laid_out(load(name))
    chance = np.random.default_rng(5)
    free = [b for b, body in enumerate(bodies) if body.name.startswith(("trailer", "bogie_", "hub_"))]
    for _ in range(6):
        pose = q.copy()
        for b in free:
            pose[6 * b : 6 * b + 3] += chance.normal(0.0, 0.1, 3)
            pose[6 * b + 3 : 6 * b + 6] = chance.normal(0.0, 0.5, 3)
        _, Q = tried(t, pose)
        slope = slope_of(t, pose)
        # rounding of the energies over the way of the difference
        assert np.abs(Q + slope).max() < 1e-7 * np.abs(Q).max() + 1e-3


def standing(vehicle: str) -> tuple[Any, Any]:
    """Bodies and tables of a vehicle that stands on level ground, forces as they are there."""
    start = {"kind": "standing"}
    scenario = load("side_overturn").replaced({"vehicle": f"vehicles/{vehicle}.yaml", "initiation": start})
    rig = set_up(scenario)
    q = rig.start.q
    generalised_forces(handle(rig.tables), q, np.zeros_like(q), np.zeros_like(q))
    return scenario.vehicle, rig.tables


def test_a_trailer_weighs_on_its_hitch_by_the_lever() -> None:
    """Up on the trailer F = W (x - a)/(h - a), of its weight at x, axle at a and hitch at h; the slack lean is 1e-3."""
    vehicle, t = standing("tractor_trailer")
    mass = laden(vehicle).mass - laden(alone(vehicle)).mass
    first = laden(vehicle).mass * laden(vehicle).centre_of_mass[0]
    x = (first - laden(alone(vehicle)).mass * laden(alone(vehicle)).centre_of_mass[0]) / mass
    lever = (x + 3.9) / (3.9 - 0.6)
    assert t.link_memory[0, k.L_FORCE + 2] == pytest.approx(mass * G * lever, rel=0.01)
    assert np.abs(t.link_memory[0, k.L_FORCE : k.L_FORCE + 2]).max() < 0.02 * mass * G * lever


def tower(**parts: Any) -> Scenario:
    """A block of 1000 t on hard ground, with what hangs on it."""
    block = MassProperties(mass=1e6, centre_of_mass=(0.0, 0.0, 1.2), inertia=(1e6, 2e6, 2e6))
    return Scenario(
        title="tower",
        vehicle=Vehicle(
            name="tower",
            whole=block,
            outline=(Box(name="block", low=(-2.0, -1.0, 0.0), high=(2.0, 1.0, 2.4)),),
            contact_spacing=0.4,
            **parts,
        ),
        ground=Ground(elements=Elements(length=12.0, width=8.0, spacing=(0.5, 0.5)), law=Hard(stiffness=1e7)),
        initiation=Drop(speed=1e-6),
        simulation=Simulation(duration=1.3, step=1e-3, output_step=1e-3),
    )


@pytest.mark.parametrize("integrator", ["compiled", "exudyn"])
def test_a_body_on_a_hitch_swings_as_a_pendulum(integrator: str) -> None:
    """T = 2 pi sqrt((I + m l^2)/(m g l)) (1 + A^2/16): let go at A = 0.1 rad, on the other side after T/2."""
    A, mass, arm, inertia = 0.1, 500.0, 1.0, 50.0
    free = BodyJoint(stiffness=(0.0,) * 3, damping=(0.0,) * 3, low_deg=(-60.0,) * 3, high_deg=(60.0,) * 3)
    hung = Trailer(
        body=MassProperties(
            mass=mass, centre_of_mass=(4.0 + math.sin(A), 0.0, 2.0 - math.cos(A)), inertia=(60.0, inertia, 60.0)
        ),
        hitch=Hitch(position=(4.0, 0.0, 2.0), turns=free),
    )
    done = simulate.run(tower(trailer=hung).replaced({"simulation.integrator": integrator}))
    period = 2.0 * math.pi * math.sqrt((inertia + mass * arm**2) / (mass * 9.80665 * arm)) * (1.0 + A * A / 16.0)
    angle, time = done.recording["hitch/angle_y"], done.recording.time
    rest = np.abs(angle - angle[0])
    assert float(time[int(np.argmax(rest))]) == pytest.approx(0.5 * period, abs=0.004)
    assert rest.max() == pytest.approx(2.0 * A, rel=1e-3)
    # the joint itself rings as the weight comes onto it at once
    assert done.recording["hitch/force"][-300:].mean() == pytest.approx(mass * G, rel=0.02)
    assert closure(done).largest < 1e-3


def test_the_joint_does_not_drift() -> None:
    """Both ends of the hitch stay together but for its own strain, |F| = |k d + c d'|, at every moment of a fall."""
    done = simulate.run(load("forwarder_overturn").replaced({"simulation.duration": 1.2}))
    hitch = done.scenario.vehicle.trailer.hitch  # type: ignore[union-attr]
    a, b = (ends(done, name, np.array(hitch.position)) for name in ("chassis", "trailer"))
    gap = np.linalg.norm(b - a, axis=1)
    rate = np.linalg.norm(np.gradient(b - a, done.recording.time, axis=0), axis=1)
    force = done.recording["hitch/force"]
    assert np.all(np.abs(hitch.stiffness * gap - force) <= hitch.damping * rate + 0.01 * force.max())
    assert gap[-1] < 0.01
    assert closure(done).largest < 1e-3


def ends(run: Run, body: str, point: Array) -> Array:
    """World places (n, 3) of a point in vehicle axes that goes with a body."""
    pose = run.pose[body]
    return np.array(
        [
            o + from_quaternion((x[3], x[0], x[1], x[2])) @ point
            for o, x in zip(pose.origin, pose.quaternion, strict=True)
        ]
    )


def test_struts_carry_what_is_sprung() -> None:
    """Their forces are the vehicle's weight less the hubs', but for a pitch of some mrad, at which guides carry too."""
    vehicle, t = standing("side_by_side")
    N, sprung = -t.link_memory[:, k.L_FORCE + 2], [w.suspension for w in vehicle.wheels]
    hubs = sum(s.mass for s in sprung)
    assert N.sum() == pytest.approx((laden(vehicle).mass - hubs) * G, rel=1e-3)
    assert N[0] == pytest.approx(N[1], rel=1e-3)


def car(**changes: Any) -> Scenario:
    """A mass of 400 kg in the middle of four sprung wheels, dropped at 0.2 m/s as the springs are unstrained."""
    tyre = Tyre(radius=0.33, width=0.2, vertical_stiffness=1.5e5, vertical_damping=300.0, lateral_stiffness=1e5)
    spring = Suspension(mass=25.0, stiffness=2e4, damping=500.0, bump=0.2, droop=0.2)
    at = {"fl": (1.0, 0.6), "fr": (1.0, -0.6), "rl": (-1.0, 0.6), "rr": (-1.0, -0.6)}
    vehicle = Vehicle(
        name="car",
        whole=MassProperties(mass=500.0, centre_of_mass=(0.0, 0.0, 0.6), inertia=(200.0, 300.0, 350.0)),
        wheels=tuple(Wheel(name=n, centre=(x, y, 0.33), tyre=tyre, suspension=spring) for n, (x, y) in at.items()),
    )
    found = load("side_overturn").replaced(
        {
            "vehicle": vehicle,
            "initiation": {"kind": "drop", "speed": 0.2, "lead_time": 0.0},
            "simulation": {"duration": 0.4, "step": 0.0005, "output_step": 0.0005},
        }
    )
    return found.replaced(changes)


@pytest.mark.parametrize("integrator", ["compiled", "exudyn"])
def test_a_sprung_wheel_moves_as_a_quarter_car(integrator: str) -> None:
    """M x'' = -k (x - y) - c (x' - y') - M g, m y'' = k (x - y) + c (x' - y') - k_t y - c_t y' - m g, by SciPy."""
    M, m, spring, c, tyre, ct = 100.0, 25.0, 2e4, 500.0, 1.5e5, 300.0

    def rates(_t: float, s: Array) -> list[float]:
        x, v, y, w = s
        between = spring * (x - y) + c * (v - w)
        return [v, -between / M - G, w, (between - tyre * y - ct * w) / m - G]

    done = simulate.run(car(**{"simulation.integrator": integrator}))
    time = done.recording.time
    exact = solve_ivp(rates, (0.0, time[-1]), [0.0, -0.2, 0.0, -0.2], t_eval=time, rtol=1e-9, atol=1e-12).y
    travel = done.recording["suspension/fl/travel"]
    assert np.abs(travel - (exact[2] - exact[0])).max() < 2e-3 * np.abs(travel).max()
    force = done.recording["suspension/fl/force"]
    between = spring * (exact[2] - exact[0]) + c * (exact[3] - exact[1])
    assert np.abs(force - between).max() < 5e-3 * np.abs(between).max()
    assert closure(done).largest < 1e-3


def test_a_stop_adds_to_the_spring_beyond_the_travel() -> None:
    """N = P + k d + k_s (d - bump) 50 mm beyond the stop; within it P + k d."""
    for way, beyond in ((0.15, 0.0), (0.25, 0.05), (-0.25, -0.05)):
        bodies, t, q = laid_out(car())
        b = [body.name for body in bodies].index("hub_fl")
        q[6 * b + 2] += way
        tried(t, q)
        at = next(i for i in range(len(t.link_i)) if t.link_i[i, 1] == b)
        assert -t.link_memory[at, k.L_FORCE + 2] == pytest.approx(2e4 * way + 2e5 * beyond)


def test_wheels_that_nothing_carries_are_refused() -> None:
    vehicle = load("trailer_overturn").vehicle
    assert isinstance(vehicle, Vehicle)
    with pytest.raises(ValueError, match="carried by 'trailer' but there is none"):
        replace(vehicle, trailer=None)
    wheel = replace(vehicle.wheels[-1], suspension=Suspension(mass=20.0, stiffness=2e4))
    with pytest.raises(ValueError, match="suspension: got it on 'trailer'"):
        replace(vehicle, wheels=(*vehicle.wheels[:-1], wheel))


# ---------------------------------------------------------------- bogies


def bogied(ahead: float = 0.7, behind: float = 0.7, **changes: Any) -> Scenario:
    """A mass of 900 kg on two wheels in front and on two bogies behind, whose pins are `ahead` and `behind` of wheels.

    Its wheels roll freely, so that nothing but what they bear turns a beam about its pin.
    """
    tyre = Tyre(radius=0.4, width=0.2, vertical_stiffness=3e5, vertical_damping=500.0, lateral_stiffness=2e5)
    wheels = [
        Wheel(name=f"front_{side}", centre=(2.7, y, 0.4), rolls=True, tyre=tyre)
        for side, y in (("l", 0.8), ("r", -0.8))
    ]
    bogies = []
    for side, y in (("l", 0.8), ("r", -0.8)):
        beam = MassProperties(mass=40.0, centre_of_mass=(0.0, y, 0.4), inertia=(2.0, 12.0, 12.0))
        bogies.append(Bogie(name=side, pivot=(0.0, y, 0.4), body=beam))
        for word, x in (("middle", ahead), ("rear", -behind)):
            wheels.append(Wheel(name=f"{word}_{side}", centre=(x, y, 0.4), rolls=True, tyre=tyre, bogie=side))
    vehicle = Vehicle(
        name="bogied",
        whole=MassProperties(mass=980.0, centre_of_mass=(0.9, 0.0, 0.8), inertia=(300.0, 800.0, 900.0)),
        wheels=tuple(wheels),
        bogies=tuple(bogies),
    )
    found = load("side_overturn").replaced({"vehicle": vehicle, "initiation": {"kind": "standing"}})
    return found.replaced(changes)


def bearing(scenario: Scenario) -> tuple[dict[str, float], dict[str, Array]]:
    """What the ground bears under each wheel, N, and where bodies are, (6,), of a vehicle that stands."""
    rig = set_up(scenario)
    q = rig.start.q
    generalised_forces(handle(rig.tables), q, np.zeros_like(q), np.zeros_like(q))
    names = [w.name for w in scenario.vehicle.wheels]
    force = {n: float(f) for n, f in zip(names, rig.tables.wheel_memory[:, E_FORCE_NOW], strict=True)}
    return force, {b.name: q[6 * i : 6 * i + 6] for i, b in enumerate(rig.bodies)}


STEP = {"kind": "kerb", "height": 0.15, "face_deg": 60.0, "foot": [0.0, 0.0], "direction_deg": 0.0}


@pytest.mark.parametrize("ahead", [0.7, 0.5])
@pytest.mark.parametrize("step", [False, True])
def test_a_bogies_wheels_share_by_the_lever(ahead: float, step: bool) -> None:
    """N_m a = N_r b on a pin without friction, on the flat and with the wheel ahead 0.15 m higher.

    The beam then leans by asin(0.15/(a + b)); what the tyres give differs by (N_m - N_r)/k, 3 mm at most.
    """
    scenario = bogied(ahead, 1.4 - ahead, **({"ground.surface": STEP} if step else {}))
    force, q = bearing(scenario)
    a, b = ahead, 1.4 - ahead
    for side in "lr":
        middle, rear = force[f"middle_{side}"], force[f"rear_{side}"]
        assert middle * a == pytest.approx(rear * b, rel=1e-6)
        sunk = (middle - rear) / 3e5
        lean = -math.asin(((0.15 if step else 0.0) - sunk) / 1.4)
        assert q[f"bogie_{side}"][4] == pytest.approx(lean, abs=2e-3)
    assert sum(force.values()) == pytest.approx(980.0 * 9.81, rel=1e-6)


def test_without_a_bogie_the_wheel_on_the_step_bears_alone() -> None:
    """What the bogie is for: the same wheels on the chassis, of which the higher one carries all of its side."""
    vehicle = bogied().vehicle
    assert isinstance(vehicle, Vehicle)
    rigid = replace(vehicle, bogies=(), wheels=tuple(replace(w, bogie=None) for w in vehicle.wheels))
    force, _ = bearing(bogied(**{"vehicle": rigid, "ground.surface": STEP}))
    assert force["rear_l"] == 0.0
    assert force["middle_l"] > 1000.0


@pytest.mark.parametrize("integrator", ["compiled", "exudyn"])
def test_a_bogie_swings_as_a_pendulum(integrator: str) -> None:
    """T = 2 pi sqrt((I + m l^2)/(m g l)) (1 + A^2/16) about its pin, let go at A = 0.1 rad, its wheels in the air."""
    A, mass, arm, inertia = 0.1, 500.0, 0.4, 60.0
    centre = (4.0 + arm * math.sin(A), 1.5, 2.0 - arm * math.cos(A))
    beam = MassProperties(mass=mass, centre_of_mass=centre, inertia=(40.0, inertia, 60.0))
    tyre = Tyre(radius=0.4, width=0.2, vertical_stiffness=3e5, lateral_stiffness=2e5)
    hung = Bogie(name="left", pivot=(4.0, 1.5, 2.0), body=beam)
    on = [Wheel(name=f"w{i}", centre=(4.0 + x, 1.5, 2.0), tyre=tyre, bogie="left") for i, x in enumerate((0.6, -0.6))]
    scenario = tower(bogies=(hung,), wheels=tuple(on))
    done = simulate.run(scenario.replaced({"simulation.integrator": integrator}))
    period = 2.0 * math.pi * math.sqrt((inertia + mass * arm**2) / (mass * 9.80665 * arm)) * (1.0 + A * A / 16.0)
    angle, time = done.recording["bogie/left/angle"], done.recording.time
    rest = np.abs(angle - angle[0])
    assert float(time[int(np.argmax(rest))]) == pytest.approx(0.5 * period, abs=0.004)
    assert rest.max() == pytest.approx(2.0 * A, rel=2e-3)
    assert done.recording["bogie/left/force"][-300:].mean() == pytest.approx(mass * G, rel=0.02)
    assert closure(done).largest < 1e-3


def test_a_bogie_meets_its_stop() -> None:
    """M = k_s (a - swing) on both bodies, 0.05 rad beyond; nothing within the swing."""
    for way, beyond in ((0.2, 0.0), (math.radians(15.0) + 0.05, 0.05), (-math.radians(15.0) - 0.05, -0.05)):
        _, t, q = laid_out(bogied())
        q[6 + 4] = way  # the bogie on the left is the second body
        tried(t, q)
        assert t.link_memory[0, k.L_MOMENT + 1] == pytest.approx(-1e6 * beyond, rel=1e-6, abs=1e-3)


def test_bogies_that_cannot_swing_are_refused() -> None:
    vehicle = bogied().vehicle
    assert isinstance(vehicle, Vehicle)
    with pytest.raises(ValueError, match=r"wheels: a wheel stands on bogie 'l', got \['r'\]"):
        replace(vehicle, bogies=vehicle.bogies[1:])
    with pytest.raises(ValueError, match=r"bogies.l.pivot: its beam falls over, got wheels at .* one ahead of it"):
        replace(vehicle, bogies=(replace(vehicle.bogies[0], pivot=(1.0, 0.8, 0.4)), vehicle.bogies[1]))
    sprung = replace(vehicle.wheels[2], suspension=Suspension(mass=20.0, stiffness=2e4))
    with pytest.raises(ValueError, match="suspension: got it on bogie 'l'"):
        replace(vehicle, wheels=(*vehicle.wheels[:2], sprung, *vehicle.wheels[3:]))
    with pytest.raises(ValueError, match="two bogies share a name"):
        replace(vehicle, bogies=(vehicle.bogies[0], replace(vehicle.bogies[1], name="l")))
    heavy = replace(vehicle.bogies[0].body, mass=990.0)
    with pytest.raises(ValueError, match="sprung wheels and bogies weigh more"):
        replace(vehicle, bogies=(replace(vehicle.bogies[0], body=heavy), vehicle.bogies[1]))
