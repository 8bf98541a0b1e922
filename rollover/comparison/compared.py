"""Recordings against runs under their conditions: what `rollover compare` does between reading and writing."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rollover.assessment.results import versions
from rollover.comparison.misfit import Misfit, estimated_noise, misfit, summary
from rollover.comparison.onset import timed
from rollover.comparison.rating import NotRateable, verdict
from rollover.dynamics import simulate
from rollover.dynamics.result import Run
from rollover.recording import Recording
from rollover.scenario import Scenario
from rollover.spec.document import named
from rollover.system.errors import Fault, InputError
from rollover.system.notebook import card

FORMAT = "rollover-compare/1"
Progress = Callable[[float, float], None]
Watch = Callable[[str, Scenario], AbstractContextManager[Progress | None]]


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """Each recording against its run, by name and in the order of the recordings.

    `misfits` hold residuals (SI) and ratings by channel and phase; `runs` are the scenario under each recording's
    conditions.
    """

    scenario: Scenario
    runs: Mapping[str, Run]
    misfits: tuple[Misfit, ...]

    def __getitem__(self, name: str) -> Misfit:
        """Misfit of the recording `name`. Raises ``KeyError``."""
        return {each.recording: each for each in self.misfits}[name]

    def _repr_html_(self) -> str:
        """What a notebook shows: how well each channel is followed."""
        rows = []
        for each in self.misfits:
            for c in each.channels:
                if isinstance(c.rating, NotRateable):
                    rows.append((each.recording, c.channel, str(c.cfc or ""), "", "", "", c.rating.reason))
                    continue
                iso, peak, over, said = c.rating.iso18571, c.rating.peak, c.rating.over_noise, verdict(c.rating)
                overall = getattr(iso, "overall", None)
                numbers = (
                    "" if overall is None else f"{overall:.3f}",
                    "" if over is None else f"{over:.3g}",
                    "" if peak.relative_error is None else f"{100.0 * peak.relative_error:+.3g}",
                )
                rows.append((each.recording, c.channel, str(c.cfc or ""), *numbers, said.in_words))
        headings = ("recording", "channel", "CFC", "ISO 18571", "rms/noise", "peak %", "verdict")
        failed = [
            f"{name}: the simulation failed: {r.sentence}" for name, r in self.runs.items() if r.status == "failed"
        ]
        notes = [f"{each.recording}: {note}" for each in self.misfits for note in each.notes]
        left = [f"{each.recording}: {c}: left out, {why}" for each in self.misfits for c, why in each.skipped.items()]
        return card(self.scenario.title, [*failed, *notes, *left], headings, rows, words=(0, 1, 6))


def compared(
    scenario: Scenario,
    recordings: Mapping[str, Recording],
    *,
    file: Path | None = None,
    cfc: int | None = None,
    watch: Watch | None = None,
) -> Comparison:
    """Simulate a scenario under the conditions of each recording, and compare.

    `file` is the scenario's, to which faults of the runs are put. `cfc` is the filter class for both sides, refused
    where one is too slow; None: that of the scenario where possible.
    `watch(name, scenario)` gives what is told the progress of each run (s simulated, s of wall time). Raises
    `InputError`, for all recordings at once of which nothing can be compared.
    """
    with named(file):
        runs = under_conditions(scenario, recordings, watch)
    return Comparison(scenario=scenario, runs=runs, misfits=misfits(runs, recordings, cfc))


def under_conditions(
    scenario: Scenario, recordings: Mapping[str, Recording], watch: Watch | None = None
) -> dict[str, Run]:
    """A run of the scenario for each recording, under its conditions. Raises `InputError`."""
    runs = {}
    for name, recording in recordings.items():
        under = scenario.replaced(recording.conditions, origin=f"{name}: conditions")
        with nullcontext() if watch is None else watch(name, under) as show:
            runs[name] = simulate.run(under, progress=show)
    return runs


def misfits(runs: Mapping[str, Run], recordings: Mapping[str, Recording], cfc: int | None) -> tuple[Misfit, ...]:
    """Each recording against its run. Raises `InputError` for all at once of which nothing can be compared."""
    found, faults = [], []
    for name, recording in recordings.items():
        try:
            found.append(_misfit(runs[name], recording, name, cfc))
        except InputError as e:
            faults += e.faults
    if faults:
        raise InputError(*faults)
    return tuple(found)


def _misfit(run: Run, recording: Recording, name: str, cfc: int | None) -> Misfit:
    wanted = run.scenario.loads.cfc if cfc is None else cfc
    at = timed(name, recording, run.scenario, lambda _: run.recording)
    try:
        found = misfit(run, at.recording, name=name, cfc=wanted, at_least=cfc is not None, noise=estimated_noise)
    except ValueError as e:
        raise InputError(Fault(file=name, message=str(e))) from None
    if not found.channels:
        why = "; ".join(f"{channel}: {reason}" for channel, reason in found.skipped.items())
        message = f"nothing to compare, got {why}; one channel that both have at one time is needed"
        raise InputError(Fault(file=name, message=message))
    return replace(found, zero=at.zero)


def json_of(found: Comparison, about: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """What compare.json says; `about` names what was asked."""
    runs = found.runs
    return {
        "format": FORMAT,
        **(about or {}),
        "versions": versions(),
        "comparisons": [
            {**summary(each), "status": runs[each.recording].status, "sentence": runs[each.recording].sentence}
            for each in found.misfits
        ],
    }
