#!/usr/bin/env bash
# pinocchio 4.1.0: a slide joint of a MuJoCo model keeps 1/57 of its travel. One would guess that a range of -0.1 to 0.5 m
# comes over as metres, as MuJoCo 4.0.0 reads it: `compiler/angle`, degrees by default, is for angles. buildModelFromMJCF
# converts ranges of slide joints from degrees to radians too. No warning. A suspension or piston that is optimised or
# clamped within model.lower/upperPositionLimit has 9 mm to go instead of half a metre; files that state
# angle="radian" hide it. Exits 1 if the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check "pin==4.1.0" "mujoco==4.0.0" "numpy==2.4.6"
cd "$folder"
"$folder/venv/bin/python" - <<'PY'
import sys
from math import pi
from pathlib import Path

import mujoco
import numpy as np
import pinocchio

MODEL = """<mujoco model="strut">{}<worldbody><body name="wheel">
<joint name="travel" type="slide" axis="0 0 1" range="-0.1 0.5" limited="true"/><geom type="sphere" size="0.1" mass="2"/>
</body></worldbody></mujoco>"""
print("pinocchio", pinocchio.__version__, "mujoco", mujoco.__version__)
seen = {}
for unit in ("", '<compiler angle="radian"/>'):
    Path("strut.xml").write_text(MODEL.format(unit))
    model = pinocchio.buildModelFromMJCF("strut.xml")
    seen[unit] = np.array([model.lowerPositionLimit[0], model.upperPositionLimit[0]])
    print("angles in", "radians" if unit else "degrees (default)")
    print("  range in metres, MuJoCo   ", mujoco.MjModel.from_xml_path("strut.xml").jnt_range[0])
    print("  range in metres, pinocchio", seen[unit])
right = np.array([-0.1, 0.5])
is_as_seen = np.allclose(seen[""], right * pi / 180) and np.allclose(seen['<compiler angle="radian"/>'], right)
print("as seen" if is_as_seen else "the behaviour has changed")
sys.exit(0 if is_as_seen else 1)
PY
