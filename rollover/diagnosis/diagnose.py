"""Locate the mismatch, say what physics was left out, show the fit improve: from recordings to a `Diagnosis`."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Mapping, Sequence

from rollover.diagnosis.candidates import candidates_of, size_of
from rollover.diagnosis.depend import dependency, residual_forces
from rollover.diagnosis.detect import Mismatch, mismatch_of
from rollover.diagnosis.evidence import Evidence, binned, doubted, evidence_of, left_out, recoloured
from rollover.diagnosis.explain import Step
from rollover.diagnosis.fit import Fitted, Judge
from rollover.diagnosis.holdout import Held, held_out
from rollover.diagnosis.phases import drop_phases
from rollover.diagnosis.repeats import with_scatter
from rollover.diagnosis.scores import scored
from rollover.diagnosis.selection import EXPLAINED, decided, selected
from rollover.diagnosis.simulator import DropSimulator, set_up, simulator_of
from rollover.diagnosis.statements import considered, named, noise, places, sentence
from rollover.diagnosis.verdict import Diagnosis
from rollover.effects import EFFECTS
from rollover.recording import Recording
from rollover.scenario import Scenario

NEARLY_NOISE = 1.3  # misfit over the noise up to which its own memory is believed
FEWEST = 24  # samples in all, below which nothing is said


def diagnose(
    scenario: Scenario,
    recordings: Sequence[tuple[str, Recording]],
    *,
    hold_out: Sequence[str] = (),
    say: Callable[[str], None] = lambda _: None,
) -> Diagnosis:
    """Compare a scenario with recordings and say what separates them.

    `recordings` are (name, recording); `hold_out` names those that are never fitted, otherwise each condition is left
    out in turn. Raises `InputError` for a condition that the scenario does not know, ``ValueError`` for a name in
    `hold_out` that is none.
    """
    began = clock.perf_counter()
    names = [name for name, _ in recordings]
    unknown = [name for name in hold_out if name not in names]
    if unknown:
        raise ValueError(f"hold_out: no such recording, got {unknown[0]!r}; {', '.join(names)}")
    found, notes = _evidence(scenario, recordings)
    if sum(e.count for e in found) < FEWEST:
        return _nothing(found, names, notes, began)
    groups = left_out(found)
    if hold_out:
        held = [k for k, e in enumerate(found) if e.name in hold_out]
        groups = [held] if held else groups
    judge = Judge(found)
    judge.aligned()
    base = judge.fit((), ())
    if base is not None and base.left < NEARLY_NOISE**2 * sum(e.count for e in found):
        judge, base = _recoloured(judge, base)
        found = list(judge.evidence)
    if base is None:
        return _nothing(found, names, [*notes, "the scenario itself could not be simulated"], began)
    phases = [drop_phases(e) for e in found]
    before = mismatch_of(found, base.blocks, phases)
    acts = "drop" if all(isinstance(e.simulator, DropSimulator) for e in found) else "rollover"
    size = size_of(set_up(scenario, found[0].recording))
    candidates = candidates_of(found, scenario.effects, acts, size)
    steps, current = selected(judge, base, candidates, groups, phases, say)
    steps, current, verdict = decided(judge, base, before, steps, groups)
    after = mismatch_of(found, current.blocks, phases)
    set_ups = [set_up(scenario, e.recording) for e in found]
    say("what the mismatch depends on")
    dependencies = dependency(residual_forces(set_ups, found)) if acts == "drop" else []
    detectable = _detectable(steps.looked, judge)
    if verdict == "no-mismatch" and _is_weak(found, detectable):
        verdict = "cannot-tell"
    h_before, h_after = held_out(base, groups), held_out(current, groups)
    effects = named(judge, base, steps, groups) if verdict in ("parameter", "sensor", "missing-physics") else ()
    depends = dependencies[0][0] if dependencies and dependencies[0][1] > 0.3 else None
    training = tuple(e.name for e in found if e.name not in hold_out)
    return Diagnosis(
        verdict=verdict,
        sentence=sentence(verdict, effects, before, h_before, h_after, found),
        p_value=before.p_value,
        noise=noise(found),
        where=places(before, found, depends) if verdict not in ("no-mismatch", "cannot-tell") else (),
        effects=effects,
        remaining_significant=verdict == "unexplained" or (bool(effects) and _remains(after, h_after)),
        remaining_p_value=after.p_value,
        remaining_where=places(after, found, None) if verdict == "unexplained" or _remains(after, h_after) else (),
        depends_on=depends if verdict not in ("no-mismatch", "cannot-tell") else None,
        dependencies=tuple(dependencies),
        smallest_detectable=detectable,
        training=training,
        held_out=tuple(hold_out) or training,
        before=scored(judge, base, h_before, hold_out),
        after=scored(judge, current, h_after, hold_out),
        per_recording=tuple(
            (e.name, float(a), float(b)) for e, a, b in zip(found, h_before.nrmse, h_after.nrmse, strict=True)
        ),
        candidates=considered(judge, base, steps, groups),
        simulations=judge.simulations,
        seconds=clock.perf_counter() - began,
        notes=tuple(notes),
    )


def _evidence(scenario: Scenario, recordings: Sequence[tuple[str, Recording]]) -> tuple[list[Evidence], list[str]]:
    found, notes = [], []
    for name, recording in recordings:
        recording = binned(recording)
        one = evidence_of(name, recording, simulator_of(scenario, recording))
        if one is None:
            notes.append(f"{name}: shares no usable channel with the simulation and was left aside")
        else:
            found.append(one)
    found = [doubted(e, set_up(scenario, e.recording)) for e in with_scatter(found)]
    return found, notes


def _recoloured(judge: Judge, base: Fitted) -> tuple[Judge, Fitted | None]:
    """The same recordings with the colour of the noise from the whole misfit."""
    found = []
    for e, block in zip(judge.evidence, base.blocks, strict=True):
        predicted = e.simulator.predict({}, block.shift)
        found.append(e if predicted is None else recoloured(e, predicted))
    again = Judge(found)
    again.shifts = [b.shift for b in base.blocks]
    return again, again.fit((), ())


def _detectable(first: Step | None, judge: Judge) -> dict[str, float]:
    """Strength of each effect that these recordings would have shown, in its first parameter's unit."""
    del judge
    if first is None:
        return {}
    return dict(first.detectable)


def _is_weak(evidence: Sequence[Evidence], detectable: Mapping[str, float]) -> bool:
    """Whether even typical strengths of most effects of the ground would have stayed below what shows."""
    typical = {name: value for name, value in detectable.items() if name in EFFECTS and EFFECTS[name].kind == "physics"}
    if not typical:
        return True
    blind = 0
    for name, value in typical.items():
        parameter = next(iter(EFFECTS[name].search))
        usual, null = getattr(EFFECTS[name](), parameter, None), EFFECTS[name].null.get(parameter)
        base = null if isinstance(null, (int, float)) else 0.0
        if usual is None or abs(value - base) > abs(usual - base):
            blind += 1
    return blind > 0.6 * len(typical)


def _remains(after: Mismatch, held: Held) -> bool:
    return after.p_value < 1e-4 and held.total > EXPLAINED


def _nothing(evidence: Sequence[Evidence], names: Sequence[str], notes: Sequence[str], began: float) -> Diagnosis:
    """The answer where there is too little to judge."""
    return Diagnosis(
        verdict="cannot-tell",
        sentence="There is too little in these recordings to be compared with the simulation.",
        p_value=1.0,
        noise=noise(evidence),
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
