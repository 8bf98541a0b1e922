"""What a study costs: side overturns here and on a local cluster, and the store, table and page of many cheap rows.

    python -m tests.benchmarks.studies [CASES] [WORKERS]

CPU time is that of all processes together, so that it says the same on a machine that others use; cases a minute and
the parallel efficiency are wall time and hold for one that is idle.
"""

from __future__ import annotations

import os
import resource
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rollover import studies
from rollover.dynamics import simulate
from rollover.recording import as_numbers, read_table
from rollover.studies import case_store
from rollover.studies.case import _peak_memory, _simulated, warm_up
from rollover.studies.design import points
from rollover.studies.plan import Random
from rollover.studies.runner import Builder, Conducted, Way, conduct
from rollover.studies.summary import answers
from tests.rollover.studies import made_up

COUNTS = (1000, 3000, 10_000)
ALONE = 10  # cases that are timed in this very process
MEASURES = 24  # numbers of a row, as a side overturn has


@dataclass
class Clock:
    """Seconds: on the wall, and of CPU in this process and in its children that have ended."""

    wall: float = 0.0
    own: float = 0.0
    children: float = 0.0

    @property
    def cpu(self) -> float:
        return self.own + self.children


def _cpu(who: int) -> float:
    used = resource.getrusage(who)
    return used.ru_utime + used.ru_stime


@contextmanager
def timed() -> Iterator[Clock]:
    clock = Clock()
    whose = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    began, own, children = time.perf_counter(), *map(_cpu, whose)
    yield clock
    clock.wall = time.perf_counter() - began
    clock.own, clock.children = _cpu(whose[0]) - own, _cpu(whose[1]) - children


@dataclass(frozen=True, kw_only=True)
class Conduct:
    """One study as it was carried out."""

    way: str
    cases: int
    workers: int
    clock: Clock
    case_cpu: float  # s, of all cases together, as they told
    case_wall: float
    memory: float  # bytes, the largest child
    parent: float
    table: bytes

    def says(self, alone: float) -> str:
        n, c = self.cases, self.clock
        overhead = (c.cpu - self.case_cpu) / n
        lines = (
            f"{self.way}: {n} side overturns, {self.workers} workers, {60.0 * n / c.wall:.1f} a minute",
            f"CPU of a case {1e3 * self.case_cpu / n:.0f} ms, all else {1e3 * overhead:.1f} ms a case "
            f"({100.0 * overhead * n / self.case_cpu:.1f} %), of it {1e3 * c.own / n:.1f} ms in the parent",
            f"parallel efficiency {100.0 * self.case_wall / (self.workers * c.wall):.0f} % (workers busy), "
            f"{100.0 * n * alone / (self.workers * c.wall):.0f} % (against one case after another, alone)",
            f"memory: {self.memory / 1e6:.0f} MB for a child, {self.parent / 1e6:.0f} MB for the parent",
        )
        return "\n  ".join(lines)


def overturns(cases: int, workers: int, scheduler: str, folder: Path) -> Conduct:
    """Carry out the soil study of the side overturn with so many draws."""
    study = replace(studies.load("soil_side_overturn"), plan=Random(count=cases, seed=1))
    with timed() as clock:
        done = conduct(study, folder, Way(workers=workers, scheduler=scheduler))
    if any(row.status != "done" for row in done.rows):
        raise RuntimeError(next(row.sentence for row in done.rows if row.status != "done"))
    told, _ = read_table(folder / case_store.PROVENANCE)
    return Conduct(
        way=scheduler or "here",
        cases=cases,
        workers=workers,
        clock=clock,
        case_cpu=float(as_numbers(told["cpu_time"]).sum()),
        case_wall=float(as_numbers(told["wall_time"]).sum()),
        memory=float(max(told["peak_memory"])),
        parent=_peak_memory(),
        table=(folder / case_store.TABLE).read_bytes(),
    )


def alone() -> float:
    """CPU seconds of one case in this process, without a study around it; the mean of some."""
    study = studies.load("soil_side_overturn")
    builder, found = Builder(study), points(study)
    warm_up()
    simulate.run(builder.scenario(found.row(0)))
    scenarios = [builder.scenario(found.row(k)) for k in range(ALONE)]
    began = time.process_time()
    for scenario in scenarios:
        _simulated(scenario, clearance=False)
    return (time.process_time() - began) / ALONE


def rows(count: int, folder: Path) -> dict[str, float]:
    """CPU ms a case of what follows a simulation, for made-up rows; bytes a case on disk and of the page."""
    study, done = made_up(folder, count)
    full = [replace(row, measures=_filled(row.measures)) for row in done.rows]
    found: dict[str, float] = {}

    def step(name: str, work: Any) -> Any:
        began = time.process_time()
        value = work()
        found[name] = 1e3 * (time.process_time() - began) / count
        return value

    builder = Builder(study)
    builder.key(done.points.row(0))
    step("key", lambda: [builder.key(done.points.row(k)) for k in range(count)])
    step("keep", lambda: [case_store.keep(folder, row) for row in full])
    step("read", lambda: [case_store.stored(folder, row.key) for row in full])
    step("table", lambda: case_store.compact(folder, study, done.keys, done.points.columns, full))
    again = Conducted(points=done.points, keys=done.keys, rows=full, ran=count)
    report = step("answers", lambda: answers(study, again))
    found["page"] = _page(study, again, report, folder, count)
    cases = folder / case_store.CASES
    found["disk"] = sum(p.stat().st_blocks * 512 for p in cases.rglob("*.parquet")) / count
    found["table bytes"] = (folder / case_store.TABLE).stat().st_size / count
    found["page bytes"] = (folder / case_store.PAGE).stat().st_size / count
    return found


def _filled(measures: Mapping[str, float]) -> dict[str, float]:
    """As many numbers as a case has, none like that of another."""
    first = measures.get("ground/force_normal", 0.0)
    more = {f"wheel/w{k}/force_normal": first / (k + 3.0) for k in range(MEASURES - 2)}
    return {**measures, **more} if measures else {}


def _page(study: Any, done: Conducted, report: dict[str, Any], folder: Path, count: int) -> float:
    from tests.viz.test_study_page import json_of as headed
    from viz.pages.study import page

    whole = {**headed(study, done), **report}
    began = time.process_time()
    text = page(study, done, whole, command="rollover study")
    spent = 1e3 * (time.process_time() - began) / count
    (folder / case_store.PAGE).write_text(text, encoding="utf-8")
    return spent


def opening(page: Path) -> float:
    """Seconds in which Chromium opens a page from disk until its table stands, the best of three; nan without one."""
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        return float("nan")
    program = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if program is None:
        return float("nan")
    best = float("inf")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=["--no-sandbox"])
        for _ in range(3):
            tab = browser.new_page()
            began = time.perf_counter()
            tab.goto(page.as_uri())
            tab.locator(".where", has_text="1 to 50").wait_for()
            best = min(best, time.perf_counter() - began)
            tab.close()
        browser.close()
    return best


def report_overturns(cases: int, workers: int) -> tuple[Conduct, Conduct | None]:
    """Measure and print: here, and on a cluster of as many single-threaded workers."""
    print(f"load of the machine {os.getloadavg()[0]:.1f}")
    one = alone()
    print(f"alone: {1e3 * one:.0f} ms of CPU a case")
    with tempfile.TemporaryDirectory() as folder:
        here = overturns(cases, workers, "", Path(folder, "here"))
        print(here.says(one))
        try:
            import distributed  # noqa: F401
        except ImportError:
            print("no cluster: distributed is not installed")
            return here, None
        there = overturns(cases, workers, "local", Path(folder, "there"))
        print(there.says(one))
    print(f"the same table: {here.table == there.table}; load of the machine {os.getloadavg()[0]:.1f}")
    return here, there


def report_rows() -> list[dict[str, float]]:
    """Measure and print what follows the simulations."""
    found = []
    print(
        "cases   ms of CPU a case: "
        + "    ".join(("key", "keep", "read", "table", "answers", "page"))
        + "   bytes a case"
    )
    for count in COUNTS:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            each = rows(count, folder)
            opened = opening(folder / case_store.PAGE)
        cells = "  ".join(f"{each[k]:6.3f}" for k in ("key", "keep", "read", "table", "answers", "page"))
        sizes = ", ".join(f"{k} {each[k]:.0f}" for k in ("disk", "table bytes", "page bytes"))
        print(f"{count:6d}                    {cells}   {sizes}; opens in {opened:.2f} s")
        found.append(each)
    return found


if __name__ == "__main__":
    given = [int(text) for text in sys.argv[1:]]
    report_rows()
    report_overturns(*(given + [1000, 2][len(given) :]))
