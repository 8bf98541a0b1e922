"""Scenarios that the physics tests start from."""

from __future__ import annotations

from pathlib import Path

from ground.array import CoMovingMass, Elements
from ground.friction import Coulomb
from ground.law import GroundLaw
from ground.surface import Plane, Surface
from ground.ye import Ye2006
from rollover.scenario import Ground, Scenario, Simulation, load
from rollover.spec.inertia import MassProperties
from rollover.spec.initiation import Drop, Initiation
from rollover.spec.shapes import Box
from rollover.spec.vehicle import Striker, Vehicle

SHIPPED = Path(__file__).parents[2] / "scenarios"


def shipped(name: str) -> Scenario:
    """A scenario of the folder `scenarios`."""
    return load(SHIPPED / f"{name}.yaml")


def drop(
    speed: float,
    *,
    step: float = 2e-4,
    duration: float = 0.5,
    spacing: tuple[float, float] = (0.140, 0.045),
    fraction: float = 0.1,
    law: GroundLaw | None = None,
    striker: Striker | None = None,
) -> Scenario:
    """The drop rig at first contact; the array covers a little more than the face."""
    return Scenario(
        title="drop",
        vehicle=striker or Striker(),
        ground=Ground(
            elements=Elements(length=0.42, width=0.135, spacing=spacing),
            law=law or Ye2006(),
            co_moving_mass=CoMovingMass(fraction=fraction),
        ),
        initiation=Drop(speed=speed),
        simulation=Simulation(duration=duration, step=step, output_step=step),
    )


def block(
    initiation: Initiation,
    *,
    mass: float = 500.0,
    size: tuple[float, float, float] = (1.0, 0.6, 0.4),
    surface: Surface | None = None,
    mu: float = 0.0,
    spacing: float = 0.05,
    contact_spacing: float = 0.05,
    law: GroundLaw | None = None,
    fraction: float = 0.1,
    duration: float = 1.0,
    step: float = 5e-4,
) -> Scenario:
    """A free rigid block with its lower face at z = 0 of its own axes, over an array of 6 m by 6 m."""
    a, b, c = size
    inertia = (mass * (b * b + c * c) / 12, mass * (a * a + c * c) / 12, mass * (a * a + b * b) / 12)
    return Scenario(
        title="block",
        vehicle=Vehicle(
            name="block",
            whole=MassProperties(mass=mass, centre_of_mass=(0.0, 0.0, c / 2), inertia=inertia),
            outline=(Box(name="block", low=(-a / 2, -b / 2, 0.0), high=(a / 2, b / 2, c)),),
            contact_spacing=contact_spacing,
        ),
        ground=Ground(
            surface=surface or Plane(),
            elements=Elements(length=6.0, width=6.0, spacing=(spacing, spacing)),
            law=law or Ye2006(),
            friction=Coulomb(coefficient=mu),
            co_moving_mass=CoMovingMass(fraction=fraction),
        ),
        initiation=initiation,
        simulation=Simulation(duration=duration, step=step, output_step=step),
    )
