#!/usr/bin/env bash
# fatpack 0.7.8 (fatigue): find_rainflow_ranges rounds the signal to 64 classes between its least and its largest value before it
# counts. One would guess that ranges are those of the signal, as ASTM E1049 counts them: one peak of an impact beside
# 100 cycles of range 10 makes each of these 15.7, a damage by the third power of 3.9 times what it is, and cycles below half a
# class are gone. k = 2**20 classes give 10.00. Exits 1 if the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check "fatpack==0.7.8" "numpy==1.26.4"
"$folder/venv/bin/python" - <<'PY'
import sys

import fatpack
import numpy as np

time = np.arange(0.0, 100.0, 0.01)
load = 5.0 * np.sin(2.0 * np.pi * time)
alone = float(np.median(fatpack.find_rainflow_ranges(load)))
load[5000] += 1000.0  # one impact
beside = float(np.median(fatpack.find_rainflow_ranges(load)))
fine = float(np.median(fatpack.find_rainflow_ranges(load, k=2**20)))
small = 0.5 * np.sin(2.0 * np.pi * time)
small[5000] += 1000.0
left = len(fatpack.find_rainflow_ranges(small))
print(f"100 cycles of range 10: {alone:.3f} alone, {beside:.3f} beside one peak of 1000, {fine:.3f} with 2**20 classes")
print(f"100 cycles of range 1 beside that peak: {left} ranges are found")
is_as_seen = (round(alone, 1), round(beside, 1), round(fine, 1)) == (10.0, 15.7, 10.0) and left < 5
print("as seen" if is_as_seen else "the behaviour has changed")
sys.exit(0 if is_as_seen else 1)
PY
