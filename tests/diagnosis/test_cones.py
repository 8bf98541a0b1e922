"""Cones that enter water by the theory of momentum: the answer never predicts held-out recordings worse than none."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

from rollover.diagnosis import diagnose
from rollover.recording import Clock, Recording
from tests.physics.scenes import shipped

DENSITY, GRAVITY, RADIUS, MASS = 1000.0, 9.81, 0.026, 0.59
TAKEN_ALONG, DRAG = 0.012, 0.5  # kg once the cone is in; 1


def acceleration(speed: float, t: np.ndarray) -> np.ndarray:
    """Of a 45 degree cone, m/s2: (M + m) v' = M g - m' v^2 - rho C pi r^2 v^2/2, with m ~ depth^2 until it is in."""

    def rates(_: float, y: np.ndarray) -> np.ndarray:
        depth, v = y
        wet = float(np.clip(depth / RADIUS, 0.0, 1.0))
        along, growth = TAKEN_ALONG * wet**2, 2.0 * TAKEN_ALONG * wet / RADIUS if wet < 1.0 else 0.0
        drag = 0.5 * DENSITY * DRAG * np.pi * (RADIUS * wet) ** 2
        return np.array([v, (MASS * GRAVITY - (growth + drag) * v * v) / (MASS + along)])

    start = [speed * t[0] + 0.5 * GRAVITY * t[0] ** 2, speed + GRAVITY * t[0]]
    found = solve_ivp(rates, (t[0], t[-1]), start, t_eval=t, max_step=5e-5, rtol=1e-8)
    return np.array([-rates(0.0, y)[1] for y in found.y.T])


def entries() -> list[tuple[str, Recording]]:
    """Six drops from 0.25 to 1.5 m, with a drag of the law that is said to be known within 0.3."""
    rng, t = np.random.default_rng(3), np.arange(-0.0148, 0.0497, 1.0 / 4040.0)
    found = []
    for height in (0.25, 0.5, 0.75, 1.0, 1.25, 1.5):
        speed = float(np.sqrt(2.0 * GRAVITY * height))
        known = {"initiation.speed": speed, "vehicle.mass": MASS, "vehicle.nose": "cone"}
        known |= {"vehicle.nose_radius": RADIUS, "vehicle.nose_height": RADIUS}
        channels = {"striker/acceleration_z": acceleration(speed, t) + rng.normal(0.0, 0.03, t.size)}
        r = Recording(
            title=f"{height} m",
            time=t,
            channels=channels,
            conditions=known,
            clock=Clock(zero="known", within=0.002),
            uncertainty={"ground.law.drag_coefficient": 0.3},
        )
        found.append((f"{height} m", r))
    return found


def test_what_is_named_predicts_better_than_nothing() -> None:
    # the drag that is left out fits few drops and, once the law's own is free, predicts the others worse than without
    found = diagnose(shipped("cone_drop"), entries(), tolerance=0.05)
    assert found.broken == ()
    assert found.effects, found.sentence
    named = {e.id for e in found.effects}.union(*(e.indistinguishable_from for e in found.effects))
    assert "soil-added-mass-growth" in named
    assert found.after["held_out"].nrmse < 0.7 * found.before["held_out"].nrmse
