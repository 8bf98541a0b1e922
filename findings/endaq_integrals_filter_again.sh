#!/usr/bin/env bash
# endaq 1.5.3 (shock and vibration): calc.integrate.integrals(n=2, highpass_cutoff=f) calls f the cutoff of "the initial" high-pass
# filter. One would guess that the acceleration is filtered once and integrated twice; it is filtered anew before each
# integration. A sine at the cutoff, which one pass there and back halves, has half its amplitude as velocity and a quarter as
# displacement, and the Tukey window is applied twice too. Exits 1 if the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check "endaq==1.5.3" "numpy==1.26.4" "pandas==2.2.3"
"$folder/venv/bin/python" - <<'PY'
import sys
import warnings

warnings.simplefilter("ignore")
import numpy as np
import pandas as pd
from endaq.calc.integrate import integrals

hertz = 5.0
omega = 2.0 * np.pi * hertz
time = np.arange(0.0, 20.0, 1e-3)
frame = pd.DataFrame({"a": np.sin(omega * time)}, index=pd.Index(time, name="t"))
_, velocity, displacement = integrals(frame, n=2, zero="mean", highpass_cutoff=hertz)
middle = slice(5000, 15000)  # away from both ends
seen = []
for name, values, exact in (("velocity", velocity, 1.0 / omega), ("displacement", displacement, 1.0 / omega**2)):
    half_range = float(np.ptp(values["a"].to_numpy()[middle])) / 2.0
    seen.append(round(half_range / exact, 2))
    print(f"{name}: {half_range / exact:.3f} of the exact amplitude at the cutoff")
is_as_seen = seen == [0.5, 0.25]
print("as seen" if is_as_seen else "the behaviour has changed")
sys.exit(0 if is_as_seen else 1)
PY
