"""Recording: named channels over time, simulated and measured alike; Parquet files of them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rollover.channels import describe
from rollover.faults import Fault, InputError

FORMAT = "rollover-channels/1"


@dataclass(frozen=True, kw_only=True)
class Recording:
    """Channels (see `channels.CHANNELS`), SI, one value each per time stamp; gaps are NaN.

    `time` (n,) strictly increasing, s; `channels` name -> (n,); `noise` name -> 1 sigma; `cfc` name -> class
    of the filter already applied.
    """

    title: str
    time: NDArray[np.float64]
    channels: Mapping[str, NDArray[np.float64]]
    source: str = ""
    conditions: Mapping[str, float] = field(default_factory=dict)
    noise: Mapping[str, float] = field(default_factory=dict)
    cfc: Mapping[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.time.ndim != 1 or self.time.size == 0:
            raise ValueError(f"time: empty or not one column, got shape {self.time.shape}; at least one stamp")
        if not np.all(np.diff(self.time) > 0):
            at = int(np.argmin(np.diff(self.time)))
            raise ValueError(f"time: does not increase, got {self.time[at + 1]!r} after {self.time[at]!r}")
        for name, values in self.channels.items():
            if values.shape != self.time.shape:
                raise ValueError(f"{name}: got {values.shape} values for {self.time.shape} time stamps; one each")

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """Values of a channel, (n,)."""
        return self.channels[name]


def write_parquet(recording: Recording, path: Path) -> None:
    """Write one row per time stamp and one column per channel, each with its unit and meaning."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = {"time": recording.time, **recording.channels}
    known = {name: describe(name) for name in table}
    fields = [
        pa.field(name, pa.float64(), metadata={"unit": channel.unit, "meaning": channel.meaning})
        for name, channel in known.items()
    ]
    about = {
        "format": FORMAT,
        "title": recording.title,
        "source": recording.source,
        "conditions": dict(recording.conditions),
        "noise": dict(recording.noise),
        "cfc": dict(recording.cfc),
    }
    schema = pa.schema(fields, metadata={"rollover": json.dumps(about)})
    pq.write_table(pa.table([pa.array(values) for values in table.values()], schema=schema), path)


def read_parquet(path: Path) -> Recording:
    """Read what `write_parquet` wrote, to the last bit. Raises `InputError`."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        table = pq.read_table(path)
    except (OSError, pa.ArrowInvalid) as e:
        raise InputError(Fault(file=str(path), message=f"cannot be read: {str(e).splitlines()[0]}")) from None
    about = json.loads((table.schema.metadata or {}).get(b"rollover", b"{}"))
    if about.pop("format", None) != FORMAT:
        raise InputError(Fault(file=str(path), message=f"not channels of a run; a file of format {FORMAT} is needed"))
    columns = {name: table[name].to_numpy() for name in table.column_names}
    return Recording(time=columns.pop("time"), channels=columns, **about)
