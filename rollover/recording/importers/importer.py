"""What an importer is, and what they share: the optional library that is missing, the file that cannot be read."""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

from rollover.recording import Recording
from rollover.recording.importers.sidecar import Described
from rollover.recording.importers.soundness import check_recording, sound
from rollover.system import boundary
from rollover.system.boundary import bounded
from rollover.system.budget import Budget
from rollover.system.errors import Fault, InputError, hint


@dataclass(frozen=True, kw_only=True)
class Importer:
    """A file format: `sniff` tells from a path, quickly, whether it is one; `read` gives the recording.

    Where a file may hold several tests, `tests` names them and `read_test` gives one by its name.
    A lab's own format is one of these under the entry point group `rollover.recording.importers`.
    """

    name: str
    meaning: str
    sniff: Callable[[Path], bool]
    read: Callable[[Path, Described | None], Recording]
    tests: Callable[[Path], Sequence[str]] | None = None
    read_test: Callable[[Path, Described | None, str], Recording] | None = None

    def __post_init__(self) -> None:
        """Put every reader behind the boundary, those of other packages too; a file that `sniff` trips over is none."""
        what = f"{self.name} file"
        object.__setattr__(self, "sniff", _sure(self.sniff))
        object.__setattr__(self, "read", bounded(sound(self.read), what))
        if self.tests is not None:
            object.__setattr__(self, "tests", bounded(self.tests, what))
        if self.read_test is not None:
            object.__setattr__(self, "read_test", bounded(sound(self.read_test), what))


@dataclass(frozen=True, kw_only=True)
class Collection:
    """A published set of recordings that a user downloads; `read` gives those whose name fits one of the patterns.

    `channels` gives patterns of those that an import keeps of a recording where no others are asked for.
    """

    name: str
    meaning: str
    citation: str
    licence: str
    where: str
    read: Callable[[Path, Sequence[str]], Iterator[tuple[str, Recording]]]
    channels: Callable[[Recording], Sequence[str]] = lambda _: ("*",)

    def __post_init__(self) -> None:
        """Put the reader behind the boundary; it has read all before the first is handed over."""
        read = self.read

        def whole(path: Path, select: Sequence[str]) -> Iterator[tuple[str, Recording]]:
            found = list(read(path, select))
            for name, recording in found:
                check_recording(path / name, recording)
            return iter(found)

        object.__setattr__(self, "read", bounded(whole, f"{self.name} set"))

    @property
    def source(self) -> str:
        """What a recording says about where it comes from."""
        return f"{self.citation}; {self.where}; licence: {self.licence}"


def _sure(sniff: Callable[[Path], bool]) -> Callable[[Path], bool]:
    def within(path: Path) -> bool:
        with contextlib.suppress(Exception), boundary.quiet():
            return sniff(path)
        return False

    return within


def with_channels(recording: Recording, patterns: Sequence[str], file: str) -> Recording:
    """The recording with those channels alone that fit a pattern; the others are named in its notes.

    Raises `InputError` for a pattern that fits none.
    """
    for pattern in patterns:
        if not any(fnmatch(name, pattern) for name in recording.channels):
            message = f"no such channel, got {pattern!r}; {hint(pattern, recording.channels)}"
            raise InputError(Fault(file=file, path="--channel", message=message))
    kept = [name for name in recording.channels if any(fnmatch(name, pattern) for pattern in patterns)]
    left_out = [name for name in recording.channels if name not in kept]
    if not left_out:
        return recording
    note = f"channels left out, --channel '*' keeps them: {', '.join(left_out)}"
    return replace(
        recording,
        channels={name: recording.channels[name] for name in kept},
        noise={name: v for name, v in recording.noise.items() if name in kept},
        cfc={name: v for name, v in recording.cfc.items() if name in kept},
        sensors={name: v for name, v in recording.sensors.items() if name in kept},
        notes=(*recording.notes, note),
    )


def starts_with(path: Path, *marks: bytes) -> bool:
    """Whether a file begins with one of these bytes."""
    try:
        with path.open("rb") as file:
            return file.read(max(map(len, marks))).startswith(marks)
    except OSError:
        return False


def library(name: str, extra: str, path: Path) -> Any:
    """An optional library. Raises `InputError` that says how to get it."""
    try:
        return importlib.import_module(name)
    except ImportError:
        raise _missing(name, extra, path) from None


def check_library(name: str, extra: str, path: Path) -> None:
    """Refuse where an optional library is missing, without importing it. Raises `InputError`."""
    try:
        found = importlib.util.find_spec(name)
    except (ImportError, ValueError):  # of a package that is missing, or half there
        found = None
    if found is None:
        raise _missing(name, extra, path)


def _missing(name: str, extra: str, path: Path) -> InputError:
    package = name.partition(".")[0]
    message = f"needs {package}, which is not installed; pip install 'rollover[{extra}]'"
    return InputError(Fault(file=str(path), message=message))


def reading(path: Path, what: str) -> contextlib.AbstractContextManager[None]:
    """Turn whatever a library says about a broken file into one line. Raises `InputError`."""
    return boundary.reading(path, f"{what} file")


def check_claim(path: Path, values: int, *, most_per_byte: float | None = None) -> None:
    """Refuse a file whose header claims more values than it may hold, before anything is made room for.

    `most_per_byte` is what a format that packs nothing can hold at most.
    """
    size = path.stat().st_size
    if values < 0 or (most_per_byte is not None and values > most_per_byte * size):
        cure = "it is cut off or damaged: a whole file is needed"
        raise InputError(Fault(file=str(path), message=f"claims too much, got {values} values in {size} bytes; {cure}"))
    Budget(path).claim(8 * values)
