"""A diagnosis as it is asked for from Python: files or objects, recordings from anywhere, a scenario or a model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from rollover.calibration.posterior import draws_of
from rollover.comparison.recordings import Recordings, held_out, measured
from rollover.diagnosis import sensors_first
from rollover.diagnosis.fit.jobs import Executor
from rollover.diagnosis.own_model import ForwardModel, diagnose_model, load_model
from rollover.diagnosis.own_model.declaration import declared
from rollover.diagnosis.own_model.tables import tables
from rollover.diagnosis.result import Diagnosis, Estimate
from rollover.dynamics.drop_test import unfit
from rollover.scenario import Scenario, given
from rollover.system.arguments import listed, within
from rollover.system.errors import Fault, InputError


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
    sensors_first.check(chosen, known)
    held = held_out(list(known), listed(hold_out)) if hold_out else []
    with Executor(workers) as executor:
        findings = sensors_first.sensor_precheck(chosen, known)
        return sensors_first.diagnosed(
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
