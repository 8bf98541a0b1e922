#!/usr/bin/env bash
# objective_rating_metrics 1.3 (ISO/TS 18571 by openVT): both curves are handed over with a column of time stamps, and none is
# read. One would guess that the phase rating compares the clocks: curves that differ in nothing but 20 ms of 100 in their
# stamps, both even at 10 kHz, are rated 1.000 in phase and overall. The same 20 ms as rows, on one clock, give a phase of
# 0.000. Whoever cuts two recordings each to its own trigger compares them without the delay that is to be rated.
# Exits 1 if the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check "objective_rating_metrics==1.3" "numpy==2.4.6" "scipy==1.17.1"
"$folder/venv/bin/python" - <<'PY'
import sys
from importlib.metadata import version

import numpy as np
from objective_rating_metrics.rating import ISO18571

print("objective_rating_metrics", version("objective_rating_metrics"))
STEP, COUNT, LATE = 1e-4, 1000, 0.020
stamps = STEP * np.arange(COUNT)


def pulse(time):
    """A half sine of 30 ms that begins at 20 ms."""
    inside = (time > 0.02) & (time < 0.05)
    return np.where(inside, np.sin(np.pi * (time - 0.02) / 0.03), 0.0)


reference = np.column_stack([stamps, pulse(stamps)])
seen = {}
for what, curve in (
    ("stamps 20 ms later", np.column_stack([stamps + LATE, pulse(stamps)])),
    ("pulse 20 ms later ", np.column_stack([stamps, pulse(stamps - LATE)])),
):
    rating = ISO18571(reference_curve=reference, comparison_curve=curve)
    seen[what.strip()] = rating.phase_rating(), rating.overall_rating()
    print(f"{what}: phase {rating.phase_rating():.3f}, overall {rating.overall_rating():.3f}")
is_as_seen = seen["stamps 20 ms later"] == (1, 1) and seen["pulse 20 ms later"][0] == 0
print("as seen" if is_as_seen else "the behaviour has changed")
sys.exit(0 if is_as_seen else 1)
PY
