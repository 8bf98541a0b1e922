"""What holds of every diagnosis: findings that break it are none, and what breaks it all the same is said by name."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from math import isfinite

import numpy as np

from rollover.diagnosis.data.phases import Phases
from rollover.diagnosis.fit.cross_validation import Groups, held_out
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted, is_at_bound
from rollover.diagnosis.fit.parameterisation import coordinate, physical, strength_parameter, with_slices
from rollover.diagnosis.grades import shares
from rollover.diagnosis.inference.intervals import held_at
from rollover.diagnosis.inference.lack_of_fit import mismatch_of
from rollover.diagnosis.result import Diagnosis, Named
from rollover.diagnosis.selection.explanation import Explanation, with_conditions_refitted
from rollover.diagnosis.settings import SETTINGS
from rollover.diagnosis.statements import is_null_effect
from rollover.effects import EFFECTS

NAMING = ("parameter", "sensor", "missing-physics")  # verdicts that name effects
TUNING = SETTINGS.report.invariants


def at_bounds(effects: Sequence[Named]) -> set[str]:
    """Ids of effects with a number at an end of its range: the search ended there, not the effect.

    A shape that few recordings tell from the strength may lie there, and the least strength of what acts at that
    already.
    """
    return {
        e.id
        for e in effects
        if any(i.at_bound and not _may_end(e.id, name, i.value) for name, i in e.parameters.items())
    }


def hard_by_bounds(fitted: Fitted) -> set[str]:
    """The same of a fit, and where a strength ended hard by an end, as a search that is led there does."""
    return {
        c.id
        for c, own in with_slices(fitted.candidates)
        for (name, search), x in zip(c.search.items(), fitted.x[own], strict=True)
        if not TUNING.hard_by < x < 1.0 - TUNING.hard_by and not _may_end(c.id, name, physical(x, search))
    }


def _may_end(id: str, name: str, value: float) -> bool:
    """Whether a number of an effect may be at that end of its range: it is a shape, or its least acts all the same."""
    kind = EFFECTS[id]
    acts_there = kind.is_discontinuous and name in kind.search and coordinate(value, kind.search[name]) < 0.5
    return name in kind.secondary or acts_there


def rejected_effects(
    problem: Problem, found: Explanation, effects: Sequence[Named], groups: Groups, *, in_doubt: bool
) -> set[str]:
    """Ids of effects that are no finding: predicting no better than without them, or at a bound and worse than a rival.

    What is at a bound beside the first effect bends to what the form of that one leaves. Where `in_doubt`, all that are
    at a bound or maybe null. Of an effect alone the misfit itself is asked whether it may be null, slopes only of one
    beside others.
    """
    if not effects:
        return set()
    after = held_out(found.fitted, groups)
    if after.total >= held_out(found.base, groups).total:
        return {e.id for e in effects}
    if len(effects) > 1 and not problem.effort.is_ensemble:  # of full runs what a step adds scatters
        _, each = shares(problem, found, groups)
        if worse := {key.partition(":")[0] for key, share in each.items() if share.share <= 0.0}:
            return worse
    if not in_doubt:
        first = found.first
        chi2, rivals = float(after.chi2.sum()), first.rivals if first is not None else ()
        better = any(not is_at_bound(f) and float(held_out(f, groups).chi2.sum()) < chi2 for f in rivals)
        leads = effects[0].id if first is None or len(effects) == 1 else first.fitted.candidates[-1].id
        beside = (hard_by_bounds(found.fitted) & {e.id for e in effects}) - {leads}
        return beside | (at_bounds(effects) if better else set())
    null = {e.id for e in effects if may_be_null(e)}
    if len(effects) == 1 and null and is_clear_of_null(problem, found.fitted):
        null = set()
    return at_bounds(effects) | null


def may_be_null(effect: Named) -> bool:
    """Whether its interval holds its null; what does something at its least strength already is there all the same."""
    return is_null_effect(effect) and not EFFECTS[effect.id].is_discontinuous


def holds_null(effect: Named) -> bool:
    """Whether the interval of each of its numbers that has a null holds that."""
    nulls = {n: EFFECTS[effect.id].null.get(n) for n in effect.parameters}
    known = {n: v for n, v in nulls.items() if isinstance(v, (int, float))}
    return bool(known) and all(effect.parameters[n].low <= v <= effect.parameters[n].high for n, v in known.items())


def is_clear_of_null(problem: Problem, fitted: Fitted) -> bool:
    """Whether the misfit of an effect alone rises by what ends an interval before its null is reached.

    An interval by slopes may hold the null of a number whose misfit is steep on that side. Where a run is dear it is
    not looked at.
    """
    return problem.effort.is_ensemble or null_side(problem, fitted) is not None


def null_side(problem: Problem, fitted: Fitted) -> tuple[str, float, bool] | None:
    """The number that says how strong an effect alone is, where its interval ends towards its null, and if from below.

    By halving the way with all else fitted anew; None where even next to the null too little more is left.
    """
    c = fitted.candidates[-1]
    name, null = strength_parameter(c.id, c.search)
    search, k = c.search[name], list(c.search).index(name)
    at = fitted.x[k]
    end = coordinate(null, search) if search.scale == "linear" or null > 0.0 else 0.0
    if not np.isfinite(end):
        return None
    count = sum(b.residual.size for b in fitted.blocks)
    due = (
        SETTINGS.inference.local_quadratic.normal_quantile**2
        * max(1.0, fitted.chi2 / count)
        * problem.samples_per_error
    )
    shifts, others = [b.shift for b in fitted.blocks], [v for j, v in enumerate(fitted.x) if j != k]

    def is_met(x: float) -> bool:
        there = problem.fit(
            held_at(fitted, k, x),
            others,
            rounds=SETTINGS.inference.intervals.held_rounds,
            shifts=shifts,
            width=1,
        )
        return there is None or there.chi2 - fitted.chi2 < due

    beyond, inside = min(max(end, 0.0), 1.0), at
    if is_met(beyond):
        return None
    for _ in range(TUNING.halvings):
        middle = 0.5 * (inside + beyond)
        inside, beyond = (middle, beyond) if is_met(middle) else (inside, middle)
    return name, physical(beyond, search), beyond < at


def clear_of_null(problem: Problem, found: Explanation, effects: Sequence[Named]) -> tuple[Named, ...]:
    """Effects, one alone with an interval that ends before its null where it would hold that by slopes."""
    if len(effects) != 1 or problem.effort.is_ensemble or not may_be_null(effects[0]):
        return tuple(effects)
    side = null_side(problem, found.fitted)
    if side is None:
        return tuple(effects)
    name, end, is_low = side
    own = effects[0].parameters[name]
    own = replace(own, low=end) if is_low else replace(own, high=end)
    return (replace(effects[0], parameters={**effects[0].parameters, name: own}),)


def next_best(
    problem: Problem, found: Explanation, out: Collection[str], groups: Groups, phases: Phases
) -> Explanation:
    """The explanation by the best single effect that is not `out`, if it takes a good part of what the best does."""
    first = found.first
    if first is None:
        return found.refused()
    start = float(held_out(first.base, groups).chi2.sum())
    chi2 = {f.label: float(held_out(f, groups).chi2.sum()) for f in first.rivals}
    most = max((start - v for v in chi2.values()), default=0.0)
    able = [
        f
        for f in first.rivals
        if f.candidates[-1].id not in out and not is_at_bound(f) and start - chi2[f.label] > TUNING.rival_share * most
    ]
    if not able:
        return found.refused()
    one = replace(first, fitted=min(able, key=lambda f: chi2[f.label])).again(problem)
    one, after = with_conditions_refitted(problem, one, mismatch_of(problem.dataset, one.fitted.blocks, phases), phases)
    return replace(found, parts=(one,), fitted=one.fitted, after=after, first=one)


def is_noise_alone(problem: Problem, found: Explanation, groups: Groups) -> bool:
    """Whether what is significant is 1.0 times the noise, or nearly that and lies before the first contact.

    Neither is a mismatch: a noise with a slow part below a white one looks so. What is more acts in the fall.
    """
    total = held_out(found.base, groups).total
    if total < TUNING.at_noise:
        return True
    pairs = zip(found.before.cells, found.before.adjusted, strict=True)
    significant = [c for c, p in pairs if p < SETTINGS.inference.lack_of_fit.p_value]
    early = all(c.end <= problem.dataset[c.recording].simulator.contact for c in significant)
    return total < SETTINGS.selection.forward_step.nearly_noise and bool(significant) and early


def checked(found: Diagnosis) -> Diagnosis:
    """The diagnosis with the invariants that were checked, and those of them that it breaks."""
    detectable = {name: v for name, v in found.smallest_detectable.items() if isfinite(v) and v > 0.0}
    found = replace(found, smallest_detectable=detectable)
    before, after = (s["held_out"].nrmse if "held_out" in s else None for s in (found.before, found.after))
    gains = before is None or after is None or not found.effects or after < before
    rules = {
        "no value at a bound is a finding": not at_bounds(found.effects),
        "no interval of a finding holds its null": not any(
            holds_null(e) and not EFFECTS[e.id].is_discontinuous for e in found.effects
        ),
        "held-out recordings are predicted no worse than without": gains,
        "verdict and effects agree": (found.verdict in NAMING) == bool(found.effects),
        "no effect of consequence to no load leads to a verdict": not found.effects
        or any(
            e.moves is None or e.moves >= SETTINGS.report.grades.immaterial or e.kind == "sensor" for e in found.effects
        ),
        "smallest_detectable is above 0": all(v > 0.0 for v in found.smallest_detectable.values()),
        "unexplained is more than 1.0 times the noise, or shown without a simulation": found.verdict != "unexplained"
        or found.by_itself
        or not found.where
        or before is None
        or before >= TUNING.at_noise,
    }
    return replace(found, checked=tuple(rules), broken=tuple(name for name, holds in rules.items() if not holds))
