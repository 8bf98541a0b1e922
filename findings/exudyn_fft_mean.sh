#!/usr/bin/env bash
# Exudyn 1.13.6: signalProcessing.ComputeFFT gives twice the mean at 0 Hz. It returns amplitudes, 2|Y|/N, so that a sine of
# 2 m/s2 reads 2; one would guess that 0 Hz, which has no second half at negative frequencies, reads the mean. It is doubled
# with the rest, and so is the amplitude at the Nyquist frequency of an even number of samples. A resting accelerometer
# reads 2 g, a static axle load twice its weight, and the signal that is put together again from magnitude and phase
# is off by its mean. Exits 1 if the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check "exudyn==1.13.6" "numpy==2.4.6"
"$folder/venv/bin/python" - <<'PY'
import sys

import exudyn
import numpy as np
from exudyn.signalProcessing import ComputeFFT

print("exudyn", exudyn.__version__)
time = np.arange(1000) / 1000.0
signal = 9.81 + 2.0 * np.sin(2 * np.pi * 50.0 * time) + 0.5 * np.cos(2 * np.pi * 500.0 * time)
frequency, magnitude, phase = ComputeFFT(time, signal)
seen = {}
for hertz, right in ((0, 9.81), (50, 2.0), (500, 0.5)):
    at = int(np.argmin(np.abs(frequency - hertz)))
    seen[hertz] = round(float(magnitude[at]), 6)
    print(f"{frequency[at]:5.0f} Hz: amplitude put in {right}, ComputeFFT {seen[hertz]}")
waves = magnitude[:, None] * np.cos(2 * np.pi * frequency[:, None] * time + phase[:, None])
print("mean of the signal", signal.mean().round(3), "of the sum of the waves", waves.sum(axis=0).mean().round(3))
is_as_seen = seen == {0: 19.62, 50: 2.0, 500: 1.0}
print("as seen" if is_as_seen else "the behaviour has changed")
sys.exit(0 if is_as_seen else 1)
PY
