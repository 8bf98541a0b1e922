"""Cones on water: what the water's mass and a spring in the body explain (Boom, Truscott, Fish, Habtour, 2024).

    python -m tests.real.cone_drops $ROLLOVER_DATA/cone_drops [--repeats 6] [--json]

The scenario `cone_drop` knows drag and buoyancy only. Each set of numbers is fitted to one repeat of three heights and
judged on the other three heights: rigid cones without and with `soil-added-mass-growth`, then cones on a spring
without and with `structural-compliance`, in the water of the rigid ones and in water of their own: what rings has
water at its nose for longer than a rigid cone's blow lasts, and says more of where its growth ends.

The clock of the recordings starts "about" at the impact, so that every comparison, good or bad, is free to shift it.
The error is the root mean square over the range of the recording, from 2 ms before the stated impact to 50 ms behind
it, without clipped rows.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from ground.fluid import cone_rate
from rollover.dynamics.drop_test import DropModel
from rollover.recording import Recording
from rollover.recording.importers import COLLECTIONS
from rollover.recording.importers.cone_drops import BODY, CLIPS, RADIUS, G
from rollover.scenario import load

Array = NDArray[np.float64]
CHANNEL = "striker/acceleration_z"
TIMES = np.arange(-0.008, 0.0555, 1e-4)  # s, of the simulation
SHIFTS = np.arange(-0.004, 0.004, 2.5e-5)  # s, of the clock
TRAINING, HELD_OUT = (25, 75, 125), (50, 100, 150)  # cm
DRAG = "ground.law.drag_coefficient"
RATE, FADE = (f"effects.soil-added-mass-growth.{n}" for n in ("rate", "fade"))
STIFFNESS, DAMPING, SHARE = (f"effects.structural-compliance.{n}" for n in ("stiffness", "damping", "nose_share"))
SPRING = 7800.0  # N/m, by the authors


@dataclass(frozen=True, kw_only=True)
class Drop:
    """One recording, cut to what is compared, and the scenario that repeats it."""

    name: str
    height: int  # cm
    time: Array
    measured: Array  # m/s2, coordinate acceleration of the body
    model: DropModel

    def residual(self, changes: Mapping[str, float]) -> Array:
        """(simulated - measured)/range at the shift of the clock that fits best."""
        return aligned(TIMES, self.model.with_(changes).run(TIMES)[CHANNEL], self.time, self.measured)

    def error(self, changes: Mapping[str, float]) -> float:
        """Root mean square of the residual."""
        return rms(self.residual(changes))


def rms(x: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(x**2)))


def aligned(t: Array, y: Array, time: Array, measured: Array) -> Array:
    """(y - measured)/range with y shifted along t by the one of `SHIFTS` that fits best."""
    off = np.interp(time[None] - SHIFTS[:, None], t, y) - measured
    return np.asarray(off[np.argmin(np.sum(off**2, axis=1))] / np.ptp(measured))


def drops(folder: Path, series: str, repeats: int = 6) -> list[Drop]:
    """Drops of a series, such as SR60 (rigid, 60 deg) or SF80 (on a spring), all heights."""
    pattern = [f"{series}*{k}" for k in range(1, repeats + 1)]
    return [_cut(name, recording) for name, recording in COLLECTIONS["cone-drops"].read(folder, pattern)]


def _cut(name: str, recording: Recording) -> Drop:
    a = recording[CHANNEL]
    rows = (recording.time > -0.002) & (recording.time < 0.050) & (a < 0.97 * CLIPS * G)
    scenario = load("cone_drop").replaced(recording.conditions)
    model = DropModel(scenario=scenario)
    return Drop(name=name, height=int(name[4:7]), time=recording.time[rows], measured=a[rows], model=model)


def fit(training: Sequence[Drop], start: Mapping[str, float], fixed: Mapping[str, float]) -> dict[str, float]:
    """Least squares over the drops at once; `start` names what is free."""
    first = np.array(list(start.values()))

    def residual(x: Array) -> Array:
        changes = {**fixed, **dict(zip(start, first * x, strict=True))}
        return np.concatenate([drop.residual(changes) for drop in training])

    # a shift of the clock comes in steps: differences wide enough to look beyond one
    done = least_squares(residual, np.ones(len(first)), bounds=(0.02, 20.0), diff_step=0.03, xtol=1e-4, ftol=1e-4)
    return {**fixed, **dict(zip(start, (first * done.x).tolist(), strict=True))}


def by_height(found: Sequence[Drop], changes: Mapping[str, float]) -> dict[int, float]:
    """Mean error of the repeats of each height."""
    heights = sorted({drop.height for drop in found})
    return {h: float(np.mean([drop.error(changes) for drop in found if drop.height == h])) for h in heights}


def repeatability(found: Sequence[Drop]) -> dict[int, float]:
    """Mean error of one repeat as a prediction of the next: what no model can beat by much."""
    errors: dict[int, list[float]] = {}
    for a, b in pairwise(found):
        if a.height == b.height:
            inside = (b.time > a.time[0] + 0.002) & (b.time < a.time[-1] - 0.002)
            errors.setdefault(a.height, []).append(rms(aligned(a.time, a.measured, b.time[inside], b.measured[inside])))
    return {h: float(np.mean(e)) for h, e in errors.items()}


def share_of_cube(water: Mapping[str, float], half: float) -> float:
    """k of k rho r^3, the mass that moves along once its growth has ended; `half` angle of the cone in rad."""
    height = RADIUS / math.tan(half)
    return water[RATE] / cone_rate(half, coefficient=1.0) * (1.0 + 3.0 * water[FADE] / height)


def rigid(folder: Path, angle: int, repeats: int = 6) -> dict[str, Any]:
    """Rigid cones: drag and buoyancy alone against the same with the mass of the water."""
    found, half = drops(folder, f"SR{angle}", repeats), math.radians(angle)
    training = [d for d in _one_each(found) if d.height in TRAINING]
    without = fit(training, {DRAG: 0.7}, {})
    with_mass = fit(training, {DRAG: 0.7, RATE: cone_rate(half), FADE: 0.001}, {})
    return {
        "without": {"numbers": without, "error": by_height(found, without)},
        "with": {"numbers": with_mass, "error": by_height(found, with_mass), "k": share_of_cube(with_mass, half)},
        "repeat": {"error": repeatability(found)},
    }


def sprung(folder: Path, angle: int, water: Mapping[str, float], repeats: int = 6) -> dict[str, Any]:
    """Cones on a spring: rigid, on the authors' spring, on one that is fitted, and with water of their own.

    `water` holds drag and growing mass of the rigid ones.
    """
    found = drops(folder, f"SF{angle}", repeats)
    training = [d for d in _one_each(found) if d.height in TRAINING]
    share = {SHARE: 1.0 - BODY / found[0].model.scenario.vehicle.mass}
    spring = {DAMPING: 2.0, STIFFNESS: SPRING}
    stated = fit(training, {DAMPING: 2.0}, {**water, **share, STIFFNESS: SPRING})
    fitted = fit(training, spring, {**water, **share})
    own = fit(training, {**spring, **water}, share)
    return {
        "rigid": {"numbers": dict(water), "error": by_height(found, water)},
        "stated": {"numbers": stated, "error": by_height(found, stated)},
        "fitted": {"numbers": fitted, "error": by_height(found, fitted)},
        "own": {"numbers": own, "error": by_height(found, own), "k": share_of_cube(own, math.radians(angle))},
        "repeat": {"error": repeatability(found)},
    }


def _one_each(found: Sequence[Drop]) -> list[Drop]:
    return list({drop.height: drop for drop in reversed(found)}.values())


def main() -> None:
    """Print the study."""
    parser = argparse.ArgumentParser(description="Cones on water, simulated and measured.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--repeats", type=int, default=6)
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    answer = {}
    for angle in (60, 80):
        answer[f"rigid {angle} deg"] = found = rigid(given.folder, angle, given.repeats)
        answer[f"sprung {angle} deg"] = sprung(given.folder, angle, found["with"]["numbers"], given.repeats)
    if given.json:
        print(json.dumps(answer, indent=2))
        return
    print("errors in % of the range, at", ", ".join(f"{h} cm" for h in sorted((*TRAINING, *HELD_OUT))))
    print("fitted to one drop each of", *TRAINING, "cm; all the rest was left out")
    for name, part in answer.items():
        print(name)
        for which, value in part.items():
            numbers = [f"{k.split('.')[-1]} {v:.4g}" for k, v in value.get("numbers", {}).items()]
            numbers += [f"m_a = {value['k']:.2f} rho r^3"] if "k" in value else []
            print(f"  {which:8s}", *(f"{100 * e:5.1f}" for e in value["error"].values()), "  " + ", ".join(numbers))


if __name__ == "__main__":
    main()
