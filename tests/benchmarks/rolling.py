"""Planar calculation of rolling beside the dynamic run: `python -m tests.benchmarks.rolling [VEHICLE ...]`.

Each shipped vehicle on wheels tips over on a slope of 1 : 1.5; it rolls on if its roll passes half a turn. Prints both
verdicts, the roll (deg) at the end, and the ledger (%). Where the calculation does not cover a vehicle it says why: a
ROPS that is folded down lands after the bonnet, which the regulation's order of blows does not know; the run goes on.
"""

from __future__ import annotations

import math
import sys

import numpy as np

from rollover.assessment.ledger import closure
from rollover.assessment.rolled import rolled
from rollover.assessment.standing import scenario_of
from rollover.dynamics.simulate import run
from rollover.scenario import load
from rollover.spec.vehicle import Vehicle
from rollover.system.errors import InputError

SHIPPED = (
    "vineyard_tractor",
    "compact_tractor",
    "compact_tractor_folding",
    "compact_tractor_folded",
    "utility_tractor",
    "utility_tractor_tubes",
    "mf178",
    "row_crop_tractor",
    "large_tractor",
    "light_vehicle",
)


def beside(name: str, **inputs: float) -> tuple[str, str, float, float]:
    """Verdict of the calculation, verdict of the run, its roll at the end (deg) and its ledger (%)."""
    vehicle = scenario_of(name).vehicle
    assert isinstance(vehicle, Vehicle)
    base = load("side_overturn_slope")
    slope = base.replaced({"ground.surface.angle_deg": math.degrees(0.588), "ground.elements.width": 48.0})
    scenario = slope.replaced({"vehicle": vehicle, "simulation.duration": 5.0})
    try:
        planar = rolled(scenario, inputs)[1].verdict
    except InputError as e:
        planar = str(e)
    done = run(scenario)
    roll = np.degrees(np.abs(done.recording["chassis/roll"]))
    verdict = "continuous" if float(roll.max()) > 180.0 else "interrupted"
    return planar, verdict if done.status == "done" else done.sentence, float(roll[-1]), 100.0 * closure(done).largest


def main() -> None:
    """Print the table."""
    print(f"{'vehicle':20} {'calculation':13} {'dynamic run':13} {'roll, deg':>9} {'ledger, %':>9}")
    for name in sys.argv[1:] or SHIPPED:
        planar, dynamic, roll, ledger = beside(name)
        print(f"{name:20} {planar:13} {dynamic:13} {roll:9.0f} {ledger:9.3f}", flush=True)


if __name__ == "__main__":
    main()
