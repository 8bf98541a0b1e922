"""What compiling the kernels costs: the first run of an installation against the second.

Two fresh processes run the shipped side overturn, the first with an empty folder of compiled kernels, the second with
what the first left there.

    python -m tests.benchmarks.cold_start
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
RUN = """
import time
began = time.perf_counter()
from rollover.scenario import load
from rollover.dynamics.simulate import run
status = run(load("side_overturn")).status
print(status, time.perf_counter() - began, time.process_time())
"""


@dataclass(frozen=True, kw_only=True)
class Start:
    """Seconds of one process, from its imports to the end of its run: on the clock, and of CPU."""

    wall: float
    cpu: float


def start(cache: str) -> Start:
    """Run in a fresh process whose compiled kernels live in `cache`."""
    done = subprocess.run(
        [sys.executable, "-c", RUN],
        env={**os.environ, "NUMBA_CACHE_DIR": cache},
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    status, wall, cpu = done.stdout.split()[-3:]
    if status != "done":
        raise RuntimeError(f"the run ended as {status!r}")
    return Start(wall=float(wall), cpu=float(cpu))


def measure() -> tuple[Start, Start]:
    """First and second start of an installation."""
    with tempfile.TemporaryDirectory() as cache:
        return start(cache), start(cache)


def report() -> tuple[Start, Start]:
    """Measure and print."""
    first, second = measure()
    for name, s in (("first run, kernels compiled", first), ("second run, kernels loaded", second)):
        print(f"{name:28} {s.wall:7.2f} s  {s.cpu:7.2f} CPU s, imports included")
    print(f"{'compiling costs':28} {first.wall - second.wall:7.2f} s  {first.cpu - second.cpu:7.2f} CPU s, once")
    return first, second


if __name__ == "__main__":
    report()
