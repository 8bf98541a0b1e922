"""Entry into water against closed forms, by itself and in the full run; each derivation stands in its test.

Depth z and speed v are positive down; a cone of radius R and height h has the area pi (R z/h)^2 and the volume
V(z) = pi R^2 z^3/(3 h^2) below the surface until it is in, then V = pi R^2 (z - 2h/3).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ground.fluid import FluidEntry, cone_rate
from ground.law import REFERENCE_AREA
from rollover.dynamics.drop_test import DropModel, simulate_drop
from rollover.dynamics.simulate import run
from rollover.scenario import Scenario
from rollover.spec.vehicle import Striker
from tests.physics.scenes import drop, shipped

Array = NDArray[np.float64]
m, v0, g = 0.59, 4.0, 9.81
R, h = 0.026, 0.015
BASE = math.pi * R * R
RATE = "effects.soil-added-mass-growth.rate"
T = np.linspace(0.0, 0.02, 401)


def cone(law: FluidEntry, changes: dict[str, Any] | None = None, **simulation: Any) -> Scenario:
    """A cone that meets a fluid with v0."""
    striker = Striker(mass=m, nose="cone", nose_radius=R, nose_height=h, contact_spacing=0.001)
    scenario = drop(v0, law=law, striker=striker, fraction=0.0, step=5e-5, duration=0.02, spacing=(0.1, 0.1))
    return scenario.replaced({"ground.elements.length": 0.1, "ground.elements.width": 0.1, **(changes or {})})


def nothing() -> FluidEntry:
    """A fluid without drag and weight: whatever acts is the mass that moves along."""
    return FluidEntry(density=1000.0, drag_coefficient=0.0, gravity=0.0)


def volume(z: Array) -> Array:
    """V(z), m3."""
    wet = np.minimum(z, h)
    return np.asarray(BASE * (wet**3 / (3.0 * h * h) + z - wet))


def motion(scenario: Scenario, times: Array = T) -> tuple[Array, Array, Array]:
    """Depth, speed and acceleration of the instruments, positive down."""
    r = DropModel(scenario=scenario).run(times)
    return -r["striker/position_z"], -r["striker/velocity_z"], -r["striker/acceleration_z"]


def test_water_that_moves_along_takes_its_share_of_the_momentum() -> None:
    """d((m + m_a) v)/dt = 0: v = v0 m/(m + m_a), m_a = rate/A_ref V until the cone is in, k rho R^3 from then on."""
    k, rho = 4.0 / 3.0, 1000.0
    rate = cone_rate(math.atan(R / h), density=rho, coefficient=k)
    z, v, a = motion(cone(nothing(), {RATE: rate, "gravity": 0.0}))
    radius = R * np.minimum(z / h, 1.0)
    # a step ends 0.1 um before the cone is in and goes on 0.1 um behind: 4e-5 of m_a, which is 0.04 m
    assert v == pytest.approx(v0 * m / (m + k * rho * radius**3), rel=3e-6)
    assert z[-1] > 4.0 * h
    assert v[-1] == pytest.approx(v0 * m / (m + k * rho * R**3), rel=3e-6)
    assert v[-1] < 0.97 * v0
    inside = (z > 0.2 * h) & (z < 0.95 * h)
    grows = 3.0 * k * rho * R**3 * z**2 / h**3 * v  # dm_a/dt
    assert a[inside] == pytest.approx(-(grows * v / (m + k * rho * radius**3))[inside], rel=1e-4)
    assert np.all(a[z > 1.01 * h] == 0.0)


def test_added_mass_grows_to_a_reach_and_with_depth_on_a_face() -> None:
    rate, reach = 12.0, 0.009
    changes = {RATE: rate, "effects.soil-added-mass-growth.reach": reach, "gravity": 0.0}
    z, v, _ = motion(cone(nothing(), changes))
    held = rate / REFERENCE_AREA * volume(np.minimum(z, reach))
    assert v == pytest.approx(v0 * m / (m + held), rel=3e-6)
    face = cone(nothing(), {RATE: rate, "vehicle.nose": "flat", "gravity": 0.0})
    z, v, _ = motion(face)
    assert v == pytest.approx(v0 * m / (m + rate * z), rel=1e-6)


def test_fading_added_mass_conserves_momentum_in_both_models() -> None:
    """m_a = rate/A_ref (V(h) + A l (1 - exp(-(z - h)/l))) behind the base, and m v is kept as before."""
    rate, fade = 12.0, 0.004
    scenario = cone(nothing(), {RATE: rate, "effects.soil-added-mass-growth.fade": fade, "gravity": 0.0})
    z, v, a = motion(scenario)
    behind = BASE * fade * -np.expm1(-np.maximum(z - h, 0.0) / fade)
    held = rate / REFERENCE_AREA * (volume(np.minimum(z, h)) + behind)
    assert z[-1] > 4.0 * h
    assert v == pytest.approx(v0 * m / (m + held), rel=3e-6)
    late = z > 1.05 * h  # dm_a/dt v on what moves
    grows = rate / REFERENCE_AREA * BASE * np.exp(-(z - h) / fade) * v
    assert a[late] == pytest.approx(-(grows * v / (m + held))[late], rel=1e-4)
    # first order in the step, as without a fade: 0.005 m/s here, where the growth behind the base takes 0.1 m/s
    full = run(scenario).recording
    alone = simulate_drop(scenario, full.time)
    assert full["striker/velocity_z"] == pytest.approx(alone["striker/velocity_z"], abs=0.006)
    assert v[-1] < v0 * m / (m + rate / REFERENCE_AREA * volume(np.array(h))) - 0.09


def test_the_null_of_the_mass_is_drag_and_buoyancy_bit_for_bit() -> None:
    law = FluidEntry(density=1000.0, drag_coefficient=0.7)
    plain, null = simulate_drop(cone(law)), simulate_drop(cone(law, {RATE: 0.0}))
    assert all(plain[name].tobytes() == null[name].tobytes() for name in plain.channels)
    assert not np.array_equal(plain["striker/velocity_z"], simulate_drop(cone(law, {RATE: 5.0}))["striker/velocity_z"])


def test_drag_and_hydrostatic_pressure_on_a_face() -> None:
    """m v dv/dz = m g - rho g A z - c v^2, c = C rho A/2, is linear in u = v^2:

    u = a + b z + (v0^2 - a) e^(-2 c z/m), b = -rho g A/c, a = (m/2c)(2 g - b).
    """
    C, rho, mass = 0.8, 1000.0, 5.0
    A = REFERENCE_AREA
    c = 0.5 * C * rho * A
    b = -rho * g * A / c
    a = mass / (2.0 * c) * (2.0 * g - b)
    law = FluidEntry(density=rho, drag_coefficient=C)
    z, v, _ = motion(drop(v0, law=law, striker=Striker(mass=mass), fraction=0.0), np.linspace(0.0, 0.3, 200))
    assert np.all(v > 0.05)
    assert z[-1] > 0.5
    assert v**2 == pytest.approx(a + b * z + (v0**2 - a) * np.exp(-2.0 * c * z / mass), rel=1e-5, abs=1e-6)


def test_terminal_speed() -> None:
    """Without the pressure of depth m g = 1/2 C rho A v^2; a cone that is in has the area of its base."""
    C, rho = 0.7, 1000.0
    scenario = cone(FluidEntry(density=rho, drag_coefficient=C, gravity=0.0), {"initiation.speed": 1.0})
    _, v, _ = motion(scenario, np.array([0.0, 5.0]))
    assert v[-1] == pytest.approx(math.sqrt(2.0 * m * g / (C * rho * BASE)), rel=1e-6)


def test_buoyancy_is_the_weight_of_the_displaced_volume() -> None:
    """1/2 m v^2 = 1/2 m v0^2 - rho g int V dz; int V = pi R^2 z^4/(12 h^2), then pi R^2 (h^2/12 + ...)."""
    rho = 8000.0  # a heavy fluid, so that it shows within the cone's height
    z, v, _ = motion(
        cone(FluidEntry(density=rho, drag_coefficient=0.0), {"gravity": 0.0, "initiation.speed": 1.0}),
        np.linspace(0.0, 0.03, 200),
    )
    wet, deep = np.minimum(z, h), np.maximum(z - h, 0.0)
    work = rho * g * BASE * (wet**4 / (12.0 * h * h) + h / 3.0 * deep + 0.5 * deep**2)
    assert v**2 == pytest.approx(1.0 - 2.0 * work / m, rel=2e-6)
    assert z.max() > 1.5 * h
    assert v.min() < 0.95


def test_a_sprung_body_rings_with_the_reduced_mass() -> None:
    """A blow takes the nose's speed down by w; body b and nose n + m_b on a spring k, from rest against each other:

    body's deceleration = k w/(omega b) sin(omega t), omega^2 = k (1/(n + m_b) + 1/b), while the spring is compressed.
    """
    k, share, fraction = 7800.0, 0.12, 0.05
    n, b, along = share * m, (1.0 - share) * m, fraction * m
    w = v0 * along / (n + along)
    omega = math.sqrt(k * (1.0 / (n + along) + 1.0 / b))
    changes = {
        "effects.structural-compliance.stiffness": k,
        "effects.structural-compliance.damping": 0.0,
        "effects.structural-compliance.nose_share": share,
        "ground.co_moving_mass.fraction": fraction,
        "gravity": 0.0,
    }
    times = np.linspace(0.0, 0.99 * math.pi / omega, 60)
    _, _, a = motion(cone(nothing(), changes), times)
    exact = -k * w / (omega * b) * np.sin(omega * times)
    assert a == pytest.approx(exact, rel=1e-3, abs=1e-3 * np.abs(exact).max())


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {RATE: 15.0},
        {
            RATE: 15.0,
            "effects.structural-compliance.stiffness": 7800.0,
            "effects.structural-compliance.damping": 2.0,
            "effects.structural-compliance.nose_share": 0.12,
        },
    ],
    ids=["drag and buoyancy", "with its mass", "on a spring"],
)
def test_the_full_run_and_a_drop_by_itself_agree_on_a_cone(changes: dict[str, Any]) -> None:
    """The full run covers a cone by points 1 mm apart and lets its area grow from step to step: first order in both.

    On the spring its peak is 50.9 here and 51.6 with a fifth of the step and half the spacing; the other, 51.9.
    """
    scenario = cone(FluidEntry(density=1000.0, drag_coefficient=0.7), changes)
    full = run(scenario)
    assert full.status == "done", full.sentence
    alone = simulate_drop(scenario, full.recording.time)
    assert alone["striker/velocity_z"] == pytest.approx(full.recording["striker/velocity_z"], abs=3e-3 * v0)
    peak = full.recording["striker/acceleration_z"].max()
    assert alone["striker/acceleration_z"].max() == pytest.approx(peak, rel=0.03)
    assert np.abs(full.recording["energy/residual"]).max() < 1e-3 * full.released


def test_both_agree_on_a_cone_in_soft_ground() -> None:
    scenario = shipped("penetrometer_drop").replaced({"simulation.duration": 0.3})
    full = run(scenario)
    alone = simulate_drop(scenario, full.recording.time)
    assert alone["ground/sinkage"].max() == pytest.approx(full.recording["ground/sinkage"].max(), rel=1e-3)
    error = np.abs(alone["striker/acceleration_z"] - full.recording["striker/acceleration_z"])
    # all but the row in which it turns round, where the acceleration jumps
    assert np.sort(error)[-2] < 0.01 * alone["striker/acceleration_z"].max()


# ---------------------------------------------------------------- a release


def test_a_ball_falls_through_air_as_the_closed_form_says() -> None:
    """m v' = m g - k v^2 from rest: v = V tanh(g t/V), fallen V^2/g ln cosh(g t/V), V^2 = m g/k."""
    area, C, rho, mass, height = 0.03, 0.5, 1.2, 0.1, 47.0
    changes = {
        "effects.air-drag.area": area,
        "effects.air-drag.drag_coefficient": C,
        "effects.air-drag.density": rho,
        "vehicle.mass": mass,
        "initiation.height": height,
        "simulation.duration": 2.0,
    }
    scenario = shipped("ball_drop").replaced(changes)
    V = math.sqrt(2.0 * mass * g / (rho * C * area))
    full = run(scenario).recording
    t = full.time
    fallen, speed = V * V / g * np.log(np.cosh(g * t / V)), V * np.tanh(g * t / V)
    alone = simulate_drop(scenario, t)
    assert alone["striker/position_z"] == pytest.approx(height - fallen, abs=1e-8)
    assert alone["striker/velocity_z"] == pytest.approx(-speed, abs=1e-8)
    assert full["striker/position_z"] == pytest.approx(height - fallen, abs=1e-4)
    assert speed[-1] < 0.75 * g * t[-1]
    assert np.all(full["ground/force_normal"] == 0.0)


def test_a_release_lands_with_the_speed_of_its_height() -> None:
    """At t = (u + sqrt(u^2 + 2 g H))/g, thrown up with u, and with sqrt(u^2 + 2 g H)."""
    H, u = 0.3, 0.5
    speed = math.sqrt(u * u + 2.0 * g * H)
    landing = (u + speed) / g
    released = drop(2.0).replaced({"initiation": {"kind": "release", "height": H, "speed": -u}})
    after = np.linspace(1e-4, 0.25, 200)
    dropped = simulate_drop(drop(speed), after)
    alone = simulate_drop(released, after + landing)
    assert alone["ground/sinkage"] == pytest.approx(dropped["ground/sinkage"], rel=1e-5, abs=1e-8)
    assert alone["ground/impulse_normal"][0] == pytest.approx(13.2 * speed / 1.1, rel=1e-9)
    start = simulate_drop(released, np.array([0.0]))
    assert (start["striker/position_z"][0], start["striker/velocity_z"][0]) == (H, u)
    full = run(released.replaced({"simulation.duration": landing + 0.25})).recording
    alone = simulate_drop(released, full.time)
    # the full run meets the ground within a step
    assert full["striker/position_z"] == pytest.approx(alone["striker/position_z"], abs=1e-3)
    assert full["striker/position_z"][0] == pytest.approx(H, abs=1e-12)


def test_a_release_from_below_the_ground_is_refused() -> None:
    with pytest.raises(ValueError, match=r"initiation.height: out of bounds, got -1"):
        shipped("ball_drop").replaced({"initiation.height": -1.0})
