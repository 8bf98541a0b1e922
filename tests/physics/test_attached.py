"""Attached masses, tyres that bottom, and the shipped vehicles in an overturn."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from rollover.assessment.clearance import protected_margin
from rollover.assessment.criteria import LIGHT_SHARES, rops_share
from rollover.dynamics.assembly import tables_of
from rollover.dynamics.bodies import bodies_of
from rollover.dynamics.simulate import run
from rollover.kernels.forces import generalised_forces
from rollover.kernels.tables import E_DEPTH_NOW, E_ENERGY_NOW, E_FORCE_NOW, handle
from rollover.spec.frames import from_angles, rotation_vector
from rollover.spec.inertia import MassProperties
from rollover.spec.shapes import Box
from rollover.spec.vehicle import Attached, Vehicle, carried, chassis_of, laden
from tests.physics.scenes import shipped


def utility() -> Vehicle:
    vehicle = shipped("side_overturn").vehicle
    assert isinstance(vehicle, Vehicle)
    return vehicle


def test_ballast_shifts_the_centre_of_mass_as_by_hand() -> None:
    """3000 kg at (0.90, 0, 0.82) and 300 kg at (2.90, 0, 0.60): x = (2700 + 870)/3300, z = (2460 + 180)/3300.

    Iyy about the new centre: 3000 + 12.5 + 3000*300/3300 (2.0^2 + 0.22^2), the cuboid 300/12 (0.4^2 + 0.58^2) = 12.4.
    """
    ballast = Attached(name="ballast", mass=300.0, centre_of_mass=(2.90, 0.0, 0.60), size=(0.4, 0.8, 0.58))
    vehicle = dataclasses.replace(utility(), attached=(ballast,))
    whole = laden(vehicle)
    assert whole.mass == 3300.0
    assert whole.centre_of_mass == pytest.approx((3570.0 / 3300.0, 0.0, 2640.0 / 3300.0), rel=1e-12)
    own = 300.0 / 12.0 * (0.4**2 + 0.58**2)
    assert whole.inertia[1] == pytest.approx(3000.0 + own + 3000.0 * 300.0 / 3300.0 * (2.0**2 + 0.22**2), rel=1e-12)
    assert whole.products[1] == pytest.approx(-3000.0 * 300.0 / 3300.0 * 2.0 * -0.22, rel=1e-12)
    # it stands on top of the whole, and of the body that carries it alone
    assert chassis_of(vehicle) == chassis_of(utility())
    assert carried(vehicle, "chassis").mass == pytest.approx(chassis_of(vehicle).mass + 300.0)
    assert carried(vehicle, "rops") == vehicle.rops.body  # type: ignore[union-attr]


@pytest.mark.parametrize("carrier", ["chassis", "front_axle", "rops"])
def test_an_attached_mass_moves_with_the_body_that_carries_it(carrier: str) -> None:
    weights = Box(name="weights", low=(2.7, -0.4, 0.3), high=(3.1, 0.4, 0.9))
    mass = Attached(
        name="plate",
        mass=120.0,
        centre_of_mass=(2.9, 0.1, 0.6),
        inertia=(5.0, 6.0, 7.0),
        carried_by=carrier,  # type: ignore[arg-type]
        outline=(weights,),
    )
    scenario = shipped("side_overturn")
    plain = bodies_of(utility(), scenario.ground.elements)
    bodies = bodies_of(dataclasses.replace(utility(), attached=(mass,)), scenario.ground.elements)
    for before, after in zip(plain, bodies, strict=True):
        heavier = after.inertia.mass - before.inertia.mass
        assert heavier == pytest.approx(120.0 if after.name == carrier else 0.0)
        touching = {name for name, _ in after.surfaces} - {name for name, _ in before.surfaces}
        assert touching == ({"weights"} if after.name == carrier else set())


def test_ballast_in_front_presses_on_the_front_wheels() -> None:
    """Standing: the front axle carries m a/L + 300 (2.90/2.25) kg, pitch aside."""
    ballast = {"name": "ballast", "mass": 300.0, "centre_of_mass": [2.90, 0.0, 0.60], "size": [0.4, 0.8, 0.4]}
    changes = {"initiation": {"kind": "standing"}, "simulation.duration": 0.01}
    scenario = shipped("side_overturn").replaced({**changes, "vehicle.attached": [ballast]})
    recording = run(scenario).recording
    front = sum(recording[f"wheel/front_{side}/force_normal"][0] for side in ("left", "right"))
    assert front == pytest.approx(9.81 * (3000.0 * 0.90 + 300.0 * 2.90) / 2.25, rel=0.01)
    rear = sum(recording[f"wheel/rear_{side}/force_normal"][0] for side in ("left", "right"))
    assert front + rear == pytest.approx(9.81 * 3300.0, rel=1e-5)


def test_an_attached_mass_says_its_inertia_once() -> None:
    with pytest.raises(ValueError, match="give either inertia or size"):
        Attached(name="a", mass=1.0, centre_of_mass=(0.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="triangle"):
        Attached(name="a", mass=1.0, centre_of_mass=(0.0, 0.0, 0.0), inertia=(1.0, 1.0, 3.0))
    loose = Attached(name="a", mass=1.0, centre_of_mass=(0.0, 0.0, 0.0), size=(1.0, 1.0, 1.0), carried_by="rops")
    with pytest.raises(ValueError, match=r"attached\.a\.carried_by: there is none"):
        dataclasses.replace(utility(), rops=None, attached=(loose,))


# ---------------------------------------------------------------- rim bottoming


@pytest.mark.parametrize("camber", [0.0, 20.0, 60.0, 75.0, 85.0])
def test_a_bottomed_tyre_is_a_potential(camber: float) -> None:
    """Q = -dE/dq for each of the six coordinates, friction and damping off; deeper than the rim, up to lying flat."""
    scenario = shipped("side_overturn").replaced({"ground.friction.coefficient": 0.0})
    tyre = dataclasses.replace(
        utility().wheels[2].tyre, friction=0.0, vertical_damping=0.0, bottoming=0.05, bottoming_stiffness=2e6
    )
    wheel = dataclasses.replace(utility().wheels[2], tyre=tyre)
    whole = MassProperties(mass=1000.0, centre_of_mass=(0.3, 0.1, 0.8), inertia=(400.0, 500.0, 600.0))
    vehicle = Vehicle(name="corner", whole=whole, wheels=(wheel,))
    scenario = dataclasses.replace(shipped("rops_drop"), vehicle=vehicle)
    t = tables_of(scenario, bodies_of(vehicle, scenario.ground.elements))
    kernels, Q, scratch = handle(t), np.zeros(6), np.zeros(6)
    R = from_angles(np.radians(-camber), 0.1, 0.2)

    def state(x: np.ndarray, turn: np.ndarray) -> np.ndarray:
        return np.concatenate([x, rotation_vector(R @ from_angles(*turn))])

    x = np.array([0.0, 0.0, 3.0])
    generalised_forces(kernels, state(x, np.zeros(3)), np.zeros(6), Q)
    depth = float(t.wheel_memory[0, E_DEPTH_NOW])
    x[2] += depth - 0.10  # 65 mm beyond the rim's 35 mm
    generalised_forces(kernels, state(x, np.zeros(3)), np.zeros(6), Q)
    force = float(t.wheel_memory[0, E_FORCE_NOW])
    soft = tables_of(
        dataclasses.replace(
            scenario,
            vehicle=dataclasses.replace(
                vehicle, wheels=(dataclasses.replace(wheel, tyre=dataclasses.replace(tyre, bottoming=None)),)
            ),
        ),
        bodies_of(vehicle, scenario.ground.elements),
    )
    generalised_forces(handle(soft), state(x, np.zeros(3)), np.zeros(6), scratch)
    share = min(1.0, np.cos(np.arcsin(np.clip((R @ [0, 1, 0])[2], -1, 1))) ** 2 / 0.12)
    assert force - soft.wheel_memory[0, E_FORCE_NOW] == pytest.approx(share * 2e6 * 0.065, rel=1e-6)
    eps = 1e-6
    for k in range(6):
        energies = []
        for sign in (-1.0, 1.0):
            way = np.zeros(6)
            way[k] = sign * eps
            generalised_forces(kernels, state(x + way[:3], way[3:]), np.zeros(6), scratch)
            energies.append(float(t.wheel_memory[0, E_ENERGY_NOW]))
        assert Q[k] == pytest.approx(-(energies[1] - energies[0]) / (2.0 * eps), rel=1e-4, abs=5.0)


def test_bottoming_closes_the_ledger_and_hardens_a_drop() -> None:
    """Dropped on its wheels from 3 m/s, tyres that bottom at a tenth of their radius give the higher peak."""
    drop = {"initiation": {"kind": "drop", "speed": 3.0}, "simulation.duration": 0.3}
    hard = {
        f"vehicle.wheels.{w}.tyre.{key}": value
        for w in ("front_left", "front_right", "rear_left", "rear_right")
        for key, value in (("bottoming", 0.10), ("bottoming_stiffness", 1.5e6))
    }
    soft, firm = (run(shipped("side_overturn").replaced({**drop, **more})) for more in ({}, hard))
    assert np.abs(firm.recording["energy/residual"]).max() < 5e-3 * firm.released
    peaks = [r.recording["wheel/rear_left/force_normal"].max() for r in (soft, firm)]
    assert peaks[1] > 1.3 * peaks[0]


# ---------------------------------------------------------------- every vehicle overturns

TRACTORS = (
    "vineyard_tractor",
    "compact_tractor",
    "compact_tractor_folding",
    "utility_tractor",
    "mf178",
    "row_crop_tractor",
    "large_tractor",
    "light_vehicle",
)


@pytest.mark.parametrize("name", TRACTORS)
def test_every_vehicle_overturns(name: str) -> None:
    """Down to its side, stopped by its ROPS before it lies on its back; the ledger closes."""
    result = run(shipped("side_overturn").replaced({"vehicle": f"vehicles/{name}.yaml", "simulation.duration": 3.0}))
    vehicle = result.scenario.vehicle
    assert isinstance(vehicle, Vehicle)
    weight = 9.81 * laden(vehicle).mass
    assert result.status == "done"
    assert np.abs(result.recording["energy/residual"]).max() < 5e-3 * result.released
    force, roll = result.recording["rops/force"], np.degrees(result.recording["chassis/roll"])
    assert any(e.kind == "first-touch" and e.subject in ("rops", "rops_upper") for e in result.events)
    first = int(np.argmax(force > 0.0))
    assert -112.0 < roll[first] < -88.0  # a rigid tractor's corner lands at 94 to 98 degrees
    assert 0.3 * weight < force.max() < 2.0 * weight
    assert roll.min() > -135.0
    assert 0.02 < result.recording["rops/deflection"].max() < 0.20


def test_a_folded_rops_does_not_stop_the_roll() -> None:
    result = run(shipped("side_overturn").replaced({"vehicle": "vehicles/compact_tractor_folded.yaml"}))
    assert np.degrees(result.recording["chassis/roll"]).min() < -160.0


def test_the_share_of_the_energy_that_a_light_rops_takes() -> None:
    """Published for vehicles of 300 to 600 kg: 43 to 61 percent of the energy of the roll. Here, of the kinetic energy

    when the ROPS lands: 16 percent on natural clay, which yields under a ROPS of 53 kN/m; 25 on ground a hundred times
    as stiff; 44 there with mounts that yield at a third. The trials' ground and frames are not told: firm and soft.
    """
    light = shipped("side_overturn").replaced({"vehicle": "vehicles/light_vehicle.yaml", "simulation.duration": 2.0})
    firm = {"ground.law.stiffness_scale": 100.0}
    soft = {f"vehicle.rops.mounts.{m}.yield_force": [2000.0, 900.0, None] for m in ("left", "right")}
    shares: list[float | None] = []
    for changes in ({}, firm, {**firm, **soft}):
        shares.append(rops_share(run(light.replaced(changes))))
    print(f"share of the ROPS on clay, firm ground, firm ground with soft mounts: {shares}; published 0.43 to 0.61")
    assert shares == pytest.approx(LIGHT_SHARES, abs=0.01)  # the numbers that stand beside every overturn


def test_the_clearance_zone_sees_the_upper_part() -> None:
    """Upright, the zone lies within the frame in two parts as within the one in one part; folded back not."""
    margins = {
        name: protected_margin(vehicle)
        for name in ("compact_tractor", "compact_tractor_folding", "compact_tractor_folded")
        if isinstance(
            vehicle := shipped("side_overturn").replaced({"vehicle": f"vehicles/{name}.yaml"}).vehicle, Vehicle
        )
    }
    assert margins["compact_tractor_folding"] == pytest.approx(margins["compact_tractor"], abs=0.05)
    assert margins["compact_tractor_folded"] < margins["compact_tractor"] - 0.2
