"""When a gain is more than chance: the score of the best of all candidates against its null distribution.

Each candidate looked at in a few places beside what is held already gives directions d in the space of the whitened
samples, freed of what the time shifts and the effects already held explain. Where runs depend on chance after an
impact, what it does before is a direction of its own. On noise alone the gain of a direction is
z^2, z = d'n/|d|, and the best of all is max z^2: drawn from N(0, G), G the matrix of the directions' cosines, without a
single simulation. What is compared with it is the same maximum for the misfit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.fit.finite_differences import Point
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted, ResidualBlock, without_shift_direction
from rollover.diagnosis.fit.parameterisation import (
    Candidate,
    followed,
    is_limit,
    null_of,
)
from rollover.diagnosis.fit.tasks import ParallelMap, serial_map
from rollover.diagnosis.noise.ensemble import gained
from rollover.diagnosis.settings import SETTINGS

Array = NDArray[np.float64]
ScanPoint = tuple[str, tuple[float, ...]]  # a candidate's key, and coordinates of it
TUNING = SETTINGS.selection.score_test
PAIRS = SETTINGS.selection.pair_score


@dataclass(frozen=True, kw_only=True)
class ScoreTest:
    """The best score of all candidates, each one's own by key, the null (draws,), and the strength that would show.

    `starts` are the places where a fit may begin, by key, the best first: the directions that score most, followed as
    far as the misfit goes along them. Thresholds have no such way and are not in it. `only` are the recordings that all
    candidates were looked at in; empty for all. `leading` are candidates to be tried whatever they score, and `far`
    where some of them begin that have to be strong. `both` are two that may gain much together, and where they begin,
    the best pair first.
    """

    score: float
    scores: Mapping[str, float]
    null: Array
    detectable: Mapping[str, float]
    starts: Mapping[str, tuple[tuple[float, ...], ...]] = field(default_factory=dict)
    only: tuple[int, ...] = ()
    leading: tuple[str, ...] = ()
    far: Mapping[str, tuple[tuple[float, ...], ...]] = field(default_factory=dict)
    points: Mapping[str, tuple[tuple[float, ...], ...]] = field(default_factory=dict)
    both: tuple[tuple[ScanPoint, ScanPoint], ...] = ()

    @property
    def best(self) -> str:
        """Key of what scored most, or nothing."""
        return max(self.scores, key=lambda key: self.scores[key], default="")

    def ranked(self, candidates: Sequence[Candidate]) -> list[Candidate]:
        """Candidates by score, the best first; before each of the first ones the next of those that are `leading`."""
        by_score = sorted(candidates, key=lambda c: -self.scores.get(c.key, 0.0))
        leading = [c for key in self.leading for c in by_score if c.key == key]
        joined = [c for both in zip(leading, by_score, strict=False) for c in both]
        return list({c.key: c for c in (*joined, *by_score)}.values())

    def p_value(self, dispersion: float = 1.0) -> float:
        """p-value of the best score; `dispersion` is what is left per sample where no explanation leaves noise."""
        return p_value(self.score / max(dispersion, 1.0), self.null)


def score_test(
    problem: Problem,
    base: Fitted,
    candidates: Sequence[Candidate],
    only: Sequence[int] | None = None,
    beside: Fitted | None = None,
    parallel_map: ParallelMap[Problem] = serial_map,
) -> ScoreTest:
    """Score every candidate beside the base, in all recordings or `only` some, from the base's own time shifts.

    Directions are what candidates move `beside` another fit, where that is given: the null holds for any directions.
    `parallel_map` works them off.
    """
    at, use = beside or base, list(range(len(base.blocks))) if only is None else list(only)
    blocks = [base.blocks[r] for r in use]
    misfit = np.concatenate(
        [without_shift_direction((b.residual + b.shift * b.slope)[:, None], b)[:, 0] for b in blocks]
    )
    held = np.concatenate([without_shift_direction(b.J, b) for b in blocks]) if base.x else np.zeros((misfit.size, 0))
    own, _ = np.linalg.qr(held)
    columns, seen_at, sizes = [], [], []
    quiet = _before_the_impact(problem, use)
    problem.made_ahead((r, (*at.candidates, c), (*at.x, *x)) for c in candidates for x in c.scan_points() for r in use)
    directions = partial(_directions, at=(at.candidates, at.x), blocks=base.blocks, use=tuple(use))
    for c, found in zip(candidates, parallel_map(problem, directions, candidates), strict=True):
        for x, d in found:
            parts = [(d, TUNING.least_direction)]
            if c.kind != "sensor" and quiet is not None:
                parts.append((d * quiet, TUNING.visible))
            for part, least in parts:
                way = part - own @ (own.T @ part)
                size = float(np.sqrt(way @ way))
                if size > least:
                    columns.append(way / size)
                    seen_at.append((c, x))
                    sizes.append(size)
    if not columns:
        return ScoreTest(score=0.0, scores={}, null=np.zeros(TUNING.draws), detectable={})
    D = np.stack(columns, axis=1)
    misfit = misfit - own @ (own.T @ misfit)
    along, scores = _best_amplitude(misfit, D, blocks)
    scores = scores / (1.0 + _ensemble_variance(problem, blocks, use, D))
    if any(problem.dataset[r].perturbed for r in use):
        scores = scores / _birge_ratio(misfit, D, [b.residual.size for b in blocks])
    detectable: dict[str, float] = {}
    own_best: dict[str, float] = {}
    ways: dict[str, list[tuple[float, ...]]] = {}
    points: dict[str, list[tuple[float, ...]]] = {}
    for k in np.argsort(-scores, kind="stable"):
        c, x = seen_at[k]
        shows = _visible(c, x, sizes[k])
        if shows is not None:
            detectable[c.key] = (max if is_limit(c) else min)(shows, detectable.get(c.key, shows))
        own_best.setdefault(c.key, float(scores[k]))
        if x not in (seen := points.setdefault(c.key, [])):
            seen.append(x)
        start = followed(c, x, float(along[k]) / sizes[k])
        if start is not None and len(ways.setdefault(c.key, [])) < TUNING.ways:
            ways[c.key].append(start)
    cosines = D.T @ D
    both = []
    for pair in [] if problem.effort.is_ensemble else best_direction_pairs(along, cosines, [c.key for c, _ in seen_at]):
        one, other = (
            _scaled_start(*seen_at[k], far / sizes[k]) for k, far in zip(pair.columns, pair.along, strict=True)
        )
        both.append((one, other))
    return ScoreTest(
        score=float(scores.max()),
        scores=own_best,
        null=null_from_gram(cosines),
        detectable=detectable,
        starts={key: tuple(each) for key, each in ways.items()},
        only=tuple(only or ()),
        points={key: tuple(each[: TUNING.close_points]) for key, each in points.items()},
        both=tuple(both),
    )


def _before_the_impact(problem: Problem, use: Sequence[int]) -> Array | None:
    """1 for the stacked samples before runs depend on chance, 0 after; None where they never do.

    What an effect does there is the effect's alone; beyond, one run's difference is chance to a large part.
    """
    stacked = np.concatenate([problem.dataset[r].early for r in use]).astype(float)
    return None if stacked.all() or not stacked.any() else stacked


def _scaled_start(c: Candidate, x: tuple[float, ...], factor: float) -> ScanPoint:
    """Where a direction leads: `factor` times as strong as at x, or x itself where there is no zero to go from."""
    return c.key, followed(c, x, factor) or x


def _best_amplitude(misfit: Array, D: Array, blocks: Sequence[ResidualBlock]) -> tuple[Array, Array]:
    """How far along each unit direction (n, m) is best, (m,), and what that gains, (m,), noise units.

    z and z^2, z = d'n, where all samples count in full. Where recordings diverged more may be gained further
    on (D12): as far as each of them asks for is tried.
    """
    along = D.T @ misfit
    if all(b.heavy_tail is None for b in blocks):
        return along, along**2
    tried, parts = [along], []
    for b, whole in zip(blocks, _stacked([b.residual.size for b in blocks]), strict=True):
        every = slice(None)
        cells = (
            [(1.0, every)]
            if b.heavy_tail is None
            else [(1.0, ~b.heavy_tail.late), (b.heavy_tail.slope, b.heavy_tail.late)]
        )
        for slope, rows in cells:
            d, w = D[whole][rows], misfit[whole][rows]
            pull, size = d.T @ w, np.sum(d**2, axis=0)
            parts.append((slope, pull, size))
            tried.append(pull / np.maximum(size, 1e-12))
    gains = np.array([sum(gained(2.0 * a * pull - a**2 * size, slope) for slope, pull, size in parts) for a in tried])
    best, each = np.argmax(gains, axis=0), np.arange(along.size)
    return np.array(tried)[best, each], np.maximum(gains[best, each], 0.0)


def _stacked(sizes: Sequence[int]) -> list[slice]:
    """Where recordings of `sizes` rows lie in the stack of all."""
    return [slice(int(end - n), int(end)) for end, n in zip(np.cumsum(sizes), sizes, strict=True)]


def _birge_ratio(misfit: Array, D: Array, sizes: Sequence[int]) -> Array:
    """How far recordings of `sizes` rows disagree on how much there is of each direction (n, m): Birge's ratio, (m,).

    With a_r = d_r'w_r/|d_r|^2 the amplitude by recording r and a that by all, sum_r |d_r|^2 (a_r - a)^2 over the number
    of recordings but one, at least 1. A run that diverged asks for much of some effect, and does so alone.
    """
    parts = _stacked(sizes)
    along = np.array([D[p].T @ misfit[p] for p in parts])
    size = np.array([np.sum(D[p] ** 2, axis=0) for p in parts])
    apart = np.sum(along**2 / np.maximum(size, 1e-12), axis=0) - along.sum(axis=0) ** 2 / size.sum(axis=0)
    return np.asarray(np.maximum(1.0, apart / max(len(parts) - 1, 1)))


def _ensemble_variance(problem: Problem, blocks: Sequence[ResidualBlock], use: Sequence[int], D: Array) -> Array:
    """Variance along each direction (n, m) of what runs that nobody could tell apart differ by, (m,), noise units."""
    many = min((len(problem.dataset[r].perturbed) for r in use), default=0)
    found = np.zeros(D.shape[1])
    for k in range(many):
        perturbed = [
            without_shift_direction(
                block.counted(problem.dataset[r].whitened(problem.dataset[r].perturbed[k]))[:, None], block
            )[:, 0]
            for r, block in zip(use, blocks, strict=True)
        ]
        found += (D.T @ np.concatenate(perturbed)) ** 2
    return np.asarray(SETTINGS.noise.ensemble.few_factor * found / max(many, 1))


def _directions(
    problem: Problem, c: Candidate, *, at: Point, blocks: Sequence[ResidualBlock], use: Sequence[int]
) -> list[tuple[tuple[float, ...], Array]]:
    """Where a candidate is looked at beside a point, and what it moves there in the recordings `use`."""
    points = (*c.scan_points(), *(c.further() if problem.effort.is_ensemble else ()))
    found = [(x, _direction(problem, at, blocks, c, x, use)) for x in points]
    return [(x, d) for x, d in found if d is not None]


def _direction(
    problem: Problem, at: Point, blocks: Sequence[ResidualBlock], c: Candidate, x: Sequence[float], use: Sequence[int]
) -> Array | None:
    """What the candidate at x moves beside a point in the recordings `use`, without time shifts; None if it fails."""
    found = []
    for r in use:
        block = blocks[r]
        d = problem.moved(r, at, ((*at[0], c), (*at[1], *x)), block.shift)
        if d is None:
            return None
        found.append(without_shift_direction(block.counted(d)[:, None], block)[:, 0])
    return np.concatenate(found)


def _visible(c: Candidate, x: Sequence[float], size: float) -> float | None:
    """How far from its null an effect's parameter must be for a trace `visible` times the noise's, by that at x.

    Of a limit its value at x if that shows, else None; so where no value is known to be none.
    """
    name, zero = null_of(c)
    value = c.values(x)[name]
    if zero is not None:
        return abs(value - zero) * TUNING.visible / size
    return value if is_limit(c) and size >= TUNING.visible else None


def null_from_gram(G: Array, draws: int = TUNING.draws, seed: int = 0) -> Array:
    """Largest gain on noise (draws,), sorted, by the scalar products of the directions (m, m)."""
    m = len(G)
    size = np.sqrt(np.maximum(np.diag(G), 1e-300))
    root = np.linalg.cholesky(G / np.outer(size, size) + TUNING.jitter * m * np.eye(m))
    z = np.random.default_rng(seed).standard_normal((draws, m)) @ root.T
    return np.asarray(np.sort(np.max(z * z, axis=1)))


def p_value(gain: float, null: Array) -> float:
    """Share of the null at or above a gain; beyond the draws the tail goes on as that of chi-square."""
    above = int(null.size - np.searchsorted(null, gain))
    if above >= 10:
        return (above + 1) / (null.size + 1)
    from scipy.special import chdtrc

    anchor = float(null[-10])
    return float(10.0 / null.size * chdtrc(1, gain) / max(chdtrc(1, anchor), 1e-300))


@dataclass(frozen=True, kw_only=True)
class Both:
    """Two directions, by their places among all, what they gain together, and how far along each that is."""

    columns: tuple[int, int]
    gain: float
    along: tuple[float, float]


def best_direction_pairs(along: Array, cosines: Array, owners: Sequence[str]) -> list[Both]:
    """The best two directions of each pair of owners, the pair that gains most first.

    With z (m,) the misfit along unit directions and c their cosines (m, m), two gain
    g = (z_i^2 + z_j^2 - 2 c z_i z_j)/(1 - c^2) along a_i = (z_i - c z_j)/(1 - c^2): least squares of two columns. What
    two that are nearly one would gain by their difference is no more than arithmetic.
    """
    z, c = along, np.clip(cosines, -1.0, 1.0)
    rest = 1.0 - c**2
    able = rest > PAIRS.same_direction
    rest = np.where(able, rest, 1.0)
    gains = np.where(able, (z[:, None] ** 2 + z[None, :] ** 2 - 2.0 * c * np.outer(z, z)) / rest, 0.0)
    best: dict[frozenset[str], Both] = {}
    upper = np.triu_indices(z.size, 1)
    for k in np.argsort(-gains[upper], kind="stable"):
        i, j = int(upper[0][k]), int(upper[1][k])
        pair = frozenset((owners[i], owners[j]))
        if len(pair) == 2 and pair not in best:
            far = ((z[i] - c[i, j] * z[j]) / rest[i, j], (z[j] - c[i, j] * z[i]) / rest[i, j])
            best[pair] = Both(columns=(i, j), gain=float(gains[i, j]), along=(float(far[0]), float(far[1])))
            if len(best) == PAIRS.most_pairs:
                break
    return list(best.values())
