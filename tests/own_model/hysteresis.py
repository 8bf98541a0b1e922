"""An oscillator on a hysteretic spring, in the form of Bouc and Wen, and on others that the model does not list."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numba import njit

from rollover.recording import Recording
from tests.own_model.recorded import World, drawn_of, multisine, noisy


@njit(cache=True)
def _slopes(y, f, p):  # type: ignore[no-untyped-def]
    mass, damping, stiffness, strength, travel, cubic, drag, gap, stop, relaxing, memory = p
    x, v, w, s = y
    push = stiffness * x + cubic * x**3 + strength * w + s
    push += stop * max(x - gap, 0.0) - stop * max(-x - gap, 0.0)
    a = (f - push - damping * v - drag * v * abs(v)) / mass
    # Bouc and Wen as published: A x' - beta |x'| |w|^(n-1) w - gamma x' |w|^n, n = 1, A = 1/d, beta = gamma = 1/(2 d)
    dw = (v - 0.5 * abs(v) * w - 0.5 * v * abs(w)) / travel
    return np.array([v, a, dw, relaxing * v - s / memory])


@njit(cache=True)
def _shake(dt, force, p, parts, out):  # type: ignore[no-untyped-def]
    """Deflection (n,): classical Runge-Kutta, in so many parts."""
    y, h = np.zeros(4), dt / parts
    for i in range(force.size):
        out[i] = y[0]
        for _ in range(parts):
            k1 = _slopes(y, force[i], p)
            k2 = _slopes(y + 0.5 * h * k1, force[i], p)
            k3 = _slopes(y + 0.5 * h * k2, force[i], p)
            k4 = _slopes(y + h * k3, force[i], p)
            y = y + h * (k1 + 2.0 * k2 + 2.0 * k3 + k4) / 6.0


ORDER = ("mass", "damping", "stiffness", "hysteresis", "travel", "cubic-stiffness", "quadratic-damping", "gap", "stop")
ORDER += ("relaxing", "memory")


def hysteretic(values: Mapping[str, float], rng: np.random.Generator) -> dict[str, Recording]:
    """Four runs of 1 s at 2 kHz under a multisine from 5 to 50 Hz, each stronger than the one before."""
    found = {}
    for k, rms in enumerate((10.0, 20.0, 30.0, 40.0)):
        time, out = np.arange(2000) / 2000.0, np.empty(2000)
        force = multisine(time, rms, 5.0, 50.0, rng)
        _shake(0.0005, force, np.array([values.get(n, 0.0) for n in ORDER]), 10, out)
        outputs = {"oscillator/deflection": out}
        found[f"r{k + 1}"] = noisy(time, {"oscillator/force": force}, outputs, rng, f"Oscillator, {rms} N rms")
    return found


def hysteretic_world(kind: str, number: int, rng: np.random.Generator) -> World:
    """A resonance near 25 Hz; the hysteretic force is from a tenth to a half of the largest elastic one."""
    values = {
        "mass": 2.0 * rng.uniform(0.85, 1.15), "damping": rng.uniform(8.0, 14.0), "memory": rng.uniform(0.01, 0.03),
        "stiffness": 5e4 * rng.uniform(0.9, 1.1), "gap": rng.uniform(5e-4, 1e-3), "travel": rng.uniform(3e-4, 1.2e-3),
    }  # fmt: skip
    listed = {
        "hysteresis": rng.uniform(5.0, 25.0), "cubic-stiffness": rng.uniform(2e8, 1e9),
        "quadratic-damping": rng.uniform(20.0, 100.0),
    }  # fmt: skip
    unlisted = {"stop": rng.uniform(2e4, 6e4), "relaxing": rng.uniform(6e3, 1.5e4)}
    truth = drawn_of(kind, number, listed, unlisted)
    values |= {truth: {**listed, **unlisted}[truth]} if truth else {}
    return World(
        model="hysteretic_oscillator", kind=kind, truth=truth, values=values, recordings=hysteretic(values, rng)
    )
