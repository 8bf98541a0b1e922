"""Signals out of recordings: the channel that a scenario names as what drives a run."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rollover.recording.record import Recording
from rollover.spec.channels import describe
from rollover.spec.document import Node, beside
from rollover.spec.inputs.signal import SignalFile
from rollover.system.errors import hint

Array = NDArray[np.float64]
WHOLE = 1.5  # longest over median interval of a clock that jitters; where one sample is missing it is 2
PROFILES = (".yaml", ".yml")
WHAT = {"file": "recording", "profile": "profile"}
SI = {"deg": ("rad", np.degrees)}  # unit of a key that is not SI: the SI unit, and from there to it


def read_signal(given: SignalFile, node: Node, path: str, unit: str) -> tuple[Array, Array]:
    """Instants (n,), s, and values (n,) in `unit` of the channel that a file is given for. Raises `InputError`."""
    assert isinstance(node.value, Mapping)  # `given` was read from it
    recording = _recording(given, node.value, path)
    if given.offset is None and recording.clock.zero == "unknown":
        what = f"the clock of {given.file} has no known zero, got no offset"
        raise node.place.fault(f"{path}.offset", f"{what}; the scenario's time at its time 0 is needed")
    return _samples(recording, given, node.value["channel"], path, unit)


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
