"""Tyres on uneven ground: one energy for each pose, the force its exact gradient, and the plane's law on a plane."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ground.surface import Bank, Heightmap, Kerb, Ramp, Slope, Sum, Surface
from rollover.dynamics.assembly import tables_of
from rollover.dynamics.bodies import bodies_of
from rollover.kernels.forces import read_poses
from rollover.kernels.tables import E_DAMPING_NOW, E_DEPTH_NOW, E_ENERGY_NOW, E_FORCE_NOW, W_BOTTOM, W_C, W_KZ, handle
from rollover.kernels.tyres import try_wheels
from rollover.spec.frames import from_angles, matrices, rotation_vector
from tests.physics.scenes import shipped

Array = NDArray[np.float64]
BUMPY = Heightmap(
    heights=tuple(tuple(0.08 * math.sin(1.7 * i) * math.cos(1.1 * j) for j in range(40)) for i in range(40)),
    spacing=(0.3, 0.3),
    corner=(-6.0, -6.0),
)
SURFACES: list[Surface] = [
    Bank(height=2.0, angle_deg=50.0, edge=(0.0, 0.3)),
    Kerb(height=0.25, face_deg=60.0, foot=(0.0, 0.2), direction_deg=80.0),
    BUMPY,
    Sum(parts=(Slope(angle_deg=25.0, direction_deg=40.0), Ramp(length=1.5, height=0.457, width=0.6, top=1.0))),
]


class Tyres:
    """The utility tractor's tyres without friction, held in a pose on a surface."""

    def __init__(self, surface: Surface, lying: float | None = None) -> None:
        changes: dict[str, Any] = {"ground.surface": surface, "initiation": {"kind": "driving", "speed": 0.0}}
        for wheel in ("front_left", "front_right", "rear_left", "rear_right"):
            changes[f"vehicle.wheels.{wheel}.tyre.friction"] = 0.0
            changes[f"vehicle.wheels.{wheel}.tyre.lying_stiffness"] = lying
        scenario = shipped("side_overturn").replaced(changes)
        self.scenario = scenario
        self.bodies = bodies_of(scenario.vehicle, scenario.ground.elements)
        self.tables = tables_of(scenario, self.bodies)
        self.handle = handle(self.tables)

    def at(self, place: Array, R: Array, rates: Array | None = None) -> tuple[Array, Array]:
        """Energy, depth, force and dashpot's part of each tyre (4, 4), and the resultant (6,); all bodies as one.

        `rates` are velocity of the vehicle's origin (world) and angular velocity (body axes).
        """
        q, qd = np.zeros((len(self.bodies), 6)), np.zeros((len(self.bodies), 6))
        for b, body in enumerate(self.bodies):
            q[b, :3] = place + R @ body.centre
            q[b, 3:] = rotation_vector(R)
            if rates is not None:
                qd[b, :3] = rates[:3] + R @ np.cross(rates[3:], body.centre)
                qd[b, 3:] = rates[3:]
        read_poses(self.tables.pose, q.ravel(), qd.ravel())
        Q = np.zeros(6 * len(self.bodies))
        try_wheels(self.handle, Q)
        columns = [E_ENERGY_NOW, E_DEPTH_NOW, E_FORCE_NOW, E_DAMPING_NOW]
        return self.tables.wheel_memory[:, columns].copy(), self.together(Q, R)

    def together(self, Q: Array, R: Array) -> Array:
        """Force (world) and moment about the vehicle's origin (body axes) of all bodies' generalised forces, (6,)."""
        total = np.zeros(6)
        for b, body in enumerate(self.bodies):
            force, moment = Q[6 * b : 6 * b + 3], Q[6 * b + 3 : 6 * b + 6]
            total[:3] += force
            total[3:] += moment + np.cross(body.centre, R.T @ force)
        return total


ENERGY, DEPTH, FORCE, DAMPING = 0, 1, 2, 3


def moved(place: Array, R: Array, way: Array) -> tuple[Array, Array]:
    return place + way[:3], R @ matrices(way[3:][None])[0]


def poses(tyres: Tyres, surface: Surface, seed: int, number: int) -> list[tuple[Array, Array]]:
    """Poses with the tyres some way into the ground, upright to far beyond their side, all over what is uneven."""
    rng, found = np.random.default_rng(seed), []
    while len(found) < number:
        R = from_angles(*np.radians(rng.uniform((-110, -30, -180), (110, 30, 180))))
        place = np.array([*rng.uniform(-1.5, 1.5, 2), rng.uniform(-1.5, 1.5)])
        deep = tyres.at(place, R)[0][:, DEPTH].max()
        if 0.01 < deep < 0.3:
            found.append((place, R))
    return found


@pytest.mark.parametrize("surface", SURFACES, ids=lambda s: s.kind)
def test_the_force_is_the_gradient_of_the_energy(surface: Surface) -> None:
    """Q = -dU/dx by central differences over 1 um, at 100 poses of any camber."""
    tyres = Tyres(surface)
    for place, R in poses(tyres, surface, 5, 100):
        Q = tyres.at(place, R)[1]
        for k in range(6):
            way = 1e-6 * np.eye(6)[k]
            up, down = (tyres.at(*moved(place, R, s * way))[0][:, ENERGY].sum() for s in (1.0, -1.0))
            assert Q[k] == pytest.approx((down - up) / 2e-6, rel=1e-4, abs=1e-3 * np.abs(Q).max() + 1.0)


@pytest.mark.parametrize("surface", SURFACES, ids=lambda s: s.kind)
def test_the_dashpot_takes_what_it_is_booked_for(surface: Surface) -> None:
    """P = sum of dashpot force times the depth's rate (by differences) = (Q(0) - Q(v)) . v; the force is c k/k_z rate.

    k = 2 U/d^2 where the rim is not reached; no tyre pulls.
    """
    tyres, rng, compared = Tyres(surface), np.random.default_rng(6), 0
    for place, R in poses(tyres, surface, 7, 40):
        rates = rng.normal(size=6)
        still, moving = tyres.at(place, R), tyres.at(place, R, rates)
        ahead, behind = (tyres.at(*moved(place, R, s * 1e-6 * rates))[0][:, DEPTH] for s in (1.0, -1.0))
        rate = (ahead - behind) / 2e-6
        power = float(moving[0][:, DAMPING] @ rate)
        assert float((still[1] - moving[1]) @ rates) == pytest.approx(power, rel=1e-4, abs=1e-2)
        for w, c in enumerate(tyres.tables.wheel_f):
            energy, depth, _, damping = moving[0][w]
            if 0.0 < depth < c[W_BOTTOM] and damping > -1.99 * energy / depth:
                assert damping == pytest.approx(c[W_C] * 2.0 * energy / depth**2 / c[W_KZ] * rate[w], rel=1e-4, abs=0.1)
                compared += 1
    assert compared > 30


@pytest.mark.parametrize("degrees", [0.0, 20.0, -35.0])
def test_on_a_plane_it_is_the_plane_s_law(degrees: float) -> None:
    """Depth within 3 mm: the rounding between slices, and the lowest point that lies between two of them."""
    far = Bank(height=1.0, angle_deg=10.0, edge=(0.0, 50.0))
    slope = Slope(angle_deg=degrees, direction_deg=60.0)
    flat, uneven = Tyres(slope), Tyres(Sum(parts=(slope, far)))
    rng, compared = np.random.default_rng(8), 0
    for _ in range(300):
        R = from_angles(*np.radians(rng.uniform((-80, -30, -180), (80, 30, 180))))
        place = np.array([*rng.uniform(-1.0, 1.0, 2), rng.uniform(-1.0, 1.5)])
        a, b = flat.at(place, R)[0], uneven.at(place, R)[0]
        for w in np.flatnonzero((a[:, DEPTH] > 0.02) & (a[:, DEPTH] < 0.15)).tolist():
            assert b[w, DEPTH] == pytest.approx(a[w, DEPTH], abs=0.003)
            compared += 1
    assert compared > 40


def test_a_tyre_against_a_kerb_gives_back_its_energy() -> None:
    """Turned through the face's own slope with its side to it: the work of the force is the change of its energy."""
    tyres = Tyres(SURFACES[1])
    angle = np.radians(np.linspace(0.0, -88.0, 4001))
    turn = matrices(np.outer(angle, (1.0, 0.0, 0.0)))
    energy, moment = np.zeros(len(angle)), np.zeros(len(angle))
    for k, R in enumerate(turn):
        found, Q = tyres.at(np.array([-1.0, -0.75, 0.1]), R)
        energy[k], moment[k] = found[:, ENERGY].sum(), Q[3]
    work = np.concatenate([[0.0], np.cumsum(-0.5 * (moment[1:] + moment[:-1]) * np.diff(angle))])
    assert np.ptp(energy) > 1000.0
    np.testing.assert_allclose(energy - energy[0], work, atol=2e-3 * np.ptp(energy))


def test_a_step_is_climbed_over_its_edge() -> None:
    """Upright before a kerb: it touches when the corner is R from the hub; the push is at right angles to the chord.

    The chord leads from where the face leaves the tread's circle to where the kerb's top does. Within 15 %, on the
    mean over 8 places, as the tread is sampled every 19 mm.
    """
    radius, height, rise = 0.45, 0.2, math.tan(math.radians(75.0))
    tyres = Tyres(Kerb(height=height, face_deg=75.0, foot=(0.0, 0.0), direction_deg=0.0))
    wheels = tyres.scenario.vehicle.wheels  # type: ignore[union-attr]
    assert wheels[0].name == "front_left"
    z = radius + 0.005
    reach = math.sqrt(radius**2 - (z - height) ** 2)

    def at(beyond: float) -> tuple[float, Array, float]:
        """Depth, push of all tyres, and the chord's inclination, with the hub so far beyond the first touch."""
        x = height / rise - reach + beyond
        found, push = tyres.at(np.array([x, 0.0, z]) - wheels[0].centre, np.eye(3))
        a, b, c = 1.0 + rise**2, -2.0 * (x + rise * z), x**2 + z**2 - radius**2
        enters = (-b - math.sqrt(max(b * b - 4.0 * a * c, 0.0))) / (2.0 * a)
        return found[0, DEPTH], push, (height - rise * enters) / (x + reach - enters)

    assert at(-0.02)[0] < 0.0 < at(0.02)[0]
    ratios = []
    for beyond in np.linspace(0.05, 0.2, 8).tolist():
        _, push, chord = at(beyond)
        ratios.append(push[0] / push[2] / -chord)
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.15)
