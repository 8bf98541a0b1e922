"""Entries to sealed cases of drops by other methods: answers as JSON, which `rollover score` scores.

    rollover prove --cases 20 --export out/cases
    python -m tests.benchmarks.entries out/cases --by bic --out out/bic.json        # or pysindy, or rollover
    rollover score out/cases out/bic.json

`bic`: each candidate alone by least squares with white noise, the least BIC (`plain_bic`). `pysindy`: a sparse
polynomial in depth and speed of the residual force, named after its largest term where that has a name; nothing where
it predicts nothing of conditions left out. `rollover`: the diagnosis itself.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Callable, Mapping
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from rollover.diagnosis import diagnose_folder
from rollover.diagnosis.data.dataset import dataset_of
from rollover.diagnosis.forward.averaging import simulated
from rollover.diagnosis.forward.forward_model import set_up
from rollover.diagnosis.inference.residual_law import balances
from rollover.diagnosis.io import recordings_in
from rollover.effects import effects
from rollover.scenario import load
from tests.benchmarks.plain_bic import by_bic
from tests.benchmarks.test_diagnosis import POWERS, Method, by_sindy, powers

# what a power (a, b) of z^a v^b alone would be called
NAMES = {
    (0, 0): "guide-friction",
    (1, 0): "soil-stiffness",
    (2, 0): "soil-stiffness",
    (0, 1): "soil-viscous-damping",
    (1, 1): "soil-viscous-damping",
    (0, 2): "soil-inertial-drag",
    (1, 2): "soil-inertial-drag",
}
VERDICT = {"physics": "missing-physics", "parameter": "parameter", "sensor": "sensor"}
Said = dict[str, Any]


def named(id: str, **more: Any) -> Said:
    """An answer of one effect."""
    return {"verdict": VERDICT[effects()[id].kind], "effects": [{"id": id, **more}]}


def of_bic(case: Path) -> Said:
    """The least BIC, and its weights as probabilities."""
    with tempfile.TemporaryDirectory() as out:
        found = by_bic(case, Path(out))
    said = {"verdict": "no-mismatch"} if not found["effects"] else named(**found["effects"][0])
    total = sum(found["probabilities"].values())
    return {**said, "probabilities": {id: p / total for id, p in found["probabilities"].items()}}


def of_sindy(case: Path, method: Method = by_sindy) -> Said:
    """The largest term of a sparse polynomial, if it predicts conditions left out better than nothing does."""
    scenario, recordings = load(case / "scenario.yaml"), recordings_in(case)
    kept = [e for e in (dataset_of(name, *simulated(scenario, r)) for name, r in recordings) if e is not None]
    every = balances([set_up(scenario, e.recording) for e in kept], kept)
    if len(every) < 2:
        return {"verdict": "cannot-tell"}
    scale = np.array([max(float(b.depth.max()) for b in every), max(float(b.speed.max()) for b in every)])
    means = [b.weights @ powers(np.stack([b.depth, b.speed], axis=1) / scale) for b in every]
    before = after = 0.0
    for k, b in enumerate(every):
        rest = [j for j, other in enumerate(every) if other.condition != b.condition]
        if not rest:
            return {"verdict": "cannot-tell"}
        c, _ = method(np.concatenate([means[j] for j in rest]), np.concatenate([every[j].force for j in rest]))
        before, after = before + float(np.sum(b.force**2)), after + float(np.sum((b.force - means[k] @ c) ** 2))
    c, _ = method(np.concatenate(means), np.concatenate([b.force for b in every]))
    if after >= before or not np.any(c):
        return {"verdict": "no-mismatch"}
    largest = POWERS[int(np.argmax(np.abs(c)))]
    return named(NAMES[largest]) if largest in NAMES else {"verdict": "unexplained"}


def of_rollover(case: Path) -> Said:
    """The diagnosis, its names with their sets and intervals."""
    with tempfile.TemporaryDirectory() as out:
        found = diagnose_folder(case, Path(out), workers=1)
    kept = ("id", "channel", "indistinguishable_from", "parameters")
    told = [{k: e[k] for k in kept if k in e} for e in found["effects"]]
    for e in told:
        e["parameters"] = {n: _interval(v) for n, v in e.get("parameters", {}).items()}
    return {"verdict": found["verdict"], "effects": told}


def _interval(found: Mapping[str, Any]) -> dict[str, float]:
    return {key: float(found[key]) for key in ("value", "low", "high")}


WAYS: dict[str, tuple[str, Callable[[Path], Said]]] = {
    "bic": ("", of_bic),
    "pysindy": ("pysindy", of_sindy),
    "rollover": ("rollover", of_rollover),
}


def answered(folder: Path, by: str) -> dict[str, Any]:
    """Answers to all cases of a folder, by one of `WAYS`."""
    package, way = WAYS[by]
    answers = []
    for case in sorted(p for p in folder.glob("case-*") if p.is_dir()):
        began = time.process_time()
        try:
            said = way(case)
        except (ArithmeticError, ValueError) as e:  # a method that fails is told so, and goes on
            print(f"{case.name}: {e}")
            said = {"verdict": "no-answer"}
        answers.append({"case": case.name, **said, "seconds": round(time.process_time() - began, 3)})
    seal = json.loads((folder / "seal.json").read_text(encoding="utf-8"))["digest"]
    return {"format": "rollover-answers/1", "by": _name(by, package), "seal": seal, "answers": answers}


def _name(by: str, package: str) -> str:
    try:
        return f"{by} {version(package)}" if package else by
    except PackageNotFoundError:
        return by


def main() -> None:
    """Write the answers of one method."""
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("folder", type=Path)
    asked.add_argument("--by", choices=list(WAYS), required=True)
    asked.add_argument("--out", type=Path, required=True)
    given = asked.parse_args()
    package, _ = WAYS[given.by]
    if package and find_spec(package) is None:
        asked.error(f"--by {given.by}: {package} is not installed; uv sync --group benchmark")
    given.out.write_text(json.dumps(answered(given.folder, given.by), indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
