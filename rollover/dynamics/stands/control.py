"""Who runs a test stand: asked after each step, it moves on what the devices do and keeps what the test found."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

from rollover.dynamics.result import Event
from rollover.dynamics.setup import Rig
from rollover.dynamics.stands.exciter import Hammer, Shaker
from rollover.dynamics.stands.pendulum import PendulumControl
from rollover.dynamics.stands.static_load import StaticControl
from rollover.dynamics.stands.tilt_table import TiltControl
from rollover.kernels.tables import Tables
from rollover.scenario import Scenario
from rollover.spec.excitation import Blows, Harmonic
from rollover.spec.stand import PendulumBlow, StaticTest, TiltTable
from rollover.spec.standards.static_sequence import sequence
from rollover.spec.vehicle import Vehicle


class Control(Protocol):
    """One test on one stand."""

    events: list[Event]

    def after(self, now: float, dt: float, q: Any, qd: Any, t: Tables) -> bool:
        """Move on after an accepted step, dt is 0 at the start; may write velocities; False ends the run."""
        ...

    def results(self) -> tuple[Mapping[str, Any], ...]:
        """What was found: a row for each load, blow or tilt, each with kind, name and status."""
        ...


def control_of(scenario: Scenario, rig: Rig) -> Control | None:
    """Who runs the scenario's test stand, or None where there is none."""
    begin = scenario.initiation
    if isinstance(begin, StaticTest):
        assert isinstance(scenario.vehicle, Vehicle)
        return StaticControl(begin, sequence(scenario.vehicle, begin), rig)
    if isinstance(begin, PendulumBlow):
        return PendulumControl(begin, rig, scenario.gravity)
    if isinstance(begin, TiltTable):
        return TiltControl(begin, rig, scenario)
    if isinstance(scenario.excitation, Harmonic):
        return Shaker(scenario.excitation, rig)
    if isinstance(scenario.excitation, Blows):
        return Hammer(scenario.excitation, rig, scenario.gravity)
    return None
