"""A diagnosis as it is asked for: files or objects, a scenario or a model; sensors are checked before any model is."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from rollover.assessment import results
from rollover.calibration.posterior import draws_of
from rollover.comparison.recordings import Recordings, held_out, measured
from rollover.diagnosis.fit.jobs import Executor
from rollover.diagnosis.forward.forward_model import set_up
from rollover.diagnosis.own_model.declaration import ForwardModel, declared, load_model
from rollover.diagnosis.own_model.pipeline import diagnose_model
from rollover.diagnosis.own_model.tables import tables
from rollover.diagnosis.pipeline import diagnose
from rollover.diagnosis.result import Diagnosis, Estimate
from rollover.diagnosis.settings import SETTINGS
from rollover.dynamics.drop_test import unfit
from rollover.recording import Recording
from rollover.recording.checks import Finding, prechecks, shared_rails
from rollover.scenario import Scenario, given
from rollover.system.arguments import listed, within
from rollover.system.errors import Fault, InputError

PRECHECKS = SETTINGS.report.sensors_first
Findings = Sequence[tuple[str, Finding]]


def check_is_drop(scenario: Scenario, by: str) -> None:
    """Refuse draws of what is no drop; `by` names what asks for them. Raises `InputError`."""
    if unfit(scenario):
        message = f"of drops only, got an overturn, whose draws are runs; without it, or calibrate with {by}"
        raise InputError(Fault(file=by, message=message))


def diagnosed(
    scenario: str | Path | Scenario | ForwardModel,
    recordings: Recordings,
    *,
    hold_out: str | Sequence[str],
    tolerance: float | Mapping[str, float],
    reference: str | Sequence[str],
    estimate: Estimate,
    posterior: bool | int,
    profile: str | Path | None,
    workers: int,
) -> Diagnosis:
    """See `rollover.diagnose`. Raises `InputError`, also for what is asked of a model and is of scenarios alone."""
    for share in [tolerance] if isinstance(tolerance, (int, float)) else tolerance.values():
        within("tolerance", share, 0.0, 0.5)
    is_file = isinstance(scenario, (str, Path)) and Path(scenario).suffix == ".py"
    if is_file or not isinstance(scenario, (str, Path, Scenario)):
        if reference or posterior or estimate is True or not isinstance(tolerance, (int, float)):
            message = (
                "not of a model of one's own; one tolerance for all channels is allowed, "
                "no reference, no estimate, no posterior"
            )
            raise InputError(Fault(path="diagnose", message=message))
        model = load_model(Path(scenario)) if isinstance(scenario, (str, Path)) else declared(scenario)
        with tables(model):
            known = measured(recordings, profile)
        held = held_out(list(known), listed(hold_out)) if hold_out else []
        with Executor(workers) as executor:
            return diagnose_model(model, known, hold_out=held, tolerance=tolerance, executor=executor)
    draws, chosen = draws_of(posterior), given(scenario)[0]
    if draws:
        check_is_drop(chosen, "posterior")
    known = measured(recordings, profile)
    check_conditions(chosen, known)
    held = held_out(list(known), listed(hold_out)) if hold_out else []
    with Executor(workers) as executor:
        findings = sensor_precheck(chosen, known)
        return diagnosed_with_prechecks(
            chosen,
            known,
            findings,
            hold_out=held,
            tolerance=tolerance,
            reference=listed(reference),
            estimate=estimate,
            posterior=draws,
            executor=executor,
        )


def check_conditions(scenario: Scenario, measured: Mapping[str, Recording]) -> None:
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


def diagnosed_with_prechecks(
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
    return replace(found, notes=(*finding_lines(findings), *found.notes))


def finding_lines(findings: Findings) -> Iterator[str]:
    """A line for each finding; of many alike in one channel of one recording the first ones, and how many more."""
    alike: dict[tuple[str, str, str], list[str]] = {}
    for name, f in findings:
        alike.setdefault((name, f.channel, f.check), []).append(f.sentence)
    for (name, channel, check_), sentences in alike.items():
        yield from (f"{name}: {channel}: {s}" for s in sentences[: PRECHECKS.spelt_out])
        if len(sentences) > PRECHECKS.spelt_out:
            yield f"{name}: {channel}: {len(sentences) - PRECHECKS.spelt_out} more such findings ({check_})"


def plain_findings(findings: Findings) -> list[dict[str, Any]]:
    """The findings as bare values, for diagnosis.json."""
    return [{"recording": name, **results.plain(asdict(f))} for name, f in findings]
