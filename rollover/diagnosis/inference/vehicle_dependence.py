"""What the misfit of a vehicle's motion depends on: one channel, regressed on one quantity of the motion after another.

What is missing moves all that comes after it, and after an impact chance does: so it is the whitened misfit w of the
chassis' channel that misses most that is explained, samples for what they count in the fit, by a function of a quantity
q common to all recordings, piecewise linear. Of a rate of turn also what has grown with it, integral f(q) dt: a moment
that acts. A quantity's share is what its function, fitted to all other conditions, takes from the excess of w'w over
the noise where that condition is left out; a second one has what it adds to the first.

The missing force is found by inverse dynamics of the difference between what the chassis' instruments read and what
the run says, in body axes, to the first order in that difference:

    dF = m (a - a_s),    dM = J d(omega - omega_s)/dt                                                          (D4)

m, J those of the chassis about its centre of mass. Each degree of freedom is weighed by its own noise and by the
scatter of the ensemble, so that an impact that falls elsewhere is no force.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.data.dataset import Dataset, Signal
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted
from rollover.diagnosis.inference.bases import TIME, linear_b_splines
from rollover.diagnosis.result import Degree
from rollover.diagnosis.settings import SETTINGS
from rollover.scenario import Scenario
from rollover.spec.vehicle import Striker, chassis_of

Array = NDArray[np.float64]
AXES = "xyz"
ALONG, ABOUT = "chassis/acceleration_", "chassis/angular_velocity_"
STATE = ("chassis/roll", "chassis/pitch", "chassis/velocity_y", "chassis/velocity_z", "chassis/angular_velocity_x")
FURTHER = ("ground/sinkage", "axle/front/angle")  # where there is ground to sink into, and an axle
TUNING = SETTINGS.inference.vehicle_dependence
CHASSIS = SETTINGS.inference.chassis


@dataclass(frozen=True, kw_only=True)
class Seen:
    """One recording of a channel: whitened misfit (n,), quantities (n,) by name, its condition, what noise leaves."""

    recording: int
    condition: str
    part: slice
    misfit: Array
    of: dict[str, Array]
    noise: float


def dependency(problem: Problem, base: Fitted) -> tuple[tuple[str, float], ...]:
    """Quantities with their shares, which add up to at most 1, the first the one that predicts most; () if none does.

    Empty where no instrument sits at the chassis' centre of mass, or where it misses by no more than noise does.
    """
    channels = [f"{stem}{axis}" for stem in (ALONG, ABOUT) for axis in "xyz"]
    every = {channel: _seen(problem, base, channel) for channel in channels}
    excess = {c: sum(float(s.misfit @ s.misfit) - s.noise for s in seen) for c, seen in every.items() if seen}
    most = max(excess, key=lambda c: excess[c], default=None)
    if most is None or excess[most] <= 0.0:
        return ()
    seen = every[most]
    models = [(name, _columns(problem, base, seen, name, grown)) for name, grown in _ways(seen, most.startswith(ABOUT))]
    held: list[Array] | None = None
    shares: list[tuple[str, float]] = []
    for _ in range(TUNING.most_quantities):
        before = sum(share for _, share in shares)
        taken = [name for name, _ in shares]
        tried = []
        for name, columns in models:
            if name not in taken:
                both = columns if held is None else [np.hstack(pair) for pair in zip(held, columns, strict=True)]
                tried.append((min(_predicted(seen, both) / excess[most], 1.0) - before, name, both))
        added, name, columns = max(tried, key=lambda one: one[0])
        if added <= (TUNING.least_second_share if shares else 0.0):
            break
        shares.append((name, added))
        held = columns
    return tuple(shares)


def _seen(problem: Problem, base: Fitted, channel: str) -> list[Seen]:
    """A channel in the recordings that have it at the chassis' centre of mass."""
    found = []
    for r, (e, block) in enumerate(zip(problem.dataset, base.blocks, strict=True)):
        if channel in e.recording.sensors:
            continue
        for s, part in e.spans():
            if s.channel == channel and (state := e.simulator.state(block.shift)):
                counts = np.ones(s.rows.size) if s.weight is None else s.weight
                counts = counts if block.heavy_tail is None else counts * block.heavy_tail.samples[part]
                of = {TIME: e.recording.time[s.rows]}
                of |= {c: state[c][s.rows] for c in (*STATE, *FURTHER) if c in state}
                found.append(
                    Seen(
                        recording=r, condition=e.condition or e.name, part=part, misfit=block.residual[part], of=of,
                        noise=float(counts @ counts),
                    )
                )  # fmt: skip
    return found


def _ways(seen: Sequence[Seen], turns: bool) -> list[tuple[str, bool]]:
    """Quantities that all recordings have, as they are and, of what `turns`, as what grows with them."""
    shared = [name for name in seen[0].of if all(name in s.of for s in seen)]
    return [(name, grown) for name in shared for grown in ((False, True) if turns else (False,))]


def _columns(problem: Problem, base: Fitted, seen: Sequence[Seen], name: str, grown: bool) -> list[Array]:
    """What functions of a quantity do to the whitened channel, (n, k) each."""
    knots = np.unique(np.quantile(np.concatenate([s.of[name] for s in seen]), np.linspace(0.0, 1.0, TUNING.knots)))
    found = []
    for s in seen:
        basis, e = linear_b_splines(s.of[name], knots), problem.dataset[s.recording]
        if grown:
            basis = np.cumsum(basis, axis=0) * float(np.median(np.diff(s.of[TIME])))
        raw = np.zeros((e.count, basis.shape[1]))
        raw[s.part] = basis
        found.append(base.blocks[s.recording].counted(e.whitened(raw))[s.part])
    return found


def _predicted(seen: Sequence[Seen], columns: Sequence[Array]) -> float:
    """What functions fitted to all other conditions take from the squares of each that is left out, summed."""
    less = 0.0
    for left in sorted({s.condition for s in seen}):
        out = [k for k, s in enumerate(seen) if s.condition == left]
        rest = [k for k in range(len(seen)) if k not in out] or out
        weights = np.linalg.lstsq(
            np.vstack([columns[k] for k in rest]), np.concatenate([seen[k].misfit for k in rest]), rcond=1e-8
        )[0]
        for k in out:
            miss = seen[k].misfit - columns[k] @ weights
            less += float(seen[k].misfit @ seen[k].misfit) - float(miss @ miss)
    return less


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
    n = max(5, 2 * round(0.5 * CHASSIS.smoothing / step) + 1)
    if values.size <= n:
        return np.asarray(np.gradient(values, time))
    return np.asarray(savgol_filter(values, n, 2, deriv=1, delta=step))
