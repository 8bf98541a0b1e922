"""From recordings made ready to a conclusion: who explains them, what that is worth, and what is no finding."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

from rollover.diagnosis.alone import alike_beside, fit_single_effect, verdict_on_single_effect
from rollover.diagnosis.data.dataset import Dataset, left_out, with_uncertain_conditions_at
from rollover.diagnosis.data.inconsistent import Aside, inconsistency_sentences
from rollover.diagnosis.data.phases import phases_of
from rollover.diagnosis.data.repeatability import inconsistent_repeats
from rollover.diagnosis.fit.cross_validation import Groups
from rollover.diagnosis.fit.jobs import Executor
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted
from rollover.diagnosis.fit.local_search import has_uncertain_conditions, refitted_with_conditions
from rollover.diagnosis.fit.parameterisation import Candidate
from rollover.diagnosis.fit.step import Inquiry, Step
from rollover.diagnosis.fit.time_shift import estimate_time_shifts
from rollover.diagnosis.forward.forward_model import set_up
from rollover.diagnosis.grades import cannot_tell, graded, with_shares
from rollover.diagnosis.inference.discrepancy import Discrepancy
from rollover.diagnosis.inference.lack_of_fit import is_enough, is_tolerated, mismatch_of
from rollover.diagnosis.inference.recording_faults import RecordingFault, intrinsic_faults, misread, truncation_fault
from rollover.diagnosis.invariants import NAMING, clear_of_null, is_noise_alone, next_best, rejected_effects
from rollover.diagnosis.noise.offsets import zero_notes
from rollover.diagnosis.noise.truncation import truncation_notes
from rollover.diagnosis.prepared import weighted_datasets
from rollover.diagnosis.result import Answer, Diagnosis, Named, Verdict
from rollover.diagnosis.selection.candidates import candidates_of, size_of
from rollover.diagnosis.selection.decision import (
    by_first_effect,
    explained,
    explains_little,
    redundant_effects,
    verdict_on,
)
from rollover.diagnosis.selection.explanation import Explanation
from rollover.diagnosis.selection.forward_step import confusion_set
from rollover.diagnosis.settings import SETTINGS
from rollover.diagnosis.statements import (
    interval_contains_null,
    named,
    pull_notes,
)
from rollover.dynamics.drop_test import unfit
from rollover.recording import Recording
from rollover.scenario import Scenario

TUNING = SETTINGS.report.conclusion
AS_NOISE = "what is left is 1.0 times the noise, or hardly more and before the first contact: no more than noise"


@dataclass(frozen=True, kw_only=True)
class Asked:
    """What a diagnosis was asked for, and when (s of the clock that counts).

    `discrepancy` is what the scenario may miss beside what it lacks, once that is stated, taught or estimated; `bounds`
    are the shares of a channel's range that one which is estimated cannot exceed.
    """

    scenario: Scenario | None  # None of a model of one's own
    recordings: Mapping[str, Recording]
    hold_out: Sequence[str]
    say: Callable[[str], None]
    executor: Executor
    began: float
    discrepancy: Discrepancy | None = None
    bounds: Mapping[str, float] = field(default_factory=dict)
    estimates: bool = False  # whether a model error is estimated, and answers that it makes doubtful are refused
    draws: int = 0  # of the numbers of what is named
    is_timed: bool = False  # whether clocks were set right that are off by far more than they may be
    known: tuple[Fitted, ...] = ()  # fits of single effects to the same recordings under another noise


@dataclass(frozen=True, kw_only=True)
class Conclusion:
    """What recordings say: the explanation, its verdict and grade, and what it was drawn from.

    `tried` is the explanation before what does not explain was refused, `slight` are effects of no consequence,
    `recording_fault` is what recordings show by themselves, `validation` are those that were held out, `groups` what is
    left out in turn.
    """

    asked: Asked
    problem: Problem
    tried: Explanation
    explanation: Explanation
    verdict: Verdict
    grade: Answer
    effects: tuple[Named, ...]
    slight: tuple[Named, ...]
    recording_fault: RecordingFault | None
    validation: tuple[Dataset, ...]
    groups: Groups
    candidates: Sequence[Candidate]
    acts: str
    set_ups: tuple[Scenario, ...]  # under the conditions of each recording
    is_cross_validated: bool
    inconsistencies: tuple[Aside, ...]
    notes: tuple[str, ...]

    @property
    def is_beside(self) -> bool:
        """Whether it was drawn beside a discrepancy that was estimated, or of full runs taught."""
        return is_beside(self.asked, self.problem)

    @property
    def is_estimated(self) -> bool:
        """Whether it was drawn beside a discrepancy that was estimated."""
        return self.asked.discrepancy is not None and self.asked.discrepancy.is_estimated


def is_beside(asked: Asked, problem: Problem) -> bool:
    """Whether one effect is looked for, beside a discrepancy that was estimated, or of full runs taught.

    A stated one is a bound: within it nothing is looked for.
    """
    known = asked.discrepancy
    return known is not None and (known.is_estimated or (known.is_taught and problem.effort.is_ensemble))


def concluded(
    asked: Asked, every: Sequence[Dataset], inconsistencies: Sequence[Aside], notes: Sequence[str]
) -> Conclusion | Diagnosis:
    """The conclusion from what was not excluded; the diagnosis itself where there is too little to judge."""
    scenario, hold_out = asked.scenario, asked.hold_out
    executor, began, names = asked.executor, asked.began, list(asked.recordings)
    assert scenario is not None
    notes = [*notes, *(inconsistency.message() for inconsistency in inconsistencies)]
    found = weighted_datasets(scenario, [e for e in every if e.name not in hold_out])
    validation = [e for e in weighted_datasets(scenario, every) if e.name in hold_out] if hold_out else []
    if sum(e.count for e in found) < TUNING.least_samples:
        return cannot_tell(every, names, notes, began, inconsistency_sentences(inconsistencies))
    notes += [*truncation_notes(every, found), *zero_notes(found)]
    groups = left_out(found)
    notes += inconsistent_repeats(found)
    is_cross_validated = len(groups) > 1 or bool(validation)
    if not is_cross_validated:
        notes.append("one recording only: what is given as held out is of the fit to it")
    problem = Problem(found)
    executor.begin(problem)
    estimate_time_shifts(problem)
    base = problem.fit((), ())
    if base is None:
        return cannot_tell(every, names, [*notes, "the scenario itself could not be simulated"], began)
    phases = [phases_of(e) for e in found]
    set_ups = tuple(set_up(scenario, e.recording) for e in found)
    acts = "rollover" if any(map(unfit, set_ups)) else "drop"
    candidates = candidates_of(found, scenario.effects, acts, scenario, size_of(set_ups[0]))
    inquiry = Inquiry(
        problem=problem,
        candidates=candidates,
        groups=groups,
        phases=phases,
        say=asked.say,
        executor=executor,
        known=asked.known,
    )
    return conclusion_of(
        asked,
        inquiry,
        base,
        validation,
        acts=acts,
        set_ups=set_ups,
        inconsistencies=inconsistencies,
        notes=notes,
    )


def conclusion_of(
    asked: Asked,
    inquiry: Inquiry,
    base: Fitted,
    validation: Sequence[Dataset],
    *,
    acts: str,
    set_ups: tuple[Scenario, ...] = (),
    inconsistencies: Sequence[Aside] = (),
    notes: Sequence[str] = (),
) -> Conclusion:
    """The conclusion of an inquiry beside a base: explanation, verdict, grade, and effects with their numbers.

    `validation` are recordings that were held out, `acts` what kind of test they are of.
    """
    problem, groups, notes = inquiry.problem, inquiry.groups, list(notes)
    beside = is_beside(asked, problem)
    tried = fit_single_effect(inquiry, base) if beside else explained(inquiry, base)
    explanation, verdict, effects, validation = _findings(asked, inquiry, tried, validation, beside=beside)
    effects = clear_of_null(problem, explanation, effects) if asked.estimates else effects
    # beside a discrepancy what is met is no more than that and noise: what is surely predicted all the same is more
    is_open = asked.estimates and verdict == "unexplained" and not beside
    if is_open and is_noise_alone(problem, explanation, groups):
        verdict = "no-mismatch"
        notes.append(AS_NOISE)
    enough = is_tolerated if beside else partial(is_enough, mismatch=explanation.after)
    remains = not enough(problem, explanation.fitted)
    grade, effects = graded(*with_shares(problem, explanation, effects, groups), is_beside=beside, remains=remains)
    slight = effects if asked.estimates and grade == "immaterial" else ()
    if asked.estimates and (slight or (effects and grade == "unexplained")):
        verdict, effects, explanation = "no-mismatch" if slight else "unexplained", (), explanation.refused()
    recording_fault = _recording_fault(asked, inquiry, explanation, verdict, effects, inconsistencies)
    if recording_fault is not None:
        verdict, effects = recording_fault.verdict, recording_fault.effects
        explanation = explanation.refused()
    notes += pull_notes(problem, explanation.fitted)
    return Conclusion(
        asked=asked,
        problem=problem,
        tried=tried,
        explanation=explanation,
        verdict=verdict,
        grade=grade,
        effects=effects,
        slight=slight,
        recording_fault=recording_fault,
        validation=tuple(validation),
        groups=groups,
        candidates=inquiry.candidates,
        acts=acts,
        set_ups=set_ups,
        is_cross_validated=len(groups) > 1 or bool(validation),
        inconsistencies=tuple(inconsistencies),
        notes=tuple(notes),
    )


def _findings(
    asked: Asked, inquiry: Inquiry, tried: Explanation, validation: Sequence[Dataset], *, beside: bool
) -> tuple[Explanation, Verdict, tuple[Named, ...], list[Dataset]]:
    """What is named of an explanation: its verdict, the effects with their numbers, and the recordings for validation.

    Effects whose work others do, that predict nothing, or that may be null are refuted one set after another, each time
    from the noise model before any was named.
    """
    problem, groups, phases = inquiry.problem, inquiry.groups, inquiry.phases
    is_taught = asked.discrepancy is not None and asked.discrepancy.is_taught
    alike = partial(alike_beside, problem, groups=groups) if beside else None

    def decide(found: Explanation) -> tuple[Explanation, Verdict]:
        return (
            verdict_on_single_effect(problem, found, groups, is_taught=is_taught)
            if beside
            else verdict_on(problem, found, groups, phases)
        )

    def refit(found: Explanation, verdict: str) -> tuple[Explanation, tuple[Named, ...], list[Dataset]]:
        return _refitted_explanation(problem, found, verdict, validation, groups, phases, alike)

    explanation, verdict = decide(tried)
    held, refitted = problem.dataset, refit(explanation, verdict)
    refuted: set[str] = set()
    while (
        more := redundant_effects(problem, refitted[0], interval_contains_null(refitted[1], problem.effort.is_ensemble))
        - refuted
    ):
        # the first effect explains all alone, or nothing does
        refuted |= more
        problem.with_noise_model(held)
        explanation, verdict = decide(by_first_effect(problem, explanation, refuted, phases))
        refitted = refit(explanation, verdict)
    while more := rejected_effects(problem, *refitted[:2], groups, in_doubt=asked.estimates) - refuted:
        refuted |= more
        problem.with_noise_model(held)
        explanation, verdict = decide(next_best(problem, explanation, refuted, groups, phases))
        refitted = refit(explanation, verdict)
    explanation, effects, marginalised = refitted
    return explanation, verdict, effects, marginalised


def _recording_fault(
    asked: Asked,
    inquiry: Inquiry,
    explanation: Explanation,
    verdict: Verdict,
    effects: Sequence[Named],
    inconsistencies: Sequence[Aside],
) -> RecordingFault | None:
    """What recordings show by themselves where nothing is named, or losses where what is named explains little."""
    found, p_value = list(inquiry.problem.dataset), explanation.p_value
    if verdict == "no-mismatch":
        fault = intrinsic_faults(found, asked.recordings, inquiry.phases, p_value)
        return fault or misread(inconsistencies, len(found), p_value)
    if not effects or not explains_little(explanation, inquiry.groups, TUNING.main_share):
        return None
    # what is lost again and again is met by no effect, and biases those that are fitted to it
    fault = truncation_fault(found, asked.recordings, inquiry.phases, p_value)
    is_theirs = fault is not None and fault.is_covered_by(e.channel for e in effects)
    # what another channel loses is no reason to doubt them
    return fault if is_theirs or explains_little(explanation, inquiry.groups) else None


def _refitted_explanation(
    problem: Problem,
    explanation: Explanation,
    verdict: str,
    validation: Sequence[Dataset],
    groups: Sequence[Sequence[int]],
    phases: Sequence[Sequence[tuple[float, str]]],
    alike: Callable[[Step], Sequence[Fitted]] | None,
) -> tuple[Explanation, tuple[Named, ...], list[Dataset]]:
    """An explanation with uncertain conditions at its fit, its effects with their numbers if the verdict names any.

    Also the recordings for validation, under those conditions.
    """
    whole, validation = marginalised_at_fit(problem, explanation, validation, phases)
    if alike is None and not is_enough(problem, whole.fitted, whole.after):
        alike = partial(confusion_set, groups=groups, shared=problem.samples_per_error, is_refuted=True)
    return whole, named(problem, whole, groups, alike) if verdict in NAMING else (), validation


def marginalised_at_fit(
    problem: Problem,
    explanation: Explanation,
    validation: Sequence[Dataset],
    phases: Sequence[Sequence[tuple[float, str]]],
) -> tuple[Explanation, list[Dataset]]:
    """The explanation fitted again with what the conditions leave uncertain as it acts beside it.

    Also the recordings for validation, under those conditions.
    """
    if not explanation.parts or not has_uncertain_conditions(problem):
        return explanation, list(validation)
    fitted = refitted_with_conditions(problem, explanation.fitted)
    beside = problem.changes(fitted.candidates, fitted.x)
    after = mismatch_of(problem.dataset, fitted.blocks, phases)
    uncertain = [with_uncertain_conditions_at(e, beside) for e in validation]
    return replace(explanation, fitted=fitted, after=after), uncertain
