"""Recordings of the worlds that the example models are diagnosed by: what they are made with."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rollover.recording import Recording

Array = NDArray[np.float64]
NOISE = 0.005


@dataclass(frozen=True, kw_only=True)
class World:
    """What a case is: the model's name, kind ("single", "null", "unlisted"), the truth's id, recordings by name."""

    model: str
    kind: str
    truth: str
    values: Mapping[str, float]
    recordings: Mapping[str, Recording]


def noisy(
    time: Array,
    inputs: Mapping[str, Array],
    outputs: Mapping[str, Array],
    rng: np.random.Generator,
    title: str,
    conditions: Mapping[str, float] | None = None,
) -> Recording:
    """A recording whose outputs have white noise of half a percent of their standard deviation."""
    read = {c: v + NOISE * float(np.std(v)) * rng.standard_normal(v.size) for c, v in outputs.items()}
    return Recording(title=title, time=time, channels={**inputs, **read}, conditions=conditions or {})


def multisine(time: Array, rms: float, low: float, high: float, rng: np.random.Generator) -> Array:
    """Sum of sines (n,) at all multiples of 1/T from low to high Hz, phases by chance."""
    span = float(time[-1] - time[0])
    f = np.arange(math.ceil(low * span), math.floor(high * span) + 1) / span
    made = np.cos(2.0 * np.pi * np.outer(time, f) + rng.uniform(0.0, 2.0 * np.pi, f.size)).sum(axis=1)
    return np.asarray(rms * made / np.std(made))


def drawn_of(kind: str, number: int, listed: Mapping[str, float], unlisted: Mapping[str, float]) -> str:
    """Which is concealed: one after another of those of a kind; nothing in a null."""
    among = list(listed if kind == "single" else unlisted)
    return "" if kind == "null" else among[number % len(among)]
