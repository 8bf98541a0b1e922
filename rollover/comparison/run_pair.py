"""Two runs side by side, a baseline and a candidate: what was changed, which loads that moved, and by how much.

Nothing is simulated and nothing is shifted in time: both are read from their results folders as they were written.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover import scenario
from rollover.assessment.answer_shape import ANSWER
from rollover.assessment.loads import PeakLoad, leading
from rollover.assessment.results import CHANNELS, RUN, SCENARIO, read_run_json
from rollover.recording import Recording, read_parquet
from rollover.recording.attitude import beside
from rollover.scenario import Scenario
from rollover.spec import document
from rollover.system.errors import Fault, InputError
from rollover.system.own_json import misfit_of

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Result:
    """A run as its folder keeps it; `answer` is what its run.json says."""

    folder: Path
    answer: Mapping[str, Any]
    scenario: Scenario
    recording: Recording
    peaks: tuple[PeakLoad, ...]

    @property
    def phases(self) -> tuple[tuple[float, str], ...]:
        """Start and name of each phase."""
        return tuple((p["start"], p["name"]) for p in self.answer["phases"])


@dataclass(frozen=True, kw_only=True)
class Change:
    """One value of the scenario that is not the same, by its path; None where only one of them has it."""

    path: str
    was: Any
    now: Any
    unit: str


@dataclass(frozen=True, kw_only=True)
class LoadChange:
    """Filtered peak (SI) of a load in both runs; None where only one has the load.

    `change` is relative to the baseline; `step` the larger change at half the step of the two runs, None if that was
    examined in neither.
    """

    channel: str
    unit: str
    cfc: int
    was: float | None
    now: float | None
    was_time: float | None
    now_time: float | None
    change: float | None
    step: float | None

    @property
    def verdict(self) -> str:
        """Whether the change is one: a change that halving the step makes as well says nothing."""
        if self.change is None:
            return "in one run only"
        if self.change == 0.0:
            return "as it was"
        if self.step is None:
            return "changed, step not examined"
        return "changed" if abs(self.change) > self.step else "within the step's error"


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """A criterion on whose verdict the two runs do not agree."""

    name: str
    was: str
    now: str


@dataclass(frozen=True, kw_only=True)
class Pair:
    """A baseline, a candidate and what separates them."""

    baseline: Result
    candidate: Result
    changes: tuple[Change, ...]
    loads: tuple[LoadChange, ...]
    verdicts: tuple[Verdict, ...]

    @property
    def leading(self) -> LoadChange | None:
        """The load that is asked for first, of those in both runs."""
        both = {load.channel: load for load in self.loads if load.change is not None}
        first = leading([p for p in self.baseline.peaks if p.channel in both])
        return None if first is None else both[first.channel]

    @property
    def channels(self) -> list[str]:
        """Channels that both have, in the baseline's order."""
        return [c for c in self.baseline.recording.channels if c in self.candidate.recording.channels]


def is_result(path: str | Path) -> bool:
    """Whether a path is the results folder of a run."""
    return (Path(path) / RUN).is_file()


def read(folder: Path) -> Result:
    """A run from its folder. Raises `InputError`."""
    answer = read_run_json(folder)
    for name in (SCENARIO, CHANNELS):
        if not (folder / name).is_file():
            raise InputError(Fault(file=str(folder), message=f"no {name} there; run it again with `rollover run`"))
    if wrong := misfit_of(answer, ANSWER):
        raise InputError(Fault(file=str(folder / RUN), path=wrong[0], message=wrong[1]))
    known = {f.name for f in fields(PeakLoad)}
    for i, peak in enumerate(answer["peak_loads"]):
        if more := [key for key in peak if key not in known]:
            message = f"unknown, got {more[0]!r}; {', '.join(sorted(known))} are allowed"
            raise InputError(Fault(file=str(folder / RUN), path=f"peak_loads.{i}", message=message))
    peaks = tuple(PeakLoad(**{**peak, "domain_flags": tuple(peak["domain_flags"])}) for peak in answer["peak_loads"])
    return Result(
        folder=folder,
        answer=answer,
        scenario=scenario.load(folder / SCENARIO),
        recording=read_parquet(folder / CHANNELS),
        peaks=peaks,
    )


def pair(baseline: Result, candidate: Result) -> Pair:
    """What separates two runs; the candidate's attitude is put on the baseline's branch."""
    candidate = replace(candidate, recording=beside(candidate.recording, baseline.recording))
    return Pair(
        baseline=baseline,
        candidate=candidate,
        changes=_changes(baseline.scenario, candidate.scenario),
        loads=_loads(baseline, candidate),
        verdicts=_verdicts(baseline.answer, candidate.answer),
    )


def difference(found: Pair, channel: str) -> tuple[Array, Array]:
    """Stamps (n,) of the baseline that lie within the candidate, s, and candidate less baseline there (n,), SI.

    The candidate is interpolated linearly where its stamps are others, and not at all where they are the same.
    """
    was, now = found.baseline.recording, found.candidate.recording
    inside = (was.time >= now.time[0]) & (was.time <= now.time[-1])
    time = was.time[inside]
    return time, np.interp(time, now.time, now[channel]) - was[channel][inside]


def summary(found: Pair) -> dict[str, Any]:
    """Everything but the histories, as bare values."""

    def side(result: Result) -> dict[str, Any]:
        keys = ("title", "status", "sentence", "scenario_hash", "versions")
        return {"folder": str(result.folder), **{key: result.answer[key] for key in keys}}

    return {
        "baseline": side(found.baseline),
        "candidate": side(found.candidate),
        "changed": [asdict(c) for c in found.changes],
        "loads": [{**asdict(load), "verdict": load.verdict} for load in found.loads],
        "verdicts": [asdict(v) for v in found.verdicts],
    }


def _changes(was: Scenario, now: Scenario) -> tuple[Change, ...]:
    before = {leaf.path: leaf for leaf in document.paths(was)}
    after = {leaf.path: leaf for leaf in document.paths(now)}
    found = []
    for path in dict.fromkeys([*before, *after]):
        a, b = before.get(path), after.get(path)
        values = (None if a is None else a.value, None if b is None else b.value)
        if path != "title" and values[0] != values[1]:
            found.append(Change(path=path, was=values[0], now=values[1], unit=(a or b).unit))  # type: ignore[union-attr]
    return tuple(found)


def _loads(was: Result, now: Result) -> tuple[LoadChange, ...]:
    before, after = ({p.channel: p for p in r.peaks} for r in (was, now))
    found = []
    for channel in dict.fromkeys([*before, *after]):
        a, b = before.get(channel), after.get(channel)
        either = a or b
        assert either is not None
        if not any(p is not None and p.raw for p in (a, b)):
            continue  # a wheel that touched in neither
        change = None
        if a is not None and b is not None and a.filtered:
            change = (b.filtered - a.filtered) / abs(a.filtered)
        steps = [p.half_step_change for p in (a, b) if p is not None and p.half_step_change is not None]
        found.append(
            LoadChange(
                channel=channel,
                unit=either.unit,
                cfc=either.cfc,
                was=None if a is None else a.filtered,
                now=None if b is None else b.filtered,
                was_time=None if a is None else a.filtered_time,
                now_time=None if b is None else b.filtered_time,
                change=change,
                step=max(steps, default=None),
            )
        )
    return tuple(found)


def _verdicts(was: Mapping[str, Any], now: Mapping[str, Any]) -> tuple[Verdict, ...]:
    def of(answer: Mapping[str, Any]) -> dict[str, str]:
        return {f"{c['requirement']['standard']}: {c['requirement']['name']}": c["verdict"] for c in answer["criteria"]}

    before, after = of(was), of(now)
    names = [n for n in before if n in after and before[n] != after[n]]
    return tuple(Verdict(name=n, was=before[n], now=after[n]) for n in names)
