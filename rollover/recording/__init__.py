"""Recording: named channels over time, simulated and measured alike; tables of them on disk. The only pyarrow home."""

from __future__ import annotations

from rollover.recording.record import Clock, Doubt, Recording, Sensor
from rollover.recording.runs import FORMAT, is_run, read_parquet, write_parquet

__all__ = ["FORMAT", "Clock", "Doubt", "Recording", "Sensor", "is_run", "read_parquet", "write_parquet"]
