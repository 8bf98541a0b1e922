"""Twins by the command's own means: how often stated 95 % intervals hold a truth that was drawn at random.

python -m tests.benchmarks.coverage [TRUTHS] prints a line for each truth and the count. Drops at 1.5, 2.2, 2.9 and
3.5 m/s are recorded at 1 kHz with noise of half a percent of the range and clocks that are off by 0.3 ms; four
parameters are fitted to all of them at once.
"""

from __future__ import annotations

import math
import sys
import time

import numpy as np

from rollover.calibration.calibrate import calibrate, simulator
from rollover.calibration.objective import parameter
from rollover.comparison.synthesis import synthetic
from rollover.recording import Recording
from rollover.scenario import load

SPEEDS = (1.5, 2.2, 2.9, 3.5)
CHANNELS = ("ground/force_normal", "ground/sinkage", "striker/acceleration_z")
FITS = (
    "ground.law.stiffness_scale=0.3:3",
    "vehicle.mass=90:200",
    "ground.law.momentum_base=0.7:1.1",
    "ground.co_moving_mass.fraction=0.02:0.5",
)


def stated(recording: Recording, channel: str) -> None:
    """All noise is stated in the recordings."""


def main(truths: int) -> None:
    """Draw truths, record, fit, count."""
    base = load("drop_test")
    simulate = simulator(base)
    parameters = [parameter(base, text) for text in FITS]
    hits, count, began = np.zeros(len(FITS), dtype=int), 0, time.perf_counter()
    for seed in range(truths):
        rng = np.random.default_rng(seed)
        truth = {
            "ground.law.stiffness_scale": math.exp(rng.uniform(-0.5, 0.5)),
            "vehicle.mass": rng.uniform(110.0, 160.0),
            "ground.law.momentum_base": rng.uniform(0.82, 0.95),
            "ground.co_moving_mass.fraction": rng.uniform(0.05, 0.3),
        }
        world = base.replaced(truth)
        made = {}
        for k, speed in enumerate(SPEEDS):
            conditions = {"initiation.speed": speed}
            true = simulate(world.replaced(conditions))
            made[f"at {speed}"] = synthetic(
                true,
                channels=CHANNELS,
                rate=1000.0,
                late=float(rng.normal(scale=3e-4)),
                seed=100 * seed + k,
                conditions=conditions,
            )
        found = calibrate(base, made, parameters, noise=stated, seed=seed, starts=2)
        inside = [e.low <= truth[e.path] <= e.high for e in found.estimates]
        hits += inside
        count += len(inside)
        error = max(abs(e.value / truth[e.path] - 1.0) for e in found.estimates)
        print(f"truth {seed}: {sum(inside)} of {len(inside)} inside, largest error {100.0 * error:.2g} %", flush=True)
    wall = time.perf_counter() - began
    print(f"{hits.sum()} of {count} inside ({100.0 * hits.sum() / count:.1f} %), {wall / truths:.1f} s a truth")
    print(dict(zip([p.path for p in parameters], hits.tolist(), strict=True)))


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 20)
