"""A law for what no candidate explains: the best few terms of a fixed table, offered only if they predict.

Every set of up to three terms is fitted to the residual force in weak form and judged on conditions left out. The
best sets are then switched on in the simulation, their forces fitted to the recordings themselves, and a law is
offered if leaving out one condition after another it gains more than its standard error allows.

The residual force in weak form is its means over windows of time, without a derivative of what was measured. With
test functions phi_j(t), smooth, positive, zero with three derivatives at both ends, and integral phi_j dt = 1,

    r_j = integral phi_j F_s dt - integral phi_j K'(z; v_s) z dt - m_b1 integral phi_j z'' dt                  (D4)

where integral phi z'' = integral phi'' z: where only the depth was measured the derivatives fall on phi. Without a
load cell F_s = m (g - z''). A law sum_i c_i T_i is linear in the means of its terms, S_ji = integral phi_j T_i dt.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ground.empirical import MOST, TERMS, shape
from ground.law import REFERENCE_AREA, along
from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.fit.cross_validation import held_out
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted
from rollover.diagnosis.fit.parameterisation import Candidate, coordinate
from rollover.diagnosis.inference.bases import motion
from rollover.diagnosis.inference.intervals import intervals
from rollover.diagnosis.result import Law, LawTerm
from rollover.diagnosis.settings import SETTINGS
from rollover.effects import Search
from rollover.effects.empirical import PARTS, Empirical
from rollover.scenario import Scenario
from rollover.spec.initiation import Drop
from rollover.spec.vehicle import Striker

Array = NDArray[np.float64]
TUNING = SETTINGS.inference.residual_law
WEAK_FORM = SETTINGS.inference.weak_form


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


@dataclass(frozen=True, kw_only=True)
class Balance:
    """One recording: means of the residual force, (k,) N; depth (m), rate and touch speed (m/s) at rows (n,)."""

    condition: str
    force: Array
    depth: Array
    speed: Array
    touch: Array
    weights: Array  # (k, n): the means of what is given at the rows

    def terms(self, depth: float, speed: float) -> Array:
        """S of every term of the table, (k, terms), over scales of depth (m) and speed (m/s)."""
        x, u, w = self.depth / depth, self.speed / speed, self.touch / speed
        return self.weights @ np.stack([shape(name, x, u, w) for name in TERMS], axis=1)


def balances(scenarios: Sequence[Scenario], dataset: Sequence[Dataset]) -> list[Balance]:
    """(D4) of each recording that has what it takes, force on the reference face; scenarios under their conditions."""
    found = [_balance(s, e) for s, e in zip(scenarios, dataset, strict=True)]
    return [one for one in found if one is not None]


def _balance(scenario: Scenario, e: Dataset) -> Balance | None:
    striker, start, r = scenario.vehicle, scenario.initiation, e.recording
    if not isinstance(striker, Striker) or not isinstance(start, Drop) or striker.nose == "cone":
        return None
    share, touch = scenario.ground.co_moving_mass.share, float(start.speed)
    state = motion(r, touch / (1.0 + share))
    if state is None:
        return None
    time, z, v, a = state
    rows = np.flatnonzero((z > 0.0) & (v > 0.02 * touch) & (time > 0.0))
    if rows.size < WEAK_FORM.least_rows:
        return None
    rows = rows[rows <= rows[0] + int(np.argmax(np.append(np.diff(rows) > 1, True)))]  # the first way down alone
    if rows.size < WEAK_FORM.least_rows:
        return None
    rows = rows[:: max(1, rows.size // WEAK_FORM.most_rows)]
    t, dt = time[rows], np.gradient(time[rows])
    dispersion, curved = _tests(t)
    weights = dispersion * dt
    area = striker.face_length * striker.face_width / REFERENCE_AREA
    spring = area * along(scenario.ground.law, z[rows], v[rows], speed=touch)
    seen = "striker/acceleration_z" in r.channels
    mean_a = weights @ a[rows] if seen else (curved * dt) @ z[rows]
    if "ground/force_normal" in r.channels:
        force = weights @ np.interp(t, *r.samples("ground/force_normal"))
    else:
        force = striker.mass * (scenario.gravity - mean_a)
    residual = force - weights @ spring - share * striker.mass * mean_a
    return Balance(
        condition=e.condition or e.name,
        force=residual / area,
        depth=z[rows],
        speed=v[rows],
        touch=np.full(rows.size, touch),
        weights=weights,
    )


def _tests(t: Array) -> tuple[Array, Array]:
    """phi and phi'' of the windows at times t, (k, n) each: cos^4 of half a turn, short after the contact."""
    marks = (
        t[0]
        + (t[-1] - t[0]) * np.linspace(0.0, 1.0, WEAK_FORM.windows + 2 * WEAK_FORM.overlap) ** WEAK_FORM.window_power
    )
    centres = marks[WEAK_FORM.overlap : -WEAK_FORM.overlap]
    half = np.minimum(marks[2 * WEAK_FORM.overlap :] - centres, centres - marks[: -2 * WEAK_FORM.overlap])
    wide = half > WEAK_FORM.least_half_width * float(np.median(np.diff(t)))
    centres, half = centres[wide, None], half[wide, None]
    c = np.cos(0.5 * np.pi * np.clip((t[None] - centres) / half, -1.0, 1.0))
    rate = 0.5 * np.pi / half
    scale = 4.0 / (3.0 * half)  # integral of cos^4 over the window: 3/4 half
    dispersion = scale * c**4
    curved = scale * rate**2 * (12.0 * c**2 * (1.0 - c**2) - 4.0 * c**4)
    return dispersion, curved
