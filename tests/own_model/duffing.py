"""An oscillator that a multisine shakes: stiffness and damping in forms that the model lists, and in others."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numba import njit

from rollover.recording import Recording
from tests.own_model.recorded import World, drawn_of, multisine, noisy


@njit(cache=True)
def _bend(x, v, f, p):  # type: ignore[no-untyped-def]
    mass, damping, stiffness, cubic, square, dry, drag, gap, extra = p
    pull = stiffness * x + cubic * x * x * x + square * x * x
    if abs(x) > gap:
        pull += extra * (x - math.copysign(gap, x))
    resist = damping * v + drag * v * abs(v)
    if dry > 0.0:
        resist += dry * math.tanh(v / 1e-3)
    return (f - pull - resist) / mass


@njit(cache=True)
def _shake(dt, force, p, parts, out):  # type: ignore[no-untyped-def]
    """Deflection (n,): implicit midpoint rule by fixed-point iteration, in so many parts."""
    x, v = 0.0, 0.0
    h = dt / parts
    for i in range(force.size):
        out[i] = x
        for _ in range(parts):
            a = _bend(x, v, force[i], p)
            for _ in range(8):
                middle_v = v + 0.5 * h * a
                a = _bend(x + 0.5 * h * middle_v, middle_v, force[i], p)
            x += h * (v + 0.5 * h * a)
            v += h * a


DUFFING = ("mass", "damping", "stiffness", "cubic-stiffness", "quadratic-stiffness", "dry-friction")
DUFFING += ("drag", "gap", "stop")


def duffing(values: Mapping[str, float], rng: np.random.Generator) -> dict[str, Recording]:
    """Four runs of 2 s at 1 kHz under a multisine from 2 to 20 Hz, each stronger than the one before."""
    found = {}
    for k, rms in enumerate((4.0, 8.0, 12.0, 16.0)):
        time, out = np.arange(2000) / 1000.0, np.empty(2000)
        force = multisine(time, rms, 2.0, 20.0, rng)
        _shake(0.001, force, np.array([values.get(n, 0.0) for n in DUFFING]), 20, out)
        outputs = {"oscillator/deflection": out}
        found[f"r{k + 1}"] = noisy(time, {"oscillator/force": force}, outputs, rng, f"Oscillator, {rms} N rms")
    return found


def duffing_world(kind: str, number: int, rng: np.random.Generator) -> World:
    """A resonance near 10 Hz, lightly damped; what is concealed moves it by some percent at the largest deflection."""
    values = {
        "mass": rng.uniform(0.85, 1.15), "damping": rng.uniform(2.5, 5.0), "stiffness": 3950.0 * rng.uniform(0.9, 1.1),
        "gap": rng.uniform(0.003, 0.006),
    }  # fmt: skip
    listed = {
        "cubic-stiffness": rng.uniform(1e6, 8e6), "dry-friction": rng.uniform(0.3, 1.5),
        "quadratic-stiffness": rng.choice([-1.0, 1.0]) * rng.uniform(8e3, 3e4),
    }  # fmt: skip
    unlisted = {"drag": rng.uniform(8.0, 25.0), "stop": rng.uniform(2e3, 6e3)}
    truth = drawn_of(kind, number, listed, unlisted)
    values |= {truth: {**listed, **unlisted}[truth]} if truth else {}
    return World(model="duffing", kind=kind, truth=truth, values=values, recordings=duffing(values, rng))
