"""Diagnoses made by hand, found by name in a child process."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any


def says_nothing(folder: Path, out: Path, workers: int = 1) -> dict[str, Any]:
    """Look at what was handed over, and claim no mismatch."""
    names = sorted(p.name for p in folder.iterdir())
    assert "scenario.yaml" in names
    assert "r1.parquet" in names
    assert not any("truth" in name for name in names)
    answer = {"format": "rollover-diagnosis/1", "verdict": "no-mismatch", "effects": [], "folder": folder.name}
    return {**answer, "significance": {"p_value": 0.5}}


def always_damping(folder: Path, out: Path, workers: int = 1) -> dict[str, Any]:
    """Blame the soil, whatever it is."""
    return {"verdict": "missing-physics", "effects": [{"id": "soil-viscous-damping", "kind": "physics"}]}


def spoils(folder: Path, out: Path, workers: int = 1) -> dict[str, Any]:
    """Change what was handed over."""
    (folder / "scenario.yaml").write_text("changed")
    return says_nothing(folder, out)


def fails(folder: Path, out: Path, workers: int = 1) -> dict[str, Any]:
    """Give up."""
    raise RuntimeError("no idea")


def counted(folder: Path, out: Path, workers: int = 1) -> dict[str, Any]:
    """Note which case is diagnosed in the file that is named by COUNTED; an interrupt at the case INTERRUPT."""
    with Path(os.environ["COUNTED"]).open("a") as file:
        file.write(f"{folder.name}\n")
    if os.environ["INTERRUPT"] == folder.name:
        raise KeyboardInterrupt
    return says_nothing(folder, out)
