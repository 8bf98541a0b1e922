"""A profile of foreign files, its conditions held against what a scenario has."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from rollover.system.errors import InputError, hint

if TYPE_CHECKING:
    from rollover.recording.importers.sidecar import Described


def profile_of(path: Path | None) -> Described | None:
    """A profile; None for none. Raises `InputError`, also for conditions of single files that no scenario has."""
    if path is None:
        return None
    from rollover.recording.importers import read_profile

    given = read_profile(path)
    if given.by_file is None:
        return given
    unread = {name: _unknown(name) for name in given.by_file.places}
    faults = [replace(given.by_file.places[name], message=what) for name, what in unread.items() if what]
    if faults:
        raise InputError(*faults)
    return given


def _unknown(path: str) -> str:
    """What is wrong with a path that leads nowhere in any scenario; nothing where it leads somewhere in one."""
    from rollover.scenario import Scenario
    from rollover.spec import document

    slot = document.slot_of(Scenario)
    steps = path.split(".")
    for depth, step in enumerate(steps):
        inner = slot.element(0) if slot.is_list else slot.child(step)
        if inner is None:
            where = ".".join(steps[:depth]) or "a scenario"
            return f"no such path, got {path!r}; below {where}: {hint(step, slot.keys())}"
        slot = inner
    return ""
