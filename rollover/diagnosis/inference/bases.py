"""Quantities that a misfit may depend on, functions of them, and the motion of a drop as measured."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rollover.recording import Recording

Array = NDArray[np.float64]
TIME, DEPTH, SPEED, ACCELERATION = "time", "ground/sinkage", "striker/velocity_z", "striker/acceleration_z"


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


def linear_b_splines(x: Array, knots: Array) -> Array:
    """Piecewise linear basis (n, k), constant beyond the ends."""
    return np.stack([np.interp(x, knots, row) for row in np.eye(knots.size)], axis=1)
