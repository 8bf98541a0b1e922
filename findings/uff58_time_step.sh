#!/usr/bin/env bash
# Universal file 58 (pyuff 2.5.8): its binary form keeps samples as doubles but the time step as text of six digits. One
# would guess that 58b, made to keep full precision, gives back the time axis that was written. Record 7 of the header is
# ASCII in both forms, 3E13.5 for start, step and z, so 1/51200 s comes back as 1.95313e-05 s, 2.6e-6 too long, while the
# samples are exact. After an hour two channels of different rates are 9 ms, 470 samples, apart; a rate found as
# 1/step is 51199.87 Hz and fails tests for equality. Exits 1 if the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check "pyuff==2.5.8" "numpy==2.4.6"
cd "$folder"
"$folder/venv/bin/python" -W ignore - <<'PY'
import sys

import numpy as np
import pyuff

print("pyuff", pyuff.__version__)
seen = {}
for rate in (51200.0, 44100.0, 10000.0):
    time = np.arange(1000) / rate
    data = np.sin(100.0 * time)
    name = f"at_{rate:.0f}_Hz.uff"
    pyuff.UFF(name).write_sets(
        pyuff.prepare_58(
            func_type=1, rsp_node=1, rsp_dir=1, ref_node=1, ref_dir=1, data=data, x=time, binary=1, id1="channel",
            rsp_ent_name="a", ref_ent_name="b", abscissa_spacing=1, ordinate_spec_data_type=8, ver_num=0, load_case_id=0,
            orddenom_spec_data_type=0, abscissa_spec_data_type=17, abscissa_axis_units_lab="s", abscissa_min=0.0,
            abscissa_inc=1.0 / rate,
        ),
        "add",
    )
    back = pyuff.UFF(name).read_sets(0)
    seen[rate] = round((back["abscissa_inc"] * rate - 1.0) * 1e6, 2)
    print(f"{rate:.0f} Hz: samples exact {np.array_equal(back['data'], data)}, step off by {seen[rate]} ppm,", end=" ")
    print(f"{seen[rate] * 3.6:.1f} ms in an hour; 1/step = {1 / back['abscissa_inc']:.2f} Hz")
is_as_seen = seen == {51200.0: 2.56, 44100.0: -1.63, 10000.0: 0.0}
print("as seen" if is_as_seen else "the behaviour has changed")
sys.exit(0 if is_as_seen else 1)
PY
