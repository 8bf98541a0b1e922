"""Locate the mismatch, say what physics was left out, show the fit improve: from recordings to a `Diagnosis`."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rollover.diagnosis.data.dataset import Dataset, dataset_of, doubted, doubted_beside, foreign_to, left_out
from rollover.diagnosis.data.inconsistent import Aside, by_inconsistencies, inconsistencies_of, without
from rollover.diagnosis.data.onset import about_clocks, at_their_zeros
from rollover.diagnosis.data.phases import phases_of
from rollover.diagnosis.data.quantisation import digitised, without_spikes
from rollover.diagnosis.data.repeatability import CONTRADICTING, against_itself, differing, with_scatter
from rollover.diagnosis.data.rounding import to_the_last_digit
from rollover.diagnosis.fit.jobs import Executor
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.local_search import conditioned, is_doubtful
from rollover.diagnosis.fit.parameterisation import strength_parameter
from rollover.diagnosis.fit.time_shift import align, by_clock, mistimed
from rollover.diagnosis.forward.averaging import compared
from rollover.diagnosis.forward.forward_model import first_impact_of, set_up
from rollover.diagnosis.forward.full_run import full_runs
from rollover.diagnosis.inference.adequacy import is_enough
from rollover.diagnosis.inference.chassis import degrees_of
from rollover.diagnosis.inference.drop_dependence import Dependence, dependence, dependence_of_one
from rollover.diagnosis.inference.lack_of_fit import mismatch_of
from rollover.diagnosis.inference.recording_faults import broken_off, by_themselves, misread
from rollover.diagnosis.inference.residual_law import offered, proposed
from rollover.diagnosis.inference.scores import before_an_impact, judged
from rollover.diagnosis.inference.vehicle_dependence import dependency
from rollover.diagnosis.inference.wrong_condition import wrong_conditions
from rollover.diagnosis.noise import autoregression
from rollover.diagnosis.noise.ensemble import weighted
from rollover.diagnosis.noise.heteroscedasticity import with_variance_model
from rollover.diagnosis.noise.offsets import by_zeros, with_zeros
from rollover.diagnosis.noise.truncation import left_aside, shortened
from rollover.diagnosis.result import Degree, Diagnosis, Named
from rollover.diagnosis.selection.candidates import candidates_of, size_of
from rollover.diagnosis.selection.context import Inquiry
from rollover.diagnosis.selection.decision import (
    Explanation,
    by_the_first,
    decided,
    done_by_others,
    explained,
    takes_little,
)
from rollover.diagnosis.statements import (
    by_steps,
    closest,
    considered,
    interval_contains_null,
    named,
    noise,
    of_no_ground,
    places,
    sentence,
)
from rollover.dynamics.drop_test import unfit
from rollover.effects import EFFECTS, spoken
from rollover.recording import Recording
from rollover.recording.attitude import continuous
from rollover.scenario import Scenario
from rollover.spec.channels import describe
from rollover.spec.vehicle import Striker
from rollover.system.errors import InputError

NAMING = ("parameter", "sensor", "missing-physics")  # verdicts that name effects
HALF = 0.5  # of what was beyond the noise: of less a channel that breaks off may be all of it
MOSTLY = 0.6  # of the effects that would not have shown: then nothing can be told
FEWEST = 24  # samples in all, below which nothing is said


def diagnose(
    scenario: Scenario,
    recordings: Sequence[tuple[str, Recording]],
    *,
    hold_out: Sequence[str] = (),
    tolerance: float = 0.0,
    say: Callable[[str], None] = lambda _: None,
    executor: Executor | None = None,
) -> Diagnosis:
    """Compare a scenario with recordings and say what separates them.

    `recordings` are (name, recording); `hold_out` names those that are never fitted, otherwise each condition is left
    out in turn. `tolerance` is the share of a channel's range by which a scenario that lacks nothing may still miss it:
    what is smaller counts as noise. `executor` works off the fits, in children if it has any; the answer is the same.
    Raises `InputError` for an unknown condition, a clock that nothing tells the zero of, and recordings without any
    channel that is simulated; ``ValueError`` for a name in `hold_out` that is none, a tolerance outside 0 to 1.
    """
    began = clock.perf_counter()
    names = [name for name, _ in recordings]
    unknown = [name for name in hold_out if name not in names]
    if unknown:
        raise ValueError(f"hold_out: no such recording, got {unknown[0]!r}; {', '.join(names)}")
    if not 0.0 <= tolerance < 1.0:
        raise ValueError(f"tolerance: not a share of a range, got {tolerance:g}; at least 0 and below 1")
    executor = executor or Executor()
    recordings, zeros = at_their_zeros(scenario, [(name, continuous(r)) for name, r in recordings])
    is_drop = isinstance(scenario.vehicle, Striker)  # what little errors do to an overturn is chance, see `chaos`
    recordings, rounded = to_the_last_digit(recordings) if is_drop else (recordings, [])
    every, notes = _dataset(scenario, recordings, executor)
    notes += [*about_clocks(scenario, recordings, zeros), *rounded]
    every = [replace(e, model_error=float(np.hypot(e.model_error, tolerance))) for e in every]
    asked = Asked(
        scenario=scenario, recordings=dict(recordings), hold_out=hold_out, say=say, executor=executor, began=began
    )
    some, shared = inconsistencies_of(every)
    wrong = wrong_conditions([e for e in without(every, some) if e.name not in hold_out])
    every = [e for e in every if e.name not in {one.dataset.name for one in wrong}]
    found = _diagnosed(asked, without(every, some), [*some, *wrong], notes)
    if found.verdict == "unexplained" and shared:
        # beside a factor so large what else is missing may be out of sight
        other = _diagnosed(asked, without(every, [*some, *shared]), [*some, *shared, *wrong], notes)
        found = other if other.effects else found
    return replace(found, clocks=zeros)


@dataclass(frozen=True, kw_only=True)
class Asked:
    """What a diagnosis was asked for, and when (s of the clock that counts)."""

    scenario: Scenario
    recordings: Mapping[str, Recording]
    hold_out: Sequence[str]
    say: Callable[[str], None]
    executor: Executor
    began: float


def _diagnosed(
    asked: Asked, every: Sequence[Dataset], inconsistencies: Sequence[Aside], notes: Sequence[str]
) -> Diagnosis:
    """The diagnosis of recordings without what was left aside."""
    scenario, recordings, hold_out = asked.scenario, asked.recordings, asked.hold_out
    say, executor, began, names = asked.say, asked.executor, asked.began, list(asked.recordings)
    notes = [*notes, *(inconsistency.says() for inconsistency in inconsistencies)]
    found = _trusted(scenario, [e for e in every if e.name not in hold_out])
    kept = [e for e in _trusted(scenario, every) if e.name in hold_out] if hold_out else []
    if sum(e.count for e in found) < FEWEST:
        return _nothing(every, names, notes, began, by_inconsistencies(inconsistencies))
    notes += [*left_aside(every, found), *by_zeros(found)]
    groups = left_out(found)
    notes += differing(found)
    is_cross_validated = len(groups) > 1 or bool(kept)
    if not is_cross_validated:
        notes.append("one condition only: what stands as held out is predicted by the fit to it")
    problem = Problem(found)
    executor.begin(problem)
    align(problem)
    base = problem.fit((), ())
    if base is None:
        return _nothing(every, names, [*notes, "the scenario itself could not be simulated"], began)
    phases = [phases_of(e) for e in found]
    acts = "rollover" if any(unfit(set_up(scenario, e.recording)) for e in found) else "drop"
    candidates = candidates_of(found, scenario.effects, acts, scenario, size_of(set_up(scenario, found[0].recording)))
    inquiry = Inquiry(problem=problem, candidates=candidates, groups=groups, phases=phases, say=say, executor=executor)
    explanation = explained(inquiry, base)
    explanation, verdict = decided(problem, explanation, groups, phases)
    held, named_so = problem.dataset, _named_beside(problem, explanation, verdict, kept, groups, phases)
    nothing: set[str] = set()
    while (
        more := done_by_others(problem, named_so[0], interval_contains_null(named_so[1], problem.effort.is_ensemble))
        - nothing
    ):
        # what may as well be nothing is none of it: what came first explains what there is alone, or nothing does
        nothing |= more
        problem.with_noise_model(held)
        alone = by_the_first(problem, explanation, nothing, phases)
        explanation, verdict = decided(problem, alone, groups, phases)
        named_so = _named_beside(problem, explanation, verdict, kept, groups, phases)
    explanation, effects, kept = named_so
    found = list(problem.dataset)
    shown = None
    if verdict == "no-mismatch":
        shown = by_themselves(found, recordings, phases, explanation.p_value) or misread(
            inconsistencies, len(found), explanation.p_value
        )
    elif effects and takes_little(explanation, groups, HALF):
        # what is lost again and again is met by no effect, and bends those that are fitted to it
        shown = broken_off(found, recordings, phases, explanation.p_value)
        if shown is not None and not (takes_little(explanation, groups) or shown.is_of(e.channel for e in effects)):
            shown = None  # what another channel loses is no reason to doubt them
    if shown is not None:
        verdict, effects = shown.verdict, shown.effects
        explanation = explanation.refused()
    before, after = explanation.before, explanation.after
    set_ups = [set_up(scenario, e.recording) for e in found]
    is_mismatch = verdict not in ("no-mismatch", "cannot-tell") and shown is None
    say("what the mismatch depends on")
    depends_on = Dependence()
    degrees: tuple[Degree, ...] = ()
    if acts == "drop" and is_mismatch:
        depends_on = dependence(problem, set_ups, explanation.base, executor.parallel_map)
    elif acts != "drop":
        degrees = degrees_of(set_ups, found, [b.shift for b in explanation.base.blocks])
        of_one = dependence_of_one(problem, explanation.base, before) if is_mismatch else None
        of_motion = Dependence(shares=dependency(problem, explanation.base))
        depends_on = of_motion if of_one is None or of_one.yields_to(of_motion) else of_one
    law = None
    if verdict == "unexplained" and acts == "drop" and shown is None:
        say("a law for what no candidate explains")
        law = proposed(problem, explanation.base, set_ups, found, groups)
    detectable = dict(explanation.detectable)
    contrary = differing(found, CONTRADICTING)
    if verdict == "no-mismatch" and (contrary or _is_weak(detectable)):
        verdict = "cannot-tell"
    h_before, h_after = (judged(problem, f, kept, groups) for f in (explanation.base, explanation.fitted))
    early = before_an_impact(problem.dataset, explanation.base), before_an_impact(problem.dataset, explanation.fitted)
    remains = not is_enough(problem, explanation.fitted, after)
    by_itself = () if shown is None else shown.places
    lost = by_itself if verdict == "unexplained" else ()
    is_left = (verdict == "unexplained" and shown is None) or (bool(effects) and remains)
    training = tuple(e.name for e in found)
    notes += [*(_felt(degrees[0]) for _ in degrees[:1] if is_mismatch), *by_steps(effects), *_cost(found)]
    return Diagnosis(
        verdict=verdict,
        sentence=(
            shown.sentence
            if shown is not None
            else sentence(
                verdict,
                effects,
                explanation.p_value,
                h_before.held,
                h_after.held,
                found,
                early,
                remains=remains,
                cross_validated=is_cross_validated,
            )
        )
        + (closest(explanation, groups) if verdict == "unexplained" and shown is None else "")
        + (by_clock(mistimed(problem, explanation.fitted, executor.parallel_map)) if is_left else "")
        + offered(law)
        + by_inconsistencies(inconsistencies)
        + against_itself(verdict, contrary)
        + of_no_ground(found),
        p_value=explanation.p_value if shown is None else shown.p_value,
        noise=noise(found),
        where=places(before, found, depends_on.on) if is_mismatch else by_itself,
        effects=effects,
        remaining_significant=is_left or bool(lost),
        remaining_p_value=after.p_value,
        remaining_where=places(after, found, None) if is_left else lost,
        depends_on=depends_on.on if is_mismatch else next((p.depends_on for p in lost), None),
        dependencies=depends_on.shares,
        degrees=degrees if is_mismatch else (),
        smallest_detectable=detectable,
        training=training,
        held_out=tuple(e.name for e in kept) or training,
        before=h_before.scores,
        after=h_after.scores,
        per_recording=tuple(
            (n, a, b) for (n, a), (_, b) in zip(h_before.by_recording, h_after.by_recording, strict=True)
        ),
        candidates=considered(explanation, candidates, groups),
        simulations=problem.simulations,
        seconds=clock.perf_counter() - began,
        notes=tuple(notes),
        grids=_grids([*found, *kept]),
        empirical=law,
    )


def _reweighted(scenario: Scenario, every: Sequence[Dataset]) -> list[Dataset]:
    """The recordings with the noise of those alike taken together, from their quiet stretches."""
    every = [doubted(e, set_up(scenario, e.recording)) for e in with_scatter(every)]
    problem = Problem(every)
    align(problem)
    base = problem.fit((), (), rounds=2)
    if base is None:
        return list(every)
    residuals, shifts = problem.residuals(base), [b.shift for b in base.blocks]
    return with_zeros(autoregression.quiet(every, residuals), residuals, shifts)


def _named_beside(
    problem: Problem,
    explanation: Explanation,
    verdict: str,
    kept: Sequence[Dataset],
    groups: Sequence[Sequence[int]],
    phases: Sequence[Sequence[tuple[float, str]]],
) -> tuple[Explanation, tuple[Named, ...], list[Dataset]]:
    """An explanation eased beside its effects, these with their numbers if the verdict names any, and the kept ones."""
    whole, kept = marginalised_beside(problem, explanation, kept, phases)
    return whole, named(problem, whole, groups) if verdict in NAMING else (), kept


def marginalised_beside(
    problem: Problem, explanation: Explanation, kept: Sequence[Dataset], phases: Sequence[Sequence[tuple[float, str]]]
) -> tuple[Explanation, list[Dataset]]:
    """The explanation fitted again with what the conditions leave uncertain as it acts beside it; kept ones too."""
    if not explanation.parts or not is_doubtful(problem):
        return explanation, list(kept)
    fitted = conditioned(problem, explanation.fitted)
    beside = problem.changes(fitted.candidates, fitted.x)
    after = mismatch_of(problem.dataset, fitted.blocks, phases)
    return replace(explanation, fitted=fitted, after=after), [doubted_beside(e, beside) for e in kept]


def _trusted(scenario: Scenario, every: Sequence[Dataset]) -> list[Dataset]:
    """The recordings weighed, what the simulation itself is not sure of less."""
    reweighted = [weighted(e, e.simulator.perturbed()) for e in _reweighted(scenario, every)]
    return [shortened(e, alone=len(reweighted) == 1) for e in reweighted]


def _dataset(
    scenario: Scenario, recordings: Sequence[tuple[str, Recording]], executor: Executor
) -> tuple[list[Dataset], list[str]]:
    found, read, notes, foreign = [], [], [], []
    for name, whole in recordings:
        recording, spiked = without_spikes(whole)
        recording, thin, simulator, averaged = compared(scenario, recording)
        if spiked and (first_impact := first_impact_of(simulator)) < np.inf:
            recording, spiked = without_spikes(whole, first_impact)
            recording, thin, simulator, averaged = compared(scenario, recording)
        runs = full_runs(simulator)
        if runs is not None:
            runs.children = executor.children
        simulator.settle()
        notes += [f"{name}: {line}" for line in spiked]
        one = dataset_of(name, thin, simulator, averaged)
        still = [c for c, v in recording.channels.items() if np.isfinite(v).any() and np.nanmin(v) == np.nanmax(v)]
        notes += [f"{name}: {channel} never moves and was left aside" for channel in still]
        if one is None:
            notes.append(f"{name}: shares no usable channel with the simulation and was left aside")
            foreign += foreign_to(simulator, name, recording)
        else:
            found.append(one)
            read.append(recording)
    if foreign and not found:
        raise InputError(*foreign)
    found = with_variance_model(digitised(found, read))
    louder = {s.channel: float(s.level.max()) for e in found for s in e.signals if s.level is not None}
    notes += [f"{c}: the noise grows with the value, to {most:.1f} times its least" for c, most in louder.items()]
    steps = {s.channel: s.step for e in found for s in e.signals if s.step > 0.0}
    notes += [
        f"{c}: recorded in steps of {step:.3g} {describe(c).unit}, more than its noise: what is smaller does not show"
        for c, step in steps.items()
    ]
    return found, notes


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
    return [f"{runs} full runs of {1e3 * seconds / runs:.0f} ms on the average"] if runs else []


def _is_weak(detectable: Mapping[str, float]) -> bool:
    """Whether even typical strengths of most effects would have stayed below what shows; of all, where no ground acts.

    How many others there are is a matter of the vehicle, not of what its recordings tell.
    """
    typical = {
        name: value
        for name, value in detectable.items()
        if name in EFFECTS and EFFECTS[name].kind == "physics" and None not in EFFECTS[name].null.values()
    }  # of a limit, and of what the scenario has already, nothing is usual
    blind = 0
    for name, value in typical.items():
        parameter, null = strength_parameter(name, EFFECTS[name].search)
        usual = getattr(EFFECTS[name](), parameter, None)
        blind += usual is None or value > abs(usual - null)
    acts = any(channel.startswith("ground/") for name in typical for channel in EFFECTS[name].channels)
    return blind > MOSTLY * len(typical) if acts else blind == len(typical)


def _nothing(
    dataset: Sequence[Dataset], names: Sequence[str], notes: Sequence[str], began: float, why: str = ""
) -> Diagnosis:
    """The answer where there is too little to judge."""
    return Diagnosis(
        verdict="cannot-tell",
        sentence=f"There is too little in these recordings to be compared with the simulation.{why}",
        p_value=1.0,
        noise=noise(dataset),
        where=(),
        effects=(),
        remaining_significant=False,
        remaining_p_value=1.0,
        remaining_where=(),
        depends_on=None,
        dependencies=(),
        smallest_detectable={},
        training=tuple(names),
        held_out=(),
        before={},
        after={},
        per_recording=(),
        candidates=(),
        simulations=0,
        seconds=clock.perf_counter() - began,
        notes=tuple(notes),
    )
