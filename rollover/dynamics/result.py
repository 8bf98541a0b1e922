"""What a run gives: channels, events, phases, motion, the ground it leaves, the energy ledger (data only)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from rollover.recording import Recording
from rollover.scenario import Scenario


@dataclass(frozen=True, kw_only=True)
class Event:
    """Something that happened: when, where (world, m), to what."""

    time: float
    kind: Literal[
        "first-touch",
        "branch-change",
        "unloading",
        "lift-off",
        "touch-down",
        "axle-stop",
        "plastic-hinge",
        "rest",
        "load-begins",
        "load-reached",
        "blow",
        "overturn",
    ]
    subject: str  # "rops", "chassis", "front_left", "axle", a mount's name
    place: tuple[float, float, float]
    detail: str = ""


@dataclass(frozen=True, kw_only=True)
class Motion:
    """Pose of one body's vehicle-axes frame at the frame times: its origin (n, 3) and quaternion xyzw (n, 4).

    Geometry given in vehicle axes (outline, members, wheels) is drawn with this pose directly.
    """

    origin: NDArray[np.float64]
    quaternion: NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class GroundTrack:
    """How the ground was left: sinkage of the touched elements at some instants.

    `time` (f,); `element` (k,) flat indices ix * ny + iy into the array; `sinkage` (f, k) m, 0 before the touch.
    """

    time: NDArray[np.float64]
    element: NDArray[np.int64]
    sinkage: NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class ContactForce:
    """Ground's force on one body at the frame times, world axes: point of application (n, 3), force (n, 3), N."""

    point: NDArray[np.float64]
    force: NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Run:
    """What one run gave; a run that failed is a value too, with its sentence and all that was recorded until then."""

    scenario: Scenario
    status: Literal["done", "failed"]
    sentence: str  # why it failed; of one that is done what is special about its start
    recording: Recording
    flags: NDArray[np.int64]  # (n,) bits of the domain flags in force at each row of the recording
    events: tuple[Event, ...]
    phases: tuple[tuple[float, str], ...]  # (start, name): approach | support, tipping, impact, rest
    frame_time: NDArray[np.float64]  # (n,) of motion and contact
    motion: Mapping[str, Motion]  # "chassis", "front_axle", "rops" or "striker"
    pose: Mapping[str, Motion]  # the same at every row of the recording
    contact: Mapping[str, ContactForce]  # "chassis", "rops" or "striker", and each wheel by its name
    track: GroundTrack
    domain_flags: tuple[str, ...]  # over the whole run
    ledger: Mapping[
        str, float
    ]  # J at the end: kinetic, potential, soil, tyre, rops, friction, collision, axle, drive, residual
    released: float  # J, energy the run had to give; the residual is judged against it
    wall_time: float
    stop_time: float
    tests: tuple[Mapping[str, Any], ...] = ()  # one for each load, blow or tilt of a test stand
