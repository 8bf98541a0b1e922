"""A signal: a quantity at instants, from a number, from a table, or from a recording in a file beside."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from ground.quantity import Quantity, parameters
from rollover.recording import Recording
from rollover.spec.channels import describe
from rollover.spec.document import Node, Written, beside, check, planted
from rollover.system.errors import InputError, hint

Array = NDArray[np.float64]
FORMS = "{time: [...], value: [...]} or {file: NAME, channel: NAME}"
MOST_SAMPLES = 50_000  # each costs 0.14 ms where a result's scenario is written: 7 s
WHOLE = 1.5  # longest over median interval of a clock that jitters; where one sample is missing it is 2
PROFILES = (".yaml", ".yml")
WHAT = {"file": "recording", "profile": "profile"}
SI = {"deg": ("rad", np.degrees)}  # unit of a key that is not SI: the SI unit, and from there to it


@parameters
class Signal:
    """A quantity at instants; the first value holds before them, the last one after them."""

    time: Annotated[tuple[float, ...], Quantity("s", "of the samples, rising")]
    value: Annotated[tuple[float, ...], Quantity("1", "in the unit of the key that the signal stands under")]
    offset: Annotated[float, Quantity("s", "the scenario's time at the signal's time 0")] = 0.0
    factor: Annotated[float, Quantity("1", "by which the values are multiplied")] = 1.0

    def validate(self) -> None:
        """Refuse an empty signal, a value without its instant, and time that does not rise."""
        if not self.time or len(self.time) != len(self.value):
            what = f"got {len(self.value)} for {len(self.time)} of time"
            raise ValueError(f"value: as many as instants are needed, at least one, {what}; one each")
        if len(self.time) > MOST_SAMPLES:
            raise ValueError(f"time: too many samples, got {len(self.time)}; at most {MOST_SAMPLES}, a lower rate")
        steps = np.diff(self.time)
        if np.any(steps <= 0.0):
            k = int(np.argmax(steps <= 0.0))
            raise ValueError(f"time: does not rise, got {self.time[k + 1]!r} after {self.time[k]!r}; later")

    @property
    def instants(self) -> Array:
        """When the samples are, scenario's time, (n,), s."""
        return np.array(self.time) + self.offset

    @property
    def values(self) -> Array:
        """The samples, (n,), in the unit of the key."""
        return np.array(self.value) * self.factor

    def at(self, time: float) -> float:
        """The value at an instant, on straight lines between the samples."""
        return float(np.interp(time, self.instants, self.values))


@parameters
class SignalFile:
    """A signal in a file that `rollover import` reads, beside the one that names it or among the shipped ones."""

    file: Annotated[str, "name of the recording, with its ending"]
    channel: Annotated[str, "name of the channel, in the unit of the key or one that is converted to it"]
    profile: Annotated[str | None, "file that says what the columns are; null: the recording does"] = None
    test: Annotated[str | None, "name of one of several tests in the file"] = None
    offset: Annotated[
        float | None, Quantity("s", "the scenario's time at the recording's time 0; null: 0, if its clock says so")
    ] = None
    factor: Annotated[float, Quantity("1", "by which the values are multiplied")] = 1.0


def written(unit: str, meaning: str) -> Written:
    """Mark a key whose value is a signal in this unit."""
    return Written(unit=unit, meaning=meaning, read=_read, forms=(SignalFile,), allowed=FORMS)


def _read(node: Node, path: str, unit: str) -> Node | None:
    """Time and values where a number or a file stands. Raises `InputError`."""
    if isinstance(node.value, (int, float)) and not isinstance(node.value, bool):
        return replace(node, value=planted({"time": [0.0], "value": [node.value]}, node.place).value)
    if not isinstance(node.value, Mapping) or "file" not in node.value:
        return None
    try:
        given: SignalFile = check(node, SignalFile)
    except InputError as e:
        raise InputError(*(replace(f, path=f"{path}.{f.path}" if f.path else path) for f in e.faults)) from None
    recording = _recording(given, node.value, path)
    if given.offset is None and recording.clock.zero == "unknown":
        what = f"the clock of {given.file} has no known zero, got no offset"
        raise node.place.fault(f"{path}.offset", f"{what}; the scenario's time at its time 0 is needed")
    time, values = _samples(recording, given, node.value["channel"], path, unit)
    signal = {
        "time": time.tolist(),
        "value": values.tolist(),
        "offset": 0.0 if given.offset is None else given.offset,
        "factor": given.factor,
    }
    return replace(node, value=planted(signal, node.place).value)


def _recording(given: SignalFile, keys: Mapping[str, Node], path: str) -> Recording:
    from rollover.recording.importers import ENDINGS, read_recording  # slow to import, and few scenarios read a file

    recordings = tuple(e for e in ENDINGS if e not in PROFILES)
    found: dict[str, Path | None] = {}
    for key, name, endings in (("file", given.file, recordings), ("profile", given.profile, PROFILES)):
        if name is None:
            continue
        if not name.lower().endswith(endings):  # somebody else's scenario names it: no file of any kind
            what = f"not the name of a {WHAT[key]}, got {name!r}"
            raise keys[key].place.fault(f"{path}.{key}", f"{what}; one that ends in {', '.join(endings)} is needed")
        found[key] = beside(name, keys[key])
        if found[key] is None:
            message = f"no such file, got {name!r}; a file beside this one is needed"
            raise keys[key].place.fault(f"{path}.{key}", message)
    file = found["file"]
    assert file is not None  # refused above
    return read_recording(file, profile=found.get("profile"), test=given.test or "")


def _samples(recording: Recording, given: SignalFile, node: Node, path: str, unit: str) -> tuple[Array, Array]:
    """Instants and values of a channel in the unit of the key. Raises `InputError`."""
    path, name = f"{path}.channel", given.channel
    if name not in recording.channels:
        message = f"no such channel in {given.file}, got {name!r}; {hint(name, recording.channels)}"
        raise node.place.fault(path, message)
    needed, convert = SI.get(unit, (unit, None))
    own = describe(name).unit
    if own != needed:
        raise node.place.fault(path, f"a channel in {own}, got {name!r}; one in {needed} is needed here")
    sensor = recording.sensors.get(name)
    if sensor is not None and sensor.gravity == "proper":
        what = f"reads what holds it up beside its motion, got {name!r} with gravity: proper"
        raise node.place.fault(path, f"{what}; coordinate acceleration is needed")
    time, values = recording.samples(name)
    if (gap := _gap(recording, name)) is not None:
        what = f"a gap in {given.file}, got no value of {name!r} from t = {gap[0]:.6g} to {gap[1]:.6g} s"
        raise node.place.fault(path, f"{what}; fill it in the file, or cut the file down to where there is none")
    return time, values if convert is None else convert(values)


def _gap(recording: Recording, name: str) -> tuple[float, float] | None:
    """Where a channel misses samples. Stamps that only others have are none: a slower clock of its own is regular."""
    there = np.isfinite(recording.channels[name])
    if there.all():
        return None
    time = recording.time
    others = [np.isfinite(v) for n, v in recording.channels.items() if n != name]
    alone = ~there & ~np.any(others, axis=0) if others else ~there
    own = time[there]
    if alone.any():  # a stamp at which nothing was measured
        return float(time[alone][0]), float(time[alone][-1])
    if len(own) < 2:
        return float(time[0]), float(time[-1])
    steps = np.diff(own)
    usual = float(np.median(steps))
    if steps.max() > WHOLE * usual:
        k = int(np.argmax(steps))
        return float(own[k]), float(own[k + 1])
    # before the first and after the last of its own samples a slower clock misses less than one
    for first, last in ((float(time[0]), float(own[0])), (float(own[-1]), float(time[-1]))):
        if last - first > (1.0 - 1e-6) * usual:
            return first, last
    return None
