"""The interface between a forward model and the estimation: what simulates one recording, and how it fails."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.settings.forward import Effort

Array = NDArray[np.float64]
EDGES = ("sensor-lag", "sensor-clock-offset", "sensor-clock-drift")  # sensor errors that move a jump in time


class FailedModelError(RuntimeError):
    """A model of one's own is faulty: the line that names its file, an ``InputError`` once the diagnosis has ended.

    A point without a solution is no fault: `Simulator.predict` returns None there, and a fit goes around it.
    """


class Simulator(Protocol):
    """One recording's test, ready to be run with values exchanged by path."""

    def predict(self, changes: Mapping[str, Any], shift: float) -> dict[str, Array] | None:
        """Channels (n,) at the recording's stamps less `shift` (s); None if the simulation fails."""

    def perturbed(
        self, changes: Mapping[str, Any] | None = None, shift: float = 0.0, parts: int = 1
    ) -> list[dict[str, Array]]:
        """What runs with `changes` that nobody could tell apart differ by, (n,) at the stamps less `shift`, s.

        Each step of theirs is one of at least `parts` of the scenario's.
        """

    def choose_medoid(self) -> None:
        """Of runs that nobody could tell apart take the one that is the most like all."""

    def until(self, n: int) -> Simulator:
        """The same for the first n stamps."""

    def marks(self) -> tuple[tuple[float, str], ...]:
        """(start s, name) of the phases of the scenario as it is; empty if the recording itself tells."""

    def state(self, shift: float) -> Mapping[str, Array]:
        """Motion of the scenario as it is, recorded or not, (n,) each; empty if it cannot be simulated."""

    @property
    def contact(self) -> float:
        """When a scenario as it is first touches the ground, s; infinite if it never does or none can tell."""

    @property
    def effort(self) -> Effort:
        """How much may be simulated."""


def first_impact_of(simulator: Simulator) -> float:
    """When the scenario as it is first hits the ground with more than its wheels, s; infinite if it never does."""
    return next((at for at, name in simulator.marks() if name == "impact"), np.inf)
