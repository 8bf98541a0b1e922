#!/usr/bin/env bash
# obspy 1.5.1: Trace.resample damps what it resamples, even when it only goes to a higher rate. One would guess that signals
# below both Nyquist frequencies pass unchanged, as in scipy.signal.resample, which it names as its method, all the more
# with its default no_filter=True. Its other default window='hann' multiplies the spectrum: the amplitude falls
# as cos2(pi/2 * f/fNyquist), to 85 % at a quarter of the old Nyquist frequency and 50 % at half of it. An acceleration
# record at 1 kHz brought to 2 kHz so loses half of a 250 Hz peak. window=None is right. Exits 1 if it has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check "obspy==1.5.1" "numpy==2.4.6" "scipy==1.17.1"
"$folder/venv/bin/python" -W ignore - <<'PY'
import sys

import numpy as np
import obspy
import scipy
from obspy import Trace

print("obspy", obspy.__version__, "scipy", scipy.__version__, "- a sine of amplitude 1 at 1000 Hz, resampled to 2000 Hz")
time = np.arange(4000) / 1000.0
seen = {}
for frequency in (50, 125, 250, 375):
    sine = np.sin(2 * np.pi * frequency * time)
    peaks = [np.abs(scipy.signal.resample(sine, 8000)[2000:6000]).max()]
    for options in ({"window": None}, {}):
        trace = Trace(sine.copy(), {"sampling_rate": 1000.0})
        trace.resample(2000.0, **options)
        peaks.append(np.abs(trace.data[2000:6000]).max())
    seen[frequency] = round(float(peaks[2]), 3)
    print(f"{frequency} Hz: scipy {peaks[0]:.3f}, obspy with window=None {peaks[1]:.3f}, obspy {peaks[2]:.3f}")
is_as_seen = seen == {50: 0.976, 125: 0.854, 250: 0.5, 375: 0.146}
print("as seen" if is_as_seen else "the behaviour has changed")
sys.exit(0 if is_as_seen else 1)
PY
