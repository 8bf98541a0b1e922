"""Locate the mismatch, say what physics was left out, show the fit improve: from recordings to a `Diagnosis`."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.candidates import Candidate, candidates_of
from rollover.diagnosis.depend import dependency, residual_forces
from rollover.diagnosis.detect import Mismatch, mismatch_of
from rollover.diagnosis.evidence import Evidence, binned, evidence_of, groups_of, recoloured
from rollover.diagnosis.explain import CHANCE, MOST, NEGLIGIBLE, Step, confusion, moves, step
from rollover.diagnosis.fit import Fitted, Judge
from rollover.diagnosis.gate import null_of_the_best
from rollover.diagnosis.holdout import Held, held_out
from rollover.diagnosis.intervals import intervals
from rollover.diagnosis.phases import drop_phases
from rollover.diagnosis.scores import scored
from rollover.diagnosis.simulator import DropSimulator, set_up, simulator_of
from rollover.diagnosis.verdict import Considered, Diagnosis, Named, Place, Verdict
from rollover.effects import EFFECTS
from rollover.recording import Recording
from rollover.scenario import Scenario

Array = NDArray[np.float64]

SURE = 1e-3  # p-value below which there is a mismatch
EXPLAINED = 1.2  # held-out misfit over the noise that counts as explained
NEARLY_NOISE = 1.3  # misfit over the noise up to which its own memory is believed
NOISE_ITSELF = 1.05  # held-out misfit that no further effect can better
PARTLY = 0.05  # of the excess over the noise that an explanation may leave and still be named
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
    groups = groups_of(found)
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
    candidates = candidates_of(found, scenario.effects, acts)
    steps, current = _selected(judge, base, candidates, groups, phases, say)
    steps, current, verdict = _decided(judge, base, before, steps, groups)
    after = mismatch_of(found, current.blocks, phases)
    set_ups = [set_up(scenario, e.recording) for e in found]
    say("what the mismatch depends on")
    dependencies = dependency(residual_forces(set_ups, found)) if acts == "drop" else []
    detectable = _detectable(steps.looked, judge)
    if verdict == "no-mismatch" and _is_weak(found, detectable):
        verdict = "cannot-tell"
    h_before, h_after = held_out(base, groups), held_out(current, groups)
    effects = _named(judge, base, steps, groups) if verdict in ("parameter", "sensor", "missing-physics") else ()
    depends = dependencies[0][0] if dependencies and dependencies[0][1] > 0.3 else None
    training = tuple(e.name for e in found if e.name not in hold_out)
    return Diagnosis(
        verdict=verdict,
        sentence=_sentence(verdict, effects, before, h_before, h_after, found),
        p_value=before.p_value,
        noise=_noise(found),
        where=_places(before, found, depends) if verdict not in ("no-mismatch", "cannot-tell") else (),
        effects=effects,
        remaining_significant=verdict == "unexplained" or (bool(effects) and _remains(after, h_after)),
        remaining_p_value=after.p_value,
        remaining_where=_places(after, found, None) if verdict == "unexplained" or _remains(after, h_after) else (),
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
        candidates=_considered(judge, base, steps, groups),
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


class Steps:
    """The steps of a selection, and what was looked at in its first."""

    def __init__(self, taken: Sequence[Step], tried: Sequence[Step]) -> None:
        self.taken, self.tried = list(taken), list(tried)

    @property
    def looked(self) -> Step | None:
        """The first step, taken or not."""
        return self.tried[0] if self.tried else None


def _selected(
    judge: Judge,
    base: Fitted,
    candidates: Sequence[Candidate],
    groups: Sequence[Sequence[int]],
    phases: Sequence[Sequence[tuple[float, str]]],
    say: Callable[[str], None],
) -> tuple[Steps, Fitted]:
    """Forward selection: up to three effects, each beyond chance, until nothing but noise is left."""
    taken: list[Step] = []
    tried: list[Step] = []
    current = base
    for _ in range(MOST):
        used = {c.key for c in current.candidates} | {c.id for c in current.candidates if c.channel is None}
        found = step(judge, current, [c for c in candidates if c.key not in used and c.id not in used], groups, say)
        tried.append(found)
        if found.p_value > CHANCE or moves(judge, current, found.fitted) < NEGLIGIBLE:
            break
        taken.append(found)
        current = found.fitted
        if held_out(current, groups).total < NOISE_ITSELF:
            break
        left = mismatch_of(judge.evidence, current.blocks, phases)
        if left.p_value > SURE or not _matters(judge, current, left):
            break
    return Steps(taken, tried), current


def _decided(
    judge: Judge, base: Fitted, before: Mismatch, steps: Steps, groups: Sequence[Sequence[int]]
) -> tuple[Steps, Fitted, Verdict]:
    """The verdict; what does not explain is not named, and of several effects only those that are needed."""
    start = held_out(base, groups).total
    for count in range(len(steps.taken), 0, -1):
        fitted = steps.taken[count - 1].fitted
        end = held_out(fitted, groups).total
        if end < EXPLAINED or end**2 - 1.0 < PARTLY * (start**2 - 1.0):
            # the fewest that explain as well
            for fewer in range(1, count):
                earlier = held_out(steps.taken[fewer - 1].fitted, groups).total
                if earlier < max(1.02 * end, NOISE_ITSELF):
                    count, fitted = fewer, steps.taken[fewer - 1].fitted
                    break
            kind = _strongest(judge, base, fitted).kind
            verdict: Verdict = (
                "missing-physics" if kind == "physics" else "parameter" if kind == "parameter" else "sensor"
            )
            return Steps(steps.taken[:count], steps.tried), fitted, verdict
    significant = before.p_value < SURE and _matters(judge, base, before)
    return Steps([], steps.tried), base, "unexplained" if significant or steps.taken else "no-mismatch"


def _strongest(judge: Judge, base: Fitted, fitted: Fitted) -> Candidate:
    """The effect without which most would be left."""
    best, loss = fitted.candidates[0], -np.inf
    for k, c in enumerate(fitted.candidates):
        rest = tuple(o for j, o in enumerate(fitted.candidates) if j != k)
        if not rest:
            return c
        x, at = [], 0
        for o in fitted.candidates:
            if o is not c:
                x += list(fitted.x[at : at + len(o.search)])
            at += len(o.search)
        without = judge.fit(rest, x, rounds=4)
        left = without.left if without is not None else base.left
        if left > loss:
            best, loss = c, left
    return best


def _matters(judge: Judge, base: Fitted, before: Mismatch) -> bool:
    """Whether the structure of the misfit is worth a word: beyond a share of a channel's range."""
    most = 0.0
    for r, block in enumerate(base.blocks):
        for signal, _ in judge.evidence[r].spans():
            cells = [c for c in before.cells if c.recording == r and c.channel == signal.channel]
            power = sum(c.structured - c.waves for c in cells) / max(sum(c.rows.size for c in cells), 1)
            most = max(most, float(np.sqrt(max(power, 0.0))) * signal.sigma / signal.span)
        del block
    return most > NEGLIGIBLE


def _named(judge: Judge, base: Fitted, steps: Steps, groups: Sequence[Sequence[int]]) -> tuple[Named, ...]:
    fitted = steps.taken[-1].fitted
    settings = intervals(judge, fitted)
    found = []
    for k, c in enumerate(fitted.candidates):
        kind = EFFECTS[c.id]
        parameters = settings[k]
        values: dict[str, Any] = {name: i.value for name, i in parameters.items()}
        if c.channel is not None:
            values["channel"] = c.channel
        before = steps.taken[k - 1].fitted if k else base
        rivals = [f.candidates[-1] for f in confusion(before, steps.taken[k], groups) if f.candidates[-1].key != c.key]
        tests = [kind.rivals[r.id] for r in rivals if r.id in kind.rivals]
        found.append(
            Named(
                id=c.id,
                kind=c.kind,
                statement=kind(**values).says(),
                parameters=parameters,
                settings=values,
                channel=c.channel,
                p_value=steps.taken[k].p_value,
                indistinguishable_from=tuple(dict.fromkeys(r.id for r in rivals if r.id != c.id)),
                discriminating_test=tests[0] if tests else next(iter(kind.rivals.values()), ""),
            )
        )
    first = _strongest(judge, base, fitted)
    return tuple(sorted(found, key=lambda n: (n.id, n.channel) != (first.id, first.channel)))


def _considered(judge: Judge, base: Fitted, steps: Steps, groups: Sequence[Sequence[int]]) -> tuple[Considered, ...]:
    """Every candidate with its gain on held-out conditions beside the base, and why it was not chosen."""
    first = steps.looked
    if first is None:
        return ()
    start = held_out(base, groups).total
    chosen = {c.key for c in steps.taken[-1].fitted.candidates} if steps.taken else set()
    best = held_out(first.fitted, groups).total
    found, seen = [], set()
    for f in first.rivals:
        c = f.candidates[-1]
        end = held_out(f, groups).total
        seen.add(c.key)
        if c.key in chosen:
            reason = "chosen"
        elif end >= 0.999 * start:
            reason = "predicts held-out recordings no better than the scenario as it is"
        else:
            reason = f"leaves {end:.2f} times the noise on held-out recordings, the best {best:.2f}"
        found.append(Considered(id=c.id, channel=c.channel, held_out_gain=float(np.log(start / end)), reason=reason))
    for s in first.screened:
        if s.candidate.key not in seen:
            found.append(
                Considered(
                    id=s.candidate.id, channel=s.candidate.channel, held_out_gain=0.0,
                    reason=f"leaves {s.nrmse:.2f} times the noise after a first fit to few recordings"
                    if s.nrmse
                    else "moves the simulation in directions in which the misfit has little",
                )
            )  # fmt: skip
    return tuple(sorted(found, key=lambda c: -c.held_out_gain))


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


def _places(mismatch: Mismatch, evidence: Sequence[Evidence], depends: str | None) -> tuple[Place, ...]:
    return tuple(
        Place(
            recording=evidence[c.recording].name,
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


def _noise(evidence: Sequence[Evidence]) -> dict[str, float]:
    found: dict[str, list[float]] = {}
    for e in evidence:
        for s in e.signals:
            found.setdefault(s.channel, []).append(s.noise)
    return {name: float(np.median(values)) for name, values in found.items()}


def _sentence(
    verdict: Verdict,
    effects: Sequence[Named],
    before: Mismatch,
    first: Held,
    last: Held,
    evidence: Sequence[Evidence],
) -> str:
    if verdict == "no-mismatch":
        return f"Simulation and {len(evidence)} recordings agree within the noise (p = {before.p_value:.2g})."
    if verdict == "cannot-tell":
        return "These recordings are too weak to show even typical effects: nothing can be said."
    if verdict == "unexplained":
        return (
            f"Simulation and recordings differ ({first.total:.1f} times the noise), and no candidate explains it on "
            "recordings that were held out."
        )
    said = " ".join(e.statement for e in effects)
    rivals = sorted({r for e in effects for r in e.indistinguishable_from})
    also = f" Not told apart by these recordings: {', '.join(rivals)}." if rivals else ""
    return f"{said} With it the held-out misfit falls from {first.total:.1f} to {last.total:.2f} times the noise.{also}"


def _nothing(evidence: Sequence[Evidence], names: Sequence[str], notes: Sequence[str], began: float) -> Diagnosis:
    """The answer where there is too little to judge."""
    return Diagnosis(
        verdict="cannot-tell",
        sentence="There is too little in these recordings to be compared with the simulation.",
        p_value=1.0,
        noise=_noise(evidence),
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


__all__ = ["diagnose", "null_of_the_best"]
