"""Channels that are derivatives of each other: gain, bias, lag and clock drift of one against the other.

With a the accelerometer's reading, v = int a, x = int v from the first sample on, and contact at t_c,

    p(t) = c_0 + c_1 t + c_2 (t - t_c)_+ + G x + b t^2/2 - lag v - drift t v                        (K1)
    u(t) = c_0 + c_2 H(t - t_c)         + G v + b t     - lag a - drift t a                         (K2)

for a position p and a speed u; c_2 takes a collision that is shorter than a sample. Least squares; the standard errors
are those of the same fit to noise drawn with each channel's own level and colour.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from rollover.prechecks.finding import SURE, Finding, Trace

Array = NDArray[np.float64]

PAIRS = (
    ("striker/position_z", "striker/acceleration_z", 2),
    ("striker/velocity_z", "striker/acceleration_z", 1),
    ("striker/position_z", "striker/velocity_z", 1),
)
DRAWS = 100
LEAST = {"gain": 0.005, "bias": 0.02, "lag": 0.0, "drift": 1e-3}  # what sampling and quadrature may do by themselves
MOST_SAMPLES = 20_000


def kinematic(traces: Mapping[str, Trace], *, seed: int = 0) -> Iterator[Finding]:
    """Findings of the first pair of channels that is there for each kind of disagreement."""
    for higher, lower, order in PAIRS:
        if higher in traces and lower in traces:
            yield from _pair(traces[higher], traces[lower], order, np.random.default_rng(seed))


def _pair(p: Trace, a: Trace, order: int, random: np.random.Generator) -> Iterator[Finding]:
    inside = (a.time >= p.time[0]) & (a.time <= p.time[-1])
    if not (p.regular and a.regular) or inside.sum() < 100 or p.floor.sigma == 0.0 or a.floor.sigma == 0.0:
        return
    if inside.sum() > MOST_SAMPLES:
        return
    time, values = a.time[inside], a.values[inside]
    if float(np.std(values)) < 10.0 * a.floor.sigma:
        return  # nothing happens
    higher = np.interp(time, p.time, p.values)
    columns = _columns(time, values, order, "trapezoid")
    fit = _solve(columns, higher)
    other = _solve(_columns(time, values, order, "left"), higher)
    spread = _drawn(columns, fit, p, a, time, order, random).std(axis=0)
    quadrature = 0.1 * np.abs(other - fit)  # the trapezoid errs by far less than this share of what the rectangle does
    unit = "m/s2" if order == 2 or "velocity" in p.channel else "m/s"
    start, end = float(time[0]), float(time[-1])
    size = float(np.abs(values).max())
    for k, (name, neutral) in enumerate((("gain", 1.0), ("bias", 0.0), ("lag", 0.0), ("drift", 0.0))):
        value, error = float(fit[k]), float(np.hypot(spread[k], quadrature[k]))
        least = {"bias": 0.002 * size, "lag": 0.5 * max(p.step, a.step)}.get(name, LEAST[name])
        if abs(value - neutral) <= max(1.2 * SURE * error, least):
            continue
        check = {"lag": "lag", "drift": "clock-drift"}.get(name, "double-integral")
        said = {
            "gain": f"{p.channel} moves {value:.4g} times as far as {a.channel} says: a gain of one of the two",
            "bias": f"the integral of {a.channel} drifts by {value:.3g} {unit} against {p.channel}: a bias",
            "lag": f"{p.channel} comes {1e3 * value:.3g} ms after {a.channel}",
            "drift": f"{p.channel} and {a.channel} run apart by {1e3 * value:.3g} ms a second: two clocks",
        }[name]
        used = {"gain": "1", "bias": unit, "lag": "s", "drift": "s/s"}[name]
        yield Finding(
            check=check, channel=p.channel, start=start, end=end, value=value, unit=used, error=error, sentence=said
        )


def _columns(time: Array, a: Array, order: int, rule: str) -> Array:
    """Right-hand sides of (K1) or (K2), (n, k): gain, bias, lag, drift first."""
    t = time - time[0]
    v = _integral(t, a, rule)
    x = _integral(t, v, rule)
    contact = float(t[int(np.argmax(np.abs(np.diff(a))))])
    late = np.maximum(t - contact, 0.0)
    ones = np.ones_like(t)
    if order == 2:
        return np.column_stack([x, 0.5 * t * t, -v, -t * v, ones, t, late])
    return np.column_stack([v, t, -a, -t * a, ones, (late > 0.0).astype(float)])


def _integral(t: Array, y: Array, rule: str) -> Array:
    steps = np.diff(t)
    area = 0.5 * (y[1:] + y[:-1]) * steps if rule == "trapezoid" else y[:-1] * steps
    return np.concatenate([[0.0], np.cumsum(area)])


def _solve(columns: Array, y: Array) -> Array:
    scale = np.linalg.norm(columns, axis=0)
    scale[scale == 0.0] = 1.0
    return np.asarray(np.linalg.lstsq(columns / scale, y, rcond=1e-9)[0] / scale)


def _drawn(
    columns: Array, fit: Array, p: Trace, a: Trace, time: Array, order: int, random: np.random.Generator
) -> Array:
    """What the noise of both channels does to the fit, to first order, in many draws (d, k)."""
    noise = a.floor.drawn(time.size, random, DRAWS)
    once = np.pad(np.cumsum(0.5 * (noise[:, 1:] + noise[:, :-1]) * np.diff(time), axis=1), ((0, 0), (1, 0)))
    twice = np.pad(np.cumsum(0.5 * (once[:, 1:] + once[:, :-1]) * np.diff(time), axis=1), ((0, 0), (1, 0)))
    t = time - time[0]
    x, v = (twice, once) if order == 2 else (once, noise)
    higher = p.floor.drawn(p.time.size, random, DRAWS)
    if p.time.size != time.size:
        higher = np.array([np.interp(time, p.time, row) for row in higher])
    left = higher - fit[0] * x + (fit[2] + fit[3] * t) * v
    scale = np.linalg.norm(columns, axis=0)
    scale[scale == 0.0] = 1.0
    return np.asarray(left @ np.linalg.pinv(columns / scale, rcond=1e-9).T / scale)
