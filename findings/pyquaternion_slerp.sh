#!/usr/bin/env bash
# pyquaternion 0.9.9: interpolating between two recorded orientations rewrites the record. One would guess that
# Quaternion.slerp(q0, q1, t), a class method that returns a new quaternion, leaves q0 alone. If the two lie on opposite
# halves of the sphere, as where a logger that keeps w >= 0 passes 180 degrees, it turns the sign of q0 itself. The rotation
# is the same, but what is written, hashed, filtered or differenced by components afterwards is not what was recorded,
# and depends on who looked before; a reference that all samples are compared with changes sign on the way. The
# docstring speaks of normalising only. Exits 1 if the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check "pyquaternion==0.9.9" "numpy==2.4.6"
"$folder/venv/bin/python" - <<'PY'
import sys
from importlib.metadata import version

import numpy as np
from pyquaternion import Quaternion

print("pyquaternion", version("pyquaternion"))
# a body that rolls over at 90 degrees/s, ten samples a second; the logger keeps w >= 0, so one pair straddles 180 degrees
record = [Quaternion(axis=[1, 0, 0], degrees=9.0 * k) for k in range(30)]
record = [q if q.w >= 0 else -q for q in record]
before = np.array([q.elements for q in record])
finer = [Quaternion.slerp(a, b, 0.5) for a, b in zip(record, record[1:])]
after = np.array([q.elements for q in record])
changed = np.flatnonzero(np.abs(after - before).max(axis=1) > 0.5)
print("midpoints", len(finer), "- samples of the record that now differ:", changed.tolist(), "expected: []")
for k in changed:
    print("sample", k, "before", before[k].round(3).tolist(), "after", after[k].round(3).tolist())
is_as_seen = changed.tolist() == [20]
print("as seen" if is_as_seen else "the behaviour has changed")
sys.exit(0 if is_as_seen else 1)
PY
