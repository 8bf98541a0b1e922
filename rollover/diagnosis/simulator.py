"""What the scenario predicts for a recording, at the recording's own stamps and behind its own filters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.overturn import RunSimulator
from rollover.drop import DropFailedError, DropModel, unfit
from rollover.effects import read
from rollover.filters import filtered
from rollover.recording import Recording
from rollover.scenario import Scenario

Array = NDArray[np.float64]
SENSORS = "effects.sensor-"
KEPT = 64  # runs of one recording


class Simulator(Protocol):
    """One recording's test, ready to be run with values exchanged by path."""

    def predict(self, changes: Mapping[str, Any], shift: float) -> dict[str, Array] | None:
        """Channels (n,) at the recording's stamps less `shift` (s); None if the simulation fails."""


class DropSimulator:
    """A drop test by its own integrator: two milliseconds a run."""

    def __init__(self, scenario: Scenario, recording: Recording) -> None:
        self.model = DropModel(scenario=scenario)
        self.recording = recording
        self._raw: dict[tuple[Any, ...], Recording] = {}

    def predict(self, changes: Mapping[str, Any], shift: float) -> dict[str, Array] | None:
        """See `Simulator`; ``ValueError`` for a value out of bounds passes."""
        physical = {path: value for path, value in changes.items() if not path.startswith(SENSORS)}
        try:
            run = self._run(physical, shift)
        except DropFailedError:
            return None
        if len(physical) < len(changes):
            read_by = self.model.with_({p: v for p, v in changes.items() if p not in physical})
            run = read(read_by.scenario.effects, run)
        return behind_filters(run.channels, self.recording)

    def _run(self, physical: Mapping[str, Any], shift: float) -> Recording:
        """The drop before instruments: what sensors alone change needs no second run."""
        key = (*sorted(physical.items()), shift)
        if key not in self._raw:
            if len(self._raw) >= KEPT:
                self._raw.pop(next(iter(self._raw)))
            model = self.model.with_(physical) if physical else self.model
            self._raw[key] = model.run(self.recording.time - shift)
        return self._raw[key]


def behind_filters(channels: Mapping[str, Array], recording: Recording) -> dict[str, Array]:
    """Simulated channels that the recording has, each through the filter class that the recording says was applied."""
    step = float(np.median(np.diff(recording.time)))
    found = {}
    for name in recording.channels:
        if name in channels:
            values = channels[name]
            if name in recording.cfc:
                values = filtered(values, step, recording.cfc[name])
            found[name] = values
    return found


def simulator_of(scenario: Scenario, recording: Recording) -> Simulator:
    """The quickest simulator that a scenario admits; the recording's conditions are put in by path.

    Raises `InputError` for a condition that the scenario does not know.
    """
    own = set_up(scenario, recording)
    return RunSimulator(own, recording) if unfit(own) else DropSimulator(own, recording)


def set_up(scenario: Scenario, recording: Recording) -> Scenario:
    """The scenario under a recording's conditions. Raises `InputError`."""
    return scenario.replaced(dict(recording.conditions), origin=recording.title) if recording.conditions else scenario


__all__ = ["DropSimulator", "RunSimulator", "Simulator", "behind_filters", "set_up", "simulator_of"]
