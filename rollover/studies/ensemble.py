"""A small ensemble of starts that nobody could tell apart: how far chance carries each load.

A vehicle that rocks on its side is many small hits, and small causes grow: another processor, another order of a
sum, and the peak is another one. The mean over a few starts is what can be compared, the scatter what a single
run leaves open.
"""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rollover.assessment.assessed import AssessedRun
from rollover.assessment.bands import History, bands, history
from rollover.assessment.ledger import Closure, closure
from rollover.assessment.loads import peak_loads
from rollover.dynamics import simulate
from rollover.dynamics.result import Run
from rollover.scenario import Scenario
from rollover.system.errors import Fault, InputError
from rollover.system.processes import map_cases

VARIATION = 1e-6  # of gravity from one start to the next: as over a storey of a house
IMPULSE, RAW = "impulse", "raw"
ALSO = (("rops/deflection", "m"), ("rops/energy", "J"), ("ground/sinkage", "m"))


class FailedRunError(RuntimeError):
    """A run that a peak was wanted of failed; its sentence says why."""


@dataclass(frozen=True, kw_only=True)
class Extreme:
    """Largest magnitude of one quantity in one run; `filter` is 'raw', 'CFC 60' or so, or 'impulse' (at the end)."""

    load: str
    filter: str
    unit: str
    value: float
    time: float

    @property
    def key(self) -> tuple[str, str]:
        """What tells it from the others of its run."""
        return self.load, self.filter


@dataclass(frozen=True, kw_only=True)
class Spread:
    """One quantity over an ensemble: mean, its time in the first start, `values` of all of them.

    `scatter` is the standard deviation over the mean, 0 where the mean is.
    """

    load: str
    filter: str
    unit: str
    mean: float
    time: float
    values: tuple[float, ...]

    @property
    def scatter(self) -> float:
        """Standard deviation over the mean."""
        if len(self.values) < 2 or self.mean == 0.0:
            return 0.0
        return statistics.stdev(self.values) / abs(self.mean)


def perturbed_starts(scenario: Scenario, starts: int) -> list[Scenario]:
    """The scenario itself, then `starts` - 1 whose gravity differs by 1e-6, -1e-6, 2e-6 ... of itself.

    Gravity acts in every scenario, however it begins, and nothing about a load depends on it that closely: smooth
    loads move by less than 1e-6, chaotic ones scatter as they would between two machines.
    Raises `InputError` where there is no gravity to vary.
    """
    if starts > 1 and scenario.gravity == 0.0:
        raise InputError(Fault(path="gravity", message="an ensemble varies gravity, got 0; one start is all there is"))
    steps = [(k + 1) // 2 * (1 if k % 2 else -1) for k in range(1, starts)]
    varied = [scenario.replaced({"gravity": scenario.gravity * (1.0 + k * VARIATION)}) for k in steps]
    return [scenario, *varied]


def extremes(run: Run) -> tuple[Extreme, ...]:
    """Peaks of a run: every load raw, filtered and as impulse; deflection and energy of the ROPS, sinkage."""
    found = []
    for peak in peak_loads(run):
        load, unit = peak.channel, peak.unit
        found.append(Extreme(load=load, filter=RAW, unit=unit, value=peak.raw, time=peak.raw_time))
        kind = f"CFC {peak.cfc}"
        found.append(Extreme(load=load, filter=kind, unit=unit, value=peak.filtered, time=peak.filtered_time))
        if peak.impulse is not None:
            found.append(Extreme(load=load, filter=IMPULSE, unit="N s", value=abs(peak.impulse), time=run.stop_time))
    for channel, unit in ALSO:
        if channel in run.recording.channels:
            values = np.abs(run.recording[channel])
            k = int(np.argmax(values))
            time = float(run.recording.time[k])
            found.append(Extreme(load=channel, filter=RAW, unit=unit, value=float(values[k]), time=time))
    return tuple(found)


@dataclass(frozen=True, kw_only=True)
class Observed:
    """What one run of an ensemble gives: its extremes, and how well its energy ledger closes."""

    extremes: tuple[Extreme, ...]
    ledger: Closure


def observed(scenario: Scenario) -> Observed:
    """Run a scenario for its extremes and its ledger. Raises `FailedRunError`."""
    run = simulate.run(scenario)
    if run.status == "failed":
        raise FailedRunError(run.sentence)
    return Observed(extremes=extremes(run), ledger=closure(run))


def measured(scenario: Scenario) -> tuple[Extreme, ...]:
    """Run a scenario for its extremes. Raises `FailedRunError`."""
    return observed(scenario).extremes


def followed(scenario: Scenario) -> tuple[tuple[Extreme, ...], History]:
    """Run a scenario for its extremes and its loads over time. Raises `FailedRunError`."""
    run = simulate.run(scenario)
    if run.status == "failed":
        raise FailedRunError(run.sentence)
    return extremes(run), history(run)


def spreads(ensemble: Sequence[Sequence[Extreme]]) -> tuple[Spread, ...]:
    """Mean and values of each quantity over the starts; those of the first start, in its order."""
    by_key = [{e.key: e.value for e in start} for start in ensemble]
    found = []
    for extreme in ensemble[0]:
        values = tuple(start[extreme.key] for start in by_key if extreme.key in start)
        found.append(
            Spread(
                load=extreme.load,
                filter=extreme.filter,
                unit=extreme.unit,
                mean=statistics.fmean(values),
                time=extreme.time,
                values=values,
            )
        )
    return tuple(found)


def with_scatter(found: AssessedRun, starts: int, workers: int | None = None) -> AssessedRun:
    """A run with mean and scatter of its peaks, and bands of its loads, over it and `starts` - 1 neighbours.

    These run in child processes. Raises `FailedRunError` if one of them fails.
    """
    ensemble = [{(p.channel, f"CFC {p.cfc}"): p.filtered for p in found.peaks}]
    others = [s.of_many() for s in perturbed_starts(found.scenario, starts)[1:]]
    histories = []
    for outcome in map_cases(followed, others, workers=workers):
        if outcome.value is None:
            assert outcome.failure is not None
            raise FailedRunError(f"neighbouring start {outcome.index + 2} of {starts}: {outcome.failure.sentence}")
        own, over_time = outcome.value
        ensemble.append({e.key: e.value for e in own})
        histories.append(over_time)
    peaks = []
    for peak in found.peaks:
        values = [start[peak.channel, f"CFC {peak.cfc}"] for start in ensemble]
        mean = statistics.fmean(values)
        scatter = statistics.stdev(values) / mean if mean > 0.0 else 0.0
        peaks.append(replace(peak, starts=starts, mean=mean, scatter=scatter, starts_by=others[0].integrator))
    return replace(found, peaks=tuple(peaks), bands=bands(found.result, histories))
