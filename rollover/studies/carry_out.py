"""A study from its file to its answer: what `rollover study` does between reading and what it says."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import ndtr

from rollover.assessment.results import plain, versions
from rollover.assessment.shipped import origin
from rollover.spec import document
from rollover.spec.document import content_hash, dump
from rollover.studies import case_store, cluster, reference, reliability
from rollover.studies.case import made_by
from rollover.studies.design import from_unit, points
from rollover.studies.runner import Builder, Conducted, Progress, Way, conduct, evaluate
from rollover.studies.study import Study, load
from rollover.studies.summary import answers, values_of
from rollover.system.errors import Fault, InputError
from rollover.system.own_json import read_json
from rollover.system.writing import holding, sweep

Page = Callable[[Conducted, Mapping[str, Any]], str]
SET = "--set"
Watch = Callable[[str], AbstractContextManager[Callable[..., None]]]


@contextmanager
def unwatched(what: str) -> Iterator[Callable[..., None]]:
    """Nobody is told how many are done."""
    del what
    yield lambda *_: None


@dataclass(frozen=True, kw_only=True)
class Prepared:
    """A study that was read, and its folder, `target` resolved, that may be written."""

    name: str
    study: Study
    folder: Path
    target: Path
    given: tuple[str, ...] = ()  # what was set in the scenario of the study's file, PATH=VALUE

    def carried_out(
        self,
        way: Way,
        *,
        page: Page,
        watch: Watch = unwatched,
        say: Callable[[str], None] = lambda _: None,
    ) -> dict[str, Any]:
        """Run what is missing and write the answer to the folder.

        Returns what study.json says, before `plain`. `page` gives the report, `watch(what)` what is told how many cases
        are done. Raises `InputError`.
        """
        chosen, target = self.study, self.target
        with holding(target):
            _begin(self)
            began = time.perf_counter()
            with watch("cases") as show:
                done = conduct(chosen, target, way, lambda p: show(p.done, p.of, _note(p)))
            ran = time.perf_counter() - began
            builder = Builder(chosen)
            report = {**_head(self, "done"), **answers(chosen, done), "ran": done.ran}
            report["kept"] = len(set(done.keys)) - done.ran
            report["integrator"] = _integrators(chosen, done)
            report["reference_check"] = _reference(chosen, target, way, watch, done)
            report["reliability"] = _reliability(chosen, builder, target, way, watch, say)
            report["worst"] = _write_worst(target, chosen, builder, report)
            report["run_time"] = ran
            bare: dict[str, Any] = plain(report)
            case_store.put_text(target / case_store.PAGE, page(done, bare))
            case_store.put_text(target / case_store.REPORT, json.dumps(bare, indent=2, allow_nan=False) + "\n")
        return report


def prepared(
    path: Path,
    out: Path | None = None,
    *,
    changes: Mapping[str, Any] | None = None,
    given: Sequence[str] = (),
    scheduler: str = "",
    force: bool = False,
) -> Prepared:
    """Read a study and what it needs, and claim its folder (None: out/study/NAME). Raises `InputError`.

    `changes` are values of its scenario by path, told as they were `given`; its axes are checked with them.
    """
    chosen = load(path)
    if changes:
        chosen = _changed(chosen, changes)
    points(chosen)  # reads the plan's table as well, before anything is written
    if chosen.reliability is not None:
        reliability.installed()
    if scheduler:
        cluster.installed(scheduler)
    folder = out or Path("out", "study", path.stem)
    target = case_store.claim(folder, path.stem, force=force)
    return Prepared(name=path.stem, study=chosen, folder=folder, target=target, given=tuple(given))


def _changed(chosen: Study, changes: Mapping[str, Any]) -> Study:
    """The study of a scenario with other values, its axes checked with them. Raises `InputError`."""
    for axis in chosen.axes:
        for at in axis.paths if axis.apply == "value" else ():
            lost = next((path for path in changes if path == at or path.startswith(f"{at}.")), None)
            if lost is not None:
                message = f"set by the axis {axis.name!r} in every case; another path, or another axis in the file"
                raise InputError(Fault(file=SET, path=lost, message=message))
    scenario = chosen.scenario.replaced(changes, origin=SET)
    return document.replaced(chosen, {"scenario": scenario}, SET)


def _begin(ready: Prepared) -> None:
    """Mark the folder as this study's, so that it can be gone on with after whatever happens."""
    target, name, chosen = ready.target, ready.name, ready.study
    target.mkdir(parents=True, exist_ok=True)
    sweep(target)  # what a process left that was killed
    (target / case_store.LOCK).unlink(missing_ok=True)  # of an earlier version, which locked the folder from within
    head = f"{chosen.title}\nEvery value of the study beside this file."
    case_store.put_text(target / case_store.STUDY, dump(chosen, head))
    if not (target / case_store.REPORT).exists() or _name_of(target / case_store.REPORT) != name:
        case_store.put_text(target / case_store.REPORT, json.dumps(_head(ready, "running"), indent=2) + "\n")


def _name_of(report: Path) -> str:
    try:
        return str(read_json(report).get("name", ""))
    except (OSError, ValueError):
        return ""


def _head(ready: Prepared, status: str) -> dict[str, Any]:
    chosen, made_from = ready.study, origin(ready.study.scenario)
    return {
        "format": case_store.FORMAT,
        "name": ready.name,
        "title": chosen.title,
        "differs": made_from.in_words if made_from else "",
        "set": list(ready.given),
        "status": status,
        "scenario_hash": content_hash(chosen.scenario),
        **chosen.scenario.own_code,
        "integrator": made_by(chosen.scenario.of_many(), chosen.simulator),
        "plan": chosen.plan.kind,
        "versions": versions(),
    }


def _reference(chosen: Study, target: Path, way: Way, watch: Watch, done: Conducted) -> dict[str, Any] | None:
    """Some cases once more by Exudyn, through the same store."""
    if not (at := reference.chosen(chosen, done)):
        return None
    with watch("cases by Exudyn") as show:
        return reference.checked(chosen, target, way, done, at, lambda p: show(p.done, p.of, _note(p)))


def _integrators(chosen: Study, done: Conducted) -> str:
    """Which integrator made the cases, both where an axis leads from one to the other."""
    integrators = {str(name) for row in done.rows if (name := row.provenance.get("integrator"))}
    return ", ".join(sorted(integrators)) or made_by(chosen.scenario.of_many(), chosen.simulator)


def _note(p: Progress) -> str:
    failed = f"{p.failed} failed, " if p.failed else ""
    return f"{failed}{60.0 * p.rate:.3g} a minute, {_span(p.left)} left" if p.rate > 0.0 else failed.rstrip(", ")


def _span(seconds: float) -> str:
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"


def _reliability(
    chosen: Study, builder: Builder, target: Path, way: Way, watch: Watch, say: Callable[[str], None]
) -> dict[str, Any] | None:
    """FORM and importance sampling through the same store: what was run once is not run again."""
    if chosen.reliability is None:
        return None

    output = chosen.outputs[0]
    limit = output.limit
    assert limit is not None

    def limit_state(u: Any) -> Any:
        with watch("cases about the design point") as show:
            found = from_unit(chosen, ndtr(u))
            rows = evaluate(builder, target, way, found, lambda p: show(p.done, p.of, _note(p)))
        return output.worst_sign * (values_of(output, rows) - limit) / max(abs(limit), 1e-12)

    names = [axis.name for axis in chosen.axes]
    try:
        found = reliability.form_and_importance_sampling(limit_state, names, chosen.reliability, chosen.confidence)
    except reliability.NoDesignPointError as e:
        say(f"No reliability: {e}")
        return {"reason": str(e)}
    point = from_unit(chosen, ndtr(np.array([[found["design_point"][n] for n in names]]))).row(0)
    return {**found, "output": output.name, "limit": limit, "design_values": point}


def _write_worst(target: Path, chosen: Study, builder: Builder, report: dict[str, Any]) -> dict[str, Any] | None:
    """Write the worst case of the first output as a scenario, and say what it is."""
    worst = report["outputs"][0]["worst"]
    if worst is None:
        (target / case_store.WORST).unlink(missing_ok=True)
        return None
    output = chosen.outputs[0]
    said = ", ".join(f"{name} = {value}" for name, value in worst["axes"].items())
    scenario = builder.scenario(worst["axes"])
    head = (
        f"Worst case of the study {report['name']}: point {worst['point']}, {said}.\n"
        f"There {output.name} is {worst['value']!r} {output.unit}; run it again: rollover run {case_store.WORST}"
    )
    if chosen.simulator == "drop":
        head += "\nThe study dropped it by itself; the full run differs by the integration error."
    case_store.put_text(target / case_store.WORST, dump(scenario, head))
    return {"output": output.name, "file": case_store.WORST, "scenario_hash": content_hash(scenario), **worst}
