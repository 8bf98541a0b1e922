"""Sealed cases on their way out: a folder that anyone may have, and the truth in a file apart."""

from __future__ import annotations

import json
import secrets
from dataclasses import asdict, dataclass
from pathlib import Path

from rollover.system.errors import Fault, InputError

LARGEST = 2**31  # of a seed that is drawn, so that it can be typed


@dataclass(frozen=True, kw_only=True)
class Order:
    """Which cases; the seed is drawn where none is given, as whoever knows it can make the truth."""

    cases: int
    seed: int | None
    rig: str
    kinds: list[str]
    effects: list[str]
    background: float | str | None
    workers: int | None


def write_sealed_cases(order: Order, folder: Path, truth: Path, *, force: bool, as_json: bool) -> None:
    """Write the folder and the file, both or neither. Raises `InputError`."""
    from rollover.assessment import results
    from rollover.cli import catalogue, console
    from rollover.cli.templates import of_sealed_cases
    from rollover.proof import sealed_cases
    from rollover.proof.commitment import PRIVATE, SEAL, write_truth
    from rollover.system.writing import check_free, hold, staged

    names = [sealed_cases.LIST, sealed_cases.CANDIDATES, SEAL, *of_sealed_cases(0, "", "")]
    if truth.resolve().is_relative_to(folder.resolve()):
        message = f"within the folder that others are given, got {folder}; --truth FILE elsewhere"
        raise InputError(Fault(file=str(truth), message=message))
    names += [p.name for p in folder.glob("case-*")] if (folder / sealed_cases.LIST).is_file() else []
    if folder.exists() and not force and any(folder.iterdir() if folder.is_dir() else [folder]):
        raise InputError(Fault(file=str(folder), message="exists; --force replaces it, another name leaves it"))
    results.claim_report(folder, sealed_cases.FORMAT, {}, names, force=force)
    check_free(truth, force=force)
    hold(truth)
    seed = secrets.randbelow(LARGEST) if order.seed is None else order.seed
    asked = {name: value for name, value in asdict(order).items() if name != "workers"} | {"seed": seed}
    with results.whole(folder) as part:
        try:
            made = sealed_cases.export(
                part,
                order.cases,
                seed,
                rig=order.rig,
                kinds=order.kinds,
                effects=order.effects,
                background=order.background,
                workers=order.workers,
            )
        except ValueError as e:
            raise InputError(Fault(file="rollover prove", message=str(e))) from None
        listed = catalogue.candidates("drop" if order.rig == "drop" else "rollover")
        results.write_json(part / sealed_cases.LIST, {**made.report, "versions": results.versions()})
        candidates = {"format": sealed_cases.CANDIDATES_FORMAT, "candidates": listed}
        results.write_json(part / sealed_cases.CANDIDATES, candidates)
        results.write_json(part / SEAL, made.seal.public())
        for name, text in of_sealed_cases(order.cases, order.rig, made.seal.digest).items():
            (part / name).write_text(text, encoding="utf-8")
        truth.parent.mkdir(parents=True, exist_ok=True)
        kept = staged(truth, lambda at: write_truth(made.truths, made.seal, at.parent, at.name, asked))
    kept.chmod(PRIVATE)  # before anybody sees it
    kept.replace(truth)
    if as_json:
        print(json.dumps({**made.report, "seal": made.seal.public(), "truth": str(truth)}, indent=2))
    else:
        console.tell(f"{order.cases} sealed cases in {folder}; the truth, of hash {made.seal.digest}, is {truth}")
