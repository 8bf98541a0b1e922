"""From recordings and a scenario to what physics was left out; see `diagnose`."""

from __future__ import annotations

from rollover.diagnosis.io import diagnosed_text, json_of
from rollover.diagnosis.pipeline import diagnose, diagnose_folder
from rollover.diagnosis.result import Diagnosis

__all__ = ["Diagnosis", "diagnose", "diagnose_folder", "diagnosed_text", "json_of"]
