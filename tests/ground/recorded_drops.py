"""Recordings of drops made up from the independent solution, with noise; nothing of `ground` solves the motion."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ground.drops import Drop
from tests.ground.reference_drop import solve

TRUTH = {
    "speed_coefficient": 4.9e-6,
    "speed_exponent": 18.71,
    "first_stiffness": 75_000.0,
    "second_stiffness": 1300.0,
    "sinkage_exponent": -0.736,
    "momentum_base": 0.89,
}
SPEEDS = (1.0, 2.0, 3.0, 3.5)


def recorded(
    seed: int,
    *,
    noise: float = 0.0,
    speeds: Sequence[float] = SPEEDS,
    mass: float = 132.0,
    area_ratio: float = 1.0,
    law_mass: float = 132.0,
    rate: float = 2000.0,
    rest: float = 0.1,
) -> list[Drop]:
    """One drop for each speed: load cell, depth, acceleration; noise as a share of each channel's largest value."""
    rng = np.random.default_rng(seed)
    drops = []
    for speed in speeds:
        s = solve(speed, mass=mass, area_ratio=area_ratio, law_mass=law_mass)
        t = np.arange(0.0, s.t_max + rest, 1.0 / rate)
        falls = t <= s.t_max
        at = np.minimum(t, s.t_max)

        def noisy(y: NDArray[np.float64], t: NDArray[np.float64] = t) -> NDArray[np.float64]:
            return np.asarray(y + noise * np.abs(y).max() * rng.standard_normal(t.size))

        drops.append(
            Drop(
                name=f"{speed:g} m/s",
                time=t,
                mass=mass,
                speed=speed,
                area=area_ratio * 0.140 * 0.045,
                # behind the deepest point it rests: the clay does not rebound
                force=noisy(np.where(falls, s.load_cell(at), mass * 9.81)),
                sinkage=noisy(s.z(at)),
                acceleration=noisy(np.where(falls, s.a(at), 0.0)),
            )
        )
    return drops
