"""Locate the mismatch, say what physics was left out, show the fit improve: from recordings to a `Diagnosis`."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from rollover.diagnosis.alone import follows_a_law, repeats_its_course
from rollover.diagnosis.conclusion import Asked, Conclusion, concluded
from rollover.diagnosis.data.condition_uncertainty import with_rounding_uncertainty
from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.data.inconsistent import Aside, find_inconsistencies, without_inconsistent, wrong_conditions
from rollover.diagnosis.data.onset import clock_notes, with_clock_zeros
from rollover.diagnosis.data.repeatability import without_copies
from rollover.diagnosis.fit.jobs import Executor
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted
from rollover.diagnosis.fit.time_shift import clock_outliers, estimate_time_shifts, is_explained_by_clocks
from rollover.diagnosis.forward.forward_model import set_up
from rollover.diagnosis.inference.discrepancy import Discrepancy, estimated, learned_from_references, with_discrepancy
from rollover.diagnosis.inference.taught_course import taught_by
from rollover.diagnosis.invariants import checked
from rollover.diagnosis.io import REFERENCE, json_of, recordings_in
from rollover.diagnosis.prepared import prepared, weighted_datasets
from rollover.diagnosis.reported import reported, with_clock_finding
from rollover.diagnosis.result import Diagnosis, Estimate
from rollover.diagnosis.selection.explanation import Explanation
from rollover.diagnosis.settings import SETTINGS
from rollover.diagnosis.statements import is_hardly_tolerated
from rollover.dynamics.drop_test import unfit
from rollover.recording import Recording
from rollover.recording.attitude import continuous
from rollover.scenario import Scenario, load
from rollover.spec.vehicle import Striker

COMMON = "the common part of what {} references show was subtracted, as far as each of them repeats the others"
HALF = SETTINGS.report.grades.half_share
WITHIN_TOLERANCE = (
    "the tolerance is the most that a scenario may miss the curves by: beside an error of its size nothing is named;"
    " what is named surely predicts half of the mismatch on conditions held out"
)


def diagnose(
    scenario: Scenario,
    recordings: Sequence[tuple[str, Recording]],
    *,
    hold_out: Sequence[str] = (),
    tolerance: float | Mapping[str, float] = 0.0,
    reference: Sequence[str] = (),
    estimate: Estimate = "unexplained",
    posterior: int = 0,
    say: Callable[[str], None] = lambda _: None,
    executor: Executor | None = None,
) -> Diagnosis:
    """Compare a scenario with recordings and say what separates them.

    `recordings` are (name, recording); `hold_out` names those that are never fitted, otherwise each condition is left
    out in turn. `tolerance` is the share of a channel's range by which a scenario that lacks nothing may still miss
    it, of all or by channel: what is smaller is none. Where nothing explains what is larger, it passes by chance alone
    or curves are poor, that bounds a discrepancy that is estimated, and what surely predicts half of the mismatch is
    named (of drops). `reference` names recordings of the same rig in which nothing is suspected: they teach how far it
    misses, and are not diagnosed. With `estimate` that is estimated where nothing explains the recordings (see
    `inference.discrepancy`), and the answer beside it is given where it says more: if it is "unexplained" in place of
    that verdict alone, where neither of the others is stated; if it is True what the estimate makes doubtful is not
    named either.
    `posterior` draws of the numbers of what is named are made, of drops only.
    `executor` works off the fits, in children if it has any; the answer is the same. Raises `InputError` for an
    unknown condition, a clock that nothing tells the zero of, and recordings without any channel that is simulated;
    ``ValueError`` for a name in `hold_out` or `reference` that is none, a tolerance outside 0 to 1.
    """
    began = clock.perf_counter()
    names = [name for name, _ in recordings]
    channels = list(dict.fromkeys(channel for _, r in recordings for channel in r.channels))
    _refuse_unknown(names, {"hold_out": hold_out, "reference": reference})
    general, stated = _shares(tolerance, channels)
    executor = executor or Executor()
    if posterior and unfit(scenario):
        raise ValueError("posterior: of drops only, got an overturn; 0 draws, or those of a calibration")
    recordings, copies = without_copies(recordings, {*hold_out, *reference})
    recordings, zeros = with_clock_zeros(scenario, [(name, continuous(r)) for name, r in recordings])
    is_drop = isinstance(scenario.vehicle, Striker)  # what small errors do to an overturn is ensemble scatter
    recordings, rounded = with_rounding_uncertainty(recordings) if is_drop else (recordings, [])
    every, notes = prepared(scenario, recordings, executor)
    notes += [*copies, *clock_notes(scenario, recordings, zeros), *rounded]
    exact = every  # beside noise alone, whatever is tolerated
    every = [replace(e, model_error=float(np.hypot(e.model_error, general))) for e in every]
    asked = Asked(
        scenario=scenario,
        recordings=dict(recordings),
        hold_out=hold_out,
        say=say,
        executor=executor,
        began=began,
        estimates=estimate is True,
        draws=posterior,
    )
    if reference:
        every, learned = _learned_from_references(scenario, every, reference)
        asked = replace(asked, discrepancy=learned)
        notes += [COMMON.format(learned.taught_by)] if learned is not None and learned.taught_by else []
    if stated:
        asked = replace(asked, discrepancy=Discrepancy(scales=stated))
    if asked.discrepancy is not None:
        every = with_discrepancy(every, asked.discrepancy)
    inconsistent, shared = find_inconsistencies(every)
    wrong = wrong_conditions([e for e in without_inconsistent(every, inconsistent) if e.name not in hold_out])
    every = [e for e in every if e.name not in {one.dataset.name for one in wrong}]
    usable = without_inconsistent(every, inconsistent)
    first = concluded(asked, usable, [*inconsistent, *wrong], notes)
    is_open = estimate == "unexplained" and not (reference or stated or general > 0.0)
    unexplained = first if is_open and isinstance(first, Conclusion) and first.verdict == "unexplained" else None
    if unexplained is not None and not shared:
        # a report on an unexplained residual takes long, and is made only where there is no second opinion
        found = _second_opinion(unexplained, usable, notes) or _answered(unexplained, usable, notes)
    else:
        found = _answered(first, usable, notes)
        if found.verdict == "unexplained" and shared:
            # a factor that all recordings of a channel share may hide what else is missing: once more without these
            left_out = [*inconsistent, *shared]
            other = _diagnosed(asked, without_inconsistent(every, left_out), [*left_out, *wrong], notes)
            found = other if other.effects else found
        if found.verdict == "unexplained" and unexplained is not None:
            found = _second_opinion(unexplained, usable, notes) or found
    bounds = stated or (dict.fromkeys(channels, general) if general > 0.0 else {})
    is_open = (found.verdict == "unexplained" and not found.by_itself) or is_hardly_tolerated(found)
    if estimate and not reference and bounds and is_open and not unfit(scenario):
        used = {e.name for e in usable}
        exact = without_inconsistent([e for e in exact if e.name in used], inconsistent)
        found = _within_tolerance(replace(asked, bounds=bounds), exact, [*inconsistent, *wrong], notes) or found
    return checked(replace(found, clocks=zeros, seconds=clock.perf_counter() - began))


def _refuse_unknown(names: Sequence[str], options: Mapping[str, Sequence[str]]) -> None:
    """Raise ``ValueError`` for a name in an option that no recording has."""
    for option, given in options.items():
        for name in given:
            if name not in names:
                raise ValueError(f"{option}: no such recording, got {name!r}; {', '.join(names)}")


def _shares(tolerance: float | Mapping[str, float], channels: Sequence[str]) -> tuple[float, dict[str, float]]:
    """A tolerance as the share of all ranges and those by channel; ``ValueError`` for no share, or no channel."""
    stated = dict(tolerance) if isinstance(tolerance, Mapping) else {}
    general = 0.0 if isinstance(tolerance, Mapping) else tolerance
    for share in (general, *stated.values()):
        if not 0.0 <= share < 1.0:
            raise ValueError(f"tolerance: not a share of a range, got {share:g}; at least 0 and below 1")
    for channel in stated:
        if channel not in channels:
            raise ValueError(f"tolerance: no such channel recorded, got {channel!r}; {', '.join(channels)}")
    return general, stated


def _within_tolerance(
    asked: Asked, every: Sequence[Dataset], inconsistencies: Sequence[Aside], notes: Sequence[str]
) -> Diagnosis | None:
    """What is there beside an estimated discrepancy of at most what is tolerated; None if that may as well be all.

    It surely predicts half of the mismatch: of an effect that resembles a background the interval of its share reaches
    below.
    """
    asked.say("the tolerance may hide an effect: once more beside an estimated background of at most that size")
    found = _diagnosed(replace(asked, discrepancy=None, estimates=True), every, inconsistencies, notes)
    is_sure = any(e.explains is not None and e.explains.low >= HALF for e in found.effects) or found.answer == "whole"
    return replace(found, notes=(*found.notes, WITHIN_TOLERANCE)) if is_sure else None


def _diagnosed(
    asked: Asked, every: Sequence[Dataset], inconsistencies: Sequence[Aside], notes: Sequence[str]
) -> Diagnosis:
    """The diagnosis of recordings without what was left aside."""
    return _answered(concluded(asked, every, inconsistencies, notes), every, notes)


def _answered(found: Conclusion | Diagnosis, every: Sequence[Dataset], notes: Sequence[str]) -> Diagnosis:
    """The answer that a conclusion gives, or where a discrepancy is to be estimated that beside it, if it says more.

    What is named and leaves structure is held against no more than noise as well.
    """
    if isinstance(found, Diagnosis):
        return found
    if found.asked.estimates and (found.verdict == "unexplained" or found.grade == "part"):
        return _second_opinion(found, every, notes) or reported(found)
    return reported(found)


def _second_opinion(found: Conclusion, every: Sequence[Dataset], notes: Sequence[str]) -> Diagnosis | None:
    """What clocks, or an effect beside a discrepancy, say of recordings that nothing explains beside their noise."""
    if found.recording_fault is not None:
        return None
    found = replace(found, asked=replace(found.asked, estimates=True))
    return _with_clocks_corrected(found, every, notes) or _beside_estimated_discrepancy(found, every, notes)


def _beside_estimated_discrepancy(
    found: Conclusion, every: Sequence[Dataset], notes: Sequence[str]
) -> Diagnosis | None:
    """The diagnosis beside a discrepancy as large as what explanations leave says; None if it says no more."""
    asked, tried = found.asked, found.tried
    if asked.discrepancy is not None:
        return None
    several = [tried.fitted] if len(tried.fitted.candidates) > 1 else []
    learned = estimated(found.problem, tried.base, [*_rivals(tried), *several]).at_most(asked.bounds)
    asked.say("noise alone explains too little: once more beside an estimated background")
    asked = replace(asked, known=_rivals(tried))  # a minimum that was found stays found
    other = concluded(
        replace(asked, discrepancy=learned), with_discrepancy(every, learned), found.inconsistencies, notes
    )
    if isinstance(other, Conclusion) and other.tried.first is not None:
        # fits held against noise alone are bent to what they cannot meet, and leave more than others would
        again = estimated(other.problem, other.tried.base, _rivals(other.tried)).at_most(asked.bounds)
        if learned.is_clearly_above(again):
            learned, asked = again, replace(asked, known=_rivals(other.tried))
            other = concluded(
                replace(asked, discrepancy=learned), with_discrepancy(every, learned), found.inconsistencies, notes
            )
    if isinstance(other, Diagnosis):
        return None
    explains_more = bool(other.effects) or (
        other.verdict == "no-mismatch" and learned.is_usual and not _is_reproduced(other)
    )
    return reported(other) if explains_more else None


def _is_reproduced(found: Conclusion) -> bool:
    """Whether the unexplained residual carries over to recordings that were held out, as it is or by a law."""
    problem, scenario = found.problem, found.asked.scenario
    if scenario is None or found.acts != "drop":
        return False  # nothing predicts the course of an overturn but a run
    if repeats_its_course(problem, found.explanation.base, found.groups):
        return True
    scenarios = [set_up(scenario, e.recording) for e in problem.dataset]
    return follows_a_law(problem, found.explanation.base, scenarios, found.groups)


def _rivals(tried: Explanation) -> tuple[Fitted, ...]:
    """All that competed to explain by a single effect."""
    return tried.first.rivals if tried.first is not None else ()


def _learned_from_references(
    scenario: Scenario, every: Sequence[Dataset], reference: Sequence[str]
) -> tuple[list[Dataset], Discrepancy | None]:
    """The recordings that are no references, without what these have in common, and what else these miss.

    None where noise hides that.
    """
    others = [e for e in every if e.name not in reference]
    usable = [e for e in every if e.name in reference]
    if not usable:
        return others, None
    problem = Problem(weighted_datasets(scenario, usable))
    estimate_time_shifts(problem)
    base = problem.fit((), ())
    if base is None:
        return others, None
    taught = taught_by(problem, base)
    if taught is None:
        return others, learned_from_references(problem, base)
    common, rest = taught
    learned = learned_from_references(rest, rest.again(base))
    if learned is not None:
        learned = replace(learned, taught_by=common.count)
    return [common.without(e) for e in others], learned


def _with_clocks_corrected(found: Conclusion, every: Sequence[Dataset], notes: Sequence[str]) -> Diagnosis | None:
    """The diagnosis with clocks set right that are off by far more than they may be; None if that explains nothing."""
    asked, problem, base = found.asked, found.problem, found.tried.base
    late = {} if asked.is_timed else dict(clock_outliers(problem, base, asked.executor.parallel_map))
    if not late or not is_explained_by_clocks(problem, base, asked.executor.parallel_map):
        return None
    own = {e.name: e for e in every}
    moved = {n: replace(r, time=r.time - late.get(n, 0.0)) for n, r in asked.recordings.items() if n in own}
    assert asked.scenario is not None
    again, _ = prepared(asked.scenario, list(moved.items()), asked.executor)
    again = [
        replace(e, model_error=own[e.name].model_error, discrepancy=own[e.name].discrepancy, memory=own[e.name].memory)
        for e in again
    ]
    other = _diagnosed(replace(asked, recordings=moved, is_timed=True), again, found.inconsistencies, notes)
    if other.verdict in ("unexplained", "cannot-tell"):
        return None
    return with_clock_finding(other, late, problem, found.tried)


def diagnose_folder(folder: Path, out: Path | None = None, workers: int = 1) -> dict[str, Any]:
    """Diagnose a folder that holds scenario.yaml and its recordings; returns what diagnosis.json says.

    Those whose names begin with "reference" are references, see `diagnose`.
    """
    del out
    recordings = recordings_in(folder)
    taught = [name for name, _ in recordings if name.startswith(REFERENCE)]
    with Executor(workers) as executor:
        return json_of(diagnose(load(folder / "scenario.yaml"), recordings, reference=taught, executor=executor))
