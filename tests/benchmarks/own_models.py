"""The example models held against sealed recordings: is what is concealed in the answer, is anything named wrongly?

    python -m tests.benchmarks.own_models [--seed 1] [--models friction_axis duffing ...] [--cases 0-19]

Each model has 20 cases a seed: 12 with one of its terms, 4 with nothing, 4 with something that it does not list. A
line for each case, then for each model the count of singles with the truth in the set (named, or said to be not
distinguishable), of nulls and unlisted ones in which nothing is named, and of false names.
"""

from __future__ import annotations

import argparse
import time as clock
from collections.abc import Sequence
from dataclasses import dataclass

from rollover.diagnosis import Diagnosis
from rollover.diagnosis.own_model import diagnose_model, load_model
from rollover.diagnosis.own_model.declaration import found_at
from tests.own_model.recorded import World
from tests.own_model.worlds import KINDS, WORLDS, drawn


@dataclass(frozen=True, kw_only=True)
class Scored:
    """One case: whether the truth is in the set (of nothing and unlisted: whether nothing is named), a false name."""

    world: World
    found: Diagnosis
    seconds: float

    @property
    def names(self) -> set[str]:
        """What was named, and what was said to be as good."""
        return {n for e in self.found.effects for n in (e.id, *e.indistinguishable_from)}

    @property
    def is_right(self) -> bool:
        """Whether the answer holds the truth: that, or no name."""
        return self.world.truth in self.names if self.world.kind == "single" else not self.names

    @property
    def is_false(self) -> bool:
        """Whether anything was named that is not there, and the truth not beside it."""
        return bool(self.names) and not self.is_right

    def line(self, case: int) -> str:
        """The case in a line."""
        said = ", ".join("/".join([e.id, *e.indistinguishable_from]) for e in self.found.effects) or "-"
        mark = "ok" if self.is_right else "FALSE" if self.is_false else "missed"
        return (
            f"{self.world.model:14s} {case:2d} {self.world.kind:8s} {self.world.truth or '-':22s} "
            f"{self.found.verdict:16s} {said:40s} {mark:6s} {self.seconds:5.1f} s"
        )


def scored(model: str, seed: int, case: int) -> Scored:
    """One case drawn, diagnosed and scored."""
    world = drawn(model, seed, case)
    began = clock.perf_counter()
    found = diagnose_model(load_model(found_at(model)), world.recordings)
    return Scored(world=world, found=found, seconds=clock.perf_counter() - began)


def counted(model: str, every: Sequence[Scored]) -> str:
    """The counts of a model's cases."""
    parts = []
    for kind in dict.fromkeys(KINDS):
        own = [s for s in every if s.world.kind == kind]
        parts.append(f"{kind} {sum(s.is_right for s in own)} of {len(own)}")
    false = sum(s.is_false for s in every)
    return f"{model}: {', '.join(parts)}; false names {false} of {len(every)}"


def main() -> None:
    """Draw, diagnose, count."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--seed", type=int, default=1)
    asked.add_argument("--models", nargs="+", default=list(WORLDS), choices=list(WORLDS))
    asked.add_argument("--cases", default=f"0-{len(KINDS) - 1}")
    given = asked.parse_args()
    first, _, last = given.cases.partition("-")
    told = []
    for model in given.models:
        every = []
        for case in range(int(first), int(last or first) + 1):
            every.append(scored(model, given.seed, case))
            print(every[-1].line(case), flush=True)
        told.append(counted(model, every))
    print("\n".join(told))


if __name__ == "__main__":
    main()
