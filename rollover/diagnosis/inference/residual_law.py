"""A law for what no candidate explains: the best few terms of a fixed table, offered only if they predict.

Every set of up to three terms is fitted to the residual force in weak form and judged on conditions left out. The
best sets are then switched on in the simulation, their forces fitted to the recordings themselves, and a law is
offered if leaving out one condition after another it gains more than its standard error allows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ground.empirical import MOST, TERMS
from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.fit.cross_validation import held_out
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted
from rollover.diagnosis.fit.parameterisation import Candidate, coordinate
from rollover.diagnosis.inference.intervals import intervals
from rollover.diagnosis.inference.weak_form import Balance, balances
from rollover.diagnosis.result import Law, LawTerm
from rollover.diagnosis.settings import SETTINGS
from rollover.effects import Search
from rollover.effects.empirical import PARTS, Empirical
from rollover.scenario import Scenario

Array = NDArray[np.float64]
TUNING = SETTINGS.inference.residual_law


@dataclass(frozen=True, kw_only=True)
class Subset:
    """Places of terms in the table, their forces (N on the reference face), and the held-out squares by condition."""

    terms: tuple[int, ...]
    forces: Array
    left: Array

    @property
    def score(self) -> float:
        """Mean logarithm of what is left."""
        return float(np.mean(np.log(np.maximum(self.left, 1e-300))))


def proposed(
    problem: Problem,
    base: Fitted,
    scenarios: Sequence[Scenario],
    dataset: Sequence[Dataset],
    groups: Sequence[Sequence[int]],
) -> Law | None:
    """The law that predicts held-out conditions best, if any does; `scenarios` under the conditions of `dataset`."""
    best = fitted_law(problem, base, scenarios, dataset, groups)
    if best is None:
        return None
    gains = gains_of(base, best, groups)
    error = float(gains.std(ddof=1) / np.sqrt(gains.size))
    before, after = held_out(base, groups), held_out(best, groups)
    return _law(problem, best, float(gains.mean()), error, before.total, after.total)


def fitted_law(
    problem: Problem,
    base: Fitted,
    scenarios: Sequence[Scenario],
    dataset: Sequence[Dataset],
    groups: Sequence[Sequence[int]],
) -> Fitted | None:
    """The fit of the law that predicts held-out conditions best, if it gains more than its standard error allows."""
    found = balances(scenarios, dataset)
    if len({b.condition for b in found}) < 3 or len(groups) < 3:
        return None
    depth, speed = (float(f"{max(float(getattr(b, name).max()) for b in found):.2g}") for name in ("depth", "speed"))
    fits = []
    for subset in best_subsets(found, depth, speed):
        candidate, x = _candidate(subset, depth, speed)
        fitted = problem.fit(
            (*base.candidates, candidate), (*base.x, *x), shifts=[b.shift for b in base.blocks], width=1
        )
        if fitted is not None:
            fits.append(fitted)
    if not fits:
        return None
    best = min(fits, key=lambda f: held_out(f, groups).total)
    gains = gains_of(base, best, groups)
    gain, error = float(gains.mean()), float(gains.std(ddof=1) / np.sqrt(gains.size))
    return None if gain < max(TUNING.least_law_gain, TUNING.least_errors * error) else best


def gains_of(base: Fitted, fitted: Fitted, groups: Sequence[Sequence[int]]) -> Array:
    """Held-out gain ln(E_before/E_after) of each condition, (conditions,)."""
    before, after = held_out(base, groups).chi2, held_out(fitted, groups).chi2
    return np.array([0.5 * np.log(before[list(g)].sum() / after[list(g)].sum()) for g in groups])


def offered(law: Law | None) -> str:
    """What a sentence on an unexplained mismatch goes on with."""
    if law is None:
        return ""
    return (
        f" A law found by regression predicts them: {law.law}; it leaves {law.after:.2f} times the noise where "
        f"{law.before:.2f} were left."
    )


def best_subsets(found: Sequence[Balance], depth: float, speed: float) -> list[Subset]:
    """The best sets of terms, best first: as many terms as pay, each set judged on conditions left out."""
    conditions = sorted({b.condition for b in found})
    G, h, power = [], [], []
    for condition in conditions:
        S = np.concatenate([b.terms(depth, speed) for b in found if b.condition == condition])
        r = np.concatenate([b.force for b in found if b.condition == condition])
        G.append(S.T @ S)
        h.append(S.T @ r)
        power.append(float(r @ r))
    by_size = [_best_of_size(size, np.array(G), np.array(h), np.array(power)) for size in range(1, MOST + 1)]
    chosen = by_size[0]
    for larger in by_size[1:]:
        gains = 0.5 * np.log(np.maximum(chosen[0].left, 1e-300) / np.maximum(larger[0].left, 1e-300))
        if gains.mean() > max(TUNING.least_term_gain, gains.std(ddof=1) / np.sqrt(gains.size)):
            chosen = larger
    return chosen


def _best_of_size(size: int, G: Array, h: Array, power: Array) -> list[Subset]:
    """The best sets of one size by leaving out one condition after another; G (c, m, m), h (c, m), power (c,)."""
    sets = np.array(list(combinations(range(G.shape[1]), size)))
    rows, columns = sets[:, :, None], sets[:, None, :]
    left = np.empty((len(sets), len(power)))
    for c in range(len(power)):
        solved = _solved(G.sum(axis=0) - G[c], h.sum(axis=0) - h[c], sets)
        own, right = G[c][rows, columns], h[c][sets]
        left[:, c] = power[c] - 2.0 * np.sum(right * solved, axis=1) + np.einsum("si,sij,sj->s", solved, own, solved)
    forces = _solved(G.sum(axis=0), h.sum(axis=0), sets)
    return [
        Subset(terms=tuple(int(t) for t in sets[k]), forces=forces[k], left=left[k])
        for k in np.argsort(np.mean(np.log(np.maximum(left, 1e-300)), axis=1))[: TUNING.simulated_sets]
    ]


def _solved(G: Array, h: Array, sets: NDArray[np.int64]) -> Array:
    A = G[sets[:, :, None], sets[:, None, :]]
    size = np.maximum(np.einsum("sii->si", A), 1e-300)
    A = A + TUNING.ridge * np.einsum("si,ij->sij", size, np.eye(sets.shape[1]))
    return np.asarray(np.linalg.solve(A, h[sets][..., None])[..., 0])


def _candidate(subset: Subset, depth: float, speed: float) -> tuple[Candidate, list[float]]:
    """The law as a candidate, and where its search begins."""
    names = list(TERMS)
    largest = float(np.abs(subset.forces).max())
    fixed: dict[str, Any] = {part: names[t] for part, t in zip(PARTS, subset.terms, strict=False)}
    search, x = {}, []
    for part, force in zip(PARTS, subset.forces, strict=False):
        half_width = TUNING.search_width * abs(float(force)) + 0.3 * largest
        search[f"{part}_force"] = Search(float(force) - half_width, float(force) + half_width)
        x.append(coordinate(float(force), search[f"{part}_force"]))
    family = Empirical.family
    fixed |= {"depth": depth, "speed": speed}
    return Candidate(id=Empirical.id, kind="physics", family=family, search=search, fixed=fixed), x


def _law(problem: Problem, fitted: Fitted, gain: float, error: float, before: float, after: float) -> Law:
    candidate = fitted.candidates[-1]
    parameters = intervals(problem, fitted)[-1]
    settings: dict[str, Any] = dict(candidate.fixed) | {name: i.value for name, i in parameters.items()}
    effect = Empirical(**settings)
    terms = tuple(
        LawTerm(
            term=getattr(effect, part), depends_on=TERMS[getattr(effect, part)].on, force=parameters[f"{part}_force"]
        )
        for part in PARTS
        if f"{part}_force" in parameters
    )
    return Law(
        terms=terms,
        law=effect.law,
        held_out_gain=gain,
        standard_error=error,
        before=before,
        after=after,
        settings=settings,
    )


__all__ = ["best_subsets", "offered", "proposed"]
