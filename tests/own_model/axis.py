"""An axis driven by a motor: friction in forms that the model lists, and in others; short steps of their own."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numba import njit

from rollover.recording import Recording
from tests.own_model.recorded import World, drawn_of, multisine, noisy


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


def axis(values: Mapping[str, float], rng: np.random.Generator) -> dict[str, Recording]:
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
        found[f"r{k + 1}"] = noisy(time, {"axis/force": force}, outputs, rng, f"Axis, {top} m/s")
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
    return World(model="friction_axis", kind=kind, truth=truth, values=values, recordings=axis(values, rng))
