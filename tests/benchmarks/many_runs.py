"""What a case of a study costs by each integrator, side by side, and threads beside processes.

    python -m tests.benchmarks.many_runs [CASES] [WORKERS]

CPU of a case is that of this one process, both integrators in turn, so that the ratio holds on a busy machine. Cases
a minute are wall time of a whole study, with the start of its workers, its store and its tables; the largest worker's
memory is the most that it ever held. Threads work the same cases off in one process without limits.
"""

from __future__ import annotations

import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

from rollover import studies
from rollover.recording import as_numbers, read_table
from rollover.studies import Study, case_store
from rollover.studies.case import _simulated
from rollover.studies.design import points
from rollover.studies.plan import Random
from rollover.studies.runner import Builder, Way, conduct

INTEGRATORS = ("exudyn", "compiled")
ALONE = 6  # cases of each integrator that are timed in this very process


@dataclass(frozen=True, kw_only=True)
class Alone:
    """CPU seconds of each case, one pair for each point: by Exudyn and by the loop."""

    pairs: tuple[tuple[float, float], ...]

    @property
    def ratio(self) -> float:
        """Of the sums."""
        return sum(a for a, _ in self.pairs) / sum(b for _, b in self.pairs)


@dataclass(frozen=True, kw_only=True)
class Whole:
    """A whole study: cases a minute of wall time, and the most bytes that a worker held."""

    rate: float
    memory: float


def overturns(count: int) -> Study:
    """The soil study of the side overturn with so many draws."""
    return replace(studies.load("soil_side_overturn"), plan=Random(count=count, seed=1))


def alone(count: int = ALONE) -> Alone:
    """Both integrators in turn, after a case of each that nobody times."""
    study = overturns(count + 1)
    found = points(study)
    builders = [Builder(study, integrator=name) for name in INTEGRATORS]
    pairs = []
    for k in range(found.count):
        times = []
        for builder in builders:
            scenario = builder.scenario(found.row(k))
            began = time.process_time()
            _simulated(scenario, clearance=False)
            times.append(time.process_time() - began)
        pairs.append((times[0], times[1]))
    return Alone(pairs=tuple(pairs[1:]))


def whole(integrator: str, cases: int, workers: int) -> Whole:
    """A study from its start to its tables, by one integrator."""
    study = overturns(cases)
    study = replace(study, scenario=study.scenario.replaced({"simulation.integrator": integrator}))
    with tempfile.TemporaryDirectory() as name:
        folder, began = Path(name), time.perf_counter()
        done = conduct(study, folder, Way(workers=workers))
        wall = time.perf_counter() - began
        if wrong := next((row.sentence for row in done.rows if row.status != "done"), ""):
            raise RuntimeError(wrong)
        told, _ = read_table(folder / case_store.PROVENANCE)
    return Whole(rate=60.0 * cases / wall, memory=float(as_numbers(told["peak_memory"]).max()))


def threads(cases: int, workers: int) -> float:
    """Cases a minute of wall time in so many threads of this process, by the loop."""
    study = overturns(cases)
    found, builder = points(study), Builder(study)
    scenarios = [builder.scenario(found.row(k)) for k in range(cases)]
    _simulated(scenarios[0], clearance=False)
    began = time.perf_counter()
    with ThreadPoolExecutor(workers) as pool:
        list(pool.map(lambda scenario: _simulated(scenario, clearance=False), scenarios))
    return 60.0 * cases / (time.perf_counter() - began)


def report(cases: int, workers: int) -> Alone:
    """Measure and print."""
    one = alone()
    by = [1e3 * sum(pair[i] for pair in one.pairs) / len(one.pairs) for i in (0, 1)]
    print(f"CPU of a case: exudyn {by[0]:.0f} ms, compiled {by[1]:.0f} ms, ratio {one.ratio:.2f}")
    for name in INTEGRATORS:
        found = whole(name, cases, workers)
        print(
            f"{name}: {cases} side overturns by {workers} workers, {found.rate:.0f} a minute, "
            f"{found.memory / 1e6:.0f} MB the largest worker"
        )
    print(f"compiled in {workers} threads of one process: {threads(cases, workers):.0f} a minute")
    return one


if __name__ == "__main__":
    given = [int(text) for text in sys.argv[1:]]
    report(*(given + [200, 2][len(given) :]))
