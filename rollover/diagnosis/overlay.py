"""What a diagnosis rests on, over time: measured, simulated before, and simulated with what was found.

The scenario before and the diagnosed one are simulated anew at every stamp of a recording: the latter is what
`rollover run` makes of scenario-diagnosed.yaml. Both at one time shift, that of the better explanation: a shift of its
own would hide part of what the scenario misses. Full runs lie on the ground's grid where the one that is most like its
neighbours does, and are shown with what these differ by: what no simulation is sure of is no misfit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.data.dataset import Dataset, Signal, dataset_of
from rollover.diagnosis.data.onset import zeros_from_contact
from rollover.diagnosis.data.phases import phases_of
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.time_shift import estimate_time_shifts
from rollover.diagnosis.forward.averaging import on_attitude_branch, simulated, with_reference_attitude
from rollover.diagnosis.forward.forward_model import simulator_of
from rollover.diagnosis.forward.full_run import CENTRE, full_runs, made_ahead
from rollover.diagnosis.forward.interface import Simulator
from rollover.diagnosis.io import diagnosed_scenario
from rollover.diagnosis.noise.ensemble import running_mean
from rollover.diagnosis.noise.heteroscedasticity import with_variance_model
from rollover.diagnosis.result import Diagnosis
from rollover.diagnosis.settings import SETTINGS
from rollover.recording import Recording
from rollover.scenario import Scenario
from rollover.system.processes import Children

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Track:
    """One channel over time, SI: `time`, `measured`, `before` (n,), `after` (n,) or None; gaps are left out.

    `noise` is 1 sigma of what the misfit is held against: the measured noise, and what integrators differ by. Beside it
    stands `scatter` (n,), 1 sigma of what neighbouring runs differ by and of a noise that grows with the value; None
    where there is neither.
    """

    channel: str
    time: Array
    measured: Array
    before: Array
    after: Array | None
    noise: float
    scatter: Array | None = None

    @property
    def unsure(self) -> Array:
        """1 sigma of noise and scatter together, over the noise, (n,)."""
        if self.scatter is None:
            return np.ones(self.time.size)
        return np.hypot(1.0, self.scatter / self.noise)

    @property
    def rms_before(self) -> float:
        """Root mean square of measured less simulated, over the noise and the scatter."""
        return self._rms(self.before)

    @property
    def rms_after(self) -> float | None:
        """The same with what was found; None if nothing was."""
        return None if self.after is None else self._rms(self.after)

    def _rms(self, simulated: Array) -> float:
        return float(np.sqrt(np.mean(((self.measured - simulated) / (self.noise * self.unsure)) ** 2)))


@dataclass(frozen=True, kw_only=True)
class Overlay:
    """One recording: its tracks, its phases (start s, name), and the time shift (s) at which it is shown."""

    recording: str
    title: str
    held_out: bool
    phases: tuple[tuple[float, str], ...]
    shift: float
    tracks: tuple[Track, ...]
    condition: str = ""


def overlays_of(
    scenario: Scenario,
    recordings: Sequence[tuple[str, Recording]],
    found: Diagnosis,
    children: Children | None = None,
) -> tuple[Overlay, ...]:
    """Each recording beside its simulations, in the order given; those that could not be simulated are left out.

    `children` make full runs side by side.
    """
    diagnosed = diagnosed_scenario(scenario, found)
    judged = found.held_out if set(found.held_out) != set(found.training) else ()
    overlays = []
    for name, recording in zeros_from_contact(scenario, recordings)[0]:
        laid = {CENTRE: found.grids[name]} if name in found.grids else {}
        other = diagnosed.replaced(laid) if found.effects or found.empirical else None
        left = _left_conditions(recording, found)
        one = _overlay_of(name, recording, scenario.replaced(laid), other, left, name in judged, children)
        if one is not None:
            overlays.append(one)
    return tuple(overlays)


def _left_conditions(recording: Recording, found: Diagnosis) -> Mapping[str, Any]:
    """Conditions but those that state other numbers of what was found, as an importer may."""
    replaced = {f"effects.{e.id}.{name}" for e in found.effects for name in e.settings}
    return {path: v for path, v in recording.conditions.items() if path not in replaced}


def _overlay_of(
    name: str,
    recording: Recording,
    scenario: Scenario,
    diagnosed: Scenario | None,
    left: Mapping[str, Any],
    held_out: bool,
    children: Children | None,
) -> Overlay | None:
    """`left` are the conditions of the recording under which it is `diagnosed`."""
    recording, reference = on_attitude_branch(scenario, recording)
    made = [_simulators(scenario, recording, reference)]
    if diagnosed is not None:
        made.append(_simulators(diagnosed, replace(recording, conditions=left), reference))
    full = [runs for _, *both, _ in made for one in both if (runs := full_runs(one)) is not None]
    for runs in full:
        runs.children = children
    made_ahead(children, [(runs, {}) for runs in full])
    ready = [(whole, dataset_of(name, thin, simulator, many)) for thin, simulator, whole, many in made]
    (simulator, dataset), (last, best) = ready[0], ready[-1]
    if dataset is None:
        return None
    (dataset,), thinner = with_variance_model([dataset]), dataset.recording
    at = _shift(dataset if diagnosed is None or best is None else best)
    before = simulator.predict({}, at)
    if before is None:
        return None
    after = None if diagnosed is None else last.predict({}, at)
    perturbed = last.perturbed({}, at)
    tracks = []
    for signal in dataset.signals:
        channel = signal.channel
        there = np.isfinite(recording.channels[channel])
        stamps, measured = recording.time[there], recording.channels[channel][there]
        met = before[channel][there] if after is None else after[channel][there]
        times = single_sample_noise(measured - met, signal.sigma, dataset.averaged) / signal.sigma
        both = (_scatter([d[channel][there] for d in perturbed], stamps), _louder(signal, thinner.time, stamps, times))
        more = [s for s in both if s is not None]
        tracks.append(
            Track(
                channel=channel,
                time=stamps,
                measured=measured,
                before=before[channel][there],
                after=None if after is None else after[channel][there],
                noise=signal.sigma * times,
                scatter=np.sqrt(np.sum(np.square(more), axis=0)) if more else None,
            )
        )
    return Overlay(
        recording=name,
        title=recording.title,
        held_out=held_out,
        phases=phases_of(dataset),
        shift=at,
        tracks=tuple(tracks),
        condition=dataset.condition,
    )


def _simulators(
    scenario: Scenario, recording: Recording, reference: Recording | None
) -> tuple[Recording, Simulator, Simulator, int]:
    """A recording at no more rows than are needed, what simulates it, what all stamps, and how many are in a row."""
    thin, simulator, many = simulated(scenario, recording, reference)
    return (
        thin,
        simulator,
        simulator if many == 1 else with_reference_attitude(simulator_of(scenario, recording), reference),
        many,
    )


def _scatter(perturbed: Sequence[Array], time: Array) -> Array | None:
    """1 sigma (n,) of what neighbouring runs differ by; None where there are none."""
    whole = [d for d in perturbed if np.all(np.isfinite(d))]
    return np.sqrt(running_mean(np.mean(np.square(whole), axis=0), time)) if whole else None


def _louder(signal: Signal, time: Array, stamps: Array, times: float) -> Array | None:
    """1 sigma (n,) at `stamps` of the noise beyond its least, `times` that of means; None where it does not grow."""
    if signal.level is None:
        return None
    return np.interp(stamps, time[signal.rows], signal.noise * times * np.sqrt(signal.level**2 - 1.0))


def single_sample_noise(residual: Array, sigma: float, many: int) -> float:
    """Noise (1 sigma) of single samples, of which means of `many` have `sigma`, by their misfit (n,).

    Variance of the means and that within them: of coloured noise, as behind a filter, it is no `many` times the means'.
    That within is estimated by the median: most of the misfit is noise, k = many - 1 degrees of freedom having theirs
    at (1 - 2/(9 k))^3 of the mean (Wilson and Hilferty, 1931).
    """
    if many == 1 or residual.size < many:
        return sigma
    within = residual[: residual.size // many * many].reshape(-1, many).var(axis=1)
    return float(np.hypot(sigma, np.sqrt(np.median(within) / (1.0 - 2.0 / (9.0 * (many - 1))) ** 3)))


def _shift(dataset: Dataset) -> float:
    """Time shift at which a simulation meets its recording best, within `search_width` of its prior, s."""
    problem = Problem([dataset])
    estimate_time_shifts(problem)
    fitted = problem.fit((), ())
    best = problem.shifts[0] if fitted is None else fitted.blocks[0].shift
    most = SETTINGS.fit.time_shift.search_width * dataset.shift_prior
    return float(np.clip(best, -most, most))
