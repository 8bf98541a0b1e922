"""Pieces of a TDMS file: a logger appends to it, and may say something else of a channel each time.

The reader keeps the last word alone, of the start of a waveform too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

START = "wf_start_time"
MATTERS = ("wf_increment", "wf_start_offset", "wf_xunit_string", "unit_string")
SCALES = ("NI_Scale[", "NI_Number_Of_Scales", "NI_Scaling_Status")
ON_TIME = 1.0  # step: a start that is written again lies as near to where the samples have come


@dataclass(frozen=True, kw_only=True)
class Pieces:
    """What changes within a file, by path of a channel, a group or the file."""

    starts: Mapping[str, Sequence[tuple[int, Any]]] = field(default_factory=dict)  # sample, stamp from there on
    changed: Mapping[str, str] = field(default_factory=dict)  # in words


def opened(nptdms: Any, path: Path) -> tuple[Any, Pieces]:
    """A file of `nptdms` that is open for its data, and what each of its pieces says anew, from one reading."""
    starts: dict[str, list[tuple[int, Any]]] = {}
    changed: dict[str, str] = {}

    class Reader(nptdms.reader.TdmsReader):  # type: ignore[misc]
        counts: Mapping[str, int] = MappingProxyType({})  # values before the piece that is being read

        def _update_object_metadata(self, segment: Any) -> None:
            self.counts = {path: about.num_values for path, about in self.object_metadata.items()}
            super()._update_object_metadata(segment)

        def _update_object_properties(self, segment_object_properties: Any) -> None:
            written = any(self.counts.values())
            for name, properties in (segment_object_properties or {}).items():
                known = self._get_or_create_object(name).properties
                # what holds no data is of all that was written; a channel that begins here has nothing before it
                before = self.counts.get(name, 0 if name in self.object_metadata else 1)
                for key, value in properties:
                    is_same = key in known and bool(known[key] == value)  # many writers repeat what holds still
                    if key == START and not is_same:
                        said, at = starts.setdefault(name, []), self.counts.get(name, 0)
                        said[:] = [*(one for one in said if one[0] != at), (at, value)]
                    is_new = written and before > 0 and not is_same
                    if is_new and (key in MATTERS or key.startswith(SCALES)):
                        changed.setdefault(name, f"{key} changes within the file, got {known.get(key)} and {value}")
            super()._update_object_properties(segment_object_properties)

    class File(nptdms.TdmsFile):  # type: ignore[misc]
        def _read_file(self, reader: Any, only_metadata: bool, keep_open: bool) -> None:
            reader.close()
            self._reader = Reader(str(path))
            super()._read_file(self._reader, only_metadata, keep_open)

    file = File(str(path), raw_timestamps=True, read_metadata_only=True, keep_open=True)
    return file, Pieces(starts=starts, changed=changed)


def continued(
    time: NDArray[np.float64], step: float, starts: Sequence[tuple[int, int]]
) -> tuple[NDArray[np.float64], str]:
    """Stamps of samples that were written in pieces, each from its own start (sample, ns); what is to be said of them.

    Raises ``ValueError`` where the pieces overlap.
    """
    own = time.copy()
    for at, began in starts:
        own[at:] = time[0] + (began - starts[0][1]) / 1e9 + step * np.arange(time.size - at)
    jumps = np.array([own[at] - time[at] for at, _ in starts])
    if np.all(np.abs(jumps) <= ON_TIME * step):
        return time, ""
    if np.any(np.diff(own) <= 0.0):
        raise ValueError(f"its {len(starts)} pieces overlap in time by their {START}; pieces one after the other")
    return own, f"{len(starts)} pieces by their {START}, at {', '.join(f'{own[at]:g}' for at, _ in starts[:6])} s"
