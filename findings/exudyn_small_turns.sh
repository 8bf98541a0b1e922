#!/bin/sh
# Exudyn 1.13.6: a rigid body that turns slowly enough does not turn at all, though its angular velocity is right.
# Its solvers turn a NodeRigidBodyRotVecLG by composing rotation vectors and find the angle of the result by an arc
# cosine. Near the reference orientation that keeps half the digits: a turn of x rad is resolved to some 4e-16/x rad, and
# one below about 1e-8 rad in a step is lost whole, step after step, without a warning. One would expect a turn as exact
# as the velocity, whatever its size. Exits 1 if the behaviour has changed.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet exudyn==1.13.6 numpy==2.2.6
cat > "$folder/turn.py" <<'PYTHON'
import exudyn as exu
from exudyn.itemInterface import NodeRigidBodyRotVecLG, ObjectRigidBody

exu.config.printToConsole = False
print("exudyn", exu.__version__)
off = {}
for rate in (1.0, 1e-2, 1e-4, 1e-6):
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    node = mbs.AddNode(NodeRigidBodyRotVecLG(referenceCoordinates=[0.0] * 6, initialVelocities=[0, 0, 0, 0, 0, rate]))
    mbs.AddObject(ObjectRigidBody(mass=1.0, inertia=[1.0, 1.0, 1.0, 0.0, 0.0, 0.0], nodeNumber=node))
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.timeIntegration.numberOfSteps = 10
    settings.timeIntegration.endTime = 0.01
    settings.solution.file.write = False
    mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.GeneralizedAlpha)
    turned = mbs.systemData.GetODE2Coordinates()[5]
    off[rate] = turned / (rate * 0.01) - 1.0
    print(f"{rate:g} rad/s for 0.01 s: turned by {turned:.6g} rad, off by {off[rate]:.1e} of it")
assert abs(off[1.0]) < 1e-9, "a usual turn is right"
assert abs(off[1e-4]) > 1e-4, "a turn of 1e-6 rad is now exact"
assert off[1e-6] == -1.0, "a turn of 1e-8 rad is no longer lost"
PYTHON
"$folder/venv/bin/python" "$folder/turn.py"
