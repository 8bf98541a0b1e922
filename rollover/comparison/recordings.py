"""Recordings by name, from files, folders or memory, and which of them are held out."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from rollover.comparison.profiles import profile_of
from rollover.recording import Recording
from rollover.recording.importers import read_named
from rollover.system.errors import Fault, InputError, hint

Source = str | os.PathLike[str] | Recording
Recordings = Source | Sequence[Source] | Mapping[str, Source]


def read(paths: Sequence[str | Path], profile: Path | None = None) -> dict[str, Recording]:
    """Recordings by name, those in folders too. Raises `InputError` for all faults at once, and for one name twice."""
    return {name: recording for name, (_, recording) in read_named(paths, profile_of(profile)).items()}


def measured(given: Recordings, profile: str | os.PathLike[str] | None = None) -> dict[str, Recording]:
    """Recordings by name, see `gathered`. Raises `InputError`."""
    return {name: recording for name, (_, recording) in gathered(given, profile).items()}


def gathered(
    given: Recordings, profile: str | os.PathLike[str] | None = None
) -> dict[str, tuple[Path | None, Recording]]:
    """Path (None: from memory) and recording by name, in the order given.

    Files are named as `read_named` does it, recordings from memory by their title, those of a mapping by its keys.
    Raises `InputError` for all faults at once, for nothing, and for one name twice.
    """
    known = profile_of(None if profile is None else Path(profile))
    sources = list(_sources(given))
    if not sources:
        raise InputError(Fault(path="recordings", message="none, got nothing; at least one is needed"))
    paths = [Path(source) for key, source in sources if not key and not isinstance(source, Recording)]
    if len(paths) == len(sources):
        return {**read_named(paths, known)}
    found: dict[str, tuple[Path | None, Recording]] = {}
    faults: list[Fault] = []
    for key, source in sources:
        named: Mapping[str, tuple[Path | None, Recording]]
        if isinstance(source, Recording):
            named = {key or source.title: (None, source)}
        else:
            try:
                named = {**read_named([Path(source)], known)}
            except InputError as e:
                faults += e.faults
                continue
            if key and len(named) > 1:
                message = f"{len(named)} recordings for one name, got {key!r}; one file for each name is needed"
                faults.append(Fault(file=str(source), message=message))
                continue
            named = {key: next(iter(named.values()))} if key else named
        for name, one in named.items():
            if name in found:
                message = f"a second recording by this name, got {name!r}; a mapping of name -> recording is allowed"
                faults.append(Fault(file=None if one[0] is None else str(one[0]), path="recordings", message=message))
            found[name] = one
    if faults:
        raise InputError(*faults)
    return found


def _sources(given: Recordings) -> Iterator[tuple[str, Source]]:
    """Name ("": its own) and source of each."""
    if isinstance(given, (str, os.PathLike, Recording)):
        yield "", given
    elif isinstance(given, Mapping):
        yield from given.items()
    else:
        yield from (("", source) for source in given)


def digest(path: Path | None, recording: Recording) -> str:
    """SHA-256 of a recording's file: of a run's folder its channels, of another one all files with their names.

    Of a recording from memory that of its names, stamps and values.
    """
    every = hashlib.sha256()
    if path is None:
        for name, values in {"time": recording.time, **recording.channels}.items():
            every.update(f"{name}\0".encode() + values.astype("<f8").tobytes())
        return every.hexdigest()
    path = path / "channels.parquet" if (path / "channels.parquet").is_file() else path
    if path.is_file():
        return hashlib.sha256(path.read_bytes()).hexdigest()
    for file in sorted(p for p in path.rglob("*") if p.is_file()):
        every.update(f"{file.relative_to(path).as_posix()}\0".encode() + hashlib.sha256(file.read_bytes()).digest())
    return every.hexdigest()


def check_names(names: Sequence[str], given: Sequence[str], option: str) -> None:
    """Refuse names that no recording has; `option` is where they were given. Raises `InputError`."""
    for name in given:
        if name not in names:
            raise InputError(Fault(file=option, message=f"no such recording, got {name!r}; {hint(name, names)}"))


def held_out(names: Sequence[str], given: Sequence[str], option: str = "hold_out") -> list[str]:
    """The names of `given`, sorted, once each; `option` is where they were given. Raises `InputError`."""
    check_names(names, given, option)
    if set(names) <= set(given):
        raise InputError(Fault(file=option, message=f"nothing left to fit, got all of {', '.join(names)}"))
    return sorted(set(given))
