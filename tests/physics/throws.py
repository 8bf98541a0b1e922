"""Random throws of the shipped cube and random overturns: where the energy ledger is to close."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from rollover.scenario import Scenario
from tests.physics.scenes import shipped

WIDE = {"ground.elements.length": 6.3, "ground.elements.width": 6.3}  # what is thrown without friction goes far
FIELD = {"ground.elements.length": 40.0, "ground.elements.width": 40.0}  # 6 m/s for the 4 s of a run, either way


def throw(rng: np.random.Generator) -> Scenario:
    """The cube toss from a start of its own, friction 0 to 1, restitution up to 0.8."""
    x, y, z, w = Rotation.random(random_state=rng).as_quat()
    return shipped("cube_toss").replaced(
        {
            **WIDE,
            "initiation.quaternion": [float(w), float(x), float(y), float(z)],
            "initiation.position": rng.uniform((-0.2, -0.2, 0.1), (0.2, 0.2, 0.3)).tolist(),
            "initiation.velocity": rng.uniform((-1.5, -1.5, -1.5), (1.5, 1.5, 0.5)).tolist(),
            "initiation.angular_velocity": rng.uniform(-15.0, 15.0, 3).tolist(),
            "ground.friction.coefficient": float(rng.uniform(0.0, 1.0)),
            "ground.law.restitution": float(rng.uniform(0.01, 0.8)),
        }
    )


def overturn(rng: np.random.Generator) -> Scenario:
    """A tractor that turns over: on a slope, down a bank or off a ramp; slope, heading and speed by chance."""
    which = int(rng.integers(3))
    changes: dict[str, Any]
    if which == 0:
        changes = {
            **FIELD,
            "ground.surface.angle_deg": float(rng.uniform(5.0, 35.0)),
            "initiation.heading_deg": float(rng.uniform(-15.0, 15.0)),
            "initiation.roll_rate": float(rng.uniform(0.0, 1.0)),
        }
        return shipped("side_overturn_slope").replaced(changes)
    changes = {
        **FIELD,
        "initiation.speed": float(rng.uniform(3.0, 6.0)),
        "initiation.heading_deg": float(rng.uniform(8.0, 16.0)),
    }
    return shipped(("bank_overturn", "field_upset_side")[which - 1]).replaced(changes)
