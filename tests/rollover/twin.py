"""A drop on Ye's ground in forty lines, for tests that need many runs: quick, and no part of the project's solver.

(m + m_b) z'' = m g - F(z), z(0) = 0, z'(0) = v m/(m + m_b) with m_b = y m (collision without restitution), F from
eqs (3)-(5) until the turn, then down a straight line of which a share `recovery` of the depth comes back.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rollover.recording import Recording
from rollover.scenario import Scenario, load

STEP, DURATION = 2.5e-4, 0.25


def drop(scenario: Scenario) -> Recording:
    """Simulate a drop test from 0.01 s before contact."""
    law, m, v = scenario.ground.law, scenario.vehicle.mass, scenario.initiation.speed
    g, y, scale = scenario.gravity, scenario.ground.co_moving_mass.fraction, law.stiffness_scale
    k1 = scale * (law.speed_coefficient * v**law.speed_exponent + law.first_stiffness)
    n = 1.0 + law.sinkage_exponent
    c2 = scale * law.second_stiffness * 1e3 ** (1.0 + law.sinkage_exponent) * law.momentum_base ** (1.32 * v)
    depth, speed, deepest, top = 0.0, v / (1.0 + y), 0.0, 0.0
    lead = round(0.01 / STEP)
    count = round(DURATION / STEP)
    rows = np.zeros((count + lead, 3))
    for k in range(lead):
        time = (k - lead) * STEP
        rows[k] = 0.0, -(-v * time + 0.5 * g * time**2) * 0.0, -g
    for k in range(lead, count + lead):
        if depth >= deepest:
            force = min(k1 * depth, c2 * depth**n) if depth > 0.0 else 0.0
            deepest, top = depth, force
        else:
            force = max(0.0, top * (1.0 - (deepest - depth) / (law.recovery * deepest)))
        fall = (m * g - force) / (m * (1.0 + y))
        rows[k] = force, depth, -fall
        speed += STEP * fall
        depth += STEP * speed
    time = (np.arange(count + lead) - lead) * STEP
    names = ("ground/force_normal", "ground/sinkage", "striker/acceleration_z")
    return Recording(title="drop", time=time, channels=dict(zip(names, rows.T.copy(), strict=True)))


NOISE = {"ground/force_normal": 30.0, "ground/sinkage": 1e-3, "striker/acceleration_z": 0.5}


def scene(changes: Mapping[str, float] | None = None) -> Scenario:
    """The shipped drop test with a soil that gives a tenth back."""
    return load("drop_test").replaced({"ground.law.recovery": 0.1, **(changes or {})})


def recorded(
    scenario: Scenario,
    conditions: Mapping[str, float],
    rng: np.random.Generator,
    *,
    channels: tuple[str, ...] = tuple(NOISE),
    every: int = 4,
    until: float = DURATION,
    late: float = 0.0,
) -> Recording:
    """What instruments with white noise record of a drop under some conditions; `late` s by their clock."""
    true = drop(scenario.replaced(conditions))
    keep = np.flatnonzero(true.time < until)[::every]
    found = {c: true[c][keep] + rng.normal(scale=NOISE[c], size=keep.size) for c in channels}
    return Recording(
        title="twin",
        time=true.time[keep] + late,
        channels=found,
        conditions=dict(conditions),
        noise={c: NOISE[c] for c in channels},
    )
