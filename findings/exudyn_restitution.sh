#!/usr/bin/env bash
# Exudyn 1.13.6: a ball hits at 1 m/s with restitutionCoefficient=0.2 and leaves at 0.55 m/s. One would guess 0.2: the
# parameter is a coefficient of restitution that, its text says, "can become arbitrarily small to emulate plastic impact".
# With impactModel=1 of ObjectContactSphereSphere, Hunt-Crossley, it is a setting of the damping that holds near 1 only:
# 0.9 gives 0.91, 0.5 gives 0.66, and nothing below 0.48 can be had. The text calls model 2 "much more accurate", no
# more; model 2 is right to 0.5 %, the default model 0 ignores the number. At 0.2 an impact keeps 30 % of its
# energy instead of 4 %, and no warning tells. Exits 1 if the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check "exudyn==1.13.6" "numpy==2.4.6"
"$folder/venv/bin/python" -W ignore - <<'PY'
import sys

import exudyn as exu
import exudyn.itemInterface as item

exu.config.printToConsole = False
print("exudyn", exu.__version__)


def rebound(model, coefficient):
    """Speed in m/s after a ball of 1 kg has hit a fixed one at 1 m/s, without gravity."""
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    place = {"referenceCoordinates": [0.0, 0.0, 0.2, 0.0, 0.0, 0.0], "initialVelocities": [0.0, 0.0, -1.0, 0.0, 0.0, 0.0]}
    node = mbs.AddNode(item.NodeRigidBodyRotVecLG(**place))
    ball = mbs.AddObject(item.ObjectRigidBody(mass=1.0, inertia=[0.004, 0.004, 0.004, 0, 0, 0], nodeNumber=node))
    pair = [mbs.AddMarker(item.MarkerBodyRigid(bodyNumber=b)) for b in (mbs.AddObject(item.ObjectGround()), ball)]
    memory = mbs.AddNode(item.NodeGenericData(initialCoordinates=[0.1, 0.0, 0.0, 0.0], numberOfDataCoordinates=4))
    law = {"contactStiffness": 1e5, "impactModel": model, "restitutionCoefficient": coefficient, "minimumImpactVelocity": 1e-3}
    mbs.AddObject(item.ObjectContactSphereSphere(markerNumbers=pair, nodeNumber=memory, spheresRadii=[0.1, 0.1], **law))
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.timeIntegration.numberOfSteps = 20000
    settings.timeIntegration.endTime = 0.04
    settings.solution.file.write = False
    mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.RK44)
    return mbs.GetNodeOutput(node, exu.OutputVariableType.Velocity)[2]


seen = {}
for model in (0, 1, 2):
    seen[model] = [round(float(rebound(model, coefficient)), 2) for coefficient in (0.9, 0.5, 0.2)]
    print(f"impactModel {model}: expected [0.9, 0.5, 0.2], bounced back with {seen[model]}")
is_as_seen = seen == {0: [1.0, 1.0, 1.0], 1: [0.91, 0.66, 0.55], 2: [0.9, 0.5, 0.2]}
print("as seen" if is_as_seen else "the behaviour has changed")
sys.exit(0 if is_as_seen else 1)
PY
