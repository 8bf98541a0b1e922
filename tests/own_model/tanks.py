"""Two cascaded tanks: Torricelli and an upper rim as the model lists them, and flows that it does not."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numba import njit

from rollover.recording import Recording
from tests.own_model.recorded import World, drawn_of, multisine, noisy


@njit(cache=True)
def _fill(dt, voltage, p, out):  # type: ignore[no-untyped-def]
    """Levels (n, 2): Euler in 500 parts."""
    k1, k2, k3, k4, rim, leak, lag, clogging, siphon, height, upper, lower = p
    pumped = voltage[0]
    for i in range(voltage.size):
        out[i, 0], out[i, 1] = upper, lower
        h = dt / 500
        open_ = 1.0 - clogging * i / voltage.size
        for _ in range(500):
            pumped = voltage[i] if lag == 0.0 else pumped + h * (voltage[i] - pumped) / lag
            down = open_ * math.sqrt(max(upper, 0.0))
            drawn = siphon * math.sqrt(max(lower - height, 0.0))
            lower += h * (k2 * down - k3 * math.sqrt(max(lower, 0.0)) - drawn)
            upper += h * (k4 * pumped - k1 * down - leak * upper)
            if rim > 0.0 and upper > rim:
                lower += upper - rim
                upper = rim
            upper, lower = max(upper, 0.0), max(lower, 0.0)


ORDER = ("k1", "k2", "k3", "k4", "overflow", "leak", "pump-lag", "clogging", "siphon", "height", "upper", "lower")


def tanks(values: Mapping[str, float], rng: np.random.Generator) -> dict[str, Recording]:
    """Four runs of 2,000 s at 0.5 Hz, the pump about other means, from levels that were read."""
    found = {}
    for k, mean in enumerate((2.0, 3.0, 4.0, 5.0)):
        time, out = np.arange(1000) * 2.0, np.empty((1000, 2))
        voltage = np.maximum(mean + multisine(time, 0.4 * mean, 0.0005, 0.012, rng), 0.0)
        start = {"upper": 0.02 * mean * rng.uniform(0.8, 1.2), "lower": 0.02 * mean * rng.uniform(0.8, 1.2)}
        _fill(2.0, voltage, np.array([{**values, **start}.get(n, 0.0) for n in ORDER]), out)
        stated = {f"initial.{n}": v for n, v in start.items()}
        outputs = {"tank/upper": out[:, 0], "tank/lower": out[:, 1]}
        found[f"r{k + 1}"] = noisy(time, {"pump/voltage": voltage}, outputs, rng, f"Tanks, {mean} V", stated)
    return found


def tanks_world(kind: str, number: int, rng: np.random.Generator) -> World:
    """Time constants of about a minute; a rim that the stronger runs reach."""
    values = {"k1": 0.0115, "k2": 0.0105, "k3": 0.011, "k4": 0.001}
    values = {n: v * rng.uniform(0.85, 1.15) for n, v in values.items()} | {"height": rng.uniform(0.06, 0.1)}
    listed = {
        "overflow": rng.uniform(0.12, 0.2), "leak": rng.uniform(5e-4, 3e-3), "pump-lag": rng.uniform(3.0, 15.0)
    }  # fmt: skip
    unlisted = {"clogging": rng.uniform(0.1, 0.3), "siphon": rng.uniform(0.003, 0.008)}
    truth = drawn_of(kind, number, listed, unlisted)
    values |= {truth: {**listed, **unlisted}[truth]} if truth else {}
    return World(model="cascaded_tanks", kind=kind, truth=truth, values=values, recordings=tanks(values, rng))
