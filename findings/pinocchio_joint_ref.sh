#!/usr/bin/env bash
# pinocchio 4.1.0: a joint of a MuJoCo model with `ref` may move through another angle than in MuJoCo. `ref` is the value
# of the joint in the pose as drawn. One would guess either q as in MuJoCo and the range as written, or q counted from the
# drawn pose and the range less `ref`. buildModelFromMJCF does half of each: q is MuJoCo's, the limits are shifted. With
# ref 30 and range 0 to 60 degrees MuJoCo swings 30 degrees to either side of the drawing, pinocchio 60 to one side and 0 to
# the other. No warning; the pose of each q is right, so only planning, inverse kinematics and limit checks go wrong.
# Exits 1 if the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check "pin==4.1.0" "mujoco==4.0.0" "numpy==2.4.6"
cd "$folder"
"$folder/venv/bin/python" - <<'PY'
import sys
from pathlib import Path

import mujoco
import numpy as np
import pinocchio

Path("arm.xml").write_text("""<mujoco model="arm"><compiler angle="degree"/><worldbody><body name="arm">
<joint name="hinge" type="hinge" axis="0 -1 0" ref="30" range="0 60" limited="true"/>
<geom type="sphere" size="0.1" pos="1 0 0" mass="2"/></body></worldbody></mujoco>""")  # drawn along x
there = mujoco.MjModel.from_xml_path("arm.xml")
state = mujoco.MjData(there)
here = pinocchio.buildModelFromMJCF("arm.xml")
data = here.createData()
print("pinocchio", pinocchio.__version__, "mujoco", mujoco.__version__)
swing = {"MuJoCo": [], "pinocchio": []}
for end, limit in enumerate((here.lowerPositionLimit, here.upperPositionLimit)):
    state.qpos[0] = there.jnt_range[0, end]
    mujoco.mj_kinematics(there, state)
    for name, centre in (("MuJoCo", state.xipos[1]), ("pinocchio", pinocchio.centerOfMass(here, data, limit))):
        swing[name].append(round(float(np.degrees(np.arctan2(centre[2], centre[0])))))
for name, ends in swing.items():
    print(f"{name:9s} swings from {ends[0]} to {ends[1]} degrees off the pose as drawn")
is_as_seen = swing == {"MuJoCo": [-30, 30], "pinocchio": [-60, 0]}
print("as seen" if is_as_seen else "the behaviour has changed")
sys.exit(0 if is_as_seen else 1)
PY
