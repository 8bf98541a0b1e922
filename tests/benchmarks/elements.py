"""What ground elements cost: the tractor's side overturn on 1e2 to 1e6 of them, beside the limit and MuJoCo.

N is varied in two ways.

same spacing
    The elements keep their size and the rectangle grows, so that exactly the same ones are touched and the motion
    is the same: what is left of N is the cost of untouched elements. Twice: with 0.5 m elements, of which 100 just
    hold the tractor, and with 0.05 m elements, about as fine as the shipped scenario's.
same rectangle
    5 m x 5 m are cut ever finer, so that more elements are touched. The vehicle's contact points, which the product
    never lets stand further apart than 0.8 elements, become more with them: a million at 5 mm.

All three engines start from the same pose, 3 degrees beyond balance: at the shipped scenario's 1 degree MuJoCo's
rigid tyres, which stand on other points, let the tractor fall back onto its wheels. Times are CPU time of this
process, best of several interleaved repetitions; kernels are compiled before.

    python -m tests.benchmarks.elements
"""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any
from unittest import mock

from rollover.assessment.loads import peak_loads
from rollover.dynamics import model, simulate
from rollover.dynamics.result import Run
from rollover.scenario import Scenario, load
from rollover.spec.frames import angles
from tests.benchmarks.limit import loop
from tests.benchmarks.rigid import Fall, fall

SCENARIO = "side_overturn"
EXCESS_DEG = 3.0
CENTRE = [1.1, 2.0]
SPACINGS, RECTANGLES = "same spacing", "same rectangle"
COARSE, FINE = 0.5, 0.05  # m
# even counts keep the element borders where they are
GRIDS = {100: (10, 10), 1_000: (50, 20), 10_000: (100, 100), 100_000: (500, 200), 1_000_000: (1000, 1000)}
SIDE = 5.0  # m, of the rectangle that is cut finer
REPEATS = 3
ROPS_PEAK = "rops/force"
# seconds of CPU for one engine on one row: what takes longer is not repeated, and MuJoCo, which on the finest cells
# needs some twenty for each second of the fall alone, stops there
BUDGET = 15.0


@dataclass(frozen=True, kw_only=True)
class Case:
    """One row: which way N is varied, elements along x and y, their spacing (m)."""

    way: str
    nx: int
    ny: int
    spacing: float

    def scenario(self) -> Scenario:
        """The side overturn on these elements."""
        rectangle = {
            "length": self.nx * self.spacing,
            "width": self.ny * self.spacing,
            "centre": CENTRE,
            "spacing": [self.spacing, self.spacing],
        }
        changes: dict[str, Any] = {f"ground.elements.{name}": value for name, value in rectangle.items()}
        return load(SCENARIO).replaced({**changes, "initiation.excess_deg": EXCESS_DEG})


@dataclass(frozen=True, kw_only=True)
class Row:
    """What one case took, and how it ended.

    `touched` elements, `points` on the vehicle.
    `step` and `limit_step` are CPU seconds per step of the time loop alone, `cost` is CPU seconds per simulated
    second of the whole run, with its start's equilibrium and its channels. Rolls are those at the end, rad;
    `apart` is the distance between the chassis' ends in the product and in the limit, m.
    """

    case: Case
    touched: int
    points: int
    step: float
    cost: float
    limit_step: float
    fall: Fall
    roll: float
    limit_roll: float
    apart: float

    @property
    def elements(self) -> int:
        """N."""
        return self.case.nx * self.case.ny

    @property
    def over_limit(self) -> float:
        """Time of a step over the limit's."""
        return self.step / self.limit_step

    @property
    def over_mujoco(self) -> float:
        """Time of the whole run over that of MuJoCo's steps alone."""
        return self.cost / self.fall.cost


@dataclass(frozen=True, kw_only=True)
class Speed:
    """The shipped scenario at one step (s): times real time, filtered ROPS peak (N), its change at half the step."""

    step: float
    times_real: float
    cfc: int
    peak: float
    change: float


def cases() -> tuple[Case, ...]:
    """All rows of the table."""
    found = [Case(way=SPACINGS, nx=nx, ny=ny, spacing=COARSE) for nx, ny in GRIDS.values()]
    found += [Case(way=SPACINGS, nx=nx, ny=ny, spacing=FINE) for nx, ny in GRIDS.values() if min(nx, ny) * FINE >= SIDE]
    for n in GRIDS:
        side = round(math.sqrt(n))
        found.append(Case(way=RECTANGLES, nx=side, ny=side, spacing=SIDE / side))
    return tuple(found)


@contextmanager
def timed_loop() -> Iterator[list[float]]:
    """CPU seconds of each time loop that runs inside."""
    times: list[float] = []
    solve = model.solve

    def timed(**arguments: Any) -> str:
        began = clock.process_time()
        try:
            return solve(**arguments)
        finally:
            times.append(clock.process_time() - began)

    with mock.patch.object(model, "solve", timed):
        yield times


def timed_run(scenario: Scenario) -> tuple[Run, float, float]:
    """A run, CPU seconds of all of it and of its time loop."""
    with timed_loop() as times:
        began = clock.process_time()
        run = simulate.run(scenario)
        whole = clock.process_time() - began
    if run.status != "done":
        raise RuntimeError(run.sentence)
    return run, whole, times[0]


def warm_up() -> None:
    """Compile or load every kernel of both loops."""
    scenario = Case(way=SPACINGS, nx=10, ny=10, spacing=COARSE).scenario()
    simulate.run(scenario)
    loop(scenario).run()


def measure(case: Case, repeats: int = REPEATS) -> Row:
    """Run the product, the limit and MuJoCo in turn; the best time of each."""
    scenario = case.scenario()
    whole = step = limit_step = math.inf
    falls: list[Fall] = []
    for k in range(repeats):
        if k > 0 and whole * repeats > BUDGET:
            break
        run, taken, in_loop = timed_run(scenario)
        bare = loop(scenario)
        whole, step = min(whole, taken), min(step, in_loop / bare.steps)
        began = clock.process_time()
        bare.run()
        limit_step = min(limit_step, (clock.process_time() - began) / bare.steps)
        if not falls or falls[0].cost * falls[0].reached * repeats < BUDGET:
            falls.append(fall(scenario, BUDGET))
    end = [float(run.recording[f"chassis/position_{axis}"][-1]) for axis in "xyz"]
    return Row(
        case=case,
        touched=len(run.track.element),
        points=len(bare.tables.point_a),
        step=step,
        cost=whole / scenario.simulation.duration,
        limit_step=limit_step,
        fall=min(falls, key=lambda f: f.cost),
        roll=float(run.recording["chassis/roll"][-1]),
        limit_roll=float(angles(bare.q[None, 3:6])[0][0]),
        apart=math.dist(end, bare.q[:3]),
    )


def speeds(steps: tuple[float, ...] = (1e-3, 5e-4), repeats: int = REPEATS) -> tuple[Speed, ...]:
    """The shipped scenario at each step: how fast it runs, how far its filtered ROPS peak moves at half of it."""
    shipped = load(SCENARIO)
    found = []
    for h in steps:
        scenario = shipped.replaced({"simulation.step": h})
        half = simulate.run(shipped.replaced({"simulation.step": 0.5 * h}))
        taken = math.inf
        for _ in range(repeats):
            run, whole, _ = timed_run(scenario)
            taken = min(taken, whole)
        peak = next(p for p in peak_loads(run, half) if p.channel == ROPS_PEAK)
        assert peak.half_step_change is not None
        found.append(
            Speed(
                step=h,
                times_real=scenario.simulation.duration / taken,
                cfc=peak.cfc,
                peak=peak.filtered,
                change=peak.half_step_change,
            )
        )
    return tuple(found)


HEAD = (
    f"{'way':14} {'spacing':>8} {'N':>8} {'touched':>8} {'points':>8} {'ours':>8} {'ours':>7} {'limit':>8} "
    f"{'ours/':>6} {'MuJoCo':>8}  {'ours/':>6} {'roll at the end, deg':>20}\n"
    f"{'':14} {'m':>8} {'':>8} {'':>8} {'':>8} {'us/step':>8} {'s/s':>7} {'us/step':>8} {'limit':>6} "
    f"{'s/s':>8}  {'MuJoCo':>6} {'ours':>10} {'limit':>9}"
)
NOTES = """\
us/step: CPU time of the time loop over its steps of 1 ms. s/s: CPU time of the whole run, the search for its start
and its channels included, over the simulated time; MuJoCo: its steps alone.
limit: the same kernels, vehicle and step in one compiled loop (velocity Verlet), without Exudyn, Python or recording.
MuJoCo: as many cells, but rigid ground, front axle and ROPS locked, rigid tyres, a constraint solver.
* stopped at its budget of CPU time: the average covers the fall so far, what is left out costs more."""


def line(row: Row) -> str:
    """One line of the table; a MuJoCo row that ran out of its budget is marked."""
    mark = " " if row.fall.whole else "*"
    return (
        f"{row.case.way:14} {row.case.spacing:8.4g} {row.elements:8d} {row.touched:8d} {row.points:8d} "
        f"{1e6 * row.step:8.1f} {row.cost:7.3f} {1e6 * row.limit_step:8.1f} {row.over_limit:6.2f} "
        f"{row.fall.cost:8.3f}{mark} {row.over_mujoco:6.3f} "
        f"{math.degrees(row.roll):10.2f} {math.degrees(row.limit_roll):9.2f}"
    )


def verdict(met: bool) -> str:
    """In a word."""
    return "met" if met else "MISSED"


def aims(rows: tuple[Row, ...], demo: tuple[Speed, ...]) -> str:
    """The aims and whether this run meets them."""
    found = []
    for spacing in (COARSE, FINE):
        same = [r for r in rows if r.case.way == SPACINGS and r.case.spacing == spacing]
        few, many = same[0], same[-1]
        ratio, cost = many.step / few.step, many.cost / few.cost
        found.append(
            f"N = {many.elements:.0e} within 1.5 x of N = {few.elements:.0e} at {spacing:g} m: "
            f"{ratio:.2f} per step, {cost:.2f} per run; {few.touched} and {many.touched} touched: "
            f"{verdict(ratio <= 1.5)}"
        )
    most = max(rows, key=lambda r: r.over_limit)
    found.append(
        f"within 3 x of the limit per step: {min(r.over_limit for r in rows):.2f} to {most.over_limit:.2f}: "
        f"{verdict(most.over_limit <= 3.0)}"
    )
    for spacing in sorted({r.case.spacing for r in rows}, reverse=True):
        ratios = [r.over_mujoco for r in rows if r.case.spacing == spacing]
        found.append(
            f"faster than MuJoCo at {spacing:.4g} m: {min(ratios):.3f} to {max(ratios):.3f} of its time: "
            f"{verdict(max(ratios) < 1.0)}"
        )
    for s in demo:
        found.append(
            f"shipped side overturn at {1e3 * s.step:g} ms: {s.times_real:.2f} x real time (aim 4), {ROPS_PEAK} "
            f"CFC {s.cfc} {s.peak:.0f} N, {100 * s.change:.2f} % at half the step (aim below 1): "
            f"{verdict(s.times_real >= 4.0 and s.change < 0.01)}"
        )
    return "\n".join(found)


def report(show: Callable[[str], None] = print) -> tuple[tuple[Row, ...], tuple[Speed, ...]]:
    """Measure everything; lines are shown as they come."""
    warm_up()
    show(HEAD)
    rows = []
    for case in cases():
        rows.append(measure(case))
        show(line(rows[-1]))
    show(NOTES)
    demo = speeds()
    show(aims(tuple(rows), demo))
    return tuple(rows), demo


if __name__ == "__main__":
    report()
