"""Balls from a bridge: what the air explains, for light balls and heavy ones (de Silva, Higdon, Brunton, Kutz, 2020).

    python -m tests.real.falling_balls $ROLLOVER_DATA/falling_balls [--json]

The scenario `ball_drop` has no air. For each ball the drag area C_d A of `air-drag` is fitted to one drop and judged on
the other, both ways round. Height and instant of the release were not measured: both are free in every comparison,
without air as with it.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from rollover.dynamics.drop_test import DropModel
from rollover.recording import Recording
from rollover.recording.importers import COLLECTIONS
from rollover.scenario import load

Array = NDArray[np.float64]
CHANNEL = "striker/position_z"
LEAST_AREA = 1e-9  # m2


@dataclass(frozen=True, kw_only=True)
class Drop:
    """One recording and the scenario that repeats it."""

    name: str
    time: Array
    height: Array
    model: DropModel
    radius: float | None

    def residual(self, area: float, late: float, off: float) -> Array:
        """Simulated less measured height, m; released `late` s after the first row, `off` m above its height."""
        start = self.model.scenario.initiation.height  # type: ignore[union-attr]
        changes: dict[str, float] = {"initiation.height": start + off}
        if area > 0.0:
            changes |= {"effects.air-drag.area": area, "effects.air-drag.drag_coefficient": 1.0}
        times = self.time - late
        rows = times > 0.0
        simulated = np.full(times.size, start + off)
        simulated[rows] = self.model.with_(changes).run(times[rows])[CHANNEL]
        return np.asarray(simulated - self.height)

    def error(self, area: float) -> float:
        """Root mean square height error, m, at the best release for this drag area (C_d A, m2; 0: no air)."""
        done = least_squares(lambda x: self.residual(area, *x), (0.0, 0.0), x_scale=(0.1, 0.3), diff_step=1e-3)
        return float(np.sqrt(np.mean(done.fun**2)))

    def fitted(self) -> tuple[float, float]:
        """C_d A and its standard deviation, m2, from this drop."""
        start = (math.log(0.01), 0.0, 0.0)
        done = least_squares(
            lambda x: self.residual(math.exp(x[0]), x[1], x[2]),
            start,
            bounds=((math.log(LEAST_AREA), -1.0, -3.0), (0.0, 1.0, 3.0)),
            x_scale=(1.0, 0.1, 0.3),
            diff_step=1e-3,
        )
        variance = float(done.fun @ done.fun) / (done.fun.size - 3)
        area = math.exp(done.x[0])
        sd = math.sqrt(variance * np.linalg.inv(done.jac.T @ done.jac)[0, 0])
        return area, area * sd


def drops(folder: Path, select: Sequence[str] = ("*",)) -> dict[str, list[Drop]]:
    """Both drops of each ball, by the ball's name."""
    found: dict[str, list[Drop]] = {}
    for name, recording in COLLECTIONS["falling-balls"].read(folder, select):
        found.setdefault(name.rpartition("-")[0], []).append(_drop(name, recording))
    return found


def _drop(name: str, recording: Recording) -> Drop:
    model = DropModel(scenario=load("ball_drop").replaced(recording.conditions), step=2e-3)
    radius = [float(note.split()[1]) for note in recording.notes if note.startswith("radius")]
    return Drop(
        name=name,
        time=recording.time,
        height=recording[CHANNEL],
        model=model,
        radius=radius[0] if radius else None,
    )


def study(folder: Path, select: Sequence[str] = ("*",)) -> dict[str, dict[str, Any]]:
    """For each ball: C_d A of both drops, errors without air and with that of the other drop."""
    answer: dict[str, dict[str, Any]] = {}
    for ball, pair in drops(folder, select).items():
        areas = [drop.fitted() for drop in pair]
        radius = pair[0].radius
        mean = float(np.mean([area for area, _ in areas]))
        answer[ball] = {
            "mass": pair[0].model.scenario.vehicle.mass,  # type: ignore[union-attr]
            "drag_area": [{"value": area, "sd": sd} for area, sd in areas],
            "drag_coefficient": None if radius is None else mean / (math.pi * radius**2),
            "without": [drop.error(0.0) for drop in pair],
            "held_out": [pair[0].error(areas[1][0]), pair[1].error(areas[0][0])],
        }
    return answer


def main() -> None:
    """Print the study."""
    parser = argparse.ArgumentParser(description="Balls from a bridge, simulated and measured.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    answer = study(given.folder)
    if given.json:
        print(json.dumps(answer, indent=2))
        return
    print(f"{'ball':22s} {'kg':>6s} {'C_d A, cm2 (two drops)':>27s} {'C_d':>5s} {'no air, m':>12s} {'air, m':>12s}")
    for ball, a in answer.items():
        areas = ", ".join(f"{1e4 * x['value']:.0f} +- {1e4 * x['sd']:.0f}" for x in a["drag_area"])
        c = "" if a["drag_coefficient"] is None else f"{a['drag_coefficient']:.2f}"
        without, held = (" ".join(f"{e:.2f}" for e in a[k]) for k in ("without", "held_out"))
        print(f"{ball:22s} {a['mass']:6.3f} {areas:>27s} {c:>5s} {without:>12s} {held:>12s}")


if __name__ == "__main__":
    main()
