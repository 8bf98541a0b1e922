"""What the run.json of a results folder must hold for its readers: names and types, looked at before any is used."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rollover.system.own_json import COUNT, NUMBER, TEXT

_PEAK = {
    "channel": TEXT,
    "unit": TEXT,
    "cfc": COUNT,
    "domain_flags": [TEXT],
    **dict.fromkeys(("raw", "raw_time", "filtered", "filtered_time"), NUMBER),
    **dict.fromkeys(("impulse", "half_step_change", "mean", "scatter"), (NUMBER,)),
    "starts": (COUNT,),
    "starts_by": (TEXT,),
}
ANSWER: Mapping[str, Any] = {
    **dict.fromkeys(("title", "status", "sentence", "scenario_hash"), TEXT),
    "versions": {},
    "phases": [{"start": NUMBER, "name": TEXT}],
    "peak_loads": [_PEAK],
    "criteria": [{"verdict": TEXT, "requirement": {"standard": TEXT, "name": TEXT}}],
}
