"""What counting who holds the arrays costs: kernels as they are, beside the same sources compiled with that.

    pytest -m benchmark tests/benchmarks/test_leaves.py -s

Two fresh processes with their own folders of compiled kernels make the shipped drop test by itself and the shipped side
overturn. Numbers are asserted to be the same bit for bit, time never.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
pytestmark = [pytest.mark.benchmark, pytest.mark.timeout(3600)]
CODE = """
import hashlib, json, sys, time
import ground.compiled as c
if sys.argv[1] == "counting":
    c.leaf = c.inlined = c.compiled
from rollover.dynamics.drop_test import DropModel
from rollover.scenario import load
from rollover.dynamics.simulate import run

def told(make, count):
    made, best = make(), float("inf")
    for _ in range(5):
        began = time.process_time()
        for _ in range(count):
            made = make()
        best = min(best, (time.process_time() - began) / count)
    return best, hashlib.sha256(b"".join(made[name].tobytes() for name in sorted(made))).hexdigest()

drop, overturn = DropModel(scenario=load("drop_test")), load("side_overturn")
print(json.dumps([told(lambda: drop.motion(drop.times), 50), told(lambda: run(overturn).recording.channels, 1)]))
"""


def test_leaves(tmp_path: Path) -> None:
    rows = {}
    for way in ("as it is", "counting"):
        done = subprocess.run(
            [sys.executable, "-c", CODE, way],
            env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / way)},
            cwd=ROOT,
            capture_output=True,
            text=True,
            check=True,
        )
        rows[way] = json.loads(done.stdout)
    print()
    for k, what in enumerate(("drop test by itself", "side overturn")):
        (own, same), (counting, other) = rows["as it is"][k], rows["counting"][k]
        assert same == other
        print(f"{what:20s} {1e3 * own:8.2f} ms, counting {1e3 * counting:8.2f} ms, ratio {counting / own:.2f}")
