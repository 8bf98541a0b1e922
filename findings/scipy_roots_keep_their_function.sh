#!/usr/bin/env bash
# scipy 1.17.1: brentq, bisect, ridder, toms748 and solve_ivp leave a reference cycle behind that holds the function they
# were given, and all that it closes over. One would guess that a finished call lets go of it, as newton, quad and
# least_squares do: the tables of a run (8 MB here) live until the garbage collector comes by, which counts objects and not bytes, so
# that a study of many short runs grows by hundreds of megabytes. Exits 1 if the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check "scipy==1.17.1" "numpy==2.4.6"
"$folder/venv/bin/python" - <<'PY'
import gc
import sys
import weakref

import numpy as np
import scipy
from scipy import integrate, optimize


class Tables:
    def __init__(self):
        self.values = np.zeros(1_000_000)


def closure():
    tables = Tables()
    return (lambda x: x - 0.3 + tables.values[0]), weakref.ref(tables)


def is_kept(solve):
    function, tables = closure()
    solve(function)
    del function
    found = tables() is not None
    gc.collect()
    assert tables() is None, "a collection frees them"
    return found


SOLVERS = {
    "brentq": (lambda f: optimize.brentq(f, 0.0, 1.0), True),
    "bisect": (lambda f: optimize.bisect(f, 0.0, 1.0), True),
    "ridder": (lambda f: optimize.ridder(f, 0.0, 1.0), True),
    "toms748": (lambda f: optimize.toms748(f, 0.0, 1.0), True),
    "solve_ivp": (lambda f: integrate.solve_ivp(lambda t, y: f(y), (0.0, 1.0), [0.5]), True),
    "newton": (lambda f: optimize.newton(f, 0.5), False),
    "quad": (lambda f: integrate.quad(f, 0.0, 1.0), False),
    "least_squares": (lambda f: optimize.least_squares(f, 0.5), False),
}
print("scipy", scipy.__version__)
gc.collect()
gc.disable()
seen = {name: is_kept(solve) for name, (solve, _) in SOLVERS.items()}
for name, kept in seen.items():
    print(f"{name}: what the function closes over is {'kept' if kept else 'freed'} after the call")
is_as_seen = seen == {name: kept for name, (_, kept) in SOLVERS.items()}
print("as seen" if is_as_seen else "the behaviour has changed")
sys.exit(0 if is_as_seen else 1)
PY
