"""Probabilities over names, "nothing" and "not-listed" among them, by what each explanation leaves: (D23) to (D25)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.data.stretches import channel_of
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted
from rollover.diagnosis.inference.discrepancy import MEDIAN, SCALES, SPREAD, residual_rms
from rollover.diagnosis.selection.explanation import Explanation, strongest
from rollover.diagnosis.settings import SETTINGS

Array = NDArray[np.float64]
Left = Mapping[str, float]  # rms that an explanation leaves of each channel, share of its range
NOTHING, NOT_LISTED = "nothing", "not-listed"
TUNING = SETTINGS.report.probabilities
DRAWS = SETTINGS.inference.discrepancy.draws
COARSE = SCALES[:: TUNING.every]  # of two scales at once every few will do: the integrand is smooth


def probabilities(
    problem: Problem,
    tried: Explanation,
    found: Explanation,
    candidates: int,
    *,
    is_noise: bool,
    p_value: float = 1.0,
) -> dict[str, float]:
    """Probability of each name to be what is mainly missing, the largest first; they add up to one.

    None where nothing but falls was recorded, and more than noise is left: (D24) is of what comes after a contact.
    `tried` is what competed, `found` what was decided on, `candidates` how many effects could act. `is_noise` says that
    what `found` leaves is noise: samples tell then, else one draw of a discrepancy for all recordings.
    `p_value` is that of the best effect's gain on conditions held out, by (D21).
    """
    if not is_noise and not residual_rms(problem, tried.base):
        return {}
    log_evidence = _beside_noise(problem, tried, found) if is_noise else _beside_discrepancy(problem, tried)
    prior = {NOTHING: TUNING.nothing, NOT_LISTED: TUNING.not_listed}
    listed = 1.0 - TUNING.nothing - TUNING.not_listed
    names, scores = [], []
    for name, score in log_evidence:
        names.append(name)
        scores.append(score + np.log(prior.get(name, listed / max(candidates, 1))))
    scores[0] = min(scores[0], most_for_nothing(p_value, scores[1:]))
    weight = np.exp(np.array(scores) - max(scores))
    weight /= weight.sum()
    summed: dict[str, float] = {}
    for name, w in zip(names, weight, strict=True):
        summed[name] = summed.get(name, 0.0) + float(w)
    if is_noise:
        # what no table holds is seldom met down to noise by what one holds, and as seldom hidden in it
        met = TUNING.not_listed * TUNING.met_by_chance
        missed = met / (met + 1.0 - TUNING.not_listed)
        summed = {name: (1.0 - missed) * p for name, p in summed.items()} | {NOT_LISTED: missed}
    return dict(sorted(summed.items(), key=lambda one: -one[1]))


def _beside_noise(problem: Problem, tried: Explanation, found: Explanation) -> Iterable[tuple[str, float]]:
    """Name and log evidence of each explanation by Schwarz's criterion, a datum each sample, (D23)."""
    base, first = tried.base, tried.first
    count = sum(b.residual.size for b in base.blocks)
    fits = list(first.rivals) if first is not None else []
    least = min(f.chi2 for f in (base, found.fitted, *fits))
    dispersion = max(1.0, least / count)

    def evidence(gain: float, numbers: int) -> float:
        return 0.5 * (gain / dispersion - numbers * float(np.log(count)))

    every = [(NOTHING, 0.0)]
    if first is None:  # nothing was fitted: what a look says that it would gain
        every += [(key.partition(":")[0], evidence(score, 1)) for key, score in tried.scored.scores.items()]
    every += [(f.candidates[-1].id, evidence(base.chi2 - f.chi2, len(f.x))) for f in fits]
    if len(found.fitted.effects) > 1:
        name = strongest(problem, found.base, found.fitted).id
        every.append((name, evidence(base.chi2 - found.fitted.chi2, len(found.fitted.x))))
    return every


def _beside_discrepancy(problem: Problem, tried: Explanation) -> Iterable[tuple[str, float]]:
    """Name and log evidence of each explanation by what it leaves of each channel, (D24)."""
    left = residual_rms(problem, tried.base)
    yield NOTHING, log_evidence(problem, tried.base)
    yield NOT_LISTED, sum(log_touched(v, resolution(problem, c)) for c, v in left.items())
    for f in tried.first.rivals if tried.first is not None else ():
        yield f.candidates[-1].id, log_evidence(problem, f)


def most_for_nothing(p_value: float, others: Sequence[float]) -> float:
    """The most that a p-value leaves of the log weight of "nothing", by those of all `others`, (D25).

    The gain of the best effect on conditions held out tells more of "nothing" than what is left of each channel does.
    """
    if not 0.0 < p_value < np.exp(-1.0):
        return np.inf if p_value > 0.0 else -np.inf
    bound = np.log(-np.e * p_value * np.log(p_value))
    return float(np.logaddexp.reduce(others) + np.log(TUNING.nothing / (1.0 - TUNING.nothing)) + bound)


def log_evidence(problem: Problem, fitted: Fitted) -> float:
    """Log evidence of a fit beside a discrepancy that is one draw for all recordings, (D24); 0 where none acts."""
    left = residual_rms(problem, fitted)
    usual = sum(log_usual(v, resolution(problem, c)) for c, v in left.items())
    return usual - 0.5 * len(fitted.x) * float(np.log(DRAWS * len(left))) if left else 0.0


def credible(problem: Problem, fits: Sequence[Fitted]) -> list[Fitted]:
    """The fewest of some fits that hold the right one with 95 %, were it one of them, the most probable first."""
    score = np.array([log_evidence(problem, f) for f in fits])
    weight = np.exp(score - score.max())
    order = np.argsort(-weight, kind="stable")
    held = np.cumsum(weight[order]) / weight.sum()
    return [fits[k] for k in order[: int(np.searchsorted(held, TUNING.credible)) + 1]]


def resolution(problem: Problem, channel: str) -> float:
    """Least rms of a channel, share of its range, that is told from noise: by the standard error of that's power."""
    every = [s for e in problem.dataset for s in e.signals if s.channel == channel_of(channel)]
    those = [s for s in every if s.key == channel] or every
    power = float(np.mean([(s.noise / s.span) ** 2 for s in those]))
    return float(np.sqrt(power * np.sqrt(2.0 / sum(s.rows.size for s in those))))


def log_usual(left: float, told: float) -> float:
    """Log probability of an rms that is left by an explanation that lacks nothing, over all discrepancies, (D17)."""
    return float(np.log(np.sum(_prior(SCALES, MEDIAN, SPREAD) * _likelihood(left, told, SCALES))))


def log_touched(left: float, told: float) -> float:
    """The same by one that lacks an effect, of which one cannot say whether it touches the channel, and how far."""
    low, high = TUNING.effect_range
    spread = float(np.log(high / low)) / (2.0 * SETTINGS.inference.discrepancy.normal_quantile)
    usual, wide = _prior(COARSE, MEDIAN, SPREAD), _prior(COARSE, float(np.sqrt(low * high)), spread)
    both = np.hypot(COARSE[:, None], COARSE[None, :])
    touched = float(np.sum(usual[:, None] * wide[None, :] * _likelihood(left, told, both)))
    return float(np.log(0.5 * touched + 0.5 * np.exp(log_usual(left, told))))


def _prior(scales: Array, median: float, spread: float) -> Array:
    weight = np.exp(-0.5 * (np.log(scales / median) / spread) ** 2)
    return np.asarray(weight / weight.sum())


def _likelihood(left: float, told: float, scales: Array) -> Array:
    power = scales**2 + told**2
    return np.asarray(power ** (-0.5 * DRAWS) * np.exp(-0.5 * DRAWS * (left**2 + told**2) / power))
