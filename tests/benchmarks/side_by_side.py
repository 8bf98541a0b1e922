"""One overturn by every engine in one run: its cost, how far its end moves at a quarter of the step, its memory.

Ours by both integrators and the limit, on soil that remembers; MuJoCo on rigid ground, as boxes and cylinders and as
200 spheres, on a height field of as many cells and on a plane. The start is the same, 3 degrees beyond balance.

    python -m tests.benchmarks.side_by_side [REPEATS]

Each measurement is a process of its own, all engines in turn, so that a busy machine is busy for each; the least cost
counts. Cost is CPU time of the steps alone over the simulated time. `moved` is how far the chassis' end lies from that
at a quarter of the step, m: what an engine's own step leaves open, not which of them is right. Memory is the most that
the process ever held, its libraries included.
"""

from __future__ import annotations

import json
import math
import subprocess
import sys
import time as clock
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

from rollover.scenario import Scenario
from rollover.studies.case import _peak_memory
from tests.benchmarks.elements import FINE, SPACINGS, Case
from tests.benchmarks.integrators import looped
from tests.benchmarks.limit import loop

ROOT = Path(__file__).resolve().parents[2]
CASE = Case(way=SPACINGS, nx=100, ny=100, spacing=FINE)  # 1e4 elements, as many cells
STEP, FINER = 1e-3, 4  # s, and into how many parts it is cut
DURATION = 1.4  # s: the fall, the first blow and what follows at once
Place = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class Measured:
    """One engine: CPU seconds per simulated second, end of the chassis (m), most bytes held."""

    cost: float
    place: Place
    memory: int


@dataclass(frozen=True, kw_only=True)
class Row:
    """One engine: least cost, over that of `compiled`; how far its end moves at a quarter of the step (m); bytes."""

    engine: str
    cost: float
    ratio: float
    moved: float
    memory: int


def ours(scenario: Scenario, integrator: str) -> tuple[float, Place]:
    """CPU seconds of the loop alone, and the end."""
    chosen = scenario.replaced({"simulation.integrator": integrator})
    looped(chosen.replaced({"simulation.duration": 0.01}))  # kernels are loaded
    run, taken = looped(chosen)
    x, y, z = (float(run.recording[f"chassis/position_{axis}"][-1]) for axis in "xyz")
    return taken, (x, y, z)


def limit(scenario: Scenario) -> tuple[float, Place]:
    """The same of the bare loop."""
    loop(scenario.replaced({"simulation.duration": 0.01})).run()
    bare = loop(scenario)
    began = clock.process_time()
    bare.run()
    x, y, z = (float(v) for v in bare.q[:3])
    return clock.process_time() - began, (x, y, z)


def mujoco(scenario: Scenario, form: str, ground: str) -> tuple[float, Place]:
    """The same of MuJoCo's steps."""
    from tests.benchmarks.rigid import fall

    found = fall(scenario, 60.0, form=form, ground=ground)  # type: ignore[arg-type]
    return found.cost * found.reached, found.place


ENGINES: dict[str, Callable[[Scenario], tuple[float, Place]]] = {
    "compiled": lambda s: ours(s, "compiled"),
    "exudyn": lambda s: ours(s, "exudyn"),
    "limit": limit,
    "mujoco, boxes and cylinders, field": lambda s: mujoco(s, "shapes", "field"),
    "mujoco, boxes and cylinders, plane": lambda s: mujoco(s, "shapes", "plane"),
    "mujoco, 200 spheres, field": lambda s: mujoco(s, "spheres", "field"),
    "mujoco, 200 spheres, plane": lambda s: mujoco(s, "spheres", "plane"),
}


def measured(engine: str, step: float) -> Measured:
    """Run one engine here."""
    scenario = CASE.scenario().replaced({"simulation.step": step, "simulation.duration": DURATION})
    took, place = ENGINES[engine](scenario)
    return Measured(cost=took / DURATION, place=place, memory=_peak_memory())


def apart(engine: str, step: float) -> Measured:
    """The same in a process of its own."""
    words = [sys.executable, "-m", "tests.benchmarks.side_by_side", engine, repr(step)]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True)
    found = json.loads(done.stdout.splitlines()[-1])
    return Measured(cost=found["cost"], place=tuple(found["place"]), memory=found["memory"])


def table(repeats: int = 3) -> list[Row]:
    """All engines in turn, so many times; the quarter of the step once."""
    every = {engine: [apart(engine, STEP)] for engine in ENGINES}
    for _ in range(repeats - 1):
        for engine, found in every.items():
            found.append(apart(engine, STEP))
    least = {engine: min(m.cost for m in found) for engine, found in every.items()}
    return [
        Row(
            engine=engine,
            cost=least[engine],
            ratio=least[engine] / least["compiled"],
            moved=math.dist(found[0].place, apart(engine, STEP / FINER).place),
            memory=found[0].memory,
        )
        for engine, found in every.items()
    ]


def report(repeats: int = 3) -> list[Row]:
    """Measure and print."""
    rows = table(repeats)
    print(f"{'engine':36} {'CPU s/s':>8} {'/ compiled':>10} {'moved, mm':>10} {'memory, MB':>10}")
    for row in rows:
        print(
            f"{row.engine:36} {row.cost:8.4f} {row.ratio:10.2f} {1e3 * row.moved:10.2f} {1e-6 * row.memory:10.0f}",
            flush=True,
        )
    return rows


if __name__ == "__main__":
    if len(sys.argv) == 3:
        print(json.dumps(asdict(measured(sys.argv[1], float(sys.argv[2])))))
    else:
        report(*(int(text) for text in sys.argv[1:]))
