"""The blind proof: cases are made and sealed, each is diagnosed in a process of its own, then the truth is opened.

The diagnosis is known by name only (`module:function`), and so is what makes the cases of a rig other than the drop
rig: the proof imports nothing of them.
"""

from __future__ import annotations

import importlib
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from rollover.proof.commitment import Seal, opened, sealed, write_truth
from rollover.proof.generator import Case, Order
from rollover.proof.handover import fingerprint, write_case
from rollover.proof.score import score
from rollover.proof.summary import tally
from rollover.system.processes import map_cases
from rollover.system.writing import scratch

FORMAT = "rollover-proof/1"
DIAGNOSIS = "rollover.diagnosis:diagnose_folder"
RIGS = {"drop": "rollover.proof.generator", "overturn": "rollover.proof.overturns.generator"}  # with `plan` and `make`
Diagnose = Callable[..., dict[str, Any]]
_OF_FILES = re.compile(r"(?:InputError|OSError): (?:\[Errno \d+\] )?(.*)", re.DOTALL)  # a case's that cannot be written


@dataclass(frozen=True, kw_only=True)
class Making:
    """A case to be made and where its folder goes."""

    order: Order
    folder: Path
    rig: str = "drop"


@dataclass(frozen=True, kw_only=True)
class Handed:
    """All that a diagnosing process is told."""

    folder: Path
    out: Path
    diagnosis: str = DIAGNOSIS


@dataclass(frozen=True, kw_only=True)
class Proof:
    """What a proof gives: prove.json (`report`), seal, truths, and each diagnosis by case."""

    report: dict[str, Any]
    seal: Seal
    truths: list[dict[str, Any]]
    diagnoses: dict[str, dict[str, Any]]


def made(making: Making) -> dict[str, Any]:
    """Write the folder of one case; its truth, with the fingerprint of what is handed over."""
    case: Case = importlib.import_module(RIGS[making.rig]).make(making.order)
    write_case(case, making.folder)
    return {**case.truth, "handed_over": fingerprint(making.folder)}


def diagnosed(handed: Handed) -> dict[str, Any]:
    """Diagnose one folder."""
    module, _, name = handed.diagnosis.partition(":")
    diagnose = cast(Diagnose, getattr(importlib.import_module(module), name))
    return diagnose(handed.folder, handed.out, workers=1)


def orders_of(
    count: int,
    seed: int,
    *,
    rig: str,
    kinds: Sequence[str],
    effects: Sequence[str],
    background: float | str | None,
) -> list[Order]:
    """Which cases are to be made. Raises ``ValueError``."""
    if rig not in RIGS:
        raise ValueError(f"rig: no such rig, got {rig!r}; {', '.join(RIGS)} are allowed")
    if background is not None and rig != "drop":
        raise ValueError(f"background: of drops only, got it with the rig {rig!r}")
    more = {} if background is None else {"background": background}
    return list(importlib.import_module(RIGS[rig]).plan(count, seed, kinds, effects, **more))


def made_cases(
    orders: Sequence[Order], folders: Sequence[Path], *, rig: str, workers: int | None
) -> list[dict[str, Any]]:
    """Truths of cases whose folders are written, in their order. Raises ``ValueError`` where there is no room."""
    truths: dict[int, dict[str, Any]] = {}
    makings = [Making(order=o, folder=f, rig=rig) for o, f in zip(orders, folders, strict=True)]
    for outcome in map_cases(made, makings, workers=workers):
        if outcome.value is None:
            sentence = outcome.failure.sentence if outcome.failure else "no reason given"
            what = f"{orders[outcome.index].name} could not be made"
            if (refused := _OF_FILES.match(sentence)) is not None:
                raise ValueError(f"{what}: {refused[1]}; room for temporary files is needed")
            raise RuntimeError(f"{what}: {sentence}")
        truths[outcome.index] = outcome.value
    return [truths[i] for i in range(len(orders))]


def prove(
    count: int,
    seed: int,
    *,
    rig: str = "drop",
    kinds: Sequence[str] = (),
    effects: Sequence[str] = (),
    background: float | str | None = None,
    workers: int | None = None,
    time_limit: float | None = None,
    diagnosis: str = DIAGNOSIS,
    on_seal: Callable[[Seal], None] = lambda seal: None,
    show: Callable[[int, int], None] = lambda done, of: None,
) -> Proof:
    """Make, seal, diagnose, open, score. `on_seal` is called before the first diagnosis, `show` after each case.

    `rig` is one of `RIGS`; a `background` (share of the range, or ``drawn``) is put on every case, of drops only.

    Cases stand in a temporary folder, the truth in another one until it is opened. Raises ``ValueError`` for what
    cannot be planned or has no room for its files, and ``RuntimeError`` if a case cannot be made.
    """
    more = {} if background is None else {"background": background}
    orders = orders_of(count, seed, rig=rig, kinds=kinds, effects=effects, background=background)
    with scratch() as given, scratch() as kept:
        folders = [Path(given) / order.name for order in orders]
        ordered = made_cases(orders, folders, rig=rig, workers=workers)
        seal = sealed(ordered)
        path = write_truth(ordered, seal, Path(kept))
        on_seal(seal)
        tasks = [Handed(folder=f, out=Path(given) / "out" / f.name, diagnosis=diagnosis) for f in folders]
        answers: dict[int, tuple[dict[str, Any] | None, str, float]] = {}
        for done, answer in enumerate(map_cases(diagnosed, tasks, workers=workers, time_limit=time_limit), start=1):
            sentence = answer.failure.sentence if answer.failure else ""
            answers[answer.index] = (answer.value, sentence, answer.wall_time)
            show(done, len(tasks))
        found = opened(seal.digest, path)
        changed = [f.name for f, t in zip(folders, found, strict=True) if fingerprint(f) != t["handed_over"]]
        if changed:
            raise RuntimeError(f"{changed[0]}: its recordings were changed by the diagnosis")
    rows = []
    for i, truth in enumerate(found):
        value, sentence, seconds = answers[i]
        rows.append({**score(truth, value, seconds), "failure": sentence})
    report = {
        "format": FORMAT,
        "cases": count,
        "seed": seed,
        "rig": rig,
        "kinds": list(kinds),
        "effects": list(effects),
        **more,
        "seal": seal.public(),
        "summary": tally(rows),
        "rows": rows,
    }
    diagnoses = {orders[i].name: value for i, (value, _, _) in sorted(answers.items()) if value is not None}
    return Proof(report=report, seal=seal, truths=found, diagnoses=diagnoses)
