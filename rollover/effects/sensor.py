"""Effects of sensors: what is read instead of what is, y = clip(G (R h x)(t - t_0 - e t) + b), one channel each."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ground.compiled import compiled
from ground.quantity import Quantity, parameters
from rollover.effects.effect import CHANNELS_OWN, Effect, Heard, Kind, Search
from rollover.recording import Recording
from rollover.recording.record import with_channels
from rollover.spec.channels import describe, is_known

Array = NDArray[np.float64]
OTHER_UNIT = 5.0  # times as far as is simulated, from which on a channel may be in another unit than it says
READ = "one channel and no other: a missing force acts on all that feel it"


def _checked(channel: str) -> None:
    if not is_known(channel) or channel == "time":
        raise ValueError(f"channel: unknown channel, got {channel!r}; see `rollover list channels`")


def _across(channel: str) -> str:
    """The channel across one: y of x, z of y, x of z, tangential of normal; nothing where there is none."""
    if channel.endswith("force_normal"):
        return channel.replace("force_normal", "force_tangential")
    stem, axis = channel[:-1], channel[-1:]
    return stem + {"x": "y", "y": "z", "z": "x"}.get(axis, "") if stem.endswith("_") else ""


def _other_unit(search: Mapping[str, Search], times: float) -> dict[str, Search]:
    """Ranges that reach what a channel in another unit than it says would need, or one that is turned round.

    Not of the logarithm: a factor is met in one step then, however far it is.
    """
    if 1.0 / OTHER_UNIT < times < OTHER_UNIT:
        return dict(search)
    ends = {p: (s.low * times, s.high * times, s.low, s.high) for p, s in search.items()}
    return {p: Search(min(each), max(each)) for p, each in ends.items()}


def is_length(channel: str) -> bool:
    """Whether a channel is one of lengths or angles, which have a scale and no gain."""
    return describe(channel).unit in ("m", "rad")


def _with(recording: Recording, channel: str, values: Array) -> Recording:
    return with_channels(recording, {**recording.channels, channel: values})


@compiled
def _follow(fade: Any, drive: Any, y: Any) -> None:
    for i in range(fade.size):
        y[i + 1] = fade[i] * y[i] + drive[i]


@compiled
def _swing(x: Any, h: Any, rise: Any, tau: float, beta: float, y: Any) -> None:
    """Solve y + tau y' + beta tau^2 y'' = x for x of slopes `rise` over steps h, from y[0] and rise[0] on.

    Beside x - tau x' stands e: with a = 1/(2 beta tau), w^2 = 1/(beta tau^2) - a^2,
    e(h) = exp(-a h) (e_0 cos wh + (e'_0 + a e_0) sin(wh)/w), two fadings where w^2 < 0; w is kept from 0.
    """
    a, stiffness = 0.5 / (beta * tau), 1.0 / (beta * tau * tau)
    w = max(math.sqrt(abs(stiffness - a * a)), 1e-6 * a)
    rate = rise[0]
    for i in range(h.size):
        e, turning = y[i] - (x[i] - tau * rise[i]), rate - rise[i]
        if stiffness > a * a:
            fade = math.exp(-a * h[i])
            c, s = fade * math.cos(w * h[i]), fade * math.sin(w * h[i]) / w
        else:
            slow, fast = math.exp((w - a) * h[i]), math.exp(-(w + a) * h[i])
            c, s = 0.5 * (slow + fast), 0.5 * (slow - fast) / w
        y[i + 1] = x[i + 1] - tau * rise[i] + c * e + s * (turning + a * e)
        rate = rise[i] + c * turning - s * (a * turning + stiffness * e)


@parameters
class SensorMisalignment(Effect):
    """y = cos(angle) x + sin(angle) x_across: a sensor whose axis is turned towards the next one."""

    channel: Annotated[str, "that is misread"] = "striker/acceleration_z"
    angle: Annotated[float, Quantity("rad", "between the sensor's axis and its channel", least=-1.6, most=1.6)] = 0.05

    id = "sensor-misalignment"
    kind: ClassVar[Kind] = "sensor"
    family = "a sensor that points elsewhere"
    equation = "y = cos(angle) x + sin(angle) x_across; across: y for x, z for y, x for z, tangential for normal"
    source = "mounting, 1-5 deg (recalled)"
    sentence = "The sensor of {channel} is turned by {angle}."
    rivals: ClassVar[Mapping[str, str]] = {
        "sensor-gain": "a motion across the channel: a gain reads nothing of it",
        "slope": "turn the vehicle: a misaligned sensor turns with it",
    }
    null: ClassVar[Mapping[str, float | None]] = {"angle": 0.0}
    search: ClassVar[Mapping[str, Search]] = {"angle": Search(-0.3, 0.3)}

    def validate(self) -> None:
        """Refuse a channel that does not exist."""
        _checked(self.channel)

    @classmethod
    def looked_for_on(cls, heard: Heard) -> Mapping[str, Search] | None:
        """Where the channel across was recorded too; an accelerometer alone reads cos(angle), as a low gain would."""
        if _across(heard.channel) in heard.spans:
            return cls.search
        return {"angle": Search(0.0, cls.search["angle"].high)} if "/acceleration_" in heard.channel else None

    def read(self, recording: Recording) -> Recording:
        """Mix in the channel across, where there is one."""
        if self.angle == 0.0 or self.channel not in recording.channels:
            return recording
        across = _across(self.channel)
        read = math.cos(self.angle) * recording[self.channel]
        if across in recording.channels:
            read = read + math.sin(self.angle) * recording[across]
        return _with(recording, self.channel, read)


@parameters
class SensorLag(Effect):
    """y + tau y' + beta tau^2 y'' = x: a slow sensor or a filter of first or second order that is not documented."""

    channel: Annotated[str, "that is misread"] = "ground/force_normal"
    time: Annotated[float, Quantity("s", "tau, by which a steady rise is read late", least=0)] = 0.002
    second_order: Annotated[
        float, Quantity("1", "beta: 0 first order, 0.5 Butterworth, 1/(4 zeta^2) of damping zeta", least=0, most=1)
    ] = 0.0

    id = "sensor-lag"
    kind: ClassVar[Kind] = "sensor"
    family = "a channel that comes late"
    equation = "y + tau y' + beta tau^2 y'' = x"
    source = "CFC 60 cuts at 100 Hz, about 2 ms (recalled, fairly sure)"
    sentence = "{channel} lags by {time}: its edges are round."
    rivals: ClassVar[Mapping[str, str]] = {
        "sensor-clock-offset": "a sharp edge: a lag rounds it, a clock only moves it",
    }
    null: ClassVar[Mapping[str, float | None]] = {"time": 0.0}
    search: ClassVar[Mapping[str, Search]] = {"time": Search(1e-4, 0.05, "log"), "second_order": Search(0.0, 1.0)}
    secondary = ("second_order",)

    def validate(self) -> None:
        """Refuse a channel that does not exist."""
        _checked(self.channel)

    def read(self, recording: Recording) -> Recording:
        """Solve the lag exactly for a signal that is straight between its samples.

        It begins as if the signal had always moved as it does at first: tau dx/dt behind.
        """
        if self.time == 0.0 or self.channel not in recording.channels or recording.time.size < 2:
            return recording
        x, h = recording[self.channel], np.diff(recording.time)
        y = x.copy()
        with np.errstate(invalid="ignore"):  # what is infinite has no slope, and stays so
            y[0] -= self.time * (x[1] - x[0]) / h[0]
        if self.second_order > 0.0:
            rise = np.diff(x) / h
            _swing(x, h, rise, self.time, self.second_order, y)
            return _with(recording, self.channel, y)
        ratio = h / self.time
        fade = np.exp(-ratio)
        rest = -np.expm1(-ratio) / ratio  # mean of the fading over the step
        gain_old, gain_new = rest - fade, 1.0 - rest
        _follow(fade, gain_old * x[:-1] + gain_new * x[1:], y)
        return _with(recording, self.channel, y)


@parameters
class SensorScale(Effect):
    """y = scale x: a position or length channel with a wrong scale."""

    channel: Annotated[str, "that is misread; a position or a length"] = "ground/sinkage"
    scale: Annotated[float, Quantity("1", "what is read over what is", above=0, most=1e6)] = 1.02

    id = "sensor-scale"
    kind: ClassVar[Kind] = "sensor"
    family = "a channel read at a wrong scale"
    equation = "y = scale x"
    source = "1-2 % for displacement sensors (recalled)"
    sentence = "{channel} reads {scale} times the true value."
    rivals: ClassVar[Mapping[str, str]] = {
        "co-moving-mass": "the double integral of the acceleration against the displacement",
        "impact-speed": "the double integral of the acceleration against the displacement",
    }
    null: ClassVar[Mapping[str, float | None]] = {"scale": 1.0}
    search: ClassVar[Mapping[str, Search]] = {"scale": Search(0.8, 1.25, "log")}

    def validate(self) -> None:
        """Refuse a channel that does not exist."""
        _checked(self.channel)

    @classmethod
    def looked_for_on(cls, heard: Heard) -> Mapping[str, Search] | None:
        """A scale is that of a position or a length."""
        return _other_unit(cls.search, abs(heard.times)) if is_length(heard.channel) else None

    def read(self, recording: Recording) -> Recording:
        """Scale the channel."""
        if self.channel not in recording.channels:
            return recording
        return _with(recording, self.channel, self.scale * recording[self.channel])


@parameters
class SensorGain(Effect):
    """y = gain x: an amplifier that is not what its calibration says."""

    channel: Annotated[str, "that is misread"] = "ground/force_normal"
    gain: Annotated[float, Quantity("1", "what is read over what is", least=-1e6, most=1e6)] = 1.03

    id = "sensor-gain"
    kind: ClassVar[Kind] = "sensor"
    family = "a channel read at a wrong scale"
    equation = "y = gain x"
    source = "1-5 % (recalled)"
    sentence = "{channel} reads {gain} times the true value."
    rivals: ClassVar[Mapping[str, str]] = {
        "sensor-bias": "the level before contact, where a gain reads nothing",
        "sensor-misalignment": "a motion across the channel: a gain reads nothing of it",
        "mass": "the level at rest against a weighed mass",
    }
    null: ClassVar[Mapping[str, float | None]] = {"gain": 1.0}
    search: ClassVar[Mapping[str, Search]] = {"gain": Search(0.7, 1.4, "log")}

    def validate(self) -> None:
        """Refuse a channel that does not exist."""
        _checked(self.channel)

    @classmethod
    def looked_for_on(cls, heard: Heard) -> Mapping[str, Search] | None:
        """A gain is that of all but positions and lengths."""
        return None if is_length(heard.channel) else _other_unit(cls.search, heard.times)

    def read(self, recording: Recording) -> Recording:
        """Scale the channel."""
        if self.channel not in recording.channels:
            return recording
        return _with(recording, self.channel, self.gain * recording[self.channel])


@parameters
class SensorClockOffset(Effect):
    """y(t) = x(t - offset): a channel whose clock started at another time."""

    channel: Annotated[str, "that is misread"] = "ground/force_normal"
    offset: Annotated[float, Quantity("s", "by which it comes late", least=-1, most=1)] = 0.002

    id = "sensor-clock-offset"
    kind: ClassVar[Kind] = "sensor"
    family = "a channel that comes late"
    equation = "y(t) = x(t - offset)"
    source = "recorders that were started by hand or by a trigger of their own (recalled)"
    sentence = "{channel} comes {offset:late|early}."
    rivals: ClassVar[Mapping[str, str]] = {
        "sensor-lag": "a sharp edge: a lag rounds it, a clock only moves it",
        "sensor-clock-drift": "two events far apart in time",
    }
    null: ClassVar[Mapping[str, float | None]] = {"offset": 0.0}
    search: ClassVar[Mapping[str, Search]] = {"offset": Search(-0.05, 0.05)}

    def validate(self) -> None:
        """Refuse a channel that does not exist."""
        _checked(self.channel)

    def read(self, recording: Recording) -> Recording:
        """Shift the channel; beyond its ends it stays what it was there."""
        if self.offset == 0.0 or self.channel not in recording.channels:
            return recording
        late = np.interp(recording.time - self.offset, recording.time, recording[self.channel])
        return _with(recording, self.channel, late)


@parameters
class SensorClockDrift(Effect):
    """y(t) = x(t - drift t): a channel whose clock runs at another rate."""

    channel: Annotated[str, "that is misread"] = "ground/force_normal"
    drift: Annotated[float, Quantity("1", "seconds late per second", least=-0.5, most=0.5)] = 1e-3

    id = "sensor-clock-drift"
    kind: ClassVar[Kind] = "sensor"
    family = "a channel that comes late"
    equation = "y(t) = x((1 - drift) t)"
    source = "20-100 ppm for quartz (recalled, fairly sure); more where two recorders were joined"
    sentence = "The clock of {channel} falls behind by {drift} of the time."
    rivals: ClassVar[Mapping[str, str]] = {"sensor-clock-offset": "two events far apart in time"}
    null: ClassVar[Mapping[str, float | None]] = {"drift": 0.0}
    search: ClassVar[Mapping[str, Search]] = {"drift": Search(-0.05, 0.05)}

    def validate(self) -> None:
        """Refuse a channel that does not exist."""
        _checked(self.channel)

    def read(self, recording: Recording) -> Recording:
        """Stretch the channel; beyond its ends it stays what it was there."""
        if self.drift == 0.0 or self.channel not in recording.channels:
            return recording
        late = np.interp((1.0 - self.drift) * recording.time, recording.time, recording[self.channel])
        return _with(recording, self.channel, late)


@parameters
class SensorBias(Effect):
    """y = x + bias: a zero that was not set, or that moved."""

    channel: Annotated[str, "that is misread"] = "ground/force_normal"
    bias: Annotated[float, Quantity(CHANNELS_OWN, "what is read of nothing")] = 50.0

    id = "sensor-bias"
    kind: ClassVar[Kind] = "sensor"
    family = "a channel read with an offset"
    equation = "y = x + bias"
    source = "definition"
    sentence = "{channel} reads {bias:too much|too little} throughout."
    rivals: ClassVar[Mapping[str, str]] = {
        "sensor-gain": "the level before contact, where a gain reads nothing",
        "soil-adhesion": "the level before contact, where nothing holds",
    }
    null: ClassVar[Mapping[str, float | None]] = {"bias": 0.0}
    search: ClassVar[Mapping[str, Search]] = {"bias": Search(-500.0, 500.0)}

    def validate(self) -> None:
        """Refuse a channel that does not exist."""
        _checked(self.channel)

    @classmethod
    def looked_for_on(cls, heard: Heard) -> Mapping[str, Search] | None:
        """Half of what the channel moves over, to either side."""
        half = 0.5 * heard.spans[heard.channel]
        return {"bias": Search(-half, half)}

    def read(self, recording: Recording) -> Recording:
        """Shift the channel's values."""
        if self.bias == 0.0 or self.channel not in recording.channels:
            return recording
        return _with(recording, self.channel, recording[self.channel] + self.bias)


@parameters
class SensorClipping(Effect):
    """y = min(max(x, -limit), limit): an amplifier or converter at the end of its range."""

    channel: Annotated[str, "that is misread"] = "ground/force_normal"
    limit: Annotated[float | None, Quantity(CHANNELS_OWN, "end of the range to both sides", above=0)] = 3e3

    id = "sensor-clipping"
    kind: ClassVar[Kind] = "sensor"
    family = "a channel cut off at its range"
    equation = "y = min(max(x, -limit), limit)"
    source = "definition"
    sentence = "{channel} ends at {limit}: its tops are flat."
    rivals: ClassVar[Mapping[str, str]] = {
        "rops-plasticity": "a second channel that feels the force: it goes on rising"
    }
    null: ClassVar[Mapping[str, float | None]] = {"limit": None}
    search: ClassVar[Mapping[str, Search]] = {"limit": Search(10.0, 1e6, "log")}

    def validate(self) -> None:
        """Refuse a channel that does not exist."""
        _checked(self.channel)

    @classmethod
    def looked_for_on(cls, heard: Heard) -> Mapping[str, Search] | None:
        """Up to a little above all that the channel moves over; where its values end, if they do."""
        low, high = 0.1 * heard.spans[heard.channel], 1.05 * heard.spans[heard.channel]
        return {"limit": Search(low, high, suggested=heard.end if low < heard.end < high else None)}

    def read(self, recording: Recording) -> Recording:
        """Cut the channel off."""
        if self.limit is None or self.channel not in recording.channels:
            return recording
        return _with(recording, self.channel, np.clip(recording[self.channel], -self.limit, self.limit))


# in which what is read comes about, whatever the order in a file
ORDER = tuple(
    kind.id
    for kind in (
        SensorMisalignment,
        SensorLag,
        SensorScale,
        SensorGain,
        SensorClockOffset,
        SensorClockDrift,
        SensorBias,
        SensorClipping,
    )
)
