"""From a model of one's own and recordings of its inputs and outputs to a `Diagnosis`.

Recordings drive the model, inputs at every stamp; outputs are datasets with their noise; it is tried on them first.
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis import io
from rollover.diagnosis.conclusion import TUNING, Asked, conclusion_of
from rollover.diagnosis.data.dataset import Dataset, Signal, dataset_of, left_out
from rollover.diagnosis.data.phases import phases_of
from rollover.diagnosis.data.quantisation import with_quantisation, without_spikes
from rollover.diagnosis.fit.jobs import Executor
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted
from rollover.diagnosis.fit.local_search import ended
from rollover.diagnosis.fit.step import Inquiry
from rollover.diagnosis.forward.interface import FailedModelError
from rollover.diagnosis.grades import cannot_tell
from rollover.diagnosis.inference.intervals import intervals
from rollover.diagnosis.invariants import checked
from rollover.diagnosis.noise import autoregression
from rollover.diagnosis.own_model.declaration import BASELINE, ForwardModel, conditions_of, declared
from rollover.diagnosis.own_model.simulator import ModelSimulator
from rollover.diagnosis.own_model.tables import baseline_of, candidates_of_model, tables
from rollover.diagnosis.reported import reported
from rollover.diagnosis.result import Diagnosis
from rollover.diagnosis.settings import SETTINGS
from rollover.recording import Recording
from rollover.system.errors import Fault, InputError, hint

Array = NDArray[np.float64]
OWN_MODEL = SETTINGS.fit.own_model


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


def prepared_for(model: ForwardModel, recordings: Mapping[str, Recording]) -> tuple[list[Dataset], list[str]]:
    """Recordings as datasets, and notes on them. Raises `InputError` for those that cannot drive it.

    Raises `FailedModelError` for a model that fails, or does not keep to what it declares, where fits begin.
    """
    faults = [f for name, r in recordings.items() for f in _unfit(model, name, r)]
    if faults:
        raise InputError(*faults)
    found, read, notes = [], [], []
    for name, whole in recordings.items():
        inputs = {channel: _everywhere(whole, channel) for channel in model.inputs}
        gaps = {channel: int(np.isnan(whole[channel]).sum()) for channel in model.inputs}
        of = whole.time.size
        notes += [f"{name}: {c}: {n} of {of} stamps without a value, interpolated" for c, n in gaps.items() if n]
        cleaned, spiked = without_spikes(
            replace(whole, channels={c: whole[c] for c in model.outputs if c in whole.channels})
        )
        notes += [f"{name}: {line}" for line in spiked]
        simulator = ModelSimulator(model, replace(cleaned, title=name), inputs)
        _tried(simulator)
        one = dataset_of(name, simulator.recording, simulator)
        if one is None:
            notes.append(f"{name}: no output that moves, with 8 samples at least, and was excluded")
        else:
            found.append(replace(one, condition=""))  # what drives a recording makes it a test of its own
            read.append(cleaned)
    return with_quantisation(found, read), notes


def with_noise(model: ForwardModel, every: Sequence[Dataset]) -> list[Dataset]:
    """The dataset with its noise: as recordings state it, else from quiet stretches of all together."""
    problem = Problem(every)
    base = begun(model, problem)
    if base is None:
        return list(every)
    estimates = autoregression.with_noise_of_quiet_stretches(every, problem.residuals(base))
    found = []
    for e, old in zip(estimates, every, strict=True):
        signals = [
            s if (stated := old.recording.noise.get(s.channel)) is None else _stated(o, stated, old)
            for s, o in zip(e.signals, old.signals, strict=True)
        ]
        found.append(replace(e, signals=tuple(signals)))
    return found


def _stated(s: Signal, noise: float, e: Dataset) -> Signal:
    """A signal with white noise of a size that the recording states."""
    return replace(autoregression.with_noise(s, noise, (), e.model_error_of(s)), at_rest=(noise, ()))


def begun(model: ForwardModel, problem: Problem) -> Fitted | None:
    """The model as it is fitted to recordings, to the end; None if nothing can be simulated there.

    Begun at its start and to either side of that in each parameter, the way that soon leaves least followed: from far
    off a resonance is met by another one.
    """
    baseline, start = baseline_of(model)
    beside = [
        (*start[:k], min(max(x + d, 0.0), 1.0), *start[k + 1 :]) for k, x in enumerate(start) for d in OWN_MODEL.beside
    ]
    short = [problem.fit(baseline, x, rounds=problem.effort.short, no_jacobian=True) for x in (start, *beside)]
    best = min((f for f in short if f is not None), key=lambda f: f.chi2, default=None)
    if best is None or not baseline:
        return best
    for _ in range(OWN_MODEL.repeats):
        again = problem.fit(baseline, best.x)
        if again is None or again.chi2 > best.chi2 - OWN_MODEL.least_gain:
            break
        best = again
    alone = [problem.fit(baseline, best.x, only=[r]) for r in range(len(problem.dataset))]
    met = min((f for f in alone if f is not None), key=lambda f: f.chi2 / f.blocks[0].residual.size, default=best)
    placed = replace(baseline[0], points=tuple(dict.fromkeys([start, met.x])))
    return ended(problem, problem.again(replace(best, candidates=(placed,))))


def _unfit(model: ForwardModel, name: str, r: Recording) -> Iterator[Fault]:
    """Why a recording cannot drive a model."""
    for channel in model.inputs:
        if channel not in r.channels:
            message = f"missing, got {', '.join(r.channels) or 'no channel'}; each input of the model is needed"
            yield Fault(file=name, path=channel, message=message)
        elif not np.isfinite(r[channel][[0, -1]]).all():
            message = (
                "without a value at the first or the last stamp; an input is needed from end to end: cut the recording"
            )
            yield Fault(file=name, path=channel, message=message)
    if not set(model.outputs) & set(r.channels):
        message = f"no output of the model, got {', '.join(r.channels)}; one of {', '.join(model.outputs)} is needed"
        yield Fault(file=name, message=message)
    known = conditions_of(model)
    for path, value in r.conditions.items():
        if path not in known:
            yield Fault(
                file=name,
                path=f"conditions.{path}",
                message=f"no condition of the model, got {path!r}; {hint(path, known)}",
            )
        elif isinstance(value, bool) or not isinstance(value, (int, float)):
            message = f"not a number, got {value!r}; a number in {known[path].unit} is needed"
            yield Fault(file=name, path=f"conditions.{path}", message=message)
    for path in known:
        if path not in r.conditions:
            message = f"missing; the model needs it of each recording, in {known[path].unit}"
            yield Fault(file=name, path=f"conditions.{path}", message=message)
    if r.clock.zero == "unknown":
        yield Fault(
            file=name, path="clock.zero", message="got unknown; inputs and outputs share one clock: known is needed"
        )
    for channel in r.cfc:
        if channel in model.outputs:
            message = f"got class {r.cfc[channel]}; the model has no filter: apply it in simulate and leave cfc out"
            yield Fault(file=name, path=f"channels.{channel}.cfc", message=message)


def _everywhere(r: Recording, channel: str) -> Array:
    """Values (n,) of an input at each stamp, straight lines between its samples."""
    time, values = r.samples(channel)
    return np.asarray(np.interp(r.time, time, values))


def _tried(simulator: ModelSimulator) -> None:
    """Try a model as it is, twice, and each of its terms. Raises `FailedModelError` for what does not keep its word."""
    model = simulator.model
    first, again = simulator.run({}), simulator.called({})
    if first is None:
        raise simulator.refused("no solution where fits begin; other starts of its parameters are needed")
    if again is None or any(not np.array_equal(first[c], again[c]) for c in first):
        raise simulator.refused("not the same outputs for the same values twice; draw no random numbers, keep no state")
    for term in model.terms:
        typical = {f"{term.id}.{n}": p.start for n, p in term.parameters.items()}
        nulls = {f"{term.id}.{n}": p.null for n, p in term.parameters.items() if p.null is not None}
        moved = simulator.run(typical)
        if moved is not None and all(np.array_equal(first[c], moved[c]) for c in first):
            continue  # it may have no part in this recording
        beside = {f"{term.id}.{n}": p.low for n, p in term.parameters.items() if p.null is None}
        at_null = simulator.run({**beside, **nulls})
        if at_null is None or any(not np.array_equal(first[c], at_null[c]) for c in first):
            raise simulator.refused(
                f"{term.id} does something at its null; with its strength there no output may change"
            )
