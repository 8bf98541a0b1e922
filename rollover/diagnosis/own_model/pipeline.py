"""From a model of one's own and recordings of its inputs and outputs to a `Diagnosis`."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from rollover.diagnosis import io
from rollover.diagnosis.conclusion import TUNING, Asked, conclusion_of
from rollover.diagnosis.data.dataset import left_out
from rollover.diagnosis.data.phases import phases_of
from rollover.diagnosis.fit.jobs import Executor
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.step import Inquiry
from rollover.diagnosis.forward.interface import FailedModelError
from rollover.diagnosis.grades import cannot_tell
from rollover.diagnosis.inference.intervals import intervals
from rollover.diagnosis.invariants import checked
from rollover.diagnosis.own_model.declaration import BASELINE, ForwardModel, declared
from rollover.diagnosis.own_model.prepare import begun, prepared_for, with_noise
from rollover.diagnosis.own_model.tables import candidates_of_model, tables
from rollover.diagnosis.reported import reported
from rollover.diagnosis.result import Diagnosis
from rollover.recording import Recording
from rollover.system.errors import Fault, InputError


def diagnose_model(
    model: ForwardModel,
    recordings: Mapping[str, Recording],
    *,
    hold_out: Sequence[str] = (),
    tolerance: float = 0.0,
    say: Callable[[str], None] = lambda _: None,
    executor: Executor | None = None,
) -> Diagnosis:
    """Say which term a model of one's own lacks, from recordings of its inputs and outputs by name.

    The model's parameters are fitted in every explanation. `hold_out` names recordings that are never fitted, otherwise
    each is left out in turn; `tolerance` is the share of a channel's range by which a model that lacks nothing may miss
    it. Raises `InputError` for a declaration, a recording or an output that cannot be used.
    """
    declared(model)
    asked = Asked(
        scenario=None,
        recordings=recordings,
        hold_out=hold_out,
        say=say,
        executor=executor or Executor(),
        began=clock.perf_counter(),
        estimates=True,  # what may as well be nothing, or stands at an end of its range, is not named
    )
    with tables(model):
        try:
            found = checked(_diagnosed(model, asked, tolerance))
        except FailedModelError as e:
            raise InputError(Fault(message=str(e))) from e
    return replace(found, seconds=clock.perf_counter() - asked.began)


def _diagnosed(model: ForwardModel, asked: Asked, tolerance: float) -> Diagnosis:
    """The diagnosis, within the tables of the model."""
    names, executor = list(asked.recordings), asked.executor
    every, notes = prepared_for(model, asked.recordings)
    every = with_noise(model, [replace(e, model_error=float(np.hypot(e.model_error, tolerance))) for e in every])
    found, validation = ([e for e in every if (e.name in asked.hold_out) == held] for held in (False, True))
    if sum(e.count for e in found) < TUNING.least_samples:
        return cannot_tell(every, names, notes, asked.began)
    problem = Problem(found)
    executor.begin(problem)
    base = begun(model, problem)
    if base is None:
        return cannot_tell(every, names, [*notes, "the model could not be fitted"], asked.began)
    groups = left_out(found)
    if len(groups) < 2 and not validation:
        notes.append("one recording only: what stands as held out is predicted by the fit to it")
    inquiry = Inquiry(
        problem=problem,
        candidates=candidates_of_model(model, found),
        groups=groups,
        phases=[phases_of(e) for e in found],
        say=asked.say,
        executor=executor,
    )
    concluded = conclusion_of(asked, inquiry, base, validation, acts="model", notes=notes)
    fitted = concluded.explanation.fitted
    if not model.parameters:
        return reported(concluded)
    always = dict(zip([c.id for c in fitted.candidates], intervals(problem, fitted), strict=True))[BASELINE]
    return replace(reported(concluded), baseline=always)


def json_of(model: ForwardModel, found: Diagnosis, about: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """What diagnosis.json says of a model of one's own, bare JSON values; as of a scenario, and the fitted model."""
    fitted = {name: {k: v for k, v in asdict(i).items() if v is not None} for name, i in found.baseline.items()}
    return {**io.json_of(found, about), "model": {"title": model.title, "parameters": fitted}}
