#!/usr/bin/env bash
# PyBullet 3.2.7: linearDamping, 0.04 unless it is set, is a rate and a quadratic drag in one: a body falls by
# dv/dt = g - d v - d v|v| with d = 0.04 in 1/s and in 1/m. One would guess the first term alone (18.9 m/s after 2 s of fall);
# it is 12.9 m/s, and nothing falls faster than 15.2 m/s. A body dropped from 5 m lands at 8.9 m/s instead of 9.9, with a
# fifth of its energy gone, whatever the step. With linearDamping = 0 it is g t. Exits 1 if the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check "pybullet==3.2.7" "numpy==2.4.6"
"$folder/venv/bin/python" - <<'PY'
import math
import sys
from importlib.metadata import version

import pybullet as p

G, STEP, D = 9.81, 1e-3, 0.04


def fall(damping, seconds=None, height=None):
    """Speed (m/s) after a time or a height."""
    p.resetSimulation()
    p.setGravity(0, 0, -G)
    p.setTimeStep(STEP)
    body = p.createMultiBody(1, p.createCollisionShape(p.GEOM_SPHERE, radius=0.1), basePosition=[0, 0, 1000])
    if damping is not None:
        p.changeDynamics(body, -1, linearDamping=damping)
    t = 0.0
    while t < (seconds or math.inf) - STEP / 2:
        p.stepSimulation()
        t += STEP
        if height and p.getBasePositionAndOrientation(body)[0][2] <= 1000 - height:
            break
    return -p.getBaseVelocity(body)[0][2]


def both_terms(seconds):
    v = 0.0
    for _ in range(round(seconds / STEP)):
        v += STEP * (G - D * v - D * v * v)
    return v


p.connect(p.DIRECT)
print("pybullet", version("pybullet"))
two, ten, none, landed = fall(None, 2.0), fall(None, 10.0), fall(0.0, 2.0), fall(None, height=5.0)
rate_alone = G / D * (1.0 - math.exp(-2.0 * D))
print(f"after 2 s: {two:.3f} m/s; a rate alone {rate_alone:.3f}, rate and quadratic {both_terms(2.0):.3f}, undamped {none:.3f}")
print(f"after 10 s: {ten:.3f} m/s; from 5 m it lands at {landed:.2f} m/s, sqrt(2 g h) is {math.sqrt(2 * G * 5.0):.2f}")
is_as_seen = (
    abs(two - both_terms(2.0)) < 0.01 and abs(ten - both_terms(10.0)) < 0.01
    and abs(none - 2.0 * G) < 1e-6 and round(landed, 1) == 8.9 and abs(two - rate_alone) > 5.0
)  # fmt: skip
print("as seen" if is_as_seen else "the behaviour has changed")
sys.exit(0 if is_as_seen else 1)
PY
