#!/bin/sh
# asammdf 8.8.28: a value-range-to-value conversion (MDF 4, type 6) gives wrong numbers for integer channels.
# ASAM MDF 4: for integers both ends of a range belong to it; what lies in no range takes the default.
# Here 5 lies in 0 to 9, which stands for 100, and takes the default; -5 lies in no range and takes the last range's 200.
# The same conversion of the same numbers as floats is right (there the upper end is outside). No warning. Exits 1 if the behaviour has changed.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check "asammdf==8.8.28" "numpy==2.4.6"
cd "$folder"
"$folder/venv/bin/python" - <<'PY'
import sys
from importlib.metadata import version

import numpy as np
from asammdf import MDF, Signal

raw = np.array([-5, 0, 1, 5, 9, 10, 25, 31])
ranges = {"lower_0": 0, "upper_0": 9, "phys_0": 100.0, "lower_1": 20, "upper_1": 29, "phys_1": 200.0, "default": -1.0}
right = [-1.0, 100.0, 100.0, 100.0, 100.0, -1.0, 200.0, -1.0]
got = {}
for kind in ("int16", "float64"):
    with MDF(version="4.10") as file:
        file.append([Signal(raw.astype(kind), np.arange(8.0), name="F", conversion=ranges)])
        file.save(f"{kind}.mf4")
    with MDF(f"{kind}.mf4") as file:
        got[kind] = file.get("F").samples.tolist()
print("asammdf", version("asammdf"), "numpy", version("numpy"))
print("raw              ", raw.tolist())
print("right for int16  ", right)
for kind, values in got.items():
    print(f"got for {kind:9s}", values)
is_as_seen = got["int16"] == [200.0, -1.0, -1.0, -1.0, 100.0, 100.0, -1.0, 200.0]
print("as seen" if is_as_seen else "the behaviour has changed")
sys.exit(0 if is_as_seen else 1)
PY
