"""What `rollover plan` promises against what is reached: noise, clocks, gains drawn anew; the smaller misfit chooses.

`python -m tests.benchmarks.promises [--draws 25] [--seed 4 ...] [--pairs 0 1 ...]`: for each of 16 pairs so many
campaigns of one to three drops, by each seed. Held against each promise is the 90 % interval of Clopper and Pearson: an
exact promise is in nine times of ten. The last line holds all campaigns against the mean of all promises.
"""

from __future__ import annotations

import argparse
import time as clock
from collections.abc import Sequence
from dataclasses import dataclass

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

SLOW_AND_FAST, BETWEEN = (1.0, 3.5), (2.0, 3.0)
PAIRS = [  # speeds of the drops (m/s), true effect, rival, noncentrality of the true one beside nothing
    (SLOW_AND_FAST, "soil-viscous-damping", "soil-inertial-drag", 45.0),
    (SLOW_AND_FAST, "soil-inertial-drag", "soil-viscous-damping", 45.0),
    (SLOW_AND_FAST, "soil-rate-hardening", "soil-stiffness", 120.0),
    (SLOW_AND_FAST, "soil-stiffness", "soil-rate-hardening", 120.0),
    (SLOW_AND_FAST, "guide-friction", "soil-viscous-damping", 12.0),
    (SLOW_AND_FAST, "soil-stiffness", "mass", 200.0),
    (SLOW_AND_FAST, "impact-speed", "soil-stiffness", 30.0),
    (SLOW_AND_FAST, "soil-layer", "soil-stiffness", 30.0),
    (BETWEEN, "mass", "impact-speed", 60.0),
    (BETWEEN, "impact-speed", "mass", 60.0),
    (BETWEEN, "guide-friction", "air-drag", 15.0),
    (BETWEEN, "air-drag", "guide-friction", 15.0),
    (BETWEEN, "soil-stiffness", "soil-crust", 15.0),
    (BETWEEN, "soil-stiffness", "soil-layer", 60.0),
    ((3.0,), "soil-layer", "soil-crust", 15.0),
    ((1.0, 2.0, 3.5), "soil-inertial-drag", "soil-rate-hardening", 15.0),
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
        right += fitted(problem, one, x, clocks) < fitted(problem, rival, start, clocks)
    return right


def fitted(problem: Problem, c: Candidate, start: tuple[float, ...], clocks: Sequence[float]) -> float:
    """The least misfit of an effect from a start; of several numbers also from the best two of its own starts.

    Noise moves a depth and a stiffness along a curved valley, further than a fit from the expected place follows.
    """
    starts = [start]
    if len(c.search) > 1:
        short = [problem.fit((c,), s, rounds=3, shifts=clocks) for s in (*c.starts()[::4], *c.scan_points()[::2])]
        starts += [f.x for f in sorted((f for f in short if f is not None), key=misfit)[:2]]
    ended = [problem.fit((c,), s, rounds=14, width=2, shifts=clocks, finely=True) for s in starts]
    return min(misfit(f) for f in ended if f is not None)


def misfit(fitted: Fitted) -> float:
    """What a fit would leave of other recordings: two more for each fitted number than of its own (Akaike 1974).

    Samples about its own jumps, which count nothing there, by what noise leaves of each: 1.
    """
    held_out = sum(np.count_nonzero(b.residual == 0.0) for b in fitted.blocks)
    return fitted.chi2 + held_out + 2.0 * len(fitted.x)


@dataclass(frozen=True, kw_only=True)
class Held:
    """A promise, and how many of `count` campaigns were chosen rightly."""

    name: str
    promised: float
    right: int
    count: int

    @property
    def interval(self) -> tuple[float, float]:
        """Of 90 %, of Clopper and Pearson."""
        low, high = binomtest(self.right, self.count).proportion_ci(0.9)
        return float(low), float(high)

    @property
    def is_kept(self) -> bool:
        """Whether the promise lies within it."""
        low, high = self.interval
        return low <= self.promised <= high

    def line(self) -> str:
        """The promise beside what was reached."""
        low, high = self.interval
        reached = f"reached {self.right / self.count:.3f} ({low:.3f} to {high:.3f})"
        return f"{self.name}: promised {self.promised:.3f}, {reached}{'' if self.is_kept else '  OUTSIDE'}"


def held(pairs: Sequence[int], count: int, seeds: Sequence[int]) -> list[Held]:
    """Promise and achievement of some of `PAIRS`, by each seed."""
    found, made = [], {}
    for k in pairs:
        speeds, a, b, strength = PAIRS[k]
        dataset, tests = made.setdefault(speeds, (d := drops(*speeds), Tests(d)))
        known = {c.key: c for c in candidates_of(dataset, (), "drop", scenario(), size_of(scenario()))}
        one, rival = known[a], known[b]

        def shows(x: tuple[float, ...], one: Candidate = one, tests: Tests = tests) -> float:
            return tests.unexplained(one, x)

        place = point_where_it_acts(one, shows)
        x = None if place is None else strength_with(one, place, shows, strength)
        promised = None if x is None else tests.apart(one, x, rival)
        if x is None or promised is None:
            print(f"{a} through {b}: not strong enough within its range")
            continue
        for seed in seeds:
            right = chosen_rightly(dataset, one, x, rival, promised.x, count, np.random.default_rng([seed, k]))
            name = f"{seed} {', '.join(f'{v:g}' for v in speeds)} m/s, {a} through {b}"
            found.append(Held(name=name, promised=promised.probability, right=right, count=count))
            print(found[-1].line(), flush=True)
    return found


def main() -> None:
    """Print promise and achievement of each pair."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--draws", type=int, default=25)
    asked.add_argument("--seed", type=int, nargs="+", default=[4])
    asked.add_argument("--pairs", type=int, nargs="+", default=list(range(len(PAIRS))))
    given = asked.parse_args()
    began = clock.process_time()
    found = held(given.pairs, given.draws, given.seed)
    kept, reached, of = sum(h.is_kept for h in found), sum(h.right for h in found), sum(h.count for h in found)
    print(f"{kept} of {len(found)} promises within their 90 % interval, {clock.process_time() - began:.0f} s of CPU")
    low, high = binomtest(reached, of).proportion_ci(0.9)
    share = f"reached {reached} of {of}, {reached / of:.3f} ({low:.3f} to {high:.3f})"
    print(f"all: promised {np.mean([h.promised for h in found]):.3f}, {share}")


if __name__ == "__main__":
    main()
