#!/usr/bin/env bash
# ahrs 0.4.0: `rpy` means roll, pitch, yaw in one class and yaw, pitch, roll in the next. One would guess that
# DCM(rpy=a) and Quaternion(rpy=a) are one rotation and that to_rpy gives a back; the DCM's parameter is even described
# as "Array with roll->pitch->yaw angles". Quaternion takes roll first, DCM takes yaw first (an example shows it), and
# DCM.to_rpy reads the transpose. Nothing is refused: a vehicle at 10 degrees roll and 30 degrees yaw rolls by 30 and yaws by
# 10 after one change of class, and by -28 after a round trip within one. Exits 1 if the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check "ahrs==0.4.0" "numpy==2.4.6" "scipy==1.17.1"
"$folder/venv/bin/python" - <<'PY'
import sys
from importlib.metadata import version

import numpy as np
from ahrs import DCM, Quaternion
from scipy.spatial.transform import Rotation

print("ahrs", version("ahrs"))
angles = np.radians([10.0, 20.0, 30.0])


def roll_pitch_yaw(rotation):
    """What scipy finds in it: intrinsic yaw, pitch, roll, in degrees, roll first."""
    return rotation.as_euler("ZYX", degrees=True)[::-1].round(1).tolist()


seen = [
    roll_pitch_yaw(Rotation.from_quat(np.asarray(Quaternion(rpy=angles)), scalar_first=True)),
    roll_pitch_yaw(Rotation.from_matrix(np.asarray(DCM(rpy=angles)))),
    np.degrees(Quaternion(rpy=angles).to_angles()).round(1).tolist(),
    np.degrees(DCM(rpy=angles).to_rpy()).round(1).tolist(),
]
print("given as rpy                   [10.0, 20.0, 30.0]")
names = ("Quaternion(rpy=), by scipy", "DCM(rpy=), by scipy", "Quaternion(rpy=).to_angles()", "DCM(rpy=).to_rpy()")
for name, value in zip(names, seen):
    print(f"{name:30s}", value)
is_as_seen = seen == [[10.0, 20.0, 30.0], [30.0, 20.0, 10.0], [10.0, 20.0, 30.0], [-28.5, -22.2, 1.1]]
print("as seen" if is_as_seen else "the behaviour has changed")
sys.exit(0 if is_as_seen else 1)
PY
