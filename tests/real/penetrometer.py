"""Laws of a real sea bed from the drops of a free-fall penetrometer (University of Florida Coastal Geotechnics).

    python -m tests.real.penetrometer $ROLLOVER_DATA/soil_penetrometer

Prints which drops are usable, how well each form of law fits and predicts a drop that was left out, and the numbers;
then each drop as the simulator runs it, on a law identified from the others.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ground.drops import loading
from ground.penetration import FORMS, Fitted, chosen, fit_form, fit_forms, numbers_of
from rollover.calibration.ground_law import drops_of
from rollover.dynamics.drop_test import DropModel
from rollover.recording import Recording
from rollover.recording.importers import COLLECTIONS
from rollover.scenario import load

BUOYANCY = 2.473e-3 * 1025.0 * 9.81  # N, 2.473 l in sea water
SEA_WATER = 1025.0  # kg/m3
CHANNEL = "striker/acceleration_z"


def recordings(folder: Path) -> dict[str, Recording]:
    """What the importer makes of each file, by its name."""
    return dict(COLLECTIONS["soil-penetrometer"].read(folder, ["*"]))


def study(folder: Path) -> tuple[list[str], dict[str, Fitted]]:
    """What was refused, and every form fitted to the others."""
    scenario = load("penetrometer_drop").replaced({"gravity": 9.81})
    drops, refused = drops_of(recordings(folder), scenario, buoyancy=BUOYANCY, terminal=True)
    return refused, fit_forms(drops)


@dataclass(frozen=True, kw_only=True)
class Simulated:
    """One drop against the simulator, on the stand-in soil of the scenario and on a law from the other drops."""

    name: str
    error: float  # root mean square of the acceleration over its range, first contact to 0.1 s after the stop
    stand_in: float  # the same on the scenario's own soil
    depth: tuple[float, float]  # m, deepest: double integral of the recording, simulated
    peak: tuple[float, float]  # m/s2, largest deceleration: recorded, simulated


def held_out(folder: Path) -> list[Simulated]:
    """Each usable drop run in `penetrometer_drop` on a law identified from the others."""
    scenario, found = load("penetrometer_drop"), recordings(folder)
    usable, _ = drops_of(found, scenario.replaced({"gravity": 9.81}), buoyancy=BUOYANCY, terminal=True)
    answer = []
    for drop in usable:
        others = [other for other in usable if other is not drop]
        form = FORMS["bearing-rate"]
        value, *_ = fit_form(form, others)
        soil = numbers_of(form, value)
        recording = found[drop.name]
        stop = loading(drop, 0.0)
        rows = (recording.time >= 0.0) & (recording.time <= stop.duration + 0.1)
        time, measured = recording.time[rows], recording[CHANNEL][rows]
        # the water's drag is that of the fall before; the scenario's gravity is what the buoyancy leaves
        water = {
            "effects.air-drag.area": 2.0 * drop.drag / SEA_WATER,
            "effects.air-drag.density": SEA_WATER,
            "gravity": 9.81 - BUOYANCY / drop.mass,
        }
        model = DropModel(scenario=scenario.replaced({**recording.conditions, **water}))
        ours = model.with_({f"ground.law.{name}": number for name, number in soil.items()}).run(time)
        errors = [
            float(np.sqrt(np.mean((run[CHANNEL] - measured) ** 2)) / np.ptp(measured))
            for run in (ours, model.run(time))
        ]
        answer.append(
            Simulated(
                name=drop.name,
                error=errors[0],
                stand_in=errors[1],
                depth=(stop.deepest, float(ours["ground/sinkage"].max())),
                peak=(float(measured.max()), float(ours[CHANNEL].max())),
            )
        )
    return answer


def main() -> None:
    """Print the study."""
    refused, forms = study(Path(sys.argv[1]))
    print(*(f"left out: {reason}" for reason in refused), sep="\n")
    best = chosen(forms)
    for name, fit in forms.items():
        mark = "*" if fit is best else " "
        print(
            f"{mark} {name:16s} fit {100 * fit.residual:4.1f} % of the largest force, scatter of ln F "
            f"{fit.log_scatter:.2f} ({fit.between_drops:.2f} between drops), held-out deceleration "
            f"{100 * fit.deceleration_error:.0f} %, depth {100 * fit.depth_error:.0f} %"
        )
    for name, value, low, high in zip(best.form.names, best.value, best.low, best.high, strict=True):
        print(f"  {name} = {value:.3g} ({low:.3g} to {high:.3g}){' kPa' if name.endswith('pressure') else ''}")
    for drop in best.held_out:
        print(
            f"  {drop.name}: {drop.deceleration[0]:.1f} m/s2 recorded, {drop.deceleration[1]:.1f} predicted; "
            f"{drop.depth[0]:.3f} m, {drop.depth[1]:.3f} m"
        )
    print("in the simulator, on a law from the other two drops:")
    for run in held_out(Path(sys.argv[1])):
        print(
            f"  {run.name}: error {100 * run.error:.0f} % of the range "
            f"({100 * run.stand_in:.0f} % on the stand-in soil), "
            f"{run.peak[0]:.1f} m/s2 recorded, {run.peak[1]:.1f} simulated; {run.depth[0]:.3f} m, {run.depth[1]:.3f} m"
        )


if __name__ == "__main__":
    main()
