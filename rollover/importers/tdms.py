"""TDMS of LabVIEW and DIAdem: channels as `group/channel`, with their own units and clocks."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rollover.faults import Fault, InputError
from rollover.importers.importer import Importer, check_claim, library, reading, starts_with
from rollover.importers.sidecar import Described
from rollover.importers.signals import Signal, assemble
from rollover.recording import Recording


def _read(path: Path, profile: Described | None) -> Recording:
    nptdms = library("nptdms", "tdms", path)
    signals: dict[str, Signal] = {}
    with reading(path, "TDMS"), nptdms.TdmsFile.open(str(path)) as file:
        if file.file_status.incomplete_final_segment:
            message = "cut off, got less than its last segment claims; a whole file is needed"
            raise InputError(Fault(file=str(path), message=message))
        channels = [channel for group in file.groups() for channel in group.channels()]
        check_claim(path, sum(len(channel) for channel in channels), most_per_byte=1.0)
        for channel in channels:
            name = f"{channel.group_name}/{channel.name}"
            if profile is not None and name not in profile.columns:
                signals[name] = Signal(values=np.empty(0))
                continue
            values = np.asarray(channel[:])
            if values.dtype.kind not in "fiu":
                continue
            step, start = (channel.properties.get(key) for key in ("wf_increment", "wf_start_offset"))
            signals[name] = Signal(
                values=values.astype(np.float64),
                unit=str(channel.properties.get("unit_string", "")),
                time=None if step is None else np.asarray((start or 0.0) + float(step) * np.arange(values.size)),
                channel=str(channel.properties.get("rollover_channel", channel.name)),
            )
    return assemble(path, signals, profile)


TDMS = Importer(name="tdms", meaning="TDMS of LabVIEW and DIAdem", sniff=lambda p: starts_with(p, b"TDSm"), read=_read)
