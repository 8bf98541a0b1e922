"""MDF 3 and 4 of vehicle loggers: channels by name, each group with its own clock."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rollover.importers.importer import Importer, check_claim, library, reading, starts_with
from rollover.importers.sidecar import Described
from rollover.importers.signals import Signal, assemble
from rollover.recording import Recording


def _read(path: Path, profile: Described | None) -> Recording:
    asammdf = library("asammdf", "mdf", path)
    signals: dict[str, Signal] = {}
    with reading(path, "MDF"), asammdf.MDF(str(path)) as file:
        check_claim(path, sum(int(group.channel_group.cycles_nr) * len(group.channels) for group in file.groups))
        for name, places in file.channels_db.items():
            group, index = places[0]
            if file.groups[group].channels[index].channel_type in (2, 3):  # the group's own clock
                continue
            if profile is not None and name not in profile.columns:
                signals[name] = Signal(values=np.empty(0))
                continue
            got = file.get(name, group=group, index=index)
            values = np.asarray(got.samples)
            if values.ndim == 1 and values.dtype.kind in "fiu":
                time = np.asarray(got.timestamps, dtype=np.float64)
                signals[name] = Signal(values=values.astype(np.float64), unit=str(got.unit or ""), time=time)
    return assemble(path, signals, profile)


MDF = Importer(
    name="mdf",
    meaning="MDF 3 and 4 of vehicle loggers",
    sniff=lambda path: starts_with(path, b"MDF     ", b"UnFinMF "),
    read=_read,
)
