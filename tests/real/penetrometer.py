"""Laws of a real sea bed from the drops of a free-fall penetrometer (University of Florida Coastal Geotechnics).

    python -m tests.real.penetrometer $ROLLOVER_DATA/soil_penetrometer

Prints which drops are usable, how well each form of law fits and predicts a drop that was left out, and the numbers.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from ground.penetration import Fitted, chosen, fit_forms
from rollover.identification import drops_of
from rollover.recording import Recording
from rollover.scenario import load

BUOYANCY = 2.473e-3 * 1025.0 * 9.81  # N, 2.473 l in sea water
RANGE = "a18g"  # the finest accelerometer that no drop clips


def recordings(folder: Path) -> dict[str, Recording]:
    """Axial coordinate acceleration of each file, by its name."""
    found = {}
    for file in sorted(folder.glob("*_main_drop.csv.gz")):
        table = np.genfromtxt(file, delimiter=",", names=True)
        name = file.name.removesuffix("_main_drop.csv.gz")
        found[name] = Recording(
            title=name,
            time=table["t_s"] - table["t_s"][0],
            channels={"striker/acceleration_z": (table[RANGE] - 1.0) * 9.80665},
        )
    return found


def study(folder: Path) -> tuple[list[str], dict[str, Fitted]]:
    """What was refused, and every form fitted to the others."""
    scenario = load("penetrometer_drop").replaced({"gravity": 9.81})
    drops, refused = drops_of(recordings(folder), scenario, buoyancy=BUOYANCY, terminal=True)
    return refused, fit_forms(drops)


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


if __name__ == "__main__":
    main()
