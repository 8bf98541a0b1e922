"""Ratings: against closed forms, against an independent implementation, and what cannot be rated."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rollover.comparison.rating import (
    Iso18571,
    NotRateable,
    Rating,
    Verdict,
    best_shift,
    grade,
    iso18571,
    rate,
    verdict,
    worst_verdict,
)

N = 801
TIME = np.arange(N) * 1e-4  # 80 ms at 10 kHz: what the standard asks for


def pulse(centre: float, width: float, height: float) -> np.ndarray:
    return height * np.exp(-(((TIME - centre) / width) ** 2))


def random_pair(seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    made = np.zeros((2, N))
    for _ in range(3):
        centre, width, height = rng.uniform(0.01, 0.07), rng.uniform(0.003, 0.02), rng.normal(scale=1000.0)
        made[0] += pulse(centre, width, height)
        made[1] += pulse(centre + rng.normal(scale=0.002), width, height * rng.uniform(0.7, 1.3))
    return made[0], made[1] + rng.normal(scale=10.0, size=N)


@pytest.mark.parametrize("seed", range(12))
def test_iso18571_agrees_with_an_independent_implementation(seed: int) -> None:
    oracle = pytest.importorskip(
        "objective_rating_metrics.rating", reason="the outside rating is not installed: dependency group `oracle`"
    )
    measured, simulated = random_pair(seed)
    if seed == 0:
        simulated = -measured  # where nothing is alike
    if seed == 1:
        simulated = measured.copy()
    other = oracle.ISO18571(np.column_stack([TIME, measured]), np.column_stack([TIME, simulated]))
    ours = iso18571(TIME, measured, simulated)
    assert isinstance(ours, Iso18571)
    assert ours.corridor == pytest.approx(other.corridor_rating(-1), abs=1e-9)
    assert ours.phase == pytest.approx(other.phase_rating(-1), abs=1e-9)
    assert ours.magnitude == pytest.approx(other.magnitude_rating(-1), abs=1e-9)
    assert ours.slope == pytest.approx(other.slope_rating(-1), abs=1e-9)
    assert ours.overall == pytest.approx(other.overall_rating(-1), abs=1e-9)


def test_a_signal_against_itself_is_excellent() -> None:
    found = iso18571(TIME, pulse(0.04, 0.01, 5.0), pulse(0.04, 0.01, 5.0))
    assert isinstance(found, Iso18571)
    assert (found.overall, found.shift, found.grade) == (1.0, 0.0, "excellent")


def test_corridor_of_a_constant_difference() -> None:
    """With |m - s| = d, c = 0.2, of the peak: Z = ((0.5 - 0.2)/(0.5 - 0.05))^2 = 4/9."""
    measured = pulse(0.04, 0.01, 1.0)
    found = iso18571(TIME, measured, measured + 0.2)
    assert isinstance(found, Iso18571)
    assert found.corridor == pytest.approx(4.0 / 9.0, rel=1e-6)
    assert found.slope == pytest.approx(1.0)


def test_a_late_signal_loses_phase_only() -> None:
    """40 of 801 samples late: E_P = 1 - 40/(0.2 x 801); after the shift nothing differs."""
    found = iso18571(TIME, pulse(0.040, 0.005, 1.0), pulse(0.044, 0.005, 1.0))
    assert isinstance(found, Iso18571)
    assert found.shift == pytest.approx(0.004)
    assert found.phase == pytest.approx(1.0 - 40.0 / (0.2 * N))
    assert found.magnitude == pytest.approx(1.0, abs=1e-6)
    early = iso18571(TIME, pulse(0.044, 0.005, 1.0), pulse(0.040, 0.005, 1.0))
    assert isinstance(early, Iso18571)
    assert early.shift == pytest.approx(-0.004)


def test_of_equal_correlations_the_smallest_shift_is_taken() -> None:
    """A sine shifted by a quarter period fits again after every whole period."""
    period = 40
    x = np.sin(2.0 * np.pi * np.arange(N) / period)
    assert best_shift(x, np.roll(x, 10)) == 10


@pytest.mark.parametrize(
    ("overall", "word"), [(0.95, "excellent"), (0.94, "good"), (0.81, "good"), (0.6, "fair"), (0.58, "poor")]
)
def test_grades(overall: float, word: str) -> None:
    assert grade(overall) == word


def test_sprague_geers_of_a_larger_and_of_a_shifted_sine() -> None:
    """s = 1.2 m gives M = 0.2, P = 0; a sine shifted by 0.1 pi over whole periods gives M = 0, P = 0.1."""
    t = np.linspace(0.0, 1.0, 5001)
    m = np.sin(10.0 * np.pi * t)
    larger = rate(t, m, 1.2 * m)
    assert isinstance(larger, Rating)
    assert larger.sprague_geers.magnitude == pytest.approx(0.2)  # type: ignore[union-attr]
    assert larger.sprague_geers.phase == pytest.approx(0.0, abs=1e-6)  # type: ignore[union-attr]
    shifted = rate(t, m, np.sin(10.0 * np.pi * t - 0.1 * np.pi))
    assert isinstance(shifted, Rating)
    assert shifted.sprague_geers.magnitude == pytest.approx(0.0, abs=1e-6)  # type: ignore[union-attr]
    assert shifted.sprague_geers.combined == pytest.approx(0.1, abs=1e-6)  # type: ignore[union-attr]


def test_residual_peak_and_integral_of_a_half_sine() -> None:
    """m = A sin(pi t/T): peak A at T/2, integral 2 A T/pi; s = 0.9 m: rms = 0.1 A/sqrt(2), range A."""
    A, T = 3500.0, 0.2
    t = np.linspace(0.0, T, 2001)
    m = A * np.sin(np.pi * t / T)
    found = rate(t, m, 0.9 * m, noise=35.0)
    assert isinstance(found, Rating)
    assert found.peak.measured == pytest.approx(A)
    assert found.peak.relative_error == pytest.approx(-0.1)
    assert found.peak.measured_time == pytest.approx(T / 2)
    assert found.peak.time_error == 0.0
    assert found.integral_measured == pytest.approx(2.0 * A * T / math.pi, rel=1e-6)
    assert found.integral_simulated == pytest.approx(0.9 * 2.0 * A * T / math.pi, rel=1e-6)
    assert found.nrmse == pytest.approx(0.1 / math.sqrt(2.0), rel=1e-3)
    assert found.over_noise == pytest.approx(10.0 / math.sqrt(2.0), rel=1e-3)


def test_a_gap_is_not_bridged() -> None:
    """A constant 2 over 1 s with 0.4 s missing integrates to 1.2, and the longest stretch is rated."""
    t = np.linspace(0.0, 1.0, 1001)
    m = 2.0 + 0.0 * t
    m[300:701] = np.nan
    found = rate(t, m, m)
    assert isinstance(found, Rating)
    assert found.integral_measured == pytest.approx(2.0 * (0.299 + 0.299), rel=1e-9)
    wave = np.sin(20.0 * t)
    wave[300:501] = np.nan
    rated = iso18571(t, wave, np.nan_to_num(wave))
    assert isinstance(rated, Iso18571)
    assert (rated.start, rated.end) == (pytest.approx(0.501), pytest.approx(1.0))


SINE = np.sin(300.0 * TIME)


@pytest.mark.parametrize(
    ("time", "measured", "simulated", "why"),
    [
        (TIME, 0.0 * SINE, SINE, "measured signal is constant"),
        (TIME, 0.1 + 0.0 * SINE, SINE, "measured signal is constant"),
        (TIME, SINE, 7.0 + 0.0 * SINE, "simulated signal is constant"),
        (TIME[:50], SINE[:50], SINE[:50], "too short"),
        (TIME * 100.0, np.where(np.arange(N) < 15, SINE, np.nan), SINE, "sampled too slowly"),
        (TIME, np.where(np.arange(N) < 400, SINE, np.nan), np.where(np.arange(N) < 400, np.nan, SINE), "no overlap"),
    ],
)
def test_what_cannot_be_rated_says_why(time: np.ndarray, measured: np.ndarray, simulated: np.ndarray, why: str) -> None:
    found = iso18571(time, measured, simulated)
    assert isinstance(found, NotRateable)
    assert why in found.reason


def test_nothing_in_common_is_not_rateable_at_all() -> None:
    found = rate(TIME, np.full(N, np.nan), SINE)
    assert isinstance(found, NotRateable)
    assert "no overlap" in found.reason
    silent = rate(TIME, 0.0 * SINE, SINE)
    assert isinstance(silent, Rating)
    assert isinstance(silent.sprague_geers, NotRateable)
    assert silent.nrmse is None
    assert silent.peak.relative_error is None


def test_a_stretch_too_long_for_its_filter_class_is_not_rated() -> None:
    """CFC 60 needs 600 Hz; 10 000 samples of that are 16.7 s."""
    t = np.arange(20_001) * 1e-3
    found = iso18571(t, np.sin(t), np.sin(t), least_rate=600.0)
    assert isinstance(found, NotRateable)
    assert "16.7 s" in found.reason


def test_a_long_stretch_is_rated_at_a_lower_rate_that_is_stated() -> None:
    """10 s at 10 kHz would need 20 GB for the warp; 10 000 samples over it are 1 kHz."""
    t = np.arange(100_001) * 1e-4
    m = np.sin(3.0 * t) * np.exp(-0.2 * t)
    found = iso18571(t, m, 0.97 * m)
    assert isinstance(found, Iso18571)
    assert found.rate == pytest.approx(999.9)
    # |m - s| = 0.03 |m| is inside the inner corridor throughout; after the warp at most 3 % remain of 50 %
    assert found.corridor == 1.0
    assert 1.0 - 0.03 / 0.5 <= found.magnitude <= 1.0


def judged(scale: float, sigma: float, *, bias: float = 0.0, peak: float = 0.0) -> Verdict:
    """Verdict of a half-sine that is scaled, shifted by a bias and has a peak added, under noise of 1 sigma."""
    t = np.arange(0.0, 0.2, 1e-4)
    pulse = np.where(t < 0.1, np.sin(np.pi * t / 0.1), 0.0) * 1e4
    measured = pulse + np.random.default_rng(4).normal(0.0, sigma, t.size)
    simulated = scale * pulse + bias + peak * np.exp(-(((t - 0.05) / 1e-3) ** 2))
    found = rate(t, measured, simulated, noise=sigma)
    assert isinstance(found, Rating)
    return verdict(found)


def test_the_verdict_is_that_of_the_worst_measure() -> None:
    assert judged(1.0, 20.0).grade == "good"
    assert judged(1.0, 800.0).grade == "good", "noise alone is no misfit"
    # 4 % of magnitude is inside the 5 % tolerance however quiet the sensor; 8 % is not, though the standard says good
    assert judged(1.04, 5.0).grade == "good"
    fair = judged(1.08, 5.0)
    assert (fair.grade, fair.measure[:8]) == ("fair", "residual")
    assert judged(1.0, 5.0, peak=1500.0).in_words == "fair: peak error"
    assert judged(1.0, 5.0, peak=3000.0).in_words == "poor: peak error"
    assert judged(0.5, 5.0).grade == "poor"


def test_a_good_rating_far_above_the_noise_is_not_green() -> None:
    t = np.arange(0.0, 0.2, 1e-4)
    measured = 1e4 * np.where(t < 0.1, np.sin(np.pi * t / 0.1), 0.0)
    found = rate(t, measured, np.roll(measured, 20), noise=9.0)  # 2 ms late
    assert isinstance(found, Rating)
    assert isinstance(found.iso18571, Iso18571)
    assert found.iso18571.grade in ("good", "excellent")
    assert found.over_noise is not None
    assert found.over_noise > 20.0
    assert verdict(found).grade == "fair"


def test_the_worst_of_several_verdicts_is_told() -> None:
    good, fair = Verdict(grade="good", measure="ISO/TS 18571"), Verdict(grade="fair", measure="peak error")
    assert worst_verdict([good, fair, good]) is fair
