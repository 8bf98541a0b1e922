"""The energy ledger over random throws on hard ground and random overturns: `python -m tests.benchmarks.ledger`.

Prints the largest residual over the energy released, and how the runs are spread. ``--throws`` and ``--overturns`` say
how many, ``--integrator`` by which; one that stays open by more than 0.5 % or fails makes the exit status 1.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable

import numpy as np

from rollover.assessment.ledger import LIMIT, closure
from rollover.dynamics.simulate import run
from rollover.scenario import Scenario
from tests.benchmarks.integrators import INTEGRATORS
from tests.physics.throws import overturn, throw


def shares(
    make: Callable[[np.random.Generator], Scenario], count: int, seed: int, integrator: str = "exudyn"
) -> tuple[list[float], list[str]]:
    """Largest residual of each run over the energy released, and the sentences of those that failed."""
    rng, found, failed = np.random.default_rng(seed), [], []
    for _ in range(count):
        done = run(make(rng).replaced({"simulation.integrator": integrator}))
        found.append(closure(done).largest)
        if done.status == "failed":
            failed.append(done.sentence)
    return found, failed


def main() -> int:
    """Print both tables; 1 if a ledger stays open."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--throws", type=int, default=300)
    parser.add_argument("--overturns", type=int, default=30)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--integrator", choices=INTEGRATORS, default="exudyn")
    asked = parser.parse_args()
    wrong = False
    for name, make, count in (("throws", throw, asked.throws), ("overturns", overturn, asked.overturns)):
        if not count:
            continue
        found, failed = shares(make, count, asked.seed, asked.integrator)
        most, half, tail = (100.0 * float(np.quantile(found, q)) for q in (1.0, 0.5, 0.95))
        above = sum(share > LIMIT for share in found)
        print(
            f"{count} {name}, {asked.integrator}: largest residual {most:.3g} % of the energy released, 95 % below "
            f"{tail:.2g} %, half below {half:.2g} %; {above} above {100.0 * LIMIT:g} %; {len(failed)} failed"
        )
        for sentence in sorted(set(failed)):
            print(f"  failed: {sentence}")
        wrong |= bool(failed) or not all(share <= LIMIT for share in found)  # what is no number is not below
    return int(wrong)


if __name__ == "__main__":
    sys.exit(main())
