"""A tyre that lies on its side: a rigid ring on an even foundation, against the ring itself; friction, energy, null."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import minimize

from ground.surface import Plane, Slope, Surface
from rollover.assessment.ledger import closure
from rollover.dynamics.simulate import run
from rollover.kernels.tables import E_INWARD_NOW, W_CROWN, W_HALF, W_KY, W_KZ, W_RADIUS, W_SIDE
from rollover.kernels.tyres import laid
from rollover.scenario import Scenario
from rollover.spec.frames import from_angles
from rollover.spec.inertia import MassProperties
from rollover.spec.vehicle import Tyre, Vehicle, Wheel
from tests.physics.scenes import shipped
from tests.physics.test_tread import DEPTH, ENERGY, FORCE, SURFACES, Tyres, moved, poses

Array = NDArray[np.float64]
LYING = 7.5e5  # N/m, above three times the largest k_y of the tractor's tyres


def ring(c: float, R: float, d: float, s: float) -> float:
    """Energy of a rigid ring on an even foundation pressed by a plane at slope s, its lowest point by d, J.

    It shifts by u and tilts by v against the rim, c u^2/2 + c R^2 v^2/4, and lies nowhere in the plane:
    d - R s - u + R |s - v| <= 0. Solved as it stands, from above and below.
    """
    z = d - R * s

    def energy(x: Array) -> float:
        return float(0.5 * c * x[0] ** 2 + 0.25 * c * (R * x[1]) ** 2)

    clear: list[dict[str, Any]] = [
        {"type": "ineq", "fun": lambda x, sign=sign: x[0] - z + sign * R * (s - x[1])} for sign in (1.0, -1.0)
    ]
    start = np.array([z + R * s, s])
    # in units of about 1: its own scale of energy would hide the minimum from the search
    found = minimize(lambda x: energy(x) / (c * d * d), start, constraints=clear, options={"ftol": 1e-14})
    return energy(found.x)


@pytest.mark.parametrize("slope", [1e-6, 0.01, 0.05, 0.2])
@pytest.mark.parametrize("depth", [0.004, 0.02, 0.08])
def test_it_is_a_rigid_ring_on_an_even_foundation(depth: float, slope: float) -> None:
    """U and dU/d(depth) of `laid` with kappa = 3, k = c/3, beside the ring's own smallest energy."""
    wheel = np.zeros(W_SIDE + 1)
    wheel[W_RADIUS], wheel[W_CROWN], wheel[W_SIDE] = 0.63, 0.03, 3.0
    c, R, e = 6e5, 0.6, 1e-5
    pressed, twice, inward = laid(wheel, depth, slope)
    assert 0.5 * c / 3.0 * twice == pytest.approx(ring(c, R, depth, slope), rel=1e-6)
    force = (ring(c, R, depth + e, slope) - ring(c, R, depth - e, slope)) / (2.0 * e)
    assert c / 3.0 * pressed == pytest.approx(force, rel=1e-4)
    # moment about the ring's middle: c R^2 s/2 once it is flat, else the force at its edge
    flat = depth > 1.5 * R * slope
    assert pressed * (R - inward) == pytest.approx(3.0 * R * R * slope / 2.0 if flat else pressed * R, rel=1e-9)


@pytest.mark.parametrize(
    "surface", [Plane(), Slope(angle_deg=20.0, direction_deg=40.0), *SURFACES], ids=lambda s: s.kind
)
def test_its_force_is_the_gradient_of_its_energy(surface: Surface) -> None:
    """Q = -dU/dx by central differences at 60 poses of any camber, and nearly and quite flat on the side."""
    tyres = Tyres(surface, LYING)
    rng, flat = np.random.default_rng(8), 0
    found = poses(tyres, surface, 5, 40)
    while len(found) < 60:
        place, R = (
            np.array([*rng.uniform(-1.5, 1.5, 2), rng.uniform(-0.5, 1.5)]),
            from_angles(
                math.copysign(0.5 * math.pi, rng.normal()) + rng.normal(scale=0.03),
                rng.normal(scale=0.03),
                rng.uniform(-3, 3),
            ),
        )
        if 0.01 < tyres.at(place, R)[0][:, DEPTH].max() < 0.3:
            found.append((place, R))
    for place, R in found:
        Q = tyres.at(place, R)[1]
        flat += int((tyres.tables.wheel_memory[:, E_INWARD_NOW] > 0.0).sum())
        for k in range(6):
            way = 1e-6 * np.eye(6)[k]
            up, down = (tyres.at(*moved(place, R, s * way))[0][:, ENERGY].sum() for s in (1.0, -1.0))
            assert Q[k] == pytest.approx((down - up) / 2e-6, rel=1e-4, abs=1e-3 * np.abs(Q).max() + 1.0)
    assert flat > 5


@pytest.mark.parametrize("surface", [Plane(), SURFACES[2]], ids=lambda s: s.kind)
def test_its_dashpot_takes_power_and_never_pulls(surface: Surface) -> None:
    """(Q(0) - Q(v)) . v >= 0: what the rate adds to the forces takes energy, however the tyre lies down."""
    tyres, rng = Tyres(surface, LYING), np.random.default_rng(9)
    for place, R in poses(tyres, surface, 7, 60):
        rates = rng.normal(size=6)
        still, moving = tyres.at(place, R), tyres.at(place, R, rates)
        assert float((still[1] - moving[1]) @ rates) >= -1e-6 * np.abs(still[1]).max()
        assert np.all(moving[0][:, FORCE] >= 0.0)


def lying_wheel(**changes: Any) -> Scenario:
    """One wheel of 100 kg that falls flat on its side from 20 mm."""
    tyre = Tyre(
        radius=0.6, width=0.3, vertical_stiffness=3e5, vertical_damping=0.0, lateral_stiffness=1e5, friction=0.0,
        lying_stiffness=3e5,
    )  # fmt: skip
    vehicle = Vehicle(
        name="wheel",
        whole=MassProperties(mass=100.0, centre_of_mass=(0.0, 0.0, 0.6), inertia=(10.0, 20.0, 10.0)),
        wheels=(Wheel(name="one", centre=(0.0, 0.0, 0.6), tyre=tyre),),
    )
    start = {"kind": "drop", "speed": 0.6, "roll_deg": 90.0, "lead_time": 0.002}
    time = {"duration": 0.5, "step": 0.0005, "output_step": 0.0005}
    return (
        shipped("side_overturn")
        .replaced({"vehicle": vehicle, "initiation": start, "simulation": time})
        .replaced(changes)
    )


@pytest.mark.parametrize("integrator", ["exudyn", "compiled"])
def test_one_that_falls_flat_bounces_as_a_mass_on_a_spring(integrator: str) -> None:
    """In contact z = a (1 - cos w t) + v/w sin w t, w^2 = c/m, a = g/w^2: its deepest point a + sqrt(a^2 + v^2/w^2)."""
    done = run(lying_wheel(**{"simulation.integrator": integrator}))
    w2, g = 3e5 / 100.0, 9.80665
    a = g / w2
    deepest = a + math.sqrt(a * a + 0.36 / w2)
    force = done.recording["wheel/one/force_normal"]
    assert force.max() == pytest.approx(3e5 * deepest, rel=1e-3)
    assert closure(done).largest < 1e-3


def test_its_friction_holds_a_wheel_that_would_roll() -> None:
    """Flat on its side nothing rolls: on a slope of 10 degrees a free wheel stays, as a locked one does."""
    slid = []
    for rolls in (True, False):
        case = lying_wheel(**{
            "vehicle.wheels.one.rolls": rolls, "vehicle.wheels.one.tyre.friction": 0.5,
            "vehicle.wheels.one.tyre.vertical_damping": 3000.0, "initiation.speed": 0.05,
            "ground.surface": {"kind": "slope", "angle_deg": 10.0, "direction_deg": 0.0},
        })  # fmt: skip
        done = run(case.replaced({"initiation.pitch_deg": 0.0, "simulation.duration": 0.6}))
        slid.append(float(np.hypot(done.recording["chassis/velocity_x"], done.recording["chassis/velocity_y"])[-1]))
    # what sways on the stick spring; one that rolled would have g sin 10 deg x 0.6 s = 1 m/s
    assert max(slid) < 0.1
    assert slid[0] == pytest.approx(slid[1], abs=1e-3)


def test_a_ring_softer_than_one_place_of_it_is_refused() -> None:
    with pytest.raises(ValueError, match="lying_stiffness: less than at one place"):
        Tyre(radius=0.5, width=0.3, vertical_stiffness=3e5, lateral_stiffness=2e5, lying_stiffness=2e5)


def test_without_it_nothing_changes() -> None:
    """The same forces, to the last bit, as those of a stiffness too large to matter before a tyre lies down."""
    surface = SURFACES[2]
    rigid, gives = Tyres(surface), Tyres(surface, LYING)
    assert not rigid.tables.wheel_f[:, W_SIDE].any()
    assert gives.tables.wheel_f[:, W_SIDE] * gives.tables.wheel_f[:, W_KY] == pytest.approx(LYING)
    upright = from_angles(0.3, 0.1, 1.0)
    place = np.array([0.0, 0.0, 0.15])
    for a, b in zip(rigid.at(place, upright), gives.at(place, upright), strict=True):
        np.testing.assert_array_equal(a, b)
    assert gives.tables.wheel_f[0, W_HALF] > 0.0 < gives.tables.wheel_f[0, W_KZ]
