"""The store of a study: one small Parquet file for each case, named by its key, and the table that is made of them.

A file is there whole or not at all, so a study that was ended at any moment goes on where it stopped. Points that mean
the same scenario share a file.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rollover.assessment.results import plain
from rollover.recording import UnreadableError, put_text, read_pairs, read_table, write_pairs, write_table
from rollover.studies.case import Result, stated_versions
from rollover.studies.study import Study, is_measure, meaning_of, unit_of
from rollover.system.errors import Fault, InputError
from rollover.system.own_json import read_json
from rollover.system.processes import Failure
from rollover.system.writing import PART, hold, own

FORMAT = "rollover-study-account/1"
REPORT, STUDY, CASES, TABLE, PROVENANCE, PLAN, PAGE, WORST, LOCK = (
    "study.json",
    "study.yaml",
    "cases",
    "cases.parquet",
    "provenance.parquet",
    "plan.parquet",
    "report.html",
    "worst.yaml",
    ".lock",
)
FILES = (REPORT, STUDY, CASES, TABLE, PROVENANCE, PLAN, PAGE, WORST, LOCK)
EFFORT_COLUMNS = ("finished", "wall_time", "cpu_time", "peak_memory", "host", "process", "integrator")
PROVENANCE_UNITS = {"wall_time": "s", "cpu_time": "s", "peak_memory": "B"}
_TYPES = dict.fromkeys(("wall_time", "cpu_time", "peak_memory", "process"), (int, float))  # of what is told; else text

__all__ = [
    "Row",
    "claim",
    "compact",
    "keep",
    "put_text",
    "read_plan",
    "row_of",
    "stored",
    "stored_keys",
    "write_plan",
]


@dataclass(frozen=True, kw_only=True)
class Row:
    """What is kept of a case: `status` is done or failed, `failure` says by what, `sentence` why."""

    key: str
    status: str
    failure: str
    sentence: str
    measures: Mapping[str, float]
    domain_flags: tuple[str, ...]
    peak_flags: tuple[str, ...]
    provenance: Mapping[str, Any]


def row_of(key: str, result: Result | None, failure: Failure | None, wall_time: float) -> Row:
    """Row of a case that came back with a result or a failure."""
    if result is None:
        assert failure is not None
        return Row(
            key=key,
            status="failed",
            failure=failure.kind,
            sentence=failure.sentence,
            measures={},
            domain_flags=(),
            peak_flags=(),
            provenance={"wall_time": wall_time, "detail": failure.detail},
        )
    return Row(
        key=key,
        status="failed" if result.sentence else "done",
        failure="simulation" if result.sentence else "",
        sentence=result.sentence,
        measures=result.measures,
        domain_flags=result.domain_flags,
        peak_flags=result.peak_flags,
        provenance=result.provenance,
    )


def claim(folder: Path, name: str, *, force: bool) -> Path:
    """Resolve a study's folder after making sure that it may be written; a command holds it from here to its end.

    The same study, changed or not, goes on in its folder; another one replaces it only with `force`. A folder that
    holds anything but a study is never touched. Raises `InputError`.
    """
    if folder.exists() and not folder.is_dir():
        raise _refused(folder, "not a folder, but a file; another --out is needed")
    hold(folder)
    target = folder.resolve()
    if not target.exists():
        return target
    names = [p.name for p in target.iterdir() if not p.name.endswith(PART) and not own(target, p.name)]
    if led := [p.name for p in target.iterdir() if p.is_symlink() and not p.resolve().is_relative_to(target)]:
        raise _refused(folder, f"holds a link that leads out of it, got {led[0]!r}; another --out is needed")
    if foreign := sorted(set(names) - set(FILES)):
        raise _refused(folder, f"holds files that are no study's, got {foreign[0]!r}; another --out is needed")
    if force or not set(names) - {LOCK, STUDY}:  # nothing yet, or killed before anything was there
        return target
    try:
        found = read_json(target / REPORT)
    except (OSError, ValueError):
        raise _refused(folder, f"holds results without a {REPORT}; another --out, or --force") from None
    if found.get("format") != FORMAT or found.get("name") != name:
        got = found.get("name", found.get("format", ""))
        raise _refused(folder, f"holds another study, got {got!r}; --force replaces it, --out leaves it")
    return target


def path_of(folder: Path, key: str) -> Path:
    """File of a case; 256 folders keep each of them short."""
    return folder / CASES / key[:2] / f"{key}.parquet"


def keep(folder: Path, row: Row) -> None:
    """Write the file of a case."""
    about = {
        "key": row.key,
        "status": row.status,
        "failure": row.failure,
        "sentence": row.sentence,
        "domain_flags": list(row.domain_flags),
        "peak_flags": list(row.peak_flags),
        "versions": stated_versions(),
        "provenance": plain(row.provenance),
    }
    write_pairs(row.measures, about, path_of(folder, row.key))


def stored(folder: Path, key: str) -> Row | None:
    """Row of a case, None if there is none or its file is damaged: then it is run again."""
    try:
        measures, about = read_pairs(path_of(folder, key))
        texts = [about[name] for name in ("status", "failure", "sentence")]
        texts += [*about["domain_flags"], *about["peak_flags"]]
        recorded = about["provenance"].items()
        is_own = about["key"] == key and about["status"] in ("done", "failed")
        is_own = is_own and all(v is None or isinstance(v, _TYPES.get(name, str)) for name, v in recorded)
        if not is_own or None in (*measures, *measures.values()) or not all(isinstance(text, str) for text in texts):
            return None  # somebody else wrote it
        if not all(is_measure(name) for name in measures):
            return None
        return Row(
            key=key,
            status=about["status"],
            failure=about["failure"],
            sentence=about["sentence"],
            measures=measures,
            domain_flags=tuple(about["domain_flags"]),
            peak_flags=tuple(about["peak_flags"]),
            provenance=about["provenance"],
        )
    except (UnreadableError, AttributeError, KeyError, TypeError):
        return None


def stored_keys(folder: Path) -> set[str]:
    """Keys of all cases that have a file."""
    found: set[str] = set()
    shelf = folder / CASES
    for part in sorted(p for p in shelf.iterdir() if p.is_dir()) if shelf.is_dir() else ():
        with os.scandir(part) as entries:
            for e in entries:
                if e.name.startswith("."):
                    os.unlink(e)  # half a file of a process that was killed; the lock says that nobody writes it now
                else:
                    found.add(e.name.removesuffix(".parquet"))
    return found


def read_plan(folder: Path, about: str) -> list[str] | None:
    """Keys of all points if they were worked out for this very plan before."""
    try:
        columns, recorded = read_table(folder / PLAN)
    except UnreadableError:
        return None
    keys = columns.get("case", [])
    return keys if recorded.get("plan") == about and keys and all(isinstance(key, str) for key in keys) else None


def write_plan(folder: Path, about: str, keys: Sequence[str], columns: Mapping[str, Any]) -> None:
    """Keep the keys of all points with their values: working them out again takes as long as simulating some."""
    table = {"point": list(range(len(keys))), "case": list(keys), **columns}
    write_table(table, folder / PLAN, {}, {"format": "rollover-study-plan/1", "plan": about})


def compact(folder: Path, study: Study, keys: Sequence[str], columns: Mapping[str, Any], rows: Sequence[Row]) -> None:
    """Write the table of cases, a row for each point in order, and that of their provenance.

    What differs from one machine and day to the next is in the second only: equal studies, equal first tables.
    """
    names = sorted({name for row in rows for name in row.measures})
    table: dict[str, Any] = {
        "point": list(range(len(keys))),
        "case": list(keys),
        "status": [row.status for row in rows],
        "failure": [row.failure for row in rows],
        "sentence": [row.sentence for row in rows],
        **columns,
        **{name: [row.measures.get(name) for row in rows] for name in names},
        "domain_flags": [",".join(row.domain_flags) for row in rows],
        "peak_flags": [",".join(row.peak_flags) for row in rows],
    }
    meanings = {name: {"unit": unit_of(name), "meaning": meaning_of(name)} for name in names}
    for axis in study.axes:
        meanings[axis.name] = {"meaning": f"{axis.apply} at {', '.join(axis.paths)}", "unit": ""}
    about = {"format": "rollover-study-table/1", "title": study.title, "versions": stated_versions()}
    write_table(table, folder / TABLE, meanings, about)
    recorded = {name: [row.provenance.get(name) for row in rows] for name in EFFORT_COLUMNS}
    detail = [row.provenance.get("detail", "") for row in rows]
    provenance = {"point": table["point"], "case": table["case"], **recorded, "detail": detail}
    provenance["versions"] = [stated_versions()] * len(rows)
    units = {name: {"unit": unit} for name, unit in PROVENANCE_UNITS.items()}
    write_table(provenance, folder / PROVENANCE, units, {**about, "format": "rollover-study-provenance/1"})


def _refused(path: Path, message: str) -> InputError:
    return InputError(Fault(file=str(path), message=message))
