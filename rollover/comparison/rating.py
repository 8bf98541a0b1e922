"""How well a simulated signal follows a measured one: ISO/TS 18571, Sprague-Geers, residual, peak, integral.

A pair of signals that a measure is not defined for gets a `NotRateable` with a sentence, never NaN. ISO/TS 18571 wants
both signals at 10 kHz; a stretch longer than `MOST_SAMPLES` of that is rated at a lower rate, which the answer states,
so that the time warp, whose cost and memory grow with the square of the length, stays bounded.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RATE = 10_000.0  # Hz, of ISO/TS 18571
MOST_SAMPLES = 10_000  # the warp then takes 0.5 s and 0.2 GB
SHORTEST = 0.010  # s
FEWEST = 20  # stamps of its own that a stretch needs: below, interpolation would be what is rated

# ISO/TS 18571: half widths of the corridors, largest shift, window of the warp, what scores zero, weights
INNER, OUTER, POWER = 0.05, 0.50, 2
ROUNDING = 1e-12  # of a correlation: what machines may differ by decides nothing
MOST_SHIFT = 0.20
WARP_WINDOW, MAGNITUDE_LIMIT = 0.10, 0.50
SLOPE_LIMIT, SLOPE_SPAN = 2.0, 9
WEIGHTS = {"corridor": 0.4, "phase": 0.2, "magnitude": 0.2, "slope": 0.2}
BY_BADNESS: tuple[Literal["good", "fair", "poor"], ...] = ("good", "fair", "poor")
COVERAGE = 2.0  # sigmas of noise that are allowed for: 95 %
# limits of the standard's grades: recalled, no free statement of them was found; the scores are held against a package
GRADES = ((0.94, "excellent"), (0.80, "good"), (0.58, "fair"))


@dataclass(frozen=True, kw_only=True)
class NotRateable:
    """Why a measure is not defined here, in a sentence."""

    reason: str


@dataclass(frozen=True, kw_only=True)
class Iso18571:
    """Scores from 0 to 1; R = 0.4 Z + 0.2 (E_P + E_M + E_S).

    `shift` s by which the simulated signal comes late; `rate` Hz at which it was rated; `start`, `end` s of the
    stretch.
    """

    overall: float
    corridor: float
    phase: float
    magnitude: float
    slope: float
    grade: str
    shift: float
    rate: float
    start: float
    end: float


@dataclass(frozen=True, kw_only=True)
class SpragueGeers:
    """M: error of magnitude, > 0 where the simulated is larger; P: of phase, 0 to 1; C = sqrt(M^2 + P^2)."""

    magnitude: float
    phase: float
    combined: float


@dataclass(frozen=True, kw_only=True)
class Peak:
    """Largest magnitude, with its sign, and when; errors are simulated less measured.

    `relative_error` is over the measured peak, None where that is zero.
    """

    measured: float
    simulated: float
    relative_error: float | None
    measured_time: float
    simulated_time: float

    @property
    def time_error(self) -> float:
        """How much later the simulated peak comes, s."""
        return self.simulated_time - self.measured_time


@dataclass(frozen=True, kw_only=True)
class Rating:
    """All measures of one pair of signals over one stretch.

    `rms` of the residual, in the signal's unit; `nrmse` is that over the measured range, None for a constant one;
    `over_noise` is that over 1 sigma of the noise, None where that is unknown; `deviation` is the measured signal's RMS
    about its first value; `integral_*` over the samples that
    exist (the impulse of a force, N s; the change of speed of an acceleration, m/s).
    """

    iso18571: Iso18571 | NotRateable
    sprague_geers: SpragueGeers | NotRateable
    samples: int
    rms: float
    nrmse: float | None
    over_noise: float | None
    peak: Peak
    deviation: float
    integral_measured: float
    integral_simulated: float


def rate(
    time: Array, measured: Array, simulated: Array, *, noise: float | None = None, least_rate: float = 0.0
) -> Rating | NotRateable:
    """Rate a simulated signal against a measured one at the same stamps.

    `time`, `measured`, `simulated` (n,), s and SI; NaN where either is missing. `noise` 1 sigma of the measured;
    `least_rate` Hz as in `iso18571`.
    """
    known = np.isfinite(measured) & np.isfinite(simulated)
    n = int(known.sum())
    if n < 2:
        return NotRateable(reason=f"no overlap: {n} samples have both a measured and a simulated value; 2 are needed")
    t, m, s = time[known], measured[known], simulated[known]
    rms = float(np.sqrt(np.mean((s - m) ** 2)))
    span = float(np.ptp(m))
    weight = _weights(time, known)
    return Rating(
        iso18571=iso18571(time, measured, simulated, least_rate=least_rate, most=MOST_SAMPLES),
        sprague_geers=sprague_geers(weight, m, s),
        samples=n,
        rms=rms,
        nrmse=rms / span if span > 0.0 else None,
        over_noise=rms / noise if noise is not None and noise > 0.0 else None,
        peak=peak(t, m, s),
        deviation=float(np.sqrt(np.mean((m - m[0]) ** 2))),
        integral_measured=float(weight @ m),
        integral_simulated=float(weight @ s),
    )


def peak(time: Array, measured: Array, simulated: Array) -> Peak:
    """Peaks of two signals without gaps, each of its own time."""
    i, k = int(np.argmax(np.abs(measured))), int(np.argmax(np.abs(simulated)))
    high = float(measured[i])
    return Peak(
        measured=high,
        simulated=float(simulated[k]),
        relative_error=None if high == 0.0 else (float(simulated[k]) - high) / high,
        measured_time=float(time[i]),
        simulated_time=float(time[k]),
    )


def sprague_geers(weight: Array, measured: Array, simulated: Array) -> SpragueGeers | NotRateable:
    """M = sqrt(I_ss / I_mm) - 1, P = arccos(I_ms / sqrt(I_mm I_ss)) / pi, with I_ab the time integral of a b.

    `weight` (n,) s of the integral. Source: Sprague and Geers, Commun. Numer. Meth. Engng 20 (2004) 467-492.
    """
    mm, ss, ms = (
        float(weight @ (a * b)) for a, b in ((measured, measured), (simulated, simulated), (measured, simulated))
    )
    if mm == 0.0:
        return NotRateable(reason="the measured signal is zero throughout, so that no error can be taken over it")
    if ss == 0.0:
        return NotRateable(reason="the simulated signal is zero throughout: it has no phase")
    magnitude = float(np.sqrt(ss / mm)) - 1.0
    phase = float(np.arccos(np.clip(ms / np.sqrt(mm * ss), -1.0, 1.0))) / np.pi
    return SpragueGeers(magnitude=magnitude, phase=phase, combined=float(np.hypot(magnitude, phase)))


def iso18571(
    time: Array, measured: Array, simulated: Array, *, least_rate: float = 0.0, most: int = MOST_SAMPLES
) -> Iso18571 | NotRateable:
    """Rate by ISO/TS 18571 over the longest stretch without a gap, on a uniform grid of 10 kHz (or less: `rate`).

    `time` (n,) s; `measured` is the reference. Both must have been through the same filter; `least_rate` Hz is what
    it admits: a stretch so long that it would have to be rated below is not rated. `most` is the most samples.
    """
    first, last = _longest(np.isfinite(measured) & np.isfinite(simulated), time)
    count = last - first
    if count < 2:
        return NotRateable(reason="no overlap: there is no stretch where both are known")
    start, end = float(time[first]), float(time[last - 1])
    if end - start < SHORTEST:
        return NotRateable(
            reason=f"too short: {1e3 * (end - start):.3g} ms without a gap; {1e3 * SHORTEST:g} ms are needed"
        )
    if count < FEWEST:
        own = (count - 1) / (end - start)
        return NotRateable(
            reason=f"sampled too slowly: {count} samples in {end - start:.3g} s ({own:.3g} Hz); {FEWEST} are needed"
        )
    n = min(round((end - start) * RATE) + 1, most)
    if (n - 1) / (end - start) < least_rate:
        longest = (most - 1) / least_rate
        return NotRateable(
            reason=f"too long: {end - start:.4g} s; at the {least_rate:g} Hz that its filter class needs, "
            f"{longest:.3g} s can be rated at once"
        )
    grid = np.linspace(start, end, n)
    m, s = (np.interp(grid, time[first:last], values[first:last]) for values in (measured, simulated))
    if _constant(m):
        return NotRateable(reason=f"the measured signal is constant, {m[0]:.6g} throughout")
    if _constant(s):
        return NotRateable(reason=f"the simulated signal is constant, {s[0]:.6g} throughout: it has no phase")
    step = (end - start) / (n - 1)
    shift = best_shift(m, s)
    scores = {
        "corridor": corridor(m, s),
        "phase": max(0.0, 1.0 - abs(shift) / (MOST_SHIFT * n)),
    }
    m, s = (m[: n - shift], s[shift:]) if shift >= 0 else (m[-shift:], s[: n + shift])
    scores["magnitude"] = magnitude(m, s)
    scores["slope"] = slope(m, s, step)
    overall = sum(WEIGHTS[name] * score for name, score in scores.items())
    return Iso18571(
        overall=overall,
        **scores,
        grade=grade(overall),
        shift=shift * step,
        rate=1.0 / step,
        start=start,
        end=end,
    )


def grade(overall: float) -> str:
    """In words: above 0.94 excellent, above 0.80 good, above 0.58 fair, else poor (recalled)."""
    return next((name for limit, name in GRADES if overall > limit), "poor")


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """The worst of several measures of a pair of signals: how good, and by which measure."""

    grade: Literal["good", "fair", "poor"]
    measure: str

    @property
    def in_words(self) -> str:
        """``fair: peak error``; good by all measures is just that."""
        return self.grade if self.grade == "good" else f"{self.grade}: {self.measure}"


def verdict(rating: Rating) -> Verdict:
    """The worst of the ISO/TS 18571 rating, the error of the peak and the residual beyond noise and tolerance.

    Good is what the standard calls good or excellent. A peak's relative error e, less what noise may do to it, is
    graded by the standard's own score of a magnitude error, 1 - e/0.5: fair beyond 10 %, poor beyond 21 %. The RMS of
    the residual is fair beyond sqrt((2 sigma)^2 + (0.05 s)^2), poor beyond the same with 0.21: noise sigma with the
    coverage factor 2, s the RMS of the measured signal about where it began, 5 % the standard's inner corridor.
    """
    noise = rating.rms / rating.over_noise if rating.over_noise else 0.0
    found = [_by_residual(rating, noise)]
    if isinstance(rating.iso18571, Iso18571):
        found.append(Verdict(grade=_coarse(rating.iso18571.overall), measure="ISO/TS 18571"))
    if rating.peak.relative_error is not None:
        beyond = max(0.0, abs(rating.peak.relative_error) - COVERAGE * noise / abs(rating.peak.measured))
        found.append(Verdict(grade=_coarse(1.0 - beyond / MAGNITUDE_LIMIT), measure="peak error"))
    return max(found, key=lambda v: BY_BADNESS.index(v.grade))


def worst_verdict(verdicts: Sequence[Verdict]) -> Verdict:
    """The worst of at least one."""
    return max(verdicts, key=lambda v: BY_BADNESS.index(v.grade))


def _by_residual(rating: Rating, noise: float) -> Verdict:
    poor = MAGNITUDE_LIMIT * (1.0 - GRADES[-1][0])  # 21 %: the magnitude error at which the standard's score is poor
    beyond = [share for share in (INNER, poor) if rating.rms > math.hypot(COVERAGE * noise, share * rating.deviation)]
    return Verdict(
        grade=BY_BADNESS[len(beyond)], measure=f"residual, RMS beyond noise and {100.0 * INNER:g} % tolerance"
    )


def _coarse(score: float) -> Literal["good", "fair", "poor"]:
    name = grade(score)
    return "good" if name in ("excellent", "good") else "fair" if name == "fair" else "poor"


def corridor(measured: Array, simulated: Array) -> float:
    """Z: mean over the samples of ((b - d)/(b - a))^2, 1 within the inner and 0 outside the outer corridor."""
    largest = float(np.max(np.abs(measured)))
    a, b = INNER * largest, OUTER * largest
    away = np.abs(measured - simulated)
    return float(np.mean(np.where(away < a, 1.0, np.where(away > b, 0.0, ((b - away) / (b - a)) ** POWER))))


def best_shift(measured: Array, simulated: Array) -> int:
    """Samples by which the simulated signal comes late (> 0) at the largest correlation; of equals, the smallest.

    All shifts are screened by sums over fast transforms; those within rounding of the best are then worked out
    exactly, in the standard's order: none, then earlier before later, growing.
    """
    n = measured.size
    shifts = np.array([0, *(sign * k for k in range(1, int(MOST_SHIFT * n) + 1) for sign in (1, -1))])
    shifts = shifts[np.abs(shifts) < n - 1]
    rough = _correlations(measured, simulated, shifts)
    best, most = 0, -np.inf
    for shift in shifts[rough >= np.max(rough) - 1e-9]:
        k = int(shift)
        pair = (measured[: n - k], simulated[k:]) if k >= 0 else (measured[-k:], simulated[: n + k])
        if _constant(pair[0]) or _constant(pair[1]):
            continue
        now = float(np.corrcoef(*pair)[0, 1])
        if now > most + ROUNDING:
            best, most = k, now
    return best


def magnitude(measured: Array, simulated: Array) -> float:
    """E_M: one-norm of the difference after a time warp within 10 % of the length, over that of the reference."""
    from dtaidistance import dtw  # its one home; imported when something is rated

    window = int(np.ceil(WARP_WINDOW * measured.size))
    path = np.asarray(
        dtw.warping_path_fast(
            np.ascontiguousarray(simulated),
            np.ascontiguousarray(measured),
            window=window,
            inner_dist="squared euclidean",
        )
    )
    warped, reference = simulated[path[:, 0]], measured[path[:, 1]]
    error = float(np.sum(np.abs(warped - reference)) / np.sum(np.abs(reference)))
    return max(0.0, 1.0 - error / MAGNITUDE_LIMIT)


def slope(measured: Array, simulated: Array, step: float) -> float:
    """E_S: one-norm of the difference of the slopes, averaged over 9 samples, over that of the reference."""
    m, s = _mean_slope(measured, step), _mean_slope(simulated, step)
    size = float(np.sum(np.abs(m)))
    if size == 0.0:
        return 0.0
    return max(0.0, 1.0 - float(np.sum(np.abs(s - m))) / size / SLOPE_LIMIT)


def _mean_slope(values: Array, step: float) -> Array:
    """Central differences, averaged over 9 samples, and over 1, 3, 5, 7 towards the ends."""
    raw = np.gradient(values, step)
    found = np.zeros_like(raw)
    for k in range(SLOPE_SPAN // 2):
        found[k], found[-1 - k] = np.mean(raw[: 2 * k + 1]), np.mean(raw[raw.size - 2 * k - 1 :])
    found[SLOPE_SPAN // 2 : -(SLOPE_SPAN // 2)] = np.convolve(raw, np.full(SLOPE_SPAN, 1.0 / SLOPE_SPAN), mode="valid")
    return found


def _correlations(a: Array, b: Array, shifts: NDArray[np.int64]) -> Array:
    """Correlation coefficients of a[i] with b[i + shift], (number of shifts,)."""
    from scipy.fft import irfft, next_fast_len, rfft

    n = a.size
    a, b = a - a.mean(), b - b.mean()
    size = next_fast_len(2 * n)
    products = irfft(np.conj(rfft(a, size)) * rfft(b, size), size)[shifts % size]
    sums = [np.concatenate(([0.0], np.cumsum(v))) for v in (a, a * a, b, b * b)]
    late, early = np.maximum(shifts, 0), np.maximum(-shifts, 0)
    length = n - np.abs(shifts)
    a1, a2 = (s[n - late] - s[early] for s in sums[:2])
    b1, b2 = (s[n - early] - s[late] for s in sums[2:])
    spread = (a2 - a1**2 / length) * (b2 - b1**2 / length)
    tiny = 1e-20 * max(float(sums[1][-1] * sums[3][-1]), 1e-300)
    return np.asarray(np.where(spread > tiny, (products - a1 * b1 / length) / np.sqrt(np.maximum(spread, tiny)), -1.0))


def _constant(values: Array) -> bool:
    return bool(np.ptp(values) <= 1e-12 * max(float(np.max(np.abs(values))), 1e-300))


def _longest(known: NDArray[np.bool_], time: Array) -> tuple[int, int]:
    """First and one past the last index of the stretch of known samples that takes longest."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], known.astype(np.int8), [0]))))
    starts, ends = edges[::2], edges[1::2]
    if starts.size == 0:
        return 0, 0
    k = int(np.argmax(time[ends - 1] - time[starts]))
    return int(starts[k]), int(ends[k])


def _weights(time: Array, known: NDArray[np.bool_]) -> Array:
    """Weights of the trapezoidal rule at the known samples, s; nothing is bridged over a gap."""
    width = np.where(known[1:] & known[:-1], np.diff(time), 0.0)
    weight = np.zeros(time.size)
    weight[1:] += 0.5 * width
    weight[:-1] += 0.5 * width
    return np.asarray(weight[known])
