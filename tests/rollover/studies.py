"""Small studies of drop tests, which cost 2 ms a case."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rollover import studies
from rollover.studies import Study
from rollover.studies.case_store import Row
from rollover.studies.design import points
from rollover.studies.runner import Conducted

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


def made_up(folder: Path, cases: int) -> tuple[Study, Conducted]:
    """A study with rows made up by hand: force = 1000 speed^2 soil, every 20th case failed, no simulation."""
    study = studies.load(drops(folder, ("count: 20", f"count: {cases}")))
    found = points(study)
    force = 1e3 * found.columns["speed"] ** 2 * found.columns["soil"]
    rows = []
    for k in range(cases):
        failed = k % 20 == 7
        measures = {} if failed else {"ground/force_normal": float(force[k]), "ground/sinkage": float(1e-4 * force[k])}
        rows.append(
            Row(
                key=f"{k:040x}",
                status="failed" if failed else "done",
                failure="crash" if failed else "",
                sentence="its process ended with exit code -6" if failed else "",
                measures=measures,
                domain_flags=() if failed else ("impact-speed", "momentum")[: 1 + k % 2],
                peak_flags=() if failed else ("impact-speed",)[: k % 2],
                provenance={"wall_time": 0.5},
            )
        )
    return study, Conducted(points=found, keys=[row.key for row in rows], rows=rows, ran=cases)
