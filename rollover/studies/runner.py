"""A study from its points to its table: what is missing is run, here or on a cluster, and kept as it comes in."""

from __future__ import annotations

import hashlib
import json
import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Literal

from rollover.scenario import Scenario
from rollover.spec import document
from rollover.studies import case_store
from rollover.studies.case import (
    CLEARANCE,
    Case,
    Result,
    case_of,
    key_of,
    made_by,
    own_files,
    stated_versions,
    warm_up,
    work,
)
from rollover.studies.case_store import Row
from rollover.studies.design import Points, points
from rollover.studies.study import Study, base_values, changes
from rollover.system.errors import InputError
from rollover.system.processes import Failure, Outcome, begin_server, map_cases

TIME_LIMIT = 600.0  # s of wall time, for one case
MEMORY_LIMIT = 4e9  # bytes that one case may take
INTEGRATOR = "simulation.integrator"
START = "neighbouring start"  # column of points that says which one is meant; no axis has a name of two words
Show = Callable[["Progress"], None]


@dataclass(frozen=True, kw_only=True)
class Progress:
    """How far a study is: cases done and failed of those to be run, rate (1/s), time left (s)."""

    done: int
    failed: int
    of: int
    kept: int  # cases that were there already
    rate: float
    left: float


@dataclass(frozen=True, kw_only=True)
class Way:
    """How cases are worked off."""

    workers: int | None = None
    scheduler: str = ""  # address of a dask scheduler; empty: here
    time_limit: float = TIME_LIMIT
    memory_limit: float = MEMORY_LIMIT
    retry: Literal["", "failed"] = ""


@dataclass
class Builder:
    """Scenarios of points. Values are exchanged in the base where that gives the same as reading them would."""

    study: Study
    integrator: str = ""  # that makes the cases; empty: as the study has it
    fast: bool | None = None
    clearance: bool = field(init=False)
    base: dict[str, dict[str, Any]] = field(init=False)

    def __post_init__(self) -> None:
        self.base = {axis.name: base_values(self.study.scenario, axis) for axis in self.study.axes}
        self.clearance = any(output.name in CLEARANCE for output in self.study.outputs)

    def scenario(self, values: Mapping[str, Any]) -> Scenario:
        """The scenario of one point, its integrator chosen. Raises ``ValueError`` for values that it does not allow."""
        found = self._changed(values)
        if start := int(values.get(START, 0)):
            from rollover.studies.ensemble import perturbed_starts  # brings the simulation with it

            found = perturbed_starts(found, start + 1)[start]
        if self.study.simulator == "drop":
            return found
        return found.replaced({INTEGRATOR: self.integrator}) if self.integrator else found.of_many()

    def _changed(self, values: Mapping[str, Any]) -> Scenario:
        base = self.study.scenario
        found: dict[str, Any] = {}
        for axis in self.study.axes:
            found |= changes(self.base[axis.name], axis, values[axis.name])
        if self.fast is None:
            self.fast = self._agrees(found)
        if self.fast and not any(isinstance(v, str) for v in found.values()):
            return document.exchanged(base, found)
        return base.replaced(found, origin="study")

    def _agrees(self, found: Mapping[str, Any]) -> bool:
        base = self.study.scenario
        slow = base.replaced(found, origin="study")
        try:
            return document.exchanged(base, found) == slow
        except (KeyError, IndexError, ValueError, TypeError):
            return False

    def key(self, values: Mapping[str, Any]) -> str:
        """Key of a point; of one that is no scenario, one of its own."""
        try:
            scenario = self.scenario(values)
        except (ValueError, InputError) as e:
            return "bad-" + hashlib.sha256(f"{e}{json.dumps(values, sort_keys=True)}".encode()).hexdigest()[:36]
        return key_of(scenario, simulator=self.study.simulator, clearance=self.clearance)

    def case(self, key: str, values: Mapping[str, Any]) -> Case:
        """Case of a point and its key. Raises ``ValueError``."""
        return case_of(key, self.scenario(values), simulator=self.study.simulator, clearance=self.clearance)


@dataclass(frozen=True, kw_only=True)
class Conducted:
    """A study that was carried out: its points, their keys, a row for each; `ran` counts those run this time."""

    points: Points
    keys: Sequence[str]
    rows: Sequence[Row]
    ran: int


def conduct(study: Study, folder: Path, way: Way, show: Show | None = None) -> Conducted:
    """Run what is missing of a study and write its tables into `folder`, which is locked. Raises `InputError`."""
    found = points(study)
    builder = Builder(study)
    about = _plan_hash(study, found)
    keys = case_store.read_plan(folder, about)
    if keys is None or len(keys) != found.count:
        keys = [builder.key(found.row(k)) for k in range(found.count)]
        case_store.write_plan(folder, about, keys, found.columns)
    rows, ran = _worked_off(builder, folder, way, keys, found, show)
    in_order = [rows[key] for key in keys]
    case_store.compact(folder, study, keys, found.columns, in_order)
    return Conducted(points=found, keys=keys, rows=in_order, ran=ran)


def evaluate(builder: Builder, folder: Path, way: Way, found: Points, show: Show | None = None) -> list[Row]:
    """Rows of further points, kept like all others."""
    keys = [builder.key(found.row(k)) for k in range(found.count)]
    rows, _ = _worked_off(builder, folder, way, keys, found, show)
    return [rows[key] for key in keys]


def _worked_off(
    builder: Builder, folder: Path, way: Way, keys: Sequence[str], found: Points, show: Show | None
) -> tuple[dict[str, Row], int]:
    there = case_store.stored_keys(folder)
    rows: dict[str, Row] = {}
    todo: dict[str, int] = {}
    for k, key in enumerate(keys):
        if key in rows or key in todo:
            continue
        row = case_store.stored(folder, key) if key in there else None
        if row is None or (way.retry == "failed" and row.status == "failed"):
            todo[key] = k
        else:
            rows[key] = row
    tally = _Tally(of=len(todo), kept=len(rows), show=show)
    asked: list[str] = []

    def cases() -> Iterator[Case]:
        for key, k in todo.items():
            try:
                case = builder.case(key, found.row(k))
            except (ValueError, InputError) as e:
                failure = Failure(kind="error", sentence=f"no such scenario: {e}")
                rows[key] = _keep(folder, key, None, failure, 0.0)
                tally.count(rows[key])
                continue
            asked.append(key)
            yield case

    outcomes = _outcomes(cases(), way, builder.study)
    try:
        for outcome in outcomes:
            key = asked[outcome.index]
            rows[key] = _keep(folder, key, outcome.value, outcome.failure, outcome.wall_time)
            tally.count(rows[key])
    finally:
        outcomes.close()  # type: ignore[attr-defined]  # ends the children, after an interrupt too
    return rows, len(todo)


def _outcomes(cases: Iterator[Case], way: Way, study: Study) -> Iterator[Outcome[Case, Result]]:
    limits: dict[str, Any] = {
        "time_limit": way.time_limit,
        "memory_limit": way.memory_limit,
        "warm_up": partial(warm_up, study.simulator, study.scenario.of_many().integrator),
    }
    if not way.scheduler and way.workers != 0 and (module := _warm(study)):
        begin_server(module)
    if way.scheduler:
        from rollover.studies.cluster import map_on_cluster

        return map_on_cluster(work, cases, address=way.scheduler, workers=way.workers, **limits)
    return map_cases(work, cases, workers=way.workers, **limits)


def _warm(study: Study) -> str:
    """The module in which a study's kernels are loaded before its children are forked; Exudyn's are not."""
    if study.simulator == "drop":
        return "rollover.studies.warm_drops"
    return "rollover.studies.warm_overturns" if study.scenario.of_many().integrator == "compiled" else ""


def _keep(folder: Path, key: str, result: Result | None, failure: Failure | None, wall_time: float) -> Row:
    row = case_store.row_of(key, result, failure, wall_time)
    case_store.keep(folder, row)
    return row


class _Tally:
    def __init__(self, *, of: int, kept: int, show: Show | None) -> None:
        self.of, self.kept, self.show = of, kept, show
        self.done = self.failed = 0
        self.began = 0.0

    def count(self, row: Row) -> None:
        """The first case has waited for its worker to start: the clock runs from its end."""
        self.done += 1
        self.failed += row.status == "failed"
        if self.done == 1:
            self.began = time.monotonic()
        if self.show is not None:
            rate = (self.done - 1) / max(time.monotonic() - self.began, 1e-9)
            left = (self.of - self.done) / rate if rate > 0.0 else math.inf
            self.show(Progress(done=self.done, failed=self.failed, of=self.of, kept=self.kept, rate=rate, left=left))


def _plan_hash(study: Study, found: Points) -> str:
    """What the keys of a plan depend on: base, axes, values, versions, own effects."""
    digest = hashlib.sha256(document.content_hash(study.scenario).encode())
    axes = [document.to_mapping(axis) for axis in study.axes]
    parts = [
        axes,
        study.simulator,
        Builder(study).clearance,
        made_by(study.scenario.of_many(), study.simulator),
        stated_versions(),
        own_files("effects"),
        *filter(None, [own_files("laws")]),
    ]
    digest.update(json.dumps(parts, sort_keys=True).encode())
    for name, column in found.columns.items():
        digest.update(name.encode())
        digest.update(json.dumps(list(column)).encode() if column.dtype == object else column.tobytes())
    return digest.hexdigest()
