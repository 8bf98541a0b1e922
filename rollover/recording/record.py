"""What a recording is: one table of channels over time, how each was measured, and under which conditions."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from ground.quantity import Quantity, parameters
from rollover.spec.frames import from_angles

Array = NDArray[np.float64]
Point = tuple[float, float, float]
CFC = Literal[60, 180, 600, 1000]  # channel filter classes
CLASSES: tuple[int, ...] = get_args(CFC)
StandardUncertainty = float | tuple[float, ...]  # 1 sigma of a value, or of each number of a list


@parameters
class Clock:
    """What a recording's time stamps mean."""

    zero: Annotated[
        Literal["known", "unknown"], "whether t = 0 is the scenario's start, or the trigger stood anywhere"
    ] = "known"
    within: Annotated[float | None, Quantity("s", "1 sigma of how far its zero may be off", above=0)] = None


@parameters
class Sensor:
    """Where an instrument sits and which way its axes point; S its axes, B those of the body at its reference pose."""

    body: Annotated[Literal["chassis", "rops", "front_axle", "striker"], "what it is fastened to"]
    position: Annotated[Point, Quantity("m", "vehicle axes")] = (0.0, 0.0, 0.0)
    orientation_deg: Annotated[Point, Quantity("deg", "roll, pitch, yaw of its axes on the body, ISO 8855")] = (
        0.0,
        0.0,
        0.0,
    )
    matrix: Annotated[tuple[Point, Point, Point] | None, "R_BS instead of angles, row by row"] = None
    gravity: Annotated[
        Literal["coordinate", "proper"], "what an accelerometer reads at rest: 0, or what holds it up (+1 g upward)"
    ] = "coordinate"

    def validate(self) -> None:
        """Refuse a matrix that is no rotation, and two orientations at once."""
        if self.matrix is None:
            return
        if any(self.orientation_deg):
            raise ValueError("matrix: a second orientation beside orientation_deg; one of them is allowed")
        R = np.array(self.matrix)
        if not np.allclose(R @ R.T, np.eye(3), atol=1e-6) or np.linalg.det(R) < 0.0:
            raise ValueError(f"matrix: not a rotation, got {[list(row) for row in self.matrix]}; R R' = 1, det R = 1")

    @property
    def R_BS(self) -> Array:
        """Rotation that takes components in the instrument's axes to the body's, (3, 3)."""
        if self.matrix is not None:
            return np.array(self.matrix)
        roll, pitch, yaw = np.radians(self.orientation_deg)
        return from_angles(float(roll), float(pitch), float(yaw))


@dataclass(frozen=True, kw_only=True)
class Recording:
    """Channels (see `channels.CHANNELS`), SI, one value each per time stamp, 64-bit; gaps are NaN.

    `time` (n,) finite and strictly increasing, s; `channels` name -> (n,); `noise` name -> 1 sigma; `cfc` name -> class
    of the filter already applied; `conditions` scenario path -> value this was run with, `uncertainty` the same
    path -> 1 sigma; `sensors` name -> where it was measured; `notes` what the reader of the file has to say. A channel
    with its own, slower clock stands in the common table with gaps between its samples; `samples` gives it back alone.
    """

    title: str
    time: Array
    channels: Mapping[str, Array]
    source: str = ""
    conditions: Mapping[str, Any] = field(default_factory=dict)
    uncertainty: Mapping[str, StandardUncertainty] = field(default_factory=dict)
    noise: Mapping[str, float] = field(default_factory=dict)
    cfc: Mapping[str, int] = field(default_factory=dict)
    clock: Clock = field(default_factory=Clock)
    sensors: Mapping[str, Sensor] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        # files hold shorter and longer numbers, of which the tables that keep them know not all
        object.__setattr__(self, "time", np.asarray(self.time, dtype=np.float64))
        if any(v.dtype != np.float64 for v in self.channels.values()):
            as_kept = {name: v.astype(np.float64) for name, v in self.channels.items()}
            object.__setattr__(self, "channels", as_kept)
        if self.time.ndim != 1 or self.time.size == 0:
            raise ValueError(f"time: empty or not one column, got shape {self.time.shape}; at least one stamp")
        if not np.isfinite(self.time).all():
            at = int(np.argmin(np.isfinite(self.time)))
            raise ValueError(f"time: not finite, got {float(self.time[at])!r} at stamp {at + 1}; seconds are needed")
        if not np.all(np.diff(self.time) > 0):
            at = int(np.argmin(np.diff(self.time)))
            before, after = float(self.time[at]), float(self.time[at + 1])
            raise ValueError(f"time: does not increase, got {after!r} after {before!r}; a larger stamp is needed")
        for name, values in self.channels.items():
            if values.shape != self.time.shape:
                raise ValueError(f"{name}: got {values.shape} values for {self.time.shape} time stamps; one each")

    def __getitem__(self, name: str) -> Array:
        """Values of a channel, (n,)."""
        return self.channels[name]

    def until(self, n: int) -> Recording:
        """The beginning of a recording.

        Parameters
        ----------
        n
            How many stamps.

        Returns
        -------
        Recording
            The first n stamps, with their values.
        """
        return replace(self, time=self.time[:n], channels={c: v[:n] for c, v in self.channels.items()})

    def samples(self, name: str) -> tuple[Array, Array]:
        """Samples of a channel that are there: gaps (NaN) left out.

        Parameters
        ----------
        name
            The channel.

        Returns
        -------
        tuple
            Time (k,), s, and values (k,), SI.

        Raises
        ------
        KeyError
            For a channel that the recording does not have.
        """
        there = np.isfinite(self.channels[name])
        return self.time[there], self.channels[name][there]


def with_channels(recording: Recording, channels: Mapping[str, Array]) -> Recording:
    """The same stamps with other channels, 64-bit: what is checked of the stamps is not checked again."""
    found = copy(recording)
    object.__setattr__(found, "channels", channels)
    return found
