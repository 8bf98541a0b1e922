"""From recordings and a scenario to what physics was left out; see `diagnose`."""

from __future__ import annotations

from rollover.diagnosis.io import account, diagnose_folder, diagnosed_text
from rollover.diagnosis.pipeline import diagnose
from rollover.diagnosis.result import Diagnosis

__all__ = ["Diagnosis", "account", "diagnose", "diagnose_folder", "diagnosed_text"]
