#!/usr/bin/env bash
# pyisomme 1.1.0 (ISO-MME crash data): Channel.cfc_hz(freq) is documented as a filter by "an explicit cutoff frequency in Hz".
# One would guess that a sine at that frequency leaves it by 3 dB, 0.707, as of any Butterworth filter; the number is taken for
# a channel frequency class instead, whose edge of 3 dB lies at 5/3 of it (CFC 60: 100 Hz). A sine at the stated cutoff passes
# with 0.95, one at 5/3 of it with 0.71. Who asks for 100 Hz to have CFC 60 has a filter of 167 Hz, and the code of the
# channel says "S". Exits 1 if the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check "pyisomme==1.1.0" "numpy==1.26.4" "pandas==2.2.3"
"$folder/venv/bin/python" - <<'PY'
import logging
import sys

import numpy as np
import pandas as pd
from pyisomme import Channel

logging.disable(logging.WARNING)
time = np.arange(0.0, 0.5, 1e-4)
seen = {}
for cutoff in (60.0, 100.0):
    for hertz in (cutoff, cutoff * 5.0 / 3.0):
        sine = pd.DataFrame({"y": np.sin(2.0 * np.pi * hertz * time)}, index=time)
        filtered = Channel("11HEAD0000H3ACXP", sine, unit="m/s^2").cfc_hz(cutoff)
        passed = float(np.abs(filtered.get_data()[1000:4000]).max())  # away from both ends
        seen[cutoff, round(hertz / cutoff, 2)] = round(passed, 2)
        print(f"cfc_hz({cutoff:g}): a sine of {hertz:5.1f} Hz leaves with {passed:.3f}, code {filtered.code}")
is_as_seen = seen == {(60.0, 1.0): 0.95, (60.0, 1.67): 0.71, (100.0, 1.0): 0.95, (100.0, 1.67): 0.71}
print("as seen" if is_as_seen else "the behaviour has changed")
sys.exit(0 if is_as_seen else 1)
PY
