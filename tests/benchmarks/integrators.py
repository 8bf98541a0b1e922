"""Both integrators beside the limit, and what each step of theirs is worth.

The first table is the tractor's side overturn, on elements so wide that few contact points do, and as shipped: CPU time
of the time loop over its steps, over that of the limit, and the same of the whole run with its start and its channels;
both integrators and the limit in turn, in one process. The ratio is that of the best times, its spread that of the
repetitions.

The second is work against precision: the striker's drop and the side overturn until its first touch at 1.6 to 0.1 ms,
against the same integrator at a much smaller step. One order is a factor of 2 in a row, two are 4.

    python -m tests.benchmarks.integrators
"""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any
from unittest import mock

import numpy as np

from rollover.dynamics import compiled, model, simulate
from rollover.scenario import Scenario, load
from tests.benchmarks.limit import loop

# elements so wide that the vehicle needs few points
COARSE = {
    "ground.elements.length": 5.0,
    "ground.elements.width": 5.0,
    "ground.elements.spacing": [0.5, 0.5],
    "vehicle.contact_spacing": 0.4,
}
INTEGRATORS = ("exudyn", "compiled")
REPEATS = 3
STEPS = (1.6e-3, 8e-4, 4e-4, 2e-4, 1e-4)  # s; a scenario's rows may be no further apart than 1.67 ms
FINE = 2.5e-5  # s, of the reference
# scenario, what is looked at, until when (s): smooth motion, before a contact's beginning falls between two steps
PRECISION = (
    ("drop_test", "striker/position_z", 0.2, {"initiation.lead_time": 0.0}),
    ("side_overturn", "chassis/roll", 0.6, {}),
)


@dataclass(frozen=True, kw_only=True)
class Cost:
    """CPU seconds of a step, of each repetition: both integrators' loops and runs, the limit; the vehicle's points."""

    points: int
    steps: dict[str, list[float]]
    runs: dict[str, list[float]]
    limit: list[float]

    def ratio(self, integrator: str) -> tuple[float, float, float]:
        """Over the limit: of the best times, and the least and largest of the repetitions."""
        each = [a / b for a, b in zip(self.steps[integrator], self.limit, strict=True)]
        return min(self.steps[integrator]) / min(self.limit), min(each), max(each)

    def whole(self, integrator: str) -> float:
        """The whole run over the limit, of the best times."""
        return min(self.runs[integrator]) / min(self.limit)


@dataclass(frozen=True, kw_only=True)
class Worth:
    """One step of one integrator: CPU seconds of the time loop for each simulated one, largest error (m or rad)."""

    scenario: str
    integrator: str
    step: float
    cost: float
    error: float


@contextmanager
def timed_loops() -> Iterator[list[float]]:
    """CPU seconds of each time loop that runs inside, whoever makes its steps."""
    times: list[float] = []

    def timed(solve: Callable[..., str]) -> Callable[..., str]:
        def around(*given: Any, **named: Any) -> str:
            began = clock.process_time()
            try:
                return solve(*given, **named)
            finally:
                times.append(clock.process_time() - began)

        return around

    with (
        mock.patch.object(model, "solve", timed(model.solve)),
        mock.patch.object(compiled, "solve", timed(compiled.solve)),
    ):
        yield times


def looped(scenario: Scenario) -> tuple[simulate.Run, float]:
    """A run and CPU seconds of its time loop."""
    with timed_loops() as times:
        run = simulate.run(scenario)
    if run.status != "done":
        raise RuntimeError(run.sentence)
    return run, times[0]


def by(scenario: Scenario, integrator: str) -> Scenario:
    """The scenario with that integrator."""
    return scenario.replaced({"simulation.integrator": integrator})


def cost(scenario: Scenario, repeats: int = REPEATS) -> Cost:
    """Both integrators and the limit in turn."""
    steps: dict[str, list[float]] = {integrator: [] for integrator in INTEGRATORS}
    runs: dict[str, list[float]] = {integrator: [] for integrator in INTEGRATORS}
    limit: list[float] = []
    points = 0
    for _ in range(repeats):
        bare = loop(scenario)
        points = len(bare.tables.point_a)
        for integrator in INTEGRATORS:
            began = clock.process_time()
            steps[integrator].append(looped(by(scenario, integrator))[1] / bare.steps)
            runs[integrator].append((clock.process_time() - began) / bare.steps)
        began = clock.process_time()
        bare.run()
        limit.append((clock.process_time() - began) / bare.steps)
    return Cost(points=points, steps=steps, runs=runs, limit=limit)


def worth(repeats: int = 3) -> list[Worth]:
    """Both integrators at each step, held against the compiled one at the fine step."""
    found = []
    for name, channel, duration, changes in PRECISION:
        base = load(name).replaced({**changes, "simulation.duration": duration})
        fine = by(base.replaced({"simulation.step": FINE, "simulation.output_step": FINE}), "compiled")
        exact = looped(fine)[0].recording
        for integrator in INTEGRATORS:
            for step in STEPS:
                scenario = by(base.replaced({"simulation.step": step, "simulation.output_step": step}), integrator)
                taken = math.inf
                for _ in range(repeats):
                    run, time = looped(scenario)
                    taken = min(taken, time)
                at = run.recording.time
                apart = run.recording[channel] - np.interp(at, exact.time, exact[channel])
                found.append(
                    Worth(
                        scenario=name,
                        integrator=integrator,
                        step=step,
                        cost=taken / duration,
                        error=float(np.abs(apart).max()),
                    )
                )
    return found


def report(show: Callable[[str], None] = print) -> tuple[list[Cost], list[Worth]]:
    """Measure everything; lines are shown as they come."""
    many = load("side_overturn")
    few = many.replaced(COARSE)
    costs = []
    show(
        f"{'points':>8} {'limit':>9} "
        + " ".join(f"{i:>9} {'/limit':>7} {'spread':>11} {'run':>5}" for i in INTEGRATORS)
    )
    for scenario in (few, many):
        loop(scenario).run()  # kernels are compiled before
        for integrator in INTEGRATORS:
            looped(by(scenario, integrator))
        costs.append(cost(scenario))
        told = f"{costs[-1].points:8d} {1e6 * min(costs[-1].limit):6.1f} us "
        for integrator in INTEGRATORS:
            best, low, high = costs[-1].ratio(integrator)
            told += f"{1e6 * min(costs[-1].steps[integrator]):6.1f} us {best:7.2f} {low:5.2f}-{high:5.2f} "
            told += f"{costs[-1].whole(integrator):5.2f} "
        show(told.rstrip())
    found = worth()
    show(f"{'':14} {'':9} {'step, ms':>9} {'s/s':>8} {'error':>9}")
    for w in found:
        show(f"{w.scenario:14} {w.integrator:9} {1e3 * w.step:9g} {w.cost:8.4f} {w.error:9.2e}")
    return costs, found


if __name__ == "__main__":
    report()
