"""What a residual force depends on, regressed on one quantity after another, and the motion of a drop as measured.

A quantity that a force is a function of predicts it in recordings that were not fitted: the share of variance it
predicts there, leaving one condition out, is its score.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rollover.recording import Recording

Array = NDArray[np.float64]
KNOTS = 7
TIME, DEPTH, SPEED, ACCELERATION = "time", "ground/sinkage", "striker/velocity_z", "striker/acceleration_z"


@dataclass(frozen=True, kw_only=True)
class ResidualForce:
    """One recording's residual force dF (n,) N while loading, with what it may depend on, by name, (n,) each."""

    recording: str
    condition: str
    force: Array
    of: dict[str, Array]


def motion(r: Recording, speed: float) -> tuple[Array, Array, Array, Array] | None:
    """Time, depth, its rate and second derivative (positive down) while loading, smoothed; None without either.

    `speed` is that just after the impact, m/s.
    """
    if "striker/acceleration_z" in r.channels:
        time, up = r.samples("striker/acceleration_z")
        if time.size < 20:
            return None
        a = -_smoothed(up, time)
        v = _from_contact(time, a, speed)
        if "ground/sinkage" in r.channels:
            z = np.interp(time, *_cleaned(r, "ground/sinkage"))
        else:
            z = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(time))])
            z = z - np.interp(0.0, time, z)
        return time, z, v, a
    name = "ground/sinkage" if "ground/sinkage" in r.channels else None
    if name is None:
        return None
    time, z = r.samples(name)
    if time.size < 20:
        return None
    z = _smoothed(z, time)
    v = np.gradient(z, time)
    return time, z, v, np.gradient(_smoothed(v, time), time)


def _cleaned(r: Recording, name: str) -> tuple[Array, Array]:
    time, values = r.samples(name)
    return time, _smoothed(values, time)


def _smoothed(values: Array, time: Array, width: float = 0.004) -> Array:
    """Savitzky-Golay of second order over some milliseconds."""
    from scipy.signal import savgol_filter

    n = max(5, 2 * round(0.5 * width / float(np.median(np.diff(time)))) + 1)
    return np.asarray(savgol_filter(values, n, 2)) if values.size > n else values


def _from_contact(time: Array, a: Array, speed: float) -> Array:
    """Velocity downward from the acceleration; just after the impact it is `speed`."""
    v = np.concatenate([[0.0], np.cumsum(0.5 * (a[1:] + a[:-1]) * np.diff(time))])
    return np.asarray(v - np.interp(0.0, time, v) + speed)


def dependency(forces: Sequence[ResidualForce]) -> list[tuple[str, float]]:
    """Quantities with the share of the residual force that they predict in conditions left out, best first."""
    if not forces:
        return []
    conditions = sorted({f.condition for f in forces})
    scores = []
    for name in [n for n in forces[0].of if all(n in f.of for f in forces)]:
        wrong, all_ = 0.0, 0.0
        for left in conditions:
            train = [f for f in forces if f.condition != left] or list(forces)
            test = [f for f in forces if f.condition == left]
            x = np.concatenate([f.of[name] for f in train])
            y = np.concatenate([f.force for f in train])
            knots = np.unique(np.quantile(x, np.linspace(0.0, 1.0, KNOTS)))
            weights = np.linalg.lstsq(hats(x, knots), y, rcond=1e-8)[0]
            for f in test:
                # beyond what was seen nothing is predicted
                seen = (f.of[name] >= knots[0]) & (f.of[name] <= knots[-1])
                miss = f.force[seen] - hats(f.of[name][seen], knots) @ weights
                wrong += float(miss @ miss) / max(int(seen.sum()), 1) * f.force.size
                all_ += float(f.force @ f.force)
        scores.append((name, 1.0 - wrong / max(all_, 1e-300)))
    return sorted(scores, key=lambda pair: -pair[1])


def hats(x: Array, knots: Array) -> Array:
    """Piecewise linear basis (n, k), constant beyond the ends."""
    return np.stack([np.interp(x, knots, row) for row in np.eye(knots.size)], axis=1)
