"""A signal: a quantity at instants, from a number, from a table, or from a recording in a file beside.

Files of recordings are read in a package above this one, which enters its reader in `READERS`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Protocol

import numpy as np
from numpy.typing import NDArray

from ground.quantity import Quantity, parameters
from rollover.spec.document import Node, Written, check, planted
from rollover.system.errors import InputError

Array = NDArray[np.float64]
FORMS = "{time: [...], value: [...]} or {file: NAME, channel: NAME}"
MOST_SAMPLES = 50_000  # each costs 0.14 ms where a result's scenario is written: 7 s


class SignalReader(Protocol):
    """What reads the signal of a file."""

    def __call__(self, given: SignalFile, node: Node, path: str, unit: str, /) -> tuple[Array, Array]:
        """Instants (n,), s, and values (n,) in `unit`. Raises `InputError`."""


READERS: dict[str, SignalReader] = {}  # by the key that a signal is given under


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
    time, values = READERS["file"](given, node, path, unit)
    signal = {
        "time": time.tolist(),
        "value": values.tolist(),
        "offset": 0.0 if given.offset is None else given.offset,
        "factor": given.factor,
    }
    return replace(node, value=planted(signal, node.place).value)
