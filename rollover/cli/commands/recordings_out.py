"""Recordings into files of one format: what `rollover import` and `rollover export` share."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from rollover.system.errors import Fault, InputError
from rollover.system.names import distinct, inside

if TYPE_CHECKING:
    from rollover.recording import Recording

WITH_SIDECAR = ("csv", "parquet")


def check_format(to: str, formats: Sequence[str]) -> None:
    """Refuse a format that is none of those. Raises `InputError`."""
    if to not in formats:
        raise InputError(Fault(file="--to", message=f"no such format, got {to!r}; {', '.join(formats)} are allowed"))


def written(
    made: Mapping[str, tuple[Path | None, Recording]],
    place: Path,
    to: str,
    *,
    source: str,
    force: bool,
    as_json: bool,
    with_units: bool = False,
) -> None:
    """Write recordings by name (with the file that each was read from, where it is one), all or none, and say so.

    `place` is a folder, or the file of the only one where it ends in `to`. Raises `InputError`.
    """
    from rollover.cli import console
    from rollover.system.writing import hold

    targets = _targets(list(made), place, to, source)
    for target, (at, _) in zip(targets.values(), made.values(), strict=True):
        hold(target)
        if at is not None and target.exists() and target.samefile(at):
            raise InputError(Fault(file=str(target), message="would replace the recording that is read; another --out"))
    beside = [t.with_suffix(".yaml") if to in WITH_SIDECAR else t for t in targets.values()]
    taken = [t for t in (*targets.values(), *beside) if t.exists()]
    if taken and not force:
        raise InputError(Fault(file=str(taken[0]), message="exists; --force replaces it, --out leaves it"))
    rows, recordings = [], {}
    for name, (_, recording) in made.items():
        target = targets[name]
        if place.name != target.name and target.name != f"{name}.{to}":
            what = f"stands for {name!r}, which is no name for a file"
            recording = replace(recording, notes=(*recording.notes, what))
            console.say(f"{target}: {what}")
        recordings[target] = recording
        notes, channels = list(recording.notes), list(recording.channels)
        rows.append({"file": str(target), "samples": recording.time.size, "channels": channels, "notes": notes})
    _write(recordings, with_units)
    if as_json:
        print(json.dumps({"files": rows}, indent=2))
        return
    for row, recording in zip(rows, recordings.values(), strict=True):
        console.tell(f"{row['file']}: {recording.time.size} samples of {len(recording.channels)} channels")
        for note in recording.notes:
            console.tell(f"  note: {note}")


def _targets(names: Sequence[str], place: Path, to: str, source: str) -> dict[str, Path]:
    """File of each name. Raises `InputError`."""
    if not place.name.endswith(f".{to}") or place.is_dir():
        spelt = distinct(names, f".{to}", file=source)
        return {name: inside(place, f"{spelt[name]}.{to}") for name in names}
    if len(names) > 1:
        message = f"one file, and {source} holds {len(names)} recordings, got {', '.join(names[:12])}"
        raise InputError(Fault(file=str(place), message=f"{message}; a folder is needed"))
    return {names[0]: inside(place.parent, place.name, file="--out")}


def _write(made: Mapping[Path, Recording], with_units: bool) -> None:
    """All recordings, or none. Raises `InputError`."""
    from dataclasses import replace

    from rollover.recording.importers import write_recording
    from rollover.system.writing import together

    with together(list(made)[-1]) as part:
        for target, recording in made.items():
            try:
                write_recording(recording, part / target.name, with_units=with_units)
            except InputError as e:  # which names the file that stands there for a while only
                raise InputError(*(replace(fault, file=str(target)) for fault in e.faults)) from None
