#!/usr/bin/env bash
# pint 0.25.3 reads unit texts as loggers and crash data write them without an error, and as something else. One would guess that
# "Nm" is a torque or is refused; it is the textile count number_meter, 1000 m/kg, and "kNm", "Nms" are its multiples.
# "G" is a gauss, "G'S" gauss times siemens, and "cfm" a centifermi. A channel of 1 kNm becomes 1e6 in base units; what it is shows
# in its dimension alone, for whoever converts it to another unit. Exits 1 if the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check "pint==0.25.3"
"$folder/venv/bin/python" - <<'PY'
import sys

import pint

registry = pint.UnitRegistry()
print("pint", pint.__version__)
seen = {}
for text, meant in (("Nm", "N*m"), ("kNm", "kN*m"), ("G", "g_0"), ("G'S", "g_0"), ("cfm", "ft**3/min")):
    unit = registry.Unit(text)
    base = registry.Quantity(1.0, unit).to_base_units()
    is_meant = unit.dimensionality == registry.Unit(meant).dimensionality
    seen[text] = (str(unit), is_meant)
    print(f"{text!r} (meant: {meant}): {unit}, 1 of it is {base:.6g}, dimension of what is meant: {is_meant}")
is_as_seen = seen == {
    "Nm": ("number_meter", False),
    "kNm": ("kilonumber_meter", False),
    "G": ("gauss", False),
    "G'S": ("gauss * siemens", False),
    "cfm": ("centifermi", False),
}
print("as seen" if is_as_seen else "the behaviour has changed")
sys.exit(0 if is_as_seen else 1)
PY
