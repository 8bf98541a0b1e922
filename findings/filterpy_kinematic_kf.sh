#!/usr/bin/env bash
# filterpy 2.0.0: kinematic_kf for more than one dimension measures the SUM of the coordinates. Its text says "H is
# assigned assuming the measurement is position, one per dimension"; one would guess two rows for 2-D, as filterpy 1.4.5
# gave. Version 2.0.0 makes one row, [1 0 1 0]. It refuses a measurement (x, y), and the cure at hand, dim_z=2, makes
# that row twice and then takes anything: a body that runs along (1, -2) m/s is tracked along (-0.25, -0.25), no error,
# in code that was right with 1.4.5 but for that argument. Exits 1 if the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check "filterpy==2.0.0" "numpy==2.4.6" "scipy==1.17.1"
"$folder/venv/bin/python" - <<'PY'
import sys

import filterpy
import numpy as np
from filterpy.common import kinematic_kf

print("filterpy", filterpy.__version__)
right = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0]])
plain = kinematic_kf(dim=2, order=1, dt=0.1)
print("expected H", right.tolist())
print("H         ", plain.H.tolist())
tracker = kinematic_kf(dim=2, order=1, dt=0.1, dim_z=2)
print("H, dim_z=2", tracker.H.tolist())
for step in range(300):
    tracker.predict()
    tracker.update(np.array([1.0, -2.0]) * step * 0.1)
velocity = tracker.x.ravel()[[1, 3]]
print("velocity of the measurements (1, -2) m/s, of the filter", velocity.round(3))
wrong = [[1.0, 0.0, 1.0, 0.0]]
is_as_seen = plain.H.tolist() == wrong and tracker.H.tolist() == wrong * 2
print("as seen" if is_as_seen else "the behaviour has changed")
sys.exit(0 if is_as_seen else 1)
PY
