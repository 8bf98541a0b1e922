"""Each machine in each scenario that it belongs to: `python -m tests.benchmarks.machines [--whole] [MACHINE ...]`.

Prints how the run ended, how far the vehicle leant from upright at most (deg), when its ROPS first touched the ground
(s), the largest force on it (kN, filtered), what it took (J), the largest residual of the ledger over the energy
released (%), and what half the step changes of that force (%, left out with `--whole`).
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

import numpy as np

from rollover.assessment.ledger import closure
from rollover.assessment.loads import leading, peak_loads
from rollover.dynamics.result import Run
from rollover.dynamics.simulate import run
from tests.physics.machines import PAIRS, lean, scene


@dataclass(frozen=True, kw_only=True)
class Shown:
    """What a row of the table says of a run, SI."""

    status: str
    lean: float
    touched: float
    force: float
    energy: float
    residual: float


def shown(done: Run) -> Shown:
    """The row of a run; of one without a ROPS the force of the ground."""
    rec = done.recording
    force = rec["rops/force"] if "rops/force" in rec.channels else rec["ground/force_normal"]
    hit = np.flatnonzero(force > 0.0)
    energy = float(rec["rops/energy"].max()) if "rops/energy" in rec.channels else 0.0
    first = leading(peak_loads(done))
    return Shown(
        status=done.status,
        lean=lean(done),
        touched=float(rec.time[hit[0]]) if len(hit) else float("nan"),
        force=first.filtered if first is not None else 0.0,
        energy=energy,
        residual=closure(done).largest,
    )


def main() -> None:
    """Print the table."""
    wanted = [word for word in sys.argv[1:] if not word.startswith("--")]
    halved = "--whole" not in sys.argv[1:]
    print("| machine | scenario | run | lean, deg | touches, s | ROPS, kN | ROPS, J | ledger, % | half step, % |")
    print("|---|---|---|---|---|---|---|---|---|")
    for machine, name in PAIRS:
        if wanted and machine not in wanted:
            continue
        scenario = scene(machine, name)
        at = shown(run(scenario))
        change = ""
        if halved:
            finer = shown(run(scenario.replaced({"simulation.step": 0.5 * scenario.simulation.step})))
            change = f"{100.0 * abs(finer.force / at.force - 1.0):.1f}"
        lands = f"{np.degrees(at.lean):.0f} | {at.touched:.2f} | {1e-3 * at.force:.1f}"
        print(
            f"| {machine} | {name} | {at.status} | {lands} | {at.energy:.0f} | {100.0 * at.residual:.3f} | {change} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
