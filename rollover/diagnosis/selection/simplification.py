"""What a step leads to where its fit is followed to the end, and whether an effect of fewer numbers ends there too.

Over-flexible are explanations that could fit any curve: as many effects as may be of one sensor or of the soil, or two
that both take another form than their usual one; of one sensor gain and offset make a straight line, and no more.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted, first_effect_last, is_at_bound, without_shift_direction
from rollover.diagnosis.fit.local_search import ended, polish, with_time_shift_search, without_effect
from rollover.diagnosis.fit.parameterisation import Candidate, coordinates, with_slices
from rollover.diagnosis.fit.step import Inquiry, Step
from rollover.diagnosis.fit.tasks import Task
from rollover.diagnosis.inference.lack_of_fit import Mismatch, mismatch_of
from rollover.diagnosis.selection.restarts import continued_from, with_thresholds_traced
from rollover.diagnosis.settings import SETTINGS
from rollover.effects import EFFECTS

TUNING = SETTINGS.selection.simplification
Array = NDArray[np.float64]
STRAIGHT = ("sensor-gain", "sensor-scale", "sensor-bias")
BACK = ("soil-elastic-rebound", "soil-adhesion")  # effects of the soil that act on the way back alone
FLEXIBILITY = SETTINGS.selection.flexibility


def followed(inquiry: Inquiry, found: Step) -> tuple[Step, Mismatch]:
    """A step and what it leaves; where that is little more than noise, its fit followed to the end; never worse.

    Beside a kink, or a sample that a clock carries over a jump, or in the valley that two effects share, a fit may end
    too early. One effect's is followed only if what it leaves is in doubt, or if it is met better with its threshold
    elsewhere.
    """
    problem, phases, old = inquiry.problem, inquiry.phases, found.fitted
    mismatch = mismatch_of(problem.dataset, old.blocks, phases)
    is_near = old.chi2 < SETTINGS.selection.forward_step.nearly_noise**2 * sum(b.residual.size for b in old.blocks)
    if problem.effort.is_ensemble or not is_near:
        return found, mismatch
    if not is_over_flexible(old.effects):  # as they stand these will be refused, however well they fit
        new = with_thresholds_traced(inquiry, old)
        if new.chi2 < old.chi2 or len(old.effects) > 1 or mismatch.p_value < TUNING.full_p_value:
            new = with_time_shift_search(problem, polish(problem, new))
        new = ended(problem, new)
        if new.chi2 < old.chi2:
            found = _with_rivals(inquiry, found.moved_to(new))
            mismatch = mismatch_of(problem.dataset, new.blocks, phases)
    for simple in (simpler, _with_usual_secondary, with_fewer_parameters):
        other = simple(inquiry, found)
        if other is not None:
            found, mismatch = other, mismatch_of(problem.dataset, other.fitted.blocks, phases)
    return found, mismatch


def simpler(inquiry: Inquiry, found: Step) -> Step | None:
    """A step by an effect of fewer numbers that does as well; else None.

    One that its own becomes at an end of its range, as a layer from the surface on is a stiffness; or any where one of
    its own tells nothing, as it stands at such an end. What has fewer numbers is begun beside what stands beside it.
    """
    best, beside, shared = found.fitted, *_shared(found.fitted)
    begun = list(_limiting_effects(inquiry, best))
    if is_at_bound(best):
        able = sorted(found.rivals, key=lambda f: f.chi2)
        able = [f for f in able if len(f.own) < len(best.own) and f.chi2 < found.base.chi2][: TUNING.simpler_rivals]
        begun += [((*beside, f.candidates[-1]), f.own) for f in able]
    shifts = tuple(b.shift for b in best.blocks)
    tasks = [Task(candidates=candidates, start=(*shared, *own), shifts=shifts, width=1) for candidates, own in begun]
    one = min((f for f in inquiry.fits(tasks) if f is not None), key=lambda f: f.chi2, default=None)
    if one is None or not _is_as_good(one, best):
        return None
    return _with_best(one, found)


def _shared(fitted: Fitted) -> tuple[tuple[Candidate, ...], tuple[float, ...]]:
    """What a fit holds beside its last effect, in the forms that it has there, and where that stands."""
    return fitted.candidates[:-1], tuple(fitted.x[: len(fitted.x) - len(fitted.own)])


def _limiting_effects(inquiry: Inquiry, best: Fitted) -> Iterator[tuple[tuple[Candidate, ...], tuple[float, ...]]]:
    """What the last effect of a fit becomes at an end of its range, beside the others, and where that would stand."""
    *others, last = best.candidates
    values, kinds = last.values(best.own), EFFECTS[last.id].becomes
    for c in inquiry.candidates:
        there = {p: values[own] * times for p, (own, times) in kinds.get(c.id, {}).items() if own in values}
        if there.keys() >= c.search.keys() and c.key not in {o.key for o in others}:
            yield (*others, c), coordinates(there, c.search)


def _with_rivals(inquiry: Inquiry, found: Step) -> Step:
    """A step with its nearest rivals begun anew beside what they share with its best, which was followed alone."""
    best, beside, shared = found.fitted, *_shared(found.fitted)
    if len(best.effects) < 2:
        return found
    shifts, near = tuple(b.shift for b in best.blocks), sorted(found.rivals, key=lambda f: f.chi2)[: TUNING.rivals]
    begun = [f for f in near if f is not best]
    tasks = [
        Task(candidates=(*beside, f.candidates[-1]), start=(*shared, *f.own), shifts=shifts, width=1) for f in begun
    ]
    better = {id(f): again for f, again in zip(begun, inquiry.fits(tasks), strict=True) if again is not None}
    rivals = (min(f, better.get(id(f), f), key=lambda one: one.chi2) for f in found.rivals)
    return replace(found, rivals=tuple(rivals))


def _with_usual_secondary(inquiry: Inquiry, found: Step) -> Step | None:
    """A step of several effects with those in their usual shape that need no other beside each other; None if none.

    What had to be bent to do another's work as well is straight again once that stands beside it.
    """
    best, usual = found.fitted, {c.key: c for c in inquiry.candidates}
    varied = [
        k for k, c in enumerate(best.candidates) if c.has_secondary and usual[c.key].search.keys() <= c.search.keys()
    ]
    if len(best.effects) < 2 or not varied:
        return None
    shifts, ways = tuple(b.shift for b in best.blocks), [varied, *([k] for k in varied if len(varied) > 1)]
    tasks = [
        Task(candidates=c, start=x, shifts=shifts, width=1) for c, x in (in_usual_form(best, usual, w) for w in ways)
    ]
    fits = [f for f in inquiry.fits(tasks) if f is not None and _is_as_good(f, best)]
    if not fits:
        return None
    return _with_best(min(fits, key=lambda f: (len(f.x), f.chi2)), found)


def with_fewer_parameters(inquiry: Inquiry, found: Step) -> Step | None:
    """A step by any effect of fewer numbers, but a sensor's, that does as well beside the others; None if none.

    Two thresholds in one place do the work of one and a stiffness: of either. The way there is crooked: all others move
    with it, beside that which does most of the work less far.
    """
    made = (_plainer_last(inquiry, way) for way in _ways(inquiry.problem, found))
    return next((new for new in made if new is not None), None)


def _ways(problem: Problem, found: Step) -> Iterator[Step]:
    """A step, and of two effects of one family, of several numbers each, the same with the first for its last."""
    yield found
    each = found.fitted.effects
    if len(each) == 2 and len({c.family for c in each}) == 1 and all(len(c.search) > 1 for c in each):
        around = first_effect_last(found.fitted)
        base = without_effect(problem, around, around.first + 1)
        if base is not None:
            yield Step(base=base, fitted=around, p_value=found.p_value, rivals=(around,))


def _plainer_last(inquiry: Inquiry, found: Step) -> Step | None:
    best, beside, shared = found.fitted, *_shared(found.fitted)
    held = {c.key for c in best.candidates}
    able = [c for c in inquiry.candidates if c.kind != "sensor" and len(c.search) < len(best.own) and c.key not in held]
    if len(best.effects) < 2 or not able:
        return None
    shifts = tuple(b.shift for b in best.blocks)
    tasks = [
        Task(
            candidates=(*beside, c),
            start=(*shared, *c.scan_points()[0]),
            shifts=shifts,
            rounds=SETTINGS.selection.forward_step.short_rounds,
        )
        for c in able
    ]
    short = sorted((f for f in inquiry.fits(tasks) if f is not None), key=lambda f: f.total)[: TUNING.simpler_effects]
    whole = inquiry.fits([continued_from(f, "fit") for f in short])
    one = min((f for f in whole if f is not None), key=lambda f: f.chi2, default=None)
    if one is None or one.chi2 > SETTINGS.selection.restarts.leading_misfit * best.chi2:
        return None
    one = inquiry.fits([continued_from(one, "polish")])[0] or one
    return _with_best(one, found) if _is_as_good(one, best) else None


def with_mirror_rivals(inquiry: Inquiry, found: Step) -> Step:
    """A step of several effects with what mirrors its last one among its rivals, begun where it would do the same.

    The others have to move for that, so far that no look comes there.
    """
    for new in mirror_images(inquiry, found.fitted, *_shared(found.fitted)):
        known = [f for f in found.rivals if f.candidates[-1].key == new.candidates[-1].key]
        if all(new.chi2 < f.chi2 for f in known):
            others = (f for f in found.rivals if not any(f is one for one in known))
            found = replace(found, rivals=(*others, new))
    return found


def mirror_images(
    inquiry: Inquiry, fitted: Fitted, beside: Sequence[Candidate], shared: Sequence[float]
) -> list[Fitted]:
    """Fits of what mirrors the last effect of a fit beside some others from `shared`, which are led there first."""
    last, shifts = fitted.candidates[-1], tuple(b.shift for b in fitted.blocks)
    begun = list(_mirrors(last, fitted.own, inquiry.free(fitted))) if beside else []
    held = [replace(c, search={}, fixed={**c.fixed, **c.values(own)}) for c, own in begun]
    tasks = [Task(candidates=(c, *beside), start=tuple(shared), shifts=shifts) for c in held]
    led = [(c, own, f) for (c, own), f in zip(begun, inquiry.fits(tasks), strict=True) if f is not None]
    tasks = [
        Task(candidates=(*beside, c), start=(*f.x, *own), shifts=tuple(b.shift for b in f.blocks)) for c, own, f in led
    ]
    return [f for f in inquiry.fits(tasks) if f is not None]


def _mirrors(
    last: Candidate, own: Sequence[float], candidates: Sequence[Candidate]
) -> Iterator[tuple[Candidate, tuple[float, ...]]]:
    """What does the same as an effect beside another stiffness of all the ground, and where it would stand."""
    values = last.values(own)
    for c in candidates:
        there = {p: values[n] ** to for p, (n, to) in EFFECTS[last.id].mirrors.get(c.id, {}).items() if n in values}
        if there and there.keys() >= c.search.keys():
            yield c, coordinates(there, c.search)


def in_usual_form(
    fitted: Fitted, usual: Mapping[str, Candidate], which: Sequence[int]
) -> tuple[tuple[Candidate, ...], tuple[float, ...]]:
    """Effects of a fit, `which` of them in their usual shape, and where they stand."""
    candidates: list[Candidate] = []
    x: list[float] = []
    for k, (c, own) in enumerate(with_slices(fitted.candidates)):
        if k in which:
            values, c = c.values(fitted.x[own]), usual[c.key]
            x += coordinates(values, c.search)
        else:
            x += fitted.x[own]
        candidates.append(c)
    return tuple(candidates), tuple(x)


def _with_best(new: Fitted, found: Step) -> Step:
    """A step with another fit for its best, which is none of its rivals any more, nor is what was of that effect."""
    same = new.candidates[-1].key
    others = (f for f in found.rivals if f is not found.fitted and f.candidates[-1].key != same)
    return replace(found, fitted=new, rivals=(new, *others))


def _is_as_good(simple: Fitted, best: Fitted) -> bool:
    """Whether a fit of fewer numbers leaves hardly more than the best."""
    dispersion = max(1.0, best.chi2 / sum(b.residual.size for b in best.blocks))
    return simple.chi2 < best.chi2 + dispersion * TUNING.chi_square * (len(best.x) - len(simple.x))


def is_a_curve(problem: Problem, fitted: Fitted) -> bool:
    """Whether effects that make a straight line of a channel leave a curve of it, or one that drifts."""
    channels = {str(c.channel) for c in fitted.candidates if c.id in STRAIGHT}
    return any(
        curvature_gain(problem, fitted, channel, term) > FLEXIBILITY.curve_gain
        for channel in sorted(channels)
        for term in (square, drift)
    )


def is_straight_line(candidates: Sequence[Candidate]) -> bool:
    """Whether all of several effects make a straight line of one channel."""
    return len({c.channel for c in candidates}) == 1 and all(c.id in STRAIGHT for c in candidates)


def square(read: Array, time: Array) -> Array:
    """What a sensor of curved characteristic adds to what is read (n,)."""
    del time
    return read * read


def drift(read: Array, time: Array) -> Array:
    """What one adds whose gain changes as it warms, at times (n,) s."""
    return np.asarray(read * (time - time.mean()))


def curvature_gain(
    problem: Problem, fitted: Fitted, channel: str, term: Callable[[Array, Array], Array] = square
) -> float:
    """Gain of a term in what a channel reads, over its range, beside all effects of a fit and the time shifts.

    Of noise alone it is chi-square of one degree of freedom: z = q'e/|q|, q the term, whitened, freed of the fit's
    own directions; less where runs scatter, whose samples count less than their scatter asks for.
    """
    terms, misfits, held = [], [], []
    for r, block in enumerate(fitted.blocks):
        raw = problem.raw(r, fitted.candidates, fitted.x, block.shift)
        if raw is None:
            return 0.0
        e, added = problem.dataset[r], np.zeros_like(raw)
        for signal, part in e.spans():
            if signal.channel == channel:
                added[part] = term(raw[part] / signal.span, e.recording.time[signal.rows])
        own = np.column_stack([block.counted(e.whitened(added)), block.residual, block.J])
        own = without_shift_direction(own, block)
        terms.append(own[:, 0])
        misfits.append(own[:, 1])
        held.append(own[:, 2:])
    q, misfit = np.concatenate(terms), np.concatenate(misfits)
    basis, _ = np.linalg.qr(np.concatenate(held))
    q, misfit = q - basis @ (basis.T @ q), misfit - basis @ (basis.T @ misfit)
    return float((q @ misfit) ** 2 / max(float(q @ q), 1e-300))


def is_over_flexible(candidates: Sequence[Candidate]) -> bool:
    """Whether they draw any curve: as many effects as may be, all of one sensor or of the soil, or two bent ones.

    Two effects of the soil that both take another form than their usual one are curves enough, whatever joins them. The
    soil draws one on the way down and another on the way back.
    """
    subjects = [c.channel or _subject(c) for c in candidates]
    varied = [s for s, c in zip(subjects, candidates, strict=True) if c.has_secondary]
    return (len(candidates) == FLEXIBILITY.most_effects and len(set(subjects)) == 1) or len(set(varied)) < len(varied)


def _subject(c: Candidate) -> str:
    """What an effect is of that is no sensor's."""
    return "way back" if c.id in BACK else "soil" if c.id.startswith("soil-") else c.id


def is_flexible_soil(candidates: Sequence[Candidate]) -> bool:
    """Whether several are of the soil, and one of these takes another shape or form than its usual one."""
    soil = [c for c in candidates if c.id.startswith("soil-")]
    return len(soil) > 1 and any(c.has_secondary for c in soil)
