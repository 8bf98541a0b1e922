"""A diagnosis with what recordings alone give away about their sensors, which is asked before any model is."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

from rollover.assessment import results
from rollover.diagnosis.fit.jobs import Executor
from rollover.diagnosis.forward.forward_model import set_up
from rollover.diagnosis.pipeline import diagnose
from rollover.diagnosis.result import Diagnosis, Estimate
from rollover.diagnosis.settings import SETTINGS
from rollover.recording import Recording
from rollover.recording.checks import Finding, prechecks, shared_rails
from rollover.scenario import Scenario
from rollover.system.errors import Fault, InputError

TUNING = SETTINGS.report.sensors_first
Findings = Sequence[tuple[str, Finding]]


def check(scenario: Scenario, measured: Mapping[str, Recording]) -> None:
    """Refuse conditions that the scenario does not know, all at once. Raises `InputError`."""
    faults: list[Fault] = []
    for recording in measured.values():
        try:
            set_up(scenario, recording)
        except InputError as e:
            faults += e.faults
    if faults:
        raise InputError(*faults)


def sensor_precheck(scenario: Scenario, measured: Mapping[str, Recording]) -> list[tuple[str, Finding]]:
    """Name of the recording and finding, for what the recordings alone give away about their sensors."""
    found = []
    for name, recording in measured.items():
        own = set_up(scenario, recording)
        mass = getattr(own.vehicle, "mass", None)
        found += [(name, f) for f in prechecks(recording, mass=mass, gravity=own.gravity)]
    found_before = {(name, f.check, f.channel) for name, f in found}
    return found + [(name, f) for name, f in shared_rails(measured) if (name, f.check, f.channel) not in found_before]


def diagnosed(
    scenario: Scenario,
    measured: Mapping[str, Recording],
    findings: Findings,
    *,
    hold_out: Sequence[str] = (),
    tolerance: float | Mapping[str, float] = 0.0,
    reference: Sequence[str] = (),
    estimate: Estimate = "unexplained",
    posterior: int = 0,
    say: Callable[[str], None] = lambda _: None,
    executor: Executor | None = None,
) -> Diagnosis:
    """Diagnose, see `diagnose`; what the sensors gave away stands first among the notes. Raises `InputError`."""
    found = diagnose(
        scenario,
        list(measured.items()),
        hold_out=hold_out,
        tolerance=tolerance,
        reference=reference,
        estimate=estimate,
        posterior=posterior,
        say=say,
        executor=executor,
    )
    return replace(found, notes=(*in_words(findings), *found.notes))


def in_words(findings: Findings) -> Iterator[str]:
    """A line for each finding; of many alike in one channel of one recording the first ones, and how many more."""
    alike: dict[tuple[str, str, str], list[str]] = {}
    for name, f in findings:
        alike.setdefault((name, f.channel, f.check), []).append(f.sentence)
    for (name, channel, check_), sentences in alike.items():
        yield from (f"{name}: {channel}: {s}" for s in sentences[: TUNING.spelt_out])
        if len(sentences) > TUNING.spelt_out:
            yield f"{name}: {channel}: {len(sentences) - TUNING.spelt_out} more such findings ({check_})"


def plain(findings: Findings) -> list[dict[str, Any]]:
    """The findings as bare values, for diagnosis.json."""
    return [{"recording": name, **results.plain(asdict(f))} for name, f in findings]
