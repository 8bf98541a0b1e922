"""Recordings made ready for a diagnosis: what is excluded, what their digits and their noise are like."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rollover.diagnosis.data.dataset import Dataset, dataset_of, with_uncertain_conditions
from rollover.diagnosis.data.quantisation import with_quantisation, without_spikes
from rollover.diagnosis.data.repeatability import with_scatter
from rollover.diagnosis.data.stretches import parted
from rollover.diagnosis.fit.jobs import Executor
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.time_shift import estimate_time_shifts
from rollover.diagnosis.forward.averaging import compared
from rollover.diagnosis.forward.forward_model import set_up
from rollover.diagnosis.forward.full_run import full_runs
from rollover.diagnosis.forward.interface import Simulator, first_impact_of
from rollover.diagnosis.noise import autoregression
from rollover.diagnosis.noise.ensemble import with_sample_weights
from rollover.diagnosis.noise.heteroscedasticity import with_variance_model
from rollover.diagnosis.noise.offsets import with_offsets_removed
from rollover.diagnosis.noise.truncation import shortened
from rollover.recording import Recording
from rollover.scenario import Scenario
from rollover.spec.channels import describe
from rollover.system.errors import Fault, InputError


def prepared(
    scenario: Scenario, recordings: Sequence[tuple[str, Recording]], executor: Executor
) -> tuple[list[Dataset], list[str]]:
    """Recordings as datasets, and notes on them. Raises `InputError` where none of it is simulated."""
    found, read, notes, foreign = [], [], [], []
    for name, whole in recordings:
        recording, spiked = without_spikes(whole)
        recording, thin, simulator, averaged = compared(scenario, recording)
        if spiked and (first_impact := first_impact_of(simulator)) < np.inf:
            recording, spiked = without_spikes(whole, first_impact)
            recording, thin, simulator, averaged = compared(scenario, recording)
        runs = full_runs(simulator)
        if runs is not None:
            runs.children = executor.children
        simulator.choose_medoid()
        notes += [f"{name}: {line}" for line in spiked]
        one = dataset_of(name, thin, simulator, averaged)
        still = [c for c, v in recording.channels.items() if np.isfinite(v).any() and np.nanmin(v) == np.nanmax(v)]
        notes += [f"{name}: {channel} is constant and was excluded" for channel in still]
        if one is None:
            notes.append(f"{name}: shares no usable channel with the simulation and was excluded")
            foreign += _no_common_channel(simulator, name, recording)
        else:
            found.append(one)
            read.append(recording)
    if foreign and not found:
        raise InputError(*foreign)
    found = with_variance_model(with_quantisation(found, read))
    if many := sorted({e.averaged for e in found if e.averaged > 1}):
        said = " or ".join(map(str, many))
        notes.append(f"means of {said} neighbouring samples are compared: misfits and noise are those of the means")
    louder = {s.channel: float(s.level.max()) for e in found for s in e.signals if s.level is not None}
    notes += [f"{c}: the noise grows with the value, to {most:.1f} times its least" for c, most in louder.items()]
    steps = {s.channel: s.step for e in found for s in e.signals if s.step > 0.0}
    notes += [
        f"{c}: recorded in steps of {step:.3g} {describe(c).unit}, more than its noise: what is smaller does not show"
        for c, step in steps.items()
    ]
    return found, notes


def _no_common_channel(simulator: Simulator, name: str, recording: Recording) -> list[Fault]:
    """That nothing that was recorded is simulated, where that is so."""
    made = simulator.predict({}, 0.0)
    if made is None or made.keys() & recording.channels.keys():
        return []
    message = f"no channel that this scenario simulates, got {', '.join(recording.channels)}; one of them at least"
    return [Fault(file=name, message=message)]


def with_common_noise(scenario: Scenario, every: Sequence[Dataset]) -> list[Dataset]:
    """The recordings with the noise of those alike taken together, from their quiet stretches."""
    every = [with_uncertain_conditions(e, set_up(scenario, e.recording)) for e in with_scatter(every)]
    problem = Problem(every)
    estimate_time_shifts(problem)
    base = problem.fit((), (), rounds=2)
    if base is None:
        return list(every)
    residuals, shifts = problem.residuals(base), [b.shift for b in base.blocks]
    return with_offsets_removed(autoregression.with_noise_of_quiet_stretches(every, residuals), residuals, shifts)


def weighted_datasets(scenario: Scenario, every: Sequence[Dataset]) -> list[Dataset]:
    """The recordings weighed, what the simulation itself is not sure of less."""
    alike = [autoregression.with_own_model_error(parted(e)) for e in with_common_noise(scenario, every)]
    reweighted = [with_sample_weights(e, e.simulator.perturbed()) for e in alike]
    return [shortened(e, alone=len(reweighted) == 1) for e in reweighted]
