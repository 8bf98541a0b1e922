"""Recordings that the example models are diagnosed by: the published equations solved anew, with other solvers.

A world is drawn by a seed: values of its parameters, and what is concealed in it, listed by the model or not. Nothing
here is taken from the models' files: equations are written out again and solved by adaptive Runge-Kutta (DOP853), those
with dry friction by short steps of their own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from rollover.recording import Recording

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class World:
    """What a case is: the model's name, kind ("single", "null", "unlisted"), the truth's id, recordings by name."""

    model: str
    kind: str
    truth: str
    values: Mapping[str, float]
    recordings: Mapping[str, Recording]


def noisy(
    time: Array, inputs: Mapping[str, Array], outputs: Mapping[str, Array], share: float, rng: np.random.Generator, title: str
) -> Recording:
    """A recording whose outputs have white noise of a share of their standard deviation."""
    read = {c: v + share * float(np.std(v)) * rng.standard_normal(v.size) for c, v in outputs.items()}
    return Recording(title=title, time=time, channels={**inputs, **read})


def multisine(time: Array, rms: float, low: float, high: float, rng: np.random.Generator) -> Array:
    """Sum of sines (n,) at all multiples of 1/T from low to high Hz, phases by chance."""
    span = float(time[-1] - time[0])
    f = np.arange(math.ceil(low * span), math.floor(high * span) + 1) / span
    made = np.cos(2.0 * np.pi * np.outer(time, f) + rng.uniform(0.0, 2.0 * np.pi, f.size)).sum(axis=1)
    return np.asarray(rms * made / np.std(made))


# ---------------------------------------------------------------- a friction-driven axis


@njit(cache=True)
def _axis(dt, aim, p, q, v, force, read):  # type: ignore[no-untyped-def]
    """Force (n,) of a controller that follows speeds `aim` (n,), position and velocity (n, 2); Euler, 400 parts."""
    mass, viscous, coulomb, offset, added, extra, slow, quadratic, stiffness, play, ripple, pitch, warming = p
    total, seen = 0.0, q
    for i in range(aim.size):
        seen = q - play if q - play > seen else (q + play if q + play < seen else seen)
        read[i, 0], read[i, 1] = seen, v
        total += dt * (aim[i] - v)
        force[i] = 900.0 * (aim[i] - v) + 3000.0 * total
        h = dt / 400
        for part in range(400):
            held = coulomb * (1.0 + warming * (i + part / 400) / aim.size) + extra * math.exp(-((v / slow) ** 2))
            rest = force[i] - offset - stiffness * q - ripple * math.sin(2.0 * math.pi * q / pitch)
            if v > 0.0:
                net = rest - (viscous + added) * v - quadratic * v * v - held
            elif v < 0.0:
                net = rest - viscous * v + quadratic * v * v + held
            else:
                net = math.copysign(max(abs(rest) - held, 0.0), rest)
            new = v + h * net / mass
            new = 0.0 if new * v < 0.0 else new  # friction stops, and does not turn round
            q += h * v
            v = new


AXIS = ("mass", "viscous", "coulomb", "offset", "direction-dependence", "stribeck", "speed", "quadratic-drag")
AXIS += ("cable-stiffness", "backlash", "ripple", "pitch", "warming")


def axis(values: Mapping[str, float], rng: np.random.Generator, noise: float) -> dict[str, Recording]:
    """Four runs of 2 s at 500 Hz: to and fro at other speeds and strokes, with a little shaking."""
    found = {}
    for k, top in enumerate((0.1, 0.2, 0.3, 0.4)):
        time = np.arange(1000) / 500.0
        period = 2.0 * rng.uniform(0.35, 0.55)
        phase = (time / period + rng.uniform(0.0, 0.2)) % 1.0
        aim = top * np.clip(6.0 * np.cos(2.0 * np.pi * phase), -1.0, 1.0) * rng.uniform(0.9, 1.1)
        aim += multisine(time, 0.05 * top, 1.0, 12.0, rng)
        force, out = np.empty(time.size), np.empty((time.size, 2))
        _axis(0.002, aim, np.array([values.get(n, 0.0) for n in AXIS]), 0.0, 0.0, force, out)
        outputs = {"axis/position": out[:, 0], "axis/velocity": out[:, 1]}
        found[f"r{k + 1}"] = noisy(time, {"axis/force": force}, outputs, noise, rng, f"Axis, {top} m/s")
    return found


def axis_world(kind: str, number: int, rng: np.random.Generator) -> World:
    """Values after EMPS, each by a tenth or two off; strengths from a few percent of the friction to half of it."""
    values = {
        "mass": 95.0 * rng.uniform(0.85, 1.15), "viscous": 203.0 * rng.uniform(0.8, 1.2),
        "coulomb": 20.0 * rng.uniform(0.8, 1.2), "offset": rng.uniform(-4.0, 4.0), "speed": rng.uniform(0.02, 0.08),
        "pitch": rng.uniform(0.01, 0.03),
    }  # fmt: skip
    sign = rng.choice([-1.0, 1.0])
    listed = {
        "direction-dependence": sign * rng.uniform(15.0, 60.0), "stribeck": rng.uniform(3.0, 12.0),
        "quadratic-drag": rng.uniform(40.0, 200.0), "cable-stiffness": rng.uniform(20.0, 120.0),
        "backlash": rng.uniform(2e-4, 1e-3),
    }  # fmt: skip
    unlisted = {"ripple": rng.uniform(3.0, 10.0), "warming": rng.uniform(-0.5, -0.25)}
    truth = drawn_of(kind, number, listed, unlisted)
    values |= {truth: {**listed, **unlisted}[truth]} if truth else {}
    return World(model="friction_axis", kind=kind, truth=truth, values=values, recordings=axis(values, rng, 0.005))


# ---------------------------------------------------------------- a Duffing oscillator


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


DUFFING = ("mass", "damping", "stiffness", "cubic-stiffness", "quadratic-stiffness", "dry-friction", "drag", "gap", "stop")


def duffing(values: Mapping[str, float], rng: np.random.Generator, noise: float) -> dict[str, Recording]:
    """Four runs of 2 s at 1 kHz under a multisine from 2 to 20 Hz, each stronger than the one before."""
    found = {}
    for k, rms in enumerate((4.0, 8.0, 12.0, 16.0)):
        time, out = np.arange(2000) / 1000.0, np.empty(2000)
        force = multisine(time, rms, 2.0, 20.0, rng)
        _shake(0.001, force, np.array([values.get(n, 0.0) for n in DUFFING]), 20, out)
        outputs = {"oscillator/deflection": out}
        found[f"r{k + 1}"] = noisy(time, {"oscillator/force": force}, outputs, noise, rng, f"Oscillator, {rms} N rms")
    return found


def duffing_world(kind: str, number: int, rng: np.random.Generator) -> World:
    """A resonance near 10 Hz, lightly damped; what is concealed moves it by some percent at the largest deflection."""
    values = {
        "mass": rng.uniform(0.85, 1.15), "damping": rng.uniform(2.5, 5.0), "stiffness": 3950.0 * rng.uniform(0.9, 1.1),
        "gap": rng.uniform(0.003, 0.006),
    }  # fmt: skip
    listed = {
        "cubic-stiffness": rng.uniform(1e6, 8e6), "quadratic-stiffness": rng.choice([-1.0, 1.0]) * rng.uniform(8e3, 3e4),
        "dry-friction": rng.uniform(0.3, 1.5),
    }  # fmt: skip
    unlisted = {"drag": rng.uniform(8.0, 25.0), "stop": rng.uniform(2e3, 6e3)}
    truth = drawn_of(kind, number, listed, unlisted)
    values |= {truth: {**listed, **unlisted}[truth]} if truth else {}
    return World(model="duffing", kind=kind, truth=truth, values=values, recordings=duffing(values, rng, 0.005))


# ---------------------------------------------------------------- cases

KINDS = (*["single"] * 12, *["null"] * 4, *["unlisted"] * 4)
WORLDS: dict[str, Callable[[str, int, np.random.Generator], World]] = {
    "friction_axis": axis_world, "duffing": duffing_world
}  # fmt: skip


def drawn_of(kind: str, number: int, listed: Mapping[str, float], unlisted: Mapping[str, float]) -> str:
    """Which is concealed: one after another of those of a kind; nothing in a null."""
    among = list(listed if kind == "single" else unlisted)
    return "" if kind == "null" else among[number % len(among)]


def drawn(model: str, seed: int, case: int) -> World:
    """The case of a seed, of 20 that differ: 12 with one listed effect, 4 without any, 4 with one that is not listed."""
    rng = np.random.default_rng([seed, case, sum(map(ord, model))])
    return WORLDS[model](KINDS[case], case, rng)
