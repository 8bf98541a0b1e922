"""Every shipped vehicle in every shipped scenario under every law: done, or refused with a cure; the energy ledger.

    python -m tests.benchmarks.combinations [DURATION]

DURATION (0.3) s of each, at most what the scenario has. Laws without typical coefficients take those of a shipped
soil, and are left out where there is none. Prints a line for each that is not done, and the largest ledger residual.
"""

from __future__ import annotations

import math
import sys
from collections import Counter

from ground.law import laws
from rollover.assessment.ledger import LIMIT, closure
from rollover.dynamics import simulate
from rollover.scenario import AnyLaw, load
from rollover.spec import document
from rollover.spec.vehicle import Vehicle
from rollover.system.errors import InputError

SHELF = document.shipped_folder()


def grounds() -> dict[str, dict[str, object]]:
    """Values to exchange for each law: its kind alone, or with a shipped soil of it."""
    soils = {document.load(p, AnyLaw).kind: p.name for p in sorted(SHELF.glob("soils/*.yaml"))}
    base, found = load("rops_drop"), {}
    for kind in laws():
        try:
            base.replaced({"ground.law.kind": kind})
        except InputError:
            if kind in soils:
                found[kind] = {"ground.law": f"soils/{soils[kind]}"}
            continue
        found[kind] = {"ground.law.kind": kind}
    return found


def main(duration: float) -> None:
    """Run the whole matrix. Ledgers are shares of the energy that came in."""
    vehicles = [p.stem for p in sorted(SHELF.glob("vehicles/*.yaml"))]
    scenarios = [p.stem for p in sorted(SHELF.glob("*.yaml")) if isinstance(load(p).vehicle, Vehicle)]
    outcomes: Counter[str] = Counter()
    worst = (0.0, "")
    for kind, ground in grounds().items():
        for scenario in scenarios:
            base = load(scenario)
            brief = {"simulation.duration": min(duration, base.simulation.duration)}
            for vehicle in vehicles:
                name = f"{scenario}, {vehicle}, {kind}"
                try:
                    changes = {"vehicle": f"vehicles/{vehicle}.yaml", **ground, **brief}
                    run = simulate.run(base.replaced(changes, origin="--set"))
                except InputError as e:
                    outcomes["refused"] += 1
                    print(f"{name}: {str(e).splitlines()[0]}")
                    continue
                outcomes[run.status] += 1
                if run.status != "done":
                    print(f"{name}: {run.status}: {run.sentence}")
                    continue
                if math.isfinite(share := closure(run).largest):
                    worst = max(worst, (share, name))
        print(f"{kind}: {dict(outcomes)}", flush=True)
    print(f"{dict(outcomes)}; largest residual {100.0 * worst[0]:.3f} % of {100.0 * LIMIT:.1f} %: {worst[1]}")


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 0.3)
