"""Recorded drops for the tests: simulated with something that the scenario leaves out, at other steps, with noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rollover.diagnosis.data.dataset import Signal
from rollover.diagnosis.fit.linearisation import ResidualBlock
from rollover.dynamics.drop_test import DropModel
from rollover.recording import Recording
from rollover.scenario import Scenario
from tests.physics.scenes import shipped

FORCE, DEPTH, ACCELERATION = "ground/force_normal", "ground/sinkage", "striker/acceleration_z"


def scenario() -> Scenario:
    return shipped("drop_test").replaced({"simulation.duration": 0.4})


def recorded(
    changes: Mapping[str, Any],
    seed: int = 0,
    *,
    speeds: Sequence[float] = (1.0, 2.0, 3.5),
    channels: Sequence[str] = (FORCE, DEPTH),
    noise: float = 0.01,
    rate: float = 300.0,
    until: float = 0.35,
) -> list[tuple[str, Recording]]:
    """Drops with `changes`, noise as a share of each channel's range, and a clock that is off by half a millisecond."""
    rng = np.random.default_rng(seed)
    found = []
    for speed in speeds:
        time = np.arange(-0.03, until, 1.0 / rate) + rng.uniform(0.0, 1.0 / rate)
        model = DropModel(scenario=scenario(), step=2e-4).with_({"initiation.speed": speed, **changes})
        run = model.run(time - rng.normal(0.0, 0.5e-3))
        noisy = {c: run[c] + rng.normal(0.0, noise * np.ptp(run[c]), time.size) for c in channels}
        name = f"v{speed}"
        found.append((name, Recording(title=name, time=time, channels=noisy, conditions={"initiation.speed": speed})))
    return found


def linear_blocks(rng: np.random.Generator, count: int, n: int, truth: np.ndarray) -> list[ResidualBlock]:
    """Recordings of a linear model w = J x + s tau + noise of unit size, tau within its prior."""
    blocks = []
    for _ in range(count):
        J, s = rng.standard_normal((n, truth.size)), rng.standard_normal(n)
        tau = rng.normal(0.0, 0.3)
        residual = J @ truth + s * tau + rng.standard_normal(n)
        blocks.append(ResidualBlock(residual=residual, J=J, slope=s, shift=0.0, prior=0.3))
    return blocks


def signal(values: np.ndarray, sigma: float, ar: tuple[float, ...] = ()) -> Signal:
    rows = np.arange(values.size)
    return Signal(channel=FORCE, rows=rows, values=values, sigma=sigma, noise=sigma, ar=ar, span=float(np.ptp(values)))
