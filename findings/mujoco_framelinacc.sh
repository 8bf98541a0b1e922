#!/usr/bin/env bash
# MuJoCo 4.0.0: the sensor framelinacc is no acceleration of the frame but an accelerometer turned into world axes. Its
# page says "the 3D linear acceleration of the spatial frame of the object, in global coordinates", beside framelinvel for
# the velocity; one would guess 0 at rest and -g in free fall. It gives +g at rest and 0 in free fall, as gravity is felt.
# Whoever takes it for the derivative of framelinvel is 1 g off in z: m*a wants a weight that is not there, and an
# integral over 1 s is 9.81 m/s too high. Exits 1 if the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check "mujoco==4.0.0" "numpy==2.4.6"
"$folder/venv/bin/python" - <<'PY'
import sys

import mujoco

MODEL = """<mujoco><worldbody><geom type="plane" size="5 5 0.1"/>
<body name="ball" pos="0 0 {}"><freejoint/><geom type="sphere" size="0.1" mass="1"/></body></worldbody>
<sensor><framelinvel objtype="body" objname="ball"/><framelinacc objtype="body" objname="ball"/></sensor></mujoco>"""
print("mujoco", mujoco.__version__)
seen = {}
for what, height in (("at rest", 0.1), ("in free fall", 100.0)):
    model = mujoco.MjModel.from_xml_string(MODEL.format(height))
    data = mujoco.MjData(model)
    speeds = []
    for _ in range(1000):  # 2 s
        mujoco.mj_step(model, data)
        speeds.append(data.sensordata[2])
    rate = (speeds[-1] - speeds[-2]) / model.opt.timestep
    seen[what] = round(float(data.sensordata[5]), 2)
    print(f"{what:12s} dv/dt of framelinvel {rate:6.2f} m/s2 in z, framelinacc {seen[what]:5.2f} m/s2")
is_as_seen = seen == {"at rest": 9.81, "in free fall": 0.0}
print("as seen" if is_as_seen else "the behaviour has changed")
sys.exit(0 if is_as_seen else 1)
PY
