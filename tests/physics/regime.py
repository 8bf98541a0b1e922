"""Backward or sideways: which way a tractor turns over that rears up while it climbs obliquely, by the slope's angle.

The utility tractor stands on a slope with its rear wheels stuck, its nose at `heading` from across the slope (0) to
straight up it (90), and the clutch is let in, as in the scenario rear_overturn. The axle's torque throws it over
backward; the slope's part across the tractor turns that towards its downhill side, the more the steeper it is.

One published model (tractor with an implement, an obstacle on the slope) finds that backward overturning gives way to
lateral near 25 degrees. Its set-up is known by a line only, so that this is the same question put to another tractor,
not a repetition. Here there is no such change: with stuck wheels it goes over backward on every slope that it can
stand on, by 4 degrees to the side at 35 degrees of slope.

    python -m tests.physics.regime [HEADING_DEG]
"""

from __future__ import annotations

import math
import sys

import numpy as np

from rollover.dynamics.simulate import run
from rollover.scenario import Scenario
from rollover.spec.frames import from_angles
from tests.physics.scenes import shipped

PUBLISHED_DEG = 25.0  # one model, of another tractor
FALLEN = math.radians(75.0)  # inclination against the slope at which the direction is taken


def climbing(slope_deg: float, heading_deg: float = 45.0) -> Scenario:
    """The tractor of rear_overturn, obliquely on a slope; 90 degrees is straight up."""
    return shipped("rear_overturn").replaced(
        {
            "ground.surface": {"kind": "slope", "angle_deg": slope_deg, "direction_deg": 90.0},
            "ground.elements": {"length": 40.0, "width": 40.0, "spacing": [0.1, 0.1]},
            "initiation.heading_deg": heading_deg,
            "simulation.duration": 3.0,
        }
    )


def direction(scenario: Scenario) -> float | None:
    """Direction in which it has fallen, degrees: 0 backward, 90 to either side, 180 forward; None if it stays up."""
    found = run(scenario)
    assert found.status == "done", found.sentence
    rec = found.recording
    angle = math.radians(scenario.ground.surface.angle_deg)  # type: ignore[union-attr]
    normal = np.array([0.0, -math.sin(angle), math.cos(angle)])
    for roll, pitch, yaw in zip(rec["chassis/roll"], rec["chassis/pitch"], rec["chassis/yaw"], strict=True):
        x, y, z = from_angles(float(roll), float(pitch), float(yaw)).T @ normal
        if math.acos(min(z, 1.0)) > FALLEN:
            return math.degrees(math.atan2(abs(y), x))
    return None


def main() -> None:
    """Print a row for each slope, and where the direction passes 45 degrees, if it does."""
    heading = float(sys.argv[1]) if len(sys.argv) > 1 else 45.0
    last: tuple[float, float] | None = None
    print(f"heading {heading:g} deg from across the slope; 0 backward, 90 sideways; published change {PUBLISHED_DEG:g}")
    for slope in np.arange(0.0, 36.0, 5.0).tolist():
        way = direction(climbing(slope, heading))
        print(f"slope {slope:4.0f} deg  {'does not overturn' if way is None else f'{way:5.1f} deg'}", flush=True)
        if way is None:
            continue
        if last is not None and (last[1] - 45.0) * (way - 45.0) < 0.0:
            change = last[0] + (45.0 - last[1]) / (way - last[1]) * (slope - last[0])
            print(f"  backward and sideways change at {change:.0f} deg")
        last = slope, way
    if last is not None and last[1] < 45.0:
        print("backward on all of them")


if __name__ == "__main__":
    main()
