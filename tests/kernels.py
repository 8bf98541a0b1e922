"""Compile the kernels of all that moves, once: `make test` does it beside the linters, before its processes run them.

Without it each process that comes first compiles them, at the same time as the others, for a minute and more of a core.

    python -m tests.kernels
"""

from __future__ import annotations

import importlib
import time

from ground.compiled import KEPT
from rollover.dynamics.drop_test import DropModel
from rollover.dynamics.simulate import run
from rollover.scenario import load

SHORT = 0.02  # s
# bundles of arrays have one type each, so one run of each kind compiles for all others
RUNS = (("side_overturn", "exudyn"), ("side_overturn", "compiled"), ("cube_toss", "exudyn"), ("cube_toss", "compiled"))


def main() -> None:
    """Import what compiles as it is imported, and run what compiles at its first call."""
    began = time.perf_counter()
    for module in ("rollover.diagnosis", "rollover.studies.regression", "rollover.recording.filters"):
        importlib.import_module(module)
    for name, integrator in RUNS:
        changes = {"simulation.duration": SHORT, "simulation.integrator": integrator}
        run(load(name).replaced(changes))
    DropModel(scenario=load("drop_test")).run()
    print(f"kernels compiled in {time.perf_counter() - began:.0f} s, kept in {KEPT}")


if __name__ == "__main__":
    main()
