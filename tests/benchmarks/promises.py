"""What `rollover plan` promises against what is reached: noise, clocks, gains drawn anew; the smaller misfit chooses.

`python -m tests.benchmarks.promises [--draws 25] [--seed 4]`: for each of 8 pairs so many campaigns, drops at 1 and 3.5
m/s, 200 in all. Held against each promise is the 90 % interval of Clopper and Pearson: an exact promise is in nine
times of ten. The last line holds all campaigns against the mean of all promises.
"""

from __future__ import annotations

import argparse
import time as clock

import numpy as np
from scipy.stats import binomtest

from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted
from rollover.diagnosis.fit.parameterisation import Candidate
from rollover.diagnosis.planning.plan import usual_noise
from rollover.diagnosis.planning.planned import Instruments, planned, showing
from rollover.diagnosis.planning.separation import Tests, point_where_it_acts, strength_with
from rollover.diagnosis.selection.candidates import candidates_of, size_of
from tests.diagnosis.drops import ACCELERATION, DEPTH, FORCE, scenario

PAIRS = [  # true effect, rival, noncentrality of the true one beside nothing
    ("soil-viscous-damping", "soil-inertial-drag", 45.0),
    ("soil-inertial-drag", "soil-viscous-damping", 45.0),
    ("soil-rate-hardening", "soil-stiffness", 120.0),
    ("soil-stiffness", "soil-rate-hardening", 120.0),
    ("guide-friction", "soil-viscous-damping", 12.0),
    ("soil-stiffness", "mass", 200.0),
    ("impact-speed", "soil-stiffness", 30.0),
    ("soil-layer", "soil-stiffness", 30.0),
]
CLOCK = 1e-3  # s, 1 sigma of each recording's clock


def drops(*speeds: float, rate: float = 300.0) -> list[Dataset]:
    """Planned drops of the shipped rig."""
    noise = usual_noise(scenario(), (FORCE, DEPTH, ACCELERATION))
    made = [planned(scenario(), {"initiation.speed": v}, Instruments(noise=noise, rate=rate)) for v in speeds]
    return [e for e in made if e is not None]


def chosen_rightly(
    dataset: list[Dataset],
    one: Candidate,
    x: tuple[float, ...],
    rival: Candidate,
    start: tuple[float, ...],
    count: int,
    rng: np.random.Generator,
) -> int:
    """How many of `count` campaigns are met better by the effect that is in them than by a rival, both refitted."""
    right = 0
    for _ in range(count):
        noisy, clocks = [], []
        for e in dataset:
            late = float(rng.normal(0.0, CLOCK))
            raw = e.raw(e.simulator.predict(Problem.changes([one], x), late) or {})
            assert e.nuisance is not None
            raw = raw + e.nuisance @ rng.standard_normal(e.nuisance.shape[1])
            raw = raw + np.concatenate([rng.normal(0.0, s.sigma, s.rows.size) for s in e.signals])
            noisy.append(showing(e, raw))
            clocks.append(late)
        problem = Problem(noisy)
        fits = [
            problem.fit((c,), there, rounds=14, width=2, shifts=clocks, finely=True)
            for c, there in ((one, x), (rival, start))
        ]
        assert fits[0] is not None
        assert fits[1] is not None
        right += misfit(fits[0]) < misfit(fits[1])
    return right


def misfit(fitted: Fitted) -> float:
    """What a fit leaves; samples about its own leaps, which count nothing there, by what noise leaves of each: 1."""
    return fitted.chi2 + sum(np.count_nonzero(b.residual == 0.0) for b in fitted.blocks)


def main() -> None:
    """Print promise and achievement of each pair."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--draws", type=int, default=25)
    asked.add_argument("--seed", type=int, default=4)
    given = asked.parse_args()
    count, began, dataset, kept = given.draws, clock.process_time(), drops(1.0, 3.5), 0
    promises, reached = [], 0
    known = {c.key: c for c in candidates_of(dataset, (), "drop", scenario(), size_of(scenario()))}
    tests = Tests(dataset)
    for k, (a, b, strength) in enumerate(PAIRS):
        one, rival = known[a], known[b]

        def shows(x: tuple[float, ...], one: Candidate = one) -> float:
            return tests.unexplained(one, x)

        place = point_where_it_acts(one, shows)
        x = None if place is None else strength_with(one, place, shows, strength)
        promised = None if x is None else tests.apart(one, x, rival)
        if x is None or promised is None:
            print(f"{a} through {b}: not strong enough within its range")
            continue
        right = chosen_rightly(dataset, one, x, rival, promised.x, count, np.random.default_rng([given.seed, k]))
        low, high = binomtest(right, count).proportion_ci(0.9)
        is_kept = low <= promised.probability <= high
        kept += is_kept
        promises.append(promised.probability)
        reached += right
        said = f"promised {promised.probability:.3f}, reached {right / count:.3f} ({low:.3f} to {high:.3f})"
        print(f"{a} through {b}: {said}{'' if is_kept else '  OUTSIDE'}", flush=True)
    print(f"{kept} of {len(PAIRS)} promises within their 90 % interval, {clock.process_time() - began:.0f} s of CPU")
    of = count * len(promises)
    low, high = binomtest(reached, of).proportion_ci(0.9)
    share = f"reached {reached} of {of}, {reached / of:.3f} ({low:.3f} to {high:.3f})"
    print(f"all: promised {np.mean(promises):.3f}, {share}")


if __name__ == "__main__":
    main()
