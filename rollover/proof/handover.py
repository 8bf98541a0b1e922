"""What is handed to the diagnosis: a folder with the scenario and the recordings, and nothing that tells the truth."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

from rollover.proof.generator import Case
from rollover.recording.importers import write_recording

SCENARIO = "scenario.yaml"
WRITTEN = 946_684_800  # s since 1970: every file of every case was written at the same time


def write_case(case: Case, folder: Path) -> None:
    """Write `scenario.yaml` and r1, r2, ... (Parquet with a sidecar) into a new folder. Raises `InputError`.

    References, if any, are reference1, reference2, ...
    """
    folder.mkdir(parents=True, exist_ok=False)
    (folder / SCENARIO).write_text(case.scenario, encoding="utf-8")
    for number, recording in enumerate(case.recordings, start=1):
        write_recording(recording, folder / f"r{number}.parquet")
    for number, recording in enumerate(case.references, start=1):
        write_recording(recording, folder / f"reference{number}.parquet")
    for path in (*folder.iterdir(), folder):
        os.utime(path, (WRITTEN, WRITTEN))


def fingerprint(folder: Path) -> str:
    """SHA-256 over names and contents of a folder's files."""
    total = hashlib.sha256()
    for path in sorted(folder.iterdir()):
        total.update(path.name.encode() + b"\0" + hashlib.sha256(path.read_bytes()).digest())
    return total.hexdigest()
