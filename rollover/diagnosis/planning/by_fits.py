"""What a diagnosis should have measured next: by its own recordings, noise and fits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.fit.levenberg_marquardt import Fitted, Problem
from rollover.diagnosis.planning.chances import choice
from rollover.diagnosis.planning.next_test import Grid, cheapest, varied
from rollover.diagnosis.planning.planned import Instruments, planned, showing
from rollover.diagnosis.result import NextTest
from rollover.diagnosis.settings import SETTINGS
from rollover.dynamics.drop_test import unfit
from rollover.scenario import Scenario

TUNING = SETTINGS.planning


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
