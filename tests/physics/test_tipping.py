"""Static tip angles and the free side roll against closed forms; the tyre as a spring that stores what it takes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from ground.array import CoMovingMass, Elements
from ground.friction import Coulomb
from ground.surface import Slope
from ground.ye import Ye2006
from rollover.dynamics.assembly import tables_of
from rollover.dynamics.bodies import bodies_of
from rollover.dynamics.equilibrium import tread_point
from rollover.dynamics.placement import place
from rollover.dynamics.simulate import run
from rollover.kernels.forces import generalised_forces
from rollover.kernels.tables import E_ENERGY_NOW, handle
from rollover.scenario import Ground, Scenario, Simulation, load
from rollover.spec.frames import from_angles, matrices, rotation_vector
from rollover.spec.inertia import MassProperties
from rollover.spec.initiation import Drop, Standing
from rollover.spec.shapes import Box
from rollover.spec.vehicle import FrontAxle, Tyre, Vehicle, Wheel
from rollover.system.errors import InputError

# the utility tractor of the closed forms: half support width at the tyres' outer edges, m
M, L, A, H, HP, S = 3000.0, 2.25, 0.90, 0.82, 0.55, 0.96
CORNER = (0.60, 2.5)  # half width and height of the ROPS
IXX = 1300.0


def rigid_tractor(
    *, swing_deg: float | None, stiffness: float = 3e7, rops: bool = False, step: float = 2e-4
) -> Scenario:
    """Nearly rigid, flat-treaded tyres without side walls; the axle weighs next to nothing."""
    tyre = Tyre(
        radius=0.5, width=0.42, crown=2e-4, side_wall=1e-3, vertical_stiffness=stiffness, vertical_damping=2e4,
        lateral_stiffness=stiffness, friction=2.0,
    )  # fmt: skip
    carrier = "chassis" if swing_deg is None else "front_axle"
    wheels = tuple(
        Wheel(name=name, centre=(x, y, 0.5), tyre=tyre, carrier="chassis" if x == 0.0 else carrier, rolls=x > 0.0)  # type: ignore[arg-type]
        for name, x, y in (
            ("rear_left", 0.0, 0.75),
            ("rear_right", 0.0, -0.75),
            ("front_left", L, 0.75),
            ("front_right", L, -0.75),
        )
    )
    axle = None
    if swing_deg is not None:
        body = MassProperties(mass=1.0, centre_of_mass=(L, 0.0, HP), inertia=(1.0, 0.6, 1.0))
        axle = FrontAxle(pivot=(L, 0.0, HP), body=body, swing_deg=swing_deg, stop_stiffness=1e8, stop_damping=1e5)
    corner = Box(name="rops", low=(0.0, -CORNER[0], 2.4), high=(0.05, CORNER[0], CORNER[1]))
    return Scenario(
        title="rigid",
        vehicle=Vehicle(
            name="rigid",
            whole=MassProperties(mass=M, centre_of_mass=(A, 0.0, H), inertia=(IXX, 3000.0, 3300.0)),
            wheels=wheels,
            front_axle=axle,
            outline=(corner,) if rops else (Box(name="cube", low=(0.8, -0.1, 0.7), high=(1.0, 0.1, 0.9)),),
        ),
        ground=Ground(elements=Elements(length=8.0, width=16.0), law=Ye2006()),
        initiation=Standing(),
        simulation=Simulation(duration=1.0, step=step, output_step=max(step, 1e-3)),
    )


def stands(scenario: Scenario, slope_deg: float) -> bool:
    """Whether the tractor finds a standing equilibrium across a slope, and is still there a second later."""
    across = scenario.replaced({"ground.surface": {"kind": "slope", "angle_deg": slope_deg, "direction_deg": 90.0}})
    try:
        result = run(across)
    except ValueError:
        return False
    assert result.status == "done", result.sentence
    roll = result.recording["chassis/roll"]
    return bool(np.ptp(roll) < math.radians(0.5))


def tip_angle(scenario: Scenario, low: float, high: float) -> float:
    """Slope at which it just stands, deg, to 0.05 deg."""
    assert stands(scenario, low)
    assert not stands(scenario, high)
    while high - low > 0.05:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if stands(scenario, middle) else (low, middle)
    return 0.5 * (low + high)


def test_tip_angle_with_free_pivot() -> None:
    """tan b1 = s (1 - a/L)/(h - h_p a/L): about the line from the rear tyre's edge to the pivot; 43.8 deg."""
    expected = math.degrees(math.atan(S * (1 - A / L) / (H - HP * A / L)))
    assert expected == pytest.approx(43.8, abs=0.05)
    assert tip_angle(rigid_tractor(swing_deg=20.0), 0.95 * expected, 1.05 * expected) == pytest.approx(
        expected, rel=0.01
    )


def test_tip_angle_with_the_stop_engaged() -> None:
    """tan b2 = [s_r (1 - a/L) + s_f a/L]/h with equal tracks is s/h: about the line of both tyres' edges; 49.5 deg."""
    expected = math.degrees(math.atan(S / H))
    found = tip_angle(rigid_tractor(swing_deg=0.01), 0.95 * expected, 1.05 * expected)
    assert found == pytest.approx(expected, rel=0.01)


def test_balance_is_with_the_centre_of_mass_over_the_edge() -> None:
    """Flat ground, rigid: roll = atan(s/h)."""
    scenario = rigid_tractor(swing_deg=None).replaced(
        {"initiation": {"kind": "tip-over", "side": "left", "excess_deg": 0.0}}
    )
    bodies = bodies_of(scenario.vehicle, scenario.ground.elements)
    start = place(scenario, bodies, tables_of(scenario, bodies))
    assert -math.degrees(start.q[3]) == pytest.approx(math.degrees(math.atan(S / H)), rel=2e-3)
    # nothing moves at first: what little leaves the balance grows with cosh(2.2 t)
    result = run(scenario)
    assert abs(result.recording["chassis/angular_velocity_x"][100]) < 1e-2


def test_free_side_roll_from_balance_until_the_corner_lands() -> None:
    """Rigid roll about an edge: M g (r - z) = I w^2/2 with I = Ixx + M r^2, r = |(s, h)|.

    The corner stands at (b - s, H) from the edge and lands at roll = pi - atan(H/(s - b)). For the utility tractor
    98.2 deg, 117 deg/s, 5.15 m/s and 12.6 kJ. The body is a thin plate as wide as the tyres, which pivots on its
    edge on ground 1e5 times as stiff as clay, with a tower as wide and high as the ROPS.
    """
    radius, balance = math.hypot(S, H), math.atan(S / H)
    excess = math.radians(1.0)
    base = rigid_tractor(swing_deg=None)
    vehicle = Vehicle(
        name="plate and tower",
        whole=MassProperties(mass=M, centre_of_mass=(0.0, 0.0, H), inertia=(IXX, 3000.0, 3300.0)),
        outline=(
            Box(name="plate", low=(-0.5, -S, 0.0), high=(0.5, S, 0.002)),
            Box(name="tower", low=(-0.5, -CORNER[0], 2.4), high=(0.5, CORNER[0], CORNER[1])),
        ),
        contact_spacing=0.04,
    )
    result = run(
        replace(
            base,
            vehicle=vehicle,
            ground=Ground(
                elements=base.ground.elements,
                law=Ye2006(stiffness_scale=1e5),
                friction=Coulomb(coefficient=2.0),
                co_moving_mass=CoMovingMass(fraction=0.0),
            ),
            initiation=Drop(speed=1e-3, roll_deg=-math.degrees(balance + excess)),
            simulation=Simulation(duration=3.0, step=5e-4, output_step=5e-4),
        )
    )
    rec = result.recording
    roll = math.pi - math.atan(CORNER[1] / (S - CORNER[0]))
    assert math.degrees(roll) == pytest.approx(98.2, abs=0.05)
    k = int(np.argmax(-rec["chassis/roll"] > roll - 2e-3))
    # the edge pivots without slipping or lifting: the centre of mass stays on its circle
    edge = rec["chassis/position_y"] - radius * np.cos(math.atan2(H, -S) + rec["chassis/roll"])
    assert np.ptp(edge[:k]) < 0.01
    energy = M * 9.81 * (radius * math.cos(excess) - H * math.cos(roll) - S * math.sin(roll))
    assert energy == pytest.approx(12.6e3, rel=5e-3)
    rate = math.sqrt(2 * energy / (IXX + M * radius**2))
    assert math.degrees(rate) == pytest.approx(117, rel=5e-3)
    assert abs(rec["chassis/angular_velocity_x"][k]) == pytest.approx(rate, rel=0.01)
    speed = rate * math.hypot(S - CORNER[0], CORNER[1])
    assert speed == pytest.approx(5.15, rel=5e-3)


def test_tyres_give_back_what_they_take() -> None:
    """An undamped, frictionless vehicle rocking on its tyres keeps its energy: the tyre is a potential."""
    scenario = rigid_tractor(swing_deg=None, stiffness=3e5, step=5e-4)
    frozen = {f"vehicle.wheels.{w}.tyre.{k}": 0.0 for w in ("rear_left", "rear_right", "front_left", "front_right")
              for k in ("vertical_damping", "friction")}  # fmt: skip
    soft = {f"vehicle.wheels.{w}.tyre.crown": 0.05 for w in ("rear_left", "rear_right", "front_left", "front_right")}
    result = run(scenario.replaced({**frozen, **soft, "initiation.roll_rate": 0.5, "simulation.duration": 3.0,
                                    "simulation.spectral_radius": 1.0}))  # fmt: skip
    kinetic = result.recording["energy/kinetic"]
    moved = result.recording["energy/potential"] + result.recording["energy/tyre"]
    assert np.ptp(result.recording["chassis/roll"]) > 0.03
    # trapezoidal rule at h = 0.5 ms on a 2.5 Hz rocking: (w h)^2/12 a cycle and less
    assert np.abs(kinetic + moved - kinetic[0]).max() < 2e-3 * kinetic[0]


@pytest.mark.parametrize(("side", "sign"), [("left", -1), ("right", 1)])
def test_tip_over_falls_to_the_side_that_was_asked_for(side: str, sign: int) -> None:
    tip = {"initiation": {"kind": "tip-over", "side": side, "excess_deg": 2.0}, "simulation.duration": 1.6}
    roll = run(rigid_tractor(swing_deg=None, rops=True, step=5e-4).replaced(tip)).recording["chassis/roll"]
    assert sign * roll[0] > math.radians(45)
    assert sign * (roll[-1] - roll[0]) > math.radians(20)


def test_vehicle_that_cannot_stand_says_so() -> None:
    with pytest.raises(ValueError, match="does not stand"):
        run(rigid_tractor(swing_deg=None).replaced({"ground.surface": {"kind": "slope", "angle_deg": 55.0}}))
    assert Slope(angle_deg=55.0).gradient[1] > 1.0


@pytest.mark.parametrize("camber_deg", [1.0, 25.0, 55.0, 76.0, 120.0])
def test_tyre_forces_are_the_gradient_of_their_energy(camber_deg: float) -> None:
    """Q = -dU/dq with U = k(camber) depth^2/2, without damping and friction, by central differences."""
    scenario = rigid_tractor(swing_deg=None, stiffness=3e5)
    changes: dict[str, object] = {}
    for wheel in ("rear_left", "rear_right", "front_left", "front_right"):
        tyre = f"vehicle.wheels.{wheel}.tyre"
        changes |= {f"{tyre}.lateral_stiffness": 1e5, f"{tyre}.crown": 0.04, f"{tyre}.friction": 0.0}
        changes |= {f"{tyre}.vertical_damping": 0.0}
    scenario = scenario.replaced(changes)
    bodies = bodies_of(scenario.vehicle, scenario.ground.elements)
    t = tables_of(scenario, bodies)
    kernels = handle(t)
    R = from_angles(math.radians(camber_deg), 0.05, 0.3)
    lowest = min(float(tread_point(t, bodies, w, R)[2]) for w in range(4))
    place_at = np.array([0.0, 0.0, -lowest - 0.06]) + R @ bodies[0].centre

    def at(x: np.ndarray, turn: np.ndarray) -> tuple[float, np.ndarray]:
        q, Q = np.concatenate([x, rotation_vector(turn)]), np.zeros(6)
        generalised_forces(kernels, q, np.zeros(6), Q)
        return float(t.wheel_memory[:, E_ENERGY_NOW].sum()), Q

    energy, Q = at(place_at, R)
    assert energy > 1.0
    eps = 1e-6
    for k in range(3):
        e = np.eye(3)[k]
        slope = (at(place_at + eps * e, R)[0] - at(place_at - eps * e, R)[0]) / (2 * eps)
        assert Q[k] == pytest.approx(-slope, rel=1e-5, abs=1e-3)
        spun = [at(place_at, R @ matrices((s * eps * e)[None])[0])[0] for s in (1.0, -1.0)]
        assert Q[3 + k] == pytest.approx(-(spun[0] - spun[1]) / (2 * eps), rel=1e-5, abs=1e-2)


def test_above_the_static_limit_it_starts_from_rest() -> None:
    """Below 35 deg this tractor balances on two wheels; above it neither stands nor balances and is let go."""
    slope = load("side_overturn_slope").replaced({"simulation.duration": 0.4})
    for angle, side, stands in ((34.0, "left", True), (35.5, "left", False), (50.0, "left", False)):
        changes = {"ground.surface.angle_deg": angle, "initiation.side": side}
        done = run(slope.replaced(changes))
        assert done.status == "done"
        assert ("no static balance" in done.sentence) is not stands
        roll, loads = np.degrees(done.recording["chassis/roll"]), done.recording["wheel/rear_left/force_normal"]
        if not stands:
            assert roll[0] == pytest.approx(-angle, abs=1e-6), "flat on the slope"
            assert done.recording["energy/kinetic"][0] == pytest.approx(0.0, abs=1e-9)
            assert loads[0] > 0.0
            assert roll[-1] < roll[0] - 1.0, "it tips by itself"


def test_away_from_the_slope_there_is_nothing_to_let_go() -> None:
    steep = load("side_overturn_slope").replaced({"ground.surface.angle_deg": 45.0, "initiation.side": "right"})
    with pytest.raises(InputError, match=r"falls downhill, a flatter surface, or another initiation.kind"):
        run(steep)
