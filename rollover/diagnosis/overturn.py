"""What a scenario that needs a full run predicts for a recording: overturns, tosses, drops of vehicles.

A full run costs a hundred drops, so each is kept by the values that change the motion; a time shift, a filter and
what sensors make of a channel are read off it afterwards. Sensors are read on the run's own rows, at the place and in
the axes that the recording states for them, then through the channel's filter class, and last at the stamps.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover import simulate
from rollover.document import exchanged
from rollover.effects import read
from rollover.filters import filtered, least_rate
from rollover.misfit import as_measured
from rollover.recording import Recording
from rollover.scenario import Scenario

Array = NDArray[np.float64]
SENSORS = "sensor-"
KEPT = 400  # runs of one recording: a third of a megabyte each
BEYOND = 0.06  # s by which a run goes on past the last stamp, so that it covers a time shift
SLOWEST = 20.0  # times the first run's wall time, and
LEAST_TIME = 5.0  # s: a run that takes longer has lost its way in ever shorter steps
MOTION = ("chassis/", "striker/", "axle/front/angle")  # what an instrument's place is worked out from


class _TooSlowError(Exception):
    """A run takes far longer than the first."""


class RunSimulator:
    """Any scenario by full runs; `runs` counts those that were made, `seconds` is their wall time."""

    def __init__(self, scenario: Scenario, recording: Recording) -> None:
        self.recording = recording
        self.scenario = _covering(scenario, recording)
        self.runs = 0
        self.seconds = 0.0
        self._limit = np.inf
        self._known: dict[tuple[Any, ...], tuple[Scenario, Recording] | None] = {}

    def __getstate__(self) -> dict[str, Any]:
        """What is sent to another process: not the runs."""
        return {**self.__dict__, "_known": {}}

    def predict(self, changes: Mapping[str, Any], shift: float) -> dict[str, Array] | None:
        """Channels (n,) at the recording's stamps less `shift` (s); None if the run fails.

        NaN where the run has no rows: before its start by more than a shift, and after its end unless it came to rest.
        ``ValueError`` for a value out of bounds passes.
        """
        chosen = exchanged(self.scenario, changes) if changes else self.scenario
        known = self._run(chosen, changes)
        if known is None:
            return None
        applied, run = known
        run = read(chosen.effects, as_measured(applied, run, self.recording))
        step = float(np.median(np.diff(run.time)))
        at = self.recording.time - shift
        outside = (at < run.time[0] - BEYOND) | (at > run.time[-1] + BEYOND)
        found = {}
        for name in self.recording.channels:
            if name not in run.channels:
                continue
            values, cfc = run[name], self.recording.cfc.get(name)
            if cfc is not None and 1.0 / step >= least_rate(cfc) * (1.0 - 1e-9):
                values = filtered(values, step, cfc)
            found[name] = np.where(outside, np.nan, np.interp(at, run.time, values))
        return found

    def _run(self, chosen: Scenario, changes: Mapping[str, Any]) -> tuple[Scenario, Recording] | None:
        """The run before instruments, with the scenario as its effects made it; None if it failed."""
        moving = {path: value for path, value in changes.items() if not path.startswith(f"effects.{SENSORS}")}
        key = tuple(sorted(moving.items()))
        if key not in self._known:
            if len(self._known) >= KEPT:
                self._known.pop(next(iter(self._known)))
            physical = {name: e for name, e in chosen.effects.items() if not name.startswith(SENSORS)}
            self._known[key] = self._made(replace(chosen, effects=physical))
        return self._known[key]

    def _made(self, scenario: Scenario) -> tuple[Scenario, Recording] | None:
        self.runs += 1
        try:
            run = simulate.run(scenario, progress=self._watch)
        except _TooSlowError:
            self.seconds += self._limit
            return None
        self.seconds += run.wall_time
        if self._limit == np.inf:
            self._limit = max(SLOWEST * run.wall_time, LEAST_TIME)
        if run.status == "failed":
            return None
        stems = {name[:-1] for name in self.recording.channels}  # the axes across, for a sensor that is turned
        kept = {n: v for n, v in run.recording.channels.items() if n[:-1] in stems or n.startswith(MOTION)}
        return scenario.applied(), replace(run.recording, channels=kept)

    def _watch(self, _simulated: float, wall: float) -> None:
        if wall > self._limit:
            raise _TooSlowError


def _covering(scenario: Scenario, recording: Recording) -> Scenario:
    """The scenario with the shortest duration that covers the recording and its time shifts.

    It does not stop at rest: what rests stays in the rows that later stamps are compared with.
    """
    settings = scenario.simulation
    end = float(recording.time[-1]) + BEYOND
    rows = max(1, int(np.ceil(end / settings.output_step)))
    duration = round(min(rows * settings.output_step, 120.0), 9)
    return replace(scenario, simulation=replace(settings, duration=duration, stop_at_rest=False))
