#!/usr/bin/env bash
# PyBullet 3.2.7: the normal force that getContactPoints returns is divided by the number of substeps. With numSubSteps = 4
# a box of 10 kg at rest presses on the plane with 24.5 N: the impulse of the last substep is divided by the length of the
# whole step. One would guess m g whatever the substeps, as getJointState gives it for a fixed joint (98.1 N with 4 as with
# none). Whoever refines the time of an impact by substeps sees its peak load fall by their number. Exits 1 if the behaviour
# has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check "pybullet==3.2.7" "numpy==2.4.6"
"$folder/venv/bin/python" - <<'PY'
import sys
from importlib.metadata import version

import pybullet as p

MASS, GRAVITY = 10.0, 9.81
p.connect(p.DIRECT)
print("pybullet", version("pybullet"))
seen = {}
for substeps in (0, 2, 4, 8):
    p.resetSimulation()
    p.setGravity(0, 0, -GRAVITY)
    p.setPhysicsEngineParameter(fixedTimeStep=1 / 240, numSubSteps=substeps)
    plane = p.createMultiBody(0, p.createCollisionShape(p.GEOM_PLANE))
    cube = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.5, 0.5, 0.5])
    box = p.createMultiBody(MASS, cube, basePosition=[0, 0, 0.5])
    hung = p.createMultiBody(
        0, cube, basePosition=[5, 0, 5], linkMasses=[MASS], linkCollisionShapeIndices=[cube], linkVisualShapeIndices=[-1],
        linkPositions=[[0, 0, -2]], linkOrientations=[[0, 0, 0, 1]], linkInertialFramePositions=[[0, 0, 0]],
        linkInertialFrameOrientations=[[0, 0, 0, 1]], linkParentIndices=[0], linkJointTypes=[p.JOINT_FIXED],
        linkJointAxis=[[0, 0, 1]],
    )  # fmt: skip
    p.enableJointForceTorqueSensor(hung, 0)
    for _ in range(480):  # 2 s
        p.stepSimulation()
    contact = sum(point[9] for point in p.getContactPoints(box, plane))
    joint = p.getJointState(hung, 0)[2][2]
    seen[substeps] = (round(contact / (MASS * GRAVITY), 3), round(joint / (MASS * GRAVITY), 3))
    print(f"numSubSteps {substeps}: contact {contact:6.2f} N, fixed joint {joint:6.2f} N, weight {MASS * GRAVITY:.2f} N")
is_as_seen = seen == {0: (1.0, 1.0), 2: (0.5, 1.0), 4: (0.25, 1.0), 8: (0.125, 1.0)}
print("as seen" if is_as_seen else "the behaviour has changed")
sys.exit(0 if is_as_seen else 1)
PY
