"""Histories of a comparison on disk: what was measured and what was simulated, as they were rated."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rollover.comparison.compared import FORMAT
from rollover.comparison.misfit import ChannelMisfit, Misfit
from rollover.recording import Recording, read_parquet, write_parquet
from rollover.system.boundary import worded
from rollover.system.errors import Fault, InputError
from rollover.system.names import distinct
from rollover.system.own_json import TEXT, read_json, refuse_other

JSON = "compare.json"
SIDES = ("measured", "simulated")
ANY = {"format": TEXT, **dict.fromkeys(("baseline", "candidate"), ({"folder": TEXT},))}  # of recordings or of two runs
COMPARED = {"recordings": [TEXT]}
AGAIN = "`rollover compare` writes it anew"

Array = NDArray[np.float64]


def files_of(names: Sequence[str], start: str, ending: str) -> dict[str, str]:
    """Name of a file for each recording; that of a single one has the plain name."""
    if len(names) == 1:
        return dict.fromkeys(names, f"{start}{ending}")
    made = distinct((f"{start}-{name}" for name in names), ending, file="rollover compare")
    return {name: f"{made[f'{start}-{name}']}{ending}" for name in names}


def curve_files(names: Sequence[str]) -> dict[tuple[str, str], str]:
    """File of each side of each recording, by recording and side."""
    each = {side: files_of(names, side, ".parquet") for side in SIDES}
    return {(name, side): each[side][name] for name in names for side in SIDES}


def write_curves(found: Sequence[Misfit], files: dict[tuple[str, str], str], folder: Path) -> None:
    """Write both sides of each comparison, at the recording's stamps and behind the filter that both went through."""
    for each in found:
        time = np.unique(np.concatenate([c.time for c in each.channels])) if each.channels else np.zeros(0)
        for side in SIDES if time.size else ():
            made = Recording(
                title=f"{each.title}, {each.recording}: {side}",
                source="rollover compare",
                time=time,
                channels={c.channel: _on(time, c, getattr(c, side)) for c in each.channels},
                cfc={c.channel: c.cfc for c in each.channels if c.cfc},
            )
            write_parquet(made, folder / files[each.recording, side])


def read_curves(folder: Path) -> dict[str, tuple[Path, Recording]]:
    """File and recording by name (`NAME-measured`) of what `write_curves` wrote; nothing of a folder that is none.

    Raises `InputError` for a comparison without them.
    """
    if not (folder / JSON).is_file():
        return {}
    try:
        said = read_json(folder / JSON, ANY)
        if said["format"] == FORMAT:
            refuse_other(said, COMPARED)
    except (OSError, ValueError) as e:
        message = f"cannot be read: {worded(e)}; {AGAIN}"
        raise InputError(Fault(file=str(folder / JSON), message=message)) from None
    if said["format"] != FORMAT:
        sides = [said[side]["folder"] for side in ("baseline", "candidate") if said.get(side)]
        message = f"two runs compared, got no histories of its own; those of the runs: {', '.join(sides)}"
        raise InputError(Fault(file=str(folder), message=message))
    found = {}
    for (name, side), file in curve_files(said["recordings"]).items():
        if not (folder / file).is_file():
            raise InputError(Fault(file=str(folder), message=f"no {file} there; {AGAIN}"))
        found[f"{name}-{side}"] = (folder / file, read_parquet(folder / file))
    return found


def _on(time: Array, channel: ChannelMisfit, values: Array) -> Array:
    """Values at a channel's own stamps on all of them, gaps NaN."""
    placed = np.full(time.size, np.nan)
    placed[np.searchsorted(time, channel.time)] = values
    return placed
