"""Sealed cases for others: recordings and baselines in a folder that tells no truth, which stands in a file apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rollover.proof.commitment import SEAL, SEAL_FORMAT, Seal, opened, sealed
from rollover.proof.handover import fingerprint
from rollover.proof.runner import made_cases, orders_of
from rollover.system.errors import Fault, InputError
from rollover.system.own_json import read_json

FORMAT, LIST = "rollover-benchmark/1", "benchmark.json"
CANDIDATES_FORMAT, CANDIDATES = "rollover-candidates/1", "candidates.json"


@dataclass(frozen=True, kw_only=True)
class Exported:
    """Truths of the cases that were written, their seal, and what benchmark.json says."""

    truths: list[dict[str, Any]]
    seal: Seal
    report: dict[str, Any]


def export(
    folder: Path,
    count: int,
    seed: int,
    *,
    rig: str = "drop",
    kinds: Sequence[str] = (),
    effects: Sequence[str] = (),
    background: float | str | None = None,
    workers: int | None = None,
) -> Exported:
    """Write cases into a folder, which is there already. Raises ``ValueError`` for what cannot be planned.

    Seed, kinds and effects are no part of the report: they would tell the truth.
    """
    orders = orders_of(count, seed, rig=rig, kinds=kinds, effects=effects, background=background)
    truths = made_cases(orders, [folder / o.name for o in orders], rig=rig, workers=workers)
    cases = [{"case": o.name, "sha256": t["handed_over"]} for o, t in zip(orders, truths, strict=True)]
    return Exported(truths=truths, seal=sealed(truths), report={"format": FORMAT, "rig": rig, "cases": cases})


@dataclass(frozen=True, kw_only=True)
class Sealed:
    """A folder of sealed cases: names of the cases with their fingerprints, the truth's digest, what may be named.

    `candidates` are the names of the parameters that each has, by its id.
    """

    folder: Path
    seal: dict[str, Any]
    cases: dict[str, str]
    candidates: dict[str, tuple[str, ...]]

    @property
    def digest(self) -> str:
        """SHA-256 of the truth."""
        return str(self.seal["digest"])


def read_sealed(folder: Path) -> Sealed:
    """What `prove --export` wrote. Raises `InputError` for another folder, or where recordings were changed."""
    seal = _read(folder / SEAL, SEAL_FORMAT, "digest", "algorithm")
    listed = _read(folder / LIST, FORMAT, "cases")
    candidates = _read(folder / CANDIDATES, CANDIDATES_FORMAT, "candidates")
    try:
        cases = {str(c["case"]): str(c["sha256"]) for c in listed["cases"]}
    except (KeyError, TypeError, ValueError):
        raise _no_cases(folder / LIST, "its entries are not those of sealed cases") from None
    try:
        known = {str(c["id"]): tuple(map(str, dict(c["parameters"]))) for c in candidates["candidates"]}
    except (KeyError, TypeError, ValueError):
        raise _no_cases(folder / CANDIDATES, "its entries are not candidates with their parameters") from None
    for name, shown in cases.items():
        place = folder / name
        if Path(name).name != name or not place.is_dir():
            raise _no_cases(place, "no folder of a case")
        if fingerprint(place) != shown:
            raise _no_cases(place, "its files are not those that were written")
    return Sealed(folder=folder, seal=seal, cases=cases, candidates=known)


def truth_beside(folder: Path) -> Path:
    """Where the truth of a folder of cases stands unless another place is named: beside it."""
    whole = folder.resolve()
    return whole.parent / f"{whole.name}-truth.json"


def truths_of(given: Sealed, path: Path) -> list[dict[str, Any]]:
    """The truth of sealed cases, in their order. Raises `InputError` for another one."""
    truths = opened(given.digest, path)
    if [t["case"] for t in truths] != list(given.cases):
        raise InputError(
            Fault(file=str(path), message=f"not of the cases in {given.folder}; the file that goes with it")
        )
    return truths


def _read(path: Path, form: str, *keys: str) -> dict[str, Any]:
    try:
        found = read_json(path)
    except (OSError, ValueError):
        raise _no_cases(path, "it is missing, or no JSON") from None
    if found.get("format") != form or not found.keys() >= set(keys):
        raise _no_cases(path, f"format {form!r} with {', '.join(keys)} is needed")
    return found


def _no_cases(path: Path, why: str) -> InputError:
    message = f"no sealed cases: {why}; a folder as `rollover prove --export` wrote it is needed"
    return InputError(Fault(file=str(path), message=message))
