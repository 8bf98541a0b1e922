"""How much an explanation explains: shares of the held-out mismatch with intervals, and the grade of the answer."""

from __future__ import annotations

import time as clock
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.fit.cross_validation import Groups, held_out
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted
from rollover.diagnosis.fit.parameterisation import Candidate, strength_parameter, with_slices
from rollover.diagnosis.result import Answer, Diagnosis, Named, Share, Verdict
from rollover.diagnosis.selection.explanation import Explanation
from rollover.diagnosis.settings import SETTINGS
from rollover.diagnosis.statements import noise
from rollover.effects import EFFECTS

Array = NDArray[np.float64]
TUNING = SETTINGS.report.grades
POWER = SETTINGS.report.power
LOADS = ("force", "moment", "acceleration")  # in the names of channels that are loads, or tell one


def shares(problem: Problem, found: Explanation, groups: Groups) -> tuple[Share | None, dict[str, Share]]:
    """Share of the held-out mismatch that all effects explain together, and each of them beside the others by key.

    1 - (L_after - N)/(L_before - N) with L the held-out sums of squares, N what noise alone leaves of them, (D20).
    """
    whole = share_of(problem, found.base, found.fitted, groups) if found.parts else None
    if whole is None:
        return None, {}
    if len(found.parts) == 1:
        return whole, {found.parts[0].fitted.candidates[-1].key: whole}
    due = _due(problem, found.base, groups)
    each = {}
    for step in found.parts:
        without, with_ = held_out(step.base, groups).chi2, held_out(step.fitted, groups).chi2
        each[step.fitted.candidates[-1].key] = jackknifed(without - with_, due, groups)
    return whole, each


def share_of(problem: Problem, base: Fitted, fitted: Fitted, groups: Groups) -> Share | None:
    """Share of the held-out mismatch of a base that a fit explains, (D20); None where noise leaves as much."""
    return share_beyond(problem, base, base, fitted, groups)


def share_beyond(problem: Problem, base: Fitted, one: Fitted, other: Fitted, groups: Groups) -> Share | None:
    """Share of the held-out mismatch of a base that another fit explains beyond one, as `share_of`."""
    due = _due(problem, base, groups)
    if float(np.sum(due)) <= 0.0:
        return None
    return jackknifed(held_out(one, groups).chi2 - held_out(other, groups).chi2, due, groups)


def _due(problem: Problem, base: Fitted, groups: Groups) -> Array:
    """What a base leaves of each recording held out beyond what noise does, (recordings,)."""
    noise = np.array([_noise_sum_of_squares(e) for e in problem.dataset])
    return np.asarray(held_out(base, groups).chi2 - noise)


def jackknifed(gained: Array, due: Array, groups: Groups, numbers: int = 1) -> Share:
    """Ratio sum(gained)/sum(due) of recordings (n,) with an interval by what each group leaves of it.

    `numbers` were fitted to the groups, each of which takes a degree of freedom. The linearised jackknife (Cochran,
    Sampling Techniques, 1977, 6.4): where nearly all is due in one group, the ratio of the others is of next to
    nothing, and says nothing of the whole.
    """
    from scipy.special import stdtrit

    share = float(gained.sum() / due.sum())
    deviations = np.array([float(np.sum(gained[list(g)] - share * due[list(g)])) for g in groups])
    m = deviations.size
    if m < 1 + numbers:
        return Share(share=min(share, 1.0), low=-np.inf, high=1.0)
    error = float(np.sqrt(m / (m - numbers) * np.sum(deviations**2)) / due.sum())
    wide = float(stdtrit(m - numbers, TUNING.one_sided_confidence)) * error
    return Share(share=min(share, 1.0), low=share - wide, high=min(share + wide, 1.0))


def _noise_sum_of_squares(e: Dataset) -> float:
    """Sum of squares that the noise alone leaves of a recording beside a discrepancy."""
    return float(sum(s.rows.size * min(s.noise / s.sigma, 1.0) ** 2 for s in e.signals))


def with_shares(
    problem: Problem, found: Explanation, effects: Sequence[Named], groups: Groups
) -> tuple[tuple[Named, ...], Share | None]:
    """Effects with the share of the mismatch that each explains and how far it moves loads, and the share of all."""
    whole, each = shares(problem, found, groups)
    # where a run is dear, what was simulated without an effect stands for the others as they are
    bases = {s.fitted.candidates[-1].key: s.base for s in found.parts} if problem.effort.is_ensemble else {}
    with_grades = []
    for k, (c, own) in enumerate(with_slices(found.fitted.candidates)):
        others = [o for j, o in enumerate(found.fitted.candidates) if j != k]
        x = [v for j, v in enumerate(found.fitted.x) if not own.start <= j < own.stop]
        if c.key in bases:
            others, x = list(bases[c.key].candidates), list(bases[c.key].x)
        named = [e for e in effects if (e.id, e.channel) == (c.id, c.channel)]
        moves = moved(problem, found.fitted, others, x) if c.kind != "sensor" and named else None
        with_grades += [replace(e, explains=each.get(c.key), moves=moves) for e in named]
    rank = {(e.id, e.channel): n for n, e in enumerate(effects)}
    return tuple(sorted(with_grades, key=lambda e: rank[e.id, e.channel])), whole


def moved(problem: Problem, fitted: Fitted, others: Sequence[Candidate], x: Sequence[float]) -> float | None:
    """The most by which a fit's loads differ from those of the `others` at x, of a load's peak; None of no load."""
    most: float | None = None
    for r, (e, block) in enumerate(zip(problem.dataset, fitted.blocks, strict=True)):
        a = problem.raw(r, fitted.candidates, fitted.x, block.shift)
        b = problem.raw(r, others, x, block.shift)
        if a is None or b is None:
            continue
        for s, part in e.spans():
            peak = float(np.max(np.abs(a[part])))
            if is_load(s.channel) and peak > 0.0:
                most = max(most or 0.0, float(np.quantile(np.abs(a[part] - b[part]), TUNING.load_quantile)) / peak)
    return most


def answer_of(verdict: Verdict, grade: Answer, p_value: float, *, slight: bool, is_beside: bool) -> Answer:
    """The answer of a diagnosis by its verdict, and by the `grade` of the effects that it names.

    `slight` are effects of no consequence; what is left beside a discrepancy (`is_beside`) is nothing.
    """
    if verdict == "no-mismatch":
        return (
            "immaterial"
            if slight or (p_value < SETTINGS.inference.lack_of_fit.p_value and not is_beside)
            else "nothing"
        )
    if verdict in ("unexplained", "cannot-tell"):
        return "unexplained" if verdict == "unexplained" else "cannot-tell"
    return grade


def is_load(channel: str) -> bool:
    """Whether a channel is a load, or tells one."""
    return any(name in channel.rsplit("/", 1)[-1] for name in LOADS)


def is_immaterial(effect: Named) -> bool:
    """Whether an effect of the body or the ground is there, and of no consequence to any load."""
    return effect.kind != "sensor" and effect.moves is not None and effect.moves < TUNING.immaterial


def graded(
    effects: Sequence[Named], whole: Share | None, *, is_beside: bool, remains: bool
) -> tuple[Answer, tuple[Named, ...]]:
    """The answer, and the effects with theirs; `is_beside` an estimated discrepancy, `remains` says if more is left.

    Whole: noise is left. Likeness: its family cannot be told from another, or beside a discrepancy, where more than
    noise is left, so that its form is not quite that of the recordings. Part: structure is left that is more.
    """
    if effects and all(is_immaterial(e) for e in effects):
        return "immaterial", tuple(replace(e, answer="immaterial") for e in effects)
    if remains and whole is not None and whole.share < TUNING.half_share:
        return "unexplained", tuple(replace(e, answer="unexplained") for e in effects)
    alike = any(e.indistinguishable_from for e in effects)
    answer: Answer = "part" if remains else "likeness" if alike or is_beside else "whole"
    return answer, tuple(replace(e, answer="immaterial" if is_immaterial(e) else answer) for e in effects)


def is_underpowered(detectable: Mapping[str, float]) -> bool:
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
    return blind > POWER.blind_share * len(typical) if acts else blind == len(typical)


def cannot_tell(
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
