#!/usr/bin/env bash
# mdfreader 4.3 reads an MDF 4.10 file that asammdf 8.1.2 wrote with two of ten samples marked invalid. asammdf leaves the two out.
# One would guess that the other reader masks them, at the latest when apply_invalid_bit is asked for: it returns them
# as numbers (9999 here), and afterwards a masked array whose mask is False everywhere. A peak force is then that of an
# amplifier in overload. Exits 1 if the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check "asammdf==8.1.2" "mdfreader==4.3" "numpy==1.26.4" "pandas==2.2.3"
cd "$folder"
"$folder/venv/bin/python" - <<'PY'
import sys
import warnings

warnings.simplefilter("ignore")
import mdfreader
import numpy as np
from asammdf import MDF, Signal

force = np.array([1.0, 2.0, 3.0, 9999.0, 9999.0, 6.0, 7.0, 8.0, 9.0, 10.0])
is_invalid = force == 9999.0
made = MDF(version="4.10")
made.append([Signal(force, np.arange(10) * 0.1, name="force", unit="N", invalidation_bits=is_invalid)])
made.save("force.mf4", overwrite=True)
made.close()

by_asammdf = MDF("force.mf4").get("force").samples
other = mdfreader.Mdf("force.mf4")
plain = np.asarray(other.get_channel_data("force"))
other.apply_invalid_bit("force")
masked = other.get_channel_data("force")
print("asammdf:", by_asammdf)
print("mdfreader:", plain)
print("mdfreader after apply_invalid_bit: mask", np.ma.getmaskarray(masked))
is_as_seen = by_asammdf.max() == 10.0 and plain.max() == 9999.0 and not np.ma.getmaskarray(masked).any()
print("as seen" if is_as_seen else "the behaviour has changed")
sys.exit(0 if is_as_seen else 1)
PY
