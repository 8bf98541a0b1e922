"""What is kept of a run while it goes on, whichever integrator makes its steps, and when it must end."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rollover.dynamics import history, prescribed
from rollover.dynamics.assembly import grown
from rollover.dynamics.events import collect, place_of, unseen
from rollover.dynamics.history import History
from rollover.dynamics.result import Event
from rollover.dynamics.setup import Rig
from rollover.dynamics.stands.control import Control
from rollover.dynamics.validity import calibrated_by_laws
from rollover.kernels import time_loop as loop
from rollover.kernels.dense import largest
from rollover.kernels.step import end_of_step
from rollover.kernels.tables import Handle, Tables, handle
from rollover.kernels.wheel_spin import DRIVE_NUMBERS, throttle
from rollover.scenario import Scenario
from rollover.spec.initiation import Driving, Standing

TRACK_RATE = 50.0  # Hz, of the ground's deformation
SAID_EVERY = 0.25  # s of wall time between two words of progress


class DivergedError(Exception):
    """The state left what can be: not finite, or faster than anything that falls."""


@dataclass
class Live:
    """Tables and the kernels' handle on them; both are replaced when the memory grows."""

    tables: Tables
    handle: Handle


def watch_of(scenario: Scenario, t: Tables, steps: int, start: float) -> loop.Watch:
    """Room for the rows of a run, and what its loop needs to know."""
    h = scenario.simulation.step
    every = max(1, round(scenario.simulation.output_step / h))
    uncalibrated, deepest = calibrated_by_laws(scenario.ground.every_law)
    begin, drive = scenario.initiation, np.zeros(0)
    if isinstance(begin, Driving) and begin.drive is not None and begin.drive.torque is not None:
        drive = np.zeros(DRIVE_NUMBERS)
        until = math.inf if begin.drive.until is None else begin.drive.until
        drive[:] = begin.drive.torque, begin.drive.rise_time, until
    per_frame = max(1, round(1.0 / (TRACK_RATE * every * h)))
    balanced = isinstance(begin, (Standing, Driving))  # what balances before it falls is not at rest
    return loop.Watch(
        rows=np.zeros((steps // every + 2, history.row_length(t))),
        time=np.zeros(steps // every + 2),
        seen=unseen(t),
        uncalibrated=uncalibrated,
        deepest=deepest,
        drive=drive,
        real=np.array([every * h, start, 0.0, prescribed.over(scenario.inputs)]),
        whole=np.array([0, per_frame, int(balanced), 0]),
    )


@dataclass
class Recorder:
    """Events, rows and frames of a run in progress."""

    scenario: Scenario
    rig: Rig
    live: Live
    past: History
    control: Control | None
    progress: Callable[[float, float], None] | None
    began: float  # wall time
    force: Any  # (n,) generalised forces
    watch: loop.WatchHandle = field(init=False)
    events: list[Event] = field(default_factory=list)
    last: float = 0.0  # of the solver's time
    due: float = 0.0  # wall time of the next word of progress

    def __post_init__(self) -> None:
        """Hand the kernels what they watch."""
        self.watch = loop.watched(self.past.watch)

    def after_step(self, time: float, q: Any, qd: Any, qdd: Any) -> bool:
        """End an accepted step of a solver that makes them one by one, or the start; False ends the run."""
        live, watch = self.live, self.watch
        now = self.now(time)
        dt = time - self.last  # the solver halves a step that does not converge
        self.last = time
        live.tables.clock[1] = now
        end_of_step(live.handle, q, qd, qdd, dt, self.force, False)
        if self.past.watch.drive.size:
            throttle(live.handle, self.past.watch.drive, now)
        if self.control is None:
            reason = loop.look(live.handle, watch, q, qd, qdd, self.force, dt, time)
            if reason == 0:
                return True
            self.see_to(reason, time, qd)
            return self.goes_on(reason, time, q)
        self.see_to(loop.check(live.handle, watch, qd, self.force), time, qd)
        goes_on = self.control.after(now, dt, q, qd, live.tables)
        live.tables.velocity[:] = qd  # a blow of the control has changed it
        return self.goes_on(loop.keep(live.handle, watch, q, qd, qdd, dt, time), time, q) and goes_on

    def now(self, time: float) -> float:
        """The scenario's time at a time of the solver."""
        return round(self.past.start + time, 9)

    def see_to(self, reason: int, time: float, qd: Any) -> None:
        """Collect events, make room. Raises ``DivergedError``."""
        now, t = self.now(time), self.live.tables
        if reason & loop.EVENT:
            collect(t, now, self.rig.bodies, self.scenario, self.events)
        if reason & loop.LOST:
            raise DivergedError(f"diverged at t = {now:.4f} s: a velocity of {largest(qd):.3g} (m/s or rad/s)")
        if reason & loop.OUT:
            raise DivergedError(
                f"left the array of ground elements at t = {now:.4f} s: "
                "enlarge ground.elements.length, .width or move .centre"
            )
        if reason & loop.FULL:
            self.live.tables = grown(t)
            self.live.handle = handle(self.live.tables)

    def goes_on(self, reason: int, time: float, q: Any) -> bool:
        """Keep a frame of the ground, say how far the run is, note rest; False where it ends there."""
        now = self.now(time)
        if reason & loop.FRAME:
            self.past.add_track(now, self.live.tables)
            if self.progress is not None and clock.perf_counter() >= self.due:
                self.progress(now, clock.perf_counter() - self.began)
                self.due = clock.perf_counter() + SAID_EVERY
        if not reason & loop.REST:
            return True
        at = round(now - loop.REST_TIME, 9)
        self.events.append(Event(time=at, kind="rest", subject=self.rig.bodies[0].name, place=place_of(q[:3])))
        return not self.scenario.simulation.stop_at_rest
