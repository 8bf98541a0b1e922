"""From recordings and a scenario to what physics was left out; see `diagnose`."""

from __future__ import annotations

from rollover.diagnosis.account import account, diagnose_folder, diagnosed_text
from rollover.diagnosis.diagnose import diagnose
from rollover.diagnosis.verdict import Diagnosis

__all__ = ["Diagnosis", "account", "diagnose", "diagnose_folder", "diagnosed_text"]
