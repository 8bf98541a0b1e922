#!/bin/sh
# asammdf 8.8.28: an algebraic conversion that it cannot compute hands over the raw numbers as physical ones, silently.
# Conversions of MDF 4, type 3, are formulas such as `pow(X1, 2)`. asammdf gives them to numexpr, which knows no pow(). If
# that raises and the optional package sympy is not there, as after `pip install asammdf`, the numbers stay raw: no
# warning, no exception, and the unit is that of the physical value. Exits 1 if the behaviour has changed.
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

raw = np.arange(6, dtype="int16")
formula = "pow(X1, 2)"
print("asammdf", version("asammdf"), "numexpr", version("numexpr"), "numpy", version("numpy"))
print("raw       ", raw.tolist())
print("right     ", (raw**2).tolist())
with MDF(version="4.10") as file:
    file.append([Signal(raw, np.arange(6.0), name="F", unit="N", conversion={"formula": formula})])
    file.save("a.mf4")
with MDF("a.mf4") as file:
    signal = file.get("F")
print(formula, signal.samples.tolist(), signal.unit)
is_as_seen = signal.samples.tolist() == raw.tolist()
print("as seen" if is_as_seen else "the behaviour has changed")
sys.exit(0 if is_as_seen else 1)
PY
