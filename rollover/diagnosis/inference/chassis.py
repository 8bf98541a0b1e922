"""Which force is missing on a vehicle that turns over: the residual generalised force on its chassis.

Inverse dynamics of the difference between what the chassis' instruments read and what the run says, in body axes,
to the first order in that difference:

    dF = m (a - a_s),    dM = J d(omega - omega_s)/dt                                                          (D4)

m, J those of the chassis about its centre of mass. Each degree of freedom is weighed by its own noise and by what runs
that nobody could tell apart differ by, so that an impact that falls elsewhere is no force.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.data.dataset import Dataset, Signal
from rollover.diagnosis.result import Degree
from rollover.diagnosis.settings import SETTINGS
from rollover.scenario import Scenario
from rollover.spec.vehicle import Striker, chassis_of

Array = NDArray[np.float64]
AXES = "xyz"
ALONG, ABOUT = "chassis/acceleration_", "chassis/angular_velocity_"
TUNING = SETTINGS.inference.chassis


def misfit_by_degree_of_freedom(
    scenarios: Sequence[Scenario], dataset: Sequence[Dataset], shifts: Sequence[float]
) -> tuple[Degree, ...]:
    """Degrees of freedom of the chassis by their share of the misfit, largest first.

    Empty where no instrument sits at the chassis' centre of mass. `scenarios` are those of the recordings.
    """
    forces: dict[str, list[Array]] = {}
    worth: dict[str, float] = {}
    for scenario, e, shift in zip(scenarios, dataset, shifts, strict=True):
        predicted = e.simulator.predict({}, shift)
        if predicted is None or isinstance(scenario.vehicle, Striker):
            continue
        body = chassis_of(scenario.vehicle)
        for s in e.signals:
            axis = s.channel[-1]
            if s.channel in e.recording.sensors or s.channel[:-1] not in (ALONG, ABOUT):
                continue
            time, off = e.recording.time[s.rows], s.values - predicted[s.channel][s.rows]
            name = f"{'along' if s.channel.startswith(ALONG) else 'about'} {axis}"
            k = AXES.index(axis)
            force = body.mass * off if name.startswith("along") else body.inertia[k] * _derivative(off, time)
            forces.setdefault(name, []).append(force)
            worth[name] = worth.get(name, 0.0) + _worth(s, off)
    total = sum(worth.values())
    if total <= 0.0:
        return ()
    found = []
    for name in sorted(worth, key=lambda n: -worth[n]):
        all_ = np.concatenate(forces[name])
        unit = "N" if name.startswith("along") else "N m"
        rms = float(np.sqrt(np.mean(all_**2)))
        found.append(Degree(body="chassis", axis=name, unit=unit, rms=rms, share=worth[name] / total))
    return tuple(found)


def _worth(s: Signal, off: Array) -> float:
    """Square of the misfit over the noise, samples weighed, less that of the noise itself."""
    weight = np.ones(off.size) if s.weight is None else s.weight
    return max(float(np.sum((weight * off / s.sigma) ** 2) - np.sum(weight**2)), 0.0)


def _derivative(values: Array, time: Array) -> Array:
    """Derivative by a smoothing polynomial of second order."""
    from scipy.signal import savgol_filter

    step = float(np.median(np.diff(time)))
    n = max(5, 2 * round(0.5 * TUNING.smoothing / step) + 1)
    if values.size <= n:
        return np.asarray(np.gradient(values, time))
    return np.asarray(savgol_filter(values, n, 2, deriv=1, delta=step))
