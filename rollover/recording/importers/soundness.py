"""What every recording has, read or to be written: stamps that increase, and channels of finite numbers or gaps."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Concatenate, ParamSpec

import numpy as np
from numpy.typing import NDArray

from rollover.recording import Recording
from rollover.system.errors import Fault, InputError

P = ParamSpec("P")

Array = NDArray[np.float64]
RATE_CURE = "; a clock too coarse for its samples: `rate` in Hz in a profile, and no column of time"
Line = Callable[[int], int | None]  # row of a channel -> line of the file, for messages


def check_recording(path: Path, recording: Recording) -> None:
    """Refuse what could not be read back once it is written; `path` is where it is from. Raises `InputError`."""
    if not recording.channels:
        raise InputError(
            Fault(file=str(path), message="nothing but time, got no other channel; one at least is needed")
        )
    check_time(path, recording.time)
    for name, values in recording.channels.items():
        check_values(path, name, values)


def sound(read: Callable[Concatenate[Path, P], Recording]) -> Callable[Concatenate[Path, P], Recording]:
    """A reader whose recordings have passed `check_recording`."""

    def within(path: Path, /, *args: P.args, **kwargs: P.kwargs) -> Recording:
        recording = read(path, *args, **kwargs)
        check_recording(path, recording)
        return recording

    return within


def check_time(path: Path, time: Array, line: Line = lambda row: None, other: str = "") -> None:
    """Refuse stamps that are missing, infinite, repeated or run backwards. Raises `InputError` with the line.

    `other` names a column of stamps that could be taken instead.
    """
    if time.size == 0:
        raise InputError(Fault(file=str(path), message="empty, got no time stamps"))
    wrong = np.flatnonzero(~np.isfinite(time))
    if wrong.size:
        row = int(wrong[0])
        raise _at(path, line, row, f"time: not a finite number, got {time[row]}; every row needs a stamp")
    wrong = np.flatnonzero(np.diff(time) <= 0.0)
    if wrong.size:
        row = int(wrong[0]) + 1
        what = "repeated stamp" if time[row] == time[row - 1] else "runs backwards"
        cure = RATE_CURE if time[row] == time[row - 1] else ""
        if other:
            cure = f", or a profile takes other stamps: {{{other!r}: {{channel: time}}}}"
        got = f"got {float(time[row])!r} after {float(time[row - 1])!r}"
        raise _at(path, line, row, f"time: {what}, {got}; it must increase{cure}")


def check_values(path: Path, name: str, values: Array, line: Line = lambda row: None) -> None:
    """Refuse a column without a single number, and infinities. Raises `InputError` with the line."""
    with np.errstate(all="ignore"):  # of huge ones it is infinite too
        total = float(np.sum(values))  # one pass finds any gap or infinity
    if np.isfinite(total):
        return
    wrong = np.flatnonzero(np.isinf(values))
    if wrong.size:
        row = int(wrong[0])
        raise _at(path, line, row, f"column {name}: not a finite number, got {values[row]}; a number or an empty cell")
    if np.isnan(values).all():
        raise _at(path, line, 0, f"column {name}: all gaps, got not one number; leave the column out")


def _at(path: Path, line: Line, row: int, message: str) -> InputError:
    number = line(row)
    message = message if number is not None else f"sample {row}: {message}"
    return InputError(Fault(file=str(path), line=number, message=message))
