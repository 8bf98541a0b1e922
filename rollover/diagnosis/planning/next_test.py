"""The cheapest test that tells two effects apart: by a plan alone, or by two fits to recordings at hand.

Conditions are varied first, then one sensor is added, then the rate is raised.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted
from rollover.diagnosis.fit.parameterisation import Candidate
from rollover.diagnosis.planning.choosing import choice
from rollover.diagnosis.planning.planned import Instruments, planned, showing
from rollover.diagnosis.planning.separation import Tests
from rollover.diagnosis.result import NextTest
from rollover.diagnosis.settings import SETTINGS
from rollover.dynamics.drop_test import COLUMNS, unfit
from rollover.effects import EFFECTS
from rollover.scenario import Scenario
from rollover.spec.document import paths, value_at
from rollover.spec.initiation import Release
from rollover.system.errors import InputError

TUNING = SETTINGS.planning
Placed = tuple[Candidate, tuple[float, ...]]


@dataclass(frozen=True, kw_only=True)
class Advice:
    """A pair, how surely the planned tests tell it apart, the cheapest test that does, and all that were looked at.

    `best` is the one that does best where none is sure enough; None where nothing is needed. `known` is the fixed
    advice that goes with the pair, if there is one.
    """

    effects: tuple[str, str]
    probability: float
    best: NextTest | None
    is_enough: bool
    tried: tuple[NextTest, ...]
    known: str

    def message(self) -> str:
        """The sentence."""
        one, other = self.effects
        now = f"{one} and {other}: told apart with {self.probability:.0%}"
        if self.best is None:
            return f"{now} as planned."
        seldom = "" if self.is_enough else "; no single test that was looked at is sure to"
        return f"{now} as planned; beside it {self.best.message()}{seldom}."


@dataclass(frozen=True, kw_only=True)
class Grid:
    """What may be tested beside what is planned: the scenario with another value at `path`, these instruments."""

    scenario: Scenario
    dataset: tuple[Dataset, ...]
    instruments: Instruments
    path: str

    def values(self) -> list[float]:
        """Values of the condition, the gentlest first; those that the scenario does not admit are left out."""
        now = float(value_at(self.scenario, self.path))
        found = []
        for value in sorted({float(f"{ratio * now:.2g}") for ratio in TUNING.ratios}):
            try:
                self.scenario.replaced({self.path: value}, origin="plan")
            except InputError:
                continue
            found.append(value)
        return found

    def test(self, value: float, channels: tuple[str, ...], rate: float, probability: float) -> NextTest:
        """A test at another value."""
        unit = next(leaf.unit for leaf in paths(self.scenario) if leaf.path == self.path)
        return NextTest(path=self.path, value=value, unit=unit, channels=channels, rate=rate, probability=probability)

    def levels(self) -> Iterator[list[Instruments]]:
        """Instruments, the cheapest first: those that are planned, these with one channel more, these faster."""
        own = self.instruments
        yield [own]
        full = planned(self.scenario, {}, replace(own, noise=dict.fromkeys(COLUMNS, 1.0), gain=0.0))
        spans = {} if full is None else {s.channel: s.span for s in full.signals}
        more = {c: TUNING.noise * span for c, span in spans.items() if c not in own.noise}
        yield [replace(own, noise={**own.noise, c: sigma}) for c, sigma in more.items()]
        yield [replace(own, rate=TUNING.faster * own.rate)]


def varied(scenario: Scenario) -> str:
    """Path of the value by which a drop is made harder: its speed at contact, or the height it is let go at."""
    return "initiation.height" if isinstance(scenario.initiation, Release) else "initiation.speed"


def cheapest(tried: Sequence[NextTest]) -> NextTest | None:
    """The gentlest test that is sure enough, else the surest; None of none."""
    sure = [t for t in tried if t.probability >= TUNING.distinguishable]
    return min(sure, key=lambda t: t.value) if sure else max(tried, key=lambda t: t.probability, default=None)


def advice(grid: Grid, one: Placed, other: Placed, probability: float) -> Advice:
    """What to measure beside the planned tests so that two effects, at their places, are told apart."""
    a, b = one[0], other[0]
    known = EFFECTS[a.id].rivals.get(b.id) or EFFECTS[b.id].rivals.get(a.id) or ""
    tried: list[NextTest] = []
    if probability >= TUNING.distinguishable:
        return _advice((a.key, b.key), probability, None, tried, known)
    for level in grid.levels():
        for instruments in level:
            for value in grid.values():
                extra = planned(grid.scenario, {grid.path: value}, instruments)
                if extra is None:
                    continue
                chance = chance_of([*grid.dataset, extra], one, other)
                channels = tuple(instruments.noise)
                tried.append(grid.test(value, channels, instruments.rate, chance))
        best = cheapest(tried)
        if best is not None and best.probability >= TUNING.distinguishable:
            break
    return _advice((a.key, b.key), probability, cheapest(tried), tried, known)


def chance_of(dataset: Sequence[Dataset], one: Placed, other: Placed) -> float:
    """Probability that recordings choose the right one of two effects that are as likely to be the true one."""
    tests = Tests(dataset)
    found = [tests.apart(*one, other[0]), tests.apart(*other, one[0])]
    known = [f.probability for f in found if f is not None]
    return sum(known) / len(known) if known else 0.5


def _advice(
    effects: tuple[str, str], probability: float, best: NextTest | None, tried: Sequence[NextTest], known: Any
) -> Advice:
    is_enough = max(probability, 0.0 if best is None else best.probability) >= TUNING.distinguishable
    return Advice(
        effects=effects, probability=probability, best=best, is_enough=is_enough, tried=tuple(tried), known=known
    )


def next_test(scenario: Scenario, dataset: Sequence[Dataset], one: Fitted, other: Fitted) -> NextTest | None:
    """The gentlest drop that would choose between two fits to the same recordings, else the surest; None of no drop.

    What it adds is the misfit that one leaves, refitted to the recordings and to what the other foretells of the drop.
    """
    if unfit(scenario):
        return None
    path = varied(scenario)
    instruments, conditions = _as_recorded(dataset), dict(dataset[0].recording.conditions)
    grid = Grid(scenario=scenario, dataset=tuple(dataset), instruments=instruments, path=path)
    alone = {id(f): _refitted(dataset, f) for f in (one, other)}
    tried = []
    for value in grid.values():
        extra = planned(scenario, {**conditions, path: value}, instruments)
        if extra is None:
            continue
        chances = []
        for truth, rival in ((one, other), (other, one)):
            predicted = Problem([extra]).predicted_with_jumps(0, truth.candidates, truth.x, 0.0)
            before = alone[id(rival)]
            after = None if predicted is None else _refitted([*dataset, showing(extra, predicted)], rival)
            if before is not None and after is not None:
                chances.append(choice(max(after - before, 0.0)))
        if len(chances) == 2:
            tried.append(grid.test(value, tuple(instruments.noise), instruments.rate, sum(chances) / 2.0))
    return cheapest(tried)


def _refitted(dataset: Sequence[Dataset], fitted: Fitted) -> float | None:
    """What the effects of a fit leave of recordings, the first of them those it was made to."""
    shifts = [b.shift for b in fitted.blocks]
    shifts += [0.0] * (len(dataset) - len(shifts))
    found = Problem(dataset).fit(fitted.candidates, fitted.x, rounds=TUNING.rounds, shifts=shifts, width=1)
    return None if found is None else found.total


def _as_recorded(dataset: Sequence[Dataset]) -> Instruments:
    """Instruments as those of the recordings, the middle ones: noise of each channel, rate, what the model misses."""
    noise: dict[str, list[float]] = {}
    misses: list[float] = []
    for e in dataset:
        for s in e.signals:
            noise.setdefault(s.channel, []).append(s.noise * float(np.sqrt(e.averaged)))
            misses.append(np.sqrt(max(e.model_error_of(s) ** 2 - SETTINGS.data.dataset.model_error**2, 0.0)))
    steps = [float(np.median(np.diff(e.recording.time))) / e.averaged for e in dataset]
    middle: Mapping[str, Any] = {channel: float(np.median(each)) for channel, each in noise.items()}
    rate = float(f"{1.0 / float(np.median(steps)):.4g}")
    return Instruments(noise=middle, rate=rate, tolerance=float(np.median(misses)), gain=0.0)
