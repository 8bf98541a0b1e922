"""Small studies of drop tests, which cost 2 ms a case."""

from __future__ import annotations

from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
EFFECTS = ROOT / "tests" / "rollover" / "faulty_effect.py"

DROPS = """\
title: Drops of any speed on any clay
scenario: drop_test.yaml
simulator: drop
axes:
  - {kind: uniform, name: speed, paths: [initiation.speed], low: 1.0, high: 3.5}
  - {kind: soil-scatter, name: soil}
plan: {kind: lhs, count: 20, seed: 3}
outputs:
  - {name: ground/force_normal, limit: 3500.0}
  - {name: ground/sinkage}
"""

FAULTY = """\
title: Sixty drops, some of which go wrong
scenario:
  base: drop_test.yaml
  effects: {faulty: {}}
simulator: drop
axes:
  - {kind: column, name: speed, paths: [initiation.speed]}
  - {kind: column, name: fault, paths: [effects.faulty.fault]}
  - {kind: column, name: wait, paths: [effects.faulty.wait]}
plan: {kind: table, file: points.csv}
outputs: [{name: ground/force_normal}, {name: ground/sinkage}]
"""


def drops(folder: Path, *changes: tuple[str, str]) -> Path:
    """Write the study of drops, with some of its text replaced."""
    text = DROPS
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = folder / "drops.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def faulty(folder: Path, faults: dict[int, int], cases: int = 60, wait: float = 0.0) -> Path:
    """Write a study whose cases at some places have a fault."""
    speeds = np.linspace(1.0, 3.5, cases)
    lines = [f"{float(v)!r},{faults.get(k, 0)},{wait}" for k, v in enumerate(speeds)]
    (folder / "points.csv").write_text("\n".join(["speed,fault,wait", *lines, ""]), encoding="utf-8")
    path = folder / "faulty.yaml"
    path.write_text(FAULTY, encoding="utf-8")
    return path
