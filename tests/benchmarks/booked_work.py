"""What booking the ledger's work as the integrator applied it costs a step: kernels as they are, beside those without.

    python -m tests.benchmarks.booked_work

Two processes in turn make the shipped side overturn and a throw of the cube on hard ground; the other one's kernels are
compiled with nothing in place of that booking, to a folder of its own, which takes some minutes. The motion is the same
to the last bit. The ratio is that of CPU time of the time loop, of the best of the repetitions, and that of each pair.
A step may cost 1.1 times what it did before the work was booked so; one without any booking is no dearer than that was.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
ALLOWED = 1.1  # times the cost of a step before
ROUNDS = 5
CASES: dict[str, dict[str, float]] = {"side_overturn": {}, "cube_toss": {"ground.law.restitution": 0.4}}
WAYS = ("booked", "plain")
CHILD = """
import hashlib, json, sys
from rollover.kernels import elements, step
from ground.compiled import leaf

if sys.argv[1] == "plain":

    @leaf
    def nothing(t):
        pass

    @leaf
    def no_step(t, h, qd):
        pass

    @leaf
    def no_force(row, b, r, x, y, z, Q):
        pass

    # the compiler looks names up when it first compiles
    step.account_friction, step.finish_applied, elements.add_force = nothing, no_step, no_force

from rollover.scenario import load
from tests.benchmarks.integrators import looped

ready = {n: load(n).replaced({**c, "simulation.integrator": "compiled"}) for n, c in json.loads(sys.argv[2]).items()}
for scenario in ready.values():
    looped(scenario)  # compiles
print(flush=True)
for _ in sys.stdin:
    told = {}
    for name, scenario in ready.items():
        run, taken = looped(scenario)
        moved = run.recording.channels
        kept = [moved[c].tobytes() for c in sorted(moved) if not c.startswith("energy/")]
        told[name] = [taken, hashlib.sha256(b"".join(kept)).hexdigest()]
    print(json.dumps(told), flush=True)
"""
Told = dict[str, tuple[float, str]]  # by scenario: CPU seconds, hash of the motion


@dataclass(frozen=True, kw_only=True)
class Cost:
    """CPU seconds of the time loop of each repetition, with the booking and without; whether the motion is the same."""

    scenario: str
    booked: tuple[float, ...]
    plain: tuple[float, ...]
    is_same: bool

    @property
    def ratio(self) -> float:
        """Of the best times: what else the machine does only ever adds."""
        return min(self.booked) / min(self.plain)

    def line(self) -> str:
        """The figures in a line."""
        each = [a / b for a, b in zip(self.booked, self.plain, strict=True)]
        return (
            f"{self.scenario:16s} booked {1e3 * min(self.booked):8.1f} ms, plain {1e3 * min(self.plain):8.1f} ms, "
            f"ratio {self.ratio:.3f} ({min(each):.3f} to {max(each):.3f})"
        )


def measured(folder: Path, rounds: int = ROUNDS) -> list[Cost]:
    """Both ways in turn; the kernels of the one without go to a folder."""
    children = []
    for way in WAYS:
        env = {**os.environ, **({} if way == "booked" else {"NUMBA_CACHE_DIR": str(folder)})}
        words = [sys.executable, "-c", CHILD, way, json.dumps(CASES)]
        child = subprocess.Popen(words, env=env, cwd=ROOT, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        assert child.stdout is not None
        child.stdout.readline()  # once it has compiled
        children.append(child)
    told: list[list[Told]] = [[], []]
    for _ in range(rounds):
        for child, found in zip(children, told, strict=True):
            assert child.stdin is not None
            assert child.stdout is not None
            child.stdin.write("\n")
            child.stdin.flush()
            found.append(json.loads(child.stdout.readline()))
    for child in children:
        child.communicate()
    return [_cost(name, *told) for name in CASES]


def _cost(name: str, booked: Sequence[Told], plain: Sequence[Told]) -> Cost:
    return Cost(
        scenario=name,
        booked=tuple(each[name][0] for each in booked),
        plain=tuple(each[name][0] for each in plain),
        is_same=len({each[name][1] for each in (*booked, *plain)}) == 1,
    )


def main() -> int:
    """Print a line for each scenario; 1 if a step costs more than allowed, or the motion is another."""
    with tempfile.TemporaryDirectory() as name:
        costs = measured(Path(name))
    for cost in costs:
        print(cost.line() + ("" if cost.is_same else "  ANOTHER MOTION"))
    return int(not all(cost.is_same and cost.ratio <= ALLOWED for cost in costs))


if __name__ == "__main__":
    raise SystemExit(main())
