"""Soil that is pushed aside: Rankine's passive pressure by hand, a plate that ploughs, its energy, what is refused."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from ground.array import Elements
from ground.bekker import BekkerWong
from ground.friction import Bulldozing, Coulomb, JanosiHanamoto
from ground.kernel import CELL, IDLE, LINE_F, LINE_K, LINE_Z, LOADING, MODE, NORMAL, PLOUGHED, SINKAGE
from rollover.assessment.ledger import closure
from rollover.dynamics.assembly import tables_of
from rollover.dynamics.bodies import bodies_of
from rollover.dynamics.result import Run
from rollover.dynamics.simulate import run
from rollover.kernels.forces import read_poses
from rollover.kernels.ploughing import plough
from rollover.kernels.tables import ACTIVE, SLOTS, handle
from rollover.scenario import Scenario, Simulation, load
from rollover.spec.document import to_mapping
from rollover.spec.inertia import MassProperties
from rollover.spec.initiation import Throw
from rollover.spec.shapes import Box
from rollover.spec.vehicle import RigidBody
from rollover.system.errors import InputError

SOIL = BekkerWong(cohesive_modulus=0.0, frictional_modulus=2.0e5, exponent=1.0, width=0.1)
EARTH = Bulldozing(unit_weight=18_000.0, friction_angle_deg=30.0, cohesion=5000.0, surcharge=1000.0)
# m, kg; edges 0.1 mm within those of elements of 0.1 m, so that sliding straight on never takes in a further row
LENGTH, WIDTH, MASS = 0.7998, 0.3998, 600.0


def test_passive_pressure_by_hand() -> None:
    """K_p = 3 at 30 deg. At 0.2 m: 18 000/2 x 0.04 x 3 + 1000 x 0.2 x 3 + 2 x 5000 x 0.2 x sqrt(3) = 5144.1 N/m."""
    assert EARTH.passive == pytest.approx(3.0, rel=1e-12)
    square, linear = EARTH.coefficients
    assert square * 0.2**2 + linear * 0.2 == pytest.approx(1080.0 + 600.0 + 3464.1016, rel=1e-7)
    # clay that does not drain, phi = 0: K_p = 1
    assert Bulldozing(unit_weight=17e3, friction_angle_deg=0.0, cohesion=20e3).coefficients == pytest.approx(
        (8500, 4e4)
    )


class Footprint:
    """A footprint of 6 by 4 elements of 0.05 m under a body that slides, all of them 0.1 m deep."""

    depth, square, linear = 0.1, *EARTH.coefficients

    def __init__(self) -> None:
        given = {"unit_weight": 18e3, "friction_angle_deg": 30.0, "cohesion": 5e3, "surcharge": 1e3}
        scenario = load("soil_trip").replaced(
            {"ground.friction.bulldozing": given, "ground.elements.spacing": [0.05, 0.05]}
        )
        self.t = t = tables_of(scenario, bodies_of(scenario.vehicle, scenario.ground.elements))
        self.cells = [(30 + i, 40 + j) for i in range(6) for j in range(4)]
        for slot, (i, j) in enumerate(self.cells):
            self.put(slot, i, j, LOADING)
            t.active[slot] = slot
        t.counts[ACTIVE] = t.counts[SLOTS] = len(self.cells)

    def put(self, slot: int, i: int, j: int, mode: int) -> None:
        t = self.t
        cell = i * int(t.grid_i[1]) + j
        t.slot_of[cell], t.state[slot, CELL], t.state[slot, MODE] = slot, cell, mode
        t.memory[slot, SINKAGE], t.memory[slot, NORMAL + 2] = self.depth, 1.0

    def pushed(self, x: float, y: float) -> float:
        read_poses(self.t.pose, np.zeros(6), np.array([x, y, -0.3, 0.0, 0.0, 0.0]))
        plough(handle(self.t))
        return float(self.t.memory[: len(self.cells), PLOUGHED].sum())

    def expected(self, across: float, rut: float = 0.0) -> float:
        at = [(self.square * z + self.linear) * z for z in (self.depth, rut)]
        return float(across * (at[0] - at[1]))


@pytest.mark.parametrize("angle_deg", [0.0, 30.0, 90.0, 135.0, 200.0, 300.0])
def test_an_edge_is_met_by_its_width_across_the_motion(angle_deg: float) -> None:
    a = math.radians(angle_deg)
    across = 4 * 0.05 * abs(math.cos(a)) + 6 * 0.05 * abs(math.sin(a))
    footprint = Footprint()
    assert footprint.pushed(2.0 * math.cos(a), 2.0 * math.sin(a)) == pytest.approx(footprint.expected(across))
    # what has stopped keeps the side that it ploughed to
    assert footprint.pushed(0.0, 1e-4) == pytest.approx(footprint.expected(across))


def test_a_rut_ahead_is_met_by_what_is_below_it() -> None:
    """Rut of 60 mm: from 80 mm a line of unloading of 20 mm leads there."""
    footprint = Footprint()
    for k in range(4):
        slot = len(footprint.cells) + k
        footprint.put(slot, 36, 40 + k, IDLE)
        m = footprint.t.memory[slot]
        m[LINE_Z], m[LINE_F], m[LINE_K] = 0.08, 2000.0, 1e5
    assert footprint.pushed(1.5, 0.0) == pytest.approx(footprint.expected(4 * 0.05, rut=0.06))
    assert footprint.pushed(-1.5, 0.0) == pytest.approx(footprint.expected(4 * 0.05))


def ploughing(velocity: tuple[float, float], friction: Coulomb | JanosiHanamoto, integrator: str = "compiled") -> Run:
    """A plate of 0.8 m by 0.4 m that sinks 92 mm by its weight, m g = A k_phi z, and slides on from there."""
    sunk = MASS * 9.81 / (LENGTH * WIDTH * 2.0e5)
    start = Throw(position=(0.0, 0.0, 0.001), velocity=(*velocity, 0.0))
    scenario: Scenario = replace(
        load("soil_trip"),
        vehicle=RigidBody(
            name="plate",
            # its centre of mass at the depth of its sole's pressure: it does not pitch
            whole=MassProperties(mass=MASS, centre_of_mass=(0.0, 0.0, 0.0), inertia=(1e5, 1e5, 1e5)),
            outline=(Box(name="plate", low=(-LENGTH / 2, -WIDTH / 2, 0.0), high=(LENGTH / 2, WIDTH / 2, 0.5)),),
            contact_spacing=0.08,
        ),
        initiation=start,
    )
    ground = replace(
        scenario.ground,
        elements=Elements(length=6.0, width=6.0, spacing=(0.1, 0.1)),
        law=SOIL,
        friction=friction,
        co_moving_mass=replace(scenario.ground.co_moving_mass, fraction=0.0),
    )
    simulation = Simulation(duration=0.25, step=1e-3, output_step=1e-3, integrator=integrator)  # type: ignore[arg-type]
    done = run(replace(scenario, ground=ground, simulation=simulation))
    assert done.status == "done", done.sentence
    assert float(done.recording["ground/sinkage"].max()) > sunk
    return done


@pytest.mark.parametrize(
    ("velocity", "across", "most"),
    [
        ((3.0, 0.0), WIDTH, WIDTH),
        ((0.0, 3.0), LENGTH, LENGTH),
        ((-3.0, 0.0), WIDTH, WIDTH),
        # the plate's edges lie within elements, which count in whole: one more of 0.1 m each way
        ((2.0, 2.0), (LENGTH + WIDTH) / math.sqrt(2.0), (LENGTH + WIDTH + 0.2) / math.sqrt(2.0)),
    ],
)
def test_a_plate_that_ploughs_meets_the_closed_form(velocity: tuple[float, float], across: float, most: float) -> None:
    """F = b (1/2 gamma z^2 K_p + q z K_p + 2 c z sqrt(K_p)), b across the motion, z that of the step's start."""
    done = ploughing(velocity, Coulomb(coefficient=0.0, bulldozing=EARTH))
    force, sunk = done.recording["ground/force_tangential"][1:], done.recording["ground/sinkage"][:-1]
    deep = sunk > 0.02
    assert deep.sum() > 100
    square, linear = EARTH.coefficients
    each = force[deep] / ((square * sunk[deep] + linear) * sunk[deep])
    assert each.min() > across * (1.0 - 1e-3)
    assert each.max() < most * (1.0 + 1e-3)
    # it acts against the motion
    x, y = (done.recording[f"chassis/velocity_{axis}"] for axis in "xy")
    assert math.hypot(x[-1], y[-1]) < math.hypot(*velocity)
    assert x[-1] * velocity[1] == pytest.approx(y[-1] * velocity[0], abs=0.02)


@pytest.mark.parametrize("integrator", ["exudyn", "compiled"])
@pytest.mark.parametrize(
    "friction",
    [
        Coulomb(coefficient=0.3, bulldozing=EARTH),
        JanosiHanamoto(cohesion=2000.0, friction_angle_deg=25.0, shear_modulus=0.01, bulldozing=EARTH),
    ],
)
def test_what_it_takes_is_booked(friction: Coulomb | JanosiHanamoto, integrator: str) -> None:
    done = ploughing((3.0, 0.0), friction, integrator)
    plain = ploughing((3.0, 0.0), replace(friction, bulldozing=None), integrator)
    assert closure(done).largest < 0.005
    lost = [0.5 * MASS * (9.0 - r.recording["chassis/velocity_x"][-1] ** 2) for r in (done, plain)]
    assert lost[0] > 1.1 * lost[1]
    # the plate keeps level: what is lost along x is what friction took
    assert done.ledger["friction"] == pytest.approx(lost[0], rel=0.02)


def test_none_is_as_before_in_numbers_and_hash() -> None:
    scenario = load("soil_trip")
    for friction in (scenario.ground.friction, Coulomb()):
        assert "bulldozing" not in to_mapping(friction, hashed=True)
    given = {"unit_weight": 15e3, "friction_angle_deg": 29.0, "cohesion": 1720.0}
    pushed = scenario.replaced({"ground.friction.bulldozing": given})
    assert pushed.ground.friction.bulldozing == Bulldozing(unit_weight=15e3, friction_angle_deg=29.0, cohesion=1720.0)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (
            {
                "ground.law": {"kind": "hard"},
                "ground.friction.bulldozing": {"unit_weight": 1e4, "friction_angle_deg": 30},
            },
            "ground.friction.bulldozing: ground that keeps no rut, got law.kind 'hard'",
        ),
        (
            {"ground.friction.bulldozing": {"unit_weight": 0.0, "friction_angle_deg": 30.0}},
            "ground.friction.bulldozing.unit_weight: out of bounds, got 0.0",
        ),
        (
            {"ground.friction.bulldozing": {"unit_weight": 1e4, "friction_angle_deg": 75.0}},
            "ground.friction.bulldozing.friction_angle_deg: out of bounds, got 75.0",
        ),
    ],
)
def test_wrong_bulldozing_is_one_line(changes: dict[str, object], said: str) -> None:
    with pytest.raises(InputError) as refused:
        load("soil_trip").replaced(changes)
    assert said in str(refused.value)
