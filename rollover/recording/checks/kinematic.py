"""Channels that are derivatives of each other: gain, bias, lag and clock drift of one against the other.

With a the accelerometer's reading, v = int a, x = int v from the first sample on, and contact at t_c,

    p(t) - x = c_0 + c_1 t + c_2 (t - t_c)_+ + { (G - 1) x | b t^2/2 | -lag v | -drift t v }        (K1)
    u(t) - v = c_0 + c_2 H(t - t_c)          + { (G - 1) v | b t     | -lag a | -drift t a }        (K2)

for a position p and a speed u; c_2 takes a collision that is shorter than a sample. The four are tried one at a time:
the one that leaves the others nothing to explain is found, and those that would do as well are named. Standard errors
are those of the same fit to noise drawn with each channel's own level and autocorrelation.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from rollover.recording.checks.finding import SURE, Finding, Trace

Array = NDArray[np.float64]

PAIRS = (
    ("striker/position_z", "striker/acceleration_z", 2),
    ("striker/velocity_z", "striker/acceleration_z", 1),
    ("striker/position_z", "striker/velocity_z", 1),
)
DRAWS = 50
LEAST = {"gain": 0.005, "bias": 0.02, "lag": 0.0, "drift": 1e-3}  # what sampling and quadrature may do by themselves
MOST_SAMPLES = 20_000
INSTANTS = 100  # at which a collision is looked for at first


def disagreements(traces: Mapping[str, Trace], *, seed: int = 0) -> Iterator[Finding]:
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
    effects, always = _columns(time, values, order)
    left = higher - effects["gain"]
    collision = _collision(time, np.column_stack([always, *effects.values()]), left, order)
    nuisance = np.column_stack([always, collision])
    noise = _noise(p, a, time, order, random)
    unit = "m/s2" if order == 2 or "velocity" in p.channel else "m/s"
    size = float(np.abs(values).max())
    least = {**LEAST, "bias": 0.002 * size, "lag": 0.5 * max(p.step, a.step)}
    for _ in range(2):
        z = _scores(effects, nuisance, left, noise)
        if max(abs(value) / error for value, error in z.values()) < 1.4 * SURE:
            return
        after = {name: _after(name, effects, nuisance, left, noise) for name in z}
        chosen = min(after, key=lambda name: after[name])
        value, error = z[chosen]
        if abs(value) < least[chosen]:
            return
        as_well = [name for name in after if name != chosen and after[name] < max(SURE, 1.5 * after[chosen])]
        yield _finding(chosen, value, error, as_well, p, a, unit, time)
        nuisance = np.column_stack([nuisance, effects.pop(chosen)])


def _finding(
    name: str, value: float, error: float, as_well: list[str], p: Trace, a: Trace, unit: str, time: Array
) -> Finding:
    said = {
        "gain": f"{p.channel} moves {1.0 + value:.4g} times as far as {a.channel} implies: a gain or unit error",
        "bias": f"the integral of {a.channel} drifts by {value:.3g} {unit} against {p.channel}: a zero offset",
        "lag": f"{p.channel} comes {1e3 * value:.3g} ms after {a.channel}: a delay, of a filter or a trigger",
        "drift": f"{p.channel} and {a.channel} run apart by {1e3 * value:.3g} ms a second: a time-base error",
    }[name]
    return Finding(
        check={"lag": "lag", "drift": "clock-drift"}.get(name, "double-integral"),
        channel=p.channel,
        start=float(time[0]),
        end=float(time[-1]),
        value=value,
        unit={"gain": "1", "bias": unit, "lag": "s", "drift": "s/s"}[name],
        error=error,
        sentence=said + (f" ({' or '.join(as_well)} would explain it as well)" if as_well else ""),
    )


def _scores(effects: Mapping[str, Array], nuisance: Array, left: Array, noise: Array) -> dict[str, tuple[float, float]]:
    """Value and standard error of each effect, alone beside the nuisances."""
    Q, _ = np.linalg.qr(nuisance / np.linalg.norm(nuisance, axis=0))
    found = {}
    for name, column in effects.items():
        e = column - Q @ (Q.T @ column)
        if e @ e < 1e-12 * (column @ column):
            continue
        found[name] = (float(e @ left / (e @ e)), float(np.std(noise @ e / (e @ e))))
    return found


def _after(name: str, effects: Mapping[str, Array], nuisance: Array, left: Array, noise: Array) -> float:
    """How sure the surest of the other effects still is once this one has been taken out."""
    others = {other: column for other, column in effects.items() if other != name}
    rest = _scores(others, np.column_stack([nuisance, effects[name]]), left, noise)
    return max((abs(value) / error for value, error in rest.values()), default=0.0)


def _columns(time: Array, a: Array, order: int) -> tuple[dict[str, Array], Array]:
    """Right-hand sides of (K1) or (K2): each effect, (n,), and what is always fitted, (n, k)."""
    t = time - time[0]
    v = _integral(t, a)
    ones = np.ones_like(t)
    if order == 2:
        x = _integral(t, v)
        return {"gain": x, "bias": 0.5 * t * t, "lag": -v, "drift": -t * v}, np.column_stack([ones, t])
    return {"gain": v, "bias": t, "lag": -a, "drift": -t * a}, ones[:, None]


def _collision(time: Array, columns: Array, left: Array, order: int) -> Array:
    """What a collision at the instant that explains most beside all `columns` (n, k) adds, (n,): c_2's in (K1), (K2).

    The largest jump of an acceleration may as well be its noise, or the way back of the ground.
    """
    Q, _ = np.linalg.qr(columns / np.linalg.norm(columns, axis=0))
    rest = left - Q @ (Q.T @ left)

    def kink(k: int) -> Array:
        late = np.maximum(time - time[k], 0.0)
        return np.asarray(late if order == 2 else (late > 0.0).astype(float))

    def gain(k: int) -> float:
        e = kink(k) - Q @ (Q.T @ kink(k))
        return float((e @ rest) ** 2 / max(float(e @ e), 1e-300))

    step = max(1, time.size // INSTANTS)
    near = max(range(step, time.size - step, step), key=gain)
    while step > 1:
        step = max(1, step // 4)
        near = max(range(max(1, near - 4 * step), min(time.size - 1, near + 4 * step + 1), step), key=gain)
    return kink(near)


def _integral(t: Array, y: Array) -> Array:
    """Integral along the last axis from the first sample on, by the trapezoid."""
    area = 0.5 * (y[..., 1:] + y[..., :-1]) * np.diff(t)
    return np.concatenate([np.zeros((*y.shape[:-1], 1)), np.cumsum(area, axis=-1)], axis=-1)


def _noise(p: Trace, a: Trace, time: Array, order: int, random: np.random.Generator) -> Array:
    """What the noise of both channels makes of the left-hand side, in many draws (d, n)."""
    integral = a.floor.drawn(time.size, random, DRAWS)
    for _ in range(order):
        integral = _integral(time, integral)
    higher = p.floor.drawn(p.time.size, random, DRAWS)
    if p.time.size != time.size:
        higher = np.array([np.interp(time, p.time, row) for row in higher])
    return np.asarray(higher - integral)
