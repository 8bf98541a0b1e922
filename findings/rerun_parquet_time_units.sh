#!/usr/bin/env bash
# rerun-sdk 0.41.0 with pyarrow 26.0.1: ParquetReader overlooks the time unit that a Parquet column carries. pyarrow, pandas
# and polars write times as timestamp[ms], timestamp[us] or duration[ms]; one would guess that a typed column needs no
# `input_unit` and that the wrong one is refused. The bare integers are taken as nanoseconds, or as whatever
# `input_unit` says, and no error or warning tells. A 5 s test becomes 5 us long and its date 1970, and a file written
# again in another resolution changes its time axis by 1000 though each other reader sees the same instants.
# Exits 1 if the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check "rerun-sdk==0.41.0" "pyarrow==26.0.1" "numpy==2.4.6"
cd "$folder"
"$folder/venv/bin/python" - <<'PY'
import sys

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import rerun
from rerun.chunk import IndexColumn
from rerun.experimental import ParquetReader

print("rerun-sdk", rerun.__version__, "pyarrow", pa.__version__)
start = np.datetime64("2026-03-01T12:00:00", "ms")
times = start + np.arange(6) * np.timedelta64(1000, "ms")
seen = {}
for unit in ("ms", "us", "ns"):
    column = pa.array(times).cast(pa.timestamp(unit))
    pq.write_table(pa.table({"t": column, "force": np.arange(6.0)}), "test.parquet")
    read = pq.read_table("test.parquet")["t"].cast(pa.timestamp("ns")).cast(pa.int64()).to_numpy()
    stream = ParquetReader("test.parquet").stream(index_columns=[IndexColumn.timestamp("t")])
    (batch,) = [b for c in stream.to_chunks() if "t" in (b := c.to_record_batch()).schema.names]
    there = batch["t"].cast(pa.int64()).to_numpy()
    seen[unit] = int(read[-1] - read[0]) // int(there[-1] - there[0])
    print(f"{column.type}: pyarrow {np.datetime64(int(read[0]), 'ns')} and {np.ptp(read) / 1e9:g} s long,", end=" ")
    print(f"rerun {np.datetime64(int(there[0]), 'ns')} and {np.ptp(there) / 1e9:g} s long")
is_as_seen = seen == {"ms": 1_000_000, "us": 1000, "ns": 1}
print("as seen" if is_as_seen else "the behaviour has changed")
sys.exit(0 if is_as_seen else 1)
PY
