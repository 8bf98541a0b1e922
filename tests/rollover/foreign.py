"""What the tests of foreign formats share: a profile, reading with it, and the count of all that a file holds."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

import numpy as np
import pytest

from rollover.recording import Recording
from rollover.recording.importers import read_recording

CASES = Path(__file__).parent / "cases"
FORCE, SINKAGE = "ground/force_normal", "ground/sinkage"


def needs(library: str) -> None:
    if importlib.util.find_spec(library) is None:
        pytest.skip(f"{library} is not installed: its format is not tested", allow_module_level=True)


def named(path: Path, columns: dict[str, str], more: str = "") -> Recording:
    """Read a file by a profile of these columns, `name -> channel, and more of its description`."""
    text = "format: rollover-profile/1\n" + more + "channels:\n"
    text += "".join(f"  {name!r}: {{channel: {about}}}\n" for name, about in columns.items())
    profile = path.parent / f"{path.name}.profile.yaml"
    profile.write_text(text)
    return read_recording(path, profile=profile)


def peak(recording: Recording, channel: str = FORCE) -> float:
    return float(np.nanmax(recording[channel]))


def left_out(recording: Recording) -> tuple[int, int]:
    """How many columns the notes say are left out, and how many they say there are."""
    counts = [m.groups() for note in recording.notes if (m := re.match(r"(\d+) of (\d+) columns left out", note))]
    assert len({total for _, total in counts}) == 1
    return sum(int(n) for n, _ in counts), int(counts[0][1])
