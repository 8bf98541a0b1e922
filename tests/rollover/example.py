"""A short scenario text, and runs made up by hand so that the store and the commands can be tested without a solver."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rollover.dynamics.result import ContactForce, Event, GroundTrack, Motion, Run
from rollover.recording import Recording
from rollover.scenario import Scenario

TEXT = """\
title: Drop
vehicle: {kind: striker}
ground:
  elements: {length: 1.0, width: 1.0}
  law: {kind: ye-2006}
initiation:
  kind: drop
  speed: 3.0
simulation:
  duration: 0.6
"""


@dataclass(frozen=True, kw_only=True)
class Peak:
    """What `rollover.assessment.loads.PeakLoad` has."""

    channel: str = "ground/force_normal"
    unit: str = "N"
    raw: float = 3552.1
    raw_time: float = 0.205
    filtered: float = 3549.9
    filtered_time: float = 0.206
    cfc: int = 60
    impulse: float | None = 36.0
    domain_flags: tuple[str, ...] = ()
    half_step_change: float | None = 0.001
    starts: int | None = None
    mean: float | None = None
    scatter: float | None = None


def run_of(scenario: Scenario, sentence: str = "") -> Run:
    """A run of eleven rows; with a sentence, one that failed."""
    time = np.linspace(0.0, 0.01, 11)
    pose = np.zeros((2, 3))
    return Run(
        scenario=scenario,
        status="failed" if sentence else "done",
        sentence=sentence,
        recording=Recording(
            title=scenario.title,
            time=time,
            channels={
                "ground/force_normal": np.sin(300.0 * time) ** 2 / 3.0,
                "rops/mount/left/force_x": np.where(time > 0.005, np.nan, 0.1),
            },
            source="simulation",
        ),
        flags=np.zeros(11, dtype=np.int64),
        events=(Event(time=0.001, kind="first-touch", subject="striker", place=(0.0, 0.0, -1e-9), detail="3 m/s"),),
        phases=((0.0, "impact"),),
        frame_time=np.array([0.0, 0.01]),
        motion={"striker": Motion(origin=pose, quaternion=np.tile([0.0, 0.0, 0.0, 1.0], (2, 1)))},
        pose={"striker": Motion(origin=pose, quaternion=np.tile([0.0, 0.0, 0.0, 1.0], (2, 1)))},
        contact={"striker": ContactForce(point=pose, force=pose)},
        track=GroundTrack(time=np.array([0.01]), element=np.array([0]), sinkage=np.array([[0.1]])),
        domain_flags=("speed",),
        ledger={"kinetic": 1.0, "residual": float("nan")},
        released=2.0,
        wall_time=0.5,
        stop_time=0.01,
    )
