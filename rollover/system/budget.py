"""What reading a file may cost: the limits on what it claims, where they come from, and the variable that raises them.

A claim is what a file says that it holds (a shape, a size unpacked, a number of cases): a few bytes can say anything.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from rollover.system.errors import Fault, InputError

VARIABLE = "ROLLOVER_BUDGET"  # a factor on every limit here

MB = 1_000_000
FLOOR = 64 * MB  # bytes that a file of any size may unpack to: eight million numbers, read in a third of a second
RATIO = 200  # bytes unpacked of a byte: numbers shrink 2 to 20 times, whole channels of zeros beside them some 100
MOST = 4000 * MB  # bytes of one file: 500 million numbers are more than a recording of one test has
FILES = 10_000  # in an archive, where a test has a few hundred; each costs a look-up
IN_ARCHIVE = 1 << 28  # bytes of one file in it, ten million samples as text
SMALL = 1 << 20  # bytes that a file in an archive may unpack to from any size; beyond, `RATIO`
KEPT = 256 * MB  # bytes unpacked of an archive that are kept while its files are read one by one
TEXT = 1 * MB  # characters of YAML beside rows of numbers: the parser takes 1.7 s for them
ROWS = 16 * MB  # characters of YAML in all: the largest grid of heights, half a million numbers, has 10 million
VALUES = 30_000  # of one YAML text, aliases in full: 55 us each, 1.7 s; more than 25,000, which that grid counts as
ROW = 20  # numbers of a row that cost as much as one other value
CASES = 1_000_000  # of a study, and levels of an axis: half an hour of drop tests, the shortest case of all
POINTS = 10 * CASES  # cases times axes: 80 MB for each copy of the table
LEVELS_TRIED = 200  # levels of an axis that are tried when a study is read, 5 ms each
MEMORY = 8  # bytes that a reader may take per byte that may be claimed: raw, scaled, stamps, sent, and as many again
BASE = 500 * MB  # bytes that a reader takes besides, for what it imports while it reads
PROCESSOR = 4.0  # s for a small file: the slowest reader takes 0.3 s for one
PER_MB = 10.0  # s per MB of a file: the slowest, messages in JSON in compressed chunks, takes 3 s
WALL = 60.0  # s beside the processor's, for a disk or network that is slow, or a machine that is busy

_MOST_COUNTED = 10**15  # counts are told up to here: a file may have a number of a thousand digits


def factor() -> float:
    """What the user multiplies all limits by. Raises `InputError` for what is no factor."""
    text = os.environ.get(VARIABLE, "1")
    try:
        found = float(text)
    except ValueError:
        found = math.nan
    if not 0.0 < found <= 1e6:
        message = f"not a factor, got {text!r}; a number above 0 and at most 1e6, usually 1"
        raise InputError(Fault(file=VARIABLE, message=message))
    return found


def cure(needed: float) -> str:
    """How to allow what needs `needed` times the limit that holds."""
    enough = math.ceil(factor() * needed * 1.01)
    return f"if it is known to be sound, {VARIABLE}={enough} in the environment allows it"


def unpacked(size: int) -> int:
    """Bytes that a file of `size` bytes may unpack to."""
    return int(factor() * min(MOST, max(FLOOR, RATIO * size)))


def amount(count: float) -> str:
    """Bytes in words."""
    return f"{count / MB:.3g} MB" if count < 1e9 else f"{count / 1e9:,.4g} GB"


@dataclass
class Budget:
    """Bytes that a file claims, summed up before any of them is made room for."""

    path: Path
    spent: int = 0
    size: int = field(init=False)
    allowed: int = field(init=False)

    def __post_init__(self) -> None:
        self.size = self.path.stat().st_size
        self.allowed = unpacked(self.size)

    def claim(self, count: int, at: str = "") -> None:
        """Add the claim of a part of the file. Raises `InputError` where the sum is too much, or no size at all."""
        if count < 0:
            raise InputError(
                Fault(file=str(self.path), path=at, message=f"claims a negative size, got {count} bytes; a sound file")
            )
        self.spent += count
        if self.spent > self.allowed:
            got = f"got {amount(self.spent)} of contents in a file of {amount(self.size)}"
            most = f"at most {amount(self.allowed)} are allowed"
            message = f"claims too much, {got}; {most}; {cure(self.spent / self.allowed)}"
            raise InputError(Fault(file=str(self.path), path=at, message=message))


def check_count(count: int, most: int, refuse: Callable[[str], Exception], what: str) -> None:
    """Refuse more than `most` of something; `refuse` makes the exception of a message."""
    allowed = max(1, int(factor() * most))
    if count > allowed:
        shown = str(count) if count < _MOST_COUNTED else "more than 1e15"
        needed = min(count, _MOST_COUNTED) / allowed
        raise refuse(f"too many {what}, got {shown}; at most {allowed} are allowed; {cure(needed)}")


def processor(size: int) -> float:
    """Seconds of the processor that reading a file of `size` bytes may take."""
    return factor() * (PROCESSOR + PER_MB * size / MB)


def wall(size: int) -> float:
    """Seconds in all that reading a file of `size` bytes may take."""
    return factor() * WALL + 4.0 * processor(size)


def memory(size: int) -> float:
    """Bytes that the process may take that reads a file of `size` bytes."""
    return BASE + MEMORY * float(unpacked(size))
