"""Digits so coarse that a channel does not show what was measured: no model is wrong, and none makes up for it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.data.phases import whole
from rollover.diagnosis.result import Place
from rollover.diagnosis.settings import SETTINGS
from rollover.effects import spoken
from rollover.spec.channels import describe

Array = NDArray[np.float64]
TUNING = SETTINGS.inference.coarse_sampling


def coarse(dataset: Sequence[Dataset], phases: Sequence[Sequence[tuple[float, str]]]) -> tuple[Place, ...]:
    """Where channels are recorded in steps of more than `least_step` of their range and more than their noise."""
    values: dict[str, list[Array]] = {}
    for s in (s for e in dataset for s in e.signals):
        values.setdefault(s.channel, []).append(s.values)
    least = {channel: TUNING.least_step * float(np.ptp(np.concatenate(v))) for channel, v in values.items()}
    rough = [(r, e, s) for r, e in enumerate(dataset) for s in e.signals if s.step > least[s.channel]]
    return tuple(whole(e, s, phases[r], 1.0 / len(rough)) for r, e, s in rough)


def digit_sentence(places: Sequence[Place], dataset: Sequence[Dataset]) -> str:
    """The sentence on what digits make of recordings."""
    steps = {s.channel: s.step for e in dataset for s in e.signals if s.channel in {p.channel for p in places}}
    said = " and ".join(f"{c} in steps of {spoken(step)} {describe(c).unit}" for c, step in steps.items())
    return (
        f"Recorded is {said}, far more than the noise: what was measured and what was recorded differ by half of that, "
        "which no candidate can explain."
    )
