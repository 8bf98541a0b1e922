"""Recording: named channels over time, simulated and measured alike; tables of them on disk. The only pyarrow home."""

from __future__ import annotations

from rollover.recording.pairs import (
    UnreadableError,
    as_numbers,
    put_text,
    read_pairs,
    read_table,
    write_pairs,
    write_table,
)
from rollover.recording.record import Clock, Recording, Sensor, StandardUncertainty
from rollover.recording.runs import FORMAT, arrow_table, data_frame, is_run, read_parquet, write_parquet

__all__ = ["FORMAT", "Clock", "Recording", "Sensor", "StandardUncertainty", "UnreadableError", "as_numbers", "is_run"]
__all__ += ["arrow_table", "data_frame", "put_text", "read_pairs", "read_parquet", "read_table"]
__all__ += ["write_pairs", "write_parquet", "write_table"]
