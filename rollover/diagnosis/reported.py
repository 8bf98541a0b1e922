"""A conclusion as it is reported: places, dependence, scores, one sentence; clocks that are far off as a finding."""

from __future__ import annotations

import time as clock
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from rollover.diagnosis.conclusion import Conclusion
from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.data.inconsistent import inconsistency_sentences
from rollover.diagnosis.data.repeatability import contradiction_clause, inconsistent_repeats
from rollover.diagnosis.fit.cross_validation import HeldOutMisfit, held_out
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.parameterisation import Candidate
from rollover.diagnosis.fit.time_shift import clock_offset_sentence, clock_outliers
from rollover.diagnosis.forward.full_run import full_runs
from rollover.diagnosis.grades import answer_of, is_underpowered, share_of
from rollover.diagnosis.inference.drop_dependence import Dependence, dependence, dependence_of_one
from rollover.diagnosis.inference.lack_of_fit import is_enough, is_tolerated
from rollover.diagnosis.inference.posterior import drawn
from rollover.diagnosis.inference.residual_law import offered, proposed
from rollover.diagnosis.inference.scores import judged, misfit_before_impact
from rollover.diagnosis.inference.vehicle_dependence import dependency, misfit_by_degree_of_freedom
from rollover.diagnosis.planning.next_test import next_test
from rollover.diagnosis.probabilities import NOTHING, probabilities
from rollover.diagnosis.result import Degree, Diagnosis, Draws, Interval, Named, Share, Verdict
from rollover.diagnosis.selection.explanation import Explanation
from rollover.diagnosis.settings import SETTINGS
from rollover.diagnosis.statements import (
    by_share,
    candidate_table,
    closest_candidate_sentence,
    immaterial_sentence,
    locations,
    no_contact_clause,
    noise,
    sentence,
    step_error_note,
    tolerance_clause,
    usual_model_error_sentence,
)
from rollover.effects import EFFECTS, spoken

LATE_CLOCKS = SETTINGS.report.late_clocks
CLOCK_OFFSET = "sensor-clock-offset"


def reported(c: Conclusion) -> Diagnosis:
    """A conclusion as it is reported, with what the mismatch depends on."""
    asked, problem, explanation, recording_fault = c.asked, c.problem, c.explanation, c.recording_fault
    verdict, effects, groups, found, set_ups = c.verdict, c.effects, c.groups, list(problem.dataset), c.set_ups
    before, after = explanation.before, explanation.after
    is_mismatch = verdict not in ("no-mismatch", "cannot-tell") and recording_fault is None
    asked.say("what the mismatch depends on")
    depends_on, degrees = _dependence(c, is_mismatch=is_mismatch)
    law = None
    if verdict == "unexplained" and c.acts == "drop" and recording_fault is None:
        asked.say("a law for the unexplained residual")
        law = proposed(problem, explanation.base, set_ups, found, groups)
    model_error = {} if asked.discrepancy is None else asked.discrepancy.scales_by_channel(found)
    shares = {} if asked.discrepancy is None else {k: asked.discrepancy.scales[k] for k in model_error}
    is_taught = asked.discrepancy is not None and asked.discrepancy.is_taught
    detectable = dict(explanation.detectable)
    contrary = inconsistent_repeats(found, SETTINGS.data.repeatability.contradiction)
    if verdict == "no-mismatch" and not c.slight and (contrary or is_underpowered(detectable)):
        verdict = "cannot-tell"
    h_before, h_after = (judged(problem, f, c.validation, groups) for f in (explanation.base, explanation.fitted))
    remains = not (c.is_beside and is_tolerated(problem, explanation.fitted)) and not is_enough(
        problem, explanation.fitted, after
    )
    by_itself = () if recording_fault is None else recording_fault.locations
    lost = by_itself if verdict == "unexplained" else ()
    is_left = (verdict == "unexplained" and recording_fault is None) or (bool(effects) and remains)
    training = tuple(e.name for e in found)
    notes = [
        *c.notes,
        *(_felt(degrees[0]) for _ in degrees[:1] if is_mismatch),
        *step_error_note(effects),
        *_cost(found),
    ]
    said = _main_sentence(c, verdict, h_before.held, h_after.held, remains=remains, has_model_error=bool(model_error))
    if verdict == "unexplained" and recording_fault is None:
        said += closest_candidate_sentence(explanation, groups)
    if is_left:
        said += clock_offset_sentence(clock_outliers(problem, explanation.fitted, asked.executor.parallel_map))
    if recording_fault is None:
        said += by_share(effects, shares, estimated=c.is_estimated) + hint(c)
    said += offered(law) + inconsistency_sentences(c.inconsistencies) + contradiction_clause(verdict, contrary)
    source = "taught" if is_taught else "estimated" if c.is_estimated else "stated"
    said += tolerance_clause(verdict, explanation.p_value, h_before.scores.get("held_out"), found, source=source)
    said += no_contact_clause(found)
    return Diagnosis(
        verdict=verdict,
        sentence=said,
        p_value=explanation.p_value if recording_fault is None else recording_fault.p_value,
        noise=noise(found),
        where=locations(before, found, depends_on.on) if is_mismatch else by_itself,
        effects=_with_next_test(c),
        remaining_significant=is_left or bool(lost),
        remaining_p_value=after.p_value,
        remaining_where=locations(after, found, None) if is_left else lost,
        depends_on=depends_on.on if is_mismatch else next((p.depends_on for p in lost), None),
        dependencies=depends_on.shares,
        degrees=degrees if is_mismatch else (),
        smallest_detectable=detectable,
        training=training,
        held_out=tuple(e.name for e in c.validation) or training,
        before=h_before.scores,
        after=h_after.scores,
        per_recording=tuple(
            (n, a, b) for (n, a), (_, b) in zip(h_before.by_recording, h_after.by_recording, strict=True)
        ),
        candidates=candidate_table(explanation, c.candidates, groups),
        simulations=problem.simulations,
        seconds=clock.perf_counter() - asked.began,
        notes=tuple(notes),
        grids=_grids([*found, *c.validation]),
        empirical=law,
        answer=answer_of(
            verdict, c.grade, explanation.p_value, slight=bool(c.slight), is_beside=asked.discrepancy is not None
        ),
        discrepancy=model_error,
        by_itself=recording_fault is not None,
        posterior=_draws(c) if effects else None,
        probabilities=_probabilities(c, remains=remains),
    )


def _dependence(c: Conclusion, *, is_mismatch: bool) -> tuple[Dependence, tuple[Degree, ...]]:
    """What the mismatch depends on, and of overturns the degrees of freedom by their share of it."""
    problem, base = c.problem, c.explanation.base
    if c.acts == "drop" and is_mismatch:
        return dependence(problem, c.set_ups, base, c.asked.executor.parallel_map), ()
    if c.acts != "rollover":
        return Dependence(), ()
    degrees = misfit_by_degree_of_freedom(c.set_ups, list(problem.dataset), [b.shift for b in base.blocks])
    of_one = dependence_of_one(problem, base, c.explanation.before) if is_mismatch else None
    of_motion = Dependence(shares=dependency(problem, base))
    return of_motion if of_one is None or of_one.yields_to(of_motion) else of_one, degrees


def _main_sentence(
    c: Conclusion,
    verdict: Verdict,
    before: HeldOutMisfit,
    after: HeldOutMisfit,
    *,
    remains: bool,
    has_model_error: bool,
) -> str:
    """The sentence on the verdict; `before` and `after` are the held-out misfits over the noise."""
    explanation, found, discrepancy = c.explanation, list(c.problem.dataset), c.asked.discrepancy
    if c.recording_fault is not None:
        return c.recording_fault.sentence
    if c.slight:
        return immaterial_sentence(c.slight)
    if verdict == "no-mismatch" and discrepancy is not None and c.is_beside:
        return usual_model_error_sentence(
            discrepancy.scales, explanation.p_value, len(found), _most(c), taught=discrepancy.is_taught
        )
    return sentence(
        verdict,
        c.effects,
        explanation.p_value,
        before,
        after,
        found,
        (misfit_before_impact(found, explanation.base), misfit_before_impact(found, explanation.fitted)),
        remains=remains,
        cross_validated=c.is_cross_validated,
        beside=c.is_beside and has_model_error,
    )


def hint(c: Conclusion) -> str:
    """What the sentence goes on with where more effects surely predict half of what a part leaves.

    Together they leave more than noise, or can be bent to too much, so that they were not named.
    """
    named = {e.key for e in c.explanation.fitted.effects}
    more = [e for e in c.tried.fitted.effects if e.key not in named]
    if c.grade != "part" or not more or not c.explanation.parts:
        return ""
    share = share_of(c.problem, c.explanation.fitted, c.problem.again(c.tried.fitted), c.groups)
    if share is None or share.low < SETTINGS.report.grades.half_share:
        return ""
    names = " and ".join(e.spoken for e in more)
    predict = "predicts" if len(more) == 1 else "together predict"
    return (
        f" Beside it {names} {predict} {share.message('what is left')}: a hint, no finding, as what was fitted leaves "
        "structure or can be bent to much."
    )


def _probabilities(c: Conclusion, *, remains: bool) -> dict[str, float]:
    """Of each name; none of full runs, of a model of one's own, and of what recordings show by themselves."""
    if c.acts != "drop" or c.asked.scenario is None or c.recording_fault is not None:
        return {}
    is_noise = not remains and c.problem.samples_per_error == 1.0
    p_value = c.tried.first.p_value if c.is_beside and c.tried.first is not None else 1.0
    found = probabilities(c.problem, c.tried, c.explanation, len(c.candidates), is_noise=is_noise, p_value=p_value)
    for slight in {e.id for e in c.slight} & found.keys():  # what is of no consequence is none worth a name
        found[NOTHING] += found.pop(slight)
    return dict(sorted(found.items(), key=lambda one: -one[1]))


def _draws(c: Conclusion) -> Draws | None:
    """Draws of what is named, where they were asked for; none of what recordings show by themselves."""
    if not c.asked.draws or c.recording_fault is not None or c.acts != "drop":
        return None
    c.asked.say("samples of the posterior of the numbers")
    return drawn(c.problem, c.explanation.fitted, c.asked.draws)


def _with_next_test(c: Conclusion) -> tuple[Named, ...]:
    """The effects, and where two names are in the set what would choose between them, by their fits."""
    if c.asked.scenario is None or len(c.effects) != 1 or c.recording_fault is not None or not c.explanation.parts:
        return c.effects
    (effect,), step = c.effects, c.explanation.parts[0]
    # what does the very same at other values no drop tells from it, though that effect by itself would be told
    same = EFFECTS[effect.id](**effect.settings).same_as()
    rivals = [
        f
        for f in step.rivals
        if f.candidates[-1].id in effect.indistinguishable_from and f.candidates[-1].id not in same
    ]
    if len(effect.indistinguishable_from) != 1 or not rivals or len(c.explanation.fitted.candidates) != 1:
        return c.effects
    found = next_test(c.asked.scenario, c.problem.dataset, c.explanation.fitted, min(rivals, key=lambda f: f.chi2))
    return (replace(effect, next_test=found),)


def _most(c: Conclusion) -> tuple[Candidate, Share] | None:
    """The effect that predicts most of the mismatch of recordings that were held out, and its share of that."""
    first = c.explanation.first
    share = None if first is None else share_of(c.problem, first.base, first.fitted, c.groups)
    return None if first is None or share is None else (first.fitted.candidates[-1], share)


def _grids(dataset: Sequence[Dataset]) -> dict[str, tuple[float, ...]]:
    """Centre of the ground's elements (m) of the run that stands for its neighbours, by recording; drops have none."""
    made = [(e.name, full_runs(e.simulator)) for e in dataset]
    return {name: s.scenario.ground.elements.centre for name, s in made if s is not None}


def _felt(d: Degree) -> str:
    """The degree of freedom that misses most, in a sentence."""
    what = "force" if d.unit == "N" else "moment"
    return (
        f"on the {d.body}, {d.share:.0%} of the misfit is a {what} {d.axis}, {spoken(d.rms)} {d.unit} root mean square"
    )


def _cost(found: Sequence[Dataset]) -> list[str]:
    """What full runs took, where there were any."""
    made = [s for e in found if (s := full_runs(e.simulator)) is not None]
    runs, seconds = sum(s.runs for s in made), sum(s.seconds for s in made)
    return [f"{runs} full runs of {1e3 * seconds / runs:.0f} ms on average"] if runs else []


def with_clock_finding(found: Diagnosis, late: Mapping[str, float], problem: Problem, tried: Explanation) -> Diagnosis:
    """A diagnosis made with clocks set right that were `late` (s, by recording), with that as its first finding."""
    groups = [[r] for r in range(len(problem.dataset))]
    before, held = judged(problem, tried.base, [], groups), held_out(tried.base, groups).total
    clocks = _named(late, problem, tried.p_value)
    rest = f" Beside that: {found.sentence}" if found.effects else ""
    after = {n: a for n, _, a in found.per_recording}
    end = found.after.get("held_out", found.after["training"]).nrmse
    return replace(
        found,
        verdict=found.verdict if found.effects else "sensor",
        answer=found.answer if found.effects else "whole",
        sentence=f"{clocks[0].statement} With it the misfit falls from {held:.1f} to {end:.2f} times the noise.{rest}",
        p_value=tried.p_value,
        effects=(*clocks, *found.effects),
        before=before.scores,
        per_recording=tuple((n, b, after.get(n, b)) for n, b in before.by_recording),
    )


def _named(late: Mapping[str, float], problem: Problem, p_value: float) -> tuple[Named, ...]:
    """One finding for each channel where all recordings are as late, which a scenario can be told; else one of all."""
    from scipy.special import stdtrit

    values = np.array(list(late.values()))
    is_common = len(late) == len(problem.dataset) and float(np.ptp(values)) < 2.0 * SETTINGS.data.dataset.shift_prior
    value, n = float(np.mean(values)), values.size
    error = max(float(np.std(values, ddof=1)) / np.sqrt(n) if n > 1 else 0.0, 0.1 * SETTINGS.data.dataset.shift_prior)
    wide = float(stdtrit(max(n - 1, 1), SETTINGS.report.grades.one_sided_confidence)) * error
    way = "late" if value > 0.0 else "early"
    each = ", ".join(f"{spoken(abs(s) * 1e3)} ms {'late' if s > 0.0 else 'early'} ({name})" for name, s in late.items())
    statement = (
        f"All channels of all recordings come {spoken(abs(value) * 1e3)} ms {way}: their common clock is off."
        if is_common
        else f"Clocks of recordings are off: {each}."
    )
    channels = list(dict.fromkeys(s.channel for e in problem.dataset for s in e.signals))
    own: list[str | None] = [*channels] if is_common and len(channels) <= LATE_CLOCKS.most_channels else [None]
    return tuple(
        Named(
            id=CLOCK_OFFSET,
            kind="sensor",
            statement=statement,
            parameters={"offset": Interval(value=value, low=value - wide, high=value + wide, unit="s")},
            settings={} if channel is None else {"channel": channel, "offset": value},
            channel=channel,
            p_value=p_value,
            indistinguishable_from=(),
            discriminating_test=next(iter(EFFECTS[CLOCK_OFFSET].rivals.values()), ""),
        )
        for channel in own
    )
