#!/usr/bin/env bash
# Drake 1.51.1: the armature inertia of a MuJoCo joint counts only if some actuator drives that joint. One would guess that
# `armature`, an attribute of the joint, adds to its mass matrix as in MuJoCo 4.0.0, driven or not. Drake keeps it with the
# actuator and drops it from a passive joint; its parser warns of each attribute that it does not support, but not of this.
# A free-wheeling drum with a geared flywheel speeds up 8.5 times as fast from the same torque here, and the very same joint
# is right again as soon as an unused motor is added. Exits 1 if the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check "drake==1.51.1" "mujoco==4.0.0" "numpy==2.4.6"
cd "$folder"
"$folder/venv/bin/python" - <<'PY'
import sys
from importlib.metadata import version
from pathlib import Path

import mujoco
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

MODEL = """<mujoco model="drum"><worldbody><body name="drum"><joint name="axle" type="hinge" axis="0 1 0" armature="0.5"/>
<geom type="box" size="0.1 0.2 0.3" mass="2"/></body></worldbody>{}</mujoco>"""
print("drake", version("drake"), "mujoco", mujoco.__version__)
inertia = {}
for what, actuator in (("passive", ""), ("driven", '<actuator><motor joint="axle"/></actuator>')):
    Path("drum.xml").write_text(MODEL.format(actuator))
    plant = MultibodyPlant(time_step=0.0)
    Parser(plant).AddModels("drum.xml")
    plant.Finalize()
    there = mujoco.MjModel.from_xml_path("drum.xml")
    inertia[what] = round(float(plant.CalcMassMatrix(plant.CreateDefaultContext())[0, 0]), 4)
    right = there.body_inertia[1][1] + there.dof_armature[0]
    print(f"{what:8s} inertia about the axle in kg m2: box and armature {right:.4f}, Drake {inertia[what]}")
is_as_seen = inertia == {"passive": 0.0667, "driven": 0.5667}
print("as seen" if is_as_seen else "the behaviour has changed")
sys.exit(0 if is_as_seen else 1)
PY
