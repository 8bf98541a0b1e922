"""The blind proof: cases are made and sealed, each is diagnosed in a process of its own, then the truth is opened.

The diagnosis is known by name only (`module:function`), and so is what makes the cases of a rig other than the drop
rig: the proof imports nothing of them.
"""

from __future__ import annotations

import importlib
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from rollover.proof.commitment import Seal, opened, sealed, write_truth
from rollover.proof.generator import Case, Order
from rollover.proof.handover import fingerprint, write_case
from rollover.proof.kept import Answer, Kept
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
    kept: Kept | None = None,
    on_seal: Callable[[Seal], None] = lambda seal: None,
    show: Callable[[int, int], None] = lambda done, of: None,
) -> Proof:
    """Make, seal, diagnose, open, score. `on_seal` is called before the first diagnosis, `show` after each case.

    What is `kept` of the same campaign is not diagnosed again; whoever has written the report clears it.

    `rig` is one of `RIGS`; a `background` (share of the range, or ``drawn``) is put on every case, of drops only.

    Cases stand in a temporary folder, the truth in another one until it is opened. Raises ``ValueError`` for what
    cannot be planned or has no room for its files, and ``RuntimeError`` if a case cannot be made.
    """
    more = {} if background is None else {"background": background}
    orders = orders_of(count, seed, rig=rig, kinds=kinds, effects=effects, background=background)
    with scratch() as given, scratch() as apart:
        folders = [Path(given) / order.name for order in orders]
        ordered = made_cases(orders, folders, rig=rig, workers=workers)
        shown = None if kept is None else kept.seal()
        seal = sealed(ordered, None if shown is None else shown.salt)
        path = write_truth(ordered, seal, Path(apart))
        if kept is not None:
            kept.begin(seal)
        on_seal(seal)
        handed = {f: str(t["handed_over"]) for f, t in zip(folders, ordered, strict=True)}
        answers = _answers(handed, diagnosis, kept, show, workers=workers, time_limit=time_limit)
        found = opened(seal.digest, path)
        for folder, mark in handed.items():
            _check_unchanged(folder, mark)
    rows = []
    for order, truth in zip(orders, found, strict=True):
        answer = answers[order.name]
        rows.append({**score(truth, answer.diagnosis, answer.seconds), "failure": answer.sentence})
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
    diagnoses = {order.name: value for order in orders if (value := answers[order.name].diagnosis) is not None}
    return Proof(report=report, seal=seal, truths=found, diagnoses=diagnoses)


def _answers(
    handed: Mapping[Path, str],
    diagnosis: str,
    kept: Kept | None,
    show: Callable[[int, int], None],
    *,
    workers: int | None,
    time_limit: float | None,
) -> dict[str, Answer]:
    """What came of each case, by its name; of cases that are kept what came of them before.

    `handed` are folders with their fingerprints. A process that was ended is no answer of its case: that is not kept.
    """
    before = {f.name: kept.answer(f.name) for f in handed} if kept is not None else {}
    answers = {name: answer for name, answer in before.items() if answer is not None}
    if answers:
        show(len(answers), len(handed))
    left = [f for f in handed if f.name not in answers]
    tasks = [Handed(folder=f, out=f.parent / "out" / f.name, diagnosis=diagnosis) for f in left]
    for outcome in map_cases(diagnosed, tasks, workers=workers, time_limit=time_limit):
        folder, failure = left[outcome.index], outcome.failure
        _check_unchanged(folder, handed[folder])
        sentence = failure.sentence if failure else ""
        answer = Answer(diagnosis=outcome.value, sentence=sentence, seconds=outcome.wall_time)
        answers[folder.name] = answer
        if kept is not None and (failure is None or failure.kind != "crash"):
            kept.keep(folder.name, answer)
        show(len(answers), len(handed))
    return answers


def _check_unchanged(folder: Path, handed: str) -> None:
    if fingerprint(folder) != handed:
        raise RuntimeError(f"{folder.name}: its recordings were changed by the diagnosis")
