"""What a diagnosis says of what it found: effects by name, places, candidates passed over, one sentence."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from rollover.comparison.rating import grade
from rollover.diagnosis.data.condition_uncertainty import pulls
from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.fit.cross_validation import Groups, HeldOutMisfit, held_out
from rollover.diagnosis.fit.ensemble_mean import refined_by_ensemble_mean
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted
from rollover.diagnosis.fit.parameterisation import Candidate
from rollover.diagnosis.fit.step import Step
from rollover.diagnosis.inference.intervals import intervals
from rollover.diagnosis.inference.lack_of_fit import Mismatch
from rollover.diagnosis.result import Considered, Diagnosis, Location, Named, Score, Share, Verdict, chance
from rollover.diagnosis.selection.explanation import Explanation, strongest
from rollover.diagnosis.selection.forward_step import confusion_set
from rollover.diagnosis.settings import SETTINGS
from rollover.effects import EFFECTS

TUNING = SETTINGS.report.statements
PULLS = SETTINGS.inference.condition_pulls
CURES = {  # by where the size of what passes comes from: what that is, and what may show an effect in it
    "stated": ("what is tolerated", "a smaller --tolerance, or values known better than their stated uncertainty,"),
    "taught": ("what is tolerated", "a model that meets the references better, or more of them,"),
    "estimated": ("such a background", "recordings under other conditions, or --reference,"),
}


def named(
    problem: Problem, found: Explanation, groups: Groups, alike: Callable[[Step], Sequence[Fitted]] | None = None
) -> tuple[Named, ...]:
    """Effects of an explanation with their intervals and look-alikes, the strongest first.

    `alike` says of a step what cannot be told from its best; by default all that predict no worse (`confusion_set`).
    Values are those of shorter steps, where runs are integrated: what the scenario's steps take for it is no property
    of what was recorded.
    """
    fitted, held = found.fitted, problem.dataset
    fine = refined_by_ensemble_mean(problem, fitted)
    settings_of = intervals(problem, fine, coarse=fitted)
    if fine is not fitted:
        problem.with_noise_model(held)
    settings = {c.key: s for c, s in zip(fitted.candidates, settings_of, strict=True)}
    by_key = {s.fitted.candidates[-1].key: s for s in found.parts}
    effects = []
    for c in fitted.effects:
        kind = EFFECTS[c.id]
        parameters = settings[c.key]
        values: dict[str, Any] = {name: i.value for name, i in parameters.items()}
        if c.channel is not None:
            values["channel"] = c.channel
        own = by_key[c.key]
        near = confusion_set(own, groups, problem.samples_per_error) if alike is None else alike(own)
        # what was named too is told apart by being beside it
        rivals = [r for r in (f.candidates[-1] for f in near) if r.key not in settings]
        effect = kind(**values)
        same = {id: said for id, said in effect.same_as().items() if id not in settings}
        effects.append(
            Named(
                id=c.id,
                kind=c.kind,
                statement=" ".join([effect.statement(), *same.values(), *_clock_ambiguity(problem, c, values)]),
                parameters=parameters,
                settings=values,
                channel=c.channel,
                p_value=own.p_value,
                indistinguishable_from=tuple(dict.fromkeys([*(r.id for r in rivals if r.id != c.id), *same])),
                discriminating_test=discriminating_test(c.key, [*(r.key for r in rivals), *same]),
            )
        )
    first = strongest(problem, found.base, fitted)
    return tuple(sorted(effects, key=lambda n: (n.id, n.channel) != (first.id, first.channel)))


def discriminating_test(key: str, rivals: Sequence[str]) -> str:
    """The test that tells an effect from the first of its rivals (keys) that either lists; without, the usual one's."""
    id = key.partition(":")[0]
    known, others = EFFECTS[id].rivals, [r.partition(":")[0] for r in rivals]
    listed = (known.get(other) or EFFECTS[other].rivals.get(id) for other in others)
    planned = f"what `rollover plan SCENARIO --between {key},{rivals[0]}` advises" if rivals else ""
    return next(filter(None, listed), planned or next(iter(known.values()), ""))


def _clock_ambiguity(problem: Problem, c: Candidate, values: Mapping[str, Any]) -> list[str]:
    """What is to be said of a channel that comes late by no more than the clocks are unsure of, beside one other."""
    others = {s.channel for e in problem.dataset for s in e.signals} - {c.channel}
    if c.id != "sensor-clock-offset" or len(others) != 1:
        return []
    if abs(values["offset"]) > TUNING.clock_errors * min(e.shift_prior for e in problem.dataset):
        return []
    way = "early" if values["offset"] > 0.0 else "late"
    return [f"With two channels the late one cannot be identified: {others.pop()} may be {way} by as much."]


def is_null_effect(effect: Named) -> bool:
    """Whether all that an effect is may be none of it: the interval of each number that has a null holds that.

    A range of logarithms holds no nought: there an interval that goes down to a small part of the value does.
    """
    kind = EFFECTS[effect.id]
    nulls = {p: kind.null.get(p) for p in effect.parameters}
    logarithmic = {p for p, s in kind.search.items() if s.scale == "log"}

    def may_be(name: str, null: float) -> bool:
        i = effect.parameters[name]
        least = i.low - (TUNING.near_zero * i.value if null == 0.0 and name in logarithmic else 0.0)
        return least <= null <= i.high

    known = {p: null for p, null in nulls.items() if isinstance(null, (int, float))}
    return bool(known) and all(may_be(p, null) for p, null in known.items())


def interval_contains_null(effects: Sequence[Named], scattering: bool) -> set[str]:
    """Ids of those that may be none of what they are said to be: their gain is another's, or chance of the runs.

    One alone has no other's gain: where runs are not `scattering` it is there, its strength cannot be estimated. So
    it is with what does something at its least.
    """
    if len(effects) == 1 and (not scattering or EFFECTS[effects[0].id].is_discontinuous):
        return set()
    return {e.id for e in effects if is_null_effect(e)}


def no_contact_clause(found: Sequence[Dataset]) -> str:
    """What a sentence goes on with where no recording reaches the first contact that is simulated."""
    contacts = [e.simulator.contact for e in found]
    last_times = [max(float(e.recording.time[s.rows[-1]]) for s in e.signals) for e in found]
    if any(end >= at or not np.isfinite(at) for end, at in zip(last_times, contacts, strict=True)):
        return ""
    return " None of them reaches the first contact: nothing can be said of the ground."


def immaterial_sentence(effects: Sequence[Named]) -> str:
    """The sentence where all that separates simulation and recordings moves no load by more than a share of it."""
    moves = max(e.moves or 0.0 for e in effects)
    said = " ".join(e.statement for e in effects)
    return f"Simulation and recordings differ by nothing of consequence: no load moves by more than {moves:.2%}. {said}"


def background(shares: Mapping[str, float]) -> str:
    """A discrepancy in words: its shares of the channels' ranges, of many the least and the most."""
    if len(shares) > TUNING.spelt_out_scales:
        least, most = (one(shares, key=lambda k: shares[k]) for one in (min, max))
        return f"{shares[least]:.1%} of {least} to {shares[most]:.1%} of {most}"
    return ", ".join(f"{share:.1%} of {channel}" for channel, share in shares.items())


def by_share(effects: Sequence[Named], scales: Mapping[str, float], *, estimated: bool = True) -> str:
    """What a sentence goes on with where effects are a part of it, or have not quite its form.

    `scales` are shares of the channels' ranges, `estimated` from what explanations leave, else stated or taught.
    """
    found = [e for e in effects if e.explains is not None and e.answer in ("part", "likeness")]
    said = ""
    for e in found:
        assert e.explains is not None
        nuance = "; its law may have another form, or more is missing" if e.answer == "likeness" and scales else ""
        said += f" {e.id} explains {e.explains.message(alone=len(effects) == 1)}{nuance}."
    if found and scales:
        how = "estimated" if estimated else "allowed for"
        said += f" A background was {how} beside it (standard deviation as a share of the range: {background(scales)})."
    return said


def usual_model_error_sentence(
    scales: Mapping[str, float],
    p_value: float,
    recordings: int,
    best: tuple[Candidate, Share] | None = None,
    *,
    taught: bool = False,
) -> str:
    """The sentence where all is met but for an estimated background, a share of each channel's range.

    `best` is the effect that predicts most of it, with its share, which is stated where it surely predicts some.
    """
    some = ""
    if best is not None and best[1].low > 0.0:
        candidate, found = best
        some = f" Part of it is predicted by {candidate.spoken}: {found.message()}."
    how, most = ("a", "the references show") if taught else ("an estimated", "models usually miss")
    least = "surely predicts some" if taught else "predicts half"
    return (
        f"Simulation and {recordings} recordings agree but for {how} background (standard deviation as a share of the "
        f"range: {background(scales)}). It is more than noise ({chance(p_value)}) and no more than {most}; no effect "
        f"that could be named {least} of it on recordings that were held out.{some}"
    )


def step_error_note(effects: Sequence[Named]) -> list[str]:
    """What the scenario's own steps would have said of values, where that is far off beside their intervals."""
    return [
        f"{effect.id} {name}: {i.value:.4g} {'' if i.unit == '1' else i.unit}".rstrip()
        + f" in steps of 1/{SETTINGS.fit.ensemble_mean.finer_parts} of the scenario's, {i.as_simulated:.4g} in these"
        for effect in effects
        for name, i in effect.parameters.items()
        if i.as_simulated is not None and abs(i.as_simulated - i.value) > TUNING.notable_change * (i.high - i.low)
    ]


def candidate_table(
    found: Explanation, candidates: Sequence[Candidate], groups: Sequence[Sequence[int]]
) -> tuple[Considered, ...]:
    """Every candidate with its gain on held-out conditions beside the base, and why it was not chosen."""
    first = found.first
    chosen = {c.key for c in found.fitted.candidates}
    lines: dict[str, Considered] = {}
    if first is not None:
        start, best = held_out(first.base, groups).total, held_out(first.fitted, groups).total
        for f in first.rivals:
            c = f.candidates[-1]
            end = held_out(f, groups).total
            if c.key in chosen:
                reason = "chosen"
            elif end >= 0.999 * start:
                reason = "predicts held-out recordings no better than the scenario as it is"
            else:
                reason = f"leaves {end:.2f} times the noise on held-out recordings, the best {best:.2f}"
            lines[c.key] = Considered(
                id=c.id, channel=c.channel, held_out_gain=float(np.log(start / end)), reason=reason
            )
        for s in first.screened:
            if s.candidate.key not in lines and s.nrmse:
                c = s.candidate
                reason = f"leaves {s.nrmse:.2f} times the noise after a first fit to few recordings"
                lines[c.key] = Considered(id=c.id, channel=c.channel, held_out_gain=0.0, reason=reason)
    for c in candidates:
        if c.key not in lines:
            reason = (
                "chosen beside another one" if c.key in chosen else "its sensitivity is nearly orthogonal to the misfit"
            )
            lines[c.key] = Considered(id=c.id, channel=c.channel, held_out_gain=0.0, reason=reason)
    return tuple(sorted(lines.values(), key=lambda c: -c.held_out_gain))


def closest_candidate_sentence(found: Explanation, groups: Sequence[Sequence[int]]) -> str:
    """Which candidate comes closest to explaining what none explains, if one takes at least half; else nothing."""
    one = found.first
    if one is None:
        return ""
    start, end = held_out(one.base, groups).total, held_out(one.fitted, groups).total
    if end > 0.5 * start:
        return ""
    closest = one.fitted.candidates[-1].spoken
    return f" The closest, {closest}, leaves {end:.2f} times the noise, with structure in it."


def locations(mismatch: Mismatch, dataset: Sequence[Dataset], depends: str | None) -> tuple[Location, ...]:
    """Where the misfit is more than noise, largest share first."""
    return tuple(
        Location(
            recording=dataset[c.recording].name,
            channel=c.channel,
            phase=c.phase,
            start=c.start,
            end=c.end,
            share=share,
            depends_on=depends,
        )
        for c, share in mismatch.shares()[:12]
        if share > 0.01
    )  # fmt: skip


def noise(dataset: Sequence[Dataset]) -> dict[str, float]:
    """Noise (1 sigma, SI) of each channel, the median of the recordings."""
    found: dict[str, list[float]] = {}
    for e in dataset:
        for s in e.signals:
            found.setdefault(s.channel, []).append(s.noise)
    return {name: float(np.median(values)) for name, values in found.items()}


def is_hardly_tolerated(found: Diagnosis) -> bool:
    """Whether what passes is larger than noise and tolerance, by no more than chance, or is poor by ISO/TS 18571.

    A fault that recordings show by themselves is named already.
    """
    score = found.before.get("held_out")
    if found.verdict != "no-mismatch" or found.by_itself or score is None:
        return False
    return score.nrmse > 1.0 or (score.iso18571 is not None and grade(score.iso18571) == "poor")


def tolerance_clause(
    verdict: Verdict, p_value: float, score: Score | None, dataset: Sequence[Dataset], *, source: str = "stated"
) -> str:
    """What a sentence goes on with where poor curves pass, or a peak force that is off by more than what is let pass.

    Poor is what ISO/TS 18571 calls so; `source` (of `CURES`) says where that comes from.
    """
    is_beyond_noise = verdict == "no-mismatch" and p_value < SETTINGS.inference.lack_of_fit.p_value
    if not is_beyond_noise or score is None:
        return ""
    tolerated = [e.model_error_of(s) for e in dataset for s in e.signals if e.model_error_dominates(s)]
    if not tolerated:
        return ""
    iso, peak = score.iso18571, score.peak_force_error or 0.0
    if iso is not None and grade(iso) == "poor":
        said = f"By ISO 18571 they are poor ({iso:.2f})"
    elif abs(peak) > max(tolerated):
        said = f"A peak force is off by {abs(peak):.0%}"
    else:
        return ""
    hides, cure = CURES[source]
    return f" {said}: {hides} may hide an effect; {cure} may show it."


def sentence(
    verdict: Verdict,
    effects: Sequence[Named],
    p_value: float,
    first: HeldOutMisfit,
    last: HeldOutMisfit,
    dataset: Sequence[Dataset],
    early: tuple[float | None, float | None] = (None, None),
    *,
    remains: bool = False,
    cross_validated: bool = True,
    beside: bool = False,
) -> str:
    """The verdict in a few sentences; `early` is the misfit before the first impact without and with the effects.

    `remains` says that these are not all that separates simulation and recordings, `cross_validated` that some
    recordings were held out, as none can be of one condition, `beside` that an estimated discrepancy counts beside the
    noise.
    """
    if verdict == "no-mismatch" and p_value < SETTINGS.inference.lack_of_fit.p_value:
        model_error_dominates = any(e.model_error_dominates(s) for e in dataset for s in e.signals)
        beyond = " beyond what is tolerated or repeats differ by" if model_error_dominates else ""
        return (
            f"Simulation and {len(dataset)} recordings differ by more than noise ({chance(p_value)}), but by less "
            f"than {SETTINGS.inference.adequacy.negligible:.1%} of any channel's range{beyond}."
        )
    if verdict == "no-mismatch":
        return f"Simulation and {len(dataset)} recordings agree within the noise ({chance(p_value)})."
    if verdict == "cannot-tell":
        return "These recordings are too weak to show even effects of typical strength: no statement is possible."
    if verdict == "unexplained":
        return (
            f"Simulation and recordings differ ({first.total:.1f} times the noise), and no candidate explains it"
            f"{' on recordings that were held out' if cross_validated else ''}."
        )
    said = " ".join(e.statement for e in effects)
    # beside a background the law of what is missing need not be that of the effect
    said = f"Of all effects {effects[0].id} comes closest: {said}" if beside else said
    rivals = sorted({r for e in effects for r in e.indistinguishable_from})
    also = (
        "" if cross_validated else " With one recording nothing can be held out: this is the misfit of the fit to it."
    )
    also += " The unexplained residual has structure: these effects are not the whole difference." if remains else ""
    also += f" Not distinguishable by these recordings: {', '.join(rivals)}." if rivals else ""
    misfit = "held-out misfit" if cross_validated else "misfit"
    falls = f"{said} With it the {misfit} falls from {first.total:.1f} to {last.total:.2f} times the noise"
    falls += " and what models usually miss" if beside else ""
    without, with_ = early
    if without is None or with_ is None:
        return f"{falls}.{also}"
    first_impact = (
        f"before the first impact, where runs do not scatter, it is {with_:.2f} times the noise, without {without:.2f}"
    )
    return f"{falls} and the scatter of runs; {first_impact}.{also}"


def mean_pulls(problem: Problem, fitted: Fitted) -> Mapping[str, float]:
    """Mean pull of each uncertain number, none of a list, over the recordings that state it, by path.

    In standard deviations of what is stated.
    """
    found: dict[str, list[float]] = {}
    for e, block in zip(problem.dataset, fitted.blocks, strict=True):
        count = 0 if e.nuisance is None else e.nuisance.shape[1]
        if not count or count != len(e.doubtful):
            continue
        z = pulls(e.uncertain, e.marginalised.undone(block.residual), problem.samples_per_error)
        for one, pull in zip(e.doubtful, z[:count], strict=True):
            for path, value in one.items():
                # numbers of a list have no path of their own, and are left out
                if isinstance(value, (int, float)):
                    found.setdefault(path, []).append(float(pull))
    return {path: float(np.mean(each)) for path, each in found.items()}


def pull_notes(problem: Problem, fitted: Fitted) -> list[str]:
    """A note on what is pulled by a standard deviation and more; none where nothing is."""
    large = {path: z for path, z in mean_pulls(problem, fitted).items() if abs(z) >= PULLS.least_pull}
    if not large:
        return []
    said = ", ".join(f"{path} by {z:+.1f}" for path, z in large.items())
    return [f"what is stated as uncertain absorbs part of the mismatch: {said} of its standard deviations"]
